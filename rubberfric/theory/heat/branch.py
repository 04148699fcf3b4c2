r"""Branches of fixed points y = F(y; v), followed in ln v and past their folds.

If several solutions exist at a velocity, the result is the one that sliding reaches when the velocity changes
slowly from a range with a single solution. The branch is followed from that range. Past a fold, the result is
the state to which

.. math:: \frac{dy}{dt} \propto F(y; v) - y

leads. F' has one real eigenvalue sigma that may be large; its other eigenvalues are small. A secant along the
residual estimates sigma, and every step along the residual is divided by 1 - sigma,

.. math:: y \leftarrow y + \frac{r}{1-\sigma},\qquad r = F(y) - y,\qquad
          1 - \sigma = -\frac{\Delta r\cdot\Delta y}{\Delta y\cdot\Delta y},\qquad \sigma < 1

Because 1 - sigma > 0, the division never reverses a step. Steps therefore lead to stable solutions and away
from unstable ones. Steps in ln v grow and shrink with the number of evaluations that they take. A large
change at the shortest step is a jump.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

# Largest last step on the way [K]. The way need not be accurate, only close to the branch.
_NEAR = 0.03
# Largest first step after a prediction [K]. After a larger one, the step in ln v is shortened.
_FAR = 0.7
# Largest step of the rises [K]. Longer ones might leave the branch.
_LARGEST_MOVE = 2.0
# Shortest step in ln v. A large change at this step is a jump.
_SHORTEST = 0.03
# Longest step in ln v, which is also the first one.
_LONGEST = 3.0
# Number of evaluations at one velocity after which the step in ln v is shortened.
_PATIENCE = 6
# Sign changes of the residual at one velocity after which steps no longer lengthen.
_CIRCLING = 4
# Lower bound of sigma. Steps are at least the residual divided by 41.
_LOWEST_SIGMA = -40.0
# Upper bound of sigma. Steps are at most five times the residual.
_HIGHEST_SIGMA = 0.8
# Upper bound of sigma where the residual is small. Close to folds sigma is nearly 1.
_HIGHEST_AT_FOLDS = 0.98
# Residual [K] below which the upper bound for folds holds. A step is then at most 0.5 K.
_SMALL_RESIDUAL = 0.01
# Most evaluations on the way of a branch. Rows that need more count as not arrived.
_MOST_EVALUATIONS = 500


class BranchPoint(NamedTuple):
    """Positions on branches. Each row is one position."""

    log_v: jax.Array  # (rows,)
    rises: jax.Array  # (rows, n)
    slope: jax.Array  # d rises / d ln v, (rows, n)
    step: jax.Array  # next step in ln v, >= 0, (rows,)
    sigma: jax.Array  # the eigenvalue, (rows,)


class _Trial(NamedTuple):
    """Iterate for the solution at the next velocity of a branch."""

    log_v: jax.Array
    rises: jax.Array
    count: jax.Array  # evaluations made at this velocity
    before: jax.Array  # previous iterate and residual
    residual: jax.Array
    sigma: jax.Array
    turns: jax.Array  # number of sign changes of the residual


def begin_at(log_v: jax.Array, start: jax.Array) -> BranchPoint:
    """Return a `BranchPoint` with given ln v and temperature rises in each row."""
    zero = jnp.zeros_like(log_v)
    return BranchPoint(log_v, start, jnp.zeros_like(start), zero + _LONGEST, zero)


def path(
    residual: Callable[[jax.Array, jax.Array], jax.Array],
    begin: BranchPoint,
    targets: jax.Array,
    direction: int,
) -> BranchPoint:
    """Follow one branch, and return the last position before each target.

    The steps along the branch do not depend on the targets, so the result for one target does not depend on
    the other targets.

    Parameters
    ----------
    residual : function of (ln v, rises), shapes (1,) and (1, n), to F - y of shape (1, n)
    begin : BranchPoint of one row
    targets : ln v, shape (targets,)
    direction : 1 towards higher velocities, -1 towards lower

    Returns
    -------
    BranchPoint with one row for each target
    """
    count = targets.shape[0]
    reached = jax.tree.map(lambda x: jnp.repeat(x, count, 0), begin)
    # The branch of a target before the begin starts at the target.
    early = direction * (targets - begin.log_v) < 0
    reached = reached._replace(log_v=jnp.where(early, targets, reached.log_v))

    def beyond(place):
        return direction * (place.log_v - targets) > 0

    def step(progress):
        k, place, trial, reached = progress
        place, trial, _ = _evaluated(residual, place, trial, direction * jnp.inf, _NEAR, begin.log_v)
        reached = jax.tree.map(
            lambda new, old: jnp.where(_column(beyond(place), old), old, new), place, reached
        )
        return k + 1, place, trial, reached

    def going(progress):
        return (progress[0] < _MOST_EVALUATIONS) & ~jnp.all(beyond(progress[1]))

    return jax.lax.while_loop(going, step, (0, begin, _first(begin, begin.log_v), reached))[-1]


def arrive(
    residual: Callable[[jax.Array, jax.Array], jax.Array],
    places: BranchPoint,
    targets: jax.Array,
    tolerance: float,
) -> tuple[jax.Array, jax.Array]:
    """Follow branches from given positions to the targets, and return the temperature rises at the targets.

    Parameters
    ----------
    residual : function of (ln v, rises), shapes (rows,) and (rows, n), to F - y of shape (rows, n)
    places : BranchPoint of every row
    targets : ln v, shape (rows,)
    tolerance : largest last step at the target [K]. Just beyond a fold steps are small although no solution
        is near.

    Returns
    -------
    (rises, arrived), shapes (rows, n) and (rows,)
    """
    begin = places.log_v
    ready = places._replace(step=jnp.minimum(places.step, jnp.abs(targets - begin)))

    def step(progress):
        k, place, trial, arrived = progress
        new = _evaluated(residual, place, trial, targets, tolerance, begin)
        # A row stops at its own target, so its result does not depend on the other rows.
        place, trial, now = jax.tree.map(
            lambda new, old: jnp.where(_column(arrived, new), old, new), new, (place, trial, arrived)
        )
        return k + 1, place, trial, arrived | now

    def going(progress):
        return (progress[0] < _MOST_EVALUATIONS) & ~jnp.all(progress[-1])

    at = begin + jnp.sign(targets - begin) * ready.step
    progress = 0, ready, _first(ready, at), jnp.zeros(begin.shape, bool)
    _, place, _, arrived = jax.lax.while_loop(going, step, progress)
    return place.rises, arrived


def _first(place, log_v):
    """Return the first trial at `log_v`, with temperature rises extrapolated linearly from `place`."""
    rises = place.rises + place.slope * (log_v - place.log_v)[:, None]
    zero = jnp.zeros_like(rises)
    none = jnp.zeros(log_v.shape, int)
    return _Trial(log_v, rises, none, zero, zero, place.sigma, none)


def _evaluated(residual, place, trial, target, tolerance, begin):
    """Evaluate the residual once, and return (place, trial, there).

    `place` is the new `BranchPoint`, and `trial` is the new `_Trial`. `there` is True where a row has arrived
    at the target of the row.
    """
    r = residual(trial.log_v, trial.rises)
    finite = jnp.all(jnp.isfinite(r), -1)
    r = jnp.where(finite[:, None], r, 0.0)
    move, change = trial.rises - trial.before, r - trial.residual
    length = jnp.sum(move * move, -1)
    secant = 1 + jnp.sum(change * move, -1) / jnp.where(length > 0, length, 1.0)
    highest = jnp.where(jnp.max(jnp.abs(r), -1) < _SMALL_RESIDUAL, _HIGHEST_AT_FOLDS, _HIGHEST_SIGMA)
    # Ignore steps at rounding level.
    learned = (trial.count > 0) & (length > 1e-12)
    sigma = jnp.clip(jnp.where(learned, secant, trial.sigma), _LOWEST_SIGMA, highest)
    turns = trial.turns + ((trial.count > 0) & (jnp.sum(r * trial.residual, -1) < 0))
    # Alternating secants can cycle; keep the smaller eigenvalue estimate.
    sigma = jnp.where(turns >= _CIRCLING, jnp.minimum(sigma, trial.sigma), sigma)
    step = r / (1 - sigma)[:, None]
    size = jnp.max(jnp.abs(step), -1)
    rises = trial.rises + step * jnp.minimum(1.0, _LARGEST_MOVE / jnp.maximum(size, 1e-30))[:, None]
    rises = jnp.where(finite[:, None], rises, 0.5 * (trial.rises + place.rises))

    accepted = finite & (size <= jnp.where(trial.log_v == target, tolerance, _NEAR))
    late = ~finite | ((trial.count == 0) & (size > _FAR)) | (trial.count >= _PATIENCE)
    shortened = ~accepted & late & (place.step > _SHORTEST) & (trial.log_v != begin)
    there = accepted & (trial.log_v == target)

    gone = trial.log_v - place.log_v
    # After a jump the previous slope predicts nothing.
    steady = (gone != 0) & (trial.count < _PATIENCE)
    slope = jnp.where(steady[:, None], (rises - place.rises) / jnp.where(gone != 0, gone, 1.0)[:, None], 0.0)
    factor = jnp.select([trial.count == 0, trial.count == 1, trial.count >= 3], [2.0, 1.4, 0.7], 1.0)
    grown = jnp.clip(place.step * factor, _SHORTEST, _LONGEST)
    arrived = BranchPoint(trial.log_v, rises, slope, grown, sigma)
    retried = place._replace(step=jnp.maximum(place.step / 3, _SHORTEST), sigma=sigma)
    place = jax.tree.map(
        lambda new, again, old: jnp.where(
            _column(accepted, old), new, jnp.where(_column(shortened, old), again, old)
        ),
        arrived,
        retried,
        place,
    )

    left = target - place.log_v
    at = jnp.where(jnp.abs(left) <= place.step, target, place.log_v + jnp.sign(left) * place.step)
    following = _first(place, at)
    again = _Trial(trial.log_v, rises, trial.count + 1, trial.rises, r, sigma, turns)
    moved = (accepted & ~there) | shortened
    trial = jax.tree.map(lambda new, old: jnp.where(_column(moved, old), new, old), following, again)
    return place, trial, there


def _column(rows, like):
    return rows.reshape(rows.shape + (1,) * (like.ndim - rows.ndim))
