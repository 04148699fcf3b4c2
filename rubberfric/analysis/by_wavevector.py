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

from rubberfric.base.blocks import over_points
from rubberfric.base.checks import POSITIVE, as_leaf, check_values
from rubberfric.base.quadrature import Quadrature
from rubberfric.roughness.moments import cumulative_moment
from rubberfric.roughness.spectra import log_ratio, log_shape
from rubberfric.scene.scene import cast, rough_pairs
from rubberfric.scene.softening import softened_of
from rubberfric.theory.integrals import prepare, solved
from rubberfric.theory.model import checked
from rubberfric.theory.partial_contact import (
    contact_argument,
    contact_fraction,
    energy_factor,
    friction_weight,
)
from rubberfric.theory.stiffness.angular_means import angular_means, with_means
from rubberfric.theory.stiffness.factors import mix_of, modes_of, node_factors
from rubberfric.theory.stiffness.series import Sampled, Static, series_stiffness
from rubberfric.theory.stiffness.softened_means import sampled_means
from rubberfric.theory.stress_fluctuation import corrected, friction_terms
from rubberfric.theory.temperatures import temperature_at

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
    temperature: jax.Array | None = None  # of a heated scene, of two deformable solids the mean [K]
    strain: jax.Array | None = None  # of a scene that softens [-]


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
    laws = [rough.spectrum.power_law() for rough, _ in rough_pairs(scene)]
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
        q=q,
        magnification=q / first,
        rms_slope=_root(slope2),
        rms_height=_root(height2),
        strain=None if scene.softening is None else scene.softening.factor * _root(slope2),
        **results,
    )


def default_wavevectors(laws, count=COUNT):
    """Equally spaced in ln q, over all the roughness."""
    first = functools.reduce(jnp.minimum, [law.q[0] for law in laws])
    last = functools.reduce(jnp.maximum, [law.q[-1] for law in laws])
    within = first * jnp.exp(log_ratio(last, first) * (np.arange(1, count - 1) / (count - 1)))
    # The ends are the ends, whatever exp and ln round.
    return jnp.concatenate([first[None], jnp.clip(within, first, last), last[None]])


def fluctuation_at_marks(prepared, state, count):
    """Plain G at the last `count` marks, (points, marks)."""
    g = sum_before_marks(prepared, state.panels, count)
    return state.stiffness[:, None] ** 2 * jnp.maximum(g, 0.0)


def sum_before_marks(prepared, panels, count):
    """Sums over the panels before each of the last `count` marks, (points, marks), of (panels, points)."""
    before = jnp.concatenate([jnp.zeros_like(panels[:1]), jnp.cumsum(panels, 0)])
    return before[prepared.mesh.marks[-count:]].T


def contact_at_marks(prepared, state, count):
    """x and G at the last marks, with S in G where the scene asks for it, both (points, marks)."""
    plain = fluctuation_at_marks(prepared, state, count)
    x_plain = contact_argument(plain, jnp.ones_like(plain))
    x = corrected(prepared, x_plain)
    # x stops at 27, where S = 1: G itself goes on.
    return x, plain * (x_plain / x) ** 2


def _over_wavevectors(prepared, at_q, q, points):
    """Fields of Profile at points, (points, marks)."""
    velocity, pressure, temperature = (*points, None)[:3]
    state, temperatures = solved(prepared, velocity, pressure, temperature)
    x, G = contact_at_marks(prepared, state, q.shape[0])
    P = contact_fraction(x)
    density = friction = jnp.zeros_like(G)
    warm = None
    if temperatures is not None:
        warm = temperature_at(prepared, state, temperatures, velocity, pressure, temperature, q)
    if at_q is not None:
        terms = sum(jnp.sum(values, -1) for values in friction_terms(prepared, state).values())
        friction = sum_before_marks(prepared, terms, q.shape[0])
        temperatures_of = [temperature] * len(at_q) if warm is None else _of_channels(prepared, warm)
        density = (jnp.pi * state.stiffness)[:, None] * friction_weight(x, prepared.gamma)
        density = density * sum(
            density_at(one, "dissipation", velocity, T, q, prepared.quadrature)
            for one, T in zip(at_q, temperatures_of, strict=True)
        )
    results = {
        "area": P,
        "fluctuation": G,
        "energy_factor": energy_factor(P, prepared.gamma),
        "friction_density": density,
        "friction": friction,
    }
    return results if warm is None else results | {"temperature": jnp.mean(warm, 1)}


