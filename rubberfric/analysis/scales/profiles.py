"""Profiles over the wavevector: contact, friction and roughness at each length scale.

The wavevectors are borders of radial panels, so that G(q) and mu(q) are sums over whole panels. The density
is evaluated at q itself, without interpolation over q.
"""

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.analysis.scales.law_profile import last_wavevector, over_wavevectors
from rubberfric.base.blocks import check_count, over_points
from rubberfric.base.checks import POSITIVE, ArrayLike, as_leaf, check_values
from rubberfric.base.quadrature import Quadrature
from rubberfric.roughness.moments import cumulative_moment, safe_root
from rubberfric.roughness.spectra import BrokenPowerLaw, log_ratio, log_shape
from rubberfric.scene.scene import Scene, check_without, result_dtype, rough_surfaces
from rubberfric.theory.area.partial_contact import (
    contact_argument,
    contact_fraction,
    energy_factor,
)
from rubberfric.theory.arguments import validate, warn_of_last_iterates
from rubberfric.theory.contact import Contact
from rubberfric.theory.contributions import density_of_K, total
from rubberfric.theory.integrals import Prepared, prepare, solved
from rubberfric.theory.stiffness.means import factors_at, stiffness_means
from rubberfric.theory.structure import RequiredMeans, RoughSurface, SurfaceTemperatures, rough_surfaces_of

# Default number of wavevectors of a profile.
_COUNT = 200
# Points of a profile evaluated at once. Each keeps the nodes of some hundred panels in memory.
_BLOCK = 32


class Profile(NamedTuple):
    """Results of `profile`.

    A field has the shape [q], or [conditions..., q] if the field depends on the conditions.
    """

    q: jax.Array  # wavevectors [1/m]
    magnification: jax.Array  # q / (first wavevector of the roughness) [-]
    area: jax.Array  # P(q), relative contact area at resolution q [-]
    fluctuation: jax.Array | None  # G(q), with P = erf(1 / (2 sqrt G)) [-]
    energy_factor: jax.Array | None  # S(q) [-]
    friction_density: jax.Array  # d mu / d ln q, viscoelastic [-]
    friction: jax.Array  # mu of the roughness up to q, viscoelastic [-]
    rms_slope: jax.Array  # of the roughness of both solids up to q [-]
    rms_height: jax.Array  # of the roughness of both solids up to q [m]
    temperature: jax.Array | None = None  # of a heated scene, mean of both deformable solids [K]
    strain: jax.Array | None = None  # of a softening solid, with its strain factor [-]
    share: jax.Array | None = None  # W(q) of "boundary_elements" where abs(E) is its mean E_r [-]


def profile(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    q: ArrayLike | None = None,
    quadrature: Quadrature | None = None,
) -> Profile:
    r"""Compute contact area, friction and roughness as functions of the largest wavevector.

    .. math:: P(q) = \mathrm{erf}\frac{1}{2\sqrt{G(q)}},\qquad
              \frac{d\mu}{d\ln q} = \frac{q^2}{\sigma_0}\, S P \sum_j C_j \int d\varphi\,
              q\cos\varphi\,\mathrm{Im}K_j(q v \cos\varphi)

    [Scaraggi & Persson, arXiv:1506.06955; the integrands of `rubberfric.friction`]

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    q : wavevectors [1/m], > 0, shape (n,), in any order; or None
        None: 200 from the first to the last wavevector of the roughness, equally spaced in ln q.
    quadrature : Quadrature, static, or None: chosen for the scene

    Returns
    -------
    Profile. Below the range of roughness P = S = 1 and G = mu = 0. Beyond the range these fields are
    constant. The density is 0 outside the range. At the last wavevector P is `contact_area` and mu is the
    viscoelastic part of `friction`.

    Raises
    ------
    ValueError : as `contact_area`; concrete q <= 0; q None in a scene without roughness.

    Warns
    -----
    RuntimeWarning : as `solve`, if the temperatures of a heated scene did not converge.

    Notes
    -----
    The quadrature determines the error at every q. With a TabulatedModulus, whose knots are kinks over q,
    errors of P(q) and mu(q) may reach 1e-4 at the first wavevector and 1e-7 above. Friction excludes contact
    shear. Without roughness or dissipation, friction and its density are zero, not computed. With
    `scene.area_correction` G contains S. G keeps its accuracy where P = 1 - 1e-300. Without roughness the
    magnification is q / q[0].

    With `contact_model="boundary_elements"`, the default wavevectors end at 6 q1, because displacements
    beyond q1 contribute to the friction. P(q) is the area by the law for the roughness up to q. The law is
    extrapolated there if this roughness has a narrow band. G and S are None, because they do not occur in the
    law.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> profile = rf.analysis.profile(scene, 0.01, 0.15e6)
    >>> bool(profile.area[0] > profile.area[-1])  # the contact area decreases with q
    True
    """
    scene, conditions, quadrature = validate(scene, velocity, pressure, temperature, quadrature)
    if scene.contact_model == "paper":
        check_without(scene, ("adhesion", "correlation"), "profile")
    q = checked_wavevectors(q, 1, conditions, scene)
    result, converged = _profile(scene, *conditions, q, quadrature=quadrature)
    warn_of_last_iterates(scene, converged, conditions)
    return result


