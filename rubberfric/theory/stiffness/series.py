r"""Series stiffness K_j of the two solids, as roughness on solid j sees it.

Roughness on solid j excites the other solid o at omega = q v cos(phi) and its own solid
statically, so that [Scaraggi & Persson, eqs. (A6), (A8)]

.. math:: K_j(q, \omega) = \frac{1}{M_o(q, \omega) + M_j(q, 0)},\qquad M = \frac{2}{q E_r \bar S}

Everything here is about two bodies and wavevectors; velocity enters later. K_j is kept
as (q/2) * scale * factor * F with a modulus scale common to the scene [Pa], a real
factor (a slab's Sbar) known at every q, and F of order one: a constant, a Prony series
(a Prony solid in series with a spring is one again, and so is a coated one) or a tabulated modulus.
"""

import jax
import jax.numpy as jnp

from rubberfric.materials.material import plane_strain
from rubberfric.materials.series.prony_and_prony import two_in_series
from rubberfric.materials.series.prony_and_spring import in_series
from rubberfric.scene.pairs import Pair, has_coating
from rubberfric.scene.scene import Body, Scene, relaxes
from rubberfric.scene.softening import Softened, softening_factors
from rubberfric.theory.stiffness.angular_means import Relaxing
from rubberfric.theory.stiffness.softened_means import SoftenedInSeries
from rubberfric.theory.stiffness.tabulated_means import Tabulated


def modulus_scale(scene: Scene) -> jax.Array:
    """A modulus that makes every F of order one or less [Pa]: the softer solid's stiffest value.

    A unit only: results do not depend on it, so no gradient goes through it.
    """
    bodies = [body for body in (scene.lower, scene.upper) if body.material.deforms]
    highest = [body.material.glassy_reduced() for body in bodies]
    scale = highest[0] if len(highest) == 1 else jnp.minimum(*highest)
    # All moduli can be zero under jit, past the constructor's check: then nothing is stiff.
    return jax.lax.stop_gradient(jnp.where(scale > 0, scale, 1.0))


def relaxing_stiffness(
    pair: Pair, scale: jax.Array, q: jax.Array, angle: int
) -> Relaxing | Tabulated | SoftenedInSeries:
    """F of K_j where the strained solid relaxes, without the factor of `layer_factor`.

    Parameters
    ----------
    pair : Pair
    scale : modulus scale [Pa]
    q : wavevectors [1/m], shape (panels, order)
    angle : nodes of an angular integral that has no closed form

    Returns
    -------
    Relaxing or Tabulated, of all q in one row where F depends on q; or SoftenedInSeries
    """
    rough, strained = pair.rough, pair.strained
    if pair.softened is not None and pair.both_deform:
        return _softened(pair, scale, q, angle)
    nodes = q.reshape(-1) if pair.by_wavevector else None
    spring = _spring(rough, scale, nodes) if pair.both_deform else None
    if has_coating(strained):
        return _coated(strained, scale, nodes, spring)
    own = None if nodes is None else _layer(strained, nodes)
    if strained.material.needs_quadrature:
        unit = plane_strain(strained.material) / scale
        return Tabulated(strained.material, unit if own is None else unit * own, spring, angle)
    series = Relaxing(*strained.material.reduced_series(scale))
    if spring is None:
        return series
    if own is None:
        return Relaxing(*in_series(*series, spring))
    return Relaxing(*in_series(own * series.rest, own[:, None] * series.weight, series.tau, spring))


def static_stiffness(pair: Pair, scale: jax.Array, q: jax.Array) -> jax.Array:
    """K_j / (q/2 scale) at q of any shape where the strained solid does not relax: springs in series."""
    deformable = [body for body in (pair.rough, pair.strained) if body.material.deforms]
    springs = [_spring(body, scale, q, pair.softened) for body in deformable]
    if len(springs) == 1:
        return springs[0]
    soft, hard = jnp.minimum(*springs), jnp.maximum(*springs)
    # Written as soft / (1 + soft/hard): no product that overflows, and 0 for two liquids.
    return soft / (1 + soft / jnp.where(hard > 0, hard, 1.0))


def layer_factor(pair: Pair, q: jax.Array) -> jax.Array | None:
    """Sbar at q where it multiplies all of a relaxing K_j (a slab faces a rigid solid); else None."""
    strained = pair.strained
    if strained.layer is None or pair.by_wavevector:
        return None
    return strained.layer.stiffening(strained.material.poisson, q)


def _softened(pair: Pair, scale: jax.Array, q: jax.Array, angle: int) -> SoftenedInSeries:
    """F of a softened solid in series with another one."""
    material, factor = pair.strained.material, _layer(pair.strained, q)
    if material.needs_quadrature:
        modulus, factor = material, factor * (plane_strain(material) / scale)
    else:
        modulus = Relaxing(*material.reduced_series(scale))
    storage, loss = (factor * softened for softened in softening_factors(pair.softened, q))
    return SoftenedInSeries(modulus, storage, loss, _spring(pair.rough, scale, q, pair.softened), angle)


def _coated(body: Body, scale: jax.Array, q: jax.Array, spring: jax.Array | None) -> Relaxing:
    """F of a coated body that relaxes, in series with a spring or None."""
    series = body.layer.reduced_series(body.material, scale, q)
    if spring is not None:
        nothing = jnp.zeros(0, q.dtype)
        series = two_in_series(series, (spring, nothing, nothing))
    return Relaxing(*series)


def _spring(body: Body, scale: jax.Array, q: jax.Array | None, softened: Softened | None = None) -> jax.Array:
    """E_r(0) Sbar of a body over the scale, at q; q None: of its half-space."""
    if q is not None and has_coating(body):
        return body.layer.static_reduced(body.material, scale, q)
    own = body.material.static_reduced() / scale
    if q is None:
        return own
    if softened is not None and relaxes(body):
        own = own * softening_factors(softened, q)[0]
    return own * _layer(body, q)


def _layer(body: Body, q: jax.Array) -> jax.Array:
    """Sbar of a slab, 1 for a half-space."""
    return jnp.ones_like(q) if body.layer is None else body.layer.stiffening(body.material.poisson, q)
