r"""Pull-off force of a rough sphere with adhesion, and the verdict whether adhesion matters.

Solids that are pulled into full contact store the elastic energy

.. math:: \frac{U_\mathrm{el}}{A_0} = \frac12\int d^2q \sum_j C_j\,\mathrm{Re}K_j
          \qquad\Big[= \frac{\pi}{2} E_r\int dq\, q^2 C(q) \text{ for one elastic half-space}\Big]

[Persson and Tosatti, J. Chem. Phys. 115, 5597 (2001), doi:10.1063/1.1398300] and gain the work of adhesion.

The pull-off force of a sphere follows from the work W that separates flat rough solids. In the short-range
limit W is the work of `rubberfric.theory.area.constant_area`, in the formula of Johnson, Kendall and
Roberts. In the long-range limit the sphere keeps its shape, and Derjaguin's approximation gives

.. math:: F = 2\pi R\,W,\qquad W = \max_p\big[\Delta\gamma\,\langle e^{-u/r}\rangle - U\big],\qquad
          U = \int_0^p p'\,\Big(-\frac{d\bar u}{dp'}\Big)\,dp'

with gaps u and elastic energy U of contact without adhesion at load p. The maximum is over these states only,
so W is a lower bound. (The integral of attraction minus load over the separation is not a bound and may
exceed the work of adhesion.) At light loads

.. math:: \bar u \to -u_0 \ln p,\qquad U \to u_0\,p,\qquad \langle e^{-u/r}\rangle \propto p^m
"""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.blocks import over_points
from rubberfric.base.checks import POSITIVE, ArrayLike, as_leaf, check_values, is_concrete
from rubberfric.base.quadrature import Quadrature, gauss, typed
from rubberfric.scene.scene import Scene, isothermal, rough_surfaces
from rubberfric.theory.adhesive_contact import relative_attraction, work_of_separation
from rubberfric.theory.area.partial_contact import contact_argument
from rubberfric.theory.arguments import checked_arguments
from rubberfric.theory.contributions import total
from rubberfric.theory.integrals import evaluate, prepare, solved
from rubberfric.theory.structure import SurfaceTemperatures

_DEFAULT = Quadrature()

# Points evaluated at once in the long-range limit, where each has some hundred loads.
_LONG_BLOCK = 4

# Points evaluated at once for the work of separation.
_WORK_BLOCK = 64

# x = 1 / (2 sqrt G) of light loads, below which the limits above hold. If the attraction is stronger than the
# load there, W has a relative error of 6e-10, and of 5e-6 with 1e-4.
_LIGHT = 1e-6

# Exponent m from which the attraction counts as proportional to the load.
_AS_THE_LOAD = 0.999

# How far the best load may exceed work / range, in e-folds: near full contact nothing depends on it.
_BEYOND = 3.0

# Panels over ln p.
_PANELS = 24

# Gauss nodes of a panel.
_NODES = 8

# Loads of a search interval.
_LOADS = 32

# Number of searches, each in the interval that the previous one found.
_ROUNDS = 6

# Points evaluated at once for the energy of full contact.
_ENERGY_BLOCK = 64

# Work of adhesion of rubber on most clean solids [J/m^2].
_WORK = 0.05

# Ratio of energy to work above which adhesion is negligible. Works of adhesion are known within a factor of a
# few, so that the ratio must be far from 1.
_NEGLIGIBLE = 30.0
# Ratio of energy to work below which adhesion is dominant, as far from 1 as the ratio above.
_DOMINANT = 1 / _NEGLIGIBLE


class AdhesionVerdict(NamedTuple):
    """Results of `adhesion_matters`; arrays of the broadcast shape of the conditions."""

    ratio: jax.Array  # elastic energy of full contact over the work of adhesion [-]
    elastic_energy: jax.Array  # of full contact [J/m^2]
    words: str  # verdict from the smallest ratio

    def __str__(self) -> str:
        return self.words