def checked_wavevectors(
    q: ArrayLike | None, ndim: int, conditions: Sequence[jax.Array | None], scene: Scene
) -> jax.Array | None:
    """Check the wavevectors, or raise ValueError, and cast them to the dtype of the conditions."""
    if q is not None:
        q = as_leaf("q", q, ndim)
        check_values("q", q, POSITIVE)
        shape = np.broadcast_shapes(*(np.shape(x) for x in conditions if x is not None))
        check_count((*shape, *np.shape(q)), "the conditions and q")
        return jnp.asarray(q, result_dtype(conditions))
    if ndim and not rough_surfaces(scene):
        raise ValueError("q is None, but the scene has no roughness; give wavevectors")
    return None


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _profile(scene, velocity, pressure, temperature, q, *, quadrature):
    surfaces = rough_surfaces_of(scene)
    if not surfaces:
        return _without_roughness(q, jnp.broadcast_shapes(velocity.shape, pressure.shape)), None
    laws = [surface.law for surface in surfaces]
    first = functools.reduce(jnp.minimum, [law.q[0] for law in laws])
    by_law = scene.contact_model == "boundary_elements"
    if q is None:
        q = default_wavevectors(laws, last=last_wavevector(laws[0]) if by_law else None)
    if by_law:

        def block(points):
            result = over_wavevectors(surfaces[0], quadrature, q, *points)
            return {"fluctuation": None, "energy_factor": None, **result._asdict()}
    else:
        prepared = prepare(scene, ("area", "friction"), quadrature, surfaces=surfaces, borders=q)
        densities = []
        if prepared.needs.mean_cos_loss:
            scale = prepared.roughness.scale
            densities = [density_of(surface, scale, "mean_cos_loss", q) for surface in surfaces]
        block = functools.partial(_over_wavevectors, prepared, densities, q)
    results = over_points(block, (velocity, pressure, temperature), _BLOCK)
    converged = results.pop("converged", None)
    slope2, height2 = (
        total(cumulative_moment(law, order, log_ratio(jnp.maximum(q, law.q[0]), law.q[0])) for law in laws)
        for order in (2, 0)
    )
    result = Profile(
        q=q,
        magnification=q / first,
        rms_slope=safe_root(slope2),
        rms_height=safe_root(height2),
        strain=soft[0].strain_at(safe_root(slope2)) if (soft := surfaces[0].soft_solids) else None,
        **results,
    )
    return result, converged


def default_wavevectors(
    laws: Sequence[BrokenPowerLaw], count: int = _COUNT, last: jax.Array | None = None
) -> jax.Array:
    """Return `count` wavevectors, equally spaced in ln q, over all roughness or up to `last`."""
    first = functools.reduce(jnp.minimum, [law.q[0] for law in laws])
    if last is None:
        last = functools.reduce(jnp.maximum, [law.q[-1] for law in laws])
    within = first * jnp.exp(log_ratio(last, first) * (np.arange(1, count - 1) / (count - 1)))
    # Exact ends despite the rounding of exp and ln.
    return jnp.concatenate([first[None], jnp.clip(within, first, last), last[None]])


