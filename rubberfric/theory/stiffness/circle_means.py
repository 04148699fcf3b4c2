r"""Means over the circle of functions of x = ln omega.

The mean over the circle of f(ln(omega cos(phi))) is a convolution, with s = -ln cos(phi) = ln cosh t

.. math:: \langle f\rangle(x) = \frac{2}{\pi}\int_0^{\pi/2} f(x - s(\varphi))\,d\varphi
          = \frac{2}{\pi}\int_0^\infty f(x - \ln\cosh t)\,\frac{dt}{\cosh t}

On a grid of which f is known at the entries only, f is the local polynomial through `_POINTS` of them: a
weight for each of the entries before x (`circle_weights`), constants of the step. Where f can be had
anywhere, the trapezoidal rule in t converges faster than any power of the step, as the integrand is even
(`circle_rule`).
"""

import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from rubberfric.base.quadrature import gauss, typed
from rubberfric.theory.stiffness.splines import with_neighbours

# Points of a local polynomial, of which as many lie on either side; entries after x that its mean hangs on.
_POINTS = 20
LEAD = _POINTS // 2 - 1

# How far down the circle is followed: e^-36 of it is left out.
_DEPTH = 36.0

# Beyond this s the weights are sums of a few powers of e^-s.
_FAR = 1.6


class Weights(NamedTuple):
    """Weights of means over the circle, a row for each; arrays of NumPy, or of jax where they are mixed."""

    near: np.ndarray | jax.Array  # of f(x - m step), m = -LEAD ... 2 block - 1, (rows, 2 block + LEAD)
    far: np.ndarray | jax.Array  # coefficients of e^-s, e^-2s, ... of the weights from block + 1 on

    def mixed(self, shares: jax.Array) -> "Weights":
        """One row: the first, and the others by their shares."""
        return Weights(*((rows[0] + shares @ rows[1:])[None] for rows in self))


def depth(step: float) -> int:
    """How many entries before x its mean hangs on."""
    return math.ceil(_DEPTH / step)


