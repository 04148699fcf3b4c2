r"""The integrals over ln q that the quantities of a scene are, for many velocities and pressures at once.

`prepare` does what depends on the scene alone; `evaluate` adds velocity, pressure and
temperature. G and the friction are in `rubberfric.theory.stress_fluctuation`; with its notation
[Scaraggi & Persson, eq. (A18)]

.. math:: \bar u = \frac{\pi}{2}\frac{scale}{\sigma_0}\int d\ln q\; x\Psi(x)
          \sum_j q^3 C_j\, factor_j\langle\mathrm{Re}F_j\rangle

and the transverse friction is the friction with sin(phi) in place of cos(phi).
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.quadrature import Quadrature
from rubberfric.roughness.mesh import build_mesh
from rubberfric.scene.pairs import Pair, pairs_of
from rubberfric.scene.scene import Scene
from rubberfric.scene.shear import ContactShear, shear_friction
from rubberfric.scene.softening import knots
from rubberfric.theory.area_correction import correction_table
from rubberfric.theory.contributions import contribution, total
from rubberfric.theory.partial_contact import separation_weight
from rubberfric.theory.quantities import Needs, needs_of, parts_of
from rubberfric.theory.stiffness.series import modulus_scale
from rubberfric.theory.stress_fluctuation import Contact, Roughness
from rubberfric.theory.temperatures import (
    Temperatures,
    Thermal,
    macroasperity,
    prepare_thermal,
    solve_temperatures,
)


class Prepared(NamedTuple):
    """A scene ready for many points."""

    needs: Needs
    roughness: Roughness | None  # None if nothing is needed of it
    thermal: Thermal | None
    shear: ContactShear | None


def prepare(
    scene: Scene,
    quantities: Iterable[str],
    quadrature: Quadrature,
    *,
    pairs: Sequence[Pair] | None = None,
    borders: jax.Array | None = None,
) -> Prepared:
    """Mesh, spectra and series stiffness of a scene: all that no velocity, pressure or temperature changes.

    Parameters
    ----------
    scene : Scene
    quantities : fields of `Solution`
    quadrature : Quadrature
    pairs : `pairs_of` the scene where they are known already, or with other power laws
    borders : see `build_mesh`; with borders G is known at every node, whatever the quantities
    """
    needs = needs_of(scene, quantities)
    if not needs.power:
        return Prepared(needs, None, None, scene.shear)
    pairs = pairs_of(scene) if pairs is None else pairs
    mesh = build_mesh(
        [pair.law for pair in pairs],
        quadrature,
        graded=needs.everywhere or scene.heating is not None or borders is not None,
        logarithmic=any(pair.steep for pair in pairs),
        borders=_borders(scene, pairs, borders),
    )
    scale = modulus_scale(scene)
    roughness = Roughness(
        mesh,
        tuple(contribution(pair, mesh, j, scale, needs) for j, pair in enumerate(pairs)),
        tuple(pair.side for pair in pairs),
        scale,
        scene.gamma,
        correction_table(scene.gamma) if scene.area_correction and needs.area else None,
    )
    heating = scene.heating
    thermal = None if heating is None else prepare_thermal(heating, scene, roughness, quadrature.heat)
    return Prepared(needs, roughness, thermal, scene.shear)


def _borders(scene, pairs, asked):
    """Wavevectors that must be borders of panels: the macroasperities' first, those asked for last."""
    borders = [] if scene.heating is None else [macroasperity(scene.heating)[None]]
    borders += [] if pairs[0].softened is None else [knots(pairs[0].softened)]
    borders += [] if asked is None else [asked]
    return jnp.concatenate(borders) if borders else None


def solved(
    prepared: Prepared, velocity: jax.Array, pressure: jax.Array, temperature: jax.Array | None = None
) -> tuple[Contact, Temperatures | None]:
    """`Contact` at points, shape (points,) each, and the `Temperatures` of a heated scene.

    Raises
    ------
    ValueError : a scene prepared for nothing that is an integral, or a heated one without temperature.
    """
    roughness, thermal = prepared.roughness, prepared.thermal
    if roughness is None:
        raise ValueError("the scene was prepared for nothing that is an integral: there is no contact")
    if thermal is None:
        return roughness.contact(velocity, pressure, [temperature] * len(roughness.contributions)), None
    if temperature is None:
        raise ValueError("temperature is missing: a scene with heating needs that far from the contact [K]")
    found = solve_temperatures(thermal, roughness, velocity, pressure, temperature)
    return roughness.contact(velocity, pressure, found.strained), found


def evaluate(
    prepared: Prepared, quantities: Iterable[str], points: Sequence[jax.Array]
) -> dict[str, jax.Array]:
    """Quantities at points.

    Parameters
    ----------
    prepared : Prepared for these quantities at least
    quantities : fields of `Solution`
    points : velocity [m/s], pressure [Pa](, temperature [K]), shape (n,)

    Returns
    -------
    dict from the quantities to arrays, shape (n,)
    """
    velocity, pressure = points[:2]
    surface = points[2] if len(points) > 2 else None
    parts = parts_of(quantities)
    sheared = prepared.shear is not None and "shear_friction" in parts
    found: dict[str, jax.Array] = {}
    if prepared.roughness is not None:
        contact, temperatures = solved(prepared, *points)
        found = _integrated(contact, parts | {"area"} if sheared else parts)
        if temperatures is not None:
            found |= {"flash_temperature": temperatures.flash, "converged": temperatures.converged}
            surface = temperatures.surface

    def value(name):
        return found[name] if name in found else _constant(name, points)

    if prepared.shear is not None and sheared:
        found["shear_friction"] = shear_friction(prepared.shear, value("area"), velocity, pressure, surface)
    if "friction" in quantities:
        found["friction"] = value("viscoelastic_friction")
        if sheared:
            found["friction"] = found["friction"] + found["shear_friction"]
    return {name: jnp.broadcast_to(value(name), velocity.shape) for name in quantities}


def _integrated(contact, parts):
    """What of the parts is an integral over the roughness."""
    found = {"area": contact.area()} if "area" in parts else {}
    for name, kind in (("viscoelastic_friction", "dissipation"), ("transverse_friction", "transverse")):
        if name in parts and (terms := contact.friction_terms(kind)):
            found[name] = total(jnp.sum(values, (0, 2)) for values in terms.values())
    if "separation" in parts:
        density = total(terms.densities["storage"] for terms in contact.terms)
        weight = separation_weight(contact.x, contact.gamma)
        found["separation"] = jnp.pi / 2 * contact.stiffness * jnp.sum(weight * density, (0, 2))
    return found


def _constant(name, points):
    """What is not integrated: full contact of smooth surfaces, and no force where nothing relaxes."""
    if name == "flash_temperature":
        return points[2]  # without roughness there is no scale to be hot
    if name == "converged":
        return jnp.ones_like(points[1], bool)
    return jnp.full_like(points[1], 1.0 if name == "area" else 0.0)