def fluctuation_at_borders(prepared: Prepared, contact: Contact, count: int) -> jax.Array:
    """Return G without S, eq. (A11), at the last `count` borders, of shape (points, count)."""
    return jnp.maximum(sum_below_borders(prepared, contact.G_panels, count), 0.0)


def sum_below_borders(prepared: Prepared, panels: jax.Array, count: int) -> jax.Array:
    """Sum over the panels, (panels, points), below each of the last `count` borders: (points, count)."""
    before, below = prepared.roughness.mesh.panels_below, jnp.cumsum(panels, 0)
    assert before is not None  # the mesh has borders
    return jnp.concatenate([jnp.zeros_like(panels[:1]), below])[before[-count:]].T


def contact_at_borders(prepared: Prepared, contact: Contact, count: int) -> tuple[jax.Array, jax.Array]:
    """Return x and G at the last `count` borders, of shape (points, count).

    G contains S if the scene has `area_correction`.
    """
    plain = fluctuation_at_borders(prepared, contact, count)
    x_plain = contact_argument(plain)
    x = contact.corrected(x_plain)
    # x is clipped at 27, where S = 1; G is not.
    return x, plain * (x_plain / x) ** 2


def _over_wavevectors(prepared, densities, q, points):
    contact, temperatures = solved(prepared, *points)
    x, G = contact_at_borders(prepared, contact, q.shape[0])
    P = contact_fraction(x)
    results = {"area": P, "fluctuation": G, "energy_factor": energy_factor(P, contact.gamma)}
    background = points[2] if len(points) > 2 else None
    inside = [SurfaceTemperatures(background, background)] * len(densities)
    if temperatures is not None:
        inside, mean = temperatures.at(prepared.roughness, contact, points, q)
        results |= {"temperature": mean, "converged": temperatures.converged}
    if not prepared.needs.mean_cos_loss:
        return results | dict.fromkeys(("friction_density", "friction"), jnp.zeros_like(G))
    terms = total(jnp.sum(values, -1) for values in contact.friction_terms().values())
    density = sum(density_at(points[0], T) for density_at, T in zip(densities, inside, strict=True))
    P = contact_fraction(x)
    SP = energy_factor(P, contact.gamma) * P
    return results | {
        "friction_density": contact.modulus_over_pressure[:, None] * SP * density,
        "friction": sum_below_borders(prepared, terms, q.shape[0]),
    }


def density_of(
    surface: RoughSurface, scale: jax.Array, kind: str, q: jax.Array
) -> Callable[[jax.Array, SurfaceTemperatures], jax.Array | float]:
    """Return a function that evaluates the density of a mean at the wavevectors q.

    The density over ln q is that of `density_of_K` times the mean, in units of the scale.

    The function takes the velocity and the `SurfaceTemperatures`. A temperature is None, or has the shape
    (points,) or (points, wavevectors). The function returns an array of shape (points, wavevectors), or 0.0
    if there is no dissipation.
    """
    law = surface.law
    inside = (q >= law.q[0]) & (q <= law.q[-1])
    # Outside its range the spectrum may overflow: evaluate it inside and discard.
    at = jnp.where(inside, q, law.q[0])
    roughness = jnp.where(inside, law.height2 * jnp.exp(log_shape(law, at) + 4 * jnp.log(at)), 0.0)
    if not surface.relaxes and kind == "mean_cos_loss":
        return lambda *_: 0.0
    weights = factors_at(surface, scale, q).of(kind, density_of_K(kind, roughness, q))
    if surface.static:
        return lambda *_: weights[0]
    excited = stiffness_means(surface, scale, q[None], RequiredMeans(**{kind: True}))

    def density(velocity, temperatures):
        at = jax.tree.map(lambda T: T[None] if T.ndim > 1 else T, temperatures)
        means = excited.means(q[None], velocity, at)
        return sum(w * mean[0] for w, mean in zip(weights, means[kind], strict=True))

    return density


def _without_roughness(q, shape):
    unity, zero_of_q = jnp.ones((*shape, q.shape[0]), q.dtype), jnp.zeros_like(q)
    zero = jnp.zeros_like(unity)
    return Profile(q, q / q[0], unity, zero, unity, zero, zero, zero_of_q, zero_of_q)
