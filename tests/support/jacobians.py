"""Residuals of a problem with and without their Jacobian, as functions of x, and rows of priors."""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from fitting import Sum
from fitting.parameters.priors import prior_residuals, prior_size, read_priors
from fitting.parameters.variables import free_parameters, to_scene
from fitting.solvers.residuals import in_errors, rows_and_slopes, rows_of, slopes_in_errors
from rubberfric.scene.scene import cast


def residuals(structure, numbers, targets, x):
    """Return the residuals of data, priors and smoothing at x, in units of the errors."""
    return in_errors(structure, numbers, targets, rows_of(structure, numbers, x))


def residuals_and_jacobian(structure, numbers, targets, x):
    """Return the residuals at x, and the Jacobian of shape (rows, size), 0 for fixed elements of x."""
    rows, slopes = rows_and_slopes(structure, numbers, x)
    return in_errors(structure, numbers, targets, rows), slopes_in_errors(structure, numbers, targets, slopes)


_rows = jax.jit(residuals, static_argnums=0)
_both = jax.jit(residuals_and_jacobian, static_argnums=0)


def functions(problem):
    """Return the residuals, and the residuals with their Jacobian, as compiled functions of x."""
    at = problem.structure, problem.numbers, problem.targets
    return lambda x: _rows(*at, jnp.asarray(x)), lambda x: _both(*at, jnp.asarray(x))


def scipy_minimum(problem, start):
    """Return the result of SciPy's `least_squares` with the loss of the problem."""
    rows, both = functions(problem)
    return least_squares(
        lambda x: np.asarray(rows(x)),
        start,
        lambda x: np.asarray(both(x)[1]),
        loss=problem.structure.loss,
        f_scale=float(problem.numbers.width),
        **{"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-12, "max_nfev": 2000},
    )


def prior_rows(scene, free, prior, shift=0.0):
    """Return the rows of priors at the start values plus a shift of x."""
    scene = cast(scene, np.float64)
    variables, constants, x = free_parameters(scene, free)
    priors = read_priors(scene, variables, constants, prior)
    x = jnp.asarray(x + shift)
    rows = np.asarray(prior_residuals(priors, to_scene(variables, constants, x), x))
    # The row of a Sum is no data, because it is zero within the limits.
    assert rows.shape == (prior_size(priors) + sum(isinstance(one, Sum) for one in prior.values()),)
    return rows
