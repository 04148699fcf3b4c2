r"""Levenberg-Marquardt: nonlinear least squares by damped Gauss-Newton steps.

.. math:: dx = -V \, \mathrm{diag}\frac{s}{s^2 + \lambda} \, U^T r, \qquad J = U \, \mathrm{diag}(s) \, V^T

One singular value decomposition of the Jacobian serves up to three dampings, from the smallest. A larger one
is tried if no smaller one brings `SUFFICIENT` of the gain that the linear model predicts, and the move with
the lowest cost is accepted. Directions that do not change the data (s = 0) stay unchanged.

Valleys of relaxation spectra are curved, so that a move along dx leaves the valley. Up to `CORRECTIONS`
evaluations per damping bring it back. They solve

.. math:: J^T \left(r(x + m) - r(x) - J \, dx\right) + \lambda (m - dx) = 0

for the move m by Broyden's method, which begins at m = 0 with the Jacobian at x [Kelley, Solving Nonlinear
Equations with Newton's Method, SIAM 2003, section 4.3]. For short moves the first correction is the geodesic
acceleration of Transtrum and Sethna, arXiv:1201.5885. An evaluation of the residuals takes a small part of
the time of the Jacobian.
"""

import dataclasses
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitting.solvers.objective import (
    NEGLIGIBLE,
    SQUARES,
    Iterate,
    Loss,
    status_after,
    unless_done,
)
from rubberfric.base import NumberLike

TRIALS = (0.1, 0.55, 3.0)  # times the damping of the last step
STIFFER = 30.0  # factor of the damping after a step that did not lower the cost
SOFTEST = 1e-30  # smallest damping, divided by the largest singular value squared
STIFFEST = 1e9  # largest damping, divided by the largest singular value squared
SUFFICIENT = 0.5  # part of the predicted decrease of the cost that makes a larger damping unnecessary
GOOD = 0.9  # part of the predicted decrease of the cost that makes a correction unnecessary
CORRECTIONS = 3  # largest number of corrections of a move
SMALL = 1e-3  # size of a correction, relative to the move, below which it is omitted
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

    def own(self, x: np.ndarray) -> np.ndarray:
        """Return the damping of the first step of each fit, as `own` of an `Iterate`. x is (fits, size)."""
        return np.full(len(x), self.damping, x.dtype)


# For fits that start near their minimum, as in a bootstrap: a quarter fewer steps than with the damping for
# distant starts.
NEAR_MINIMUM = LevenbergMarquardt(damping=1e-7)


class Plan(NamedTuple):
    """Linear model of the residuals, and its moves, one for each damping."""

    plain: jax.Array  # residuals, shape (rows,)
    factor: jax.Array  # factors of the rows of the Jacobian, from the loss
    U: jax.Array  # singular value decomposition of the Jacobian times `factor`
    s: jax.Array
    V: jax.Array  # V^T
    along: jax.Array  # U^T r
    dampings: jax.Array  # shape (3,)
    gains: jax.Array  # s / (s^2 + lambda), shape (3, size)
    moves: jax.Array  # dx, shape (3, size)
    finite: jax.Array


class Trial(NamedTuple):
    """A move to evaluate next, and the best move so far."""

    move: jax.Array
    index: jax.Array  # of its damping
    steps: jax.Array  # steps of Broyden's method, whose sum is the move, shape (CORRECTIONS + 1, size)
    count: jax.Array  # number of evaluations with this damping
    best: jax.Array
    cost: jax.Array  # of the best move
    damping: jax.Array  # of the best move
    nfev: jax.Array
    done: jax.Array  # True if no further evaluation is needed


def plan_step(
    plain: jax.Array,
    jacobian: jax.Array,
    iterate: Iterate,
    loss: Loss = SQUARES,
    longest: float = LONGEST_STEP,
) -> Plan:
    """Return the moves of the linear model, given the residuals `plain` and the Jacobian."""
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
    # Gains and moves are 0 if all s are 0.
    gains = s / (s**2 + dampings[:, None] * jnp.where(s[0] > 0, s[0], 1.0) ** 2)
    moves = -(gains * along) @ V
    # The linear model is not valid for large changes of exp or in the tails of the logit.
    moves = moves * _limited(moves, longest)
    return Plan(plain, factor, U, s, V, along, dampings, gains, moves, finite)


