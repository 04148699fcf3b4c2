r"""A Prony solid in series with a spring is a Prony solid with the same number of terms.

For f(s) = f_rest + sum_i f_i s/(s + l_i), rates l_i = 1/tau_i, and a spring k,

.. math:: \frac{k f}{k + f} = \frac{k f_\infty}{k + f_\infty} + \sum_i f_i' \frac{s}{s + l_i'}

with one new rate l' in every interval between neighbouring old rates (the first between 0 and l_1). The l'
are the roots of k + f(-l') = 0. The weights are f_i' = k^2 / (l_i' F_i) with
F_i = sum_j f_j l_j / (l_j - l_i')^2. Each root is l' = own (anchor + distance), where own is the rate at the
nearer end of the interval and anchor is 1, as in LAPACK's laed4 [R.-C. Li, LAPACK Working Note 89 (1993)]. If
the first root is near 0, anchor is 0. l' alone would lose all digits of the distance for k >> f, and of the
first rate for k << f.

Rates enter only as logarithms and quotients. Terms whose rate is own are summed separately if anchor is 1.
Squares of rates or distances would overflow float32 with 40 decades of times or a spring 1e12 times stiffer
than the solid.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

# Bisections of the logarithm of a distance leave an error of 5e-8, which each Newton step squares.
HALVINGS, NEWTON_STEPS = 32, 2


class _Roots(NamedTuple):
    """Roots l' = rate[pole] (anchor + distance), where all arrays have the shape (n,)."""

    pole: jax.Array
    anchor: jax.Array  # 1: measured from rate[pole]; 0: measured from 0 (only the first root)
    distance: jax.Array  # negative if l' < rate[pole] * anchor


class _Rates(NamedTuple):
    """Differences of all rates l_j from all roots, divided by m = max(l_j, own).

    The rate of the pole that belongs to a root is called own. The arrays have a row for each root and a
    column for each rate.
    """

    at_anchor: jax.Array  # True if the root is measured from l_j
    below: jax.Array  # own / m
    above: jax.Array  # l_j / m
    apart: jax.Array  # (l_j - anchor own) / m, without cancellation


