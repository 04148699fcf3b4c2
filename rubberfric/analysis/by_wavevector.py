r"""What each length scale does: contact, friction and roughness over the wavevector.

.. math:: P(q) = \mathrm{erf}\frac{1}{2\sqrt{G(q)}},\qquad
          \frac{d\mu}{d\ln q} = \frac{q^2}{\sigma_0}\, S P \sum_j C_j \int d\varphi\,
          q\cos\varphi\,\mathrm{Im}K_j(q v \cos\varphi)

[Scaraggi & Persson, arXiv:1506.06955, eqs. (10), (A17)]

The wavevectors asked for are borders of the radial panels, so that G(q) and mu(q) are sums over
whole panels, and the density is formed at q itself: nothing is interpolated from a grid over q.
"""

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.blocks import over_points
from rubberfric.base.checks import POSITIVE, as_leaf, check_values
from rubberfric.base.quadrature import Quadrature
from rubberfric.roughness.moments import cumulative_moment
from rubberfric.roughness.spectra import BrokenPowerLaw, log_ratio, log_shape
from rubberfric.scene.pairs import Pair, PairTemperatures, pairs_of
from rubberfric.scene.scene import Scene, check_without, result_dtype, rough_surfaces
from rubberfric.theory.area.partial_contact import (
    contact_argument,
    contact_fraction,
    energy_factor,
    friction_weight,
)
from rubberfric.theory.arguments import settled, warn_of_last_iterates
from rubberfric.theory.contact import Contact
from rubberfric.theory.contributions import total
from rubberfric.theory.integrals import Prepared, prepare, solved
from rubberfric.theory.quantities import Needs
from rubberfric.theory.stiffness.excitation import excitation
from rubberfric.theory.stiffness.series import factors_at, static_stiffness
from rubberfric.theory.temperatures.heat_balance import temperature_at

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
    strain: jax.Array | None = None  # of a solid that softens, of two with the factor of the one strained [-]