def full_contact_energy(
    scene: Scene,
    velocity: ArrayLike = 0.0,
    temperature: ArrayLike | None = None,
    *,
    quadrature: Quadrature = _DEFAULT,
) -> jax.Array:
    r"""Compute the elastic energy per nominal area of full contact.

    .. math:: U_\mathrm{el}/A_0 = \frac12\int d^2q \sum_j C_j\,\mathrm{Re}K_j(q v\cos\varphi)

    [Persson and Tosatti, J. Chem. Phys. 115, 5597 (2001)]

    Parameters
    ----------
    scene : Scene; heating and adhesion are ignored
    velocity, temperature : array_like, broadcastable [m/s], [K]; velocity 0: relaxed moduli
    quadrature : Quadrature, static

    Returns
    -------
    array, broadcast shape [J/m^2]; 0 without roughness. Raises as `contact_area`.

    Examples
    --------
    For an elastic solid this is E_r / 4 times the first moment of the spectrum:

    >>> seal = rf.load_scene("data/rubber_seal.toml")
    >>> f"{float(rf.analysis.full_contact_energy(seal)):.4g}"  # in J/m^2
    '0.007244'
    >>> f"{1e7 / 0.75 / 4 * float(rf.roughness.moment(seal.lower.spectrum, 1)):.4g}"
    '0.007244'
    """
    scene = isothermal(scene).replace(adhesion=None)
    scene, (velocity, _, temperature) = checked_arguments(scene, velocity, 1.0, temperature, quadrature)
    return _full_contact_energy(scene, velocity, temperature, quadrature=quadrature)


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _full_contact_energy(scene, velocity, temperature, *, quadrature):
    if not rough_surfaces(scene):
        shape = (
            velocity.shape if temperature is None else jnp.broadcast_shapes(velocity.shape, temperature.shape)
        )
        return jnp.zeros(shape, velocity.dtype)
    prepared = prepare(scene, ("separation",), quadrature)

    def energy(points):
        velocity, *temperature = points
        contact, _ = solved(prepared, velocity, jnp.ones_like(velocity), *temperature)
        storage = total(jnp.sum(terms.densities["mean_storage"], (0, 2)) for terms in contact.terms)
        return jnp.broadcast_to(0.5 * prepared.roughness.scale * storage, velocity.shape)

    return over_points(energy, (velocity, temperature), _ENERGY_BLOCK)


def adhesion_matters(
    scene: Scene,
    velocity: ArrayLike = 0.0,
    temperature: ArrayLike | None = None,
    *,
    work: ArrayLike | None = None,
    quadrature: Quadrature = _DEFAULT,
) -> AdhesionVerdict:
    r"""Judge whether adhesion matters in a scene.

    .. math:: ratio = \frac{U_\mathrm{el}/A_0}{\Delta\gamma}

    Parameters
    ----------
    scene : Scene
    velocity, temperature : as for `full_contact_energy`
    work : work of adhesion [J/m^2], > 0, a number; None: from the scene, or 0.05 if it has no adhesion
    quadrature : Quadrature, static

    Returns
    -------
    AdhesionVerdict. Above a ratio of about 30 adhesion cannot pull the solids together and may be omitted.
    Below about 1/30 it causes full contact without load. In between, adhesion determines how much of the fine
    roughness is in contact. The verdict uses the smallest ratio of all points.

    Raises
    ------
    ValueError : as `contact_area`; work <= 0; called within jit (`full_contact_energy` can be traced).

    Notes
    -----
    Tread rubber on asphalt at rest: 1e4. A seal on ground steel: about 1. Silicone on glass: 1e-3 and less.

    Examples
    --------
    The energy of full contact, 7.2 mJ/m^2, is 14 % of the work of a clean surface:

    >>> seal = rf.load_scene("data/rubber_seal.toml")
    >>> verdict = rf.analysis.adhesion_matters(seal, work=0.05)
    >>> round(float(verdict.ratio), 3), verdict.words[:16]
    (0.145, 'adhesion matters')
    """
    if work is None:
        work = _WORK if scene.adhesion is None else scene.adhesion.work
    work = as_leaf("work", work, 0)
    check_values("work", work, POSITIVE)
    energy = full_contact_energy(scene, velocity, temperature, quadrature=quadrature)
    if not is_concrete(energy) or not is_concrete(work):
        raise ValueError("adhesion_matters is called within jit; call it outside, or use full_contact_energy")
    ratio = energy / work
    return AdhesionVerdict(ratio, energy, _words(float(np.min(ratio)), float(np.min(energy)), float(work)))


