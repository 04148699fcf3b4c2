r"""Contact with long-range adhesion (DMT): the attraction acts like an additional load.

If the attraction reaches much further (range r) than it deforms the solids, rough solids touch as they do
without adhesion under the pressure p_rep [Derjaguin, Muller and Toporov; for rough solids Persson and
Scaraggi, J. Chem. Phys. 141, 124701 (2014), arXiv:1405.3123]

.. math:: p_\mathrm{rep} = \sigma_0 + p_\mathrm{ad},\qquad
          p_\mathrm{ad} = \int P(u; p_\mathrm{rep})\, p_a(u)\, du,\qquad
          p_a(u) = \frac{\Delta\gamma}{r} e^{-u/r}

P(u) has two parts: the contact area A at u = 0, and the area that leaves contact at each wavevector q, whose
separations are Gaussian with the mean u_1(q) and the width h(q) of
`rubberfric.theory.area.separations`:

.. math:: p_\mathrm{ad} = \frac{\Delta\gamma}{r}\Big[A
          + \int (-dP)\, \langle e^{-u/r}\rangle_{u_1(q), h(q)}\Big]

p_ad increases with p_rep and lies between 0 and the work over r. Therefore at least one solution lies between
sigma_0 and sigma_0 + work / r. The least of several is returned: approaching solids reach it first.

u_1 contains the integral of k over U beyond q. It is evaluated by parts, with x_1 at q1 and V = U(q) - U(q'):

.. math:: \int_q^{q_1} k\,dU = k(x_1)\,U(q) + \int \frac{dk}{d\ln x}\,V\,d\ln x

At light load k(x_1) is small and V is small where k has its maximum, so nothing large cancels.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.fixed_points.anderson import implicit
from rubberfric.base.fixed_points.secant import first, zero
from rubberfric.base.quadrature import gauss, typed
from rubberfric.theory.area.area_correction import CorrectionTable, correct_argument
from rubberfric.theory.area.partial_contact import (
    TWO_OVER_ROOT_PI,
    AdhesiveLoad,
    contact_argument,
    contact_fraction,
    energy_factor,
)
from rubberfric.theory.area.separations import LossTable, cubic, loss_factor, loss_weight, spread

# Loads tried to bracket the first solution, evenly spaced in ln p, and the nodes used for them.
_LOADS, _FEW = 16, (8, 12)

# Outer and inner nodes per node of a contact panel.
_OUTER, _INNER = 4, 3

# G below which hardly any area has left contact (1 - P = 1e-14).
_FIRST = 0.0085

# ln of the largest 1/x^2 at which k is still negligible (1e-12): the inner integral starts there.
_LOG_CLOSEST = -math.log(28.0)

# Share of the outer interval next to q1 within which nodes crowd towards q1.
_BEND = 0.2

# Length of the inner interval over ln(g' - g) above which its nodes crowd towards q1.
_SHORT = 8.0


class Gaps(NamedTuple):
    """Roughness and attraction at each point; knots in a row, from q0 to q1."""

    knots: jax.Array  # g, ascending from 0
    storage: jax.Array  # U beyond each knot, 0 at the last [m]
    heights: jax.Array  # mean square height beyond each knot, 0 at the last [m^2]
    stiffness: jax.Array  # modulus scale over sigma_0
    strength: jax.Array  # work / (range sigma_0)
    reach: jax.Array  # the range [m]
    gamma: jax.Array
    correction: CorrectionTable | None
    lost: LossTable


# Batched axes.
_POINTS = Gaps._make([0, 0, 0, 0, 0, None, None, None, None])


def solve_dmt_load(gaps: Gaps, order: int) -> AdhesiveLoad:
    """Solve p_rep = sigma_0 + p_ad for the load that the contact bears.

    Parameters
    ----------
    gaps : Gaps; the first axis of its arrays is the point, except for reach, gamma, correction and lost
    order : nodes of a contact panel; the nodes used here are multiples of it

    Returns
    -------
    AdhesiveLoad, of the least load if there are several; derivatives are implicit
    """
    count = _counts(order)
    still = jax.lax.stop_gradient(gaps)

    def solved(gaps):
        # Quadrature nodes follow each load: nodes placed for another load miss where contact is lost.
        top = jnp.log1p(gaps.strength)
        near = first(lambda z: z - _log_load(gaps, z, _FEW), top, _LOADS)
        near = zero(lambda z: z - _log_load(gaps, z, _FEW), near, top)[2]
        return zero(lambda z: z - _log_load(gaps, z, count), near, top)[:2]

    solution, converged = jax.vmap(solved, (_POINTS,))(still)

    def balance(z):
        return jax.vmap(lambda gaps, z: _log_load(gaps, z, count), (_POINTS, 0))(gaps, z[:, 0])[:, None]

    return AdhesiveLoad(jnp.exp(implicit(balance, solution[:, None])[:, 0]), converged)


def evaluate_attraction(gaps: Gaps, order: int) -> jax.Array:
    """Evaluate <e^-u/r>, p_ad over its value in full contact, of contact that bears sigma_0, (points,)."""
    count = _counts(order)
    return jax.vmap(lambda gaps: _share(gaps, jnp.zeros_like(gaps.stiffness), count), (_POINTS,))(gaps)


def _counts(order):
    return _OUTER * order, _INNER * order


def _log_load(gaps, z, count):
    """Return ln(1 + p_ad / sigma_0) of contact that bears the load sigma_0 e^z."""
    return jnp.log1p(gaps.strength * _share(gaps, z, count))


def _share(gaps, z, count):
    """Return <e^-u/r> of contact that bears the load sigma_0 e^z.

    count : number of outer nodes, and of inner nodes for each of them
    """
    stiffness, g_end = gaps.stiffness * jnp.exp(-z), gaps.knots[-1]
    ahead, weight = _outer_nodes(stiffness, g_end, count[0])
    g, rest = g_end * jnp.exp(-ahead), -g_end * jnp.expm1(-ahead)
    X, last = contact_argument(stiffness**2 * g), contact_argument(stiffness**2 * g_end)
    u1, width = _separations(gaps, stiffness, g, rest, X, count[1])
    lost, corrected = 1.0, X
    if gaps.correction is not None:
        corrected, last = correct_argument(gaps.correction, X), correct_argument(gaps.correction, last)
        lost = energy_factor(contact_fraction(corrected), gaps.gamma) * (corrected / X) ** 2
    # -dP / d ln g
    lost = lost * 0.5 * TWO_OVER_ROOT_PI * corrected * jnp.exp(-corrected * corrected)
    found = contact_fraction(last) + jnp.sum(weight * lost * spread(u1, width, gaps.reach))
    # Errors of the quadrature must not make p_ad exceed its bound, beyond which no load is tried.
    return jnp.minimum(found, 1.0)


def _outer_nodes(stiffness, g_end, count):
    """Return ln(g_end / g) at the nodes of the outer integral, and their weights."""
    node, weight = (typed(table, g_end) for table in gauss(count))
    # Without roughness g_end is 0 and nothing is lost.
    log_end = jnp.log(jnp.maximum(g_end, jnp.finfo(g_end.dtype).tiny))
    length = jnp.maximum(log_end + 2 * jnp.log(stiffness) - math.log(_FIRST), 0.0)
    # Next to q1 the width falls as a square root of g_end - g, which is smooth in the nodes.
    back = (1 - node) ** 2 * (1 + _BEND) / (1 - node + _BEND)
    stretch = (1 - node) * (1 + _BEND) * (1 - node + 2 * _BEND) / (1 - node + _BEND) ** 2
    return length * back, length * stretch * weight


def _separations(gaps, stiffness, g, rest, X, count):
    """Return u1 and h at g, from as many inner nodes; `rest` is g_end - g."""
    node, weight = (typed(table, g) for table in gauss(count))
    slopes = _slopes(gaps.knots, gaps.storage)
    U = _between(gaps.knots, gaps.storage, slopes, g)
    heights = _between(gaps.knots, gaps.heights, _slopes(gaps.knots, gaps.heights), g)
    P, c = contact_fraction(X), loss_factor(X)
    x_end = contact_argument((stiffness * P) ** 2 * rest)
    log_x = jnp.log(x_end)[:, None]
    # ln of (g_end - g) / (g' - g), from q1 back to where k is negligible.
    length = jnp.maximum(-_LOG_CLOSEST - 2 * log_x, 0.0)
    crowding = jnp.maximum(length / _SHORT - 1, 0.0)
    back = length * node / (1 + crowding * (1 - node))
    stretch = length * (1 + crowding) / (1 + crowding * (1 - node)) ** 2
    passed = U[:, None] - _between(
        gaps.knots, gaps.storage, slopes, g[:, None] + rest[:, None] * jnp.exp(-back)
    )
    fall = gaps.lost(log_x + 0.5 * back, c[:, None])
    integral = loss_weight(x_end, c, gaps.gamma) * U - jnp.sum(0.5 * stretch * weight * fall * passed, -1)
    u1 = jnp.pi / 2 * stiffness * P * jnp.maximum(integral, 0.0)
    smallest = jnp.finfo(g.dtype).tiny ** 0.5
    return u1, jnp.sqrt(jnp.maximum(heights, smallest))


def _slopes(knots, values):
    """Return slopes at the knots, of the parabola through each and its neighbours; 0 where knots coincide."""
    step = jnp.diff(knots)
    rising = step > 0
    slope = jnp.where(rising, jnp.diff(values) / jnp.where(rising, step, 1.0), 0.0)
    both = step[:-1] + step[1:]
    some = both > 0
    middle = (slope[:-1] * step[1:] + slope[1:] * step[:-1]) / jnp.where(some, both, 1.0)
    return jnp.concatenate([slope[:1], jnp.where(some, middle, 0.0), slope[-1:]])


def _between(knots, values, slopes, at):
    """Interpolate by cubic Hermite polynomials."""
    k = jnp.clip(jnp.searchsorted(knots, at, side="right") - 1, 0, knots.shape[0] - 2)
    step = knots[k + 1] - knots[k]
    some = step > 0
    t = jnp.clip((at - knots[k]) / jnp.where(some, step, 1.0), 0.0, 1.0)
    return cubic(t, values[k], values[k + 1], step * slopes[k], step * slopes[k + 1])
