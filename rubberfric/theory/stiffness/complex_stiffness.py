r"""Stiffness K_j of the two solids for roughness on solid j.

Roughness on solid j excites the other solid o at omega = q v cos(phi) and its own solid statically
[Scaraggi & Persson, eqs. (A6), (A8)],

.. math:: K_j(q, \omega) = \frac{1}{M_o(q, \omega) + M_j(q, 0)} = \frac{q}{2} F_j,\qquad
          M = \frac{2}{q E_r \bar S}

F_j is the modulus E_r Sbar of solid o in series with that of solid j. `rubberfric.theory.paper` and the fast
means over the direction of sliding use the same functions.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.checks import NumberLike
from rubberfric.materials.in_series import in_series, times
from rubberfric.materials.material import E_r, Material, poisson_of
from rubberfric.materials.slab import Layer
from rubberfric.materials.tabulated_modulus import REACH
from rubberfric.scene.body import Body
from rubberfric.scene.scene import Scene
from rubberfric.scene.softening import Softened, knots, softening_factors
from rubberfric.theory.structure import AT_REFERENCE, RoughSurface, SurfaceTemperatures

# Distance in ln omega from the relaxation times at which E' is constant and E'' a power of omega, to 1e-14.
_RELAXED = 16.0

# Distance in ln omega below the rounded lower end of a table at which the means are two powers of q v. A
# third power contributes e^-32.
_BELOW_TABLE = 8.0

# Distance in ln omega above the rounded upper end of a table at which the means are two powers of q v. A
# third power contributes e^-27.
_ABOVE_TABLE = 9.0

# Largest ln(E''/E') at the lowest frequency that `FrequencyRange.rest` allows for.
_MOST_EXCESS = 40.0

# Largest ln(E''/E') at the lowest frequency for the grid of a tabulated modulus in series with another solid.
MOST_EXCESS_OF_TABLE = 15.0


class Solid(NamedTuple):
    """The parts of a body that determine its stiffness; materials may be replaced by `Material.quick`."""

    material: Material
    layer: Layer | None
    below: Material | None  # base of the layer


def quick(surface: RoughSurface) -> RoughSurface:
    """Return a surface whose materials are evaluated quickly at many frequencies."""
    strained = surface.strained
    below = None if strained.below is None else strained.below.quick()
    return surface._replace(strained=Solid(strained.material.quick(), strained.layer, below))


def bare(surface: RoughSurface) -> RoughSurface:
    """Return a surface of two half-spaces without softening, whose F_j does not depend on q."""
    strained, rough = (Solid(body.material, None, None) for body in (surface.strained, surface.rough))
    return surface._replace(strained=strained, rough=rough, softened=None, softened_rough=None)


def K_j(
    surface: RoughSurface, q: jax.Array, omega: jax.Array | None, T: SurfaceTemperatures = AT_REFERENCE
) -> jax.Array:
    """Return K_j [Pa/m] at q [1/m] and omega [rad/s]; see `F_j`."""
    return q / 2 * F_j(surface, q, omega, T)  # (A6)


def F_j(
    surface: RoughSurface,
    q: jax.Array,
    omega: jax.Array | None,
    T: SurfaceTemperatures = AT_REFERENCE,
    unit: NumberLike = 1.0,
) -> jax.Array:
    """Return F_j = 2 K_j / q, divided by `unit`.

    Parameters
    ----------
    surface : RoughSurface
    q : [1/m], any shape
    omega : [rad/s], any sign, broadcastable to q; None: omega = 0, where F_j is real
    T : of the two solids [K], broadcastable to q; None: the reference temperatures
    unit : [Pa]
    """
    strained = None
    if surface.strained.material.deforms:
        strained = E_r_S_bar(surface.strained, q, omega, T.strained, surface.softened, unit)
    return facing(surface, q, strained, T.rough, unit)


def facing(
    surface: RoughSurface,
    q: jax.Array,
    strained: jax.Array | None,
    T: jax.Array | None = None,
    unit: NumberLike = 1.0,
) -> jax.Array:
    """Return F_j from E_r Sbar of the strained solid (None: rigid) in series with the rough solid at rest."""
    if strained is not None and not surface.rough.material.deforms:
        return strained
    resting = E_r_S_bar(surface.rough, q, None, T, surface.softened_rough, unit)
    return resting if strained is None else in_series(strained, resting)  # (A6)


def E_r_S_bar(
    body: Body | Solid,
    q: jax.Array,
    omega: jax.Array | None,
    T: jax.Array | None,
    softened: Softened | None,
    unit: NumberLike,
) -> jax.Array:
    """Return E_r Sbar = 2 / (q M) of a body, divided by `unit` [Pa]; complex unless omega is None.

    `F_j` describes the other arguments. Softening multiplies E' and E'' of the body's material.
    """
    E = times(1 / jnp.asarray(unit), E_r(body.material, omega, T))
    if softened is not None:
        f, g = softening_factors(softened, q)
        E = f * E if omega is None else jax.lax.complex(f * jnp.real(E), g * jnp.imag(E))
    layer = body.layer
    if layer is None:
        return E
    base = None
    if body.below is not None:
        base = times(1 / jnp.asarray(unit), E_r(body.below, omega, T, layer.base_shift(body.material)))
    return layer.E_r_S_bar(poisson_of(body.material), q, E, base)  # (A10)


def factors_of_q(surface: RoughSurface, q: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the real factors of E' and E'' in F_j at wavevectors q [1/m] of any shape.

    The strained solid is separable (`Body.separable`). If the rough solid deforms, both are half-spaces that
    do not soften.
    """
    S_bar = surface.strained.S_bar(q)
    if surface.softened is None:
        return S_bar, S_bar
    f, g = softening_factors(surface.softened, q)
    return f * S_bar, g * S_bar