def _words(ratio, energy, work):
    compared = (
        f"full contact would store {energy:.3g} J/m^2 of elastic energy, {ratio:.3g} times the work of "
        f"adhesion of {work:.3g} J/m^2"
    )
    if ratio >= _NEGLIGIBLE:
        return f"adhesion does not matter: {compared}; leave it out"
    if ratio <= _DOMINANT:
        return f"adhesion is everything: {compared}; the solids pull each other into full contact"
    return f"adhesion matters: {compared}; it decides how much of the fine roughness is in contact"


def pull_off_force(
    scene: Scene,
    radius: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    quadrature: Quadrature = _DEFAULT,
) -> jax.Array:
    r"""Compute the force that separates a rough sphere from a plane, both at rest.

    .. math:: F = \tfrac{3\pi}{2} R\,W\quad\text{(short range)},\qquad
              F = 2\pi R\, W\quad\text{(long range)}

    [Johnson, Kendall and Roberts, Proc. R. Soc. A 324, 301 (1971), with W of
    `rubberfric.theory.area.constant_area`; Derjaguin, Muller and Toporov, J. Colloid Interface Sci. 53, 314
    (1975), with W of this module]

    Parameters
    ----------
    scene : Scene with adhesion
    radius : R [m], > 0, a number
    pressure, temperature : conditions at which contact was made, array_like, broadcastable [Pa], [K]
    quadrature : Quadrature, static

    Returns
    -------
    array, broadcast shape [N], >= 0; 0 where the elastic energy exceeds the work of adhesion.

    Raises
    ------
    ValueError : as `contact_area`; radius <= 0; a scene without adhesion.

    Limits: in the long-range limit W is up to 14 % below boundary elements at Tabor number 0.1, and 6 to 60 %
    below at 0.3. The error is largest if W is a small part of the work of adhesion
    (tests/rubberfric/theory/area/test_adhesive_elements.py).

    Examples
    --------
    Roughness lowers the force of a seal on a sphere of 1 cm below JKR's 3 pi R work / 2:

    >>> scene = rf.load_scene("data/rubber_seal.toml").replace("adhesion.work", 0.05)
    >>> force = float(rf.analysis.pull_off_force(scene, radius=1e-2, pressure=1e5))
    >>> round(force / (1.5 * np.pi * 1e-2 * 0.05), 3)  # the rest is elastic energy
    0.855
    """
    adhesion = scene.adhesion
    if adhesion is None:
        raise ValueError("scene.adhesion is None; it must be an Adhesion")
    radius = as_leaf("radius", radius, 0)
    check_values("radius", radius, POSITIVE)
    scene, conditions = checked_arguments(scene, 0.0, pressure, temperature, quadrature)
    factor = 1.5 if adhesion.limit == "short" else 2.0
    shape = jnp.broadcast_shapes(*[jnp.shape(x) for x in conditions if x is not None])
    velocity, _, temperature = conditions  # W does not depend on the pressure
    if not rough_surfaces(scene):
        work = jnp.asarray(adhesion.work)
    elif adhesion.limit == "short":
        work = _work_by_energy(scene, velocity, temperature, quadrature=quadrature)
    else:
        work = _work_of_separation(scene, velocity, temperature, quadrature=quadrature)
    return factor * jnp.pi * radius * jnp.broadcast_to(work, shape)


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _work_by_energy(scene, velocity, temperature, *, quadrature):
    """Return the work of separation W in the short-range limit [J/m^2]."""
    prepared = prepare(scene, ("area",), quadrature)

    def of_points(points):
        velocity, *temperature = points
        warm = temperature[0] if temperature else None
        both = [SurfaceTemperatures(warm, warm)] * len(prepared.roughness.contributions)
        return work_of_separation(scene.adhesion, prepared.roughness, velocity, both)

    return over_points(of_points, (velocity, temperature), _WORK_BLOCK)


class _State(NamedTuple):
    separation: jax.Array  # [m]
    gained: jax.Array  # work of adhesion times <e^-u/r> [J/m^2]


@functools.partial(jax.jit, static_argnames=("quadrature",))
def _work_of_separation(scene, velocity, temperature, *, quadrature):
    """Return the work of separation W in the long-range limit [J/m^2]."""
    prepared = prepare(scene, ("area", "separation"), quadrature)
    work, reach = scene.adhesion.work, scene.adhesion.range

    def work_at(velocity, temperature=None):
        under = functools.partial(_under, prepared, work, velocity, temperature)
        return _largest(under, jnp.log(work / reach) + _BEYOND)

    return over_points(lambda points: jax.vmap(work_at)(*points), (velocity, temperature), _LONG_BLOCK)


