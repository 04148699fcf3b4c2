r"""Channels: roughness on one solid, the stiffness it sees, and what it adds to the radial integrals.

Roughness of solid j adds to the density of G the product of q^4 C_j, known at every
contact node, and <|F_j|^2>, known at the angular nodes. The rules that join the two
belong to the scene alone: for each velocity there is one small matrix product a panel.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import between_weights, cumulative, gauss, typed
from rubberfric.scene.scene import relaxes
from rubberfric.theory.stiffness.angular_means import angular_means, static_means, with_means
from rubberfric.theory.stiffness.factors import Modes, mix_of, modes_of, node_factors
from rubberfric.theory.stiffness.series import Sampled, Static, by_node, series_stiffness, static_series
from rubberfric.theory.stiffness.softened_means import sampled_means
from rubberfric.theory.stiffness.tabulated_means import log_power


class Channel(NamedTuple):
    """Roughness on one solid, and the stiffness it sees.

    `power` and `cumulative` are weights of <|F|^2> at the angular nodes i. If F is Static they are the
    integrals. If it is `logarithmic` they are weights at the contact nodes, and at the nodes between; if
    the modes are taken `at_contact` the nodes i are the contact nodes.
    A tuple has an entry for each of the `angular.Means` of its kind.
    """

    stiffness: object  # Static, Relaxing, Tabulated or Sampled
    modes: Modes  # which angular means there are
    shift: object  # time-temperature shift of the solid it excites, or None
    by_node: bool  # F depends on q itself, not on q v alone
    logarithmic: bool  # <|F|^2> may change by 1e9 within a panel: see `_logarithmic`
    power: tuple  # to the integral over a panel, (panels, i)
    cumulative: tuple | None  # to the integral up to every contact node, (panels, order, i)
    dissipation: tuple | None  # q^4 C factor dt at the contact nodes, (panels, order)
    storage: tuple | None  # q^3 C factor dt [m], same shape
    transverse: tuple | None  # as dissipation
    mix: tuple | None  # shares (c_m, s_m) of the harmonics, (harmonics,) or (harmonics, panels, order) each


class Parts(NamedTuple):
    """What a channel adds at points; axes (panels, points or 1, order)."""

    panels: jax.Array  # integral of its density of g over every panel, (panels, points or 1)
    within: jax.Array | None  # the same from the left border of the panel to every contact node
    dissipation: jax.Array | None  # terms of the friction, before the factor S P; None if F is Static
    storage: jax.Array | None  # terms of the separation, before the factor x Psi [m]
    transverse: jax.Array | None  # terms of the transverse friction, as dissipation


def is_logarithmic(rough, other):
    """Whether <|F|^2> may change by 1e9 within a panel: see `_logarithmic`."""
    return other.material.needs_quadrature or (relaxes(other) and by_node(rough, other))


def make_channel(mesh, j, pair, softened, scale, wanted, quadrature):
    """Channel of the roughness j of a mesh, for the angular means `wanted`.

    Parameters
    ----------
    mesh : Mesh
    j : which of its spectra
    pair : (rough body, body facing it)
    softened : `softening.Softened` or None
    scale : modulus scale [Pa]
    wanted : set of "power", "dissipation", "storage"
    quadrature : Quadrature
    """
    rough, other = pair
    modes = modes_of(rough, other, softened)
    nodes = mesh.q if modes.at_contact else mesh.angular_q
    F = series_stiffness(rough, other, scale, (nodes.reshape(-1), mesh.q), softened)
    static = isinstance(F, Static)
    logarithmic = is_logarithmic(rough, other) and not modes.at_contact
    mix = mix_of(rough, modes, nodes)
    once = mesh.roughness[j] * (mesh.measure * typed(gauss(quadrature.order)[1], mesh.measure))
    factors = None if static else node_factors(rough, other, softened, mesh.q)
    rule = None
    if static:
        power = (jnp.sum(once * F.value**2, -1),)
    else:
        power = tuple(once if f is None else once * f for f in factors.power)
    interpolated = not (static or logarithmic or modes.at_contact)
    if interpolated:
        power = tuple(jnp.einsum("kc,kci->ki", weights, mesh.interpolate) for weights in power)
    if mesh.between_q is not None:
        rule = _cumulative_rule(mesh, j, pair, softened, scale, F, modes, logarithmic)
    elif interpolated:
        # Only the whole integral is wanted: the contact nodes have done their part.
        power = tuple(jnp.zeros_like(mesh.angular_q).at[mesh.panel].add(weights) for weights in power)

    def weights_of(name, base):
        if name not in wanted or (static and name != "storage"):
            return None
        return (base,) if static else tuple(base if f is None else base * f for f in getattr(factors, name))

    return Channel(
        stiffness=with_means(F, wanted, modes.split, mix),
        modes=modes,
        shift=other.material.shift,
        by_node=by_node(rough, other) and not static,
        logarithmic=logarithmic,
        power=power,
        cumulative=rule,
        dissipation=weights_of("dissipation", once),
        storage=weights_of("storage", once / mesh.q),
        transverse=weights_of("transverse", once) if modes.harmonics else None,
        mix=mix,
    )


def _cumulative_rule(mesh, j, pair, softened, scale, F, modes, logarithmic):
    """Weights of <|F|^2> in g at the contact nodes, exact in the roughness and in all its factors.

    They may change by 1e6 within a panel, and g, where it matters most, is what the
    small end adds up to: a rule for the product of all would lose it, or make it < 0.
    A stiffness that does not relax is known at every q and goes into the rule as well.
    """
    density, order = mesh.between_roughness[j], mesh.q.shape[1]
    rule = typed(cumulative(order), density)
    if isinstance(F, Static):
        return ((density * static_series(*pair, scale, mesh.between_q, softened) ** 2) @ rule.sum(-1),)
    if isinstance(F, Sampled):
        return (jnp.tensordot(density, rule, 1),)
    factors = node_factors(*pair, softened, mesh.between_q).power
    densities = (density if f is None else density * f for f in factors)
    if modes.at_contact:
        return tuple(jnp.tensordot(values, rule, 1) for values in densities)
    if logarithmic:
        gaps = typed(between_weights(order), density).reshape(-1)
        return tuple(density * gaps for density in densities)
    return tuple(jnp.tensordot(density, rule, 1) @ mesh.interpolate for density in densities)


def parts(channel, mesh, speed, wanted, quadrature):
    """`Parts` of a channel at points.

    Parameters
    ----------
    channel : Channel
    mesh : Mesh
    speed : v a_T [m/s], shape (points,), or (angular panels, points, angular order) if the temperature
        differs from scale to scale; the contact nodes' for a Sampled stiffness
    wanted : set of "power", "dissipation", "storage"
    quadrature : Quadrature
    """
    if isinstance(channel.stiffness, Static):
        within = None if channel.cumulative is None else channel.cumulative[0][:, None]
        storage = None
        if "storage" in wanted:
            storage = (channel.storage[0] * static_means(channel.stiffness, wanted).storage[0])[:, None]
        return Parts(channel.power[0][:, None], within, None, storage, None)
    if channel.modes.at_contact:
        return _parts_at_contact(channel, mesh, speed, wanted, quadrature)
    means = _means_by_panel(channel, mesh.angular_q, speed, wanted, quadrature)

    def serving(values):
        """Means of the angular panel that serves each contact panel."""
        return values.at[mesh.panel].get(mode="promise_in_bounds")

    def at_contact(weights, values):
        return total(w[:, None] * to_contact(mesh, mean) for w, mean in zip(weights, values, strict=True))

    if channel.logarithmic:
        powers = tuple(map(serving, means.power))
        pairs = [_logarithmic(channel, mesh, k, powers) for k in range(len(powers))]
        panels, within = (None if x[0] is None else total(x) for x in zip(*pairs, strict=True))
    else:
        # Without nodes between, the weights are those of the angular panels themselves.
        power = means.power if channel.cumulative is None else [serving(mean) for mean in means.power]
        panels = total(map(lambda w, mean: jnp.einsum("kvi,ki->kv", mean, w), channel.power, power))
        within = None
        if channel.cumulative is not None:
            # Over a panel of five e-folds and more, where <|F|^2> rises by 1e5, its interpolant may
            # swing below 0 at the small end: there G is that of the panels before.
            within = total(
                map(lambda w, mean: jnp.einsum("kvi,kci->kvc", mean, w), channel.cumulative, power)
            )
            within = jnp.maximum(within, 0.0)
    return Parts(
        panels,
        within,
        at_contact(channel.dissipation, means.dissipation) if "dissipation" in wanted else None,
        at_contact(channel.storage, means.storage) if "storage" in wanted else None,
        at_contact(channel.transverse, means.transverse) if channel.transverse is not None else None,
    )


def to_contact(mesh, values):
    """Values at the angular nodes, (angular panels, points, angular order), at the contact nodes."""
    serving = values.at[mesh.panel].get(mode="promise_in_bounds")
    return jnp.einsum("kvi,kci->kvc", serving, mesh.interpolate)


def _parts_at_contact(channel, mesh, speed, wanted, quadrature):
    """`Parts` of means that are taken at the contact nodes."""
    if isinstance(channel.stiffness, Sampled):
        speed = speed[:, None] if speed.ndim == 1 else speed
        means = sampled_means(channel.stiffness, speed * mesh.q[:, None], wanted)
    else:
        means = _means_by_panel(channel, mesh.q, speed, wanted, quadrature)
    (power,), within = means.power, None
    if channel.cumulative is not None:
        within = jnp.maximum(jnp.einsum("kvi,kci->kvc", power, channel.cumulative[0]), 0.0)

    def terms(name):
        return getattr(channel, name)[0][:, None] * getattr(means, name)[0] if name in wanted else None

    panels = jnp.einsum("kvc,kc->kv", power, channel.power[0])
    return Parts(panels, within, *map(terms, ("dissipation", "storage", "transverse")))


def total(terms):
    """Sum of arrays, without a zero to begin with."""
    first, *others = terms
    return sum(others, first)


def _logarithmic(channel, mesh, k, powers):
    """Integrals of g where <|F|^2> may change by 1e9 within a panel, of its logarithm at angular nodes.

    So it may with two deformable solids and a layer, with a coating, and with a tabulated
    modulus that steps up. Interpolated in the logarithm and summed with positive weights, the
    small end keeps its digits and G stays positive.
    """
    logarithm = log_power(powers[k])

    def at(basis):
        return jnp.exp(jnp.einsum("kvi,kci->kvc", logarithm, basis))

    panels = jnp.einsum("kvc,kc->kv", at(mesh.interpolate), channel.power[k])
    if channel.cumulative is None:
        return panels, None
    between = at(mesh.between_interpolate)
    order = mesh.q.shape[1]
    gaps = (channel.cumulative[k][:, None] * between).reshape(*between.shape[:2], order, -1).sum(-1)
    return panels, gaps @ np.triu(np.ones((order, order), gaps.dtype))


def _means_by_panel(channel, q, speed, wanted, quadrature):
    """Angular means at the nodes q, (panels, order) [1/m], as (panels, points, order)."""
    F, split, mix = channel.stiffness, channel.modes.split, channel.mix
    depends_on_q = mix is not None and mix[0].ndim > 1
    if not channel.by_node:
        speed = speed[:, None] if speed.ndim == 1 else speed
        mix = tuple(share[:, :, None] for share in mix) if depends_on_q else mix
        return angular_means(F, speed * q[:, None], wanted, split, mix)
    flat = q.reshape(-1)
    speed = speed[:, None] if speed.ndim == 1 else jnp.swapaxes(speed, 0, 1).reshape(-1, flat.size)
    mix = tuple(share.reshape(-1, flat.size) for share in mix) if depends_on_q else mix
    means = angular_means(F, speed * flat, wanted, split, mix)
    return jax.tree.map(lambda x: jnp.swapaxes(x.reshape(-1, *q.shape), 0, 1), means)