def _of_channels(prepared, warm):
    """For every channel the temperatures of the solid it excites, (points, wavevectors)."""
    return [None if solid is None else warm[:, solid] for solid in prepared.thermal.heated]


class AtWavevectors(NamedTuple):
    """What a channel adds to densities over ln q at given wavevectors."""

    stiffness: object  # Static, Relaxing, Tabulated or Sampled, at q itself
    shift: object
    modes: tuple  # `factors.Modes`
    mix: tuple | None  # as `channels.Channel`
    factors: object  # `factors.Factors`, None if F is Static
    roughness: jax.Array  # q^4 C, 0 outside the spectrum


def densities(scene, prepared, laws, q):
    """`AtWavevectors` of every channel."""
    found, softened = [], softened_of(scene)
    for (rough, other), law in zip(rough_pairs(scene), laws, strict=True):
        F = series_stiffness(rough, other, prepared.scale, (q, q), softened)
        inside = (q >= law.q[0]) & (q <= law.q[-1])
        # Outside, at a wavevector of the spectrum: continued far, it may overflow.
        at = jnp.where(inside, q, law.q[0])
        roughness = law.height2 * jnp.exp(log_shape(law, at) + 4 * jnp.log(at))
        modes = modes_of(rough, other, softened)
        mix = mix_of(rough, modes, q)
        found.append(
            AtWavevectors(
                stiffness=with_means(F, {"power", "dissipation"}, modes.split, mix),
                shift=getattr(other.material, "shift", None),
                modes=modes,
                mix=mix,
                factors=None if isinstance(F, Static) else node_factors(rough, other, softened, q),
                roughness=jnp.where(inside, roughness, 0.0),
            )
        )
    return found


def density_at(at, wanted, velocity, temperature, q, quadrature):
    """q^4 C <cos phi Im K'> ("dissipation") or q^4 C <|K'|^2> ("power"), (points, wavevectors).

    K' is the series stiffness in its unit, all factors included. 0.0 if F is Static and the dissipation
    is wanted. The temperature is None, (points,) or (points, wavevectors).
    """
    F = at.stiffness
    if isinstance(F, Static):
        return (at.roughness * F.value**2)[None] if wanted == "power" else 0.0
    velocity = velocity[:, None]
    if temperature is not None and at.shift is not None:
        temperature = temperature[:, None] if temperature.ndim == 1 else temperature
        velocity = velocity * jnp.exp(at.shift.log_factor(temperature))
    qv = velocity * q
    if isinstance(F, Sampled):
        F = F._replace(storage=F.storage[None], loss=F.loss[None], spring=F.spring[None])
        means = jax.tree.map(
            lambda x: x[0], sampled_means(F, qv[None], frozenset({wanted}))
        )
    else:
        means = angular_means(F, qv, frozenset({wanted}), at.modes.split, at.mix)
    means, factors = getattr(means, wanted), getattr(at.factors, wanted)
    terms = (mean if f is None else f * mean for f, mean in zip(factors, means, strict=True))
    return at.roughness * sum(terms)


def _root(square):
    """Square root with derivative 0 at 0, where that of the root is infinite."""
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)


def _without_roughness(q, shape):
    """The profile of two smooth solids: full contact."""
    one, none = jnp.ones((*shape, q.shape[0]), q.dtype), jnp.zeros_like(q)
    nothing = jnp.zeros_like(one)
    return Profile(q, q / q[0], one, nothing, one, nothing, nothing, none, none)
