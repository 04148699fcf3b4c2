r"""Levenberg-Marquardt: nonlinear least squares by damped Gauss-Newton steps.

.. math:: dx = -V \, \mathrm{diag}\frac{s}{s^2 + \lambda} \, U^T r, \qquad J = U \, \mathrm{diag}(s) \, V^T

with geodesic acceleration [Transtrum & Sethna, arXiv:1201.5885], which halves the number
of steps in the curved valleys of relaxation spectra. One singular value decomposition of the
Jacobian serves two dampings. The stiffer is tried where the softer brings less than `SUFFICIENT` of what the
linear model promises, and the better of them is taken: residuals cost a small part of the Jacobian.
Directions that the data do not see (s = 0) are left where they are.
"""

import dataclasses
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from fitting.solvers.iterate import NEGLIGIBLE, Iterate, begin, ended, unless_done
from fitting.solvers.losses import SQUARES, Loss, Objective, Residuals, ResidualsAndJacobian

TRIALS = (0.1, 3.0)  # times the damping of the last step
SOFTEST, STIFFEST = 1e-30, 1e9  # damping over the largest singular value squared
SUFFICIENT = 0.9  # of the promised decrease of the cost, for a step to be taken without another trial
PROBE = 0.1  # part of a step at which its curvature is measured
LONGEST = 3.0  # of a step in any x of a fit: a factor 20 in a Positive parameter


@dataclasses.dataclass(frozen=True)
class LevenbergMarquardt:
    """The solver of fits; hashable.

    Parameters
    ----------
    tolerance : float
        done when the linear model promises, and the step brings, a lower cost by less than
        this part of it.
    damping : float
        that the first step is made with; less where fits start near their minimum.
    """

    title: ClassVar[str] = "Levenberg-Marquardt"
    max_steps: ClassVar[int] = 200

    tolerance: float = 1e-9
    damping: float = 1e-3

    def init(self, objective: Objective, x: jax.Array) -> Iterate:
        """The iterate at a start vector x."""
        return begin(objective.cost(x), x, jnp.asarray(self.damping, x.dtype))

    def step(self, objective: Objective, iterate: Iterate) -> Iterate:
        """The iterate after one step."""
        residuals, both, loss, rounding, _ = objective
        return step(residuals, both, iterate, loss, tolerance=self.tolerance, rounding=rounding)


def step(
    residuals: Residuals,
    residuals_and_jacobian: ResidualsAndJacobian,
    iterate: Iterate,
    loss: Loss = SQUARES,
    *,
    tolerance: float = 1e-9,
    rounding: ArrayLike = 0.0,
    longest: float = LONGEST,
) -> Iterate:
    """One step of least squares, or of robust losses; a pure function, that jit and vmap go through.

    Parameters
    ----------
    residuals : function of x, shape (size,), to residuals, shape (rows,)
    residuals_and_jacobian : function of x to the same and their derivatives, shape (rows, size)
    iterate : of `fitting.solvers.iterate.begin`, its own: lambda / (largest singular value)^2; or of the
        last step. One that is done stays as it is.
    loss : of the residuals
    tolerance : as of `LevenbergMarquardt`
    rounding : cost below which the residuals are met perfectly
    longest : length of a step in any x; beyond, a linear model means nothing

    Returns
    -------
    Iterate
    """
    x = jnp.asarray(iterate.x)
    plan = plan_step(*residuals_and_jacobian(x), iterate, loss, longest)

    def evaluated(state):
        """One evaluation more: ahead along a velocity, and then where the move that it bends to leads."""
        count, moves, rows, _ = state
        i, ahead = count // 2, count % 2 == 0
        move = jnp.where(ahead, PROBE * plan.velocities[i], accelerated_move(plan, i, rows[i]))
        moves, rows = moves.at[i].set(move), rows.at[i].set(residuals(x + move))
        return count + 1, moves, rows, is_sufficient(plan, rows[0], iterate, loss)

    def needed(state):
        count, _, _, enough = state
        return (count < 2) | ((count < 4) & ~enough)

    # A loop, so that the model is compiled once for all of them.
    rows = jnp.zeros((len(TRIALS), *plan.plain.shape), plan.plain.dtype)
    begun = jnp.asarray(0), jnp.zeros_like(plan.velocities), rows, jnp.asarray(False)
    _, moves, rows, _ = jax.lax.while_loop(needed, evaluated, begun)
    return accept_better(
        plan, moves, rows, iterate, loss, tolerance=tolerance, rounding=rounding, longest=longest
    )


class Plan(NamedTuple):
    """What the linear model makes of a step: two of them, one a damping."""

    plain: jax.Array  # residuals, shape (rows,)
    factor: jax.Array  # of the rows of the Jacobian, by the loss
    jacobian: jax.Array  # times it
    U: jax.Array
    s: jax.Array
    V: jax.Array  # transposed
    along: jax.Array  # U^T r
    dampings: jax.Array  # shape (2,)
    gains: jax.Array  # shape (2, size)
    velocities: jax.Array  # shape (2, size)
    finite: jax.Array


