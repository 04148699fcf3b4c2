r"""Contact with adhesion of long range: the attraction presses the solids together as a load would.

Solids that attract each other over a range r much longer than they are deformed by it [Derjaguin, Muller and
Toporov; of rough solids Persson and Scaraggi, J. Chem. Phys. 141, 124701 (2014), arXiv:1405.3123] touch like
solids without adhesion under the pressure

.. math:: p_\mathrm{rep} = \sigma_0 + p_\mathrm{ad},\qquad
          p_\mathrm{ad} = \int P(u; p_\mathrm{rep})\, p_a(u)\, du,\qquad
          p_a(u) = \frac{\Delta\gamma}{r} e^{-u/r}

P(u) is the share A of the area at u = 0, where the attraction is the same and is borne by the contact, and
what leaves contact at each length scale as `rubberfric.theory.area.separations` has it:

.. math:: p_\mathrm{ad} = \frac{\Delta\gamma}{r}\Big[A
          + \int (-dP)\, \langle e^{-u/r}\rangle_{u_1(q), h(q)}\Big]

p_ad grows with p_rep, from 0 or more to the work over the range. So there is a solution between sigma_0 and
sigma_0 + the work over r, or several: the least is where contact without adhesion goes.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import erf

from rubberfric.base.fixed_points.anderson import implicit
from rubberfric.base.fixed_points.secant import Near, zero
from rubberfric.base.quadrature import gauss, typed
from rubberfric.theory.area.area_correction import CorrectionTable, correct_argument
from rubberfric.theory.area.partial_contact import (
    TWO_OVER_ROOT_PI,
    Pressed,
    contact_argument,
    contact_fraction,
    energy_factor,
)
from rubberfric.theory.area.separations import LossTable, cubic, loss_factor, spread

# Loads that are tried, by an even share of their logarithm, for where the first solution lies; nodes then.
_LOADS, _FEW = 16, (8, 12)

# Nodes of the outer and of the inner integral for one of a contact panel.
_OUTER, _INNER = 2, 3

# G below which hardly an area has left contact (1 - P = 1e-14); 1/x^2 below which k is 0 to 1e-12.
_FIRST, _CLOSEST = 0.0085, 1 / 28.0

# Of the logarithm of the rise of g, up to where k has risen.
_RISE = 4.0

# How near q1 the outer nodes begin to be closer.
_BEND = 0.2


class Gaps(NamedTuple):
    """What the attraction depends on at a point; knots in a row, the last at q1."""

    knots: jax.Array  # ln g, rising
    storage: jax.Array  # U beyond each, 0 at the last [m]
    heights: jax.Array  # mean square of the heights beyond each, 0 at the last [m^2]
    stiffness: jax.Array  # scale over sigma_0
    strength: jax.Array  # work over range and sigma_0
    reach: jax.Array  # the range [m]
    gamma: jax.Array
    correction: CorrectionTable | None
    lost: LossTable


# Axes of points.
_POINTS = Gaps._make([0, 0, 0, 0, 0, None, None, None, None])


class _Nodes(NamedTuple):
    """Of the outer integral over ln g, (m,), and of the inner ones over the logarithm of its rise, (m, n)."""

    g: jax.Array
    weight: jax.Array
    width: jax.Array  # h there
    log_rise: jax.Array  # half the logarithm of the rise
    storage: jax.Array  # U beyond, times the weight


def attract(gaps: Gaps, order: int) -> Pressed:
    """Solve for the load that the contact bears.

    Parameters
    ----------
    gaps : Gaps of points, which are the first axis of its arrays; gamma and the correction are of all
    order : nodes of a contact panel, to which those here are in proportion

    Returns
    -------
    Pressed, of the least load if there are several; derivatives implicit
    """
    count = _counts(order)
    still = jax.lax.stop_gradient(gaps)
    near = jax.vmap(_bracket, (_POINTS,))(still)

    def log_load(gaps, about, z):
        nodes = _nodes(gaps, about, count)
        return jnp.log1p(gaps.strength * _share(gaps, nodes, z))

    def searched(gaps, near):
        nodes = jax.lax.optimization_barrier(_nodes(gaps, near.start, count))

        def excess(z):
            return z - jnp.log1p(gaps.strength * _share(gaps, nodes, z))

        return zero(excess, near, jnp.log1p(gaps.strength))[:2]

    solution, converged = jax.vmap(searched, (_POINTS, 0))(still, near)

    def balance(z):
        return jax.vmap(log_load, (_POINTS, 0, 0))(gaps, near.start, z[:, 0])[:, None]

    return Pressed(jnp.exp(implicit(balance, solution[:, None])[:, 0]), converged)


def attraction(gaps: Gaps, order: int) -> jax.Array:
    """The attraction over that of full contact, <e^-u/r>, of contact that bears sigma_0 alone, (points,)."""

    def share(gaps):
        none = jnp.zeros_like(gaps.stiffness)
        return _share(gaps, _nodes(gaps, none, _counts(order)), none)

    return jax.vmap(share, (_POINTS,))(gaps)


def _counts(order):
    return _OUTER * order, _INNER * order


def _bracket(gaps):
    """`Near` the least solution.

    Loads are logarithms of p_rep over sigma_0.
    """
    loads = jnp.log1p(gaps.strength) * typed(np.linspace(0.0, 1.0, _LOADS), gaps.strength)
    nodes = _nodes(gaps, jnp.zeros_like(gaps.strength), _FEW)
    excess = loads - jnp.log1p(gaps.strength * jax.vmap(lambda z: _share(gaps, nodes, z))(loads))
    # The last is one: no attraction is stronger than that of contact.
    after = jnp.argmax((excess > 0).at[-1].set(True).at[0].set(False))
    low, high = excess[after - 1], excess[after]
    rise, step = high - low, loads[after] - loads[after - 1]
    share = jnp.where(rise > 0, -low / jnp.where(rise > 0, rise, 1.0), 0.5)
    start = loads[after - 1] + jnp.clip(share, 0.0, 1.0) * step
    slope = jnp.where(step > 0, rise / jnp.where(step > 0, step, 1.0), 1.0)
    # Of so few nodes it may lie next to it.
    return Near(start, loads[jnp.maximum(after - 2, 0)], loads[jnp.minimum(after + 1, _LOADS - 1)], slope)


def _share(gaps, nodes, z):
    """Attraction over that of full contact, at a load of which z is the logarithm over sigma_0."""
    stiffness = gaps.stiffness * jnp.exp(-z)
    X = contact_argument(stiffness**2 * nodes.g)
    P = contact_fraction(X)
    log_x = -jnp.log(2 * stiffness * P)[:, None] - nodes.log_rise
    slope = gaps.lost(log_x, loss_factor(X)[:, None])
    u1 = jnp.pi / 2 * stiffness * P * jnp.sum(0.5 * slope * nodes.storage, -1)
    lost, corrected, last = 1.0, X, contact_argument(stiffness**2 * jnp.exp(gaps.knots[-1]))
    if gaps.correction is not None:
        corrected, last = correct_argument(gaps.correction, X), correct_argument(gaps.correction, last)
        lost = energy_factor(contact_fraction(corrected), gaps.gamma) * (corrected / X) ** 2
    # -dP / d ln g
    lost = lost * 0.5 * TWO_OVER_ROOT_PI * corrected * jnp.exp(-corrected * corrected)
    found = spread(jnp.maximum(u1, 0.0), nodes.width, gaps.reach)
    return contact_fraction(last) + jnp.sum(nodes.weight * lost * found)


def _nodes(gaps, z, count):
    """`_Nodes` about the load z, so many of the outer and of each inner integral."""
    node, weight = (typed(table, gaps.knots) for table in gauss(count[0]))
    end, stiffness = gaps.knots[-1], gaps.stiffness * jnp.exp(-z)
    g_end = jnp.exp(end)
    begin = jnp.minimum(jnp.log(_FIRST) - 2 * jnp.log(stiffness), end)
    # Next to q1 the heights beyond go as a square root, which is smooth in the nodes.
    back = (1 - node) ** 2 * (1 + _BEND) / (1 - node + _BEND)
    stretch = (1 - node) * (1 + _BEND) * (1 - node + 2 * _BEND) / (1 - node + _BEND) ** 2
    at = end - (end - begin) * back
    # Heights and U are of the same knots.
    slopes = [_slopes(gaps.knots, values) for values in (gaps.storage, gaps.heights)]
    heights = _between(gaps.knots, gaps.heights, slopes[1], at)
    g = jnp.exp(at)
    P = erf(contact_argument(stiffness**2 * g))
    most = jnp.maximum(g_end - g, 0.0)
    least = jnp.minimum(_CLOSEST / (2 * stiffness * P) ** 2, most)
    some = most > 0
    least = jnp.log(jnp.where(some, least, 1.0))
    ratio = jnp.log(jnp.where(some, most, 1.0)) - least
    # k rises within the first e-folds, which have half of the nodes.
    first = jnp.minimum(ratio, _RISE)
    half, half_weight = (typed(table, ratio) for table in gauss(count[1] // 2))
    parts = jnp.stack([first, ratio - first], -1)[..., None]
    ahead = jnp.stack([0 * first, first], -1)[..., None] + parts * half
    log_rise = least[:, None] + ahead.reshape(count[0], -1)
    inner_weight = (parts * half_weight).reshape(count[0], -1)
    beyond = _between(gaps.knots, gaps.storage, slopes[0], jnp.log(g[:, None] + jnp.exp(log_rise)))
    smallest = jnp.finfo(g.dtype).tiny ** 0.5
    width = jnp.sqrt(jnp.maximum(heights, smallest))
    return _Nodes(g, (end - begin) * stretch * weight, width, 0.5 * log_rise, inner_weight * beyond)


def _slopes(knots, values):
    """Slopes at the knots, of the parabola through each and its neighbours; 0 where knots coincide."""
    step = jnp.diff(knots)
    rising = step > 0
    slope = jnp.where(rising, jnp.diff(values) / jnp.where(rising, step, 1.0), 0.0)
    both = step[:-1] + step[1:]
    some = both > 0
    middle = (slope[:-1] * step[1:] + slope[1:] * step[:-1]) / jnp.where(some, both, 1.0)
    return jnp.concatenate([slope[:1], jnp.where(some, middle, 0.0), slope[-1:]])


def _between(knots, values, slopes, at):
    """Cubic Hermite interpolation; before the first knot its value."""
    k = jnp.clip(jnp.searchsorted(knots, at, side="right") - 1, 0, knots.shape[0] - 2)
    step = knots[k + 1] - knots[k]
    some = step > 0
    t = jnp.clip((at - knots[k]) / jnp.where(some, step, 1.0), 0.0, 1.0)
    return cubic(t, values[k], values[k + 1], step * slopes[k], step * slopes[k + 1])
