r"""Grip of a patch that slips: the brush model with the friction of a scene.

The patch is a row of elastic elements. An element enters at the leading edge, sticks to the ground, and is
sheared by the slip until the shear stress reaches the friction. It then slides to the trailing edge,

.. math:: \tau(s) = \begin{cases} k \sigma L s & s < s^* \\ p(s)\,\mu(v_s, p(s), T) & s > s^* \end{cases},
          \qquad F = L w \int_0^1 \tau\, ds,\qquad M = L^2 w \int_0^1 \tau \left(s - \tfrac12\right) ds

[Fromm 1941; Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, chapter 3]. For the slip angle :math:`\alpha`
and for the slip ratio :math:`\kappa`, at the travelling speed V,

.. math:: \sigma = \tan|\alpha|,\quad v_s = V \sin|\alpha| \qquad\text{or}\qquad
          \sigma = \frac{|\kappa|}{1 + \kappa},\quad v_s = V |\kappa|

The sliding speed :math:`v_s` is the same along the patch.

An element without pressure carries no stress, and loses its deflection. Places without pressure, such as a
groove or the ends of a measured pressure, therefore separate contacts. In each contact, from :math:`s_0` to
:math:`s_1`, elements enter at :math:`s_0`, stick with the stress :math:`k \sigma L (s - s_0)`, and slide from
:math:`s^*` to :math:`s_1`. They do not stick again before :math:`s_1`, even if the pressure rises. Force and
moment are sums over all contacts. Derivatives by measured pressures are taken for a fixed set of contacts.

The stress is continuous at :math:`s^*`, so that :math:`s^*` carries no first derivative of F.

The model leaves out the change of the sliding speed along the patch, the deformation of the carcass, camber,
water, and the temperature that an element gains in earlier turns. The first one changes the force by -2 to +3
% where friction rises with the speed, and by 6 to 20 % near the peak where it falls. The model was not
compared with measured slip curves.
"""

import functools
import warnings
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial.chebyshev import chebpts1

from rubberfric.base.checks import POSITIVE, ArrayLike, UnitWarning, as_array, check_kind, check_values, shown
from rubberfric.base.compilation import quick_jit
from rubberfric.base.quadrature import Quadrature, chebyshev_sum, chebyshev_transform, gauss, typed
from rubberfric.base.roots import root
from rubberfric.roughness.moments import safe_root
from rubberfric.scene.patch import Patch
from rubberfric.scene.plausible import warn_of_conditions
from rubberfric.scene.scene import Scene, result_dtype
from rubberfric.scene.settings import default_quadrature
from rubberfric.theory.model import friction

SlipKind = Literal["angle", "ratio"]

# Rules of the slip, by its kind.
_RANGES = {
    "angle": ("must be between -pi/2 and pi/2; is it in degrees?", lambda x: np.abs(x) < np.pi / 2),
    "ratio": ("must be > -1", lambda x: x > -1),
}

# Number of pressures at which friction is computed, Chebyshev nodes in the root of p. The force then has an
# error of 1e-8, and of 1e-6 where contact is nearly full. In ln p, ten nodes are needed.
_PRESSURES = 8
# Number of Gauss nodes between two kinks of the pressure.
_NODES = 24
# Number of slips among which the peak is searched.
_SLIPS = 33
# Number of intervals of the patch in which the first sliding element of a contact is searched. They are even
# between two kinks of the pressure.
_INTERVALS = 64
# Smallest number of these intervals between two kinks, where the friction stress is slightly curved.
_LEAST_INTERVALS = 4
# Share of the length next to the beginning of a contact, whose elements slide if the next ones do.
_EDGE = 1e-12
# Smallest such share in units of rounding of s, so that s differs from the beginning.
_EDGE_ROUNDING = 16


class Grip(NamedTuple):
    """Results of `grip`, each of the broadcast shape.

    Attributes
    ----------
    force : tangential force, with the sign of the slip [N]
    coefficient : force / load [-]
    moment : aligning moment of a side force, with the sign of the slip, or None for a slip ratio [N m]
    sliding : share of the length in contact that slides [-]
    """

    force: jax.Array
    coefficient: jax.Array
    moment: jax.Array | None
    sliding: jax.Array


