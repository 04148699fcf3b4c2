r"""The interface: distribution of stresses, normal stiffness, and dissipated power.

With g = G sigma_0^2, x = sigma_0 / (2 sqrt g), P = erf x and s = gamma P + (1 - gamma) P^3
[Scaraggi & Persson, arXiv:1506.06955], stresses and stiffness follow from the radial
integrals of area and separation (`rubberfric.theory.integrals`). The power has the terms of the friction,

.. math:: \sigma_0 \mu v = \sigma_0 v\,(\mu_2 + \mu_1 + \mu_\mathrm{con}),\qquad
          \mu_j = \frac{1}{\sigma_0}\int d^2q\, S P\, C_j\, q\cos\varphi\,\mathrm{Im}K_j
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.analysis.scales.profiles import checked_wavevectors, contact_at_borders
from rubberfric.base.blocks import broadcast_shape, over_points
from rubberfric.base.checks import FINITE, ArrayLike, as_leaf, check_values, shape_of
from rubberfric.base.quadrature import Quadrature
from rubberfric.scene.interface import shear_friction
from rubberfric.scene.scene import Scene, check_without, rough_surfaces
from rubberfric.theory.area.partial_contact import TWO_OVER_ROOT_PI, contact_fraction
from rubberfric.theory.arguments import validate, warn_of_last_iterates
from rubberfric.theory.integrals import prepare, solved
from rubberfric.theory.structure import rough_surfaces_of

# Points of a stress distribution evaluated at once. A larger block takes more memory.
_BLOCK = 64
# Points of the dissipated power evaluated at once. A larger block takes more memory.
_POWER_BLOCK = 128


def stress_distribution(
    scene: Scene,
    stress: ArrayLike,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    q: ArrayLike | None = None,
    quadrature: Quadrature | None = None,
) -> jax.Array:
    r"""Compute the probability density of the interfacial stress s > 0 (s = 0 outside the contact area).

    .. math:: p(s) = \frac{1}{\sqrt{4\pi g}}\left[e^{-(s-\sigma_0)^2/4g} - e^{-(s+\sigma_0)^2/4g}\right],
              \qquad g = \sigma_0^2 G(q)

    [Persson, J. Chem. Phys. 115, 3840 (2001)], so that int_0^inf p ds = A/A0 and
    int_0^inf s p ds = sigma_0 at any resolution.

    Parameters
    ----------
    scene : Scene
    stress : s, array_like, broadcastable with the conditions [Pa]
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    q : largest wavevector, a number > 0 [1/m]; None: all roughness
    quadrature : Quadrature, static, or None: chosen for the scene

    Returns
    -------
    array, broadcast shape of stress and conditions [1/Pa]; 0 for s <= 0.

    Raises
    ------
    ValueError : as `solve`, whose warnings this function gives too; a stress that is not finite; q <= 0.

    Limits: full relative accuracy for s -> 0 (the difference of the two terms is not formed) and for huge G.
    For smooth solids the density is Dirac's delta at sigma_0, which is not represented. The same applies to
    densities with a width below 1e-30 of sigma_0 (single precision: 1e-15). With `scene.area_correction` the
    factor S is part of G.

    Examples
    --------
    The integral of the density over the stress is A/A0:

    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> s = np.linspace(0.0, 1e8, 20_001)
    >>> density = np.asarray(rf.analysis.stress_distribution(scene, s, 0.01, 0.15e6))
    >>> round(float(np.sum(density) * s[1]), 4), round(float(rf.contact_area(scene, 0.01, 0.15e6)), 4)
    (0.0164, 0.0164)
    """
    scene, conditions, quadrature = validate(scene, velocity, pressure, temperature, quadrature)
    check_without(scene, ("adhesion",), "the distribution of stresses")
    q = checked_wavevectors(q, 0, conditions, scene)
    stress = as_leaf("stress", stress, len(shape_of(stress)))
    check_values("stress", stress, FINITE)
    stress = jnp.asarray(stress, conditions[1].dtype)
    broadcast_shape(stress=stress, velocity=velocity, pressure=pressure, temperature=temperature)
    density, converged = _stress_distribution(scene, stress, *conditions, q, quadrature=quadrature)
    warn_of_last_iterates(scene, converged, conditions)
    return density


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _stress_distribution(scene, stress, velocity, pressure, temperature, q, *, quadrature):
    surfaces = rough_surfaces_of(scene)
    if not surfaces:
        return _stress_density(stress, pressure, jnp.zeros_like(pressure + velocity)), None
    if q is None:
        q = functools.reduce(jnp.maximum, [surface.law.q[-1] for surface in surfaces])
    prepared = prepare(scene, ("area",), quadrature, surfaces=surfaces, borders=q[None])

    def fluctuation(points):
        contact, temperatures = solved(prepared, *points)
        return contact_at_borders(prepared, contact, 1)[1][:, 0], _converged(temperatures)

    G, converged = over_points(fluctuation, (velocity, pressure, temperature), _BLOCK)
    return _stress_density(stress, pressure, G), converged


def _converged(temperatures):
    return None if temperatures is None else temperatures.converged


def _stress_density(stress, pressure, G):
    coarse = G.dtype == jnp.float32
    rough = G > 0
    width = jnp.where(rough, 2 * jnp.sqrt(jnp.where(rough, G, 1.0)), 0.0)
    # Floating-point numbers do not resolve a narrower peak; 1/width^2 stays finite.
    width = jnp.maximum(width, 1e-15 if coarse else 1e-30)
    positive = stress > 0
    s = jnp.where(positive, stress, pressure) / pressure
    # e^-z^2 is 0 beyond the bound; clipping keeps 0 * inf out of the derivative.
    bound = 12.0 if coarse else 40.0
    z = jnp.clip((s - 1) / width, -bound, bound)
    # 4 s / width^2, clipped likewise.
    both = jnp.minimum(4 * (s / width), bound**2 * width) / width
    density = jnp.exp(-z * z) * -jnp.expm1(-both) / (jnp.sqrt(jnp.pi) * width) / pressure
    return jnp.where(positive, density, 0.0)


def contact_stiffness(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    quadrature: Quadrature | None = None,
) -> jax.Array:
    r"""Compute the normal stiffness of the interface per nominal area.

    .. math:: -\frac{d\sigma_0}{d\bar u} = \sigma_0 \Big/ \int d^2q \sum_j C_j\,\mathrm{Re}K_j\,
              \frac{s'(x)}{4\sqrt g}, \qquad s = \gamma\,\mathrm{erf} + (1-\gamma)\,\mathrm{erf}^3

    the derivative of `rubberfric.separation` at constant velocity.

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    quadrature : Quadrature, static, or None: chosen for the scene

    Returns
    -------
    array, broadcast shape [Pa/m]. Without roughness, or in full contact to the last bit, the stiffness is
    infinite and the derivative is 0.

    Raises and warns as `solve`.

    Notes
    -----
    G does not contain S, as in `separation`, regardless of `scene.area_correction`. In a heated scene the
    temperatures are held constant.

    Examples
    --------
    The separation falls by 1 Pa / stiffness if the pressure rises by 1 Pa:

    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> stiffness = float(rf.analysis.contact_stiffness(scene, 0.01, 0.15e6))
    >>> u = np.asarray(rf.separation(scene, 0.01, np.array([0.149e6, 0.151e6])))
    >>> f"{stiffness:.3g}", round(float(2e3 / (u[0] - u[1])) / stiffness, 3)  # in Pa/m
    ('5.07e+08', 1.0)
    """
    scene, conditions, quadrature = validate(scene, velocity, pressure, temperature, quadrature)
    check_without(scene, ("adhesion",), "the stiffness")
    stiffness, converged = _contact_stiffness(scene, *conditions, quadrature=quadrature)
    warn_of_last_iterates(scene, converged, conditions)
    return stiffness


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _contact_stiffness(scene, velocity, pressure, temperature, *, quadrature):
    if not rough_surfaces(scene):
        shape = jnp.broadcast_shapes(velocity.shape, pressure.shape)
        return jnp.full(shape, jnp.inf, pressure.dtype), None
    prepared = prepare(scene, ("separation",), quadrature)

    def stiffness(points):
        contact, temperatures = solved(prepared, *points)
        x, pressure = contact.x, points[1]
        storage = sum(terms.densities["mean_storage"] for terms in contact.terms)
        P = contact_fraction(x)
        slope = TWO_OVER_ROOT_PI * jnp.exp(-x * x) * (scene.gamma + 3 * (1 - scene.gamma) * P * P)
        compliance = jnp.sum(x * slope * storage, (0, 2))
        compliance = 0.5 * contact.modulus_over_pressure * compliance
        soft = compliance > 0
        ratio = jnp.where(soft, pressure / jnp.where(soft, compliance, 1.0), jnp.inf)
        return ratio, _converged(temperatures)

    return over_points(stiffness, (velocity, pressure, temperature), _BLOCK)


class DissipatedPower(NamedTuple):
    """Results of `dissipated_power`, each of the broadcast shape [W/m^2]."""

    lower: jax.Array  # in the lower solid, from the roughness of the upper one
    upper: jax.Array  # in the upper solid, from the roughness of the lower one
    shear: jax.Array  # in the real contact area; 0 without contact shear
    total: jax.Array  # sum, mu sigma_0 v


def dissipated_power(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    quadrature: Quadrature | None = None,
) -> DissipatedPower:
    r"""Compute the dissipated power per nominal area in both solids and in the contact.

    .. math:: p_\mathrm{lower} = v \int d^2q\, S P\, C_2\, q\cos\varphi\,\mathrm{Im}K_2,\qquad
              p_\mathrm{upper} = v \int d^2q\, S P\, C_1\, q\cos\varphi\,\mathrm{Im}K_1,\qquad
              p_\mathrm{shear} = \sigma_0 \mu_\mathrm{con} v

    [the terms of `rubberfric.friction`]

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    quadrature : Quadrature, static, or None: chosen for the scene

    Returns
    -------
    DissipatedPower, >= 0 and even in the velocity

    Raises and warns as `solve`.

    Notes
    -----
    Roughness of one solid strains the other periodically, and its own solid only statically. Therefore a
    rough solid against a smooth one dissipates nothing. The power is zero, not computed, in solids that do
    not relax or that face a smooth solid.

    Examples
    --------
    The smooth rubber dissipates mu sigma_0 v = 0.083 0.15 MPa 1 cm/s, and the rigid road nothing:

    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> power = rf.analysis.dissipated_power(scene, 0.01, 0.15e6)
    >>> round(float(power.upper), 1), float(power.lower)  # in W/m^2
    (124.6, 0.0)
    """
    check_without(scene, (), "the dissipated power")
    scene, conditions, quadrature = validate(scene, velocity, pressure, temperature, quadrature)
    power, converged = _dissipated_power(scene, *conditions, quadrature=quadrature)
    warn_of_last_iterates(scene, converged, conditions)
    return power


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _dissipated_power(scene, velocity, pressure, temperature, *, quadrature):
    prepared = prepare(scene, ("friction",), quadrature)

    def powers(points):
        velocity, pressure = points[:2]
        temperature = points[2] if len(points) > 2 else None
        results = {solid: jnp.zeros_like(pressure) for solid in ("lower", "upper", "shear")}
        area = jnp.ones_like(pressure)
        if prepared.integrated is not None:
            contact, temperatures = solved(prepared, *points)
            area = contact.area()
            if temperatures is not None:
                temperature = temperatures.surface
                results["converged"] = temperatures.converged
            for j, terms in contact.friction_terms().items():
                results[prepared.roughness.strained[j]] = jnp.sum(terms, (0, 2)) * pressure * velocity
        if scene.shear is not None:
            mu = shear_friction(scene.shear, area, velocity, pressure, temperature)
            results["shear"] = mu * pressure * velocity
        return results

    parts = over_points(powers, (velocity, pressure, temperature), _POWER_BLOCK)
    converged = parts.pop("converged", None)
    total = parts["lower"] + parts["upper"] + parts["shear"]
    return DissipatedPower(**parts, total=total), converged
