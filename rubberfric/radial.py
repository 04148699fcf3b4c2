r"""The radial integrals over ln q, for many velocities and pressures at once.

`prepare` does what depends on the scene alone; `evaluate` adds velocity, pressure and
temperature. With d^2q = q^2 d ln q dphi and K_j = (q/2) scale factor_j F_j,

.. math:: G(q) = \left(\frac{scale}{\sigma_0}\right)^2 g(q),\qquad
          g = \frac{\pi}{4}\int d\ln q \sum_j q^4 C_j\, factor_j^2 \langle|F_j|^2\rangle
.. math:: \mu = \pi\frac{scale}{\sigma_0}\int d\ln q\; S P \sum_j q^4 C_j\, factor_j \langle\cos\varphi\,\mathrm{Im}F_j\rangle
.. math:: \bar u = \frac{\pi}{2}\frac{scale}{\sigma_0}\int d\ln q\; x\Psi(x)\sum_j q^3 C_j\, factor_j\langle\mathrm{Re}F_j\rangle
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.angular import Means, angular_means, static_means
from rubberfric.contact import contact_argument, contact_fraction, friction_weight, separation_weight
from rubberfric.correction import correct_argument, correction_table
from rubberfric.materials import VISCOELASTIC
from rubberfric.mesh import Mesh, build_mesh
from rubberfric.quadrature import Quadrature, cumulative, gauss
from rubberfric.spectra import broken_power_law
from rubberfric.stiffness import Static, modulus_scale, series_stiffness


class Channel(NamedTuple):
    """Roughness on one solid, and the stiffness it sees."""

    stiffness: object  # Static, Relaxing or Tabulated
    shift: object  # time-temperature shift of the solid it excites, or None
    power: jax.Array  # q^4 C factor^2 dt/dnode, (contact panels, order)
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
    pairs = [(scene.lower, scene.upper), (scene.upper, scene.lower)]
    pairs = [(rough, other) for rough, other in pairs if rough.spectrum is not None]
    dissipates = any(isinstance(other.material, VISCOELASTIC) for _, other in pairs)
    # What is zero or constant by the structure of the scene is settled here, untraced.
    needs_profile = bool(pairs) and ("separation" in quantities or ("friction" in quantities and dissipates))
    needs_mesh = needs_profile or (bool(pairs) and "area" in quantities)
    if not needs_mesh:
        return Prepared(None, (), jnp.asarray(1.0), scene.gamma, None, quantities, quadrature)
    mesh = build_mesh(
        [broken_power_law(rough.spectrum) for rough, _ in pairs], quadrature, graded=needs_profile
    )
    scale = modulus_scale(scene)
    weight = mesh.measure * jnp.asarray(gauss(quadrature.order)[1], mesh.measure.dtype)
    channels = []
    for (rough, other), roughness in zip(pairs, mesh.roughness, strict=True):
        F, factor = series_stiffness(rough, other, scale, (mesh.angular_q.reshape(-1), mesh.q))
        once = roughness if factor is None else roughness * factor
        twice = once if factor is None else once * factor
        shift = getattr(other.material, "shift", None)
        channels.append(Channel(F, shift, twice * mesh.measure, once * weight, once / mesh.q * weight))
    corrected = scene.area_correction and ("area" in quantities or ("friction" in quantities and dissipates))
    table = correction_table(scene.gamma) if corrected else None
    return Prepared(mesh, tuple(channels), scale, scene.gamma, table, quantities, quadrature)


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
    quantities = prepared.quantities
    if prepared.mesh is None:
        constants = {"area": 1.0, "friction": 0.0, "separation": 0.0}
        return {name: jnp.full_like(pressure, constants[name]) for name in quantities}

    relaxing = any(not isinstance(channel.stiffness, Static) for channel in prepared.channels)
    profile = "separation" in quantities or ("friction" in quantities and relaxing)
    wanted = {"power"}
    wanted |= {"dissipation"} if "friction" in quantities and relaxing else set()
    wanted |= {"storage"} if "separation" in quantities else set()
    means = [_means(prepared, channel, velocity, temperature, wanted) for channel in prepared.channels]
    channels = prepared.channels
    scaled = prepared.scale / pressure

    order = prepared.quadrature.order
    density = _add(c.power * m.power for c, m in zip(channels, means, strict=True))
    panels = density @ jnp.asarray(gauss(order)[1], density.dtype)
    results = {}
    if "area" in quantities:
        results["area"] = contact_fraction(
            _argument(prepared, jnp.pi / 4 * jnp.sum(panels, -1), scaled, corrected=True)
        )
    if profile:
        # Sums of what came before, not running sums less the last: a spectrum that
        # starts 1e20 times stronger would leave nothing of the difference.
        before = _exclusive_sum(panels)
        within = density @ jnp.asarray(cumulative(order), density.dtype).T
        g = jnp.pi / 4 * (before[..., None] + within)
        scaled_here = scaled[:, None, None]
    if "friction" in quantities:
        if relaxing:
            x = _argument(prepared, g, scaled_here, corrected=True)
            density = _add(
                c.dissipation * m.dissipation
                for c, m in zip(channels, means, strict=True)
                if m.dissipation is not None
            )
            total = jnp.sum(friction_weight(x, prepared.gamma) * density, (-2, -1))
            results["friction"] = jnp.pi * scaled * total
        else:
            results["friction"] = jnp.zeros_like(pressure)
    if "separation" in quantities:
        x = _argument(prepared, g, scaled_here, corrected=False)
        density = _add(c.storage * m.storage for c, m in zip(channels, means, strict=True))
        total = jnp.sum(separation_weight(x, prepared.gamma) * density, (-2, -1))
        results["separation"] = jnp.pi / 2 * scaled * total
    return {name: results[name] for name in quantities}


def _argument(prepared, g, scaled, corrected):
    x = contact_argument(g, scaled)
    if corrected and prepared.correction is not None:
        x = correct_argument(prepared.correction, x)
    return x


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

    return Means(*(to_contact(values) for values in means))


def _exclusive_sum(panels):
    """Sum over the panels before each one."""
    running = jnp.cumsum(panels[..., :-1], -1)
    return jnp.concatenate([jnp.zeros_like(panels[..., :1]), running], -1)


def _add(terms):
    total = None
    for term in terms:
        total = term if total is None else total + term
    return total
