r"""Frictional heating: how hot a solid is at each length scale.

Roughness up to q sees the temperature averaged over the depth and width 1/q, the heat of all
scales q' diffusing for the time t_0 = R/v in which a macroasperity contact of size R slides past
[Persson, J. Phys.: Condens. Matter 18 (2006) 7789, arXiv:cond-mat/0605273, with S in f]:

.. math:: T_q = T_0 + \int dq'\, g(q, q')\, f(q'),\qquad
          f(q) = \frac{2 v q^3}{\rho c_p P_m} S P\, C \int d\varphi \cos\varphi\, \mathrm{Im}K
.. math:: g = \frac{1}{\pi}\int_0^\infty dk\, \frac{1 - e^{-D k^2 t_0}}{D k^2}\,
          \frac{4q'}{k^2 + 4q'^2}\, \frac{4q^2}{k^2 + 4q^2},\qquad D = \frac{\lambda}{\rho c_p}

so that the energy closes, rho c_p int f/(2q) dq = mu sigma_0 v / P_m. The kernel is summed over k
instead of being taken in its closed form: the integrand is a product of one factor of q, one of q'
and one of v alone, so that all temperatures are two matrix products with matrices of the scene,
and nothing cancels where q = q'. Its end at small k, which falls slowly, is known in closed form.
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
from rubberfric.base.quadrature import typed

# e-folds of k below the smallest and above the largest 2q: the rest is below 1e-10.
_BELOW, _ABOVE = 12.0, 8.0


@physical
class ThermalProperties(PhysicalObject):
    """How one solid takes up heat.

    Parameters
    ----------
    density : [kg/m^3], about 2.4e3 for asphalt
    heat_capacity : [J/(kg K)], about 0.9e3
    conductivity : [W/(m K)], about 1.5
    """

    density: Number = leaf(POSITIVE, unit="kg/m^3")
    heat_capacity: Number = leaf(POSITIVE, unit="J/(kg K)")
    conductivity: Number = leaf(POSITIVE, unit="W/(m K)")


@physical
class Heating(PhysicalObject):
    r"""Heat of friction in the deformable solids of a scene.

    Parameters
    ----------
    density : [kg/m^3], about 1.2e3 for rubber
    heat_capacity : [J/(kg K)], about 1.6e3
    conductivity : [W/(m K)], about 0.23
    radius : R, size of the macroasperity contacts [m], > 0
    area_fraction : P_m, share of the nominal area in macroasperity contacts [-], 0 ... 1;
        None: P(q_m) at q_m = pi / R.
    shear_share : share of the heat of contact shear that goes into the deformable solid, of two into the
        upper one [-], 0 ... 1; the other solid has the rest.
        None: the shares are as the effusivities sqrt(lambda rho c_p), 1/2 each for equal solids. Each solid
        rises, at every q, by its share times what all of the heat would cause in it, averaged over the depth
        1/q. At the surface, q to infinity, both rises are equal [Blok, Proc. Inst. Mech. Eng. 2 (1937) 222]
        and are the harmonic sum 1/T = 1/T_1 + 1/T_2 of what all of the heat would cause in either [Jaeger,
        Proc. R. Soc. N.S.W. 76 (1942) 203]. At finite q neither holds if the diffusivities differ: the solid
        that conducts better is hotter, as its heat goes deeper.
    shear_at : "flash" or "background" (static)
        whether contact shear has the temperature of the contact or that far away.
    branch : "rising" or "falling" (static)
        Friction that falls as the rubber warms can make several temperatures possible at one velocity.
        Those of "rising" are reached from rest by a velocity that rises slowly, those of "falling" from
        high velocities by one that falls slowly, both at the given pressure and background; where
        a branch ends, at the state that the temperatures jump to. The two differ within hysteresis loops.

    Both solids have these values, unless a Body has a `thermal` of its own. Without roughness there is no
    scale to be hot, and they keep the temperature far away. Temperatures must be given wherever a heated
    scene is computed: they are those far from the contact.

    Limits: to the heat every body is a half-space of one material, whatever its layer: good where the
    diffusion length sqrt(D R / v) is small against the thickness, or both parts of a Coating conduct alike.
    The heat of the losses stays in the solid that has them: none crosses to the other one.
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
    """The heating of one solid, which may have thermal properties of its own."""
    if thermal is None:
        return heating
    values = {name: getattr(thermal, name) for name in ("density", "heat_capacity", "conductivity")}
    return heating.replace(**values)


def shear_shares(lower: Heating, upper: Heating, both_deform: bool) -> tuple[jax.Array, jax.Array]:
    """Shares of the heat of contact shear of (lower, upper) solid [-], each of its own `heating_of`.

    both_deform : whether both do; if only one does, a given share is that of either
    """
    if upper.shear_share is not None:
        share = jnp.asarray(upper.shear_share)
        return (1 - share if both_deform else share), share
    # By logarithms: products of the three leave float32.
    one, two = (
        0.5 * (jnp.log(x.conductivity) + jnp.log(x.density) + jnp.log(x.heat_capacity))
        for x in (lower, upper)
    )
    return jax.nn.sigmoid(one - two), jax.nn.sigmoid(two - one)


class Diffusion(NamedTuple):
    """The sum over k: factors of the sources and of the places where the temperature is wanted."""

    k: jax.Array  # [1/m], (m,)
    step: jax.Array  # of ln k
    reference: jax.Array  # x for which the integral over k is known in closed form [1/m]
    source: jax.Array  # x^2 / (k^2 + x^2) with x = 2 q', (sources, m)
    target: jax.Array  # the same with x = 2 q, (targets, m)
    wavevector: jax.Array  # q of the targets [1/m]


