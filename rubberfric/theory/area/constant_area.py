r"""Contact with adhesion of short range, by its energy: pressed together without it, then held and unloaded.

Without adhesion a load p_1 makes the area A(p_1) and leaves the mean separation u(p_1). Solids that
adhere keep that area while the load falls to sigma_0: they move apart as they would on a punch of this
area, with the stiffness that they have there, and store [Ciavarella, J. Mech. Phys. Solids 114, 209 (2018),
doi:10.1016/j.jmps.2018.02.011, arXiv:1712.05844]

.. math:: U = U(p_1) - \tfrac12 c\,(p_1^2 - \sigma_0^2),\qquad
          \bar u = u(p_1) + c\,(p_1 - \sigma_0),\qquad c = -u'(p_1)

Of all areas it is that of the least energy, less the work of adhesion, and of the load:

.. math:: p_1 = \sigma_0 + \sqrt{\frac{2\,\Delta\gamma\, A'(p_1)}{u''(p_1)}}

exact of a sphere, which is that of Johnson, Kendall and Roberts, and of any contact of one edge. At light
loads A grows as p_1 and u falls as its logarithm, so that the root is a share of p_1: the area stays
proportional to the load and is larger by 1 / (1 - share). From a share of 1 on no load holds the solids
apart, and they jump into closer contact [as boundary elements have it: Pastewka and Robbins, Proc. Natl.
Acad. Sci. 111, 3298 (2014), doi:10.1073/pnas.1320846111].

Under no load, with U of s = S P, the least energy is the work that separates the solids again,

.. math:: W = \max_{p_1}\big[\Delta\gamma A - \tfrac{\pi}{2}\,scale \int (s - \tfrac12 x s')\,dU\big] \ge 0

With x of all wavevectors growing as the load, s = S P and the terms of the separation

.. math:: -p\,u' = \frac{\pi}{2}\frac{scale}{p}\int x s'\,dU,\qquad
          p^2 u'' = \frac{\pi}{2}\frac{scale}{p}\int (x s' - x^2 s'')\,dU
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.fixed_points import first, implicit, zero
from rubberfric.theory.area.area_correction import CorrectionTable, correct_argument
from rubberfric.theory.area.partial_contact import (
    TWO_OVER_ROOT_PI,
    AdhesiveLoad,
    contact_fraction,
    energy_factor,
)

# Loads that are tried, by an even share of their logarithm, for where the first solution lies, and nodes in
# one there.
_LOADS, _LUMP = 24, 24

# x of all the roughness where nothing is left to come into contact: 1 - P = 1e-29.
_FULL = 8.0

# For the work of separation: x from which on, loads that are tried, and how often about the best of them.
_LIGHT, _TRIED, _ROUNDS = 1e-4, 32, 6


class Unloading(NamedTuple):
    """What the energy depends on at a point; nodes in a row."""

    x: jax.Array  # under sigma_0
    storage: jax.Array  # terms of U [m]
    end: jax.Array  # x of all the roughness
    stiffness: jax.Array  # scale over sigma_0
    gain: jax.Array  # twice the work of adhesion over sigma_0 [m]
    gamma: jax.Array
    correction: CorrectionTable | None


# Axes of points.
_POINTS = Unloading._make([0, 0, 0, 0, 0, None, None])


def solve_energy_criterion(unloading: Unloading) -> AdhesiveLoad:
    """Solve for the load that makes the same area without adhesion.

    Parameters
    ----------
    unloading : Unloading of points, which are the first axis of its arrays; gamma and correction are of all

    Returns
    -------
    AdhesiveLoad, the least of several loads, which approaching solids reach first; that of full contact if
    there is none. Derivatives are implicit.
    """
    still = jax.lax.stop_gradient(unloading)
    solution, full, converged = jax.vmap(_solved, (_POINTS,))(still)

    def balance(z):
        found = jax.vmap(_excess, (_POINTS, 0))(unloading, z[:, 0])
        # Full contact has no load of its own: one that is large enough, which nothing moves.
        return jnp.where(full, solution, z[:, 0] - found)[:, None]

    z = implicit(balance, solution[:, None])[:, 0]
    fall = jax.vmap(lambda point, z: _slopes(point, z)[1], (_POINTS, 0))(unloading, z)
    return AdhesiveLoad(jnp.exp(z), converged, lift=-jnp.expm1(-z) * fall)


def _solved(point):
    """The least solution, whether it is full contact, and whether it was found.

    Loads are logarithms of p_1 over sigma_0.
    """
    top = jnp.maximum(jnp.log(_FULL / point.end), 0.0)
    lumped = _lumped(point)
    near = first(lambda z: _excess(lumped, z), top, _LOADS)
    near = zero(lambda z: _excess(lumped, z), near, top)[2]
    found, converged, _ = zero(lambda z: _excess(point, z), near, top)
    full = ~converged & (found >= top)
    return found, full, converged | full


def _lumped(point):
    """Neighbouring nodes as two, of the same mean and variance of x.

    What is hardly in contact goes as x, and what is nearly in full contact as exp(-x^2).
    """
    missing = -point.x.shape[-1] % _LUMP
    x, storage = (jnp.pad(row, (0, missing)).reshape(-1, _LUMP) for row in (point.x, point.storage))
    total = jnp.sum(storage, -1, keepdims=True)
    share = storage / jnp.where(total > 0, total, 1.0)
    mean = jnp.sum(share * x, -1, keepdims=True)
    width = jnp.sqrt(jnp.sum(share * (x - mean) ** 2, -1, keepdims=True))
    both = jnp.concatenate([mean - width, mean + width], -1)
    return point._replace(x=jnp.maximum(both, 0.0).ravel(), storage=jnp.repeat(0.5 * total, 2))


def _excess(point, z):
    """(p_1 - sigma_0) / p_1 less the share of p_1 that adhesion bears."""
    rise, _, bend = _slopes(point, z)
    # S of small gamma may let the energy of a contact fall short of convex, and next to full contact both are
    # 0: such a load holds nothing apart. 1 / bend^2, of the derivative, must be a number.
    apart = (bend > jnp.finfo(bend.dtype).tiny ** 0.5) & (rise > 0)
    rise, bend = (jnp.where(apart, x, 1.0) for x in (rise, bend))
    share = jnp.sqrt(point.gain * (rise * jnp.exp(-z)) / bend)
    return -jnp.expm1(-z) - jnp.where(apart, share, 2.0)


def _slopes(point, z):
    """p A', -p u' and p^2 u'' of contact without adhesion at a load of which z is the logarithm."""
    x, P, bell, slope = _nodes(point, z)
    bend = slope * (1 + 2 * x * x) - 6 * (1 - point.gamma) * P * (x * bell) ** 2
    weight = jnp.pi / 2 * (point.stiffness * jnp.exp(-z)) * point.storage
    x, X = _ends(point, z)
    rise = TWO_OVER_ROOT_PI * X * jnp.exp(-X * X)
    if point.correction is not None:
        rise = rise * energy_factor(contact_fraction(X), point.gamma) * (X / x) ** 2
    return rise, jnp.sum(weight * slope), jnp.sum(weight * bend)


def _nodes(point, z):
    """Of the nodes x, P, its derivative, and x s'."""
    x = jnp.minimum(point.x * jnp.exp(z), 2 * _FULL)
    P, bell = contact_fraction(x), TWO_OVER_ROOT_PI * jnp.exp(-x * x)
    return x, P, bell, x * bell * (point.gamma + 3 * (1 - point.gamma) * P * P)


