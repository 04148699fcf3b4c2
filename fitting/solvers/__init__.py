"""A fit as a least-squares problem, and what solves it."""
