"""Residuals of a problem with their Jacobian, as one function of x for other programs."""

from fitting.solvers.residuals import in_errors, rows_and_slopes, slopes_in_errors


def residuals_and_jacobian(structure, numbers, targets, x):
    """Return the residuals at x, and the Jacobian of shape (rows, size), 0 for fixed elements of x."""
    rows, slopes = rows_and_slopes(structure, numbers, x)
    return in_errors(structure, numbers, targets, rows), slopes_in_errors(structure, numbers, targets, slopes)
