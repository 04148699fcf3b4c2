"""The zero of a function of one number by the secant method, within a bracket that may be wrong."""

from collections.abc import Callable

import jax
import jax.numpy as jnp

_MOST_STEPS = 60


def zero(
    function: Callable[[jax.Array], jax.Array],
    start: jax.Array,
    low: jax.Array,
    high: jax.Array,
    slope: jax.Array,
    top: jax.Array,
) -> tuple[jax.Array, jax.Array]:
    """Zero of a rising function between 0 and top, and whether it was found; no derivatives.

    Parameters
    ----------
    function : of a number, below 0 at 0 and not at top
    start : where to begin
    low, high : between which the zero is likely to be
    slope : of the function at the start, or about that
    top : end of the range

    Limits: the function is 1e-11 there (float32: 1e-5).
    """
    tolerance = 1e-5 if start.dtype != jnp.float64 else 1e-11
    no = jnp.zeros_like(start, bool)

    def step(progress):
        k, z, low, high, below, above, before, value_before, slope, _ = progress
        value = function(z)
        found, short = jnp.abs(value) <= tolerance, value < 0
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
        return k + 1, jnp.where(found, z, following), low, high, below, above, z, value, slope, found

    def going(progress):
        return (progress[0] < _MOST_STEPS) & ~progress[-1]

    first = 0, start, low, high, no, no, start, jnp.zeros_like(start), slope, no
    found = jax.lax.while_loop(going, step, first)
    return found[1], found[-1]
