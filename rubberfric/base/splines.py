"""Splines of degree nine through functions on a uniform grid.

Derivatives up to the eighth are continuous, so difference quotients show no steps between cells.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import Polynomial

from rubberfric.base.quadrature import typed

# Degree of the splines. A higher one is more accurate at the same step, and a look-up takes more products.
_DEGREE = 9
# Number of coefficients on either side of a cell.
BESIDE = _DEGREE // 2
# Number of entries on either side that determine a coefficient. The outermost weight is 4e-11 of the largest.
MARGIN = 16
# Entries before the cell of the lowest position. There is one more, because rounding may place it in the cell
# before.
BEFORE = BESIDE + MARGIN + 1


@functools.cache
def _spline_matrices() -> tuple[np.ndarray, np.ndarray]:
    """Return the weights of entries in a spline coefficient, and the pieces of the B-spline.

    The pieces are polynomials, one in each row.
    """
    # Pieces of the B-spline in t - 1/2, from the recursion over the degree.
    t = Polynomial([0.5, 1.0])
    pieces = [Polynomial([1.0])]
    for degree in range(1, _DEGREE + 1):
        old = [Polynomial([0.0]), *pieces, Polynomial([0.0])]
        pieces = [((t + degree - k) * old[k] + (k + 1 - t) * old[k + 1]) / degree for k in range(degree + 1)]
    polynomials = np.array([piece.coef for piece in pieces])
    # The weights of the interpolating spline do not end. In y = sin^2(phase / 2) of a wave they are the
    # inverse of a polynomial, a power series with a radius of 1.06. Truncation at y^16 has a smaller error
    # than the spline itself for waves of at least four entries.
    y = Polynomial([0.0, 1.0])
    cosines = [Polynomial([1.0]), 1 - 2 * y]
    while len(cosines) <= BESIDE:
        cosines.append(2 * cosines[1] * cosines[-1] - cosines[-2])
    inner = [piece(-0.5) for piece in pieces[BESIDE:-1]]
    through = sum((2 * b * c for b, c in zip(inner[1:], cosines[1:], strict=True)), Polynomial(inner[:1]))
    series = [1.0]
    while len(series) <= MARGIN:
        terms = zip(through.coef[1:], series[::-1], strict=False)
        series.append(-sum(b * c for b, c in terms))
    # y applied to entries, by Horner's scheme.
    weights = np.zeros(2 * MARGIN + 1)
    for c in series[::-1]:
        weights = np.convolve(weights, [-0.25, 0.5, -0.25], "same")
        weights[MARGIN] += c
    return weights, polynomials


def splines(values: jax.Array) -> jax.Array:
    """Return splines through functions on a grid, as one polynomial for each cell.

    Parameters
    ----------
    values : values on the grid, shape (functions, entries)

    Returns
    -------
    array of shape (degree + 1, functions, entries - 2 MARGIN - degree)
        Coefficients of ascending powers of the distance from the middle of the cell. The first cell begins at
        the entry MARGIN + BESIDE.
    """
    weights, polynomials = _spline_matrices()
    functions, count = values.shape
    length = 2 * MARGIN
    blocks = -(-count // length)
    values = jnp.pad(values, ((0, 0), (0, blocks * length - count))).reshape(functions, blocks, length)
    which = np.arange(length)[:, None] - np.arange(2 * length) + 2 * MARGIN
    matrix = np.where((which >= 0) & (which <= 2 * MARGIN), weights[np.clip(which, 0, 2 * MARGIN)], 0.0)
    coefficients = jnp.einsum("fbj,ij->fbi", with_neighbours(values, MARGIN, MARGIN), typed(matrix, values))
    coefficients = coefficients.reshape(functions, -1)[:, MARGIN : count - MARGIN]
    cells = coefficients.shape[1] - _DEGREE
    beside = jnp.stack([coefficients[:, k : k + cells] for k in range(_DEGREE + 1)])
    return jnp.tensordot(typed(polynomials.T, values), beside, 1)


def at(cells: jax.Array, position: jax.Array, functions: jax.Array | None = None) -> jax.Array:
    """Evaluate `splines` at positions, counted in cells from the beginning of the first cell.

    The result has the shape (functions, *position.shape). If `functions` are indices of functions that
    broadcast with the positions, only these functions are evaluated. The result then has the common shape.
    """
    index = jnp.floor(jax.lax.stop_gradient(position))
    t, index = position - index - 0.5, index.astype(int)

    def horner(total, column):
        taken = column.at[which].get(mode="promise_in_bounds", wrap_negative_indices=False)
        return total * t + taken, None

    # A loop over the coefficients, because the look-ups of all coefficients compile several times as long.
    which = (slice(None) if functions is None else functions, index)
    shape = (cells.shape[1], *position.shape)
    if functions is not None:
        shape = jnp.broadcast_shapes(functions.shape, position.shape)
    start = jnp.zeros(shape, cells.dtype)
    return jax.lax.scan(horner, start, cells[::-1])[0]


def with_neighbours(values: jax.Array, before: int, after: int) -> jax.Array:
    """Extend each block by entries of the neighbouring blocks.

    `values` has the shape (functions, blocks, length). Zeros extend the first block on the left and the last
    block on the right.
    """
    length = values.shape[2]
    left = jnp.pad(values[:, :-1, length - before :], ((0, 0), (1, 0), (0, 0)))
    right = jnp.pad(values[:, 1:, :after], ((0, 0), (0, 1), (0, 0)))
    return jnp.concatenate([left, values, right], 2)
