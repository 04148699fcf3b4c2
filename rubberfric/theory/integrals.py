r"""The radial integrals over ln q, for many velocities and pressures at once.

`prepare` does what depends on the scene alone; `evaluate` adds velocity, pressure and
temperature. With d^2q = q^2 d ln q dphi and K_j = (q/2) scale factor_j F_j,

.. math:: G(q) = \left(\frac{scale}{\sigma_0}\right)^2 g(q),\qquad
          g = \frac{\pi}{4}\int d\ln q \sum_j q^4 C_j\, factor_j^2 \langle|F_j|^2\rangle
.. math:: \mu = \pi\frac{scale}{\sigma_0}\int d\ln q\; S P
          \sum_j q^4 C_j\, factor_j \langle\cos\varphi\,\mathrm{Im}F_j\rangle
.. math:: \bar u = \frac{\pi}{2}\frac{scale}{\sigma_0}\int d\ln q\; x\Psi(x)
          \sum_j q^3 C_j\, factor_j\langle\mathrm{Re}F_j\rangle

The transverse friction is the second with sin(phi) in place of cos(phi).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.quadrature import Quadrature
from rubberfric.roughness.mesh import Mesh, build_mesh
from rubberfric.scene.scene import dissipates, rough_pairs
from rubberfric.scene.softening import knots, softened_of
from rubberfric.theory.area_correction import correction_table
from rubberfric.theory.contributions import is_logarithmic, make_channel, total
from rubberfric.theory.partial_contact import separation_weight
from rubberfric.theory.stiffness.factors import modes_of
from rubberfric.theory.stiffness.series import modulus_scale
from rubberfric.theory.stress_fluctuation import contact, contact_area, friction_terms
from rubberfric.theory.temperatures import Thermal, macroasperity, prepare_thermal, solve_temperatures


class Prepared(NamedTuple):
    """A scene ready for many points."""

    mesh: Mesh | None
    channels: tuple
    scale: jax.Array | None  # unit of all moduli [Pa]
    gamma: jax.Array | None
    correction: object  # table of S in G, or None
    thermal: Thermal | None
    quantities: tuple
    wanted: frozenset  # angular means: "power", "dissipation", "storage", "transverse"
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
    if "transverse_friction" in quantities and pulls_aside(scene):
        wanted |= {"power", "dissipation", "transverse"}
    if pairs and "separation" in quantities:
        wanted |= {"power", "storage"}
    if pairs and scene.heating is not None and quantities:
        wanted |= {"power", "dissipation"} if dissipates(scene) else {"power"}
    wanted = frozenset(wanted)
    if not wanted:
        return Prepared(None, (), None, None, None, None, quantities, wanted, quadrature)
    logarithmic = any(is_logarithmic(*pair) for pair in pairs)
    softened = softened_of(scene)
    mesh = build_mesh(
        [rough.spectrum.power_law() for rough, _ in pairs] if laws is None else laws,
        quadrature,
        graded=wanted != {"power"} or scene.heating is not None or marks is not None,
        logarithmic=logarithmic,
        marks=_marks(scene, softened, marks),
    )
    scale = modulus_scale(scene)
    channels = tuple(
        make_channel(mesh, j, pair, softened, scale, wanted, quadrature) for j, pair in enumerate(pairs)
    )
    corrected = scene.area_correction and ("area" in quantities or "dissipation" in wanted)
    table = correction_table(scene.gamma) if corrected else None
    thermal = None if scene.heating is None else prepare_thermal(scene, mesh, quadrature)
    return Prepared(mesh, channels, scale, scene.gamma, table, thermal, quantities, wanted, quadrature)


def pulls_aside(scene):
    """Whether roughness that differs with the direction excites a viscoelastic solid."""
    return any(modes_of(*pair, None).harmonics for pair in rough_pairs(scene))


def _marks(scene, softened, asked):
    """Wavevectors that must be borders of panels: the macroasperities' first, those asked for last."""
    marks = [] if scene.heating is None else [macroasperity(scene.heating)[None]]
    marks += [] if softened is None else [knots(softened)]
    marks += [] if asked is None else [asked]
    return jnp.concatenate(marks) if marks else None


def evaluate(prepared, velocity, pressure, temperature=None):
    """Quantities at points, each of shape (points,) or (1,) where nothing depends on the point.

    Parameters
    ----------
    prepared : Prepared
    velocity, pressure : shape (points,) [m/s], [Pa]
    temperature : shape (points,) [K], or None

    Returns
    -------
    dict from the names in prepared.quantities to arrays; of a heated scene also "flash_temperature"
    and "converged".
    """
    quantities, wanted = prepared.quantities, prepared.wanted
    results = _integrals(prepared, velocity, pressure, temperature) if wanted else {}
    constants = {
        "area": 1.0,
        "friction": 0.0,
        "separation": 0.0,
        "transverse_friction": 0.0,
        "converged": True,
    }
    if not wanted and temperature is not None:
        results = {"flash_temperature": temperature}  # without roughness there is no scale to be hot
    return results | {
        name: jnp.full_like(pressure, constants[name]) for name in quantities if name not in results
    }


def _integrals(prepared, velocity, pressure, temperature):
    """What does not follow from the structure of the scene alone."""
    wanted, results = prepared.wanted, {}
    state, temperatures = solved(prepared, velocity, pressure, temperature)
    if temperatures is not None:
        results = {"flash_temperature": temperatures.flash, "converged": temperatures.converged}
    if "area" in prepared.quantities:
        results["area"] = contact_area(prepared, state)
    for name, kind in (("friction", "dissipation"), ("transverse_friction", "transverse")):
        if kind in wanted and name in prepared.quantities:
            terms = friction_terms(prepared, state, kind).values()
            results[name] = total(jnp.sum(values, (0, 2)) for values in terms)
    if "storage" in wanted:
        density = total(part.storage for part in state.parts)
        weight = separation_weight(state.x, prepared.gamma)
        results["separation"] = jnp.pi / 2 * state.stiffness * jnp.sum(weight * density, (0, 2))
    return results


def solved(prepared, velocity, pressure, temperature):
    """`state.Contact` at points, and the `thermal.Temperatures` of a heated scene, else None."""
    if prepared.thermal is None:
        return contact(prepared, velocity, pressure, [temperature] * len(prepared.channels)), None
    temperatures = solve_temperatures(prepared, velocity, pressure, temperature)
    return contact(prepared, velocity, pressure, temperatures.warm), temperatures
