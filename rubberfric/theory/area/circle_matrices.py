"""Integrals over phi as matrices that act on a modulus.

The modulus depends on q v cos(phi). On an even grid of ln(q cos(phi)), every integral over phi at a
wavevector q is a weighted sum of its values. The weights do not depend on the velocity.
"""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import NumberLike
from rubberfric.base.quadrature import typed

# Step of the trapezoidal rule in t, cos(phi) = 1 / cosh(t), with the error exp(-pi^2 / step) = 6e-13.
_STEP = 0.35

# The rule ends at -ln cos(phi) = _LEAST + 2 ln(largest |E| / smallest |E|). The mean of 1 / |E|^2 may come
# from the share (smallest / largest)^2 of the circle, where cos(phi) is small. Friction has an error of 1e-9.
_LEAST = 13.0

# The largest end of the rule: ratios of moduli up to 6e6 are resolved.
_LONGEST = 45.0

# Smallest step of the grid of ln(q cos(phi)).
_GRID = 0.22

# Number of points of the polynomials that interpolate on the grid.
_POINTS = 16

# The grid has _ENTRIES entries for the angles.
_ENTRIES = 110

# The grid has _PER_PANEL further entries for each panel of the mesh.
_PER_PANEL = 7


class Directions(NamedTuple):
    """Densities over phi relative to their means; a row for each density, shape (rows, angles)."""

    even: jax.Array  # part with g(phi) = g(-phi)
    odd: jax.Array  # part with g(phi) = -g(-phi); without rows if all densities are even


class CircleMatrices(NamedTuple):
    """Weights of integrals over the circle from values on a grid, shape (rows, nodes, grid)."""

    grid: jax.Array  # q cos(phi) [1/m], (grid,)
    mean: jax.Array  # of the mean over phi
    along: jax.Array  # of the integral with the factor cos(phi)
    across: jax.Array  # of the integral with the factor sin(phi)


def circle_matrices(
    log_q: jax.Array,
    panels: int | None,
    detail: float | None,
    log_range: NumberLike = 0.0,
    densities: Callable[[jax.Array], Directions] | None = None,
) -> CircleMatrices:
    """Return a grid of q cos(phi), and weights of integrals over the circle from values on this grid.

    Parameters
    ----------
    log_q : logarithms of the wavevectors of the integrals; the last one is the largest, shape (nodes,)
    panels : panels of the mesh over q; None if the modulus does not depend on the frequency
    detail : width in ln(omega) over which the modulus has kinks; None for smooth moduli
    log_range : ln of the largest over the smallest |E|, without derivatives; it may be traced
        The grid always has the same number of entries, so its step grows with `log_range`.
    densities : function that returns the `Directions` at angles phi between 0 and pi/2; None: the density 1
    """
    if panels is None:  # nothing depends on the frequency
        even, odd = _directions(densities, jnp.zeros(1, log_q.dtype))
        shape = log_q.size, 1
        unity, zero = (jnp.ones((len(x), *shape), log_q.dtype) for x in (even, odd))
        return CircleMatrices(jnp.exp(log_q[-1:]), unity, 0 * unity, 0 * zero)
    finer = 1.0 if detail is None else min(8.0, max(1.0, 2 * _GRID / detail))
    count = round(finer * (_ENTRIES + _PER_PANEL * panels))
    # The density of a stretched surface has poles at sin(Im t) = r or 1/r, so its rule needs smaller steps.
    angular_step = _STEP / (finer if densities is None else 3 * finer)
    t = angular_step * np.arange(int((_LONGEST + math.log(2)) / angular_step))
    dphi = 4 * angular_step / np.cosh(t)
    dphi[0] /= 2
    # The grid moves with q1, so that the error of the interpolation has no derivative.
    top = log_q[-1]
    end = jnp.minimum(_LEAST + 2 * jnp.asarray(log_range, top.dtype), _LONGEST)
    step = jnp.maximum(_GRID / finer, (top - log_q[0] + end) / (count - 2 * _POINTS))
    step, end = jax.lax.stop_gradient((step, end))
    s = jnp.minimum(typed(np.log(np.cosh(t)), top), end)
    to_nodes = _interpolation((top - log_q) / step + _POINTS, count)
    to_angles = _interpolation(s / step + _POINTS, count + _POINTS)
    dphi, cosine, sine = (typed(x, top) for x in (dphi, 1 / np.cosh(t), np.tanh(t)))
    even, odd = _directions(densities, jnp.arctan2(sine, cosine))
    at_zero = jnp.concatenate([dphi / (2 * np.pi) * even, dphi * cosine * even, dphi * sine * odd])
    at_zero = at_zero @ to_angles
    # Entries of the grid, from the high to the low frequencies, relative to the position of the integral.
    later = np.arange(count) - np.arange(count)[:, None] + _POINTS
    matrices = to_nodes @ jnp.where(later >= 0, at_zero[:, np.maximum(later, 0)], 0.0)
    mean, along, across = jnp.split(matrices, [len(even), 2 * len(even)])
    return CircleMatrices(jnp.exp(top + step * (_POINTS - np.arange(count))), mean, along, across)


def _directions(densities, phi):
    unity = jnp.ones((1, phi.size), phi.dtype)
    return Directions(unity, unity[:0]) if densities is None else densities(phi)


def _interpolation(position, count):
    """Return weights of the interpolation to positions from `count` entries with the step 1.

    The result has the shape (positions, count).
    """
    before = jnp.floor(position)
    powers = (position - before - 0.5)[:, None] ** typed(np.arange(_POINTS), position)
    weights = powers @ typed(_polynomials(), position)
    which = np.arange(count) - before.astype(int)[:, None] + _POINTS // 2 - 1
    inside = (which >= 0) & (which < _POINTS)
    return jnp.where(inside, jnp.take_along_axis(weights, jnp.clip(which, 0, _POINTS - 1), 1), 0.0)


@functools.cache
def _polynomials():
    """Return the coefficients of the Lagrange polynomials around the middle of the points.

    The coefficients are ordered by ascending powers. Each column is a polynomial.
    """
    points = np.arange(_POINTS) - (_POINTS - 1) / 2
    others = [(x, np.delete(points, i)) for i, x in enumerate(points)]
    return np.stack([np.poly(rest)[::-1] / np.prod(x - rest) for x, rest in others], 1)