def kinks(surfaces: Sequence[RoughSurface]) -> list[jax.Array]:
    """Return arrays of wavevectors at which F_j has kinks [1/m]. A scene without softening has none."""
    # Two solids with equal softening have the same knots.
    different = {id(softened.softening): softened for softened in surfaces[0].soft_solids}
    return [knots(softened) for softened in different.values()]


def modulus_scale(scene: Scene) -> jax.Array:
    """Return the largest modulus of the softer solid [Pa], the unit of all moduli.

    In this unit every F_j is of order one or less. Results do not depend on the unit, so derivatives of the
    unit are stopped.
    """
    highest = [body.material.glassy_reduced() for body in (scene.lower, scene.upper) if body.material.deforms]
    scale = highest[0] if len(highest) == 1 else jnp.minimum(*highest)
    # Under jit, where the constructor does not check, all moduli can be zero.
    return jax.lax.stop_gradient(jnp.where(scale > 0, scale, 1.0))


class FrequencyRange(NamedTuple):
    """Values of ln(omega a_T) of a strained body, without derivatives."""

    low: jax.Array  # below, F' is constant and F'' a power of omega
    high: jax.Array  # the same above
    rest: jax.Array  # below, F'' < 1e-9 F'


def frequency_range(surface: RoughSurface) -> FrequencyRange:
    """Return the `FrequencyRange` of F_j of a surface whose strained solid relaxes."""
    strained, resting = surface.strained, None
    if surface.rough.material.deforms and surface.rough.layer is None and strained.layer is None:
        resting = surface.rough.material.static_reduced()
    solids = [
        material
        for material in (strained.material, strained.below)
        if material is not None and material.relaxes
    ]
    low, high, rest = zip(*(_range_of(material, resting) for material in solids), strict=True)
    ends = jnp.min(jnp.stack(low)), jnp.max(jnp.stack(high)), jnp.min(jnp.stack(rest))
    return FrequencyRange(*jax.lax.stop_gradient(ends))


def _range_of(material, resting):
    ends = material.frequency_range()
    if ends is None:
        raise ValueError(f"{type(material).__name__} must implement reduced_series or frequency_range")
    low, high = (jnp.log(jnp.asarray(end)) for end in ends)
    below, above, most = _RELAXED, _RELAXED, _MOST_EXCESS
    if material.detail is not None:
        reach = REACH * material.detail
        below, above = _BELOW_TABLE + reach, _ABOVE_TABLE + reach
        # Below a table E is E' + i omega, and F two powers of omega unless another solid is in series.
        most = 0.0 if resting is None else MOST_EXCESS_OF_TABLE
    # Below the lowest frequency, E'' is proportional to omega. It may exceed E' there.
    storage = jnp.asarray(material.static_reduced())
    storage = storage if resting is None else storage + resting
    loss = jnp.imag(material.reduced_modulus(jnp.exp(low)))
    larger = (loss > storage) & (storage > 0)
    excess = jnp.log(jnp.where(larger, loss, 1.0)) - jnp.log(jnp.where(larger, storage, 1.0))
    excess = jnp.clip(excess, 0.0, _MOST_EXCESS) if material.loss_beyond == "fall" else jnp.zeros_like(low)
    # If E(0) = 0, no E'' is small compared with it.
    rest = low - math.log(1e9) - jnp.where(storage > 0, excess, _MOST_EXCESS)
    return low - below - jnp.minimum(excess, most), high + above, rest
