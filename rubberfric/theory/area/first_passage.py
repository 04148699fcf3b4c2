r"""Share of the area that has never been pulled off, as finer and finer roughness spreads the stress.

Stresses diffuse from sigma_0, and are absorbed where they reach the detachment stress -sigma_a
[Persson, Eur. Phys. J. E 8, 385 (2002), doi:10.1140/epje/i2002-10025-1]: in units of sigma_0, with
t = G(q) and b = sigma_a / sigma_0,

.. math:: \frac{\partial P}{\partial t} = \frac{\partial^2 P}{\partial s^2},\qquad
          P(s, 0) = \delta(s - 1),\qquad P(-b(t), t) = 0,\qquad A(t) = \int_{-b}^\infty P\,ds

A line through -b(t) that has risen to it with the slope m, and the share of paths that never cross such a
line [Bachelier; Levy], seen from a distance d below the end of it a time D before,

.. math:: u(d, D) = \tfrac12\mathrm{erfc}\frac{-d}{2\sqrt D}
          - \tfrac12 e^{-m (d - m D)}\,\mathrm{erfc}\frac{d - 2 m D}{2\sqrt D}

solve the backward equation and are 1 for all s > -b(t) at the end. So whatever m is,

.. math:: A(t) = u(1 + b(t), t) + \int_0^t dA(\tau)\, u(b(t) - b(\tau), t - \tau)

a Volterra equation of the second kind, whose kernel goes as sqrt(t - tau) at its end and needs no derivative
of b; with m = 0 it is the renewal equation [Fortet, J. Math. Pures Appl. 22 (1943) 177]. It vanishes for a
constant boundary, where the first term is all there is. The steepest line that the boundary never
crosses leaves the least to be subtracted.
"""

import functools
import itertools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import erf
from numpy.polynomial import legendre

from rubberfric.base.quadrature import gauss, legendre_transform, typed

# Parts of a panel before the one that an integral ends in, closer towards the end, where it may still go
# as the square root of the distance; nodes of each part, and of the panel where an integral ends.
_PARTS, _IN_A_PART, _IN_LAST = (0.0, 0.6, 0.9, 0.98, 1.0), 6, 10

_NOTHING = 5.0  # (1 + b) / (2 sqrt t) beyond which nothing is absorbed


class _Rule(NamedTuple):
    """From values at the Gauss nodes of a panel to those at other nodes, and to differences of A there."""

    values: np.ndarray  # (..., nodes, order)
    differences: np.ndarray  # slope times weight, the same shape


def passage(x: jax.Array, square: jax.Array) -> jax.Array:
    """A at the nodes, panel after panel.

    Parameters
    ----------
    x : 1 / (2 sqrt t) at the nodes, falling, (panels, points, order), as of `Contact.x`
    square : b^2 there, of the same shape; where it is negative b = 0
        The square, for it is smooth where b begins.

    Returns
    -------
    array, the same shape

    Limits: where t is below 1e-3 nothing is absorbed, and x may stop at 27.
    """
    before, last = (jax.tree.map(lambda table: typed(table, x), rule) for rule in _rules(x.shape[-1]))
    square = _without_rises(x, square)
    b = root(square)
    t = 0.25 / (x * x)
    # Of the panels before: t and b at the nodes of the rule, (panels, points, nodes).
    earlier, height = (jnp.einsum("kpj,mj->kpm", values, before.values) for values in (t, square))
    height = root(height)
    # Of the panel itself: (panels, points, node, nodes before it).
    own, own_height = (jnp.einsum("kpj,imj->kpim", values, last.values) for values in (t, square))
    own_height = root(own_height)
    panels, order = x.shape[0], x.shape[-1]

    def following(change, k):
        now, here, passed = t[k], b[k], np.arange(panels)[:, None, None, None] < k
        time = jnp.where(passed, now[None, :, :, None] - earlier[:, :, None], 0.0)
        rise = here[None, :, :, None] - height[:, :, None]
        own_time, own_rise = now[..., None] - own[k], here[..., None] - own_height[k]
        slope = jnp.minimum(_least(rise, time, (0, 3)), _least(own_rise, own_time, -1))
        # Any slope will do; before anything is absorbed it would be one of rounding.
        sloped = (slope > 0) & jnp.isfinite(slope) & ((1 + here) * x[k] < _NOTHING)
        slope = jnp.where(sloped, slope, 0.0)
        within = _survival(own_rise, own_time, slope[..., None])
        within = jnp.einsum("pim,imj->pij", within, last.differences)
        kernel = _survival(rise, time, slope[None, :, :, None])
        right = _survival(1 + here, now, slope) + jnp.einsum("lpim,lpm->pi", kernel, change)
        area = jnp.linalg.solve(jnp.eye(order, dtype=x.dtype) - within, right[..., None])[..., 0]
        return change.at[k].set(area @ before.differences.T), area

    nothing = jnp.zeros((panels, x.shape[1], before.values.shape[0]), x.dtype)
    return jax.lax.scan(following, nothing, np.arange(panels))[1]


