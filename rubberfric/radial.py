r"""The radial integrals over ln q, for many velocities and pressures at once.

`prepare` does what depends on the scene alone; `evaluate` adds velocity, pressure and
temperature. With d^2q = q^2 d ln q dphi and K_j = (q/2) scale factor_j F_j,

.. math:: G(q) = \left(\frac{scale}{\sigma_0}\right)^2 g(q),\qquad
          g = \frac{\pi}{4}\int d\ln q \sum_j q^4 C_j\, factor_j^2 \langle|F_j|^2\rangle
.. math:: \mu = \pi\frac{scale}{\sigma_0}\int d\ln q\; S P
          \sum_j q^4 C_j\, factor_j \langle\cos\varphi\,\mathrm{Im}F_j\rangle
.. math:: \bar u = \frac{\pi}{2}\frac{scale}{\sigma_0}\int d\ln q\; x\Psi(x)
          \sum_j q^3 C_j\, factor_j\langle\mathrm{Re}F_j\rangle
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.angular import Means, angular_means, static_means
from rubberfric.contact import contact_argument, contact_fraction, friction_weight, separation_weight
from rubberfric.correction import correct_argument, correction_table
from rubberfric.mesh import Mesh, build_mesh
from rubberfric.quadrature import Quadrature, cumulative, gauss, typed
from rubberfric.scene import dissipates, rough_pairs
from rubberfric.spectra import broken_power_law
from rubberfric.stiffness import (
    Static,
    by_node,
    layer_factor,
    modulus_scale,
    series_stiffness,
    static_series,
)


class Channel(NamedTuple):
    """Roughness on one solid, and the stiffness it sees."""

    stiffness: object  # Static, Relaxing or Tabulated
    shift: object  # time-temperature shift of the solid it excites, or None
    logarithmic: bool  # interpolate <|F|^2> in the logarithm
    power: jax.Array  # q^4 C factor^2 dt, (contact panels, order)
    # From <|F|^2> to its integral up to every node, (panels, order, order); the integral
    # itself, (panels, order), if F is Static; None where only the whole is asked for.
    cumulative: jax.Array | None
    dissipation: jax.Array  # q^4 C factor dt
    storage: jax.Array  # q^3 C factor dt [m]


class Prepared(NamedTuple):
    """A scene ready for many points."""

    mesh: Mesh | None
    channels: tuple
    scale: jax.Array  # unit of all moduli [Pa]
    gamma: jax.Array
    correction: object  # table of S in G, or None
    quantities: tuple
    quadrature: Quadrature


def prepare(scene, quantities, quadrature):
    """Mesh, spectra and series stiffness of a scene: all that no velocity changes."""
    pairs, friction = rough_pairs(scene), "friction" in quantities and dissipates(scene)
    # What is zero or constant by the structure of the scene is settled here, untraced.
    needs_profile = bool(pairs) and ("separation" in quantities or friction)
    needs_mesh = needs_profile or (bool(pairs) and "area" in quantities)
    if not needs_mesh:
        return Prepared(None, (), jnp.asarray(1.0), scene.gamma, None, quantities, quadrature)
    mesh = build_mesh(
        [broken_power_law(rough.spectrum) for rough, _ in pairs], quadrature, graded=needs_profile
    )
    scale = modulus_scale(scene)
    weight = mesh.measure * typed(gauss(quadrature.order)[1], mesh.measure)
    channels = []
    for j, (rough, other) in enumerate(pairs):
        F = series_stiffness(rough, other, scale, (mesh.angular_q.reshape(-1), mesh.q))
        factor = None if isinstance(F, Static) else layer_factor(rough, other, mesh.q)
        once = mesh.roughness[j] if factor is None else mesh.roughness[j] * factor
        twice = once if factor is None else once * factor
        rule = None
        if needs_profile:
            rule = _cumulative_rule(mesh, j, F, rough, other, scale, quadrature.order)
        shift = getattr(other.material, "shift", None)
        logarithmic = by_node(rough, other) and not isinstance(F, Static)
        channels.append(
            Channel(F, shift, logarithmic, twice * weight, rule, once * weight, once / mesh.q * weight)
        )
    corrected = scene.area_correction and ("area" in quantities or friction)
    table = correction_table(scene.gamma) if corrected else None
    return Prepared(mesh, tuple(channels), scale, scene.gamma, table, quantities, quadrature)


def _cumulative_rule(mesh, j, F, rough, other, scale, order):
    """Weights of <|F|^2> in g at every contact node, exact in the roughness and the layer.

    Both may change by 1e6 within a panel, and g, where it matters most, is what the
    small end adds up to: a rule for the product of all would lose it, or make it < 0.
    A stiffness that does not relax is known at every q and goes into the rule as well.
    """
    density = mesh.between_roughness[j]
    table = typed(cumulative(order), density)
    if isinstance(F, Static):
        return (density * static_series(rough, other, scale, mesh.between_q) ** 2) @ table.sum(-1)
    factor = layer_factor(rough, other, mesh.between_q)
    return jnp.tensordot(density if factor is None else density * factor**2, table, 1)


def evaluate(prepared, velocity, pressure, temperature=None):
    """Quantities at points, each of shape (points,) or (1,) where nothing depends on the point.

    Parameters
    ----------
    prepared : Prepared
    velocity, pressure : shape (points,) [m/s], [Pa]
    temperature : shape (points,) [K], or None

    Returns
    -------
    dict from the names in prepared.quantities to arrays.
    """
    quantities, channels = prepared.quantities, prepared.channels
    if prepared.mesh is None:
        constants = {"area": 1.0, "friction": 0.0, "separation": 0.0}
        return {name: jnp.full_like(pressure, constants[name]) for name in quantities}

    relaxing = any(not isinstance(channel.stiffness, Static) for channel in channels)
    friction = "friction" in quantities and relaxing
    wanted = {"power"}
    wanted |= {"dissipation"} if friction else set()
    wanted |= {"storage"} if "separation" in quantities else set()
    means = [_means(prepared, channel, velocity, temperature, wanted) for channel in channels]
    stiffness = prepared.scale / pressure

    panels = _add(jnp.sum(c.power * m.power, -1) for c, m in zip(channels, means, strict=True))
    results = {"friction": jnp.zeros_like(pressure)}
    if "area" in quantities:
        x = contact_argument(jnp.pi / 4 * jnp.sum(panels, -1), stiffness)
        results["area"] = contact_fraction(_corrected(prepared, x))
    if friction or "separation" in quantities:
        within = _add(_within(c, m) for c, m in zip(channels, means, strict=True))
        g = jnp.pi / 4 * (_sum_before(panels)[..., None] + within)
        x = contact_argument(g, stiffness[:, None, None])
    if friction:
        density = _add(
            c.dissipation * m.dissipation
            for c, m in zip(channels, means, strict=True)
            if m.dissipation is not None
        )
        weight = friction_weight(_corrected(prepared, x), prepared.gamma)
        results["friction"] = jnp.pi * stiffness * jnp.sum(weight * density, (-2, -1))
    if "separation" in quantities:
        density = _add(c.storage * m.storage for c, m in zip(channels, means, strict=True))
        weight = separation_weight(x, prepared.gamma)
        results["separation"] = jnp.pi / 2 * stiffness * jnp.sum(weight * density, (-2, -1))
    return {name: results[name] for name in quantities}


def _within(channel, means):
    """g at the contact nodes from the left border of their panel on."""
    if isinstance(channel.stiffness, Static):
        return channel.cumulative
    return jnp.einsum("kci,vki->vkc", channel.cumulative, means.power)


def _corrected(prepared, x):
    """S in G, where the scene asks for it."""
    return x if prepared.correction is None else correct_argument(prepared.correction, x)


def _means(prepared, channel, velocity, temperature, wanted):
    """Angular means at the contact nodes, (points or nothing, contact panels, order)."""
    if isinstance(channel.stiffness, Static):
        return static_means(channel.stiffness, wanted)
    if temperature is not None and channel.shift is not None:
        velocity = velocity * jnp.exp(channel.shift.log_factor(temperature))
    mesh = prepared.mesh
    qv = velocity[:, None] * mesh.angular_q.reshape(-1)
    means = angular_means(channel.stiffness, qv, wanted, prepared.quadrature)

    def to_contact(values):
        if values is None:
            return None
        values = values.reshape(-1, *mesh.angular_q.shape)
        chosen = jnp.einsum("vai,ka->vki", values, mesh.select)
        return jnp.einsum("vki,kci->vkc", chosen, mesh.interpolate)

    if channel.logarithmic:
        # Two deformable solids with a layer: F follows Sbar, and may change by 1e9 within
        # a panel; in the logarithm its small end keeps its digits, and G stays positive.
        # The floor is for F = 0 (two liquids at rest), where G need only be as good as 0.
        floor = float(jnp.finfo(means.power.dtype).tiny) ** 0.8
        power = jnp.exp(to_contact(jnp.log(jnp.maximum(means.power, floor))))
    else:
        power = to_contact(means.power)
    return Means(power, to_contact(means.dissipation), to_contact(means.storage))


def _sum_before(panels):
    """Sum over the panels before each one, without subtracting: a panel 1e20 times larger loses nothing."""
    return panels @ np.triu(np.ones((panels.shape[-1],) * 2, panels.dtype), 1)


def _add(terms):
    total = None
    for term in terms:
        total = term if total is None else total + term
    return total
