"""A fit as a least-squares problem, and its solvers."""
