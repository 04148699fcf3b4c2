r"""Zeros of functions of one number, within brackets.

`root` finds a zero in a bracket to rounding and has implicit derivatives of every order,

.. math:: f(x, \theta) = 0,\qquad \frac{dx}{d\theta} = -\frac{\partial f}{\partial\theta} \Big/
          \frac{\partial f}{\partial x}

It chooses between inverse quadratic interpolation and bisection [Chandrupatla, Adv. Eng. Softw. 28, 145
(1997), doi:10.1016/S0965-9978(96)00051-8]. `first` finds a bracket of the smallest zero by even steps, and
`zero` uses secants from a guess of the zero, within a bracket that may fail. `first` and `zero` have no
derivatives.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

# Largest number of evaluations of `root`. Smooth functions need about 10.
_MOST_ROUNDS = 120

# Evaluations after which `root` only bisects, so that a bracket of any function shrinks by 2^-60.
_INTERPOLATED = 60

# Width of a bracket at which `root` ends, in units of the rounding error of x.
_WIDTH = 2.0

# Largest number of secants of `zero`.
_MOST_SECANTS = 60

# Slope above which the last secant is not verified by an evaluation.
_STEEP = 0.1


class _Bracket(NamedTuple):
    """State of the search: a zero lies between `last` and `other`."""

    round: jax.Array
    trial: jax.Array  # x that is evaluated next
    last: jax.Array  # x evaluated last
    other: jax.Array
    before: jax.Array  # x that was removed from the bracket last
    f_last: jax.Array
    f_other: jax.Array
    f_before: jax.Array
    root: jax.Array
    has_zero: jax.Array
    ended: jax.Array


def root(
    function: Callable[[jax.Array], jax.Array], low: jax.Array, high: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """Find a zero of a function between `low` and `high`, for each element of an array.

    Parameters
    ----------
    function : maps an array x of the shape of low and high to an array of the same shape and dtype
        Each element of the result depends on the same element of x only. The function may close over traced
        values, to which the derivatives refer. It may overflow inside the bracket, but its derivatives at
        both ends must be finite, for the derivatives of elements without a zero to be 0.
    low, high : ends of the bracket, of the same dtype, broadcastable; they need not be ordered

    Returns
    -------
    Tuple of x and an array that is True if the function is 0 or changes its sign between the ends. Elsewhere
    x is the end at which the function is smaller, with derivatives 0.

    Limits: the error of x is its rounding error, or 1e-18 of the width of the bracket if that is larger. Use
    the logarithm of a zero whose size is unknown. Of several zeros, one is returned. If the function is 0 at
    `low`, that is `low`. Where the slope at the zero is 0, derivatives are 0.
    """
    low, high = jnp.broadcast_arrays(low, high)

    def solve(function, start):
        bracket = _search(function, start, high)
        # `custom_root` has no tangents of booleans.
        return bracket.root, bracket.has_zero.astype(low.dtype)

    x, as_number = jax.lax.custom_root(function, low, solve, _divided, has_aux=True)
    is_zero = as_number > 0
    return jnp.where(is_zero, x, jax.lax.stop_gradient(x)), is_zero


def _divided(linear, right):
    """Solve slope * y = right, where `linear` multiplies by the slope; 0 if the slope is 0."""
    slope = linear(jnp.ones_like(right))
    return jnp.where(slope != 0, right / jnp.where(slope != 0, slope, 1.0), 0.0)


def _search(function, low, high):
    """Return the last `_Bracket`."""
    precision = jnp.finfo(low.dtype)

    def step(at):
        f = function(at.trial)
        begins, second = at.round == 0, at.round == 1
        # The first evaluation is at `low`, the second at `high`.
        same = (jnp.sign(f) == jnp.sign(at.f_last)) & ~begins
        before, f_before = _where(same, (at.last, at.f_last), (at.other, at.f_other))
        other, f_other = _where(same, (at.other, at.f_other), (at.last, jnp.where(begins, f, at.f_last)))
        last, f_last = at.trial, f
        closest = jnp.where(jnp.abs(f_other) < jnp.abs(f_last), other, last)
        changes = (f_last <= 0) & (f_other >= 0) | (f_last >= 0) & (f_other <= 0)
        has_zero = at.has_zero | ((f == 0) | second & changes)
        # An element keeps its result, which then does not depend on the others.
        root = jnp.where(at.ended, at.root, closest)
        tolerance = _WIDTH * float(precision.eps) * jnp.abs(closest) + float(precision.tiny)
        width = jnp.abs(other - last)
        narrow = (f_last == 0) | (f_other == 0) | (width <= tolerance)
        ended = at.ended | jnp.where(begins, f == 0, narrow | (second & ~changes))
        share = _interpolated(last, other, before, f_last, f_other, f_before)
        share = jnp.where(at.round < _INTERPOLATED, share, 0.5)
        # A trial this far from an end moves the other end across the zero.
        least = jnp.minimum(0.5 * tolerance / jnp.where(width > 0, width, 1.0), 0.5)
        trial = last + jnp.clip(share, least, 1 - least) * (other - last)
        trial = jnp.where(begins, high, trial)
        return _Bracket(
            at.round + 1, trial, last, other, before, f_last, f_other, f_before, root, has_zero, ended
        )

    def going(at):
        return (at.round < _MOST_ROUNDS) & ~jnp.all(at.ended)

    none, no = jnp.zeros_like(low), jnp.zeros(low.shape, bool)
    begin = _Bracket(jnp.zeros((), int), low, low, low, low, none, none, none, low, no, no)
    return jax.lax.while_loop(going, step, begin)


def _interpolated(last, other, before, f_last, f_other, f_before):
    """Return the position of the zero between `last`, 0, and `other`, 1, by inverse quadratic interpolation.

    The position is 0.5 where the three points do not determine a monotonic inverse.
    """
    place, level = (last - other) / (before - other), (f_last - f_other) / (f_before - f_other)
    smooth = (level**2 < place) & ((1 - level) ** 2 < 1 - place)
    reach = (before - last) / (other - last)
    share = (f_last / (f_other - f_last)) * (f_before / (f_other - f_before))
    share = share + reach * (f_last / (f_before - f_last)) * (f_other / (f_before - f_other))
    return jnp.where(smooth & jnp.isfinite(share), share, 0.5)


def _where(condition, first, second):
    return tuple(jnp.where(condition, x, y) for x, y in zip(first, second, strict=True))


class Near(NamedTuple):
    """An initial guess of a zero, and a bracket in which the zero is expected but may not lie."""

    start: jax.Array
    low: jax.Array
    high: jax.Array
    slope: jax.Array  # estimate of the function's slope at the zero


def first(function: Callable[[jax.Array], jax.Array], top: jax.Array, tried: int) -> Near:
    """Bracket the smallest zero of a function between 0 and `top` by even steps.

    Parameters
    ----------
    function : function of one number, whose value at 0 is negative
    top : end of the range, and the guess and both ends if the function is negative at all nodes
    tried : number of nodes, including 0 and `top`
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
    """Find a zero of a function between 0 and `top` by secants within a bracket, without derivatives.

    Parameters
    ----------
    function : function of one number, whose value at 0 is negative
        If the value at `top` is negative too, the result is `top`, marked as not found.
    near : initial guess and bracket
    top : end of the range

    Returns
    -------
    Tuple of the zero, True if it was found (|function| <= 1e-11, float32: 1e-5), and a guess for a similar
    function
    """
    start, low, high, slope = near
    tolerance = 1e-5 if start.dtype != jnp.float64 else 1e-11
    no = jnp.zeros_like(start, bool)

    def step(progress):
        k, z, low, high, below, above, before, value_before, slope, *_ = progress
        value = function(z)
        here, short = jnp.abs(value) <= tolerance, value < 0
        # If the bracket failed, the zero lies beyond its end.
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
        # The error after a secant step is the product of the last two errors, times curvature / slope.
        there = moved & inside & (slope > _STEEP) & (jnp.abs((further - z) * (z - before)) <= 0.1 * tolerance)
        following = jnp.where(here | (short & (z >= top)), z, following)
        converged = here | there
        ended = converged | (short & (z >= top))
        return k + 1, following, low, high, below, above, z, value, slope, converged, ended

    def going(progress):
        return (progress[0] < _MOST_SECANTS) & ~progress[-1]

    begin = 0, start, low, high, no, no, start, jnp.zeros_like(start), slope, no, no
    _, z, *_, slope, converged, _ = jax.lax.while_loop(going, step, begin)
    return z, converged, Near(z, near.low, near.high, slope)
