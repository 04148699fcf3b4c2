r"""Levenberg-Marquardt: nonlinear least squares by damped Gauss-Newton steps.

.. math:: dx = -V \, \mathrm{diag}\frac{s}{s^2 + \lambda} \, U^T r, \qquad J = U \, \mathrm{diag}(s) \, V^T

with geodesic acceleration [Transtrum & Sethna, arXiv:1201.5885], which halves the number of steps in the
curved valleys of relaxation spectra. One singular value decomposition of the Jacobian serves two dampings.
The larger one is tried if the smaller one brings less than `SUFFICIENT` of the gain that the linear model
predicts, and the better of both is accepted. The second trial costs little, because evaluating the residuals
takes a small part of the time of the Jacobian. Directions that do not change the data (s = 0) stay unchanged.
"""

import dataclasses
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from fitting.solvers.objective import (
    NEGLIGIBLE,
    SQUARES,
    Iterate,
    Loss,
    Objective,
    Residuals,
    ResidualsAndJacobian,
    first_iterate,
    status_after,
    unless_done,
)

TRIALS = (0.1, 3.0)  # times the damping of the last step
SOFTEST, STIFFEST = 1e-30, 1e9  # dampings, divided by the largest singular value squared
SUFFICIENT = 0.9  # part of the predicted decrease of the cost that makes a second trial unnecessary
PROBE = 0.1  # part of a step at which its curvature is measured
LONGEST_STEP = 3.0  # largest change of any x in a step: a factor of 20 for a Positive parameter


@dataclasses.dataclass(frozen=True)
class LevenbergMarquardt:
    """Levenberg-Marquardt solver, the default of fits, hashable.

    Parameters
    ----------
    tolerance : the fit ends when the predicted and the actual relative decrease of the cost are smaller
    damping : damping of the first step, divided by the largest singular value of the Jacobian squared
        A small value saves steps if the fit starts near the minimum.
    """

    title: ClassVar[str] = "Levenberg-Marquardt"
    max_steps: ClassVar[int] = 200

    tolerance: float = 1e-9
    damping: float = 1e-3

    def init(self, objective: Objective, x: jax.Array) -> Iterate:
        """Return the iterate at a start vector x."""
        return first_iterate(objective.cost(x), x, jnp.asarray(self.damping, x.dtype))

    def step(self, objective: Objective, iterate: Iterate) -> Iterate:
        """Return the iterate after one step."""
        residuals, both, loss, rounding, _ = objective
        return step(residuals, both, iterate, loss, tolerance=self.tolerance, rounding=rounding)


# For fits that start near their minimum, as in a bootstrap: a quarter fewer steps than with the damping for
# distant starts.
NEAR_MINIMUM = LevenbergMarquardt(damping=1e-7)


def step(
    residuals: Residuals,
    residuals_and_jacobian: ResidualsAndJacobian,
    iterate: Iterate,
    loss: Loss = SQUARES,
    *,
    tolerance: float = 1e-9,
    rounding: ArrayLike = 0.0,
    longest: float = LONGEST_STEP,
) -> Iterate:
    """Return the iterate after one step for least squares or a robust loss, inside jit and vmap.

    Parameters
    ----------
    residuals, residuals_and_jacobian : functions of x, as in `Objective`
    iterate : the first one with `own` = lambda / (largest singular value)^2, or from the last step
        If the fit has ended, this iterate is returned.
    rounding : cost due to rounding, below which the data are fitted exactly
    longest : largest allowed change of any x, because the linear model fails for larger changes
    """
    x = jnp.asarray(iterate.x)
    plan = plan_step(*residuals_and_jacobian(x), iterate, loss, longest)

    def evaluated(state):
        """Evaluate the residuals after PROBE times a velocity, or, if `count` is odd, after a whole move."""
        count, moves, rows, _ = state
        i, ahead = count // 2, count % 2 == 0
        move = jnp.where(ahead, PROBE * plan.velocities[i], accelerated_move(plan, i, rows[i]))
        moves, rows = moves.at[i].set(move), rows.at[i].set(residuals(x + move))
        return count + 1, moves, rows, is_sufficient(plan, rows[0], iterate, loss)

    def needed(state):
        count, _, _, enough = state
        return (count < 2) | ((count < 4) & ~enough)

    # A loop, so that the model is compiled once for all evaluations.
    rows = jnp.zeros((len(TRIALS), *plan.plain.shape), plan.plain.dtype)
    begun = jnp.asarray(0), jnp.zeros_like(plan.velocities), rows, jnp.asarray(False)
    _, moves, rows, _ = jax.lax.while_loop(needed, evaluated, begun)
    return accept_better(
        plan, moves, rows, iterate, loss, tolerance=tolerance, rounding=rounding, longest=longest
    )


class Plan(NamedTuple):
    """Two trial steps from the linear model of the residuals, one for each damping."""

    plain: jax.Array  # residuals, shape (rows,)
    factor: jax.Array  # factors of the rows of the Jacobian, from the loss
    jacobian: jax.Array  # Jacobian times `factor`
    U: jax.Array
    s: jax.Array
    V: jax.Array  # V^T of the singular value decomposition
    along: jax.Array  # U^T r
    dampings: jax.Array  # shape (2,)
    gains: jax.Array  # shape (2, size)
    velocities: jax.Array  # shape (2, size)
    finite: jax.Array


