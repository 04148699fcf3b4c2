"""What a fit is used for: the next experiment, and tables for simulations."""
