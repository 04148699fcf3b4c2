r"""What each length scale does: contact, friction and roughness over the wavevector.

.. math:: P(q) = \mathrm{erf}\frac{1}{2\sqrt{G(q)}},\qquad
          \frac{d\mu}{d\ln q} = \frac{q^2}{\sigma_0}\, S P \sum_j C_j \int d\varphi\,
          q\cos\varphi\,\mathrm{Im}K_j(q v \cos\varphi)

The wavevectors asked for are borders of the radial panels, so that G(q) and mu(q) are sums over
whole panels, and the density is formed at q itself: nothing is interpolated from a grid over q.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric._pytree import POSITIVE, as_leaf, check_values
from rubberfric.angular import angular_means
from rubberfric.contact import contact_argument, contact_fraction, energy_factor, friction_weight
from rubberfric.model import checked
from rubberfric.moments import cumulative_moment
from rubberfric.points import over_points
from rubberfric.quadrature import Quadrature
from rubberfric.radial import channel_parts, corrected, node_argument, prepare
from rubberfric.scene import cast, rough_pairs
from rubberfric.spectra import _log_shape, broken_power_law, log_ratio
from rubberfric.stiffness import Static, layer_factor, series_stiffness

_DEFAULT = Quadrature()

# Wavevectors of a profile that names none, and points evaluated at once: a profile keeps
# the nodes of some hundred panels for each.
COUNT, BLOCK = 200, 32


class Profile(NamedTuple):
    """Results of `profile`; what depends on conditions has shape [conditions..., q], the rest [q]."""

    q: jax.Array  # wavevectors [1/m]
    magnification: jax.Array  # q over the first wavevector of the roughness [-]
    area: jax.Array  # P(q), relative area in contact when nothing beyond q is seen [-]
    fluctuation: jax.Array  # G(q), of which P = erf(1 / (2 sqrt G)) [-]
    energy_factor: jax.Array  # S(q) [-]
    friction_density: jax.Array  # d mu / d ln q, viscoelastic [-]
    friction: jax.Array  # mu of the roughness up to q, viscoelastic [-]
    rms_slope: jax.Array  # of the roughness of both solids up to q [-]
    rms_height: jax.Array  # the same [m]
    temperature: jax.Array | None = None  # where the scene heats up [K]
    strain: jax.Array | None = None  # where the scene softens [-]


def profile(scene, velocity, pressure, temperature=None, *, q=None, quadrature=_DEFAULT):
    r"""Contact area, friction and roughness as functions of the largest wavevector seen.

    .. math:: P(q) = \mathrm{erf}\frac{1}{2\sqrt{G(q)}},\qquad
              \mu(q) = \int_{q_0}^{q} \frac{d\mu}{d\ln q'}\, d\ln q'

    [Scaraggi & Persson, eqs. (10), (A11), (A17)]

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    q : wavevectors [1/m], > 0, shape (n,), in any order; or None
        None: 200 from the first to the last wavevector of the roughness, equally spaced in ln q.
    quadrature : Quadrature, static

    Returns
    -------
    Profile. Below the roughness P = S = 1 and G = mu = 0, beyond it all is as at its end; the density
    is 0 on either side. At the last wavevector P and mu are `contact_area` and the viscoelastic
    part of `friction`.

    Raises
    ------
    ValueError : as `contact_area`; concrete q <= 0; q None although nothing in the scene is rough.

    Notes
    -----
    Good to the quadrature's error at every q. With a TabulatedModulus, whose knots are kinks over q,
    P(q) and mu(q) may be 1e-4 off just where the roughness begins, and 1e-7 above.
    Friction without contact shear. Where nothing is rough or nothing dissipates, friction and its
    density are zero, not computed. With
    `scene.area_correction` G has S inside. G keeps its digits where P = 1 - 1e-300. The
    magnification of a scene without roughness is counted from q[0].
    """
    scene, conditions, q = checked_with_q(scene, velocity, pressure, temperature, quadrature, q)
    if q is None and not rough_pairs(scene):
        raise ValueError("q is None, but nothing in the scene is rough: must be given")
    return _profile(scene, *conditions, q, quadrature=quadrature)


def checked_with_q(scene, velocity, pressure, temperature, quadrature, q, ndim=1):
    """`checked`, and the wavevectors of a call in the same dtype."""
    scene, conditions = checked(scene, velocity, pressure, temperature, quadrature)
    if q is None:
        return scene, conditions, None
    q = as_leaf("q", q, ndim)
    check_values("q", q, POSITIVE)
    return scene, conditions, cast(q, conditions[1].dtype)


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _profile(scene, velocity, pressure, temperature, q, *, quadrature):
    laws = [broken_power_law(rough.spectrum) for rough, _ in rough_pairs(scene)]
    if not laws:
        return _without_roughness(q, jnp.broadcast_shapes(velocity.shape, pressure.shape))
    first = functools.reduce(jnp.minimum, [law.q[0] for law in laws])
    if q is None:
        q = default_wavevectors(laws)
    prepared = prepare(scene, ("area", "friction"), quadrature, marks=q)
    at_q = densities(scene, prepared, laws, q) if "dissipation" in prepared.wanted else None
    block = functools.partial(_over_wavevectors, prepared, at_q, q)
    results = over_points(block, (velocity, pressure, temperature), BLOCK)
    slope2, height2 = (
        sum(cumulative_moment(law, order, log_ratio(jnp.maximum(q, law.q[0]), law.q[0])) for law in laws)
        for order in (2, 0)
    )
    return Profile(
        q=q, magnification=q / first, rms_slope=_root(slope2), rms_height=_root(height2), **results
    )


def default_wavevectors(laws, count=COUNT):
    """Equally spaced in ln q, over all the roughness."""
    first = functools.reduce(jnp.minimum, [law.q[0] for law in laws])
    last = functools.reduce(jnp.maximum, [law.q[-1] for law in laws])
    within = first * jnp.exp(log_ratio(last, first) * (np.arange(1, count - 1) / (count - 1)))
    # The ends are the ends, whatever exp and ln round.
    return jnp.concatenate([first[None], jnp.clip(within, first, last), last[None]])


def fluctuation_at_marks(prepared, found, stiffness):
    """Plain G at the marks, (points, marks), from `channel_parts` at points."""
    g = jnp.pi / 4 * sum_before_marks(prepared, sum(part.panels for part in found))
    return stiffness[:, None] ** 2 * jnp.maximum(g, 0.0)


def sum_before_marks(prepared, panels):
    """Sums over the panels before each mark, (points, marks), of values (panels, points)."""
    before = jnp.concatenate([jnp.zeros_like(panels[:1]), jnp.cumsum(panels, 0)])
    return before[prepared.mesh.marks].T


def contact_at_marks(prepared, found, stiffness):
    """x and G at the marks, with S in G where the scene asks for it, both (points, marks)."""
    plain = fluctuation_at_marks(prepared, found, stiffness)
    x_plain = contact_argument(plain, jnp.ones_like(plain))
    x = corrected(prepared, x_plain)
    # x stops at 27, where S = 1: G itself goes on.
    return x, plain * (x_plain / x) ** 2


def _over_wavevectors(prepared, at_q, q, points):
    """Fields of Profile at points, (points, marks)."""
    velocity, pressure, temperature = (*points, None)[:3]
    found = channel_parts(prepared, velocity, temperature)
    stiffness = prepared.scale / pressure
    x, G = contact_at_marks(prepared, found, stiffness)
    P = contact_fraction(x)
    density = friction = jnp.zeros_like(G)
    if at_q is not None:
        unit = jnp.pi * stiffness
        weight = friction_weight(corrected(prepared, node_argument(found, stiffness)), prepared.gamma)
        terms = sum(part.dissipation for part in found if part.dissipation is not None)
        friction = unit[:, None] * sum_before_marks(prepared, jnp.sum(weight * terms, -1))
        density = unit[:, None] * friction_weight(x, prepared.gamma)
        density = density * sum(
            density_at(one, "dissipation", velocity, temperature, q, prepared.quadrature) for one in at_q
        )
    return {
        "area": P,
        "fluctuation": G,
        "energy_factor": energy_factor(P, prepared.gamma),
        "friction_density": density,
        "friction": friction,
    }


class AtWavevectors(NamedTuple):
    """What a channel adds to densities over ln q at given wavevectors."""

    stiffness: object  # Static, Relaxing or Tabulated, at q itself
    shift: object
    roughness: jax.Array  # q^4 C factor, 0 outside the spectrum
    factor: jax.Array | float  # of the layer


def densities(scene, prepared, laws, q):
    """`AtWavevectors` of every channel."""
    found = []
    for (rough, other), law in zip(rough_pairs(scene), laws, strict=True):
        F = series_stiffness(rough, other, prepared.scale, (q, q))
        inside = (q >= law.q[0]) & (q <= law.q[-1])
        # Outside, at a wavevector of the spectrum: continued far, it may overflow.
        at = jnp.where(inside, q, law.q[0])
        roughness = law.height2 * jnp.exp(_log_shape(law, at) + 4 * jnp.log(at))
        factor = None if isinstance(F, Static) else layer_factor(rough, other, q)
        factor = 1.0 if factor is None else factor
        shift = getattr(other.material, "shift", None)
        found.append(AtWavevectors(F, shift, jnp.where(inside, roughness * factor, 0.0), factor))
    return found


def density_at(at, wanted, velocity, temperature, q, quadrature):
    """q^4 C factor <cos phi Im F> ("dissipation") or q^4 C factor^2 <|F|^2> ("power"), (points, wavevectors).

    0.0 if F is Static and the dissipation is wanted.
    """
    if isinstance(at.stiffness, Static):
        return (at.roughness * at.stiffness.value**2)[None] if wanted == "power" else 0.0
    if temperature is not None and at.shift is not None:
        velocity = velocity * jnp.exp(at.shift.log_factor(temperature))
    means = angular_means(at.stiffness, velocity[:, None] * q, frozenset({wanted}), quadrature)
    mean = getattr(means, wanted)
    return at.roughness * (mean * at.factor if wanted == "power" else mean)


def _root(square):
    """Square root with derivative 0 at 0, where that of the root is infinite."""
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)


def _without_roughness(q, shape):
    """The profile of two smooth solids: full contact."""
    one, none = jnp.ones((*shape, q.shape[0]), q.dtype), jnp.zeros_like(q)
    nothing = jnp.zeros_like(one)
    return Profile(q, q / q[0], one, nothing, one, nothing, nothing, none, none)
