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

from rubberfric.base.fixed_points import implicit
from rubberfric.base.logarithms import floored_log
from rubberfric.base.quadrature import gauss, typed
from rubberfric.base.roots import first, zero
from rubberfric.theory.area.area_correction import UniformTable, correct_argument
from rubberfric.theory.area.partial_contact import (
    TWO_OVER_ROOT_PI,
    AdhesiveLoad,
    contact_argument,
    contact_fraction,
    energy_factor,
)
from rubberfric.theory.area.separations import LossTable, cubic, loss_factor, loss_weight, spread

# Number of loads, evenly spaced in ln p, that bracket the first solution.
_LOADS = 12

# Outer and inner nodes for these loads.
_FEW = 8, 8

# Outer nodes per node of a contact panel.
_OUTER = 3

# Inner nodes per node of a contact panel.
_INNER = 2

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
    correction: UniformTable | None
    lost: LossTable


class _Beyond(NamedTuple):
    """U and the mean square height beyond g, as cubic Hermite polynomials between the knots."""

    knots: jax.Array
    storage: tuple[jax.Array, jax.Array]  # values and slopes at the knots
    heights: tuple[jax.Array, jax.Array]


class _Nodes(NamedTuple):
    """Nodes of the outer integral over g, (outer,), and of the inner ones over g', (outer, inner)."""

    g: jax.Array
    rest: jax.Array  # g_end - g
    weight: jax.Array
    storage: jax.Array  # U(g)
    width: jax.Array  # h, rms height beyond g
    log_root: jax.Array  # ln of the root of x_end / x in which the inner nodes are spaced
    passed: jax.Array  # V = U(g) - U(g'), times the weight in ln x


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
        beyond = jax.lax.optimization_barrier(_interpolate_beyond(gaps))

        def excess_of_few(z):
            # The nodes follow each load: nodes placed for another load miss where contact is lost.
            return z - _log_load(gaps, _nodes(gaps, beyond, z, _FEW), z)

        top = jnp.log1p(gaps.strength)
        near = zero(excess_of_few, first(excess_of_few, top, _LOADS), top)[2]
        # The solution is so close to `near` that its nodes serve all further loads.
        nodes = jax.lax.optimization_barrier(_nodes(gaps, beyond, near.start, count))
        return zero(lambda z: z - _log_load(gaps, nodes, z), near, top)[:2]

    solution, converged = jax.vmap(solved, (_POINTS,))(still)

    def log_load(gaps, about, z):
        return _log_load(gaps, _nodes(gaps, _interpolate_beyond(gaps), about, count), z)

    def balance(z):
        return jax.vmap(log_load, (_POINTS, 0, 0))(gaps, solution, z[:, 0])[:, None]

    return AdhesiveLoad(jnp.exp(implicit(balance, solution[:, None])[:, 0]), converged)


def evaluate_attraction(gaps: Gaps, order: int) -> jax.Array:
    """Return the mean of e^(-u/r) over the separations u under the pressure sigma_0.

    r is the range of the attraction. The mean equals p_ad divided by work / r, and has the shape (points,).
    Arguments are as for `solve_dmt_load`.
    """

    def share(gaps):
        none = jnp.zeros_like(gaps.stiffness)
        return _share(gaps, _nodes(gaps, _interpolate_beyond(gaps), none, _counts(order)), none)

    return jax.vmap(share, (_POINTS,))(gaps)


def _counts(order):
    return _OUTER * order, _INNER * order


def _log_load(gaps, nodes, z):
    """Return ln(1 + p_ad / sigma_0) in the contact under the pressure sigma_0 e^z."""
    return jnp.log1p(gaps.strength * _share(gaps, nodes, z))


def _share(gaps, nodes, z):
    """Return the mean of e^(-u/r) over the separations u under the pressure sigma_0 e^z.

    r is the range of the attraction. The nodes were placed for a similar pressure.
    """
    stiffness, g_end = gaps.stiffness * jnp.exp(-z), gaps.knots[-1]
    X, last = contact_argument(stiffness**2 * nodes.g), contact_argument(stiffness**2 * g_end)
    u1 = _mean_separation(gaps, nodes, stiffness, X)
    lost, corrected = 1.0, X
    if gaps.correction is not None:
        corrected, last = correct_argument(gaps.correction, X), correct_argument(gaps.correction, last)
        lost = energy_factor(contact_fraction(corrected), gaps.gamma) * (corrected / X) ** 2
    # -dP / d ln g
    lost = lost * 0.5 * TWO_OVER_ROOT_PI * corrected * jnp.exp(-corrected * corrected)
    share = contact_fraction(last) + jnp.sum(nodes.weight * lost * spread(u1, nodes.width, gaps.reach))
    # Errors of the quadrature must not make p_ad exceed its bound, beyond which no load is tried.
    return jnp.minimum(share, 1.0)


