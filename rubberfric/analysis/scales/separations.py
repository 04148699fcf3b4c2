"""Separations over the wavevector: the mean separation of the surfaces at each resolution."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.analysis.scales.profiles import (
    checked_wavevectors,
    default_wavevectors,
    density_of,
    fluctuation_at_borders,
)
from rubberfric.base.blocks import over_points
from rubberfric.base.checks import ArrayLike
from rubberfric.base.quadrature import Quadrature
from rubberfric.roughness.spectra import log_shape
from rubberfric.scene.scene import Scene, check_without, temperature_by_scale
from rubberfric.theory.area.partial_contact import (
    TWO_OVER_ROOT_PI,
    contact_argument,
    contact_fraction,
)
from rubberfric.theory.arguments import validate
from rubberfric.theory.integrals import evaluate, prepare, solved
from rubberfric.theory.structure import SurfaceTemperatures, rough_surfaces_of

# Default number of wavevectors of a separation profile, which has a mesh for every wavevector.
_SEPARATION_COUNT = 100
# Points of a separation profile evaluated at once. Each keeps the nodes of all meshes in memory.
_SEPARATION_BLOCK = 8


class SeparationProfile(NamedTuple):
    """Results of `separation_profile`.

    `q` has the shape [q]. The other fields have the shape [conditions..., q].
    """

    q: jax.Array  # wavevectors [1/m]
    area: jax.Array  # P(q), of the plain G [-]
    contact_separation: jax.Array  # u_bar(q), mean over the contact area at resolution q [m]
    separation: jax.Array  # u1(q), of the area that leaves contact at q [m]


def separation_profile(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    q: ArrayLike | None = None,
    quadrature: Quadrature | None = None,
) -> SeparationProfile:
    r"""Compute the separation of the area that leaves contact at scale q.

    .. math:: u_1(q) = \frac{d[\bar u(q) P(q)]}{dP}, \qquad
              \int u_1 (-dP) + P(q_1)\, \bar u(q_1) = \bar u

    [Yang & Persson, J. Phys.: Condens. Matter 20, 215214 (2008)]. At resolution q the solids are in contact
    over P(q) A0, under the mean pressure sigma_0 / P(q). Roughness beyond q opens gaps with the mean

    .. math:: \bar u(q) = \int_{q}^{q_1} d^2q' \sum_j C_j\,\mathrm{Re}K_j\,\frac{x}{2p}\Psi(x),\qquad
              x = \frac{p}{2\sigma_0\sqrt{G(q') - G(q)}},\quad p = \frac{\sigma_0}{P(q)}

    which is `separation` of a scene with roughness beyond q only. Between q and q + dq the area -dP A0 leaves
    contact and the volume of gaps below P A0 falls by d(u_bar P). The mean separation of this area is u1.
    Because u_bar(q1) = 0, the sum over all area is u_bar(q0).

    Parameters are as for `profile`. If `q` is None, there are 100 wavevectors over the roughness.

    Returns
    -------
    SeparationProfile. The share of area with a separation above u1(q) is 1 - P(q) where u1 falls with q. u1
    is 0 beyond the roughness. It is infinite where P = 1 to the last bit, because no area leaves contact
    there.

    Raises
    ------
    ValueError : as `profile`; a heated scene.

    Limits: velocity and temperature are the same at every q. G does not contain S, as in `separation`. The
    computation takes a thousand times the work of `separation`, with one mesh for every q. Smooth solids have
    u1 = u_bar = 0.

    Examples
    --------
    The area that leaves contact at the scale of long waves has a larger separation than at short waves:

    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> profile = rf.analysis.separation_profile(scene, 0.01, 0.15e6, q=np.array([200.0, 2e3]))
    >>> (1e6 * profile.contact_separation).round()  # in µm
    Array([811.,  47.], dtype=float64)
    """
    scene, conditions, quadrature = validate(scene, velocity, pressure, temperature, quadrature)
    check_without(scene, ("adhesion", "correlation"), "the separation")
    q = checked_wavevectors(q, 1, conditions, scene)
    if temperature_by_scale(scene):
        raise ValueError(
            "scene.heating must be None: the separation at a scale q is not defined for a heated scene"
        )
    return _separation_profile(scene, *conditions, q, quadrature=quadrature)


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _separation_profile(scene, velocity, pressure, temperature, q, *, quadrature):
    surfaces = rough_surfaces_of(scene)
    if not surfaces:
        shape = (*jnp.broadcast_shapes(velocity.shape, pressure.shape), q.shape[0])
        unity = jnp.ones(shape, q.dtype)
        return SeparationProfile(q, unity, 0 * unity, 0 * unity)
    q = default_wavevectors([surface.law for surface in surfaces], _SEPARATION_COUNT) if q is None else q
    prepared = prepare(scene, ("area",), quadrature, surfaces=surfaces, borders=q)
    densities = [density_of(surface, prepared.roughness.scale, "mean_abs2", q) for surface in surfaces]
    block = functools.partial(_separations, scene, prepared, surfaces, densities, q, quadrature)
    return SeparationProfile(q, **over_points(block, (velocity, pressure, temperature), _SEPARATION_BLOCK))


def _separations(scene, prepared, surfaces, densities, q, quadrature, points):
    velocity, pressure, *temperature = points
    contact, _ = solved(prepared, *points)
    ratio = contact.modulus_over_pressure[:, None]
    G = fluctuation_at_borders(prepared, contact, q.shape[0])
    x = contact_argument(G)
    P = contact_fraction(x)
    both = SurfaceTemperatures(*temperature * 2)
    density = sum(density_at(velocity, both) for density_at in densities)
    # dP / d ln q from the exact density of G. G may be 0; x^2 = 1 / (4 G) is clipped at 27^2.
    slope = -TWO_OVER_ROOT_PI * jnp.exp(-x * x) * 2 * x**3 * (0.5 * ratio**2 * density)

    def beyond(log_step, load_step, q, mean_pressure):
        cut = [surface._replace(law=_beyond(surface.law, q * jnp.exp(log_step))) for surface in surfaces]
        ready = prepare(scene, ("separation",), quadrature, surfaces=cut)
        at = (velocity, mean_pressure * jnp.exp(load_step), *temperature)
        return evaluate(ready, ("separation",), at)["separation"]

    def gap_and_slopes(q, mean_pressure):
        zero = jnp.zeros_like(q)
        steps = functools.partial(beyond, q=q, mean_pressure=mean_pressure)
        gap, by_log_q = jax.jvp(lambda step: steps(step, zero), (zero,), (zero + 1,))
        _, by_log_load = jax.jvp(lambda step: steps(zero, step), (zero,), (zero + 1,))
        return gap, by_log_q, by_log_load

    gap, by_log_q, by_log_load = (y.T for y in jax.vmap(gap_and_slopes)(q, (pressure[:, None] / P).T))
    leaving = slope < 0
    rate = P * by_log_q / jnp.where(leaving, slope, -1.0)
    u1 = jnp.where(leaving, gap - by_log_load + rate, jnp.where(gap > 0, jnp.inf, 0.0))
    return {"area": P, "contact_separation": gap, "separation": u1}


def _beyond(law, q):
    """Remove the roughness below q from a power law. The pieces of the power law below q get zero width."""
    # At a kink the derivative with respect to q is taken from the piece above.
    q = jnp.where(q < law.q[-1], q, law.q[-1])
    above = law.q > q
    log_value = jnp.where(above, law.log_value, log_shape(law, q) + 2 * jnp.log(q))
    inside = q >= law.q[0]
    return law._replace(
        q=jnp.where(inside & ~above, q, law.q), log_value=jnp.where(inside, log_value, law.log_value)
    )
