r"""Objective and state of a fit: losses of the residuals, iterates, and the ways in which a fit can end.

The cost is half the sum of rho(r^2), of squares of residuals or of a robust loss:

============  =============================  =====================================
loss          rho(z), z = (r / width)^2      influence of an outlier
============  =============================  =====================================
"linear"      z                              grows without bound (least squares)
"huber"       z; 2 sqrt z - 1 beyond z = 1   constant
"soft_l1"     2 (sqrt(1 + z) - 1)            constant
"cauchy"      ln(1 + z)                      falls off like 1 / r
============  =============================  =====================================

Residuals and `width` are in units of the standard errors. rho is scaled by width^2, so that small residuals
count as in least squares.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.variables import Array

Scalar = jax.Array | float

# Losses, and the width at which the estimate from Gaussian data is 95 % efficient.
LOSS_WIDTHS = {"linear": 1.0, "huber": 1.345, "soft_l1": 1.287, "cauchy": 2.385}


def rho(loss: str, width: Scalar, residual: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Return rho of every residual, and the first and second derivatives of rho with respect to r^2."""
    z = (residual / width) ** 2
    if loss == "linear":
        return residual**2, jnp.ones_like(z), jnp.zeros_like(z)
    if loss == "huber":
        beyond = z > 1
        root = jnp.sqrt(jnp.where(beyond, z, 1.0))
        value = jnp.where(beyond, 2 * root - 1, z)
        return width**2 * value, 1 / root, jnp.where(beyond, -0.5 / root**3, 0.0) / width**2
    if loss == "soft_l1":
        root = jnp.sqrt(1 + z)
        # sqrt(1 + z) - 1 without cancellation: a perfect fit has cost 0 to all digits.
        return width**2 * 2 * z / (1 + root), 1 / root, -0.5 / root**3 / width**2
    return width**2 * jnp.log1p(z), 1 / (1 + z), -1 / (1 + z) ** 2 / width**2


def factors(loss: str, width: Scalar, residual: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return factors of the residuals and of the Jacobian rows for a Gauss-Newton step with a robust loss.

    The gradient is exact. The curvature rho' + 2 r^2 rho'' is kept positive as in Triggs et al. (Bundle
    adjustment, 2000, sec. 4.3), so that the step goes downhill.
    """
    _, first, second = rho(loss, width, residual)
    # A tenth of rho' at least: beyond it an outlier's curvature turns negative.
    curvature = jnp.sqrt(jnp.maximum(first + 2 * residual**2 * second, 0.1 * first))
    return first / curvature, curvature


def normal_means(loss: str, width: float) -> tuple[float, float]:
    """Return the means of psi^2 and of the curvature over a standard normal distribution of the residual.

    psi = r rho' is half the derivative of rho. The curvature is the one of `factors`.
    """
    residual = np.linspace(-10, 10, 8001)
    weight = np.exp(-(residual**2) / 2) / math.sqrt(2 * math.pi) * (residual[1] - residual[0])
    of_rows, of_jacobian = (np.asarray(part, float) for part in factors(loss, width, jnp.asarray(residual)))
    psi = residual * of_rows * of_jacobian
    return float(weight @ psi**2), float(weight @ of_jacobian**2)


class Loss(NamedTuple):
    """Loss of residuals. The first `rows` residuals are of data, and all others enter as squares."""

    kind: str = "linear"
    width: Scalar = 1.0
    rows: int = 0

    def cost(self, residuals: jax.Array) -> jax.Array:
        """Return half the sum of rho over the data rows, plus half the sum of squares of the other rows."""
        robust = rho(self.kind, self.width, residuals[: self.rows])[0]
        return 0.5 * (jnp.sum(robust) + jnp.sum(residuals[self.rows :] ** 2))

    def factors(self, residuals: jax.Array) -> list[jax.Array]:
        """Return `factors` for the data rows, with factors of 1 for the other rows."""
        ones = jnp.ones(residuals.size - self.rows, residuals.dtype)
        robust = factors(self.kind, self.width, residuals[: self.rows])
        return [jnp.concatenate([part, ones]) for part in robust]


SQUARES = Loss()


class Objective(NamedTuple):
    """Cost of a fit for first-order solvers, where x has the shape (size,)."""

    cost: Callable[[jax.Array], jax.Array]
    rounding: jax.Array  # cost due to rounding; smaller costs have no meaning
    moving: Array  # shape (size,), 0 for fixed elements of x, else 1


# Status of a fit.
RUNNING, CONVERGED, PERFECT, STALLED, OUT_OF_STEPS, NOT_FINITE, INTERRUPTED, PRECISE, UNMOVED = range(9)

# Negligible gain in cost, absolute for costs up to 1 and relative for larger ones. A parameter that is off by
# a hundredth of its standard error costs this much.
NEGLIGIBLE = 5e-5

MESSAGES = {
    RUNNING: "still running",
    CONVERGED: "converged: further steps change the cost by less than the tolerance",
    PERFECT: "converged: the data are met to rounding",
    STALLED: "stalled: no small step lowers the cost; the model may not be smooth here",
    OUT_OF_STEPS: "not converged: out of steps; raise max_steps",
    NOT_FINITE: "failed: the model is not finite at the start; check the start values",
    PRECISE: "converged: no small step lowers the cost by more than the precision of the model",
    UNMOVED: "not converged: no free parameter changes the data here, as where the contact is full at every"
    " point; start elsewhere, or try starts=8",
    INTERRUPTED: "interrupted: these are the best values so far",
}


class Iterate(NamedTuple):
    """State of a fit, as a pytree."""

    x: Array  # best so far
    cost: Array
    status: Array  # RUNNING, CONVERGED, ...
    nfev: Array  # number of evaluations of the residuals, or of the cost
    njev: Array  # number of evaluations of the Jacobian, or of the gradient
    own: Any  # arrays of the solver


def negligible(cost: float | np.ndarray) -> np.ndarray:
    """Return the largest negligible difference from a cost."""
    return NEGLIGIBLE * np.maximum(1.0, cost)


def unless_done(before: Iterate, after: Iterate) -> Iterate:
    """Return `after`, the iterate after a step, or `before` if the fit has already ended."""
    running = before.status == RUNNING
    return jax.tree.map(lambda new, old: jnp.where(running, new, old), after, before)


def status_after(
    finite: Array, perfect: Array, converged: Array, stalled: Array | bool = False, near: Array | bool = False
) -> jax.Array:
    """Return the status after a step.

    `near` is True if further steps can bring only a negligible gain. A fit that stalls there has converged.
    """
    stalled, near = jnp.asarray(stalled), jnp.asarray(near)
    ends = [NOT_FINITE, PERFECT, CONVERGED, PRECISE, STALLED]
    return jnp.select([~finite, perfect, converged, stalled & near, stalled], ends, RUNNING)


def succeeded(status: np.ndarray | int) -> np.ndarray:
    """Return True for the status of a fit that ended at a minimum."""
    return np.isin(status, (CONVERGED, PERFECT, PRECISE))


def was_interrupted(status: np.ndarray | int) -> np.ndarray:
    """Return True for the status of a fit that an interrupt ended, or kept from its first evaluation."""
    return np.isin(status, (INTERRUPTED, RUNNING))
