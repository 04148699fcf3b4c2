r"""Series stiffness K_j of the two solids for roughness on solid j.

Roughness on solid j excites the other solid o at omega = q v cos(phi) and its own solid
statically, so that [Scaraggi & Persson, eqs. (A6), (A8)]

.. math:: K_j(q, \omega) = \frac{1}{M_o(q, \omega) + M_j(q, 0)},\qquad M = \frac{2}{q E_r \bar S}

This module depends on bodies and wavevectors, not on velocity. K_j is stored as (q/2) * scale * factor * F
with a modulus scale common to the scene [Pa], a real factor (Sbar of a slab) known at every q, and F of
order one. F is a constant, a Prony series, or a tabulated modulus. A Prony solid in series with a spring is
again a Prony series, and so is a coated one.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.materials.material import apply_vertical_shift, plane_strain_factor
from rubberfric.materials.solids_in_series import in_series
from rubberfric.scene.scene import Body, Scene
from rubberfric.scene.softening import Softened, softening_factors
from rubberfric.theory.stiffness.angular_means import PronyStiffness
from rubberfric.theory.stiffness.softened_means import SoftenedInSeries
from rubberfric.theory.stiffness.tabulated_means import Tabulated
from rubberfric.theory.structure import AT_REFERENCE, RoughSurface, SurfaceTemperatures


class Factors(NamedTuple):
    """Factors that multiply the product of q^4 C and each mean, as tuples in the order of `Means`.

    None stands for a factor of 1. The angular means are smooth in ln q and are interpolated between the
    angular nodes. The factors of layers and softening are not smooth and are exact at every contact node. A
    quantity is the sum of the products of factor and mean. A kind has two products only if softening
    separates <F'^2> and <F''^2>.
    """

    mean_abs2: tuple[jax.Array | None, ...]
    mean_cos_loss: tuple[jax.Array | None, ...]
    mean_storage: tuple[jax.Array | None, ...]
    mean_sin_loss: tuple[jax.Array | None, ...]

    def of(self, kind: str, values: jax.Array) -> tuple[jax.Array, ...]:
        """Return a tuple with `values` times the factor of each mean of this kind, for example of <|F|^2>."""
        return tuple(values if factor is None else values * factor for factor in getattr(self, kind))


def modulus_scale(scene: Scene) -> jax.Array:
    """Return the largest modulus of the softer solid [Pa], the unit of all moduli.

    In this unit every F is of order one or less. Results do not depend on the unit, so derivatives of the
    unit are stopped.
    """
    highest = [body.material.glassy_reduced() for body in (scene.lower, scene.upper) if body.material.deforms]
    scale = highest[0] if len(highest) == 1 else jnp.minimum(*highest)
    # Under jit, where the constructor does not check, all moduli can be zero.
    return jax.lax.stop_gradient(jnp.where(scale > 0, scale, 1.0))


def relaxing_stiffness(
    surface: RoughSurface, scale: jax.Array, q: jax.Array, temperatures: SurfaceTemperatures = AT_REFERENCE
) -> PronyStiffness | Tabulated | SoftenedInSeries:
    """Return F of K_j if the strained solid relaxes, without the factor of `layer_factor`.

    Parameters
    ----------
    surface : RoughSurface
    scale : modulus scale [Pa]
    q : wavevectors [1/m], shape (panels, order)
    temperatures : of the two solids [K], shape () each, or None for the reference temperatures

    Returns
    -------
    PronyStiffness or Tabulated, with all q in one row if F depends on q; or SoftenedInSeries
    """
    if surface.softens_in_series:
        return _softened(surface, scale, q)
    nodes = q.reshape(-1) if surface.by_wavevector else None
    spring = (
        _spring(surface.rough, scale, nodes, temperature=temperatures.rough) if surface.both_deform else None
    )
    material, layer = surface.strained.material, surface.strained.layer
    if nodes is not None and layer is not None and not layer.multiplies:
        series = layer.reduced_series(material, scale, nodes, temperatures.strained)
        if spring is not None:
            series = in_series((series.rest, series.weight, series.tau), spring)
        return PronyStiffness(*series)
    own = None if nodes is None else _layer(surface.strained, nodes)
    series = material.reduced_series(scale)
    if series is None:
        unit = apply_vertical_shift(
            plane_strain_factor(material) / scale, material.shift, temperatures.strained
        )
        return Tabulated(material, unit if own is None else unit * own, spring)
    rest, weight = (apply_vertical_shift(x, material.shift, temperatures.strained) for x in series[:2])
    series = rest, weight, series.tau
    if own is not None:
        series = own * rest, own[:, None] * weight, series[2]
    return PronyStiffness(*(series if spring is None else in_series(series, spring)))  # (A6)


def tabulated_stiffness(surface: RoughSurface, scale: jax.Array) -> Tabulated | None:
    """Return the `Tabulated` stiffness of a surface, or None.

    The result is None if the stiffness is of another type or differs between wavevectors.
    """
    if surface.detail is None or surface.by_wavevector or surface.softens_in_series:
        return None
    F = relaxing_stiffness(surface, scale, jnp.ones((1, 1), scale.dtype))
    return F if isinstance(F, Tabulated) else None


def static_stiffness(
    surface: RoughSurface, scale: jax.Array, q: jax.Array, temperatures: SurfaceTemperatures = AT_REFERENCE
) -> jax.Array:
    """Return K_j / (q/2 scale) if the strained solid does not relax. The solids are springs in series."""
    solids = (
        (surface.rough, surface.softened_rough, temperatures.rough),
        (surface.strained, surface.softened, temperatures.strained),
    )
    springs = [_spring(body, scale, q, softened, T) for body, softened, T in solids if body.material.deforms]
    if len(springs) == 1:
        return springs[0]
    soft, hard = jnp.minimum(*springs), jnp.maximum(*springs)
    # soft / (1 + soft/hard) has no product that overflows, and is 0 for two liquids.
    return soft / (1 + soft / jnp.where(hard > 0, hard, 1.0))


def layer_factor(surface: RoughSurface, q: jax.Array) -> jax.Array | None:
    """Return Sbar at q if Sbar is a factor of a relaxing K_j, otherwise None.

    Sbar is a factor if the relaxing solid is a slab against a rigid solid.
    """
    if surface.strained.layer is None or surface.by_wavevector:
        return None
    return _layer(surface.strained, q)


def factors_at(surface: RoughSurface, scale: jax.Array, q: jax.Array) -> Factors:
    """Return the `Factors` at wavevectors q [1/m] of any shape.

    If the stiffness is static, the factors contain F.
    """
    if surface.static:
        F = static_stiffness(surface, scale, q)
        return Factors((F**2,), (), (F,), ())
    layer = layer_factor(surface, q)
    if surface.softened is not None and not surface.both_deform:
        storage, loss = (_times(layer, x) for x in softening_factors(surface.softened, q))
        return Factors((storage**2, loss**2), (loss,), (storage,), ())
    return Factors((_times(layer, layer),), (layer,), (layer,), (layer,))


def _softened(surface: RoughSurface, scale: jax.Array, q: jax.Array) -> SoftenedInSeries:
    material, factor = surface.strained.material, _layer(surface.strained, q)
    series = material.reduced_series(scale)
    if series is None:
        factor = factor * (plane_strain_factor(material) / scale)
    modulus = material if series is None else PronyStiffness(*series)
    storage = loss = factor
    if surface.softened is not None:
        storage, loss = (factor * x for x in softening_factors(surface.softened, q))
    return SoftenedInSeries(modulus, storage, loss, _spring(surface.rough, scale, q, surface.softened_rough))


def _spring(
    body: Body,
    scale: jax.Array,
    q: jax.Array | None,
    softened: Softened | None = None,
    temperature: jax.Array | None = None,
) -> jax.Array:
    """Return the stiffness E_r(0) Sbar of a body at rest, divided by `scale` [-].

    If `q` is None, the body is a half-space and Sbar is 1.
    """
    if q is not None and body.layer is not None and not body.layer.multiplies:
        return body.layer.static_reduced(body.material, scale, q, temperature)
    own = apply_vertical_shift(body.material.static_reduced() / scale, body.material.shift, temperature)
    if q is None:
        return own
    if softened is not None:
        own = own * softening_factors(softened, q)[0]
    return own * _layer(body, q)


def _layer(body: Body, q: jax.Array) -> jax.Array:
    """Return the stiffness factor Sbar of the layer of a body at q, which is 1 for a half-space."""
    if body.layer is None:
        return jnp.ones_like(q)
    # Bodies with a layer have a constant Poisson's ratio.
    return body.layer.stiffening(body.material.poisson, q)  # pyright: ignore[reportArgumentType]


def _times(a, b):
    return b if a is None else a if b is None else a * b