def profile(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    q: ArrayLike | None = None,
    quadrature: Quadrature | None = None,
) -> Profile:
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
    quadrature : Quadrature, static, or None: that which fits the scene

    Returns
    -------
    Profile. Below the roughness P = S = 1 and G = mu = 0, beyond it all is as at its end; the density
    is 0 on either side. At the last wavevector P and mu are `contact_area` and the viscoelastic
    part of `friction`.

    Raises
    ------
    ValueError : as `contact_area`; concrete q <= 0; q None although nothing in the scene is rough.

    Warns
    -----
    RuntimeWarning : as `solve`, where the temperatures of a heated scene are not a solution.

    Notes
    -----
    Good to the quadrature's error at every q. With a TabulatedModulus, whose knots are kinks over q,
    P(q) and mu(q) may be 1e-4 off just where the roughness begins, and 1e-7 above.
    Friction without contact shear. Where nothing is rough or nothing dissipates, friction and its
    density are zero, not computed. With `scene.area_correction` G has S inside. G keeps its digits where
    P = 1 - 1e-300. The magnification of a scene without roughness is counted from q[0].
    """
    scene, conditions, quadrature = settled(scene, velocity, pressure, temperature, quadrature)
    check_without(scene, ("adhesion", "correlation"), "profile")
    q = checked_wavevectors(q, 1, conditions, scene)
    found, converged = _profile(scene, *conditions, q, quadrature=quadrature)
    warn_of_last_iterates(scene, converged, conditions)
    return found


def checked_wavevectors(
    q: ArrayLike | None, ndim: int, conditions: Sequence[jax.Array | None], scene: Scene
) -> jax.Array | None:
    """The wavevectors of a call in the dtype of its conditions, or ValueError; None if it names none."""
    if q is not None:
        q = as_leaf("q", q, ndim)
        check_values("q", q, POSITIVE)
        return jnp.asarray(q, result_dtype(conditions))
    if ndim and not rough_surfaces(scene):
        raise ValueError("q is None, but nothing in the scene is rough: must be given")
    return None


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _profile(scene, velocity, pressure, temperature, q, *, quadrature):
    pairs = pairs_of(scene)
    if not pairs:
        return _without_roughness(q, jnp.broadcast_shapes(velocity.shape, pressure.shape)), None
    laws = [pair.law for pair in pairs]
    first = functools.reduce(jnp.minimum, [law.q[0] for law in laws])
    if q is None:
        q = default_wavevectors(laws)
    prepared = prepare(scene, ("area", "friction"), quadrature, pairs=pairs, borders=q)
    densities = []
    if prepared.needs.dissipation:
        scale = prepared.roughness.scale
        densities = [density_of(pair, scale, "dissipation", q) for pair in pairs]
    block = functools.partial(_over_wavevectors, prepared, densities, q)
    results = over_points(block, (velocity, pressure, temperature), BLOCK)
    converged = results.pop("converged", None)
    slope2, height2 = (
        sum(cumulative_moment(law, order, log_ratio(jnp.maximum(q, law.q[0]), law.q[0])) for law in laws)
        for order in (2, 0)
    )
    found = Profile(
        q=q,
        magnification=q / first,
        rms_slope=_root(slope2),
        rms_height=_root(height2),
        strain=softened[0].softening.factor * _root(slope2) if (softened := pairs[0].softenings) else None,
        **results,
    )
    return found, converged


def default_wavevectors(laws: Sequence[BrokenPowerLaw], count: int = COUNT) -> jax.Array:
    """Equally spaced in ln q, over all the roughness."""
    first = functools.reduce(jnp.minimum, [law.q[0] for law in laws])
    last = functools.reduce(jnp.maximum, [law.q[-1] for law in laws])
    within = first * jnp.exp(log_ratio(last, first) * (np.arange(1, count - 1) / (count - 1)))
    # The ends are the ends, whatever exp and ln round.
    return jnp.concatenate([first[None], jnp.clip(within, first, last), last[None]])


def fluctuation_at_borders(prepared: Prepared, contact: Contact, count: int) -> jax.Array:
    """Plain G at the last `count` borders that were asked for, (points, borders)."""
    return jnp.maximum(sum_below_borders(prepared, contact.G_panels, count), 0.0)


def sum_below_borders(prepared: Prepared, panels: jax.Array, count: int) -> jax.Array:
    """Sums over the panels below each of these borders, (points, borders), of (panels, points)."""
    before, below = prepared.roughness.mesh.panels_below, jnp.cumsum(panels, 0)
    assert before is not None  # borders were asked for
    return jnp.concatenate([jnp.zeros_like(panels[:1]), below])[before[-count:]].T


def contact_at_borders(prepared: Prepared, contact: Contact, count: int) -> tuple[jax.Array, jax.Array]:
    """x and G at these borders, with S in G where the scene asks for it, both (points, borders)."""
    plain = fluctuation_at_borders(prepared, contact, count)
    x_plain = contact_argument(plain)
    x = contact.corrected(x_plain)
    # x stops at 27, where S = 1: G itself goes on.
    return x, plain * (x_plain / x) ** 2


def _over_wavevectors(prepared, densities, q, points):
    """Fields of Profile at points, (points, wavevectors)."""
    contact, temperatures = solved(prepared, *points)
    x, G = contact_at_borders(prepared, contact, q.shape[0])
    P = contact_fraction(x)
    results = {"area": P, "fluctuation": G, "energy_factor": energy_factor(P, contact.gamma)}
    background = points[2] if len(points) > 2 else None
    inside = [PairTemperatures(background, background)] * len(densities)
    if temperatures is not None:
        found = temperature_at(prepared.roughness, contact, temperatures, points, q)
        inside = [
            PairTemperatures(*(background if solid is None else found[:, solid] for solid in pair))
            for pair in temperatures.thermal.solids
        ]
        results |= {"temperature": jnp.mean(found, 1), "converged": temperatures.converged}
    if not prepared.needs.dissipation:
        return results | dict.fromkeys(("friction_density", "friction"), jnp.zeros_like(G))
    terms = total(jnp.sum(values, -1) for values in contact.friction_terms().values())
    density = sum(one(points[0], T) for one, T in zip(densities, inside, strict=True))
    weight = (jnp.pi * contact.modulus_over_pressure)[:, None] * friction_weight(x, contact.gamma)
    return results | {
        "friction_density": weight * density,
        "friction": sum_below_borders(prepared, terms, q.shape[0]),
    }


def density_of(
    pair: Pair, scale: jax.Array, kind: str, q: jax.Array
) -> Callable[[jax.Array, PairTemperatures], jax.Array | float]:
    """Function that gives q^4 C <cos phi Im K'> ("dissipation") or q^4 C <|K'|^2> ("power") of a pair.

    K' is the series stiffness in its unit, the scale, all factors included. The function takes the velocity
    and the temperatures of both solids: None, (points,) or (points, wavevectors), and returns an
    array (points, wavevectors); of a dissipation that is zero 0.0.
    """
    law = pair.law
    inside = (q >= law.q[0]) & (q <= law.q[-1])
    # Outside, at a wavevector of the spectrum: continued far, it may overflow.
    at = jnp.where(inside, q, law.q[0])
    roughness = jnp.where(inside, law.height2 * jnp.exp(log_shape(law, at) + 4 * jnp.log(at)), 0.0)
    if pair.static or (not pair.relaxes and kind == "dissipation"):
        power = (roughness * static_stiffness(pair, scale, q) ** 2)[None] if kind == "power" else 0.0
        return lambda *_: power
    excited = excitation(pair, scale, q[None], Needs(**{kind: True}))
    weights = factors_at(pair, q).of(kind, roughness)

    def density(velocity, temperatures):
        at = jax.tree.map(lambda T: T[None] if T.ndim > 1 else T, temperatures)
        means = excited.means(q[None], velocity, at)
        return sum(w * mean[0] for w, mean in zip(weights, means[kind], strict=True))

    return density


def _root(square):
    """Square root with derivative 0 at 0, where that of the root is infinite."""
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)


def _without_roughness(q, shape):
    """The profile of two smooth solids: full contact."""
    one, none = jnp.ones((*shape, q.shape[0]), q.dtype), jnp.zeros_like(q)
    nothing = jnp.zeros_like(one)
    return Profile(q, q / q[0], one, nothing, one, nothing, nothing, none, none)
