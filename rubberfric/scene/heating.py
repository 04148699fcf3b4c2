r"""Frictional heating: temperature of a solid at each length scale.

The temperature at the wavevector q is averaged over the depth and width 1/q. The heat of all scales q'
diffuses for the time t_0 = R/v in which a macroasperity contact of size R slides past [Persson, J. Phys.:
Condens. Matter 18 (2006) 7789, arXiv:cond-mat/0605273, with S in f]:

.. math:: T_q = T_0 + \int dq'\, g(q, q')\, f(q'),\qquad
          f(q) = \frac{2 v q^3}{\rho c_p P_m} S P\, C \int d\varphi \cos\varphi\, \mathrm{Im}K
.. math:: g = \frac{1}{\pi}\int_0^\infty dk\, \frac{1 - e^{-D k^2 t_0}}{D k^2}\,
          \frac{4q'}{k^2 + 4q'^2}\, \frac{4q^2}{k^2 + 4q^2},\qquad D = \frac{\lambda}{\rho c_p}

Energy is conserved: rho c_p int f/(2q) dq = mu sigma_0 v / P_m. The integral over k is evaluated as a sum.
Its integrand is a product of functions of q, of q' and of v, so all temperatures follow from two matrix
products, and nothing cancels at q = q'. The slowly decaying part at small k has a closed form.
"""

import functools
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import chebyshev

from rubberfric.base.checks import POSITIVE, between
from rubberfric.base.objects.fields import Number, OptionalNumber, leaf, static
from rubberfric.base.objects.physical import PhysicalObject, physical
from rubberfric.base.quadrature import chebyshev_sum, typed

# e-folds of k below the smallest 2q. There the terms differ from their closed form by (k/2q)^2, 4e-11 at the
# end.
_E_FOLDS_BELOW = 12.0
# e-folds of k above the largest 2q. There the terms fall at least as k^-3, to 4e-11 at the end.
_E_FOLDS_ABOVE = 8.0


@physical
class ThermalProperties(PhysicalObject):
    """Thermal properties of one solid.

    Parameters
    ----------
    density : [kg/m^3], about 2.4e3 for asphalt
    heat_capacity : [J/(kg K)], about 0.9e3
    conductivity : [W/(m K)], about 1.5

    Examples
    --------
    >>> asphalt = rf.ThermalProperties(density=2.4e3, heat_capacity=0.9e3, conductivity=1.5)
    >>> rubber = rf.ThermalProperties(density=1.2e3, heat_capacity=1.6e3, conductivity=0.23)
    >>> e = [float(x.density * x.heat_capacity * x.conductivity) ** 0.5 for x in (asphalt, rubber)]
    >>> round(e[1] / sum(e), 2)
    0.27
    >>> road = rf.Body(rf.Rigid(), thermal=asphalt)
    """

    density: Number = leaf(POSITIVE, unit="kg/m^3")
    heat_capacity: Number = leaf(POSITIVE, unit="J/(kg K)")
    conductivity: Number = leaf(POSITIVE, unit="W/(m K)")