def grip(
    scene: Scene,
    patch: Patch,
    slip: ArrayLike,
    speed: ArrayLike,
    load: ArrayLike,
    temperature: ArrayLike | None = None,
    kind: SlipKind = "angle",
    *,
    quadrature: Quadrature | None = None,
) -> Grip:
    """Return the tangential force of a patch that slips on a surface.

    Parameters
    ----------
    scene : Scene of tread and road
    patch : Patch
    slip : slip angle [rad], between -pi/2 and pi/2, or slip ratio [-], > -1
    speed : travelling speed [m/s], > 0
    load : normal force on the patch [N], > 0
    temperature : [K], or None, as in `rubberfric.friction`
    kind : "angle" or "ratio" (static)
        A slip ratio is (rolling speed - travelling speed) / travelling speed, negative in braking.
    quadrature : Quadrature, static, or None, as in `rubberfric.friction`

    Returns
    -------
    Grip

    Raises
    ------
    ValueError : a slip, speed or load outside its range, an unknown kind, and as `rubberfric.friction`

    Examples
    --------
    At 45° almost the whole patch slides, and force / load is the friction at 10 m/s sin(45°), 0.315:

    >>> scene = rf.load_scene("data/sheared_tread_on_asphalt.toml")
    >>> patch = rf.Patch(length=0.12, width=0.15, stiffness=5e7, pressure="uniform")
    >>> side = rf.grip(scene, patch, np.radians([1.0, 5.0, 45.0]), speed=10.0, load=3000.0)
    >>> side.coefficient.round(3), side.moment.round(1)  # moments in N m
    (Array([0.31 , 0.395, 0.314], dtype=float64), Array([18.2,  4.7,  0.2], dtype=float64))
    """
    if kind not in _RANGES:
        raise ValueError(f"kind = {shown(kind)}: must be 'angle' or 'ratio'")
    check_kind("patch", patch, Patch)
    dtype = result_dtype(scene, patch, slip, speed, load, temperature)
    slip, speed, load = _conditions(dtype, slip, speed, load, kind)
    points = friction_points(patch, slip, speed, load, temperature, kind)
    mean = load / patch.area
    warn_of_conditions(velocity=speed, pressure=mean, temperature=temperature)
    if quadrature is None:
        quadrature = default_quadrature(scene, mean, separation=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnitWarning)  # of low pressures next to the edges
        mu = friction(scene, *points, quadrature=quadrature)
    return grip_of_friction(patch, slip, load, mu, kind)


@quick_jit(static_argnames="kind")
def friction_points(
    patch: Patch,
    slip: jax.Array,
    speed: jax.Array,
    load: jax.Array,
    temperature: ArrayLike | None = None,
    kind: SlipKind = "angle",
) -> tuple[jax.Array, jax.Array, jax.Array | None]:
    """Return the velocities, pressures and temperatures at which `grip` needs the friction.

    A last axis counts the pressures along the patch. For its arguments see `grip`.
    """
    sliding_speed = speed * (jnp.sin(jnp.abs(slip)) if kind == "angle" else jnp.abs(slip))
    highest = load / patch.area * patch.shape.highest()
    at = None if temperature is None else as_array(temperature, slip.dtype)[..., None]
    return sliding_speed[..., None], highest[..., None] * _pressures(patch, slip.dtype), at


@quick_jit(static_argnames="kind")
def grip_of_friction(
    patch: Patch, slip: jax.Array, load: jax.Array, mu: jax.Array, kind: SlipKind = "angle"
) -> Grip:
    """Return the `Grip` of a patch for the friction coefficients at the `friction_points`."""
    sigma = jnp.tan(slip) if kind == "angle" else slip / (1 + slip)
    shape = jnp.broadcast_shapes(slip.shape, load.shape, mu.shape[:-1])
    sigma, load = jnp.broadcast_to(sigma, shape), jnp.broadcast_to(load, shape)
    mapped_brush = functools.partial(brush, patch)
    for _ in shape:
        mapped_brush = jax.vmap(mapped_brush)
    force, moment, sliding = mapped_brush(
        sigma, load / patch.area, jnp.broadcast_to(mu, (*shape, mu.shape[-1]))
    )
    return Grip(force, force / load, moment if kind == "angle" else None, sliding)


class PeakGrip(NamedTuple):
    """Results of `peak_grip`, each of the broadcast shape.

    Attributes
    ----------
    slip : slip at the largest force [rad] or [-]
    force, coefficient : largest force [N], and the same divided by the load [-]
    inside : True if the peak is inside the range of slips, False if the force is largest at an end
    """

    slip: jax.Array
    force: jax.Array
    coefficient: jax.Array
    inside: jax.Array


