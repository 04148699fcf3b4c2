r"""Contact with short-range adhesion: loaded without adhesion, then unloaded at constant area.

Without adhesion a load p_1 gives the area A(p_1) and the mean separation u(p_1). Adhering solids keep this
area while the load decreases to sigma_0. They move apart like a punch of this area, with constant stiffness,
and the stored energy is [Ciavarella, J. Mech. Phys. Solids 114, 209 (2018),
doi:10.1016/j.jmps.2018.02.011, arXiv:1712.05844]

.. math:: U = U(p_1) - \tfrac12 c\,(p_1^2 - \sigma_0^2),\qquad
          \bar u = u(p_1) + c\,(p_1 - \sigma_0),\qquad c = -u'(p_1)

The area minimises this energy minus the work of adhesion and the work of the load:

.. math:: p_1 = \sigma_0 + \sqrt{\frac{2\,\Delta\gamma\, A'(p_1)}{u''(p_1)}}

This is exact for a sphere (Johnson, Kendall and Roberts) and for every contact with a single edge. At light
load A is proportional to p_1 and u to its logarithm, so the root is a constant share of p_1: the area stays
proportional to the load and is larger by the factor 1 / (1 - share). If the share reaches 1, no load keeps
the solids apart, and they jump into closer contact [boundary elements agree: Pastewka and Robbins, Proc.
Natl. Acad. Sci. 111, 3298 (2014), doi:10.1073/pnas.1320846111].

At zero load, with U for s = S P, the work that separates the solids is

.. math:: W = \max_{p_1}\big[\Delta\gamma A - \tfrac12\,scale \int (s - \tfrac12 x s')\,dU\big] \ge 0

x is proportional to the load at all wavevectors. With s = S P and the terms of the separation

.. math:: -p\,u' = \frac{scale}{2p}\int x s'\,dU,\qquad
          p^2 u'' = \frac{scale}{2p}\int (x s' - x^2 s'')\,dU
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.fixed_points import implicit
from rubberfric.base.roots import first, zero
from rubberfric.theory.area.area_correction import UniformTable, correct_argument
from rubberfric.theory.area.partial_contact import (
    TWO_OVER_ROOT_PI,
    AdhesiveLoad,
    contact_fraction,
    energy_factor,
)

# Number of loads, evenly spaced in their logarithm, that bracket the first solution.
_LOADS = 24

# Nodes that are joined to two nodes while the first solution is bracketed.
_LUMP = 24

# x of all the roughness in full contact: 1 - P = 1e-29.
_FULL = 8.0

# x of all the roughness under the lightest load tried for the work of separation.
LIGHTEST = 1e-4

# Number of these loads.
_TRIED = 32

# Number of refinements about the best of these loads.
_ROUNDS = 6


class Unloading(NamedTuple):
    """Data for the energy of unloading at a point. The nodes lie along one axis."""

    x: jax.Array  # at sigma_0
    storage: jax.Array  # terms of U [m]
    end: jax.Array  # x of all the roughness
    stiffness: jax.Array  # scale over sigma_0
    gain: jax.Array  # twice the work of adhesion over sigma_0 [m]
    gamma: jax.Array
    correction: UniformTable | None


# Axes of the points.
_POINTS = Unloading._make([0, 0, 0, 0, 0, None, None])


def solve_energy_criterion(unloading: Unloading) -> AdhesiveLoad:
    """Solve for the load that gives the same area without adhesion.

    Parameters
    ----------
    unloading : Unloading, with points along the first axis; gamma and correction are common to all points

    Returns
    -------
    AdhesiveLoad. If there are several solutions, the load is the smallest one, which approaching solids reach
    first. If there is no solution, the load is one of full contact. Derivatives are implicit.
    """
    still = jax.lax.stop_gradient(unloading)
    solution, full, converged = jax.vmap(_solved, (_POINTS,))(still)

    def balance(z):
        excess = jax.vmap(_excess, (_POINTS, 0))(unloading, z[:, 0])
        # Full contact: a sufficiently large load, with zero derivative.
        return jnp.where(full, solution, z[:, 0] - excess)[:, None]

    z = implicit(balance, solution[:, None])[:, 0]
    fall = jax.vmap(lambda point, z: _slopes(point, z)[1], (_POINTS, 0))(unloading, z)
    return AdhesiveLoad(jnp.exp(z), converged, lift=-jnp.expm1(-z) * fall)


def _solved(point):
    """Return (solution, full, converged) at one point.

    `solution` is the smallest solution ln(p_1 / sigma_0). `full` is True in full contact. `converged` is True
    if a solution was found or the contact is full.
    """
    top = jnp.maximum(jnp.log(_FULL / point.end), 0.0)
    lumped = _lumped(point)
    near = first(lambda z: _excess(lumped, z), top, _LOADS)
    near = zero(lambda z: _excess(lumped, z), near, top)[2]
    solution, converged, _ = zero(lambda z: _excess(point, z), near, top)
    full = ~converged & (solution >= top)
    return solution, full, converged | full


def _lumped(point):
    """Replace each group of neighbouring nodes by two nodes.

    The two nodes have the mean and the variance of x in the group. Terms are proportional to x in light
    contact, and to exp(-x^2) near full contact.
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
    """Return (p_1 - sigma_0) / p_1 minus the share of p_1 that adhesion bears, at p_1 = sigma_0 e^z."""
    rise, _, bend = _slopes(point, z)
    # With small gamma the energy may not be convex, and near full contact both terms are 0; such a load does
    # not keep the solids apart. 1 / bend^2 in the derivative must be finite.
    apart = (bend > jnp.finfo(bend.dtype).tiny ** 0.5) & (rise > 0)
    rise, bend = (jnp.where(apart, x, 1.0) for x in (rise, bend))
    share = jnp.sqrt(point.gain * (rise * jnp.exp(-z)) / bend)
    return -jnp.expm1(-z) - jnp.where(apart, share, 2.0)


