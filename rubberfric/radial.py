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

from rubberfric.channels import is_logarithmic, make_channel, parts
from rubberfric.contact import contact_argument, contact_fraction, friction_weight, separation_weight
from rubberfric.correction import correct_argument, correction_table
from rubberfric.mesh import Mesh, build_mesh
from rubberfric.quadrature import Quadrature
from rubberfric.scene import dissipates, rough_pairs
from rubberfric.spectra import broken_power_law
from rubberfric.stiffness import modulus_scale


class Prepared(NamedTuple):
    """A scene ready for many points."""

    mesh: Mesh | None
    channels: tuple
    scale: jax.Array | None  # unit of all moduli [Pa]
    gamma: jax.Array | None
    correction: object  # table of S in G, or None
    quantities: tuple
    wanted: frozenset  # angular means: "power", "dissipation", "storage"
    quadrature: Quadrature


def prepare(scene, quantities, quadrature, *, laws=None, marks=None):
    """Mesh, spectra and series stiffness of a scene: all that no velocity changes.

    laws : one BrokenPowerLaw for each rough body, lower first; None: of the scene's own spectra
    marks : see `build_mesh`; with marks there are nodes between, whatever the quantities
    """
    pairs = rough_pairs(scene)
    # What is zero or constant by the structure of the scene is settled here, untraced.
    wanted = {"power"} if pairs and "area" in quantities else set()
    if dissipates(scene) and "friction" in quantities:
        wanted |= {"power", "dissipation"}
    if pairs and "separation" in quantities:
        wanted |= {"power", "storage"}
    wanted = frozenset(wanted)
    if not wanted:
        return Prepared(None, (), None, None, None, quantities, wanted, quadrature)
    logarithmic = any(is_logarithmic(*pair) for pair in pairs)
    laws = [broken_power_law(rough.spectrum) for rough, _ in pairs] if laws is None else laws
    graded = marks is not None or wanted != {"power"}
    mesh = build_mesh(laws, quadrature, graded=graded, logarithmic=logarithmic, marks=marks)
    scale = modulus_scale(scene)
    channels = tuple(
        make_channel(mesh, j, rough, other, scale, wanted, quadrature.order)
        for j, (rough, other) in enumerate(pairs)
    )
    corrected = scene.area_correction and ("area" in quantities or "dissipation" in wanted)
    table = correction_table(scene.gamma) if corrected else None
    return Prepared(mesh, channels, scale, scene.gamma, table, quantities, wanted, quadrature)


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
    quantities, wanted = prepared.quantities, prepared.wanted
    results = _integrals(prepared, velocity, pressure, temperature) if wanted else {}
    constants = {"area": 1.0, "friction": 0.0, "separation": 0.0}
    return {
        name: results[name] if name in results else jnp.full_like(pressure, constants[name])
        for name in quantities
    }


def _integrals(prepared, velocity, pressure, temperature):
    """What does not follow from the structure of the scene alone."""
    wanted, results = prepared.wanted, {}
    found = channel_parts(prepared, velocity, temperature)
    stiffness = prepared.scale / pressure
    if "area" in prepared.quantities:
        whole = _sum(jnp.sum(part.panels, 0) for part in found)
        x = contact_argument(jnp.pi / 4 * whole, stiffness)
        results["area"] = contact_fraction(corrected(prepared, x))
    if wanted == {"power"}:
        return results
    x = node_argument(found, stiffness)
    if "dissipation" in wanted:
        density = _sum(part.dissipation for part in found if part.dissipation is not None)
        weight = friction_weight(corrected(prepared, x), prepared.gamma)
        results["friction"] = jnp.pi * stiffness * jnp.sum(weight * density, (0, 2))
    if "storage" in wanted:
        density = _sum(part.storage for part in found)
        weight = separation_weight(x, prepared.gamma)
        results["separation"] = jnp.pi / 2 * stiffness * jnp.sum(weight * density, (0, 2))
    return results


def channel_parts(prepared, velocity, temperature):
    """`Parts` of every channel at points."""
    return [
        parts(channel, prepared.mesh, velocity, temperature, prepared.wanted, prepared.quadrature)
        for channel in prepared.channels
    ]


def node_argument(found, stiffness):
    """x = 1 / (2 sqrt G), of the plain G, at the contact nodes, shape (panels, points, order)."""
    panels = _sum(part.panels for part in found)
    g = jnp.pi / 4 * (_sum_before(panels)[..., None] + _sum(part.within for part in found))
    return contact_argument(g, stiffness[:, None])


def corrected(prepared, x):
    """S in G, where the scene asks for it."""
    return x if prepared.correction is None else correct_argument(prepared.correction, x)


def _sum_before(panels):
    """Sum over the panels before each one, without subtracting: a panel 1e20 times larger loses nothing."""
    return np.tril(np.ones((panels.shape[0],) * 2, panels.dtype), -1) @ panels


def _sum(terms):
    total = None
    for term in terms:
        total = term if total is None else total + term
    return total
