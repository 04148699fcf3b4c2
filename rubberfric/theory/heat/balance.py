r"""Heat balance: temperatures that result from the friction at given temperatures.

The unknowns are the temperature rises of every deformable solid at the angular nodes and at the
largest wavevector (the flash temperature). They are a fixed point of

.. math:: T \to E(a_T(T_q)\,\omega) \to G, P, S \to f(q) \to T

(`rubberfric.scene.heating` has the last step).
"""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp

from rubberfric.base.quadrature import Quadrature, between_nodes
from rubberfric.roughness.mesh.nodes import Mesh
from rubberfric.scene.heating import (
    Diffusion,
    Heating,
    HeatKernel,
    diffusion,
    heat_kernel,
    heating_of,
    rise_below_surface,
    rise_inside,
    shear_shares,
)
from rubberfric.scene.interface import ShearLaw, shear_friction
from rubberfric.scene.scene import Scene
from rubberfric.theory.contact import Contact, Roughness
from rubberfric.theory.structure import SurfaceTemperatures

# Velocity [m/s], pressure [Pa] and temperature far from the contact [K], shape (points,) each.
HeatedPoints = tuple[jax.Array, jax.Array, jax.Array]


# Mesh on which branches are followed. Its errors only displace the guess for the fine mesh.
COARSE = Quadrature(order=5, panels=3, graded=2, ratio=8.0, angular_order=6, heat=48)

_Tree = TypeVar("_Tree")
_OTHER = {"lower": "upper", "upper": "lower"}


class Coarse(NamedTuple):
    """A scene on a coarse mesh, on which branches are followed.

    The coarse mesh has about a tenth of the unknowns. Derivatives are stopped.
    """

    roughness: Roughness
    diffusion: Diffusion  # from contact nodes to unknowns of the coarse mesh
    prolonged: Diffusion  # to the unknowns of the scene
    restriction: jax.Array  # from unknowns of the scene to those of the coarse mesh, (coarse, fine)


class Thermal(NamedTuple):
    """Data for computing the temperatures of a heated scene."""

    heating: Heating
    bodies: tuple[Heating, ...]  # of every deformable solid, with its own properties
    shares: tuple[jax.Array, ...]  # share of every deformable solid in the heat of contact shear
    diffusion: Diffusion  # from the contact nodes to the angular nodes and the largest wavevector
    exciting: tuple[int | None, ...]  # for every deformable solid the contribution that strains it
    # For every contribution the index of the solid that it strains, and of the rough solid.
    solids: tuple[tuple[int | None, int | None], ...]
    shear: ShearLaw | None
    coarse: Coarse | None  # None if nothing depends on the temperature


class Temperatures(NamedTuple):
    """Temperatures at points [K]."""

    thermal: Thermal
    inside: list[SurfaceTemperatures]  # for each contribution, (angular panels, points, angular order)
    flash: jax.Array  # at the largest wavevector, mean of the deformable solids, (points,)
    surface: jax.Array  # of the contact shear, (points,)
    converged: jax.Array  # True for a solution, (points,)

    def at(
        self, roughness: Roughness, contact: Contact, points: HeatedPoints, q: jax.Array
    ) -> tuple[list[SurfaceTemperatures], jax.Array]:
        """Return the temperatures at wavevectors q [1/m] for each contribution, and their mean [K].

        Parameters
        ----------
        contact : from `rubberfric.theory.integrals.solved`
        points : HeatedPoints
        q : shape (wavevectors,)

        Returns
        -------
        SurfaceTemperatures of each contribution, of shape (points, wavevectors) for a solid that deforms,
        otherwise (points,); mean of the deformable solids, of shape (points, wavevectors)
        """
        T, background = temperature_at(roughness, contact, self, points, q), points[2]
        inside = [
            SurfaceTemperatures(*(background if solid is None else T[:, solid] for solid in pair))
            for pair in self.thermal.solids
        ]
        return inside, jnp.mean(T, 1)


def borders(scene: Scene) -> list[jax.Array]:
    """Return [q_m] with q_m = pi / R, the wavevector of the macroasperities [1/m]; [] without heating."""
    return [] if scene.heating is None else [jnp.asarray(jnp.pi / scene.heating.radius)[None]]


