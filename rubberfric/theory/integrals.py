r"""Integrals over ln q that give the quantities of a scene, for many velocities and pressures.

`prepare` computes what depends only on the scene. `evaluate` adds velocity, pressure and temperature.
`rubberfric.theory.contact` has the formulas. The transverse friction is the friction with sin(phi) instead of
cos(phi).
"""

import functools
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.compilation import exact_products
from rubberfric.base.fixed_points import Inverse
from rubberfric.base.quadrature import Quadrature
from rubberfric.roughness.mesh.nodes import build_mesh
from rubberfric.roughness.moments import unscaled
from rubberfric.scene.interface import Adhesion, ShearLaw, difference, shear_friction
from rubberfric.scene.scene import Scene, temperature_by_scale
from rubberfric.theory.adhesive_contact import adhesive_contact
from rubberfric.theory.area.area_correction import correction_table
from rubberfric.theory.area.boundary_elements_law import solve_law
from rubberfric.theory.area.law_roughness import Law, prepare_law
from rubberfric.theory.contact import Contact, Roughness
from rubberfric.theory.contributions import contribution, total
from rubberfric.theory.heat.balance import COARSE, Temperatures, Thermal, prepare_thermal
from rubberfric.theory.heat.balance import borders as borders_of_heat
from rubberfric.theory.heat.temperatures import (
    imbalance,
    preconditioner,
    solve_rises,
    solve_temperatures,
)
from rubberfric.theory.stiffness.complex_stiffness import kinks, modulus_scale
from rubberfric.theory.stiffness.means import Tables
from rubberfric.theory.stiffness.table import MeansTable
from rubberfric.theory.structure import (
    MeansInterpolation,
    RequiredMeans,
    RoughSurface,
    Structure,
    SurfaceTemperatures,
    quantity_parts,
    rough_surfaces_of,
)


class Points(NamedTuple):
    """Conditions, as arrays of shape (points,)."""

    velocity: jax.Array  # [m/s]
    pressure: jax.Array  # [Pa]
    temperature: jax.Array | None = None  # [K]


class Prepared(NamedTuple):
    """A scene prepared for many points."""

    needs: RequiredMeans
    integrated: Roughness | None  # None if no quantity is an integral over it
    thermal: Thermal | None
    shear: ShearLaw | None
    adhesion: Adhesion | None
    law: Law | None = None  # gives area and friction instead of the theory

    @property
    def roughness(self) -> Roughness:
        """Return the rough surfaces.

        A ValueError is raised if none of the requested quantities is an integral over roughness.
        """
        if self.integrated is None:
            raise ValueError("no prepared quantity is an integral over roughness")
        return self.integrated

    @property
    def stiffness_by_pressure(self) -> bool:
        """Return True if the stiffness depends on the pressure, because the solids warm up."""
        return self.thermal is not None


@exact_products
def prepare(
    scene: Scene,
    quantities: Iterable[str],
    quadrature: Quadrature,
    *,
    surfaces: Sequence[RoughSurface] | None = None,
    borders: jax.Array | None = None,
    tables: Tables | None = None,
    span: float | None = None,
) -> Prepared:
    """Prepare mesh, spectra and series stiffness, which do not depend on the conditions.

    Parameters
    ----------
    scene : Scene
    quantities : fields of `Solution`
    quadrature : Quadrature
    surfaces : rough surfaces, if already known or with other power laws; None: `rough_surfaces_of(scene)`
    borders : see `build_mesh`; with borders G is computed at every node
    tables : result of `known_tables` for the scene and the quantities, or None
    span : of ln(v a_T) over the points if it is known, see `span_of_speeds`
    """
    law = None
    if scene.contact_model == "boundary_elements":
        surfaces = rough_surfaces_of(scene) if surfaces is None else surfaces
        if surfaces and set(quantities) - {"separation"}:
            law = prepare_law(surfaces[0], quadrature)
        quantities = set(quantities) & {"separation"}
    structure = Structure.of(scene, quantities)
    needs = structure.needs
    if not needs.mean_abs2:
        return Prepared(needs, None, None, scene.shear, scene.adhesion, law)
    surfaces = rough_surfaces_of(scene) if surfaces is None else surfaces
    roughness, thermal = _rough(scene, surfaces, quadrature, needs, borders, tables, span=span), None
    if temperature_by_scale(scene):
        coarse = None
        if structure.feeds_back:
            coarse_needs = Structure.of(scene, ("flash_temperature",)).needs
            coarse = _rough(scene, surfaces, COARSE, coarse_needs, like=roughness)
        thermal = prepare_thermal(scene, roughness, quadrature, coarse)
    return Prepared(needs, roughness, thermal, scene.shear, scene.adhesion, law)


