r"""Fixed points of many independent points at once that hang on one number of each, by a bracket of it.

Of y = (x, w) with y = f(y), w one number that lies between -1 and 1: while w is held, x <- f_x(x, w) settles
by itself, as where every element depends on those before it alone; then the sign of

.. math:: R(w) = f_w(x(w), w) - w,\qquad R(-1) \ge 0 \ge R(1)

says on which side of w the solution is. The next w is that of regula falsi, with half the value of an end
that stays (Illinois) [Dowell & Jarratt, BIT 11 (1971) 168]. Slower than
`rubberfric.base.fixed_points.anderson` where that works, but it ends wherever R is continuous, however steep.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp

_MOST_STEPS = 1000

# What x may still change while w is held, over the tolerance; after so many steps that is its rounding.
_SETTLED, _HELD = 0.1, 40


def bracketed(
    function: Callable[[jax.Array], jax.Array], start: jax.Array, solved: jax.Array, tolerance: float
) -> tuple[jax.Array, jax.Array]:
    """Fixed points of the rows that are not solved yet, and which of all are; no derivatives.

    Parameters
    ----------
    function : from an array of shape (points, n) to one of that shape; rows do not mix; w is the last column
    start : shape (points, n)
    solved : shape (points,); rows that are stay as they are in `start`, and if all are it costs nothing
    tolerance : residual over the largest element of a row at which it ends (float32: 1e-5)

    Returns
    -------
    (y, reached), shapes (points, n) and (points,). A row does not depend on the others.

    Limits: of several solutions it finds one.
    """
    tolerance = tolerance if start.dtype == jnp.float64 else 1e-5
    ones = jnp.ones_like(start[:, -1])

    def step(progress):
        k, y, low, high, side, held, reached = progress
        found, w = function(y), y[:, -1]
        least = tolerance * jnp.max(jnp.abs(y), -1)
        change = jnp.max(jnp.abs(found - y)[:, :-1], -1)
        left = found[:, -1] - w
        (low, at_low), (high, at_high) = low, high
        # Only then is the sign of R known, for R may hang steeply on x.
        settled = (change <= _SETTLED * least) | (held >= _HELD)
        ends = settled & (jnp.maximum(jnp.abs(left), change) <= least)
        above, below = settled & (left > 0), settled & ~(left > 0)
        # An end that stays once more counts half.
        share = jnp.where(side == jnp.sign(left), 0.5, 1.0)
        at_low = jnp.where(above, left, jnp.where(below, share * at_low, at_low))
        at_high = jnp.where(below, left, jnp.where(above, share * at_high, at_high))
        side = jnp.where(settled, jnp.sign(left), side)
        low, high = jnp.where(above, w, low), jnp.where(below, w, high)
        rise = at_low - at_high
        middle = 0.5 * (low + high)
        between = jnp.where(rise > 0, low + (high - low) * at_low / jnp.where(rise > 0, rise, 1.0), middle)
        between = jnp.where((between > low) & (between < high), between, middle)
        following = found.at[:, -1].set(jnp.where(settled, between, w))
        y = jnp.where((reached | ends)[:, None], y, following)
        return k + 1, y, (low, at_low), (high, at_high), side, jnp.where(settled, 0, held + 1), reached | ends

    def going(progress):
        return (progress[0] < _MOST_STEPS) & ~jnp.all(progress[-1])

    progress = 0, start, (-ones, ones), (ones, -ones), 0 * ones, 0 * ones, solved
    _, y, *_, reached = jax.lax.while_loop(going, step, progress)
    return y, reached
