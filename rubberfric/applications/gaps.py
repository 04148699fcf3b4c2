r"""Gaps between rough half-spaces at rest: the distribution P(u) of their separation.

The share A of the nominal area is in contact. The other area left contact at wavevectors q with the mean
separation u_1(q) [Yang & Persson, J. Phys.: Condens. Matter 20, 215214 (2008)]. Roughness beyond q, with the
rms height h(q), gives its separations a Gaussian distribution, reflected at contact [Almqvist, Campana,
Prodanov & Persson, J. Mech. Phys. Solids 59, 2355 (2011), doi:10.1016/j.jmps.2011.08.004],

.. math:: P(u) = A\,\delta(u) + \int (-dP)\,\frac{e^{-(u - u_1)^2/2h^2} + e^{-(u + u_1)^2/2h^2}}
          {\sqrt{2\pi}\,h}

Area and u_1 belong to one contact, the one with S in G (`rubberfric.theory.area.corrected_separation`).
At rest g and the integral over U are moments m_n(q) of the roughness, with the relaxed E_r,

.. math:: g = \frac{E_r^2}{8\sigma_0^2} m_2(q),\qquad
          u_1 = \frac{E_r}{4\sigma_0} P\int_q^{q_1} k\,dm_1
          = \frac{E_r}{4\sigma_0} P\Big[k(x_1)\,V(q_1) + \int_{x_1} \frac{dk}{d\ln x} V\,d\ln x\Big],\qquad
          V = m_1(q') - m_1(q)

The variables of all integrals are functions of g, in which even a kink of C(q) is smooth.
"""

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.logarithms import floored_log
from rubberfric.base.quadrature import gauss, typed
from rubberfric.base.roots import root
from rubberfric.roughness.moments import cumulative_moment, safe_root
from rubberfric.roughness.spectra import BrokenPowerLaw, log_ratio
from rubberfric.theory.area.corrected_separation import (
    CLOSEST,
    CorrectedSeparation,
    corrected_loss_factor,
)
from rubberfric.theory.area.partial_contact import (
    TWO_OVER_ROOT_PI,
    contact_argument,
    contact_fraction,
    energy_factor,
)
from rubberfric.theory.contributions import total

# Outer nodes per node of a contact panel.
_OUTER = 12

# Inner nodes per node of a contact panel.
_INNER = 4

# g below which hardly any area has left contact (1 - P = 1e-14).
_FIRST = 0.0085

# Root of x_1 / x in which the inner nodes are spaced.
_ROOT = 5

# Share of the outer interval next to q1 within which nodes crowd towards q1.
_BEND = 0.2

# Smallest ln(q / q0) at which a wavevector is searched.
_NEAREST = 1e-30

# Largest separation over the rms height. The area of the first contacts has separations of kilometres.
_FARTHEST = 1e6


class Gaps(NamedTuple):
    """P(u) of one contact: the area, and the parts that left contact at the outer nodes."""

    area: jax.Array  # A/A0
    share: jax.Array  # of the nominal area, (nodes,)
    mean: jax.Array  # u_1 [m], (nodes,)
    width: jax.Array  # h [m], (nodes,)


class Moments(NamedTuple):
    """Moments of the roughness of both solids up to and beyond t = ln(q / first wavevector)."""

    laws: tuple[BrokenPowerLaw, ...]
    mirrored: tuple[BrokenPowerLaw, ...]  # as functions of 1 / q
    begin: tuple[jax.Array, ...]  # t of the first wavevector of each law
    end: tuple[jax.Array, ...]

    def up_to(self, order: float, t: jax.Array) -> jax.Array:
        """Return the moment of all roughness up to t."""
        parts = zip(self.laws, self.begin, strict=True)
        return total(cumulative_moment(law, order, t - begin) for law, begin in parts)

    def beyond(self, order: float, t: jax.Array | float) -> jax.Array:
        """Return the moment of all roughness beyond t, which keeps all digits up to the last wavevector."""
        parts = zip(self.mirrored, self.end, strict=True)
        return total(cumulative_moment(law, -order, end - t) for law, end in parts)

    def find(self, target: jax.Array) -> jax.Array:
        """Return t up to which the moment of order 2 is `target`."""
        # The logarithm of the moment is nearly linear in the logarithm of t.
        log_target = floored_log(target)

        def miss(log_t):
            return floored_log(self.up_to(2, jnp.exp(log_t))) - log_target

        ends = _NEAREST, jax.lax.stop_gradient(functools.reduce(jnp.maximum, self.end))
        return jnp.exp(root(miss, *(jnp.full_like(target, jnp.log(end)) for end in ends))[0])


