r"""Leak of a seal: the flow of a fluid through the gaps between rough solids at rest.

A thin film of the height u has the conductivity u^3 / 12 divided by the viscosity. Bruggeman's effective
medium replaces the gaps, with the distribution P(u), by a uniform film of conductivity K. The dimension d of
the medium is chosen so that it closes at the critical area a_c [Dapp, Luecke, Persson & Mueser, Phys. Rev.
Lett. 108, 244301 (2012), arXiv:1308.3449; a_c = 0.415: Wang & Mueser, Tribol. Lett. 69, 1 (2021),
arXiv:2010.13470],

.. math:: \int P(u)\,\frac{d\; 12 K}{u^3 + (d - 1)\,12 K}\,du = 1,\qquad d = \frac{1}{1 - a_c}
          \qquad\Leftrightarrow\qquad
          \int \frac{P(u)\,du}{1 + (u/w)^3} = a_c,\qquad K = \frac{w^3}{12}\,\frac{1 - a_c}{a_c}

A uniform gap gives u^3 / 12. If a gap is open over the share 1 - A and closed elsewhere, K is proportional to
1 - A / a_c. `rubberfric.applications.gaps` has P(u).
"""

import functools
import math

import jax
import jax.numpy as jnp
from jax.scipy.special import erfinv

from rubberfric.applications.conductance import check_half_spaces, relaxed_compliance
from rubberfric.applications.gaps import Gaps, gaps_at_rest, moments_of
from rubberfric.base.blocks import over_points
from rubberfric.base.checks import FINITE, POSITIVE, ArrayLike, as_numbers, between
from rubberfric.base.quadrature import Quadrature, gauss, typed
from rubberfric.base.roots import root
from rubberfric.roughness.moments import cumulative_moment, safe_root
from rubberfric.scene.scene import Scene, check_without, rough_surfaces
from rubberfric.theory.area.area_correction import correct_argument, correction_table
from rubberfric.theory.area.corrected_separation import corrected_separation
from rubberfric.theory.arguments import validate

# Share of the nominal area in contact at which no channel crosses the contact [Wang & Mueser].
CRITICAL_AREA = 0.415

# Nodes over the widths of the Gaussian distributions, per node of a contact panel.
_NODES = 3

# Half of the range of a Gaussian, in standard deviations. The share beyond is 1e-15.
_WIDE = 8.0

# Largest u / w. A larger gap conducts like an infinite one, to 1e-15.
_OPEN = 1e5

# Smallest and largest ln w that are tried, relative to the rms height.
_RANGE = -40.0, 10.0

# Range of x that contains every critical area.
_ARGUMENTS = 1e-9, 6.0

# Pressure that is valid in every scene [Pa].
_ANY_PRESSURE = 1e5

# Points evaluated at once. A larger block takes more memory.
_BLOCK = 8


def leak_conductivity(
    scene: Scene,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    critical_area: ArrayLike = CRITICAL_AREA,
    *,
    quadrature: Quadrature | None = None,
) -> jax.Array:
    r"""Return the flow conductivity K of the gap between two solids at rest.

    .. math:: \dot V = \frac{K}{\eta}\,\frac{L_y}{L_x}\,\Delta p_\mathrm{fluid}

    Parameters
    ----------
    scene : Scene of two half-spaces with isotropic roughness, without adhesion, softening or correlation
        The moduli are the relaxed ones. S is in G for area and separation, regardless of
        `scene.area_correction`.
    pressure, temperature : array_like, broadcastable [Pa], [K]
        The pressure with which the solids press on each other, without the pressure of the fluid.
    critical_area : A/A0 at which no channel crosses the contact [-], 0.01 ... 0.99, a number
    quadrature : Quadrature, static, or None: chosen for the scene

    Returns
    -------
    array, broadcast shape [m^3]; 0 if A/A0 >= critical_area, and without roughness

    Raises
    ------
    ValueError : a part for which the leak is not defined, a solid without relaxed modulus, and as
        `rubberfric.separation`

    Notes
    -----
    On 65 surfaces of boundary elements (H = 0.5 to 0.9, q1/q0 = 6 to 32, eight longest wavelengths along a
    side), K divided by the conductivity of the Reynolds flow is 0.79 to 1.5 for A/A0 < 0.14, and 0.55 to 1.7
    for A/A0 up to 0.33, where the flow itself has a discretisation error of 30 % (notebooks/how_true.md).
    Closer to the critical area K was not compared, and nothing was compared with measured seals. A seal with
    few wavelengths along the flow deviates more, which no theory of averages predicts: with two wavelengths
    along a side, the flow along and across one surface differs by up to 17 at A/A0 = 0.23, and by up to 85
    at 0.31.

    The numerical error is 1e-8, and 1e-7 at light load with a roll-off. The fluid does not push the solids
    apart.

    Examples
    --------
    K in m^3 falls to 0 when A/A0 reaches the critical area:

    >>> seal = rf.load_scene("data/rubber_seal.toml").replace(adhesion=None)
    >>> K = rf.applications.leak_conductivity(seal, np.array([1e4, 5e4, 1e5]))
    >>> [f"{float(x):.2g}" for x in K]
    ['1e-22', '7.2e-27', '0']
    """
    _check_seal(scene, "the leak")
    critical_area = as_numbers("critical_area", critical_area, between(0.01, 0.99))
    scene, (_, pressure, temperature), quadrature = validate(scene, 0.0, pressure, temperature, quadrature)
    stiffness = 1 / (relaxed_compliance(scene, temperature) * pressure)
    critical_area = jnp.asarray(critical_area, stiffness.dtype)
    laws = _power_laws(scene)
    if not laws:
        return jnp.zeros_like(stiffness)
    contact = _corrected_separation(jnp.asarray(scene.gamma))
    return _conductivity(laws, contact, stiffness, critical_area, order=quadrature.order)


