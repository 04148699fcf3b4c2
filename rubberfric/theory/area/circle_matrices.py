"""Integrals over phi as matrices that act on a modulus.

The modulus depends on q v cos(phi). On an even grid of ln(q cos(phi)), every integral over phi at a
wavevector q is a weighted sum of its values. The weights do not depend on the velocity.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import typed

# Step and end of the trapezoidal rule in t, cos(phi) = 1 / cosh(t): errors exp(-pi^2 / step) and exp(-end).
_STEP, _LAST = 0.45, 15.0

# Smallest step of the grid of ln(q cos(phi)), and points of the polynomials that interpolate on it. The grid
# has _ENTRIES entries for the angles and _PER_PANEL for each panel of the mesh.
_GRID, _POINTS, _ENTRIES, _PER_PANEL = 0.22, 16, 110, 7


def circle_matrices(
    log_q: jax.Array, panels: int | None, detail: float | None
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Return a grid of q cos(phi) [1/m], and weights of integrals over the circle from values on this grid.

    Parameters
    ----------
    log_q : logarithms of the wavevectors of the integrals; the last one is the largest, shape (nodes,)
    panels : panels of the mesh over q; None if the modulus does not depend on the frequency
    detail : width in ln(omega) over which the modulus has kinks; None for smooth moduli

    Returns
    -------
    The grid (grid,), the weights of the mean over phi, and the weights of the integral over phi with the
    factor cos(phi), both of the shape (nodes, grid).
    """
    if panels is None:  # nothing depends on the frequency
        one = jnp.ones((log_q.size, 1), log_q.dtype)
        return jnp.exp(log_q[-1:]), one, 0 * one
    finer = 1.0 if detail is None else min(4.0, max(1.0, _GRID / detail))
    count = round(finer * (_ENTRIES + _PER_PANEL * panels))
    t = _STEP / finer * np.arange(int(finer * _LAST / _STEP))
    dphi = 4 * _STEP / finer / np.cosh(t)
    dphi[0] /= 2
    dphi[-1] += 2 * np.pi - dphi.sum()  # the rest of the circle is at rest
    s = np.log(np.cosh(t))
    # The grid moves with q1, so that the error of the interpolation has no derivative.
    top = log_q[-1]
    step = jnp.maximum(_GRID / finer, (top - log_q[0] + float(s[-1])) / (count - 2 * _POINTS))
    step = jax.lax.stop_gradient(step)
    to_nodes = _interpolation((top - log_q) / step + _POINTS, count)
    to_angles = _interpolation(typed(s, top) / step + _POINTS, count + _POINTS)
    at_zero = typed(np.stack([dphi / (2 * np.pi), dphi / np.cosh(t)]), top) @ to_angles
    # Entries of the grid, from the high to the low frequencies, relative to the position of the integral.
    later = np.arange(count) - np.arange(count)[:, None] + _POINTS
    mean, along = to_nodes @ jnp.where(later >= 0, at_zero[:, np.maximum(later, 0)], 0.0)
    return jnp.exp(top + step * (_POINTS - np.arange(count))), mean, along


def _interpolation(position, count):
    """Return weights of the interpolation to positions from `count` entries with the step 1.

    The result has the shape (positions, count).
    """
    before = jnp.floor(position)
    powers = (position - before - 0.5)[:, None] ** np.arange(_POINTS)
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
