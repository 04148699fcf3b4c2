"""What a process needs before JAX: its version, names that are imported when asked for, compiled programs."""
