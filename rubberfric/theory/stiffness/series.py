r"""Series stiffness K_j of the two solids, as roughness on solid j sees it.

Roughness on solid j excites the other solid o at omega = q v cos(phi) and its own solid
statically, so that [Scaraggi & Persson, (A6), (A8)]

.. math:: K_j(q, \omega) = \frac{1}{M_o(q, \omega) + M_j(q, 0)},\qquad M = \frac{2}{q E_r \bar S}

Everything here is about two bodies and wavevectors; velocity enters later. K_j is kept
as (q/2) * scale * factor * F with a modulus scale common to the scene [Pa], a real
factor (a slab's Sbar) known at every q, and F of order one: a constant, a Prony series
(a Prony solid in series with a spring is one again, and so is a coated one) or a tabulated modulus.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.materials.material import plane_strain
from rubberfric.materials.series.prony_and_prony import two_in_series
from rubberfric.materials.series.prony_and_spring import in_series
from rubberfric.scene.scene import relaxes
from rubberfric.scene.softening import softening_factors


class Static(NamedTuple):
    """F constant in omega: nothing relaxes."""

    value: jax.Array  # [-]


class Relaxing(NamedTuple):
    """F(s) = rest + sum_i weight_i s tau_i / (1 + s tau_i), per angular node or for all of them."""

    rest: jax.Array  # [-], shape () or (nodes,)
    weight: jax.Array  # [-], shape (n,) or (nodes, n)
    tau: jax.Array  # [s], same shape


class Tabulated(NamedTuple):
    """F = f k / (f + k) with the tabulated f(omega) = scaled E_r and a spring k (None: rigid)."""

    material: object
    scale: jax.Array  # f = scale * E [1/Pa], shape () or (nodes,)
    spring: jax.Array | None  # [-], shape () or (nodes,)
    table: object = None  # `tabulated.Table` of its angular means; None: they are taken at every node


class Sampled(NamedTuple):
    """F of a softened solid in series with a spring, at the contact nodes, (panels, order) each."""

    modulus: object  # TabulatedModulus, or Relaxing in units of the scale
    storage: jax.Array  # f times what makes it a stiffness in units of the scale
    loss: jax.Array  # the same with g
    spring: jax.Array  # the other solid at rest [-]


def modulus_scale(scene):
    """A modulus that makes every F of order one or less [Pa]: the softer solid's stiffest value.

    A unit only: results do not depend on it, so no gradient goes through it.
    """
    bodies = [body for body in (scene.lower, scene.upper) if body.material.deforms]
    highest = [body.material.glassy_reduced() for body in bodies]
    scale = highest[0] if len(highest) == 1 else jnp.minimum(*highest)
    # All moduli can be zero under jit, past the constructor's check: then nothing is stiff.
    return jax.lax.stop_gradient(jnp.where(scale > 0, scale, 1.0))


def series_stiffness(rough, other, scale, q, softened=None):
    """F of K_j for roughness on `rough`, facing `other`, without the factor of `layer_factor`.

    Parameters
    ----------
    rough, other : Body
    scale : modulus scale [Pa]
    q : (angular nodes, contact nodes) [1/m], any shapes
        A Static or Sampled F is given at the contact nodes, any other at the angular nodes.
    softened : `softening.Softened` or None

    Returns
    -------
    Static, Relaxing, Tabulated or Sampled
    """
    angular_q, contact_q = q
    if not relaxes(other):
        return Static(static_series(rough, other, scale, contact_q, softened))
    if softened is not None and rough.material.deforms:
        return _sampled(rough, other, scale, contact_q, softened)
    nodes = angular_q if by_node(rough, other) else None
    spring = _spring(rough, scale, nodes) if rough.material.deforms else None
    if other.layer is not None and not other.layer.multiplies:
        return _coated(other, scale, nodes, spring)
    own = None if nodes is None else _layer(other, nodes)
    if other.material.needs_quadrature:
        unit = plane_strain(other.material) / scale
        return Tabulated(other.material, unit if own is None else unit * own, spring)
    series = Relaxing(*other.material.reduced_series(scale))
    if spring is None:
        return series
    if own is None:
        return Relaxing(*in_series(*series, spring))
    return Relaxing(*in_series(own * series.rest, own[:, None] * series.weight, series.tau, spring))


def _sampled(rough, other, scale, q, softened):
    """F of a softened solid in series with another one, at the contact nodes q."""
    layer = _layer(other, q)
    if other.material.needs_quadrature:
        modulus, layer = other.material, layer * (plane_strain(other.material) / scale)
    else:
        modulus = Relaxing(*other.material.reduced_series(scale))
    storage, loss = (layer * factor for factor in softening_factors(softened, q))
    return Sampled(modulus, storage, loss, _spring(rough, scale, q, softened))


def _coated(body, scale, q, spring):
    """F of a coated body that relaxes, at the nodes q, in series with a spring or None."""
    series = body.layer.reduced_series(body.material, scale, q)
    if spring is not None:
        nothing = jnp.zeros(0, q.dtype)
        series = two_in_series(series, (spring, nothing, nothing))
    return Relaxing(*series)


def by_node(rough, other):
    """Whether F depends on q: a coating, or two deformable solids, at least one of them a layer."""
    layered = rough.layer is not None or other.layer is not None
    return (other.layer is not None and not other.layer.multiplies) or (layered and rough.material.deforms)


def layer_factor(rough, other, q):
    """Sbar at q where it multiplies all of a relaxing K_j (a slab faces a rigid solid); else None."""
    if other.layer is None or by_node(rough, other):
        return None
    return other.layer.stiffening(other.material.poisson, q)


def static_series(rough, other, scale, q, softened=None):
    """K_j / (q/2 scale) where neither solid's relaxation is excited: two springs in series."""
    deformable = [body for body in (rough, other) if body.material.deforms]
    springs = [_spring(body, scale, q, softened) for body in deformable]
    if len(springs) == 1:
        return springs[0]
    soft, hard = jnp.minimum(*springs), jnp.maximum(*springs)
    # Written as soft / (1 + soft/hard): no product that overflows, and 0 for two liquids.
    return soft / (1 + soft / jnp.where(hard > 0, hard, 1.0))


def _spring(body, scale, q, softened=None):
    """E_r(0) Sbar of a body over the scale, at q; q None: of its half-space."""
    own = body.material.static_reduced() / scale
    if q is None:
        return own
    if body.layer is not None and not body.layer.multiplies:
        return body.layer.static_reduced(body.material, scale, q)
    if softened is not None and relaxes(body):
        own = own * softening_factors(softened, q)[0]
    return own * _layer(body, q)


def _layer(body, q):
    """Sbar of a slab, 1 for a half-space."""
    return jnp.ones_like(q) if body.layer is None else body.layer.stiffening(body.material.poisson, q)