def _mean_separation(gaps, nodes, stiffness, X):
    """Return u1 at the outer nodes."""
    P, c = contact_fraction(X), loss_factor(X)
    x_end = contact_argument((stiffness * P) ** 2 * nodes.rest)
    fall = gaps.lost(jnp.log(x_end)[:, None] - _ROOT * nodes.log_root, c[:, None])
    integral = loss_weight(x_end, c, gaps.gamma) * nodes.storage - jnp.sum(fall * nodes.passed, -1)
    return 0.5 * stiffness * P * jnp.maximum(integral, 0.0)


def _nodes(gaps, beyond, z, count):
    """Place the nodes of both integrals for the pressure sigma_0 e^z.

    `count` has the number of outer nodes, and the number of inner nodes for each outer node.
    """
    stiffness, g_end = gaps.stiffness * jnp.exp(-z), gaps.knots[-1]
    ahead, outer_weight = _outer_nodes(stiffness, g_end, count[0])
    g, rest = g_end * jnp.exp(-ahead), -g_end * jnp.expm1(-ahead)
    cell = _find_cells(beyond.knots, g)
    U = _evaluate(beyond.knots, beyond.storage, cell, g)
    heights = _evaluate(beyond.knots, beyond.heights, cell, g)
    x_end = contact_argument((stiffness * contact_fraction(contact_argument(stiffness**2 * g))) ** 2 * rest)
    node, weight = (typed(table, g) for table in gauss(count[1]))
    # The integrand is smooth in a root of x_end / x, down to 0; g' - g falls as the square of x_end / x.
    least = jnp.minimum(x_end / _CLOSEST, 1.0)[:, None] ** (1 / _ROOT)
    root = least + (1 - least) * node
    further = g[:, None] + rest[:, None] * root ** (2 * _ROOT)
    passed = U[:, None] - _evaluate(beyond.knots, beyond.storage, _find_cells(beyond.knots, further), further)
    passed = _ROOT * (1 - least) * weight * passed / root
    smallest = jnp.finfo(g.dtype).tiny ** 0.5
    width = jnp.sqrt(jnp.maximum(heights, smallest))
    return _Nodes(g, rest, outer_weight, U, width, jnp.log(root), passed)


def _outer_nodes(stiffness, g_end, count):
    """Return ln(g_end / g) at the nodes of the outer integral, and the weights of these nodes."""
    node, weight = (typed(table, g_end) for table in gauss(count))
    # g_end is 0 if there is no roughness; then no area is lost.
    length = jnp.maximum(floored_log(g_end) + 2 * jnp.log(stiffness) - math.log(_FIRST), 0.0)
    # Next to q1 the width falls as a square root of g_end - g, which is smooth in the nodes.
    back = (1 - node) ** 2 * (1 + _BEND) / (1 - node + _BEND)
    stretch = (1 - node) * (1 + _BEND) * (1 - node + 2 * _BEND) / (1 - node + _BEND) ** 2
    return length * back, length * stretch * weight


@jax.custom_jvp
def _divide(numerator, denominator):
    return numerator / denominator


@_divide.defjvp
def _divide_jvp(primals, tangents):
    # The rule of JAX squares the denominator, which underflows in float32 for the innermost knots.
    ratio = _divide(*primals)
    return ratio, _divide(tangents[0] - ratio * tangents[1], primals[1])


def _slopes(knots, values):
    """Return slopes at the knots, from the parabola through each knot and its two neighbours.

    The slope is 0 where knots coincide.
    """
    step = jnp.diff(knots)
    rising = step > 0
    slope = jnp.where(rising, _divide(jnp.diff(values), jnp.where(rising, step, 1.0)), 0.0)
    both = step[:-1] + step[1:]
    some = both > 0
    share = _divide(step[1:], jnp.where(some, both, 1.0))
    middle = slope[1:] + share * (slope[:-1] - slope[1:])
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
    t = jnp.clip(_divide(at - knots[k], jnp.where(some, step, 1.0)), 0.0, 1.0)
    return cubic(t, values[k], values[k + 1], step * slopes[k], step * slopes[k + 1])