def moments_of(laws: Sequence[BrokenPowerLaw]) -> Moments:
    """Return the `Moments` of one or two rough surfaces."""
    first = functools.reduce(jnp.minimum, [law.q[0] for law in laws])
    mirrored = [
        law._replace(q=1 / law.q[::-1], log_value=law.log_value[::-1], exponent=-law.exponent[::-1])
        for law in laws
    ]
    ends = (tuple(log_ratio(law.q[end], first) for law in laws) for end in (0, -1))
    return Moments(tuple(laws), tuple(mirrored), *ends)


def gaps_at_rest(moments: Moments, contact: CorrectedSeparation, stiffness: jax.Array, order: int) -> Gaps:
    """Return the `Gaps` of one contact.

    Parameters
    ----------
    moments : Moments of the roughness
    contact : CorrectedSeparation
    stiffness : E_r / sigma_0, a number
    order : number of nodes of a contact panel; the numbers of nodes used here are multiples of it
    """
    whole, heights = moments.beyond(2, 0.0), moments.beyond(0, 0.0)
    scale = stiffness**2 / 8  # g over m_2
    g_end = scale * whole
    ahead, weight = _outer_nodes(g_end, order)
    slope2, rest = whole * jnp.exp(-ahead), -whole * jnp.expm1(-ahead)
    x = contact_argument(scale * slope2)
    X = contact.corrected(x)
    P = contact_fraction(X)
    # -dP / d ln g, because dG = S dg.
    lost = 0.5 * TWO_OVER_ROOT_PI * jnp.exp(-X * X) * X * energy_factor(P, contact.gamma) * (X / x) ** 2
    inner = _inner_nodes(contact_argument(scale * rest * P**2), order)
    # The first column is the outer node itself. One search compiles in half the time of two.
    ratio = jnp.concatenate([jnp.zeros_like(inner.ratio[:, :1]), inner.ratio], 1)
    t = moments.find(slope2[:, None] + rest[:, None] * ratio ** (2 * _ROOT))
    u1 = 0.25 * stiffness * P * _loss_integral(contact, X, inner, moments.beyond(1, t))
    return Gaps(
        area=contact_fraction(contact.corrected(contact_argument(g_end))),
        share=weight * lost,
        mean=jnp.clip(u1, 0.0, _FARTHEST * safe_root(heights)),
        width=safe_root(moments.beyond(0, t[:, 0])),
    )


def _outer_nodes(g_end, order):
    """Return ln(g_end / g) at the nodes of the outer integral, and their weights in ln g."""
    node, weight = (typed(table, g_end) for table in gauss(_OUTER * order))
    length = jnp.maximum(floored_log(g_end) - math.log(_FIRST), 0.0)
    # Next to q1 the width falls as a square root of g_end - g, which is smooth in the nodes.
    back = node**2 * (1 + _BEND) / (node + _BEND)
    stretch = node * (1 + _BEND) * (node + 2 * _BEND) / (node + _BEND) ** 2
    return length * back, length * stretch * weight


class _Inner(NamedTuple):
    """Nodes of the inner integral at each outer node."""

    x_end: jax.Array  # x_1, of q1, (outer,)
    ratio: jax.Array  # root of x_1 / x, (outer, inner)
    weight: jax.Array  # in ln x, (outer, inner)


def _inner_nodes(x_end, order):
    node, weight = (typed(table, x_end) for table in gauss(_INNER * order))
    # The integrand is smooth in a root of x_1 / x, down to 0; g' - g falls as the square of x_1 / x.
    least = jnp.minimum(x_end / CLOSEST, 1.0)[:, None] ** (1 / _ROOT)
    ratio = least + (1 - least) * node
    return _Inner(x_end, ratio, _ROOT * (1 - least) * weight / ratio)


def _loss_integral(contact, X, inner, m1):
    """Return the integral of k over m_1 beyond each outer node.

    `m1` is the moment beyond the outer node, in the first column, and beyond its inner nodes.
    """
    # No area is lost beyond the closest x.
    near = inner.x_end < CLOSEST
    # The first column is q1. One pass compiles in half the time of two.
    ratio = jnp.concatenate([jnp.ones_like(m1[:, :1]), inner.ratio], 1)
    x = jnp.where(near, inner.x_end, 1.0)[:, None] / ratio**_ROOT
    k, fall = contact.loss_weight(x, corrected_loss_factor(X, contact.gamma)[:, None])
    passed = jnp.sum(inner.weight * fall[:, 1:] * (m1[:, :1] - m1[:, 1:]), -1)
    return jnp.where(near, k[:, 0] * m1[:, 0] + passed, 0.0)