def peak_grip(
    scene: Scene,
    patch: Patch,
    speed: ArrayLike,
    load: ArrayLike,
    temperature: ArrayLike | None = None,
    kind: SlipKind = "angle",
    *,
    between: tuple[float, float] = (1e-3, 0.5),
    quadrature: Quadrature | None = None,
) -> PeakGrip:
    """Return the largest force over the slip, and the slip at which it occurs.

    Slip and force have derivatives by all numbers of scene, patch and conditions.

    Parameters
    ----------
    scene, patch, speed, load, temperature, kind, quadrature : as in `grip`
    between : smallest and largest slip, both positive, or both negative for a braked wheel
        Of several peaks, the highest is returned. Peaks closer than a fifth in slip may be missed.

    Returns
    -------
    PeakGrip. At an end of the range the slip has derivatives 0.

    Raises
    ------
    ValueError : an invalid range, and as `grip`

    Examples
    --------
    >>> scene = rf.load_scene("data/sheared_tread_on_asphalt.toml")
    >>> patch = rf.Patch(length=0.12, width=0.15, stiffness=5e7)
    >>> peak = rf.applications.peak_grip(scene, patch, speed=10.0, load=3000.0)
    >>> round(float(np.degrees(peak.slip)), 1), round(float(peak.coefficient), 2), bool(peak.inside)
    (3.2, 0.45, True)
    """
    low, high = (float(end) for end in between)
    if not (low < high and low * high > 0):
        raise ValueError(f"between = {shown(between)}: must be two slips of one sign, low < high")
    sign = float(np.sign(low))
    ends = np.log(np.sort(np.abs([low, high])))
    dtype = result_dtype(scene, patch, speed, load, temperature)
    at = jnp.linspace(ends[0], ends[1], _SLIPS, dtype=dtype)
    speed, load = (as_array(a, dtype)[..., None] for a in (speed, load))
    temperature = None if temperature is None else as_array(temperature, dtype)[..., None]

    def force(log_slip):
        slip = sign * jnp.exp(log_slip)
        return sign * grip(scene, patch, slip, speed, load, temperature, kind, quadrature=quadrature).force

    def slope(log_slip):
        return jax.jvp(force, (log_slip,), (jnp.ones_like(log_slip),))[1]

    forces = jax.lax.stop_gradient(force(at))
    k = jnp.argmax(forces, -1)[..., None]
    log_slip, inside = root(slope, at[jnp.maximum(k - 1, 0)], at[jnp.minimum(k + 1, _SLIPS - 1)])
    # Without a change of sign of the slope, the largest force is at an end of the range.
    log_slip = jnp.where(inside, log_slip, jnp.where(k == 0, ends[0], ends[1]).astype(log_slip.dtype))
    slip = sign * jnp.exp(log_slip[..., 0])
    largest = sign * force(log_slip)[..., 0]
    return PeakGrip(slip, largest, largest / load[..., 0], inside[..., 0])


def slip_stiffness(patch: Patch) -> jax.Array:
    r"""Return the slip stiffness dF/d(slip) at zero slip, k L^2 w / 2 [N], per rad or per slip ratio.

    All elements in contact stick at zero slip, so that friction does not matter. If places without pressure
    separate contacts of lengths L_i, L^2 is the sum of L_i^2.

    Examples
    --------
    >>> patch = rf.Patch(length=0.12, width=0.15, stiffness=5e7)
    >>> round(float(rf.applications.slip_stiffness(patch)))  # in N per rad
    54000
    """
    parts = _parts(patch, jnp.result_type(patch.stiffness))
    squares = _power(parts, parts.high, 2)
    return 0.5 * patch.stiffness * patch.length**2 * patch.width * jnp.sum(squares)


def _conditions(dtype, slip, speed, load, kind):
    slip, speed, load = (as_array(a, dtype) for a in (slip, speed, load))
    check_values("slip", slip, _RANGES[kind])
    check_values("speed", speed, POSITIVE)
    check_values("load", load, POSITIVE)
    return slip, speed, load


def _pressures(patch, dtype):
    """Return the pressures at which friction is computed, divided by the highest one."""
    if patch.shape.is_constant:
        return jnp.ones(1, dtype)
    return jnp.asarray((0.5 * (1 + chebpts1(_PRESSURES))) ** 2, dtype)


def _friction_at(mu, relative):
    """Return friction at pressures `relative` to the highest one, from its values at `_pressures`."""
    if mu.shape[0] == 1:
        return mu[0]
    coefficients = typed(chebyshev_transform(mu.shape[0]), mu) @ mu
    return chebyshev_sum(coefficients, 2 * safe_root(jnp.maximum(relative, 0.0)) - 1)


