"""Iterates of a fit, and the ways in which it can end."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.variables import Array

RUNNING, CONVERGED, PERFECT, STALLED, OUT_OF_STEPS, NOT_FINITE, INTERRUPTED, PRECISE, UNMOVED = range(9)

# Negligible gain in cost, absolute for costs up to 1 and relative for larger ones. A parameter that is off by
# a hundredth of its standard error costs this much.
NEGLIGIBLE = 5e-5

MESSAGES = {
    RUNNING: "still running",
    CONVERGED: "converged: further steps change the cost by less than the tolerance",
    PERFECT: "converged: the data are met to rounding",
    STALLED: "stalled: no step lowers the cost; the model may not be smooth here",
    OUT_OF_STEPS: "not converged: out of steps; raise max_steps",
    NOT_FINITE: "failed: the model is not finite at the start; check the start values",
    PRECISE: "converged: as far as the precision of the model allows, no step lowers the cost",
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


def first_iterate(cost: jax.Array, x: jax.Array, own: Any) -> Iterate:
    """Return the iterate of a fit before the first step.

    `own` is the internal state of the solver.
    """
    status = jnp.where(jnp.isfinite(cost), RUNNING, NOT_FINITE)
    zero = jnp.asarray(0)
    return Iterate(x, cost, status, zero + 1, zero, own)


def unless_done(before: Iterate, after: Iterate) -> Iterate:
    """Return `after`, the iterate after a step, or `before` if the fit has already ended."""
    running = before.status == RUNNING
    return jax.tree.map(lambda new, old: jnp.where(running, new, old), after, before)


def status_after(
    finite: Array,
    perfect: Array,
    converged: Array,
    stalled: Array | bool = False,
    near: Array | bool = False,
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
