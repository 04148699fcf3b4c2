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
from rubberfric.scene.scene import Scene
from rubberfric.scene.shear import ContactShear, shear_friction
from rubberfric.theory.stress_fluctuation import Contact, Roughness


class Thermal(NamedTuple):
    """What temperatures need of a scene."""

    heating: Heating
    diffusion: Diffusion  # from the contact nodes to the angular nodes and the largest wavevector
    exciting: tuple[int | None, ...]  # for every deformable solid the contribution that strains it
    strained: tuple[int | None, ...]  # for every contribution which of these solids it strains
    shear: ContactShear | None
    feedback: bool  # whether anything depends on the temperature


class Temperatures(NamedTuple):
    """Temperatures at points [K]."""

    # For each contribution, of the solid it strains: (angular panels, points, angular order).
    strained: list[jax.Array]
    flash: jax.Array  # at the largest wavevector, of two deformable solids the mean, (points,)
    surface: jax.Array  # that the contact shear has, (points,)
    converged: jax.Array  # whether they are a solution, (points,)


def macroasperity(heating: Heating) -> jax.Array:
    """q_m = pi / R, the wavevector of the macroasperities [1/m]."""
    return jnp.asarray(jnp.pi / heating.radius)


def prepare_thermal(heating: Heating, scene: Scene, roughness: Roughness, count: int) -> Thermal:
    """`Thermal` of a scene heated so; count: nodes of the sum over ln k."""
    bodies = {"lower": scene.lower, "upper": scene.upper}
    solids = [side for side, body in bodies.items() if body.material.deforms]
    mesh, sides = roughness.mesh, roughness.strained
    shifts = [bodies[side].material.shift for side in solids]
    if scene.shear is not None and heating.shear_at == "flash":
        shifts.append(scene.shear.shift)
    targets = jnp.concatenate([mesh.angular_q.reshape(-1), mesh.last[None]])
    return Thermal(
        heating=heating,
        diffusion=_diffusion(mesh, targets, count),
        exciting=tuple(sides.index(side) if side in sides else None for side in solids),
        strained=tuple(solids.index(side) if side in solids else None for side in sides),
        shear=scene.shear,
        feedback=any(shift is not None for shift in shifts),
    )


def solve_temperatures(
    thermal: Thermal, roughness: Roughness, velocity: jax.Array, pressure: jax.Array, background: jax.Array
) -> Temperatures:
    """`Temperatures` of a heated scene at points: velocity, pressure, background of shape (points,)."""
    nodes = roughness.mesh.angular_q
    solids, rows = len(thermal.exciting), nodes.size + 1
    spread = memory(thermal.heating, thermal.diffusion, velocity, thermal.shear is not None)

    def named(flat, converged):
        # Iterates may overshoot to below T_0, where a shift of the modulus has its pole. Selected, not
        # a maximum, which would give half the derivative at v = 0; what is not a number stays so.
        rises = jnp.where(flat < 0, 0.0, flat).reshape(-1, solids, rows)
        inside = rises[..., :-1].reshape(-1, solids, *nodes.shape)
        T = background[:, None] + jnp.moveaxis(inside, 0, 2)  # solids, panels, points, order
        strained = [background if solid is None else T[solid] for solid in thermal.strained]
        flash = background + jnp.mean(rises[..., -1], 1)
        surface = flash if thermal.heating.shear_at == "flash" else background
        return Temperatures(strained, flash, surface, converged)

    def heat(flat):
        guess = named(flat, None)
        contact = roughness.contact(velocity, pressure, guess.strained)
        points = velocity, pressure, guess.surface
        return _rises(thermal, roughness, spread, contact, points).reshape(flat.shape)

    start = jnp.zeros((velocity.shape[0], solids * rows), velocity.dtype)
    if thermal.feedback:
        return named(*fixed_point(heat, start))
    return named(heat(start), jnp.ones_like(velocity, bool))


def temperature_at(
    thermal: Thermal,
    roughness: Roughness,
    contact: Contact,
    temperatures: Temperatures,
    points: tuple[jax.Array, jax.Array, jax.Array],
    q: jax.Array,
) -> jax.Array:
    """Temperature of every deformable solid at wavevectors q, (points, solids, wavevectors) [K].

    Parameters
    ----------
    contact, temperatures : `rubberfric.theory.integrals.solved` of the scene
    points : velocity, pressure, temperature far from the contact, shape (points,)
    q : [1/m], shape (wavevectors,)
    """
    velocity, pressure, background = points
    ready = _diffusion(roughness.mesh, q, thermal.diffusion.k.size)
    spread = memory(thermal.heating, ready, velocity, thermal.shear is not None)
    rises = _rises(thermal, roughness, spread, contact, (velocity, pressure, temperatures.surface))
    return background[:, None, None] + rises


def _diffusion(mesh, targets, count):
    """`Diffusion` from the contact nodes to wavevectors."""
    ends = mesh.angular_q[0, 0], mesh.angular_q[-1, -1]
    return diffusion(mesh.q.reshape(-1), targets, ends, count)


def _rises(thermal, roughness, spread, contact, points):
    """Temperature rises of the heat of one contact, (points, solids, rows)."""
    heating, pressure = thermal.heating, points[1]
    # Borders of panels lie at q_m: what comes before are whole panels.
    area = heating.area_fraction
    area = contact.area(roughness.mesh.panels_below[0]) if area is None else area
    stress = pressure / area
    terms = contact.friction_terms()
    count = pressure.shape[0]
    at_surface = jnp.zeros((count, spread.diffusion.wavevector.shape[0]), pressure.dtype)
    if thermal.shear is not None:
        sheared = shear_friction(thermal.shear, contact.area(), *points)
        at_surface = rise_below_surface(spread, heating.shear_share * sheared * stress)
    found = []
    for exciting in thermal.exciting:
        rise = at_surface
        if exciting in terms:
            power = jnp.moveaxis(terms[exciting], 0, 1).reshape(count, -1) * stress[:, None]
            rise = rise + rise_inside(spread, power)
        found.append(rise)
    return jnp.stack(found, 1)