def _rough(scene, surfaces, quadrature, needs, borders=None, tables=None, like=None, span=None):
    """Return the `Roughness` of a scene.

    `like` is None, or the `Roughness` of the scene on another mesh, whose tables are reused.
    """
    details = [surface.detail for surface in surfaces if surface.detail is not None]
    laws, join = [surface.law for surface in surfaces], None
    if scene.correlation is not None:
        heights = tuple(surface.spectrum.height_scale() for surface in surfaces)
        laws = [unscaled(law) for law in laws]
        join = functools.partial(difference, scene.correlation, heights)
    mesh = build_mesh(
        laws,
        quadrature if not details else quadrature.resolving(min(details)),
        graded=needs.everywhere or temperature_by_scale(scene) or borders is not None,
        logarithmic=any(surface.interpolation is MeansInterpolation.LOGARITHMIC for surface in surfaces),
        borders=_borders(scene, surfaces, borders),
        moving=temperature_by_scale(scene),
        join=join,
    )
    if join is not None:
        # At rest both surfaces meet the same stiffness.
        surfaces = surfaces[:1]
    scale, gamma = modulus_scale(scene), jnp.asarray(scene.gamma)
    correction = None
    if like is not None:
        tables, correction = _tables_of(like, needs), like.correction
    tables = (None,) * len(surfaces) if tables is None else tables[: len(surfaces)]
    if correction is None and scene.area_correction and needs.area:
        correction = correction_table(gamma)
    pairs = zip(surfaces, tables, strict=True)
    return Roughness(
        mesh,
        tuple(
            contribution(surface, mesh, j, scale, needs, table, span)
            for j, (surface, table) in enumerate(pairs)
        ),
        tuple(surface.side for surface in surfaces),
        scale,
        gamma,
        correction,
        scene.correlation,
        approximate=like is not None,
    )


def _tables_of(roughness, needs):
    """Return the `MeansTable` of each contribution.

    An entry is None if the contribution has no table with the needed means.
    """
    stiffnesses = [contribution.stiffness for contribution in roughness.contributions]
    return tuple(
        stiffness.prepared
        if stiffness is not None
        and isinstance(stiffness.prepared, MeansTable)
        and stiffness.harmonics is None
        and stiffness.needs.kinds == needs.kinds
        else None
        for stiffness in stiffnesses
    )


def _borders(scene, surfaces, requested):
    """Return wavevectors that must be borders of panels, or None.

    The wavevector of the macroasperities comes first, and the `requested` borders come last.
    """
    borders = [*borders_of_heat(scene), *kinks(surfaces), *([] if requested is None else [requested])]
    return jnp.concatenate(borders) if borders else None


@exact_products
def solved(
    prepared: Prepared, velocity: jax.Array, pressure: jax.Array, temperature: jax.Array | None = None
) -> tuple[Contact, Temperatures | None]:
    """Return the `Contact` at points, and the `Temperatures` if the scene is heated.

    Raises
    ------
    ValueError : no prepared quantity is an integral, or a heated scene has no temperature.
    """
    roughness, thermal = prepared.roughness, prepared.thermal
    if thermal is None:
        both = SurfaceTemperatures(temperature, temperature)
        temperatures = [both] * len(roughness.contributions)
        if prepared.adhesion is not None:
            return adhesive_contact(prepared.adhesion, roughness, velocity, pressure, temperatures), None
        return roughness.contact(velocity, pressure, temperatures), None
    if temperature is None:
        raise ValueError("temperature is missing: a scene with heating requires it, far from the contact [K]")
    surfaces = solve_temperatures(thermal, roughness, velocity, pressure, temperature)
    return roughness.contact(velocity, pressure, surfaces.inside), surfaces