@physical
class Heating(PhysicalObject):
    r"""Frictional heating of the deformable solids of a scene.

    Parameters
    ----------
    density : [kg/m^3], about 1.2e3 for rubber
    heat_capacity : [J/(kg K)], about 1.6e3
    conductivity : [W/(m K)], about 0.23
    radius : R, size of the macroasperity contacts [m], > 0
    area_fraction : P_m, share of the nominal area in macroasperity contacts [-], 0 ... 1
        If None, P_m = P(q_m) with q_m = pi / R.
    shear_share : share of the heat of contact shear that enters the deformable solid, or the upper one of two
        deformable solids [-], 0 ... 1. The other solid receives the remaining heat.
        If None, the shares are proportional to the effusivities sqrt(lambda rho c_p), 1/2 each for equal
        solids. The rise of a solid at q is its share times the rise that all of the heat would cause in it,
        averaged over the depth 1/q. At the surface, for q to infinity, both rises are equal [Blok, Proc.
        Inst. Mech. Eng. 2 (1937) 222] and satisfy 1/T = 1/T_1 + 1/T_2, where T_1 and T_2 are the rises if
        one solid received all of the heat [Jaeger, Proc. R. Soc. N.S.W. 76 (1942) 203]. At finite q this does
        not hold for different diffusivities: the better conductor is hotter, because its heat penetrates
        deeper.
    shear_at : "flash" or "background" (static)
        temperature of contact shear: the temperature in the contact, or the temperature far from the contact.
    branch : "rising" or "falling" (static)
        If friction decreases with temperature, several steady states may exist at one velocity. "rising"
        selects the state reached by slowly increasing the velocity from rest, "falling" the state reached
        by slowly decreasing it from high velocity, both at the given pressure and background temperature.
        Where a branch ends, the state that the temperatures jump to is returned. The two branches differ
        within hysteresis loops.

    Density, heat capacity and conductivity apply to both solids, unless a Body has a `thermal`. Calls with a
    heated scene require `temperature`, the temperature far from the contact. A scene without roughness keeps
    this temperature.

    Limits: for heat conduction every body is a half-space of one material. This holds if the diffusion length
    sqrt(D R / v) is small compared with the thickness of a layer, or if both parts of a Coating conduct
    equally. The heat of viscoelastic losses stays in the solid where it is generated.

    Examples
    --------
    >>> cold = rf.load_scene("data/tread_on_asphalt.toml")
    >>> heating = rf.Heating(density=1.2e3, heat_capacity=1.6e3, conductivity=0.23, radius=2e-3)
    >>> hot = cold.replace(heating=heating)
    >>> solution = rf.solve(hot, 1.0, 0.3e6, 293.15, quantities=("friction", "flash_temperature"))
    >>> round(float(solution.flash_temperature) - 293.15), round(float(solution.friction), 3)
    (4, 0.122)
    >>> round(float(rf.friction(cold, 1.0, 0.3e6, 293.15)), 3)
    0.13
    """

    density: Number = leaf(POSITIVE, unit="kg/m^3")
    heat_capacity: Number = leaf(POSITIVE, unit="J/(kg K)")
    conductivity: Number = leaf(POSITIVE, unit="W/(m K)")
    radius: Number = leaf(POSITIVE, unit="m")
    area_fraction: OptionalNumber = leaf(between(1e-12, 1.0), unit="-", default=None)
    shear_share: OptionalNumber = leaf(between(0.0, 1.0), unit="-", default=None)
    shear_at: Literal["flash", "background"] = static(default="flash")
    branch: Literal["rising", "falling"] = static(default="rising")


def heating_of(heating: Heating, thermal: ThermalProperties | None) -> Heating:
    """Return `heating`, in which `thermal` replaces the thermal properties if `thermal` is given."""
    if thermal is None:
        return heating
    values = {name: getattr(thermal, name) for name in ("density", "heat_capacity", "conductivity")}
    return heating.replace(**values)


def shear_shares(lower: Heating, upper: Heating, both_deform: bool) -> tuple[jax.Array, jax.Array]:
    """Return the shares of the lower and the upper solid in the heat of contact shear [-].

    `both_deform` is True if both solids deform. If only one solid deforms and `shear_share` is given, both
    results equal `shear_share`, which is the share of the deformable solid.
    """
    if upper.shear_share is not None:
        share = jnp.asarray(upper.shear_share)
        return (1 - share if both_deform else share), share
    # Logarithms, because products of the three overflow float32.
    log_lower, log_upper = (
        0.5 * (jnp.log(x.conductivity) + jnp.log(x.density) + jnp.log(x.heat_capacity))
        for x in (lower, upper)
    )
    return jax.nn.sigmoid(log_lower - log_upper), jax.nn.sigmoid(log_upper - log_lower)


class Diffusion(NamedTuple):
    """Factors in the sum over k of the heat kernel g, for source and target wavevectors q' and q."""

    k: jax.Array  # [1/m], (m,)
    step: jax.Array  # of ln k
    reference: jax.Array  # x at which the integral over k has a closed form [1/m]
    source: jax.Array  # x^2 / (k^2 + x^2) with x = 2 q', (sources, m)
    target: jax.Array  # x^2 / (k^2 + x^2) with x = 2 q, (targets, m)
    wavevector: jax.Array  # q of the targets [1/m]


def diffusion(
    source_q: jax.Array, target_q: jax.Array, ends: tuple[jax.Array, jax.Array], count: int
) -> Diffusion:
    """Return the `Diffusion` from wavevectors of sources to wavevectors of targets.

    Parameters
    ----------
    source_q, target_q : shape (n,) [1/m]
    ends : (smallest, largest) of all wavevectors [1/m]
        Approximate values suffice. The result has no gradient with respect to `ends`.
    count : number of nodes of the sum over ln k
    """
    low, high = (jnp.log(2 * jax.lax.stop_gradient(q)) for q in ends)
    step = (high - low + _E_FOLDS_BELOW + _E_FOLDS_ABOVE) / (count - 1)
    k = jnp.exp(low - _E_FOLDS_BELOW + step * np.arange(count))
    source, target = (_share(2 * q[:, None], k) for q in (source_q, target_q))
    return Diffusion(k, step, jnp.exp(low), source, target, target_q)


def _share(x, k):
    """Return x^2 / (k^2 + x^2) from the quotient k/x, because squares overflow float32."""
    return 1 / (1 + (k / x) ** 2)


