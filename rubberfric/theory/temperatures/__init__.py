"""Temperatures of a heated scene: the balance of heat, the branch of its solutions, and the solution."""
