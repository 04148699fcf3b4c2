r"""Means over the circle of functions of x = ln omega.

The mean over the circle of f(ln(omega cos(phi))) is a convolution, with s = -ln cos(phi) = ln cosh t

.. math:: \langle f\rangle(x) = \frac{2}{\pi}\int_0^{\pi/2} f(x - s(\varphi))\,d\varphi
          = \frac{2}{\pi}\int_0^\infty f(x - \ln\cosh t)\,\frac{dt}{\cosh t}

If f is known on a grid only, it is interpolated by the local polynomial through `_POINTS` entries. The mean
is then a weighted sum of the entries before x, with weights that depend only on the step (`circle_weights`).
If f can be evaluated anywhere, the trapezoidal rule in t converges faster than any power of the step,
because the integrand is even (`circle_rule`).
"""

import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from rubberfric.base.quadrature import gauss, typed
from rubberfric.base.splines import with_neighbours

# Points of a local polynomial, half of them on either side. With fewer, a grid needs a smaller step.
_POINTS = 20

# Entries after x on which the mean depends, through the polynomial between x and the entry before it.
LEAD = _POINTS // 2 - 1

# Smallest length of a block. Shorter ones take more time than the products that they save.
_BLOCK = 64

# Largest s. The share e^-36 of the circle beyond it is neglected.
_DEPTH = 36.0

# Smallest s at which the weights are sums of a few powers of e^-s. More powers would be needed below.
_FAR = 0.8

# Smallest s at which the weights of harmonics are such sums. Below it, their powers cancel each other.
_FAR_OF_HARMONICS = 1.6


class Weights(NamedTuple):
    """Weights of means over the circle, with one row for each mean.

    The arrays are NumPy arrays, or JAX arrays if `mixed` made them.
    """

    near: np.ndarray | jax.Array  # of f(x - m step), m = -LEAD ... 2 block - 1, (rows, 2 block + LEAD)
    far: np.ndarray | jax.Array  # coefficients of e^-ps, p = parity, parity + 2, ..., from block + 1
    parity: np.ndarray  # 1 or 2

    def mixed(self, shares: jax.Array) -> "Weights":
        """Return weights of the first row plus sums of the other rows times shares.

        `shares` has the shape (rows - 1, sums), and the result has a row for each sum.
        """
        near, far = (rows[0] + shares.T @ rows[1:] for rows in self[:2])
        return Weights(near, far, self.parity)


def depth(step: float) -> int:
    """Return the number of entries before x on which the mean depends."""
    return math.ceil(_DEPTH / step)