def first_trial(plan: Plan) -> Trial:
    """Return the trial before the first evaluation."""
    # Weak types would compile `after_evaluation` twice.
    move, zero = plan.moves[0], jnp.zeros((), int)
    steps = jnp.zeros((CORRECTIONS + 1, move.size), move.dtype).at[0].set(move)
    infinite = jnp.full((), jnp.inf, move.dtype)
    return Trial(move, zero, steps, zero, move, infinite, plan.dampings[0], zero, zero > 0)


def after_evaluation(
    plan: Plan, trial: Trial, ahead: jax.Array, iterate: Iterate, loss: Loss = SQUARES
) -> Trial:
    """Return the next trial, given the residuals `ahead` after the move of `trial`."""
    i, cost = trial.index, loss.cost(ahead)
    lower = cost < trial.cost  # False for NaN
    best, lowest = jnp.where(lower, trial.move, trial.best), jnp.where(lower, cost, trial.cost)
    damping = jnp.where(lower, plan.dampings[i], trial.damping)
    # (|r|^2 - |r + J dx|^2) / 2 for dx before its length was limited. A limited move would predict less,
    # so that the other dampings are never tried and all steps stay short.
    gained = plan.s * plan.gains[i]
    promised = jnp.sum(gained * (1 - 0.5 * gained) * plan.along**2)
    gain = jnp.asarray(iterate.cost) - lowest
    enough = gain >= SUFFICIENT * promised
    correction = _correction(plan, trial, ahead)
    size, length = jnp.max(jnp.abs(correction)), jnp.max(jnp.abs(plan.moves[i]))
    # False if the residuals are not finite, because then the correction is NaN.
    useful = (size > SMALL * length) & ~(gain >= GOOD * promised)
    further = (trial.count < CORRECTIONS) & useful
    last = i == len(TRIALS) - 1
    following = jnp.where(further | last, i, i + 1)
    count = jnp.where(further, trial.count + 1, 0)
    step = jnp.where(further, correction, plan.moves[following])
    move = jnp.where(further, trial.move + correction, step)
    steps = trial.steps.at[count].set(step)
    new = Trial(
        move, following, steps, count, best, lowest, damping, trial.nfev + 1, ~further & (enough | last)
    )
    return jax.tree.map(lambda old, new: jnp.where(trial.done, old, new), trial, new)


def _correction(plan, trial, ahead):
    """Return the next step of Broyden's method, at most half as long as the move of the linear model."""
    i, first = trial.index, plan.moves[trial.index]
    # Left-hand side of the equation for the move, divided by J^T J + lambda.
    error = (plan.factor * (ahead - plan.plain)) @ plan.U - plan.s * (plan.V @ first)
    away = (1 - plan.s * plan.gains[i]) * (plan.V @ (trial.move - first))
    step = -(plan.gains[i] * error + away) @ plan.V
    # Inverse of Broyden's matrix, which is 1 at first, by its steps. Steps after `count` are of other moves.
    count = trial.count
    for k in range(CORRECTIONS):
        before, after = trial.steps[k], trial.steps[k + 1]
        along = (before @ step) / jnp.where(k < count, before @ before, 1.0)
        step = step + jnp.where(k < count, along, 0.0) * after
    newest = trial.steps[count]
    square = newest @ newest
    step = step / (1 - (newest @ step) / jnp.where(square > 0, square, 1.0))
    # The linear model is not valid for longer corrections.
    half = 0.5 * jnp.max(jnp.abs(first), keepdims=True)
    return step * _limited(step, half)


def accept(
    plan: Plan,
    trial: Trial,
    iterate: Iterate,
    *,
    tolerance: float = 1e-9,
    rounding: NumberLike = 0.0,
    longest: float = LONGEST_STEP,
) -> Iterate:
    """Return the iterate after the best move of a trial that is done."""
    x, cost = jnp.asarray(iterate.x), trial.cost
    accepted = cost < iterate.cost
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
    stalled = ~accepted & (hidden | (iterate.own >= STIFFEST))
    new = Iterate(
        jnp.where(accepted, x + trial.best, x),
        jnp.where(accepted, cost, iterate.cost),
        status_after(plan.finite, lowest <= rounding, done, stalled, near),
        iterate.nfev + trial.nfev,
        iterate.njev + 1,
        jnp.where(accepted, trial.damping, jnp.minimum(iterate.own * STIFFER, STIFFEST)),
    )
    return unless_done(iterate, new)


def _limited(moves, longest):
    """Return a factor <= 1 for each move, so that no element of the product exceeds `longest`."""
    length = jnp.max(jnp.abs(moves), -1, keepdims=True)
    return jnp.minimum(1.0, longest / jnp.where(length > 0, length, 1.0))