def prepare_thermal(
    scene: Scene, roughness: Roughness, quadrature: Quadrature, coarse: Roughness | None
) -> Thermal:
    """Return the `Thermal` of a heated scene.

    Parameters
    ----------
    scene : Scene with heating
    roughness : Roughness
    quadrature : Quadrature; its `heat` is the number of nodes of the sum over ln k
    coarse : Roughness on the mesh of `COARSE`; None if the heat does not depend on the temperature
    """
    heating = scene.heating
    assert heating is not None
    bodies = {"lower": scene.lower, "upper": scene.upper}
    solids = [side for side, body in bodies.items() if body.material.deforms]
    own = {side: heating_of(heating, body.thermal) for side, body in bodies.items()}
    shares = dict(zip(bodies, shear_shares(own["lower"], own["upper"], len(solids) == 2), strict=True))
    mesh, sides = roughness.mesh, roughness.strained
    thermal = Thermal(
        heating=heating,
        bodies=tuple(own[side] for side in solids),
        shares=tuple(shares[side] for side in solids),
        diffusion=_diffusion(mesh, unknowns(mesh), quadrature.heat),
        exciting=tuple(_index(sides, side) for side in solids),
        solids=tuple((_index(solids, side), _index(solids, _OTHER[side])) for side in sides),
        shear=scene.shear,
        coarse=None,
    )
    if coarse is None:
        return thermal
    linear = _linear(jnp.log(unknowns(mesh)), jnp.log(unknowns(coarse.mesh)))
    coarse_balance = Coarse(
        coarse,
        _diffusion(coarse.mesh, unknowns(coarse.mesh), COARSE.heat),
        _diffusion(coarse.mesh, unknowns(mesh), COARSE.heat),
        jnp.kron(jnp.eye(len(solids), dtype=linear.dtype), linear),
    )
    return thermal._replace(coarse=without_derivatives(coarse_balance))


def _index(values, value):
    return values.index(value) if value in values else None


def unknowns(mesh: Mesh) -> jax.Array:
    """Return the wavevectors at which temperatures are unknown [1/m].

    These wavevectors are the angular nodes and, at the end, the largest wavevector.
    """
    return jnp.concatenate([mesh.angular_q.reshape(-1), mesh.last[None]])


def without_derivatives(tree: _Tree) -> _Tree:
    """Stop the derivatives of all JAX arrays in a tree, and keep other leaves unchanged."""
    return jax.tree.map(lambda x: jax.lax.stop_gradient(x) if isinstance(x, jax.Array) else x, tree)


def inner_temperatures(
    thermal: Thermal, mesh: Mesh, rises: jax.Array, background: jax.Array
) -> tuple[list[SurfaceTemperatures], jax.Array]:
    """Return temperatures inside the solids and at the largest wavevector, given the temperature rises.

    Parameters
    ----------
    thermal, mesh : Thermal, Mesh
    rises : temperature rises of every deformable solid in turn [K], shape (points, solids * unknowns)
    background : [K], shape (points,)

    Returns
    -------
    inside : SurfaceTemperatures of each rough surface [K]
        The shape is (angular panels, points, angular order) for a solid that deforms, otherwise (points,).
    flash : mean temperature of the deformable solids at the largest wavevector [K], shape (points,)
    """
    solids = len(thermal.exciting)
    # Iterates may overshoot to below T_0, where a shift has its pole. `where` is used instead of a maximum,
    # which would halve the derivative at v = 0. NaN stays NaN.
    rises = jnp.where(rises < 0, 0.0, rises).reshape(rises.shape[0], solids, -1)
    inside = rises[..., :-1].reshape(-1, solids, *mesh.angular_q.shape)
    T = background[:, None] + jnp.moveaxis(inside, 0, 2)  # solids, panels, points, order
    inner = [
        SurfaceTemperatures(*(background if solid is None else T[solid] for solid in pair))
        for pair in thermal.solids
    ]
    return inner, background + jnp.mean(rises[..., -1], 1)


def heat_balance(
    thermal: Thermal, roughness: Roughness, ready: Diffusion, points: HeatedPoints
) -> Callable[[jax.Array], jax.Array]:
    """Return the function from assumed temperature rises to the rises that the friction then causes.

    The assumed rises belong to the unknowns of the mesh. The resulting rises belong to the target wavevectors
    of `ready`.

    Parameters
    ----------
    thermal : Thermal
    roughness : on the mesh of the unknowns
    ready : Diffusion from the contact nodes of this mesh to the target wavevectors
    points : HeatedPoints

    Returns
    -------
    function from rises of shape (points, solids * unknowns) to rises of shape (points, solids * targets) [K]
    """
    velocity, pressure, background = points
    spread = _heat_kernels(thermal, ready, velocity)

    def caused(rises):
        inside, flash = inner_temperatures(thermal, roughness.mesh, rises, background)
        contact = roughness.contact(velocity, pressure, inside)
        surface = shear_temperature(thermal.heating, flash, background)
        new_rises = _rises(thermal, roughness, spread, contact, (velocity, pressure, surface))
        return new_rises.reshape(velocity.shape[0], -1)

    return caused


