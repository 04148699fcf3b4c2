"""Contact with short-range or long-range adhesion.

Contact with adhesion equals the contact without adhesion under a larger load. The functions of this module
compute the larger load.
"""

import functools
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import legendre

from rubberfric.base.quadrature import gauss, legendre_transform, typed
from rubberfric.scene.interface import Adhesion
from rubberfric.theory.area.constant_area import (
    LIGHTEST,
    Unloading,
    solve_energy_criterion,
    work_at_constant_area,
)
from rubberfric.theory.area.long_range import Gaps, evaluate_attraction, solve_dmt_load
from rubberfric.theory.area.partial_contact import contact_argument
from rubberfric.theory.area.separations import loss_table
from rubberfric.theory.contact import Contact, Roughness
from rubberfric.theory.contributions import total
from rubberfric.theory.structure import SurfaceTemperatures


def adhesive_contact(
    adhesion: Adhesion,
    roughness: Roughness,
    velocity: jax.Array,
    pressure: jax.Array,
    temperatures: Sequence[SurfaceTemperatures],
) -> Contact:
    """Return the `Contact` with adhesion at points.

    `velocity`, `pressure` and `temperatures` are as for `Roughness.contact`.
    """
    contact = roughness.contact(velocity, pressure, temperatures)
    if contact.G is None:
        return contact
    if adhesion.limit == "short":
        pressed = solve_energy_criterion(_unloading(adhesion, contact, pressure))
    else:
        pressed = solve_dmt_load(_gaps(adhesion, roughness, contact, pressure), roughness.mesh.q.shape[1])
    return contact.under(*pressed)


def relative_attraction(
    adhesion: Adhesion,
    roughness: Roughness,
    velocity: jax.Array,
    pressure: jax.Array,
    temperatures: Sequence[SurfaceTemperatures],
) -> tuple[Contact, jax.Array]:
    """Return the contact without adhesion, and the long-range attraction in this contact.

    The attraction is divided by work / range and has the shape (points,). Arguments are as for
    `adhesive_contact`.
    """
    contact = roughness.contact(velocity, pressure, temperatures)
    gaps = _gaps(adhesion, roughness, contact, pressure)
    return contact, evaluate_attraction(gaps, roughness.mesh.q.shape[1])


def work_of_separation(
    adhesion: Adhesion,
    roughness: Roughness,
    velocity: jax.Array,
    temperatures: Sequence[SurfaceTemperatures],
) -> jax.Array:
    """Return the work that separates solids with short-range adhesion [J/m^2], of shape (points,).

    Arguments are as for `adhesive_contact`. The work does not depend on the pressure.
    """
    # Under the unit of the moduli, G does not overflow.
    unit = jnp.broadcast_to(jax.lax.stop_gradient(roughness.scale), velocity.shape)
    contact = roughness.contact(velocity, unit, temperatures)
    G = jnp.sum(contact.G_panels, 0)
    # x = 1 / (2 sqrt(G)) is proportional to the load.
    load = jax.lax.stop_gradient(2 * LIGHTEST * jnp.sqrt(jnp.maximum(G, float(jnp.finfo(G.dtype).tiny))))
    lightest = contact.under(load, jnp.ones_like(load, bool))
    return load * unit * work_at_constant_area(_unloading(adhesion, lightest, load * unit))


def _gaps(adhesion, roughness, contact, pressure):
    modulus = contact.modulus_over_pressure
    storage = total(terms.densities["mean_storage"] for terms in contact.terms)
    heights = (2 * jnp.pi * total(roughness.mesh.roughness) / roughness.mesh.q**2)[:, None]

    def in_a_row(begin, values, end):
        begin, end = (jnp.broadcast_to(x, pressure.shape)[:, None] for x in (begin, end))
        return jnp.concatenate([begin, _in_a_row(values, pressure, contact.G.shape), end], -1)

    def beyond(terms):
        return in_a_row(jnp.sum(terms, (0, 2)), _from_nodes_on(terms), 0.0)

    return Gaps(
        knots=in_a_row(0.0, contact.G, jnp.sum(contact.G_panels, 0)) / modulus[:, None] ** 2,
        storage=beyond(storage),
        heights=beyond(heights),
        stiffness=modulus,
        strength=adhesion.work / (adhesion.range * pressure),
        reach=adhesion.range,
        gamma=roughness.gamma,
        correction=roughness.correction,
        lost=loss_table(roughness.gamma),
    )


def _unloading(adhesion, contact, pressure):
    storage = total(terms.densities["mean_storage"] for terms in contact.terms)
    x = contact.x
    return Unloading(
        x=_in_a_row(x, pressure),
        storage=_in_a_row(storage, pressure, x.shape),
        end=contact_argument(jnp.sum(contact.G_panels, 0)),
        stiffness=contact.modulus_over_pressure,
        gain=2 * adhesion.work / pressure,
        gamma=contact.gamma,
        correction=contact.correction,
    )


def _in_a_row(values, pressure, shape=None):
    """Flatten values at the nodes to one row for each point.

    If `shape` is given, the values are first broadcast to `shape`.
    """
    panels, _, order = values.shape if shape is None else shape
    values = jnp.broadcast_to(values, (panels, pressure.shape[0], order))
    return jnp.moveaxis(values, 1, 0).reshape(pressure.shape[0], -1)


def _from_nodes_on(values):
    """Return the integrals from every node to the end of the last panel, of shape (panels, points, order).

    `values` is the integrand at each node times the weight of the node, of shape (panels, points, order).
    """
    rule = typed(_integrals_to_the_end(values.shape[-1]), values)
    after = jnp.cumsum(jnp.sum(values, -1)[::-1], 0)[::-1]
    after = jnp.concatenate([after[1:], jnp.zeros_like(after[:1])])
    return after[..., None] + jnp.einsum("kpj,ij->kpi", values, rule)


@functools.cache
def _integrals_to_the_end(order):
    """Return weights of the integrals from every Gauss node to the end of the panel.

    The weights have the shape (order, order). Row i has the weights of the integral that begins at node i.
    Entry (i, j) multiplies the product of the integrand and the Gauss weight at node j.
    """
    node, weight = gauss(order)
    y = node[:, None] + (1 - node[:, None]) * node
    values = legendre.legvander(2 * y - 1, order - 1) @ legendre_transform(order)
    return np.einsum("imj,m->ij", values, weight) * (1 - node[:, None]) / weight