def diffusion(
    source_q: jax.Array, target_q: jax.Array, ends: tuple[jax.Array, jax.Array], count: int
) -> Diffusion:
    """`Diffusion` from wavevectors of sources to those of targets.

    Parameters
    ----------
    source_q, target_q : shape (n,) [1/m]
    ends : (smallest, largest) of all of them; need not be exact, and carry no gradient
    count : nodes of the sum over ln k
    """
    low, high = (jnp.log(2 * jax.lax.stop_gradient(q)) for q in ends)
    step = (high - low + _BELOW + _ABOVE) / (count - 1)
    k = jnp.exp(low - _BELOW + step * np.arange(count))
    source, target = (_share(2 * q[:, None], k) for q in (source_q, target_q))
    return Diffusion(k, step, jnp.exp(low), source, target, target_q)


def _share(x, k):
    """x^2 / (k^2 + x^2), of the quotient: squares leave float32."""
    return 1 / (1 + (k / x) ** 2)


class HeatKernel(NamedTuple):
    """How the heat of a velocity spreads: what no temperature changes."""

    diffusion: Diffusion
    weight: jax.Array  # of the sum over k [m], (points, m)
    closed: jax.Array  # what the sum leaves out, known in closed form [m], (points,)
    surface: jax.Array | None  # of heat set free at the surface [m], (points, targets)
    heat: jax.Array  # heat capacity of a volume [J/(m^3 K)]


def heat_kernel(heating: Heating, ready: Diffusion, velocity: jax.Array, surface: bool) -> HeatKernel:
    """`HeatKernel` at velocities of shape (points,) [m/s]; `surface`: whether heat is set free there too."""
    weight = _kernel(heating, ready.k, velocity) * (ready.step * ready.k)
    known = weight @ _share(ready.reference, ready.k) ** 2
    closed = _closed(heating, ready.reference, velocity, "double") - known
    below = _closed(heating, 2 * ready.wavevector, velocity[:, None], "single") if surface else None
    return HeatKernel(ready, weight, closed, below, heating.density * heating.heat_capacity)


def rise_inside(kernel: HeatKernel, power: jax.Array) -> jax.Array:
    r"""Temperature rise of heat set free inside the solid, over q.

    Parameters
    ----------
    kernel : HeatKernel
    power : heat over velocity for each source, per area of macroasperity contact [Pa], (points, sources)

    Returns
    -------
    array (points, targets) [K]
    """
    summed = (kernel.weight * (power @ kernel.diffusion.source)) @ kernel.diffusion.target.T
    closed = kernel.closed * jnp.sum(power, -1)
    return 2 / jnp.pi * (summed + closed[:, None]) / kernel.heat


def rise_below_surface(kernel: HeatKernel, power: jax.Array) -> jax.Array:
    """Temperature rise of heat set free at the surface, over q: [K], shape (points, targets).

    power : heat over velocity per area of macroasperity contact [Pa], shape (points,)
    """
    if kernel.surface is None:
        raise ValueError("kernel.surface is None: must have been made for heat at the surface")
    return 2 / jnp.pi * power[:, None] * kernel.surface / kernel.heat


def diffusivity(heating: Heating) -> jax.Array:
    """D = lambda / (rho c_p) [m^2/s]."""
    return heating.conductivity / (heating.density * heating.heat_capacity)


def _kernel(heating, k, velocity):
    """v (1 - e^(-D k^2 R / v)) / (D k^2): how far the heat of wavevector k is remembered [m], odd in v."""
    # D k^2 R, whose square root is formed: k^2 leaves float32.
    rate = (k * jnp.sqrt(diffusivity(heating) * heating.radius)) ** 2
    speed = jnp.abs(velocity)[:, None]
    # Beyond 80 the exponential is 0 to the last bit; v = 0 stays away from 1/0.
    y = rate / jnp.maximum(speed, rate / 80)
    return velocity[:, None] * (-jnp.expm1(-y) / rate) * heating.radius


def _closed(heating, x, velocity, kind):
    """The integral of `_kernel` times x^2/(k^2 + x^2), "double": times its square, over k; any shapes."""
    root = jnp.sqrt(diffusivity(heating) * heating.radius)
    # s = sqrt(D R / v); of the root of v, whose derivative at v = 0 is infinite, only v / sqrt(v) is left.
    speed = jnp.maximum(jnp.abs(velocity), float(jnp.finfo(jnp.result_type(velocity)).tiny) ** 0.5)
    z = x * root / jnp.sqrt(speed)
    share = z / (1 + z)
    table = typed(_tables()[kind], z)
    u = 1 - 2 / (1 + z)
    return velocity * (root / jnp.sqrt(speed)) * share * _chebyshev(table, u) * (heating.radius / root**2)


def _chebyshev(coefficients, u):
    """Sum of Chebyshev polynomials by Clenshaw's recursion: one loop over the elements, quick to compile."""
    twice, one, two = 2 * u, jnp.zeros_like(u), jnp.zeros_like(u)
    for c in coefficients[:0:-1]:
        one, two = twice * one - two + c, one
    return u * one - two + coefficients[0]


@functools.cache
def _tables():
    r"""Chebyshev coefficients over u = (z - 1)/(z + 1) of two functions of z.

    They are (1 + z)/z times

    .. math:: z^2 \int_0^\infty dp \frac{1 - e^{-p^2}}{p^2 (p^2 + z^2)} \quad\text{("single")},\qquad
              z^4 \int_0^\infty dp \frac{1 - e^{-p^2}}{p^2 (p^2 + z^2)^2} \quad\text{("double")}

    By the trapezoidal rule in ln p, exact to rounding. The first is
    sqrt(pi) - (pi/2)(1 - erfcx z)/z, which cancels at small z.
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
