"""The first zero of a function of one number: by trying, then by secants within a bracket that may fail."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

_MOST_STEPS = 60

# Slope from which on a secant is trusted for the last step without another look.
_STEEP = 0.1


class Near(NamedTuple):
    """About where a zero lies."""

    start: jax.Array
    low: jax.Array  # between these two, likely
    high: jax.Array
    slope: jax.Array  # of the function there, or about that


def first(function: Callable[[jax.Array], jax.Array], top: jax.Array, tried: int) -> Near:
    """About the first zero of a function between 0 and top: even steps are tried until it is passed.

    Parameters
    ----------
    function : of a number, below 0 at 0
    top : end of the range, which is returned if the function is below 0 throughout
    tried : how many places, both ends among them
    """
    step = top / (tried - 1)

    def going(progress):
        k, _, high = progress
        return (k < tried - 1) & (high <= 0) & (top > 0)

    def further(progress):
        k, _, low = progress
        return k + 1, low, function(step * (k + 1))

    begin = function(jnp.zeros_like(top))
    k, low, high = jax.lax.while_loop(going, further, (0, begin, begin))
    none, rise = high <= 0, high - low
    share = jnp.where(rise > 0, -low / jnp.where(rise > 0, rise, 1.0), 0.5)
    slope = jnp.where(rise > 0, rise / jnp.where(step > 0, step, 1.0), 1.0)
    start = step * (k - 1 + jnp.clip(share, 0.0, 1.0))
    start, low, high = (jnp.where(none, top, x) for x in (start, step * (k - 1), step * k))
    return Near(start, low, high, slope)


def zero(
    function: Callable[[jax.Array], jax.Array], near: Near, top: jax.Array
) -> tuple[jax.Array, jax.Array, Near]:
    """Zero of a function between 0 and top, whether it was found, and what is known about it; no derivatives.

    Parameters
    ----------
    function : of a number, below 0 at 0; where it is below 0 at top that is what is returned, as not found
    near : where to begin
    top : end of the range

    Limits: the function is 1e-11 there (float32: 1e-5).
    """
    start, low, high, slope = near
    tolerance = 1e-5 if start.dtype != jnp.float64 else 1e-11
    no = jnp.zeros_like(start, bool)

    def step(progress):
        k, z, low, high, below, above, before, value_before, slope, *_ = progress
        value = function(z)
        here, short = jnp.abs(value) <= tolerance, value < 0
        # Where a bound is no bound the zero is beyond it.
        high = jnp.where(short & (z >= high), top, jnp.where(short, high, z))
        low = jnp.where(~short & (z <= low), 0.0, jnp.where(short, z, low))
        below, above = below | short, above | ~short
        moved = z != before
        slope = jnp.where(moved, (value - value_before) / jnp.where(moved, z - before, 1.0), slope)
        further = z - value / jnp.where(slope > 0, slope, 1.0)
        inside = (slope > 0) & (further > low) & (further < high)
        outside = jnp.where(
            short, jnp.where(above, 0.5 * (z + high), high), jnp.where(below, 0.5 * (low + z), low)
        )
        following = jnp.where(inside, further, outside)
        # A secant leaves the product of the last two errors, times a curvature over the slope.
        there = moved & inside & (slope > _STEEP) & (jnp.abs((further - z) * (z - before)) <= 0.1 * tolerance)
        following = jnp.where(here | (short & (z >= top)), z, following)
        found = here | there
        return k + 1, following, low, high, below, above, z, value, slope, found, found | (short & (z >= top))

    def going(progress):
        return (progress[0] < _MOST_STEPS) & ~progress[-1]

    begin = 0, start, low, high, no, no, start, jnp.zeros_like(start), slope, no, no
    _, z, *_, slope, found, _ = jax.lax.while_loop(going, step, begin)
    return z, found, Near(z, near.low, near.high, slope)