class FixedPoint(NamedTuple):
    """Unknowns y of the points with y = f(y), without derivatives."""

    unknowns: jax.Array  # (points, unknowns)
    inverse: Inverse  # of 1 - f', approximate
    converged: jax.Array  # True for a fixed point, (points,)


def fixed_point_of(prepared: Prepared, points: tuple[jax.Array, jax.Array, jax.Array]) -> FixedPoint:
    """Return the `FixedPoint` of a scene that feeds back (`Structure.feeds_back`).

    The unknowns are temperature rises [K]. `points` are the fields of `Points`.
    """
    assert prepared.thermal is not None
    rises = solve_rises(prepared.thermal, prepared.roughness, points)
    return FixedPoint(rises.rises, preconditioner(prepared.thermal, rises), rises.converged)


def imbalance_of(
    prepared: Prepared,
    solution: FixedPoint,
    unknowns: jax.Array,
    points: tuple[jax.Array, jax.Array, jax.Array],
) -> tuple[jax.Array, tuple[Contact, Temperatures]]:
    """Return f(y) - y at the unknowns y, and the argument `known` of `evaluate` there."""
    assert prepared.thermal is not None
    return imbalance(prepared.thermal, prepared.roughness, unknowns, points, solution.converged)


@exact_products
def evaluate(
    prepared: Prepared,
    quantities: Iterable[str],
    points: Iterable[jax.Array],
    known: tuple[Contact, Temperatures | None] | None = None,
) -> dict[str, jax.Array]:
    """Evaluate prepared quantities at points.

    Parameters
    ----------
    prepared : Prepared, for at least these quantities
    quantities : fields of `Solution`
    points : fields of `Points`
    known : result of `solved` for these points, or None

    Returns
    -------
    dict from the quantities to arrays, shape (points,)
    """
    velocity, pressure, temperature = Points(*points)
    parts = quantity_parts(quantities)
    sheared = prepared.shear is not None and "shear_friction" in parts
    # Smooth surfaces: flash temperature = background.
    results = {} if temperature is None else {"flash_temperature": temperature}
    surface = temperature
    wanted = parts | {"area"} if sheared else parts
    if prepared.law is not None:
        by_law = solve_law(prepared.law, velocity, pressure, temperature)
        results |= {"area": by_law.area, "viscoelastic_friction": by_law.mu, "converged": by_law.converged}
        if by_law.across:
            results["transverse_friction"] = by_law.across[0]
        wanted = wanted & {"separation"}
    if prepared.integrated is not None:
        contact, temperatures = known or solved(prepared, velocity, pressure, temperature)
        results |= _integrated(contact, wanted)
        if contact.converged is not None:
            results["converged"] = contact.converged
        if temperatures is not None:
            results |= {"flash_temperature": temperatures.flash, "converged": temperatures.converged}
            surface = temperatures.surface

    def value(name):
        return results[name] if name in results else _constant(name, pressure)

    if prepared.shear is not None and sheared:
        results["shear_friction"] = shear_friction(prepared.shear, value("area"), velocity, pressure, surface)
    if "friction" in quantities:
        results["friction"] = value("viscoelastic_friction")
        if sheared:
            results["friction"] = results["friction"] + results["shear_friction"]
    return {name: jnp.broadcast_to(value(name), velocity.shape) for name in quantities}


def _integrated(contact, parts):
    results = {"area": contact.area()} if "area" in parts else {}
    for name, kind in (("viscoelastic_friction", "mean_cos_loss"), ("transverse_friction", "mean_sin_loss")):
        if name in parts and (terms := contact.friction_terms(kind)):
            results[name] = total(jnp.sum(values, (0, 2)) for values in terms.values())
    if "separation" in parts:
        results["separation"] = contact.separation()
    return results


def _constant(name, pressure):
    """Return the value of a quantity that is constant in the scene.

    `converged` is True, the area is 1 (full contact of smooth surfaces), and every other quantity is 0.
    """
    if name == "converged":
        return jnp.ones_like(pressure, bool)
    return jnp.full_like(pressure, 1.0 if name == "area" else 0.0)
