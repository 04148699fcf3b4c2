"""Many fits: thousands as one program, and a few side by side."""