def _under(prepared: Any, work, velocity, temperature, log_load):
    """Return the `_State` at loads e^log_load of shape (n,), and x = 1 / (2 sqrt(G)) of all roughness."""
    load = jnp.exp(log_load)
    at_rest = jnp.broadcast_to(velocity, load.shape)
    warm = None if temperature is None else jnp.broadcast_to(temperature, load.shape)
    both = [SurfaceTemperatures(warm, warm)] * len(prepared.roughness.contributions)
    contact, share = relative_attraction(prepared.adhesion, prepared.roughness, at_rest, load, both)
    points = (at_rest, load) if warm is None else (at_rest, load, warm)
    results = evaluate(prepared, ("separation",), points, (contact, None))
    x = contact_argument(jnp.sum(contact.G_panels, 0))
    return _State(results["separation"], work * share), x


def _largest(under, top):
    """Return the largest work of separation W at loads up to e^top, from `under`: ln p -> (`_State`, x)."""
    node, weight = gauss(_NODES)
    places = typed((np.arange(_PANELS)[:, None] + node).reshape(-1) / _PANELS, top)
    shares = typed(np.tile(weight, _PANELS) / _PANELS, top)
    still = jax.lax.stop_gradient

    def slopes_at(at):
        state, slopes, x = jax.jvp(under, (at,), (jnp.ones_like(at),), has_aux=True)
        return state, slopes, slopes.gained + jnp.exp(at) * slopes.separation, x

    light = still(top) + jnp.log(_LIGHT / still(slopes_at(top[None])[-1][0]))
    light = jnp.minimum(light, still(top) - 1.0)
    at = light + (still(top) - light) * jnp.append(0.0, places)
    _, _, gain, _ = jax.tree.map(still, slopes_at(at))
    # The integral of the gain is largest where the gain changes sign.
    so_far = jnp.cumsum(gain[1:] * shares)
    best = jnp.where(jnp.max(so_far) > 0, jnp.argmax(so_far) + 1, 0)
    best = jnp.where((best == 0) & (gain[0] <= 0), -1, best)

    def enclosed(_, ends):
        within = jnp.linspace(ends[0], ends[1], _LOADS)
        lost = (slopes_at(within)[2] <= 0).at[0].set(False).at[-1].set(True)
        first = jnp.argmax(lost)
        return within[first - 1], within[first]

    ends = at[jnp.maximum(best, 0)], at[jnp.minimum(best + 1, at.size - 1)]
    end = still(jnp.where(best < 0, light, jax.lax.fori_loop(0, _ROUNDS, enclosed, ends)[0]))
    at = jnp.concatenate([light[None], light + (end - light) * places, end[None]])
    state, slopes, *_ = slopes_at(at)
    u0 = -slopes.separation[0]
    stored = -jnp.sum((jnp.exp(at) * slopes.separation)[1:-1] * shares) * (end - light)
    whole = state.gained[-1] - u0 * jnp.exp(light) - stored
    # Both are values of actual states, and therefore lower bounds.
    return jnp.maximum(jnp.maximum(whole, _of_light_loads(state, slopes, light)), 0.0)


def _of_light_loads(state, slopes, light):
    """Return the work of separation W at a maximum below the load e^light, or 0 without such a maximum.

    At the maximum, m <e^-u/r> times the work of adhesion equals u0 p. The module docstring defines m and u0.
    """
    u0, gain = -slopes.separation[0], slopes.gained[0]
    m = gain / state.gained[0]
    # No load satisfies this if the attraction is proportional to the load, m = 1, or if all gaps are within
    # range: then m is rounding error and its logarithm may be NaN.
    some = (m > 0) & (m < _AS_THE_LOAD) & (u0 * jnp.exp(light) >= gain)
    m, u0, gain = (jnp.where(some, x, 0.5) for x in (m, u0, gain))
    back = (light + jnp.log(u0) - jnp.log(gain)) / (1 - m)
    return jnp.where(some, u0 * jnp.exp(light - jnp.where(some, back, 0.0)) * (1 / m - 1), 0.0)
