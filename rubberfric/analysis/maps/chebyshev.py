"""Chebyshev series: nodes, coefficients, how fast they fall, and quick sums of them at many places.

[Trefethen, Approximation Theory and Approximation Practice, SIAM 2013, chapters 2, 3 and 8: coefficients of a
function that is analytic within the ellipse of rho fall like rho^-n.]
"""

import functools

import numpy as np
from numpy.polynomial import chebyshev

# A panel is read off in cells of so few coefficients, the quicker to sum.
CELLS, COEFFICIENTS = 8, 11

# Places at once, which stay in the fast memory of a processor.
_BLOCK = 2**14


@functools.cache
def roots(count: int) -> np.ndarray:
    """Chebyshev nodes of the first kind on (-1, 1), ascending, shape (count,)."""
    return -np.cos(np.pi * (np.arange(count) + 0.5) / count)


@functools.cache
def series(count: int) -> np.ndarray:
    """Matrix from values at the nodes to Chebyshev coefficients, (count, count)."""
    matrix = 2 / count * chebyshev.chebvander(roots(count), count - 1).T
    matrix[0] /= 2
    return matrix


@functools.cache
def to_cells(count: int) -> np.ndarray:
    """Matrix from values at the nodes of a panel to polynomials in its cells, (CELLS * COEFFICIENTS, count).

    The coefficients of a cell are those of powers of the place in it, -1 ... 1, ascending.
    """
    centers = -1 + (2 * np.arange(CELLS) + 1) / CELLS
    at = (centers[:, None] + roots(COEFFICIENTS) / CELLS).reshape(-1)
    values = chebyshev.chebvander(at, count - 1) @ series(count)
    powers = np.zeros((COEFFICIENTS, COEFFICIENTS))
    for k in range(COEFFICIENTS):
        powers[: k + 1, k] = chebyshev.cheb2poly(np.eye(COEFFICIENTS)[k])[: k + 1]
    return (powers @ series(COEFFICIENTS) @ values.reshape(CELLS, COEFFICIENTS, count)).reshape(-1, count)


def last_coefficients(values: np.ndarray) -> np.ndarray:
    """The largest of the last three coefficients over the last axis, of the least value at the nodes.

    Of the largest value where the sign changes; infinite where some of the values, but not all, are 0.
    """
    size = np.abs(values)
    changes = (values.min(-1) < 0) & (values.max(-1) > 0)
    scale = np.where(changes, size.max(-1), size.min(-1))
    last = np.max(np.abs(values @ series(values.shape[-1])[-3:].T), -1)
    without = np.where(size.max(-1) > 0, np.inf, 0.0)
    return np.where(scale > 0, last / np.where(scale > 0, scale, 1.0), without)


def summed(coefficients: np.ndarray, cell: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Polynomials (COEFFICIENTS, cells) of the cells, at a place in a cell; arrays of any shape."""
    found = np.empty(cell.shape)
    values, cells, places = found.reshape(-1), cell.reshape(-1), place.reshape(-1)
    for begin in range(0, values.size, _BLOCK):
        block = slice(begin, begin + _BLOCK)
        value, at = values[block], places[block]
        term = np.empty_like(value)
        # Indices are good: "clip" spares the copy that a check of them takes.
        np.take(coefficients[-1], cells[block], out=value, mode="clip")
        for row in coefficients[-2::-1]:
            np.multiply(value, at, out=value)
            np.take(row, cells[block], out=term, mode="clip")
            np.add(value, term, out=value)
    return found
