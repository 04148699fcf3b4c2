r"""Channels: roughness on one solid, the stiffness it sees, and what it adds to the radial integrals.

Roughness of solid j adds to the density of G the product of q^4 C_j, known at every
contact node, and <|F_j|^2>, known at the angular nodes. The rules that join the two
belong to the scene alone: for each velocity there is one small matrix product a panel.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.angular import angular_means, static_means
from rubberfric.materials import TabulatedModulus
from rubberfric.quadrature import between_weights, cumulative, gauss, typed
from rubberfric.scene import relaxes
from rubberfric.stiffness import Static, by_node, layer_factor, series_stiffness, static_series
from rubberfric.tabulated import log_power


class Channel(NamedTuple):
    """Roughness on one solid, and the stiffness it sees.

    `power` and `cumulative` are weights of <|F|^2> at the angular nodes i. If F is Static they are the
    integrals. If it is `logarithmic` they are weights at the contact nodes, and at the nodes between.
    """

    stiffness: object  # Static, Relaxing or Tabulated
    shift: object  # time-temperature shift of the solid it excites, or None
    by_node: bool  # F depends on q itself, not on q v alone
    logarithmic: bool  # <|F|^2> may change by 1e9 within a panel: see `_logarithmic`
    power: jax.Array  # to the integral over a panel, (panels, i)
    cumulative: jax.Array | None  # to the integral up to every contact node, (panels, order, i)
    dissipation: jax.Array | None  # q^4 C factor dt at the contact nodes, (panels, order)
    storage: jax.Array | None  # q^3 C factor dt [m], same shape


class Parts(NamedTuple):
    """What a channel adds at points; axes (panels, points or 1, order)."""

    panels: jax.Array  # integral of its density of g over every panel, (panels, points or 1)
    within: jax.Array | None  # the same from the left border of the panel to every contact node
    dissipation: jax.Array | None  # terms of the friction, before the factor S P; None if F is Static
    storage: jax.Array | None  # terms of the separation, before the factor x Psi [m]


def is_logarithmic(rough, other):
    """Whether <|F|^2> may change by 1e9 within a panel: see `_logarithmic`."""
    if isinstance(other.material, TabulatedModulus):
        return True
    return relaxes(other) and by_node(rough, other)


def make_channel(mesh, j, rough, other, scale, wanted, order):
    """Channel of the roughness j of a mesh, for the angular means `wanted`."""
    F = series_stiffness(rough, other, scale, (mesh.angular_q.reshape(-1), mesh.q))
    static = isinstance(F, Static)
    nodewise = by_node(rough, other) and not static
    logarithmic = is_logarithmic(rough, other)
    factor = None if static else layer_factor(rough, other, mesh.q)
    weight = mesh.measure * typed(gauss(order)[1], mesh.measure)
    once = mesh.roughness[j] * weight
    once = once if factor is None else once * factor
    power = once if factor is None else once * factor
    if static:
        power = jnp.sum(power * F.value**2, -1)
    elif not logarithmic:
        power = jnp.einsum("kc,kci->ki", power, mesh.interpolate)
    rule = None
    if mesh.between_q is not None:
        rule = _cumulative_rule(mesh, j, F, rough, other, scale, order, logarithmic)
    elif not static and not logarithmic:
        # Only the whole integral is wanted: the contact nodes have done their part.
        power = jnp.zeros_like(mesh.angular_q).at[mesh.panel].add(power)
    return Channel(
        F,
        getattr(other.material, "shift", None),
        nodewise,
        logarithmic,
        power,
        rule,
        once if "dissipation" in wanted and not static else None,
        once / mesh.q if "storage" in wanted else None,
    )


def _cumulative_rule(mesh, j, F, rough, other, scale, order, logarithmic):
    """Weights of <|F|^2> in g at the contact nodes, exact in the roughness and the layer.

    Both may change by 1e6 within a panel, and g, where it matters most, is what the
    small end adds up to: a rule for the product of all would lose it, or make it < 0.
    A stiffness that does not relax is known at every q and goes into the rule as well.
    """
    density = mesh.between_roughness[j]
    if isinstance(F, Static):
        density = density * static_series(rough, other, scale, mesh.between_q) ** 2
        return density @ typed(cumulative(order), density).sum(-1)
    factor = layer_factor(rough, other, mesh.between_q)
    density = density if factor is None else density * factor**2
    if logarithmic:
        return density * typed(between_weights(order), density).reshape(-1)
    return jnp.tensordot(density, typed(cumulative(order), density), 1) @ mesh.interpolate


def parts(channel, mesh, velocity, temperature, wanted, quadrature):
    """`Parts` of a channel at points (velocity and temperature of shape (points,))."""
    if isinstance(channel.stiffness, Static):
        within = None if channel.cumulative is None else channel.cumulative[:, None]
        means = static_means(channel.stiffness, wanted)
        storage = None
        if "storage" in wanted:
            storage = (channel.storage * means.storage)[:, None]
        return Parts(channel.power[:, None], within, None, storage)

    if temperature is not None and channel.shift is not None:
        velocity = velocity * jnp.exp(channel.shift.log_factor(temperature))
    means = _means_by_panel(channel, mesh, velocity, wanted, quadrature)

    def serving(values):
        """Means of the angular panel that serves each contact panel."""
        return values.at[mesh.panel].get(mode="promise_in_bounds")

    def to_contact(values):
        return jnp.einsum("kvi,kci->kvc", serving(values), mesh.interpolate)

    if channel.logarithmic:
        panels, within = _logarithmic(channel, mesh, serving(log_power(means.power)))
    else:
        # Without nodes between, the weights are those of the angular panels themselves.
        power = means.power if channel.cumulative is None else serving(means.power)
        panels, within = jnp.einsum("kvi,ki->kv", power, channel.power), None
        if channel.cumulative is not None:
            # Over a panel of five e-folds and more, where <|F|^2> rises by 1e5, its interpolant may
            # swing below 0 at the small end: there G is that of the panels before.
            within = jnp.maximum(jnp.einsum("kvi,kci->kvc", power, channel.cumulative), 0.0)
    return Parts(
        panels,
        within,
        channel.dissipation[:, None] * to_contact(means.dissipation) if "dissipation" in wanted else None,
        channel.storage[:, None] * to_contact(means.storage) if "storage" in wanted else None,
    )


def _logarithmic(channel, mesh, log_means):
    """Integrals of g where <|F|^2> may change by 1e9 within a panel, of its logarithm at angular nodes.

    So it may with two deformable solids and a layer or with a coating, as F follows Sbar, and with a
    tabulated modulus that steps up. Interpolated in the logarithm and summed with positive weights, the
    small end keeps its digits and G stays positive.
    """
    power = jnp.exp(jnp.einsum("kvi,kci->kvc", log_means, mesh.interpolate))
    panels = jnp.einsum("kvc,kc->kv", power, channel.power)
    if channel.cumulative is None:
        return panels, None
    between = jnp.exp(jnp.einsum("kvi,ksi->kvs", log_means, mesh.between_interpolate))
    order = mesh.q.shape[1]
    gaps = (channel.cumulative[:, None] * between).reshape(*between.shape[:2], order, -1).sum(-1)
    return panels, gaps @ np.triu(np.ones((order, order), gaps.dtype))


def _means_by_panel(channel, mesh, velocity, wanted, quadrature):
    """Angular means at the angular nodes, (angular panels, points, angular order)."""
    F, q = channel.stiffness, mesh.angular_q
    if not channel.by_node:
        return angular_means(F, velocity[:, None] * q[:, None], wanted, quadrature)
    means = angular_means(F, velocity[:, None] * q.reshape(-1), wanted, quadrature)
    return jax.tree.map(lambda x: jnp.swapaxes(x.reshape(-1, *q.shape), 0, 1), means)