def in_series(
    rest: jax.Array, weight: jax.Array, tau: jax.Array, spring: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Return the Prony series of a solid in series with a spring.

    Parameters
    ----------
    rest : f_inf >= 0, shape () or (nodes,)
    weight : f_i >= 0, shape (n,) or (nodes, n)
    tau : [s], shape (n,), any order
    spring : k >= 0, same unit as the moduli, shape () or (nodes,)

    Returns
    -------
    rest, weight, tau of the series solid. rest has the shape of the spring. weight and tau have a further
    axis of length n.

    Limits: in float32 neighbouring times at most 30 decades apart, spring / solid 1e-30 ... 1e16.
    """
    order = jnp.argsort(-tau)
    weight, tau = weight[..., order], tau[order]
    # In the middle of the spectrum, so that logarithms of the rates keep their digits.
    middle = jax.lax.stop_gradient(jnp.sqrt(tau[0]) * jnp.sqrt(tau[-1]))
    solve = functools.partial(_one_spring, log_rate=-jnp.log(tau / middle), tau=tau)
    found = jax.vmap(solve)(rest, weight, spring) if spring.ndim else solve(rest, weight, spring)
    # Otherwise XLA computes the series again wherever it is used, which doubles the time of a gradient.
    return jax.lax.optimization_barrier(found)


def _one_spring(rest, weight, spring, log_rate, tau):
    # A term or spring of zero stiffness would put a root on a pole (0/0) with a spurious mode. See `floors`
    # for terms. A spring has a floor of 1e-60 of the solid (float32: 1e-30). The floor does not change
    # its derivative.
    solid = rest + jnp.sum(weight)
    solid = jax.lax.stop_gradient(jnp.where(solid > 0, solid, jnp.where(spring > 0, spring, 1.0)))
    unit = jax.lax.stop_gradient(jnp.maximum(solid, spring))
    weight = weight + solid * floors(weight / solid, log_rate)
    least = solid * (1e-30 if tau.dtype != jnp.float64 else 1e-60)
    # The share is 0 without a spring, where a solid softer than the floor would remain. Where it is 1 to
    # rounding it is a constant, because its two halves would leave a rounding error of k/f in reverse mode.
    share = jnp.where(spring > 1e17 * least, 1.0, quotient(spring, spring + least))
    spring = spring + least
    # In units of the stiffer of the two, so that no reciprocal of a spring of 1e-30 is squared.
    rest, weight, spring = rest / unit, weight / unit, spring / unit
    log_rate, tau = _as_one(weight, log_rate, tau)
    roots = _roots(rest, weight, spring, log_rate)
    rates = _seen_from(roots, log_rate)
    empty = _empty(log_rate)
    relative = jnp.where(empty, 1.0, roots.anchor + roots.distance)
    new_weight = jnp.where(empty, 0.0, _weights_at(roots, rest, weight, spring, rates))
    soft, hard = jnp.minimum(spring, rest), jnp.maximum(spring, rest)
    unit = unit * share
    return unit * (soft / (1 + soft / hard)), unit * new_weight, tau[roots.pole] / relative


def floors(weight: jax.Array, log_rate: jax.Array) -> jax.Array:
    """Return small weights that are added to the terms of a series, so that no weight is 0.

    At every frequency the loss of an added weight is below 1e-30 (float32: 1e-16) of the loss of the series.
    For this, the weight added at tau_i is 1e-30 (float32: 1e-16) times the sum over j of w_j r_ij with
    r_ij = min(tau_i/tau_j, tau_j/tau_i). The loss of a term at tau_j is at least r_ij times the loss of an
    equal term at tau_i. A constant added weight would exceed the series far from the times of the series.

    Parameters
    ----------
    weight : weights of the terms divided by the stiffness of the solid [-], shape (n,)
    log_rate : logarithms of the rates, any order [-], shape (n,)

    Limits: a floor is at least 1e-75 (float32: 1e-22), also if all weights are 0.
    """
    least, small = (1e-75, 1e-30) if weight.dtype == jnp.float64 else (1e-22, 1e-16)
    shares = jnp.exp(-jnp.abs(log_rate[:, None] - log_rate))
    return jax.lax.stop_gradient(jnp.maximum(small * (shares @ weight), least))


def _as_one(weight, log_rate, tau):
    """Return `log_rate` and `tau` with derivatives that keep equal times equal.

    The derivative of a rate is replaced by the weighted mean of the derivatives of all equal rates. The
    result is exact in the moduli to all orders and in the times to first order. Second derivatives omit the
    splitting of equal times. The splitting would be a difference of numbers that are larger by k/f, 1e19 for
    a film on rubber.
    """
    same = log_rate == log_rate[:, None]
    # Squares of weights of 1e-30 underflow float32.
    share = quotient(weight, jnp.sum(jnp.where(same, weight, 0.0), -1))
    still = jax.lax.stop_gradient(log_rate)
    moved = jnp.sum(jnp.where(same, share * (log_rate - still), 0.0), -1)
    return still + moved, jax.lax.stop_gradient(tau) * jnp.exp(-moved)


@jax.custom_jvp
def quotient(x: jax.Array, y: jax.Array) -> jax.Array:
    """Return x / y [-] with a derivative that does not square y, because y^2 may overflow float32."""
    return x / y


@quotient.defjvp
def _quotient_jvp(primals, tangents):
    (x, y), (dx, dy) = primals, tangents
    return x / y, (dx - x / y * dy) / y


def _empty(log_rate):
    """Return a mask of the intervals between two equal rates, where the new term has zero weight."""
    return jnp.concatenate([jnp.zeros(1, bool), log_rate[1:] == log_rate[:-1]])


def _seen_from(roots, log_rate):
    anchored = roots.anchor[:, None] > 0
    ahead = log_rate - log_rate[roots.pole][:, None]
    at_anchor = anchored & (ahead == 0)
    above = jnp.exp(jnp.minimum(ahead, 0.0))
    return _Rates(
        at_anchor,
        jnp.exp(-jnp.maximum(ahead, 0.0)),
        above,
        jnp.where(anchored, jnp.sign(ahead) * -jnp.expm1(-jnp.abs(ahead)), above),
    )


def _gap(rates, roots):
    """Return (l_j - l') / m without cancellation, where m is defined in `_Rates`.

    The entry is 1 if a root is measured from l_j, because terms with this rate are summed separately.
    """
    return jnp.where(rates.at_anchor, 1.0, rates.apart - roots.distance[:, None] * rates.below)


def _balance(rest, weight, spring, rates, roots):
    """Return `roots.distance` times (k + f(-l')) for every root, of shape (roots,).

    The product is finite if the distance is 0. For a root with `roots.anchor` = 0, the factor is 1 instead of
    the distance.
    """
    relative = roots.anchor + roots.distance
    own = jnp.sum(jnp.where(rates.at_anchor, weight, 0.0), -1)
    others = jnp.sum(jnp.where(rates.at_anchor, 0.0, weight * rates.below / _gap(rates, roots)), -1)
    away = jnp.where(roots.anchor > 0, roots.distance, 1.0)
    return away * (spring + rest - relative * others) + relative * own


def _weights_at(roots, rest, weight, spring, rates):
    """Return the weight k^2 / (l' F) for every root, with F = sum_j f_j l_j / (l_j - l')^2."""
    size, relative = jnp.abs(roots.distance), roots.anchor + roots.distance
    own = jnp.sum(jnp.where(rates.at_anchor, weight, 0.0), -1)
    nearness = 1 / _gap(rates, roots)
    others = jnp.where(rates.at_anchor, 0.0, weight * rates.below * nearness)
    steeper = jnp.sum(others * rates.above * nearness, -1)
    # F own distance^2 = own + distance^2 steeper, by parts, because either square may leave float32.
    per_size = quotient(own, size) + size * steeper
    plain = spring * quotient(spring, per_size) * quotient(size, relative)
    # With a stiff spring the new weights nearly equal the old ones and change by (f/k)^2 with k, which would
    # be a difference of numbers of order f/k. With k = -f(-l') nothing is divided by the distance. All terms
    # are smaller than k, so the sum keeps all digits.
    stiff = (roots.anchor > 0) & (rest + relative * jnp.sum(jnp.abs(others), -1) < spring)
    times_size = relative * own + size * (relative * jnp.sum(others, -1) - rest)
    bottom = jnp.where(stiff, own + size * (size * steeper), 1.0)
    return jnp.where(stiff, times_size * quotient(times_size, bottom) / relative, plain)


@jax.custom_jvp
def _roots(rest, weight, spring, log_rate):
    """Return the root of k + f(-l') in each interval between rates, which are in ascending order.

    Between two neighbouring rates, k + f(-l') decreases from +inf to -inf.
    """
    index = jnp.arange(log_rate.shape[0])
    left, first = jnp.maximum(index - 1, 0), index == 0
    width = log_rate - log_rate[left]
    # The sign in the middle of the interval shows which end is nearer.
    half = 0.5 * jnp.where(first, 1.0, -jnp.expm1(-width))
    middle = _Roots(index, jnp.ones_like(half), -half)
    # Negative distance times the function.
    right = _balance(rest, weight, spring, _seen_from(middle, log_rate), middle) < 0
    sign = jnp.where(right, -1.0, 1.0).astype(half.dtype)
    anchor = jnp.where(right | ~first, 1.0, 0.0).astype(half.dtype)
    roots = _Roots(jnp.where(right, index, left), anchor, sign)
    rates = _seen_from(roots, log_rate)
    # `_balance` without the parts that are constant in the iteration.
    own = jnp.sum(jnp.where(rates.at_anchor, weight, 0.0), -1)
    apart = jnp.where(rates.at_anchor, 1.0, rates.apart)
    below = jnp.where(rates.at_anchor, 0.0, rates.below)

    def terms(distance):
        gap = apart - distance[:, None] * below
        return gap, jnp.sum(weight * below / gap, -1)

    def balance(distance, others):
        relative, away = anchor + distance, jnp.where(anchor > 0, distance, 1.0)
        return away * (spring + rest - relative * others) + relative * own

    def halve(_, bounds):
        low, high = bounds
        middle = jnp.sqrt(low) * jnp.sqrt(high)
        distance = sign * middle
        value = sign * balance(distance, terms(distance)[1])
        further = jnp.where(right, value < 0, value > 0)
        return jnp.where(further, middle, low), jnp.where(further, high, middle)

    # Smaller than the distances of the smallest weights.
    low = jnp.full_like(half, 1e-200 if half.dtype == jnp.float64 else 1e-36)
    high = half * jnp.where(right | first, 1.0, jnp.exp(width))
    low, high = jax.lax.fori_loop(0, HALVINGS, halve, (low, high))
    distance = sign * jnp.sqrt(low) * jnp.sqrt(high)
    # An empty interval has no root; l' = -own is far from every pole.
    distance = jnp.where(_empty(log_rate), -2.0, distance)
    for _ in range(NEWTON_STEPS):
        gap, others = terms(distance)
        relative, steeper = anchor + distance, jnp.sum(weight * (below / gap) ** 2, -1)
        inner = -others - relative * steeper
        slope = jnp.where(anchor > 0, spring + rest - relative * others + distance * inner + own, inner)
        step = jnp.where(_empty(log_rate), 0.0, balance(distance, others) / slope)
        distance = distance - step
    return roots._replace(distance=distance)


@_roots.defjvp
def _roots_jvp(primals, tangents):
    roots = _roots(*primals)

    def at(rest, weight, spring, log_rate, distance):
        moved = roots._replace(distance=distance)
        return _balance(rest, weight, spring, _seen_from(roots, log_rate), moved)

    still, one = jnp.zeros_like(roots.distance), jnp.ones_like(roots.distance)
    _, by_parameters = jax.jvp(at, (*primals, roots.distance), (*tangents, still))
    _, by_distance = jax.jvp(functools.partial(at, *primals), (roots.distance,), (one,))
    fixed = jnp.zeros(roots.pole.shape, jax.dtypes.float0)
    return roots, _Roots(fixed, jnp.zeros_like(roots.anchor), -by_parameters / by_distance)