def heat_of(
    thermal: Thermal, roughness: Roughness, contact: Contact, points: HeatedPoints, surface: jax.Array
) -> jax.Array:
    """Return the temperature rises [K] that the friction of a contact causes.

    The result has the shape (points, solids * unknowns). `surface` is the temperature of the contact shear
    [K], of shape (points,).
    """
    velocity, pressure, _ = points
    spread = _heat_kernels(thermal, thermal.diffusion, velocity)
    rises = _rises(thermal, roughness, spread, contact, (velocity, pressure, surface))
    return rises.reshape(velocity.shape[0], -1)


def temperature_at(
    roughness: Roughness, contact: Contact, temperatures: Temperatures, points: HeatedPoints, q: jax.Array
) -> jax.Array:
    """Return the temperatures of the deformable solids at wavevectors q [K].

    The result has the shape (points, solids, wavevectors).

    Parameters
    ----------
    contact, temperatures : from `rubberfric.theory.integrals.solved`
    points : HeatedPoints
    q : [1/m], shape (wavevectors,)
    """
    (velocity, pressure, background), thermal = points, temperatures.thermal
    ready = _diffusion(roughness.mesh, q, thermal.diffusion.k.size)
    spread = _heat_kernels(thermal, ready, velocity)
    rises = _rises(thermal, roughness, spread, contact, (velocity, pressure, temperatures.surface))
    return background[:, None, None] + rises


def shear_temperature(heating: Heating, flash: jax.Array, background: jax.Array) -> jax.Array:
    """Return the temperature at which contact shear is evaluated [K]."""
    return flash if heating.shear_at == "flash" else background


def _diffusion(mesh, targets, count):
    ends = mesh.angular_q[0, 0], mesh.angular_q[-1, -1]
    return diffusion(mesh.q.reshape(-1), targets, ends, count)


def _linear(nodes, targets):
    """Return weights of linear interpolation between ascending nodes, of shape (targets, nodes).

    Beyond the first and the last node the interpolant is constant.
    """
    index, share = between_nodes(nodes, targets)
    share, chosen = share[:, None], jax.nn.one_hot(index, nodes.shape[0], dtype=nodes.dtype)
    return chosen * (1 - share) + jnp.roll(chosen, 1, 1) * share


def _heat_kernels(thermal: Thermal, ready: Diffusion, velocity: jax.Array) -> list[HeatKernel]:
    """Return the `HeatKernel` of every deformable solid.

    Two solids share one kernel if they share one `Heating` object.
    """
    kernels: list[HeatKernel] = []
    for i, heating in enumerate(thermal.bodies):
        same = i > 0 and heating is thermal.bodies[0]
        kernels.append(
            kernels[0] if same else heat_kernel(heating, ready, velocity, thermal.shear is not None)
        )
    return kernels


def _rises(thermal, roughness, spread, contact, points):
    """Return the temperature rises [K] from the friction of one contact.

    The result has the shape (points, solids, wavevectors).
    """
    heating, pressure = thermal.heating, points[1]
    # q_m is a panel border, so only whole panels lie before it.
    area = heating.area_fraction
    area = contact.area(roughness.mesh.panels_below[0]) if area is None else area
    stress = pressure / area
    terms = contact.friction_terms()
    count = pressure.shape[0]
    sheared = None
    if thermal.shear is not None:
        sheared = shear_friction(thermal.shear, contact.area(), *points) * stress
    rises = []
    for exciting, share, own in zip(thermal.exciting, thermal.shares, spread, strict=True):
        rise = jnp.zeros((count, own.diffusion.wavevector.shape[0]), pressure.dtype)
        if sheared is not None:
            rise = rise_below_surface(own, share * sheared)
        if exciting in terms:
            power = jnp.moveaxis(terms[exciting], 0, 1).reshape(count, -1) * stress[:, None]
            rise = rise + rise_inside(own, power)
        rises.append(rise)
    return jnp.stack(rises, 1)