@functools.lru_cache(maxsize=64)
def circle_weights(step: float, harmonics: int) -> tuple[Weights, Weights, Weights]:
    """Weights of <f> and its harmonics <f cos 2 m phi>, of <cos(phi) f> and its, and those across.

    Those across are <sin(phi) sin(2 m phi) f>, their first row zero.
    """
    count = depth(step)
    node, weight = gauss(24 + harmonics // 2)
    # psi = pi/2 - phi at the entries: far down it has the digits that phi has not.
    psi = np.arcsin(np.exp(-step * np.arange(count + 1)))
    left, right = psi[1:], psi[:-1]
    psi = left[:, None] + (right - left)[:, None] * node
    share = -np.log(np.sin(psi)) / step - np.arange(count)[:, None]
    basis = _lagrange(share) * ((right - left)[:, None] * weight * (2 / np.pi))[..., None]

    def rows(kernels, parity):
        found = np.zeros((len(kernels), count + _POINTS))
        for row, kernel in zip(found, kernels, strict=True):
            for point, values in enumerate(np.einsum("co,cop->pc", kernel, basis)):
                row[point : point + count] += values
        block = lead_in(step)
        far = [_powers(row[LEAD + block + 1 : count], step, block + 1, parity, harmonics) for row in found]
        return Weights(found[:, : 2 * block + LEAD], np.array(far))

    even = [np.ones_like(psi), *(harmonic(m, psi)[0] for m in range(1, harmonics + 1))]
    across = [np.zeros_like(psi), *(harmonic(m, psi)[1] for m in range(1, harmonics + 1))]
    return rows(even, 1), rows([kernel * np.sin(psi) for kernel in even], 2), rows(across, 2)


def _powers(weights, step, first, parity, harmonics):
    """Coefficients of e^-s, e^-2s, ... in the weights of entries from `first` on: every other one."""
    s = step * (first + np.arange(len(weights)))
    y = np.exp(-2 * s)
    terms = 15 + harmonics // 3
    # All powers of y = 0 ... e^-3 weigh alike in the fit of the weights over their first power.
    fit = Chebyshev.fit(y, weights * np.exp(parity * s), terms - 1, domain=[0, y[0]])
    found = np.zeros(2 * terms)
    found[parity - 1 :: 2] = fit.convert(kind=Polynomial, domain=[-1, 1], window=[-1, 1]).coef
    return found


def harmonic(m: int, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """cos(2 m phi), and sin(phi) sin(2 m phi), at phi = pi/2 - psi."""
    sign = (-1.0) ** m
    return sign * np.cos(2 * m * psi), -sign * np.sin(2 * m * psi) * np.cos(psi)


def _lagrange(share):
    """Weights of the points -LEAD ... _POINTS - 1 - LEAD in the polynomial at 0 <= share <= 1."""
    points = np.arange(_POINTS) - LEAD
    found = np.ones((*share.shape, _POINTS))
    for i, own in enumerate(points):
        for j, other in enumerate(points):
            if i != j:
                found[..., i] *= (share - other) / (own - other)
    return found


def circle_means(values: jax.Array, weights: Weights, step: float, begin: np.ndarray) -> jax.Array:
    """Means of functions on a grid, (functions, entries), by rows of weights, (functions, rows, ...).

    Before the grid a function is a e^(rx) + b e^((r+2)x), r of `begin`: in a block more it is so within it.

    Parameters
    ----------
    values : the functions
    weights : for each of them
    step : of the grid
    begin : r of every function, (functions,)

    Returns
    -------
    (functions, rows, entries - lead_in(step) - LEAD): of what lies behind the first block of the grid
    """
    functions, count = values.shape
    block = lead_in(step)
    blocks = -(-count // block)
    before = _moments_before(values[:, 0], values[:, block], begin, weights.far.shape[2], step)
    values = jnp.pad(values, ((0, 0), (0, blocks * block - count))).reshape(functions, blocks, block)
    # What is within the block before, exactly.
    i, j = np.arange(block)[:, None], np.arange(2 * block + LEAD)
    which = block + i - j + LEAD
    inside = (which >= 0) & (which < 2 * block + LEAD)
    numpy = np if isinstance(weights.near, np.ndarray) else jnp
    near = numpy.where(inside, weights.near[:, :, np.where(inside, which, 0)], 0.0)
    found = jnp.einsum("fbj,frij->frbi", with_neighbours(values, block, LEAD), typed(near, values))
    # What is further off, as moments of the blocks.
    power = np.arange(1, weights.far.shape[2] + 1)
    moment = values @ typed(np.exp(-power * step * (block - np.arange(block)[:, None])), values)
    away = np.arange(blocks)[:, None] - np.arange(blocks) - 1
    passed = np.where(away > 0, np.exp(-power[:, None, None] * step * block * np.maximum(away, 0)), 0.0)
    moment = jnp.einsum("pbc,fcp->fbp", typed(passed, values), moment)
    since = np.exp(-power * step * block * np.arange(blocks)[:, None])
    moment = moment + typed(since, values) * before[:, None]
    spread = weights.far[..., None] * np.exp(-power[:, None] * step * np.arange(block))
    found = found + jnp.einsum("fbp,frpi->frbi", moment, typed(spread, values))
    return found.reshape(*found.shape[:2], -1)[..., block : count - LEAD]


def lead_in(step: float) -> int:
    """How many entries before the first mean its grid begins."""
    return math.ceil(_FAR / step)


def _moments_before(first, second, begin, count, step):
    """Moments of what lies before the grid, by its values at the first entry and a block behind it."""
    block, begin = lead_in(step), typed(begin, first)
    growth = math.exp(2 * step * block)  # a NumPy scalar would widen float32
    upper = (second * jnp.exp(-step * block * begin) - first) / (growth - 1)
    found = 0.0
    for share, rate in ((first - upper, begin), (upper, begin + 2)):
        ratio = jnp.exp(-step * (rate[:, None] + np.arange(1, count + 1)))
        found = found + share[:, None] * ratio / (1 - ratio)
    return found


@functools.lru_cache(maxsize=64)
def circle_rule(step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(s, psi, weight) of the trapezoidal rule over t for the mean over the circle, host arrays.

    The step grows with t, as what lies far down the circle counts less.
    """
    growth = 15.0
    u = np.arange(0.0, growth * math.asinh(28.0 / growth), step)
    t = growth * np.sinh(u / growth)
    weight = np.cosh(u / growth) / np.cosh(t)
    weight[0] *= 0.5
    # cos(phi) = 1 / cosh t, psi = pi/2 - phi.
    psi = 2 * np.arctan(np.exp(-t))
    psi[0] = 0.5 * np.pi
    s = np.log(np.cosh(t))
    found = s, psi, weight / weight.sum()
    for one in found:
        one.setflags(write=False)
    return found