def _ends(point, z):
    """X of all the roughness, plain and with S in G."""
    x = jnp.minimum(point.end * jnp.exp(z), 2 * _FULL)
    return x, x if point.correction is None else correct_argument(point.correction, x)


def work_at_constant_area(unloading: Unloading) -> jax.Array:
    """W over the pressure of `Unloading`, of which it does not depend otherwise [m], (points,)."""
    return jax.vmap(_work, (_POINTS,))(unloading)


def _work(point):
    def gained(z):
        _, P, _, slope = _nodes(point, z)
        energy = energy_factor(P, point.gamma) * P - 0.5 * slope
        stored = jnp.pi / 2 * point.stiffness * jnp.sum(point.storage * energy)
        return 0.5 * point.gain * contact_fraction(_ends(point, z)[1]) - stored

    def closer(_, ends):
        loads = jnp.linspace(ends[0], ends[1], _TRIED)
        best = jnp.argmax(jax.vmap(gained)(loads))
        return loads[jnp.maximum(best - 1, 0)], loads[jnp.minimum(best + 1, _TRIED - 1)]

    ends = jnp.log(_LIGHT / point.end), jnp.log(_FULL / point.end)
    low, high = jax.lax.stop_gradient(jax.lax.fori_loop(0, _ROUNDS, closer, ends))
    # Next to the largest it moves with its square alone, and so do derivatives with what moves the load.
    return jnp.maximum(gained(0.5 * (low + high)), 0.0)