def leak_rate(
    scene: Scene,
    pressure: ArrayLike,
    fluid_pressure: ArrayLike,
    viscosity: ArrayLike,
    length: ArrayLike,
    width: ArrayLike,
    temperature: ArrayLike | None = None,
    critical_area: ArrayLike = CRITICAL_AREA,
    *,
    quadrature: Quadrature | None = None,
) -> jax.Array:
    r"""Return the volume of an incompressible fluid that leaks per time, K / eta (width / length) dp [m^3/s].

    Parameters
    ----------
    scene, pressure, temperature, critical_area, quadrature : as in `leak_conductivity`
    fluid_pressure : difference of the fluid pressure across the seal [Pa]
    viscosity : dynamic viscosity of the fluid, > 0 [Pa s]
    length : length of the contact along the flow, > 0 [m]
    width : width of the contact across the flow, such as the circumference, > 0 [m]

    Returns
    -------
    array, broadcast shape of all conditions [m^3/s], with the sign of `fluid_pressure`

    Notes
    -----
    The pressure on the contact is constant over the length. For another profile p(x), the resistances of
    short parts with their own conductivities add up. The fluid does not push the solids apart.

    Examples
    --------
    An O-ring of 50 mm with a contact 2 mm long, and water at 5 bar, in ml per day:

    >>> seal = rf.load_scene("data/rubber_seal.toml").replace(adhesion=None)
    >>> flow = rf.applications.leak_rate(seal, 1e4, 5e5, viscosity=1e-3, length=2e-3, width=0.157)
    >>> f"{float(flow) * 86400 * 1e6:.2g}"
    '0.35'
    """
    drop = as_numbers("fluid_pressure", fluid_pressure, FINITE)
    eta, along, across = (
        as_numbers(name, value, POSITIVE)
        for name, value in (("viscosity", viscosity), ("length", length), ("width", width))
    )
    K = leak_conductivity(scene, pressure, temperature, critical_area, quadrature=quadrature)
    return K * drop / eta * (across / along)


def percolation_pressure(
    scene: Scene, temperature: ArrayLike | None = None, critical_area: ArrayLike = CRITICAL_AREA
) -> jax.Array:
    r"""Return the pressure at which A/A0 is critical and the leak ends.

    .. math:: \sigma_c = \frac{E_r h'}{\sqrt 2}\,x_c,\qquad \mathrm{erf} X(x_c) = a_c

    with the rms slope h'; 0.226 E_r h' for a_c = 0.415 and gamma = 1/2.

    Parameters are as for `leak_conductivity`.

    Returns
    -------
    array of the shape of the temperature [Pa]; 0 without roughness

    Examples
    --------
    The estimate 0.226 E_r h', in kPa:

    >>> seal = rf.load_scene("data/rubber_seal.toml").replace(adhesion=None)
    >>> round(float(rf.applications.percolation_pressure(seal)) / 1e3, 1)
    84.5
    >>> round(0.226 * 1e4 / 0.75 * float(rf.rms_slope(seal.lower.spectrum)), 1)
    84.4
    """
    _check_seal(scene, "the percolation pressure")
    critical_area = as_numbers("critical_area", critical_area, between(0.01, 0.99))
    # The pressure is not used, but checked together with the temperature.
    scene, (_, _, temperature), _ = validate(scene, 0.0, _ANY_PRESSURE, temperature, None)
    return _percolation(scene, 1 / relaxed_compliance(scene, temperature), jnp.asarray(critical_area))