def plan_step(
    plain: jax.Array,
    jacobian: jax.Array,
    iterate: Iterate,
    loss: Loss = SQUARES,
    longest: float = LONGEST_STEP,
) -> Plan:
    """Plan the two trial steps from the residuals `plain` and the Jacobian."""
    damping, dtype = iterate.own, jnp.asarray(iterate.x).dtype
    of_rows, factor = loss.factors(plain)
    rows, jacobian = plain * of_rows, jacobian * factor[:, None]
    finite = jnp.all(jnp.isfinite(jacobian))
    # LAPACK may not return from a matrix with NaN in it.
    jacobian = jnp.where(finite, jacobian, 0.0)
    U, s, V = jnp.linalg.svd(jacobian, full_matrices=False)
    # Rounding leaves 1e-17 in the column of a fixed parameter, which would move it by 1e-11.
    V = V * jnp.any(jacobian != 0, 0)
    along = U.T @ rows
    dampings = jnp.clip(damping * np.asarray(TRIALS, dtype), SOFTEST, STIFFEST)
    # If all s are 0, there is no gain and no step.
    gains = s / (s**2 + dampings[:, None] * jnp.where(s[0] > 0, s[0], 1.0) ** 2)
    velocities = -(gains * along) @ V
    # The linear model is not valid for large changes of exp or in the tails of the logit.
    velocities = velocities * _limited(velocities, longest)
    return Plan(plain, factor, jacobian, U, s, V, along, dampings, gains, velocities, finite)


def accelerated_move(plan: Plan, i: int | jax.Array, ahead: jax.Array) -> jax.Array:
    """Return the velocity with damping `i` plus the geodesic acceleration.

    `ahead` has the residuals after a move by PROBE times the velocity.
    """
    velocity = plan.velocities[i]
    # Second derivative of the residuals along the step, by a finite difference.
    second = 2 / PROBE * (plan.factor * (ahead - plan.plain) / PROBE - plan.jacobian @ velocity)
    acceleration = -0.5 * (plan.gains[i] * (second @ plan.U)) @ plan.V
    # Longer accelerations are outside the range of the expansion; inf * 0 where the model is not finite.
    half = 0.5 * jnp.max(jnp.abs(velocity), keepdims=True)
    acceleration = jnp.where(jnp.isfinite(acceleration), acceleration, 0.0)
    return velocity + acceleration * _limited(acceleration, half)


def is_sufficient(plan: Plan, tried: jax.Array, iterate: Iterate, loss: Loss = SQUARES) -> jax.Array:
    """Return True if the first trial step, with residuals `tried`, makes the second one unnecessary."""
    # (|r|^2 - |r + J v|^2) / 2 for the velocity before its length was limited. A limited velocity would
    # predict less, so that the other damping is never tried and all steps stay short.
    moved = plan.s * plan.gains[0]
    promised = jnp.sum(moved * (1 - 0.5 * moved) * plan.along**2)
    return jnp.asarray(iterate.cost) - loss.cost(tried) >= SUFFICIENT * promised


def accept_better(
    plan: Plan,
    moves: jax.Array,
    tried: jax.Array,
    iterate: Iterate,
    loss: Loss = SQUARES,
    *,
    tolerance: float = 1e-9,
    rounding: ArrayLike = 0.0,
    longest: float = LONGEST_STEP,
) -> Iterate:
    """Return the iterate after the better one of two moves with the residuals `tried`, shape (2, rows).

    If the first move `is_sufficient`, the second is ignored, because its residuals were not evaluated.
    """
    x, damping = jnp.asarray(iterate.x), iterate.own
    enough = is_sufficient(plan, tried[0], iterate, loss)
    costs = jax.vmap(loss.cost)(tried)
    known = jnp.isfinite(costs) & jnp.stack([jnp.asarray(True), ~enough])
    costs = jnp.where(known, costs, jnp.inf)
    best = jnp.argmin(costs)
    cost, accepted = costs[best], costs[best] < iterate.cost
    lowest = jnp.minimum(cost, iterate.cost)
    # Gain that the linear model predicts: all of the cost along the columns of J, less where a column is so
    # flat that the step would be longer than allowed.
    promised = jnp.sum(jnp.minimum(0.5 * plan.along**2, jnp.abs(plan.along) * plan.s * longest))
    # The second part is the rounding of the cost, which dominates in float32.
    little = tolerance * iterate.cost + 0.02 * jnp.sqrt(rounding * iterate.cost)
    done = (promised <= little) & (iterate.cost - lowest <= little)
    # Rounding, and the tolerance of the temperatures, may hide further gains, also from shorter steps.
    # Fits of exact data continue until the cost is at rounding level.
    near = promised <= NEGLIGIBLE * jnp.maximum(iterate.cost, 1.0)
    hidden = near & (iterate.cost > 2 * NEGLIGIBLE)
    stalled = ~accepted & (hidden | (damping >= STIFFEST))
    new = Iterate(
        jnp.where(accepted, x + moves[best], x),
        jnp.where(accepted, cost, iterate.cost),
        status_after(plan.finite, lowest <= rounding, done, stalled, near),
        iterate.nfev + jnp.where(enough, 2, 4),
        iterate.njev + 1,
        jnp.where(accepted, plan.dampings[best], jnp.minimum(damping * 1e4, STIFFEST)),
    )
    return unless_done(iterate, new)


def _limited(moves, longest):
    """Return a factor <= 1 for each move, so that no element of the product exceeds `longest`."""
    length = jnp.max(jnp.abs(moves), -1, keepdims=True)
    return jnp.minimum(1.0, longest / jnp.where(length > 0, length, 1.0))