class _Parts(NamedTuple):
    """Parts of a patch between two kinks of the pressure, each of shape (parts,)."""

    low: jax.Array  # s at the ends of the part
    high: jax.Array
    first: jax.Array  # index of the first part of the same contact
    origin: jax.Array  # s at which the contact begins
    loaded: jax.Array


def _parts(patch, dtype):
    kinks = jnp.asarray(patch.shape.kinks(), dtype)
    first, loaded = patch.shape.contacts()
    return _Parts(kinks[:-1], kinks[1:], first, kinks[first], loaded)


def _power(parts, end, exponent):
    """Return (s - origin)^exponent at `end` minus its value at the beginning of a part; 0 if not loaded."""
    change = (end - parts.origin) ** exponent - (parts.low - parts.origin) ** exponent
    return jnp.where(parts.loaded, change, 0.0)


def brush(
    patch: Patch, sigma: jax.Array, mean: jax.Array, mu: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Return the force [N], the moment [N m] and the sliding share of a patch.

    Parameters
    ----------
    patch : Patch
    sigma : slip of the elements [-], a scalar
    mean : mean pressure [Pa], a scalar
    mu : friction coefficients at `_pressures`, shape (pressures,)
    """
    shape, highest = patch.shape, patch.shape.highest()
    parts = _parts(patch, sigma.dtype)
    rise = patch.stiffness * jnp.abs(sigma) * patch.length

    def limit(s):
        relative = shape.relative(s)
        return mean * relative * _friction_at(mu, relative / highest)

    def excess(s):
        return rise * (s - parts.origin[:, None]) - limit(s)

    start = _first_sliding(excess, parts)
    t, weight = (typed(table, sigma) for table in _clustered(_NODES))
    length = (parts.high - start)[:, None]
    s = start[:, None] + length * t
    sliding = jnp.sign(sigma) * weight * length * limit(s)
    # With the sign of sigma in it, so that the slope at sigma = 0 is right.
    sticking = patch.stiffness * sigma * patch.length
    squares, cubes = _power(parts, start, 2), _power(parts, start, 3)
    force = 0.5 * sticking * jnp.sum(squares) + jnp.sum(sliding)
    arms = cubes / 3 + 0.5 * (parts.origin - 0.5) * squares
    moment = sticking * jnp.sum(arms) + jnp.sum(sliding * (s - 0.5))
    in_contact = jnp.sum(jnp.where(parts.loaded, parts.high - parts.low, 0.0))
    return patch.area * force, patch.area * patch.length * moment, jnp.sum(length) / in_contact


def _clustered(count):
    """Return nodes and weights on (0, 1), for functions of the root of the distance from both ends."""
    x, w = gauss(count)
    return x * x * (3 - 2 * x), 6 * x * (1 - x) * w


def _first_sliding(excess, parts):
    """Return the s in each part from which elements slide, or its end if they stick, with derivatives.

    `excess` maps s of shape (parts, n) to the stress of sticking elements minus the friction stress.
    """
    low, high = parts.low, parts.high
    count = max(_LEAST_INTERVALS, -(-_INTERVALS // low.shape[0]))
    u = jnp.linspace(0.0, 1.0, count + 1, dtype=low.dtype)
    grid = low[:, None] * (1 - u) + high[:, None] * u
    # Where a contact begins, stress and friction may both be 0.
    edge = jnp.maximum(_EDGE, _EDGE_ROUNDING * float(jnp.finfo(low.dtype).eps) * low)
    grid = grid.at[:, 0].add(jnp.where(low == parts.origin, edge, 0.0))
    over = parts.loaded[:, None] & (jax.lax.stop_gradient(excess(grid[:, 1:])) > 0)
    k = jnp.argmax(over, 1)[:, None]
    ends = (jnp.take_along_axis(grid, i, 1) for i in (k, k + 1))
    start, has_root = (x[:, 0] for x in root(excess, *ends))
    # Elements slide from the beginning if the stress exceeds the friction within the first interval.
    crosses = jnp.any(over, 1)
    start = jnp.where(crosses, jnp.where(has_root, start, low), high)
    # All parts slide that follow in the same contact.
    index = jnp.arange(low.shape[0])
    last = jax.lax.cummax(jnp.where(crosses, index, -1))
    slid = (index > 0) & (jnp.roll(last, 1) >= parts.first)
    return jnp.where(slid, low, start)
