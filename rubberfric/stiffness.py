r"""Series stiffness K_j of the two solids, as roughness on solid j sees it.

Roughness on solid j excites the other solid o at omega = q v cos(phi) and its own solid
statically, so that [Scaraggi & Persson, (A6), (A8)]

.. math:: K_j(q, \omega) = \frac{1}{M_o(q, \omega) + M_j(q, 0)},\qquad M = \frac{2}{q E_r \bar S}

Everything here is about two bodies and wavevectors; velocity enters later. K_j is kept
as (q/2) * scale * factor * F with a modulus scale common to the scene [Pa], a real
factor (a layer's Sbar) known at every q, and F of order one: a constant, a Prony series
(a Prony solid in series with a spring is one again) or a tabulated modulus.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.layers import stiffening
from rubberfric.materials import (
    VISCOELASTIC,
    Elastic,
    Prony,
    Rigid,
    TabulatedModulus,
    plane_strain,
    static_modulus,
)
from rubberfric.series import in_series
from rubberfric.softening import softening_factors


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


class Sampled(NamedTuple):
    """F of a softened solid in series with a spring, at the contact nodes, (panels, order) each."""

    material: object
    storage: jax.Array  # f times what makes E a scaled stiffness [1/Pa]
    loss: jax.Array  # the same with g
    spring: jax.Array  # the other solid at rest [-]


def modulus_scale(scene):
    """A modulus that makes every F of order one or less [Pa]: the softer solid's stiffest value.

    A unit only: results do not depend on it, so no gradient goes through it.
    """
    highest = [_highest(body.material) for body in (scene.lower, scene.upper)]
    highest = [h for h in highest if h is not None]
    scale = highest[0] if len(highest) == 1 else jnp.minimum(*highest)
    # All moduli can be zero under jit, past the constructor's check: then nothing is stiff.
    return jax.lax.stop_gradient(jnp.where(scale > 0, scale, 1.0))


def _highest(material):
    if isinstance(material, Rigid):
        return None
    if isinstance(material, Elastic):
        glassy = material.young
    elif isinstance(material, Prony):
        glassy = material.E_inf + jnp.sum(material.E)
    else:
        glassy = jnp.max(material.storage)
    return glassy * plane_strain(material)


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
    if not isinstance(other.material, VISCOELASTIC):
        return Static(static_series(rough, other, scale, contact_q, softened))
    unit = plane_strain(other.material) / scale
    if softened is not None and not isinstance(rough.material, Rigid):
        unit = unit * _layer(other, contact_q)
        storage, loss = (unit * factor for factor in softening_factors(softened, contact_q))
        return Sampled(other.material, storage, loss, static_spring(rough, scale, contact_q, softened))
    spring = None
    if not isinstance(rough.material, Rigid):
        spring = static_modulus(rough.material) * plane_strain(rough.material) / scale
        if by_node(rough, other):
            spring, own = spring * _layer(rough, angular_q), _layer(other, angular_q)
    if isinstance(other.material, TabulatedModulus):
        return Tabulated(other.material, unit * own if by_node(rough, other) else unit, spring)
    series = Relaxing(other.material.E_inf * unit, other.material.E * unit, other.material.tau)
    if spring is None:
        return series
    if not by_node(rough, other):
        return Relaxing(*in_series(*series, spring))
    return Relaxing(*in_series(own * series.rest, own[:, None] * series.weight, series.tau, spring))


def by_node(rough, other):
    """Whether F depends on q: two deformable solids, at least one of them a layer."""
    layered = rough.layer is not None or other.layer is not None
    return layered and not isinstance(rough.material, Rigid)


def layer_factor(rough, other, q):
    """Sbar at q where it multiplies all of a relaxing K_j (the rough solid is rigid); else None."""
    if other.layer is None or not isinstance(rough.material, Rigid):
        return None
    return stiffening(other.layer, other.material.poisson, q)


def static_series(rough, other, scale, q, softened=None):
    """K_j / (q/2 scale) where neither solid's relaxation is excited: two springs in series."""
    springs = [
        static_spring(body, scale, q, softened)
        for body in (rough, other)
        if not isinstance(body.material, Rigid)
    ]
    if len(springs) == 1:
        return springs[0]
    soft, hard = jnp.minimum(*springs), jnp.maximum(*springs)
    # Written as soft / (1 + soft/hard): no product that overflows, and 0 for two liquids.
    return soft / (1 + soft / jnp.where(hard > 0, hard, 1.0))


def static_spring(body, scale, q, softened):
    """A body at rest, at q: E_r(0) Sbar / scale [-]."""
    spring = static_modulus(body.material) * plane_strain(body.material) / scale * _layer(body, q)
    if softened is None or not isinstance(body.material, VISCOELASTIC):
        return spring
    return spring * softening_factors(softened, q)[0]


def _layer(body, q):
    """Sbar of a body, 1 for a half-space."""
    return jnp.ones_like(q) if body.layer is None else stiffening(body.layer, body.material.poisson, q)
