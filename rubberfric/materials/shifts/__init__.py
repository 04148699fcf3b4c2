"""Time-temperature superposition: laws of shift factors, and tables of them."""
