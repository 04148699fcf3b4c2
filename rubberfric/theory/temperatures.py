r"""Temperatures of a heated scene: friction heats the solids, which softens them, which changes friction.

The unknowns are the temperature rises of every deformable solid at the angular nodes and at the
largest wavevector, the flash temperature. They are a fixed point of

.. math:: T \to E(a_T(T_q)\,\omega) \to G, P, S \to f(q) \to T

(`rubberfric.scene.heating` has the last step, `rubberfric.base.fixed_point` the solver), found from T = T_0:
of several solutions the one that this leads to.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.fixed_point import fixed_point
from rubberfric.scene.heating import Diffusion, Heating, diffusion, memory, rise_below_surface, rise_inside
from rubberfric.scene.scene import rough_pairs
from rubberfric.scene.shear import shear_friction
from rubberfric.theory.stress_fluctuation import contact, contact_area, friction_terms


class Thermal(NamedTuple):
    """What temperatures need of a scene."""

    heating: Heating
    diffusion: Diffusion  # from the contact nodes to the angular nodes and the largest wavevector
    exciting: tuple  # for every deformable solid the channel that excites it, or None
    heated: tuple  # for every channel which of them it excites, or None
    shear: object  # ContactShear or None
    feedback: bool  # whether anything depends on the temperature


def macroasperity(heating):
    """q_m = pi / R, the wavevector of the macroasperities [1/m]."""
    return jnp.asarray(jnp.pi / heating.radius)


def prepare_thermal(scene, mesh, quadrature):
    """`Thermal` of a heated scene."""
    pairs = rough_pairs(scene)
    solids = [body for body in (scene.lower, scene.upper) if body.material.deforms]
    others = [other for _, other in pairs]
    exciting = tuple(next((j for j, other in enumerate(others) if other is solid), None) for solid in solids)
    heated = tuple(next((b for b, solid in enumerate(solids) if solid is other), None) for other in others)
    ends = mesh.angular_q[0, 0], mesh.angular_q[-1, -1]
    targets = jnp.concatenate([mesh.angular_q.reshape(-1), mesh.last[None]])
    shifts = [solid.material.shift for solid in solids]
    sheared = scene.shear is not None and scene.heating.shear_at == "flash"
    if sheared:
        shifts.append(scene.shear.shift)
    return Thermal(
        heating=scene.heating,
        diffusion=diffusion(mesh.q.reshape(-1), targets, ends, quadrature.heat),
        exciting=exciting,
        heated=heated,
        shear=scene.shear,
        feedback=any(shift is not None for shift in shifts),
    )


class Temperatures(NamedTuple):
    """Temperatures at points [K]."""

    warm: list  # for each channel, of the solid it excites: (angular panels, points, angular order)
    flash: jax.Array  # at the largest wavevector, of two deformable solids the mean, (points,)
    converged: jax.Array  # whether they are a solution, (points,)


def solve_temperatures(prepared, velocity, pressure, background):
    """`Temperatures` of a heated scene at points: velocity, pressure, background of shape (points,)."""
    thermal, mesh = prepared.thermal, prepared.mesh
    solids, rows = len(thermal.exciting), mesh.angular_q.size + 1
    spread = memory(thermal.heating, thermal.diffusion, velocity, thermal.shear is not None)

    def named(flat, converged):
        # Iterates may overshoot to below T_0, where a shift of the modulus has its pole. Selected, not
        # a maximum, which would give half the derivative at v = 0; what is not a number stays so.
        rises = jnp.where(flat < 0, 0.0, flat).reshape(-1, solids, rows)
        inside = rises[..., :-1].reshape(-1, solids, *mesh.angular_q.shape)
        T = background[:, None] + jnp.moveaxis(inside, 0, 2)  # solids, panels, points, order
        warm = [background if solid is None else T[solid] for solid in thermal.heated]
        return Temperatures(warm, background + jnp.mean(rises[..., -1], 1), converged)

    def heat(flat):
        guess = named(flat, None)
        state = contact(prepared, velocity, pressure, guess.warm)
        surface = shear_temperature(thermal.heating, guess.flash, background)
        return _rises(prepared, spread, state, (velocity, pressure, surface)).reshape(-1, solids * rows)

    start = jnp.zeros((velocity.shape[0], solids * rows), velocity.dtype)
    if thermal.feedback:
        return named(*fixed_point(heat, start))
    return named(heat(start), jnp.ones_like(velocity, bool))


def temperature_at(prepared, state, temperatures, velocity, pressure, background, q):
    """Temperature of every deformable solid at wavevectors q, (points, solids, wavevectors) [K]."""
    ends = prepared.mesh.angular_q[0, 0], prepared.mesh.angular_q[-1, -1]
    thermal = prepared.thermal
    ready = diffusion(prepared.mesh.q.reshape(-1), q, ends, prepared.quadrature.heat)
    spread = memory(thermal.heating, ready, velocity, thermal.shear is not None)
    surface = shear_temperature(thermal.heating, temperatures.flash, background)
    return background[:, None, None] + _rises(prepared, spread, state, (velocity, pressure, surface))


def shear_temperature(heating, flash, background):
    """The temperature that the contact shear has [K]."""
    return flash if heating.shear_at == "flash" else background


def _rises(prepared, spread, state, points):
    """Temperature rises of the heat of one state of contact, (points, solids, rows)."""
    thermal, pressure = prepared.thermal, points[1]
    heating = thermal.heating
    # Borders of panels lie at q_m: what comes before are whole panels.
    area = heating.area_fraction
    area = contact_area(prepared, state, prepared.mesh.marks[0]) if area is None else area
    stress = pressure / area
    terms = friction_terms(prepared, state) if "dissipation" in prepared.wanted else {}
    count = pressure.shape[0]
    at_surface = jnp.zeros((count, spread.diffusion.wavevector.shape[0]), pressure.dtype)
    if thermal.shear is not None:
        sheared = shear_friction(thermal.shear, contact_area(prepared, state), *points)
        at_surface = rise_below_surface(spread, heating.shear_share * sheared * stress)
    found = []
    for exciting in thermal.exciting:
        rise = at_surface
        if exciting in terms:
            power = jnp.moveaxis(terms[exciting], 0, 1).reshape(count, -1) * stress[:, None]
            rise = rise + rise_inside(spread, power)
        found.append(rise)
    return jnp.stack(found, 1)