@functools.lru_cache(maxsize=64)
def full_weights(step: float, harmonics: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the weights of <f>, of <cos(phi) f> and of the transverse means, each with harmonics.

    The harmonics of <f> and <cos(phi) f> have the additional factor cos(2 m phi). The transverse means are
    <sin(phi) sin(2 m phi) f>. Each array has the shape (1 + harmonics, entries). The entries are the weights
    of f(x - m step), m = -LEAD, 1 - LEAD, ... The first row of the transverse weights is zero.
    """
    count = depth(step)
    node, weight = gauss(24 + harmonics // 2)
    # psi = pi/2 - phi at the entries; near pi/2 it keeps the digits that phi loses.
    psi = np.arcsin(np.exp(-step * np.arange(count + 1)))
    left, right = psi[1:], psi[:-1]
    psi = left[:, None] + (right - left)[:, None] * node
    share = -np.log(np.sin(psi)) / step - np.arange(count)[:, None]
    basis = _lagrange(share) * ((right - left)[:, None] * weight * (2 / np.pi))[..., None]

    def rows(kernels):
        weights = np.zeros((len(kernels), count + _POINTS))
        for row, kernel in zip(weights, kernels, strict=True):
            for point, values in enumerate(np.einsum("co,cop->pc", kernel, basis)):
                row[point : point + count] += values
        weights.setflags(write=False)
        return weights

    even, across = (
        [start * np.ones_like(psi), *(harmonic(m, psi)[i] for m in range(1, harmonics + 1))]
        for i, start in enumerate((1.0, 0.0))
    )
    return rows(even), rows([kernel * np.sin(psi) for kernel in even]), rows(across)


@functools.lru_cache(maxsize=64)
def circle_weights(step: float, harmonics: int) -> tuple[Weights, Weights, Weights]:
    """Return the rows of `full_weights`, with sums of powers in place of the far entries."""
    block, count = lead_in(step, harmonics), depth(step)

    def near_and_far(rows, parity):
        far = [_powers(row[LEAD + block + 1 : count], step, block + 1, parity, harmonics) for row in rows]
        return Weights(rows[:, : 2 * block + LEAD], np.array(far), np.array(parity))

    even, along, across = full_weights(step, harmonics)
    return near_and_far(even, 1), near_and_far(along, 2), near_and_far(across, 2)


def _powers(weights, step, first, parity, harmonics):
    """Fit a sum of powers e^-ps to weights, and return the coefficients.

    The exponents are p = parity, parity + 2, and so on. The first weight belongs to the entry `first`.
    """
    s = step * (first + np.arange(len(weights)))
    y = np.exp(-2 * s)
    # The fit of the weights over their first power treats all powers of y equally. Powers below e^-36 do not
    # count.
    degree = min(14 + harmonics // 3, math.ceil(18 / s[0]))
    fit = Chebyshev.fit(y, weights * np.exp(parity * s), degree, domain=[0, y[0]])
    coefficients = fit.convert(kind=Polynomial, domain=[-1, 1], window=[-1, 1]).coef
    return np.pad(coefficients, (0, degree + 1 - coefficients.size))


def harmonic(m: int, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return cos(2 m phi) and sin(phi) sin(2 m phi) at phi = pi/2 - psi."""
    sign = (-1.0) ** m
    return sign * np.cos(2 * m * psi), -sign * np.sin(2 * m * psi) * np.cos(psi)


def _lagrange(share):
    """Return Lagrange weights of the points -LEAD ... _POINTS - 1 - LEAD at positions 0 <= share <= 1."""
    points = np.arange(_POINTS) - LEAD
    polynomials = np.ones((*share.shape, _POINTS))
    for i, own in enumerate(points):
        for j, other in enumerate(points):
            if i != j:
                polynomials[..., i] *= (share - other) / (own - other)
    return polynomials


def circle_means(
    values: jax.Array, weights: Weights, step: float, begin: np.ndarray, block: int
) -> jax.Array:
    """Return means over the circle of functions that are known on a grid.

    Before the grid and in the first block of the grid, a function is a e^(rx) + b e^((r+2)x) with r from
    `begin`.

    Parameters
    ----------
    values : values on the grid, (functions, entries)
    weights : Weights of arrays (functions, rows, ...)
    step : step of the grid
    begin : r of each function, (functions,)
    block : number of entries of a block, `lead_in` of the weights

    Returns
    -------
    array of shape (functions, rows, entries - block - LEAD), for entries after the first block of the grid
    """
    functions, count = values.shape
    blocks = -(-count // block)
    # For each function, (functions, terms).
    power = weights.parity[:, None] + 2 * np.arange(weights.far.shape[2])
    before = _moments_before(values[:, 0], values[:, block], begin, power, step, block)
    values = jnp.pad(values, ((0, 0), (0, blocks * block - count))).reshape(functions, blocks, block)
    # Entries of the block before: exact.
    i, j = np.arange(block)[:, None], np.arange(2 * block + LEAD)
    which = block + i - j + LEAD
    inside = (which >= 0) & (which < 2 * block + LEAD)
    numpy = np if isinstance(weights.near, np.ndarray) else jnp
    near = numpy.where(inside, weights.near[:, :, np.where(inside, which, 0)], 0.0)
    means = jnp.einsum("fbj,frij->frbi", with_neighbours(values, block, LEAD), typed(near, values))
    # Earlier entries: moments of the blocks.
    rate = step * power[..., None]
    moment = jnp.einsum("fbj,fpj->fpb", values, typed(np.exp(-rate * (block - np.arange(block))), values))
    away = np.arange(blocks)[:, None] - np.arange(blocks) - 1
    passed = np.where(away > 0, np.exp(-rate[..., None] * block * np.maximum(away, 0)), 0.0)
    moment = jnp.einsum("fpbc,fpc->fpb", typed(passed, values), moment)
    moment = moment + before[..., None] * typed(np.exp(-rate * block * np.arange(blocks)), values)
    spread = weights.far[..., None] * np.exp(-rate * np.arange(block))[:, None]
    means = means + jnp.einsum("fpb,frpi->frbi", moment, typed(spread, values))
    return means.reshape(*means.shape[:2], -1)[..., block : count - LEAD]


def lead_in(step: float, harmonics: int) -> int:
    """Return the number of entries of the grid before the first mean, which is the length of a block."""
    return max(_BLOCK, math.ceil((_FAR_OF_HARMONICS if harmonics else _FAR) / step))


def _moments_before(first, second, begin, power, step, block):
    """Return moments of the functions before the grid.

    The functions before the grid follow from `first`, the values at entry 0, and `second`, the values at
    entry `block`.
    """
    begin = typed(begin, first)
    growth = math.exp(2 * step * block)  # a NumPy scalar would widen float32
    upper = (second * jnp.exp(-step * block * begin) - first) / (growth - 1)
    moments = 0.0
    for share, rate in ((first - upper, begin), (upper, begin + 2)):
        ratio = jnp.exp(-step * (rate[:, None] + power))
        moments = moments + share[:, None] * ratio / (1 - ratio)
    return moments


@functools.lru_cache(maxsize=64)
def circle_rule(step: float, growth: float = 15.0) -> tuple[np.ndarray, np.ndarray]:
    """Return (psi, weight) of the trapezoidal rule over t for the mean over the circle.

    The step grows with t as sqrt(1 + (t / growth)^2), because large t contribute less. The results are NumPy
    arrays.
    """
    u = np.arange(0.0, growth * math.asinh(28.0 / growth), step)
    t = growth * np.sinh(u / growth)
    weight = np.cosh(u / growth) / np.cosh(t)
    weight[0] *= 0.5
    # cos(phi) = 1 / cosh t, psi = pi/2 - phi.
    psi = 2 * np.arctan(np.exp(-t))
    psi[0] = 0.5 * np.pi
    rule = psi, weight / weight.sum()
    for array in rule:
        array.setflags(write=False)
    return rule