def _slopes(point, z):
    """Return p A', -p u' and p^2 u'' of contact without adhesion under the pressure p = sigma_0 e^z.

    A is the contact area, and u is the mean separation.
    """
    x, P, bell, slope = _nodes(point, z)
    bend = slope * (1 + 2 * x * x) - 6 * (1 - point.gamma) * P * (x * bell) ** 2
    weight = 0.5 * (point.stiffness * jnp.exp(-z)) * point.storage
    x, X = _ends(point, z)
    rise = TWO_OVER_ROOT_PI * X * jnp.exp(-X * X)
    if point.correction is not None:
        rise = rise * energy_factor(contact_fraction(X), point.gamma) * (X / x) ** 2
    return rise, jnp.sum(weight * slope), jnp.sum(weight * bend)


def _nodes(point, z):
    """Return x, P, dP/dx and x ds/dx with s = S P, at the nodes under the pressure sigma_0 e^z."""
    x = jnp.minimum(point.x * jnp.exp(z), 2 * _FULL)
    P, bell = contact_fraction(x), TWO_OVER_ROOT_PI * jnp.exp(-x * x)
    return x, P, bell, x * bell * (point.gamma + 3 * (1 - point.gamma) * P * P)


def _ends(point, z):
    """Return x = 1 / (2 sqrt(G)) of all roughness under the pressure sigma_0 e^z, for two kinds of G.

    The first G is the plain G. The second G contains S if the point has a `UniformTable`.
    """
    x = jnp.minimum(point.end * jnp.exp(z), 2 * _FULL)
    return x, x if point.correction is None else correct_argument(point.correction, x)


def work_at_constant_area(unloading: Unloading) -> jax.Array:
    """Return W divided by sigma_0 [m], of shape (points,).

    sigma_0 is the pressure of `unloading`, where x of all the roughness must be `LIGHTEST`. W itself does not
    depend on this pressure. Under a heavy load, however, `contact_argument` limits x, and smaller multiples
    of these x would be too small.
    """
    return jax.vmap(_work, (_POINTS,))(unloading)


def _work(point):
    def gained(z):
        _, P, _, slope = _nodes(point, z)
        energy = energy_factor(P, point.gamma) * P - 0.5 * slope
        stored = 0.5 * point.stiffness * jnp.sum(point.storage * energy)
        return 0.5 * point.gain * contact_fraction(_ends(point, z)[1]) - stored

    def closer(_, ends):
        loads = jnp.linspace(ends[0], ends[1], _TRIED)
        best = jnp.argmax(jax.vmap(gained)(loads))
        return loads[jnp.maximum(best - 1, 0)], loads[jnp.minimum(best + 1, _TRIED - 1)]

    ends = jnp.log(LIGHTEST / point.end), jnp.log(_FULL / point.end)
    low, high = jax.lax.stop_gradient(jax.lax.fori_loop(0, _ROUNDS, closer, ends))
    # At the maximum the error is quadratic in the load, so the derivative of the load is not needed.
    return jnp.maximum(gained(0.5 * (low + high)), 0.0)
