r"""S inside G: the universal map from the plain G to the corrected G.

The paper has the elastic-energy factor S [Scaraggi & Persson, eq. (14)] in friction and separation only.
If S is also in the diffusion function, as in the commercial program, dG = S(P(G)) dg, where g is the plain G.
G then depends only on g and gamma, not on surfaces and materials. A table over ln g is computed once for a
given gamma, with an error of about 1e-11:

.. math:: g(G) = \int_0^G \frac{dG'}{S(P(G'))}

The integral uses Gauss panels in ln G. Newton's method inverts it at uniform ln g. Between the entries the
table is quintic, with exact first and second derivatives (dG/dg = S). The table contains ln(G/g) instead of
ln G: ln G reaches 60 at light loads, which would cost digits in float32.
"""

import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import erf

from rubberfric.base.quadrature import gauss

# ln g below which P = 1 to the last bit (x > 6).
_LOWEST = math.log(1 / 144)

# ln g above which P < 1e-8, so that G = gamma g + const.
_HIGHEST = math.log(1e16)

# Panels of the integral over ln g.
_PANELS = 60

# Gauss nodes of a panel.
_ORDER = 10

# Entries of the table.
_ENTRIES = 513


class UniformTable(NamedTuple):
    """Function at uniform steps of its argument, quintic between the entries and a straight line beyond."""

    start: jax.Array
    step: jax.Array
    cells: jax.Array  # coefficients in the position within a cell, (6, cells), ascending
    slopes: jax.Array  # at both ends, per cell

    def __call__(self, at: jax.Array) -> jax.Array:
        """Evaluate the table at values of any shape."""
        position = (at - self.start) / self.step
        count = self.cells.shape[1]
        index = jnp.clip(jnp.floor(jax.lax.stop_gradient(position)).astype(int), 0, count - 1)
        # Outside the table, the straight lines below are added.
        t = jnp.clip(position - index, 0.0, 1.0)
        columns = self.cells.at[:, index].get(mode="promise_in_bounds")
        value = functools.reduce(lambda total, column: total * t + column, columns[::-1])
        value = value + jnp.minimum(position, 0.0) * self.slopes[0]
        return value + jnp.maximum(position - count, 0.0) * self.slopes[1]


def correction_table(gamma: jax.Array) -> UniformTable:
    """Return the table of ln(G/g) over ln g, with the corrected G, for one gamma in 0 ... 1."""
    dtype = jnp.result_type(gamma)
    node, weight = (jnp.asarray(x, dtype) for x in gauss(_ORDER))
    edges = jnp.asarray(np.linspace(_LOWEST, _HIGHEST, _PANELS + 1), dtype)
    width = (_HIGHEST - _LOWEST) / _PANELS
    nodes = edges[:-1, None] + width * node
    panels = width * (jnp.exp(nodes) / _energy(nodes, gamma)[0]) @ weight
    # Plain G at the panel borders; S = 1 below the first.
    plain = math.exp(_LOWEST) + jnp.concatenate([jnp.zeros(1, dtype), jnp.cumsum(panels)])
    log_plain = jnp.log(plain)
    # The positions of the entries do not matter. If they depended on gamma, the last one would move by 1e16
    # at gamma = 0, and the derivatives would lose all digits.
    start, end = jax.lax.stop_gradient((log_plain[0], log_plain[-1]))
    step = (end - start) / (_ENTRIES - 1)
    target = start + step * np.arange(_ENTRIES)

    value = jnp.interp(target, log_plain, edges)
    panel = jnp.clip(jnp.searchsorted(edges, value, side="right") - 1, 0, _PANELS - 1)

    def plain_at(value):
        reach = (value - edges[panel])[:, None]
        inner = edges[panel][:, None] + reach * node
        return plain[panel] + (reach * jnp.exp(inner) / _energy(inner, gamma)[0]) @ weight

    # Each step squares the error, which begins at 1e-2, also in the derivatives.
    def improved(_, value):
        here = plain_at(value)
        return value - (jnp.log(here) - target) * _energy(value, gamma)[0] * here / jnp.exp(value)

    value = jax.lax.fori_loop(0, 5, improved, jax.lax.stop_gradient(value))
    return quintic_table(start, step, *_derivatives(value, plain_at(value), gamma))


def correct_argument(table: UniformTable, x: jax.Array) -> jax.Array:
    """Return x = 1 / (2 sqrt(G)) with S in G, given x without S in G.

    `x` may have any shape. x with S and x without S are at most 27.
    """
    return x * jnp.exp(-0.5 * table(-2 * jnp.log(2 * x)))


def quintic_table(
    start: jax.Array, step: jax.Array, f: jax.Array, slope: jax.Array, curvature: jax.Array
) -> UniformTable:
    """Return the table of a function with the given values and derivatives at `start`, `start + step`, ..."""
    d, c = step * slope, step * step * curvature
    rise = f[1:] - f[:-1] - d[:-1] - 0.5 * c[:-1]
    tilt = d[1:] - d[:-1] - c[:-1]
    bend = c[1:] - c[:-1]
    a3 = 10 * rise - 4 * tilt + 0.5 * bend
    a4 = -15 * rise + 7 * tilt - bend
    a5 = 6 * rise - 3 * tilt + 0.5 * bend
    cells = jnp.stack([f[:-1], d[:-1], 0.5 * c[:-1], a3, a4, a5])
    return UniformTable(start, step, cells, d[np.array([0, -1])])


def _energy(log_G, gamma):
    """Return S at ln G, and the derivative dS / d ln G."""
    x = 0.5 * jnp.exp(-0.5 * log_G)
    P = erf(x)
    return gamma + (1 - gamma) * P * P, -2 * (1 - gamma) * P * x * jnp.exp(-x * x) / math.sqrt(math.pi)


def _derivatives(log_G, g, gamma):
    """Return ln(G/g) and its first and second derivatives with respect to ln g."""
    S, dS = _energy(log_G, gamma)
    ratio = jnp.exp(log_G) / g
    slope = S / ratio
    return jnp.log(ratio), slope - 1, slope * (slope * dS / S + 1 - slope)