def _check_seal(scene, what):
    """Raise ValueError unless a scene has half-spaces with isotropic roughness."""
    check_half_spaces(scene, what)
    check_without(scene, ("correlation",), what)
    for name, body in (("lower", scene.lower), ("upper", scene.upper)):
        if body.spectrum is not None and body.spectrum.harmonic_count():
            raise ValueError(f"scene.{name}.spectrum is anisotropic: must be isotropic for {what}")


@jax.jit
def _percolation(scene, modulus, critical_area):
    critical_area = critical_area.astype(modulus.dtype)
    table = correction_table(jnp.asarray(scene.gamma))
    target = jnp.log(erfinv(critical_area))

    def miss(log_x):
        return jnp.log(correct_argument(table, jnp.exp(log_x))) - target

    ends = (jnp.full_like(target, math.log(end)) for end in _ARGUMENTS)
    laws = _power_laws(scene)
    slope2 = sum((cumulative_moment(law, 2, jnp.inf) for law in laws), jnp.zeros_like(target))
    return modulus * safe_root(slope2) * jnp.exp(root(miss, *ends)[0]) / math.sqrt(2)


# Compiled apart, so that scenes with other materials and settings do not compile them again.
_corrected_separation = jax.jit(corrected_separation)


@jax.jit
def _power_laws(scene):
    return [spectrum.power_law() for spectrum, _ in rough_surfaces(scene)]


@functools.partial(jax.jit, static_argnames=("order",))
def _conductivity(laws, contact, stiffness, critical_area, *, order):
    moments = moments_of(laws)

    def conductivity_at(stiffness):
        gaps = gaps_at_rest(moments, contact, stiffness, order)
        return effective_conductivity(gaps, critical_area, _NODES * order)

    return over_points(lambda points: jax.vmap(conductivity_at)(*points), (stiffness,), _BLOCK)


def effective_conductivity(gaps: Gaps, critical_area: jax.Array, count: int) -> jax.Array:
    """Return the conductivity of the effective medium [m^3].

    Parameters
    ----------
    gaps : Gaps
    critical_area : a_c, a number
    count : number of nodes over each Gaussian distribution
    """
    width, mean = jax.lax.stop_gradient((jnp.max(gaps.width), jnp.max(gaps.mean)))
    # The first contacts have separations of kilometres, so the width is the better unit.
    height = jnp.where(width > 0, width, mean)
    rough = height > 0
    unit = jnp.where(rough, height, 1.0)
    relative = gaps._replace(mean=gaps.mean / unit, width=gaps.width / unit)

    def excess(log_w):
        return gaps.area + jnp.sum(gaps.share * closed_share(relative, log_w, count)) - critical_area

    ends = (jnp.asarray(end, gaps.area.dtype) for end in _RANGE)
    log_w, has_root = root(excess, *ends)
    flows = has_root & rough & (gaps.area < critical_area)
    cube = jnp.exp(3 * jnp.where(flows, log_w, 0.0)) * unit**3 / 12
    return jnp.where(flows, cube * (1 - critical_area) / critical_area, 0.0)


def closed_share(gaps: Gaps, log_w: jax.Array, count: int) -> jax.Array:
    """Return the mean of 1 / (1 + (u/w)^3) over the Gaussian of each part, reflected at 0.

    `log_w` is ln w, and `count` is the number of nodes. The result has the shape (nodes,).
    """
    node, weight = (typed(table, log_w) for table in gauss(count))
    w = jnp.exp(log_w)
    mean, width = gaps.mean[:, None] / w, gaps.width[:, None] / w
    # No width: then every node lies at the mean.
    some = jnp.maximum(width, float(jnp.finfo(w.dtype).tiny) ** 0.25)
    low, high = jnp.maximum(mean - _WIDE * some, 0.0), mean + _WIDE * some
    low, high = (jnp.arcsinh(jnp.minimum(end, _OPEN)) for end in (low, high))
    # Nodes are even in ln u above w and in u below w, where the integrand varies on the scale of w.
    place = low + (high - low) * node
    u = jnp.sinh(place)
    ahead, reflected = (u - mean) / some, 2 * (u / some) * (mean / some)
    log_density = -0.5 * ahead**2 + jnp.log1p(jnp.exp(-reflected)) + jnp.log(jnp.cosh(place))
    share = jax.nn.softmax(log_density + jnp.log(weight), -1)
    return jnp.sum(share / (1 + u**3), -1)