def _least(rise, time, axes):
    """The least slope of the boundary from any time before to now; infinite if there is none."""
    some = time > 0
    return jnp.min(jnp.where(some, rise / jnp.where(some, time, 1.0), jnp.inf), axes)


def _survival(rise, time, slope):
    """Share of paths that never cross a line which rises by slope times time to its end, `rise` below 0.

    0 where no time passes: between nodes of panels without width, where nothing is absorbed.
    """
    some = time > 0
    root_time = jnp.sqrt(jnp.where(some, time, 1.0))
    c = 0.5 * slope * root_time
    a = 0.5 * rise / root_time - c
    # (1 + erf(a + c)) / 2 - e^(-4 a c) (1 - erf(a - c)) / 2, of which little is left where a is small.
    exponent = a * c
    crossed = jnp.expm1(-4 * jnp.where(exponent > 0, exponent, 0.0))  # below 0 by rounding only
    share = 0.5 * (erf(a + c) + (1 + crossed) * erf(a - c) - crossed)
    return jnp.where(some, share, 0.0)


def root(square: jax.Array) -> jax.Array:
    """The square root of what is positive, else 0; with derivative 0 at 0."""
    positive = square > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1.0)), 0.0)


def _without_rises(x, square):
    """The square of the boundary, held where nothing is absorbed until something is again.

    At most erfc(5) = 1e-12 of all paths are beyond it there. It may have any value above that: rising
    steeply, the kernel would be one, and the equation say that A is A.
    """
    panels, points, order = x.shape

    def in_a_row(values):
        return jnp.moveaxis(values, 1, 0).reshape(points, -1)

    lowest, square = in_a_row(jnp.maximum(_NOTHING / x - 1, 0.0) ** 2), in_a_row(square)
    count = square.shape[1]
    idle = square > lowest
    following = jax.lax.cummin(jnp.where(idle, count - 1, np.arange(count)), axis=1, reverse=True)
    held = jnp.take_along_axis(square, following, 1)
    held = jnp.where(jnp.take_along_axis(idle, following, 1), lowest[:, -1:], held)
    square = jnp.where(idle, jnp.maximum(held, lowest), square)
    return jnp.moveaxis(square.reshape(points, panels, order), 0, 1)


def at_end(values: jax.Array) -> jax.Array:
    """Values at the right border of the last panel, (points,), of those at the nodes."""
    return values[-1] @ typed(_basis(values.shape[-1], np.ones(1))[0], values)


def from_nodes_on(values: jax.Array) -> jax.Array:
    """Integrals from every node to the end, of terms of the whole one at the nodes; same shapes."""
    within = jnp.einsum("kpj,ij->kpi", values, typed(_rest(values.shape[-1]), values))
    panels = jnp.sum(values, -1)
    after = typed(_is_before(values.shape[0]).T, values) @ panels
    return after[..., None] + within


def _is_before(count):
    """Whether panel l lies before panel k, (k, l)."""
    return np.tri(count, k=-1, dtype=bool)


@functools.cache
def _rules(order):
    """Integrals over a whole panel, and over one up to each of its nodes."""
    node, weight = gauss(_IN_A_PART)
    parts = list(itertools.pairwise(_PARTS))
    whole = np.concatenate([low + (high - low) * node for low, high in parts])
    weights = np.concatenate([(high - low) * weight for low, high in parts])
    # Up to z: z (1 - u^2), in which sqrt(z - y) is smooth.
    node, weight = gauss(_IN_LAST)
    up_to = gauss(order)[0][:, None]
    return _rule(order, whole, weights), _rule(order, up_to * (1 - node**2), up_to * 2 * node * weight)


def _rule(order, y, weight):
    return _Rule(_basis(order, y), _basis(order, y, 1) * weight[..., None])


def _basis(order, y, derivative=0):
    """Lagrange polynomials of the Gauss nodes at y, or their derivatives; (*y.shape, order)."""
    polynomials = np.eye(order)
    if derivative:
        polynomials = legendre.legder(polynomials, derivative, scl=2)
    values = np.moveaxis(legendre.legval(2 * y - 1, polynomials), 0, -1)
    return values @ legendre_transform(order)


@functools.cache
def _rest(order):
    """Integrals from every Gauss node to the end of a panel, of terms of the whole one at the nodes."""
    node, weight = gauss(order)
    fine, fine_weight = gauss(order)
    y = node[:, None] + (1 - node[:, None]) * fine
    return np.einsum("imj,m->ij", _basis(order, y), fine_weight) * (1 - node[:, None]) / weight
