"""Residuals of a problem with and without their Jacobian, as functions of x for other programs."""

from fitting.solvers.residuals import in_errors, rows_and_slopes, rows_of, slopes_in_errors


def residuals(structure, numbers, targets, x):
    """Return the residuals of data, priors and smoothing at x, in units of the errors."""
    return in_errors(structure, numbers, targets, rows_of(structure, numbers, x))


def residuals_and_jacobian(structure, numbers, targets, x):
    """Return the residuals at x, and the Jacobian of shape (rows, size), 0 for fixed elements of x."""
    rows, slopes = rows_and_slopes(structure, numbers, x)
    return in_errors(structure, numbers, targets, rows), slopes_in_errors(structure, numbers, targets, slopes)
