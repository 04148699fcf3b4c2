r"""Levenberg-Marquardt: nonlinear least squares by damped Gauss-Newton steps.

.. math:: dx = -V \, \mathrm{diag}\frac{s}{s^2 + \lambda} \, U^T r, \qquad J = U \, \mathrm{diag}(s) \, V^T

with geodesic acceleration [Transtrum & Sethna, arXiv:1201.5885], which halves the number
of steps in the curved valleys of relaxation spectra. A pair of pure functions, `init` and
`step`, that jit and vmap go through. One singular value decomposition of the Jacobian
serves two dampings, which are tried side by side: residuals cost a small part of the
Jacobian, and the better of them is taken. Directions that the data do not see (s = 0) are
left where they are.
"""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitting.solvers.losses import factors
from fitting.solvers.problem import cost_at, data_rows, residuals, residuals_and_jacobian, rounding_cost
from fitting.solvers.status import CONVERGED, NOT_FINITE, PERFECT, RUNNING, STALLED

TRIALS = (0.1, 3.0)  # times the damping of the last step
SOFTEST, STIFFEST = 1e-30, 1e9  # damping over the largest singular value squared
PROBE = 0.1  # part of a step at which its curvature is measured
LONGEST = 3.0  # of a step in any x: a factor 20 in a Positive parameter


class State(NamedTuple):
    """Where a fit stands; a pytree."""

    x: jax.Array
    cost: jax.Array
    status: jax.Array  # of `fitting.solvers.status`
    nfev: jax.Array  # evaluations of the residuals
    njev: jax.Array  # and of their Jacobian
    damping: jax.Array  # lambda / (largest singular value)^2


@dataclasses.dataclass(frozen=True)
class LevenbergMarquardt:
    """The solver; hashable.

    Parameters
    ----------
    tolerance : float
        done when the linear model promises, and the step brings, a lower cost by less than
        this part of it.
    damping : float
        that the first step is made with; less where fits start near their minimum.
    """

    tolerance: float = 1e-9
    damping: float = 1e-3
    max_steps = 200

    def init(self, structure, numbers, targets, x):
        """The state at a start vector x."""
        cost = cost_at(structure, numbers, targets, x)
        status = jnp.where(jnp.isfinite(cost), RUNNING, NOT_FINITE)
        count = jnp.asarray(0)
        return State(x, cost, status, count + 1, count, jnp.asarray(self.damping, x.dtype))

    def step(self, structure, numbers, targets, state):
        """The state after one step; one that is done stays as it is."""
        x, at = state.x, (structure, numbers, targets)
        plain, weights, jacobian = linearised(*at, x)
        rows = plain * weights[0]
        finite = jnp.all(jnp.isfinite(jacobian))
        # LAPACK may not return from a matrix with NaN in it.
        jacobian = jnp.where(finite, jacobian, 0.0)
        U, s, V = jnp.linalg.svd(jacobian, full_matrices=False)
        along = U.T @ rows
        dampings = jnp.clip(state.damping * np.asarray(TRIALS, x.dtype), SOFTEST, STIFFEST)
        # s = 0 throughout: nothing to gain, and no step.
        gains = s / (s**2 + dampings[:, None] * jnp.where(s[0] > 0, s[0], 1.0) ** 2)
        velocities = -(gains * along) @ V
        # exp and the tails of the logit leave the range where the linear model means anything.
        velocities = velocities * _limited(velocities, LONGEST)
        # How the residuals bend along the steps, from their values a little way along.
        ahead = jax.vmap(lambda move: residuals(*at, x + PROBE * move))(velocities)
        bends = 2 / PROBE * (weights[1] * (ahead - plain) / PROBE - velocities @ jacobian.T)
        accelerations = -0.5 * (gains * (bends @ U)) @ V
        # Beyond half the step the expansion means nothing; inf * 0 where the model breaks down.
        half = 0.5 * jnp.max(jnp.abs(velocities), 1, keepdims=True)
        accelerations = jnp.where(jnp.isfinite(accelerations), accelerations, 0.0)
        moves = velocities + accelerations * _limited(accelerations, half)

        costs = jax.vmap(lambda move: cost_at(*at, x + move))(moves)
        costs = jnp.where(jnp.isfinite(costs), costs, jnp.inf)
        best = jnp.argmin(costs)
        cost, accepted = costs[best], costs[best] < state.cost
        # What the linear model promises: all of the cost along the columns of J, but for those so
        # flat that it would take a longer step.
        promised = jnp.sum(jnp.minimum(0.5 * along**2, jnp.abs(along) * s * LONGEST))
        # The second part is the rounding of the cost itself, all there is to gain in float32.
        rounding = rounding_cost(structure, targets)
        little = self.tolerance * state.cost + 0.02 * jnp.sqrt(rounding * state.cost)
        converged = (promised <= little) & (state.cost - jnp.minimum(cost, state.cost) <= little)
        stalled = ~accepted & (state.damping >= STIFFEST)
        perfect = jnp.minimum(cost, state.cost) <= rounding
        status = jnp.select(
            [~finite, perfect, converged, stalled], [NOT_FINITE, PERFECT, CONVERGED, STALLED], RUNNING
        )
        new = State(
            jnp.where(accepted, x + moves[best], x),
            jnp.where(accepted, cost, state.cost),
            status,
            state.nfev + 2 * len(TRIALS),
            state.njev + 1,
            jnp.where(accepted, dampings[best], jnp.minimum(state.damping * 1e4, STIFFEST)),
        )
        running = state.status == RUNNING
        return jax.tree.map(lambda after, before: jnp.where(running, after, before), new, state)


def _limited(moves, longest):
    """Factors <= 1 that keep every element of every move below `longest`."""
    length = jnp.max(jnp.abs(moves), 1, keepdims=True)
    return jnp.minimum(1.0, longest / jnp.where(length > 0, length, 1.0))


def linearised(structure, numbers, targets, x):
    """Residuals at x, their factors and those of the Jacobian's rows as the loss has it, and the Jacobian.

    The last has its factors in it; the residuals do not.
    """
    rows, jacobian = residuals_and_jacobian(structure, numbers, targets, x)
    count = data_rows(structure)
    ones = jnp.ones(rows.size - count, x.dtype)
    weights = [jnp.concatenate([part, ones]) for part in factors(structure.loss, numbers.width, rows[:count])]
    return rows, weights, jacobian * weights[1][:, None] * targets.held
