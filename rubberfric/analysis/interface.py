r"""The interface: what a load does to the separation, and how stresses and separations are distributed.

With g = G sigma_0^2, x = sigma_0 / (2 sqrt g), P = erf x and s = gamma P + (1 - gamma) P^3, all of
them follow from the same radial integrals as area and separation (`rubberfric.theory.integrals`).
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.analysis.by_wavevector import (
    checked_with_q,
    contact_at_borders,
    default_wavevectors,
    density_of,
    fluctuation_at_borders,
)
from rubberfric.base.blocks import over_points
from rubberfric.base.checks import FINITE, as_leaf, check_values
from rubberfric.base.quadrature import Quadrature
from rubberfric.roughness.spectra import log_shape
from rubberfric.scene.pairs import pairs_of
from rubberfric.scene.scene import cast, rough_surfaces
from rubberfric.theory.integrals import evaluate, prepare, solved
from rubberfric.theory.model import checked
from rubberfric.theory.partial_contact import TWO_OVER_ROOT_PI, contact_argument, contact_fraction

_DEFAULT = Quadrature()

# Points evaluated at once: as in a profile; a separation profile is a mesh for every wavevector.
BLOCK, SEPARATION_BLOCK, SEPARATION_COUNT = 64, 8, 100


def stress_distribution(scene, stress, velocity, pressure, temperature=None, *, q=None, quadrature=_DEFAULT):
    r"""Probability density of the interfacial stress s > 0 (the share of area not in contact has s = 0).

    .. math:: p(s) = \frac{1}{\sqrt{4\pi g}}\left[e^{-(s-\sigma_0)^2/4g} - e^{-(s+\sigma_0)^2/4g}\right],
              \qquad g = \sigma_0^2 G(q)

    [Persson, J. Chem. Phys. 115, 3840 (2001)], so that int_0^inf p ds = A/A0 and
    int_0^inf s p ds = sigma_0 at any resolution.

    Parameters
    ----------
    scene : Scene
    stress : s, array_like, broadcastable with the conditions [Pa]
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    q : largest wavevector seen, a number > 0 [1/m]; None: all roughness
    quadrature : Quadrature, static

    Returns
    -------
    array, broadcast shape of stress and conditions [1/Pa]; 0 for s <= 0.

    Raises
    ------
    ValueError : as `contact_area`; a stress that is not finite; concrete q <= 0.

    Limits: full relative accuracy for s -> 0 (no difference of the two terms is formed) and for huge
    G. Without roughness it is Dirac's delta at sigma_0: a width below 1e-30 of sigma_0 (single
    precision: 1e-15) counts as that. With `scene.area_correction` G has S inside.
    """
    scene, conditions, q = checked_with_q(scene, velocity, pressure, temperature, quadrature, q, ndim=0)
    stress = as_leaf("stress", stress, np.ndim(stress))
    check_values("stress", stress, FINITE)
    stress = cast(stress, conditions[1].dtype)
    return _stress_distribution(scene, stress, *conditions, q, quadrature=quadrature)


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _stress_distribution(scene, stress, velocity, pressure, temperature, q, *, quadrature):
    pairs = pairs_of(scene)
    if not pairs:
        return _stress_density(stress, pressure, jnp.zeros_like(pressure + velocity))
    if q is None:
        q = functools.reduce(jnp.maximum, [pair.law.q[-1] for pair in pairs])
    prepared = prepare(scene, ("area",), quadrature, pairs=pairs, borders=q[None])

    def fluctuation(points):
        contact, _ = solved(prepared, *points)
        return contact_at_borders(prepared, contact, 1)[1][:, 0]

    G = over_points(fluctuation, (velocity, pressure, temperature), BLOCK)
    return _stress_density(stress, pressure, G)


def _stress_density(stress, pressure, G):
    single = G.dtype == jnp.float32
    rough = G > 0
    width = jnp.where(rough, 2 * jnp.sqrt(jnp.where(rough, G, 1.0)), 0.0)
    # No spacing of floating-point numbers resolves a narrower one; 1/width^2 stays finite.
    width = jnp.maximum(width, 1e-15 if single else 1e-30)
    positive = stress > 0
    s = jnp.where(positive, stress, pressure) / pressure
    # e^-z^2 is 0 beyond, and its derivative must not become 0 * inf.
    bound = 12.0 if single else 40.0
    z = jnp.clip((s - 1) / width, -bound, bound)
    # 4 s / width^2, beyond which e^- is 0 as well.
    both = jnp.minimum(4 * (s / width), bound**2 * width) / width
    density = jnp.exp(-z * z) * -jnp.expm1(-both) / (jnp.sqrt(jnp.pi) * width) / pressure
    return jnp.where(positive, density, 0.0)


def contact_stiffness(scene, velocity, pressure, temperature=None, *, quadrature=_DEFAULT):
    r"""Normal stiffness of the interface per nominal area.

    .. math:: -\frac{d\sigma_0}{d\bar u} = \sigma_0 \Big/ \int d^2q \sum_j C_j\,\mathrm{Re}K_j\,
              \frac{s'(x)}{4\sqrt g}, \qquad s = \gamma\,\mathrm{erf} + (1-\gamma)\,\mathrm{erf}^3

    the derivative of [Scaraggi & Persson, eq. (A18)] at constant velocity.

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    quadrature : Quadrature, static

    Returns
    -------
    array, broadcast shape [Pa/m]; infinite, with derivative 0, where nothing is rough or contact is
    full to the last bit.

    Raises
    ------
    ValueError : as `contact_area`.

    Notes
    -----
    Uses the plain G like `separation`, whatever `scene.area_correction` says. In a heated scene
    temperatures are held.
    """
    scene, conditions = checked(scene, velocity, pressure, temperature, quadrature)
    return _contact_stiffness(scene, *conditions, quadrature=quadrature)


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _contact_stiffness(scene, velocity, pressure, temperature, *, quadrature):
    if not rough_surfaces(scene):
        return jnp.full(jnp.broadcast_shapes(velocity.shape, pressure.shape), jnp.inf, pressure.dtype)
    prepared = prepare(scene, ("separation",), quadrature)

    def stiffness(points):
        contact, _ = solved(prepared, *points)
        x, pressure = contact.x, points[1]
        storage = sum(terms.densities["storage"] for terms in contact.terms)
        compliance = jnp.sum(x * _load_slope(x, scene.gamma) * storage, (0, 2))
        compliance = jnp.pi / 2 * contact.stiffness * compliance
        soft = compliance > 0
        return jnp.where(soft, pressure / jnp.where(soft, compliance, 1.0), jnp.inf)

    return over_points(stiffness, (velocity, pressure, temperature), BLOCK)


def _load_slope(x, gamma):
    """s'(x)."""
    P = contact_fraction(x)
    return TWO_OVER_ROOT_PI * jnp.exp(-x * x) * (gamma + 3 * (1 - gamma) * P * P)


class SeparationProfile(NamedTuple):
    """Results of `separation_profile`; q has shape [q], the others [conditions..., q]."""

    q: jax.Array  # wavevectors [1/m]
    area: jax.Array  # P(q), of the plain G [-]
    contact_separation: jax.Array  # u_bar(q), mean over the area that is in contact at resolution q [m]
    separation: jax.Array  # u1(q), of the area that leaves contact at q [m]


def separation_profile(scene, velocity, pressure, temperature=None, *, q=None, quadrature=_DEFAULT):
    r"""Separation where contact is lost at scale q, and so the distribution of separations.

    .. math:: u_1(q) = \frac{d[\bar u(q) P(q)]}{dP}, \qquad
              \int u_1 (-dP) + P(q_1)\, \bar u(q_1) = \bar u

    [Yang & Persson, J. Phys.: Condens. Matter 20, 215214 (2008)]. Seen at resolution q the solids are
    in contact over P(q) A0, under the mean pressure sigma_0 / P(q). Roughness beyond q opens gaps
    in it, of mean

    .. math:: \bar u(q) = \int_{q}^{q_1} d^2q' \sum_j C_j\,\mathrm{Re}K_j\,\frac{x}{2p}\Psi(x),\qquad
              x = \frac{p}{2\sigma_0\sqrt{G(q') - G(q)}},\quad p = \frac{\sigma_0}{P(q)}

    which is `separation` of a scene that has roughness beyond q only. Between q and q + dq the area
    -dP A0 leaves contact; the volume of gaps below P A0 falls by d(u_bar P) with it, so its mean
    separation is u1, and as u_bar(q1) = 0 the sum over all the area is u_bar(q0).

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    q : wavevectors [1/m], > 0, shape (n,); None: 100, equally spaced in ln q over the roughness
    quadrature : Quadrature, static

    Returns
    -------
    SeparationProfile. The share of area with a separation above u1(q) is 1 - P(q) where u1 falls
    with q. u1 is 0 beyond the roughness, and infinite where P = 1 to the last bit: there no area
    leaves contact.

    Raises
    ------
    ValueError : as `profile`; a heated scene.

    Limits: velocity and temperature are those of the scene at every q. Uses the plain G like
    `separation`. A mesh for every q: a thousand times the work of `separation`. Smooth solids have
    u1 = u_bar = 0.
    """
    scene, conditions, q = checked_with_q(scene, velocity, pressure, temperature, quadrature, q)
    if q is None and not rough_surfaces(scene):
        raise ValueError("q is None, but nothing in the scene is rough: must be given")
    if scene.heating is not None:
        raise ValueError("scene.heating: what lies beyond q alone has no temperature; must be None")
    return _separation_profile(scene, *conditions, q, quadrature=quadrature)


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _separation_profile(scene, velocity, pressure, temperature, q, *, quadrature):
    pairs = pairs_of(scene)
    if not pairs:
        shape = (*jnp.broadcast_shapes(velocity.shape, pressure.shape), q.shape[0])
        one = jnp.ones(shape, q.dtype)
        return SeparationProfile(q, one, 0 * one, 0 * one)
    q = default_wavevectors([pair.law for pair in pairs], SEPARATION_COUNT) if q is None else q
    prepared = prepare(scene, ("area",), quadrature, pairs=pairs, borders=q)
    densities = [density_of(pair, prepared.roughness.scale, "power", q, quadrature) for pair in pairs]
    block = functools.partial(_separations, scene, prepared, pairs, densities, q, quadrature)
    return SeparationProfile(q, **over_points(block, (velocity, pressure, temperature), SEPARATION_BLOCK))


def _separations(scene, prepared, pairs, densities, q, quadrature, points):
    """Fields of SeparationProfile at points, (points, wavevectors)."""
    velocity, pressure, temperature = (*points, None)[:3]
    contact, _ = solved(prepared, velocity, pressure, temperature)
    ratio = contact.stiffness[:, None]
    G = fluctuation_at_borders(prepared, contact, q.shape[0])
    x = contact_argument(G, jnp.ones_like(G))
    P = contact_fraction(x)
    density = sum(one(velocity, temperature) for one in densities)
    # dP / d ln q by the exact density of G; G itself may be 0, x^2 = 1 / (4 G) stops at 27^2.
    slope = -TWO_OVER_ROOT_PI * jnp.exp(-x * x) * 2 * x**3 * (jnp.pi / 4 * ratio**2 * density)

    def beyond(log_step, load_step, q, mean_pressure):
        cut = [pair._replace(law=_beyond(pair.law, q * jnp.exp(log_step))) for pair in pairs]
        ready = prepare(scene, ("separation",), quadrature, pairs=cut)
        at = (velocity, mean_pressure * jnp.exp(load_step), *points[2:])
        return evaluate(ready, ("separation",), at)["separation"]

    def one(q, mean_pressure):
        zero = jnp.zeros_like(q)
        steps = functools.partial(beyond, q=q, mean_pressure=mean_pressure)
        gap, by_log_q = jax.jvp(lambda step: steps(step, zero), (zero,), (zero + 1,))
        _, by_log_load = jax.jvp(lambda step: steps(zero, step), (zero,), (zero + 1,))
        return gap, by_log_q, by_log_load

    gap, by_log_q, by_log_load = (y.T for y in jax.vmap(one)(q, (pressure[:, None] / P).T))
    leaving = slope < 0
    rate = P * by_log_q / jnp.where(leaving, slope, -1.0)
    u1 = jnp.where(leaving, gap - by_log_load + rate, jnp.where(gap > 0, jnp.inf, 0.0))
    return {"area": P, "contact_separation": gap, "separation": u1}


def _beyond(law, q):
    """The law without what lies below q; its pieces there have no width."""
    # Selected: at a kink the derivative by q is that of the piece above it.
    q = jnp.where(q < law.q[-1], q, law.q[-1])
    kept = law.q > q
    log_value = jnp.where(kept, law.log_value, log_shape(law, q) + 2 * jnp.log(q))
    inside = q >= law.q[0]
    return law._replace(
        q=jnp.where(inside & ~kept, q, law.q), log_value=jnp.where(inside, log_value, law.log_value)
    )