class HeatKernel(NamedTuple):
    """Data for the spreading of heat at given velocities, which do not depend on temperature."""

    diffusion: Diffusion
    weight: jax.Array  # of the sum over k [m], (points, m)
    closed: jax.Array  # closed form of the part outside the sum [m], (points,)
    surface: jax.Array | None  # for heat generated at the surface [m], (points, targets)
    heat: jax.Array  # heat capacity of a volume [J/(m^3 K)]


def heat_kernel(heating: Heating, ready: Diffusion, velocity: jax.Array, surface: bool) -> HeatKernel:
    """Return the `HeatKernel` at velocities [m/s] of shape (points,), with surface heat if `surface`."""
    weight = _kernel(heating, ready.k, velocity) * (ready.step * ready.k)
    known = weight @ _share(ready.reference, ready.k) ** 2
    closed = _closed(heating, ready.reference, velocity, "double") - known
    below = _closed(heating, 2 * ready.wavevector, velocity[:, None], "single") if surface else None
    return HeatKernel(ready, weight, closed, below, heating.density * heating.heat_capacity)


def rise_inside(kernel: HeatKernel, power: jax.Array) -> jax.Array:
    """Return the temperature rise [K] at every q from heat generated inside the solid, (points, targets).

    `power` is heat / velocity of each source, per area of macroasperity contact [Pa], (points, sources).
    """
    summed = (kernel.weight * (power @ kernel.diffusion.source)) @ kernel.diffusion.target.T
    closed = kernel.closed * jnp.sum(power, -1)
    return 2 / jnp.pi * (summed + closed[:, None]) / kernel.heat


def rise_below_surface(kernel: HeatKernel, power: jax.Array) -> jax.Array:
    """Return the temperature rise [K] at every q from heat generated at the surface, (points, targets).

    `power` is heat / velocity per area of macroasperity contact [Pa], of shape (points,).
    """
    if kernel.surface is None:
        raise ValueError("kernel.surface is None; create the kernel with surface=True")
    return 2 / jnp.pi * power[:, None] * kernel.surface / kernel.heat


def diffusivity(heating: Heating) -> jax.Array:
    """Return D = lambda / (rho c_p) [m^2/s]."""
    return heating.conductivity / (heating.density * heating.heat_capacity)


def _kernel(heating, k, velocity):
    """Return v (1 - e^(-D k^2 R / abs(v))) / (D k^2) [m], an odd function of v."""
    # The square root of D k^2 R, because k^2 overflows float32.
    rate = (k * jnp.sqrt(diffusivity(heating) * heating.radius)) ** 2
    speed = jnp.abs(velocity)[:, None]
    # Above 80 the exponential is 0 to the last bit; the limit also avoids 1/0 at v = 0.
    y = rate / jnp.maximum(speed, rate / 80)
    return velocity[:, None] * (-jnp.expm1(-y) / rate) * heating.radius


def _closed(heating, x, velocity, kind):
    """Return the integral over k of `_kernel` times s ("single") or s^2 ("double"), s = x^2 / (k^2 + x^2)."""
    root = jnp.sqrt(diffusivity(heating) * heating.radius)
    # s = sqrt(D R / v). Only v / sqrt(v) appears, because the derivative of sqrt(v) is infinite at v = 0.
    speed = jnp.maximum(jnp.abs(velocity), float(jnp.finfo(jnp.result_type(velocity)).tiny) ** 0.5)
    z = x * root / jnp.sqrt(speed)
    share = z / (1 + z)
    table = typed(_tables()[kind], z)
    u = 1 - 2 / (1 + z)
    return velocity * (root / jnp.sqrt(speed)) * share * chebyshev_sum(table, u) * (heating.radius / root**2)


@functools.cache
def _tables():
    r"""Return the Chebyshev coefficients in u = (z - 1)/(z + 1) of two functions of z.

    The functions are (1 + z)/z times the integrals

    .. math:: z^2 \int_0^\infty dp \frac{1 - e^{-p^2}}{p^2 (p^2 + z^2)} \quad\text{("single")},\qquad
              z^4 \int_0^\infty dp \frac{1 - e^{-p^2}}{p^2 (p^2 + z^2)^2} \quad\text{("double")}

    The trapezoidal rule in ln p is exact to rounding. The first integral has the closed form
    sqrt(pi) - (pi/2)(1 - erfcx z)/z, which would lose digits at small z.
    """
    p = np.exp(np.arange(-45.0, 45.0, 0.1))
    memory = -np.expm1(-(p**2)) / p * 0.1  # times p, for d ln p

    def function(u, power):
        z = ((1 + u) / (1 - u))[:, None]
        return np.sum(memory * (1 / (1 + (p / z) ** 2)) ** power, -1) * ((1 + z) / z)[:, 0]

    return {
        kind: chebyshev.chebinterpolate(lambda u, power=power: function(u, power), 26)
        for kind, power in {"single": 1, "double": 2}.items()
    }