def plan_step(
    plain: jax.Array, jacobian: jax.Array, iterate: Iterate, loss: Loss = SQUARES, longest: float = LONGEST
) -> Plan:
    """The first part of a step, from the residuals and their Jacobian."""
    damping, dtype = iterate.own, jnp.asarray(iterate.x).dtype
    of_rows, factor = loss.factors(plain)
    rows, jacobian = plain * of_rows, jacobian * factor[:, None]
    finite = jnp.all(jnp.isfinite(jacobian))
    # LAPACK may not return from a matrix with NaN in it.
    jacobian = jnp.where(finite, jacobian, 0.0)
    U, s, V = jnp.linalg.svd(jacobian, full_matrices=False)
    # Of a number that may not move, whose column is 0, rounding leaves 1e-17 there, and a step 1e-11.
    V = V * jnp.any(jacobian != 0, 0)
    along = U.T @ rows
    dampings = jnp.clip(damping * np.asarray(TRIALS, dtype), SOFTEST, STIFFEST)
    # s = 0 throughout: nothing to gain, and no step.
    gains = s / (s**2 + dampings[:, None] * jnp.where(s[0] > 0, s[0], 1.0) ** 2)
    velocities = -(gains * along) @ V
    # exp and the tails of the logit leave the range where the linear model means anything.
    velocities = velocities * _limited(velocities, longest)
    return Plan(plain, factor, jacobian, U, s, V, along, dampings, gains, velocities, finite)


def accelerated_move(plan: Plan, i: int | jax.Array, ahead: jax.Array) -> jax.Array:
    """The move of damping i, from the residuals at PROBE times its velocity, shape (rows,)."""
    velocity = plan.velocities[i]
    # How the residuals bend along the step, from their values a little way along.
    second = 2 / PROBE * (plan.factor * (ahead - plan.plain) / PROBE - plan.jacobian @ velocity)
    acceleration = -0.5 * (plan.gains[i] * (second @ plan.U)) @ plan.V
    # Beyond half the step the expansion means nothing; inf * 0 where the model breaks down.
    half = 0.5 * jnp.max(jnp.abs(velocity), keepdims=True)
    acceleration = jnp.where(jnp.isfinite(acceleration), acceleration, 0.0)
    return velocity + acceleration * _limited(acceleration, half)


def is_sufficient(plan: Plan, tried: jax.Array, iterate: Iterate, loss: Loss = SQUARES) -> jax.Array:
    """Whether the softer step, which leads to these residuals, makes a trial of the other needless."""
    # (|r|^2 - |r + J v|^2) / 2 for the velocity before it was limited: of one that was, the other damping
    # may make more, and steps would be as short for ever.
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
    longest: float = LONGEST,
) -> Iterate:
    """The iterate after the better of the moves, from the residuals that they lead to, shape (2, rows).

    Where the first `is_sufficient` the second is whatever it is, and was no evaluation.
    """
    x, damping = jnp.asarray(iterate.x), iterate.own
    enough = is_sufficient(plan, tried[0], iterate, loss)
    costs = jax.vmap(loss.cost)(tried)
    known = jnp.isfinite(costs) & jnp.stack([jnp.asarray(True), ~enough])
    costs = jnp.where(known, costs, jnp.inf)
    best = jnp.argmin(costs)
    cost, accepted = costs[best], costs[best] < iterate.cost
    lowest = jnp.minimum(cost, iterate.cost)
    # What the linear model promises: all of the cost along the columns of J, but for those so
    # flat that it would take a longer step.
    promised = jnp.sum(jnp.minimum(0.5 * plan.along**2, jnp.abs(plan.along) * plan.s * longest))
    # The second part is the rounding of the cost itself, all there is to gain in float32.
    little = tolerance * iterate.cost + 0.02 * jnp.sqrt(rounding * iterate.cost)
    done = (promised <= little) & (iterate.cost - lowest <= little)
    # Rounding, and the tolerance to which temperatures are found, may hide the last of the way: shorter steps
    # would not find it either. Data that are met need not end there, their cost falls on to rounding.
    near = promised <= NEGLIGIBLE * jnp.maximum(iterate.cost, 1.0)
    hidden = near & (iterate.cost > 2 * NEGLIGIBLE)
    stalled = ~accepted & (hidden | (damping >= STIFFEST))
    new = Iterate(
        jnp.where(accepted, x + moves[best], x),
        jnp.where(accepted, cost, iterate.cost),
        ended(plan.finite, lowest <= rounding, done, stalled, near),
        iterate.nfev + jnp.where(enough, 2, 4),
        iterate.njev + 1,
        jnp.where(accepted, plan.dampings[best], jnp.minimum(damping * 1e4, STIFFEST)),
    )
    return unless_done(iterate, new)


def _limited(moves, longest):
    """Factors <= 1 that keep every element of every move below `longest`."""
    length = jnp.max(jnp.abs(moves), -1, keepdims=True)
    return jnp.minimum(1.0, longest / jnp.where(length > 0, length, 1.0))
