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

p_ad increases with p_rep and lies between 0 and work / r. Therefore at least one solution lies between
sigma_0 and sigma_0 + work / r. If there are several, the smallest one is returned, because approaching solids
reach it first.

u_1 contains the integral of k over U beyond q. This integral is evaluated by parts, with x_1 at q1 and
V = U(q) - U(q'):

.. math:: \int_q^{q_1} k\,dU = k(x_1)\,U(q) + \int \frac{dk}{d\ln x}\,V\,d\ln x

At light load k(x_1) is small and V is small where k has its maximum, so nothing large cancels.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.fixed_points import first, implicit, zero
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
_LOADS, _FEW = 12, (8, 8)

# Outer and inner nodes per node of a contact panel.
_OUTER, _INNER = 3, 2

# G below which hardly any area has left contact (1 - P = 1e-14).
_FIRST = 0.0085

# x above which k is negligible (1e-12): the inner integral starts there.
_CLOSEST = math.sqrt(28.0)

# Root of x_end / x in which the inner nodes are spaced.
_ROOT = 5

# Share of the outer interval next to q1 within which nodes crowd towards q1.
_BEND = 0.2


class Gaps(NamedTuple):
    """Roughness and attraction at each point; the knots lie along the last axis, from q0 to q1."""

    knots: jax.Array  # g, ascending from 0
    storage: jax.Array  # U beyond each knot, 0 at the last [m]
    heights: jax.Array  # mean square height beyond each knot, 0 at the last [m^2]
    stiffness: jax.Array  # modulus scale over sigma_0
    strength: jax.Array  # work / (range sigma_0)
    reach: jax.Array  # the range [m]
    gamma: jax.Array
    correction: CorrectionTable | None
    lost: LossTable


class _Beyond(NamedTuple):
    """U and the mean square height beyond g, as cubic Hermite polynomials between the knots."""

    knots: jax.Array
    storage: tuple[jax.Array, jax.Array]  # values and slopes at the knots
    heights: tuple[jax.Array, jax.Array]


# Batched axes.
_POINTS = Gaps._make([0, 0, 0, 0, 0, None, None, None, None])


def solve_dmt_load(gaps: Gaps, order: int) -> AdhesiveLoad:
    """Solve p_rep = sigma_0 + p_ad for the pressure p_rep on the contact.

    Parameters
    ----------
    gaps : Gaps with points along the first axis of all arrays, except for reach, gamma, correction and lost
    order : number of nodes of a contact panel; the numbers of nodes used here are multiples of it

    Returns
    -------
    AdhesiveLoad. If there are several solutions, the load is the smallest one. Derivatives are implicit.
    """
    count = _counts(order)
    still = jax.lax.stop_gradient(gaps)

    def solved(gaps):
        # Quadrature nodes follow each load: nodes placed for another load miss where contact is lost.
        beyond = jax.lax.optimization_barrier(_interpolate_beyond(gaps))
        top = jnp.log1p(gaps.strength)
        near = first(lambda z: z - _log_load(gaps, beyond, z, _FEW), top, _LOADS)
        near = zero(lambda z: z - _log_load(gaps, beyond, z, _FEW), near, top)[2]
        return zero(lambda z: z - _log_load(gaps, beyond, z, count), near, top)[:2]

    solution, converged = jax.vmap(solved, (_POINTS,))(still)

    def log_load(gaps, z):
        return _log_load(gaps, _interpolate_beyond(gaps), z, count)

    def balance(z):
        return jax.vmap(log_load, (_POINTS, 0))(gaps, z[:, 0])[:, None]

    return AdhesiveLoad(jnp.exp(implicit(balance, solution[:, None])[:, 0]), converged)


def evaluate_attraction(gaps: Gaps, order: int) -> jax.Array:
    """Return the mean of e^(-u/r) over the separations u under the pressure sigma_0.

    r is the range of the attraction. The mean equals p_ad divided by work / r, and has the shape (points,).
    Arguments are as for `solve_dmt_load`.
    """

    def share(gaps):
        return _share(gaps, _interpolate_beyond(gaps), jnp.zeros_like(gaps.stiffness), _counts(order))

    return jax.vmap(share, (_POINTS,))(gaps)


def _counts(order):
    return _OUTER * order, _INNER * order


def _log_load(gaps, beyond, z, count):
    """Return ln(1 + p_ad / sigma_0) in the contact under the pressure sigma_0 e^z."""
    return jnp.log1p(gaps.strength * _share(gaps, beyond, z, count))


def _share(gaps, beyond, z, count):
    """Return the mean of e^(-u/r) over the separations u under the pressure sigma_0 e^z.

    r is the range of the attraction. `count` has the number of outer nodes, and the number of inner nodes for
    each outer node.
    """
    stiffness, g_end = gaps.stiffness * jnp.exp(-z), gaps.knots[-1]
    ahead, weight = _outer_nodes(stiffness, g_end, count[0])
    g, rest = g_end * jnp.exp(-ahead), -g_end * jnp.expm1(-ahead)
    X, last = contact_argument(stiffness**2 * g), contact_argument(stiffness**2 * g_end)
    u1, width = _separations(gaps, beyond, stiffness, (g, rest), X, count[1])
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
    """Return ln(g_end / g) at the nodes of the outer integral, and the weights of these nodes."""
    node, weight = (typed(table, g_end) for table in gauss(count))
    # g_end is 0 if there is no roughness; then no area is lost.
    log_end = jnp.log(jnp.maximum(g_end, jnp.finfo(g_end.dtype).tiny))
    length = jnp.maximum(log_end + 2 * jnp.log(stiffness) - math.log(_FIRST), 0.0)
    # Next to q1 the width falls as a square root of g_end - g, which is smooth in the nodes.
    back = (1 - node) ** 2 * (1 + _BEND) / (1 - node + _BEND)
    stretch = (1 - node) * (1 + _BEND) * (1 - node + 2 * _BEND) / (1 - node + _BEND) ** 2
    return length * back, length * stretch * weight


def _separations(gaps, beyond, stiffness, at, X, count):
    """Return the mean separation u1 and the rms height h at the outer nodes.

    `at` is (g, g_end - g) at the outer nodes. `count` is the number of inner nodes for each outer node.
    """
    g, rest = at
    node, weight = (typed(table, g) for table in gauss(count))
    cell = _find_cells(beyond.knots, g)
    U = _evaluate(beyond.knots, beyond.storage, cell, g)
    heights = _evaluate(beyond.knots, beyond.heights, cell, g)
    P, c = contact_fraction(X), loss_factor(X)
    x_end = contact_argument((stiffness * P) ** 2 * rest)
    # The integrand is smooth in a root of x_end / x, down to 0; g' - g falls as the square of x_end / x.
    least = jnp.minimum(x_end / _CLOSEST, 1.0)[:, None] ** (1 / _ROOT)
    root = least + (1 - least) * node
    further = g[:, None] + rest[:, None] * root ** (2 * _ROOT)
    passed = U[:, None] - _evaluate(beyond.knots, beyond.storage, _find_cells(beyond.knots, further), further)
    fall = gaps.lost(jnp.log(x_end)[:, None] - _ROOT * jnp.log(root), c[:, None])
    within = _ROOT * (1 - least) * jnp.sum(weight * fall * passed / root, -1, keepdims=True)
    integral = loss_weight(x_end, c, gaps.gamma) * U - within[:, 0]
    u1 = jnp.pi / 2 * stiffness * P * jnp.maximum(integral, 0.0)
    smallest = jnp.finfo(g.dtype).tiny ** 0.5
    return u1, jnp.sqrt(jnp.maximum(heights, smallest))


def _slopes(knots, values):
    """Return slopes at the knots, from the parabola through each knot and its two neighbours.

    The slope is 0 where knots coincide.
    """
    step = jnp.diff(knots)
    rising = step > 0
    slope = jnp.where(rising, jnp.diff(values) / jnp.where(rising, step, 1.0), 0.0)
    both = step[:-1] + step[1:]
    some = both > 0
    middle = (slope[:-1] * step[1:] + slope[1:] * step[:-1]) / jnp.where(some, both, 1.0)
    return jnp.concatenate([slope[:1], jnp.where(some, middle, 0.0), slope[-1:]])


def _interpolate_beyond(gaps):
    knots, storage, heights = gaps.knots, gaps.storage, gaps.heights
    return _Beyond(knots, (storage, _slopes(knots, storage)), (heights, _slopes(knots, heights)))


def _find_cells(knots, at):
    return jnp.clip(jnp.searchsorted(knots, at, side="right") - 1, 0, knots.shape[0] - 2)


def _evaluate(knots, curve, k, at):
    """Evaluate a curve of `_Beyond` at the values `at`, which lie in the cells k."""
    values, slopes = curve
    step = knots[k + 1] - knots[k]
    some = step > 0
    t = jnp.clip((at - knots[k]) / jnp.where(some, step, 1.0), 0.0, 1.0)
    return cubic(t, values[k], values[k + 1], step * slopes[k], step * slopes[k + 1])
