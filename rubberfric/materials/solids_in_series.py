r"""Two solids in series are a Prony solid if each is a Prony solid or a spring (eq. (A6)).

For f(s) = f_rest + sum_i f_i s/(s + l_i) and g likewise,

.. math:: \frac{f g}{f + g} = \frac{f_\infty g_\infty}{f_\infty + g_\infty} + \sum_i h_i \frac{s}{s + l_i'}

with one rate l' in every interval between neighbouring rates of both solids. The first lies between 0 and the
slowest rate. The l' are the zeros of f + g, where f = -g. With the weights w_j of both solids,

.. math:: h_i = \frac{f(-l_i')^2}{l_i' F_i},\qquad F_i = \sum_j w_j l_j / (l_j - l_i')^2

A rate is stored by its shares theta and phi of the interval, l' = left + theta width = right - phi width. The
smaller share is stored as its logarithm. The equation f + g = 0 is multiplied by theta phi width / l':

.. math:: H = \varphi \sum_{left} w_j A_j - \theta \sum_{right} w_j A_j = 0,\qquad
          A_j = \frac{\theta\,width}{l' - l_j}\ \text{or}\ \frac{\varphi\,width}{l_j - l'}

f_rest + g_rest is the weight of the rate 0. All A_j lie between 0 and 1. Nothing is singular if both solids
have a common rate: the interval has zero width, theta = f_i / (f_i + g_j), and the term has the weight
f_i g_j / (f_i + g_j). A spring has a rest and no terms.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero

# Bisections of the logarithm of a share leave an error of 1e-4. Secant steps reduce it to 1e-8, 1e-12, 1e-20.
_HALVINGS, _SECANTS = 22, 4

Solid = tuple[jax.Array, jax.Array, jax.Array]  # rest, weight, tau


class _Rates(NamedTuple):
    """Positions of all rates l_j relative to all intervals, as quotients that do not overflow.

    Two-dimensional arrays have a row for each interval and a column for each rate. A_j is reach / (base +
    reach), where reach is theta times slope for rates on the left side, and phi times slope otherwise.
    """

    left: jax.Array  # True if l_j <= left end
    own: jax.Array  # True if l_j is an end of the interval
    nearer: jax.Array  # slower / faster of l_j and the nearer end of the interval, <= 1
    base: jax.Array
    slope: jax.Array
    low: jax.Array  # left end divided by right end, shape (rows,); 0 for the first interval
    width: jax.Array  # 1 - low, without cancellation for close ends


class _Solids(NamedTuple):
    """Rests and weights of two solids over a common list of rates, with 0 at rates of the other solid."""

    rest: tuple
    weight: tuple  # None for a spring

    @property
    def total(self) -> tuple[Any, Any]:
        """Return the sum of the rests and the sum of the weights."""
        return sum(self.rest), sum(w for w in self.weight if w is not None)


def two_in_series(first: Solid, second: Solid) -> Solid:
    """Return the Prony series of two solids in series.

    Parameters
    ----------
    first, second : (rest, weight, tau) of each solid
        rest >= 0, shape () or (nodes,); weight >= 0, shape (n,) or (nodes, n), n >= 0; tau [s],
        shape (n,) or (nodes, n), any order, equal values allowed.

    Returns
    -------
    rest, weight, tau of the series solid, which has as many terms as both solids together. The shapes are
    (nodes,), (nodes, terms) and (nodes, terms). They lack the axis of nodes if no argument has this axis.

    Limits: in float32 neighbouring times at most 30 decades apart, ratios of the moduli 1e-30 ... 1e16.
    """
    ranks = (0, 1, 1)
    axes = tuple(
        tuple(0 if jnp.ndim(x) > rank else None for x, rank in zip(solid, ranks, strict=True))
        for solid in (first, second)
    )
    by_node = any(axis == 0 for solid in axes for axis in solid)
    return jax.vmap(_pair, in_axes=axes)(first, second) if by_node else _pair(first, second)


def in_series(solid: Solid, spring: jax.Array) -> Solid:
    """Return the Prony series of a solid in series with a spring >= 0, of shape () or (nodes,).

    `two_in_series` describes the shapes.
    """
    nothing = jnp.zeros(0, solid[2].dtype)
    # Otherwise XLA computes the series again wherever it is used, which doubles the time of a gradient.
    return jax.lax.optimization_barrier(two_in_series(solid, (spring, nothing, nothing)))


def _pair(first, second):
    tau = jnp.concatenate([first[2], second[2]])
    # Relative to the middle of the spectrum, so that logarithms of the rates keep their digits.
    middle = jax.lax.stop_gradient(jnp.sqrt(jnp.min(tau)) * jnp.sqrt(jnp.max(tau)))
    slowest = jax.lax.stop_gradient(-jnp.log(jnp.max(tau) / middle))
    parts = []
    for i, (_, weight, tau) in enumerate((first, second)):
        # Terms left over by equal times are placed away from all other rates.
        parked = slowest - 1 - i - 2 * jnp.arange(tau.shape[0], dtype=tau.dtype)
        parts.append(_distinct(weight, tau, -jnp.log(tau / middle), parked))
    weights, taus, log_rates, fixed = zip(*parts, strict=True)
    solids, unit = _floored((first[0], second[0]), weights, fixed)
    tau, log_rate = jnp.concatenate(taus), jnp.concatenate(log_rates)
    order = jnp.argsort(jnp.concatenate(fixed))  # the same for all nodes if tau is
    ordered = tuple(None if w is None else w[order] for w in solids.weight)
    weight, relative = _solve(_Solids(solids.rest, ordered), log_rate[order])
    soft, hard = jnp.minimum(first[0], second[0]), jnp.maximum(first[0], second[0])
    # soft / (1 + soft/hard) has no product that overflows, and is 0 for two liquids.
    rest = soft / (1 + soft / jnp.where(hard > 0, hard, 1.0))
    return rest, unit * weight, tau[order] / relative


def _distinct(weight, tau, log_rate, parked):
    """Merge the terms of a Prony series that have equal times.

    A merged term has the sum of the weights of its terms. If the equal times change, the logarithm of the
    merged time changes by the mean of the changes, weighted with the weights of the terms. Derivatives
    therefore agree with separate terms to all orders of the moduli. The number of terms stays the same: terms
    that are no longer needed get zero weight and the logarithmic rates `parked`. The last result is the
    logarithmic rates without derivatives.
    """
    count = tau.shape[0]
    if count < 2:
        return weight, tau, log_rate, jax.lax.stop_gradient(log_rate)
    order = jnp.argsort(log_rate)
    weight, tau, log_rate = weight[order], tau[order], log_rate[order]
    index = jnp.arange(count)
    group = jnp.cumsum(jnp.append(False, log_rate[1:] != log_rate[:-1]))
    # Dense sums over each group, because batched scatters are slow. A row is a group.
    member = group == index[:, None]
    total = jnp.sum(jnp.where(member, weight, 0.0), -1)
    whole, size = total[group], jnp.sum(member, -1)[group]
    # Terms with zero weight have equal shares.
    share = jnp.where(
        whole > 0, _quotient(weight, jnp.where(whole > 0, whole, 1.0)), 1 / size.astype(weight.dtype)
    )
    change = share * (log_rate - jax.lax.stop_gradient(log_rate))
    moved = jnp.sum(jnp.where(member, change, 0.0), -1)
    filled = index <= group[-1]
    at = jnp.max(jnp.where(member, index, 0), -1)  # one term per group
    still = jax.lax.stop_gradient(log_rate[at])
    fixed = jnp.where(filled, still, parked)
    moved = jnp.where(filled, moved, 0.0)
    away = fixed - still  # 0 for a group
    return total, jax.lax.stop_gradient(tau[at]) * jnp.exp(-away - moved), fixed + moved, fixed


def _floored(rests, weights, log_rates):
    """Return the `_Solids` with positive moduli in units of the stiffer solid, and this unit.

    A term or rest of zero stiffness would put a root on a rate (0/0). Small constants are therefore added,
    which do not change derivatives. `_floors` determines the constants of the terms. The constant of a rest
    is 1e-60 of the stiffness of the solid (float32: 1e-30).
    """
    tiny = 1e-60 if weights[0].dtype == jnp.float64 else 1e-30
    sizes = [rest + jnp.sum(weight) for rest, weight in zip(rests, weights, strict=True)]
    largest = jnp.maximum(*sizes)
    largest = jax.lax.stop_gradient(jnp.where(largest > 0, largest, 1.0))
    sizes = [jax.lax.stop_gradient(jnp.maximum(size, largest * tiny)) for size in sizes]
    one, two = (
        (
            rest / largest + size / largest * tiny,
            weight / largest + size / largest * _floors(weight / size, log_rate),
        )
        for rest, weight, size, log_rate in zip(rests, weights, sizes, log_rates, strict=True)
    )
    zeros = [jnp.zeros_like(weight) for weight in weights]
    both = jnp.concatenate([one[1], zeros[1]]), jnp.concatenate([zeros[0], two[1]])
    of_solids = tuple(x if weight.size else None for x, weight in zip(both, weights, strict=True))
    return _Solids((one[0], two[0]), of_solids), largest


def _floors(weight, log_rate):
    """Return small weights that are added to the terms of a series, so that no weight is 0.

    At every frequency the loss of an added weight is below 1e-30 (float32: 1e-16) of the loss of the series.
    For this, the weight added at tau_i is 1e-30 (float32: 1e-16) times the sum over j of w_j r_ij with
    r_ij = min(tau_i/tau_j, tau_j/tau_i). The loss of a term at tau_j is at least r_ij times the loss of an
    equal term at tau_i. A constant added weight would exceed the series far from the times of the series.
    `weight` is relative to the stiffness of the solid. A floor is at least 1e-75 (float32: 1e-22).
    """
    least, small = (1e-75, 1e-30) if weight.dtype == jnp.float64 else (1e-22, 1e-16)
    shares = jnp.exp(-jnp.abs(log_rate[:, None] - log_rate))
    return jax.lax.stop_gradient(jnp.maximum(small * (shares @ weight), least))


@jax.custom_jvp
def _quotient(x, y):
    """Return x / y [-] with a derivative that does not square y, because y^2 may overflow float32."""
    return x / y


@_quotient.defjvp
def _quotient_jvp(primals, tangents):
    (x, y), (dx, dy) = primals, tangents
    return x / y, (dx - x / y * dy) / y


def _seen(log_rate):
    # The rates are in ascending order.
    index = jnp.arange(log_rate.shape[0])
    row, column = index[:, None], index[None, :]
    left = column < row
    previous = jnp.maximum(index - 1, 0)
    end = jnp.where(left, log_rate[previous][:, None], log_rate[:, None])
    own = (column == row) | (column == row - 1)
    ahead = log_rate[None, :] - end
    near = jnp.where(own, 0.0, jnp.where(left, ahead, -ahead))
    step = jnp.where(index == 0, 0.0, log_rate - log_rate[previous])
    low = jnp.where(index == 0, 0.0, jnp.exp(-step))
    width = jnp.where(index == 0, 1.0, -jnp.expm1(-step))
    nearer, gap = jnp.exp(near), -jnp.expm1(near)
    # Ends of the interval count fully, also for zero width.
    base = jnp.where(own, 0.0, jnp.where(left, low[:, None] * gap, gap))
    slope = jnp.where(own, 1.0, width[:, None]) * jnp.where(left, 1.0, nearer)
    return _Rates(left, own, nearer, base, slope, low, width)


def _shares(rates, theta, phi):
    """Return the factors A_j in the balance H, (rows, columns), and A of the rate 0, (rows,)."""
    reach = jnp.where(rates.left, theta[:, None], phi[:, None]) * rates.slope
    zero = theta * rates.width
    # The ends are constants: in reverse mode, equal parts of their derivative would leave a rounding error.
    share = jnp.where(rates.own, 1.0, _quotient(reach, rates.base + reach))
    return share, _quotient(zero, rates.low + zero)


class _Sums(NamedTuple):
    """Sums over all rates at the root of every interval, >= 0."""

    below: tuple  # of each solid: sum of w_j A_j over the left side, the factor of phi in H
    above: tuple  # of each solid: sum over the right side, the factor of -theta in H; None for a spring
    # Parts of F_i, which are multiplied by theta^2 phi^2 width^2 in `_solve`.
    left: jax.Array
    right: jax.Array


def _sums(solids, rates, small, right):
    """Return the `_Sums` for any shares."""
    theta, phi = _both(small, right)
    share, zero = _shares(rates, theta, phi)
    below, above = [], []
    for rest, weight in zip(solids.rest, solids.weight, strict=True):
        if weight is None:
            below.append(rest * zero)
            above.append(None)
        else:
            below.append(jnp.sum(jnp.where(rates.left, weight * share, 0.0), -1) + rest * zero)
            above.append(jnp.sum(jnp.where(rates.left, 0.0, weight * share), -1))
    weight = solids.total[1]
    left = jnp.sum(jnp.where(rates.left, weight * share * share * rates.nearer, 0.0), -1)
    # A_j of the right side times l_j divided by the right end.
    side = phi[:, None]
    over = _quotient(side * rates.width[:, None], rates.base + side * rates.slope)
    over = jnp.where(rates.own, 1.0, over)
    beyond = jnp.sum(jnp.where(rates.left, 0.0, weight * rates.nearer * over * over), -1)
    return _Sums(tuple(below), tuple(above), left, beyond)


def _balance(sums, small, right):
    """Return the balance H of every interval."""
    theta, phi = _both(small, right)
    return phi * sum(sums.below) - theta * sum(x for x in sums.above if x is not None)


def _own(rest, weight, right):
    """Return the weight of the nearer end of every interval."""
    if weight is None:
        weight = jnp.zeros(right.shape, rest.dtype)
    return jnp.where(right, weight, jnp.concatenate([rest[None], weight[:-1]]))


def _both(small, right):
    """Return the shares theta and phi = 1 - theta; `small` is phi if `right` is True, otherwise theta."""
    return jnp.where(right, 1 - small, small), jnp.where(right, small, 1 - small)


def _residual(rest, weight, rates, small, right):
    """Return the balance H of every interval, which decreases with theta."""
    theta, phi = _both(small, right)
    share, zero = _shares(rates, theta, phi)
    # One sum, because two sums would compute the shares twice.
    other = jnp.where(rates.left, phi[:, None], -theta[:, None])
    return jnp.sum(weight * share * other, -1) + phi * rest * zero


def _solve(solids, log_rate):
    """Return the weights of the series solid, and every rate divided by the right end of the interval."""
    rates = _seen(log_rate)
    small, right, sums = _at_roots(solids, rates)
    theta, phi = _both(small, right)
    # f = -g at a root. The solid with the smaller terms gives the value with more digits. Near its own rate a
    # solid's value is its weight. The value of the other solid is k times the distance, whose derivative is a
    # difference of numbers k/f times larger.
    (below1, below2), (above1, above2) = sums.below, (0.0 if x is None else x for x in sums.above)
    terms1, terms2 = phi * below1 + theta * above1, phi * below2 + theta * above2
    own1, own2 = (_own(r, w, right) for r, w in zip(solids.rest, solids.weight, strict=True))
    first = terms1 < jnp.where(own1 > own2, 4.0, 0.25) * terms2
    value = jnp.where(first, phi * below1 - theta * above1, theta * above2 - phi * below2)
    relative = jnp.where(right, 1 - phi * rates.width, rates.low + theta * rates.width)
    # l' F (theta phi width / l')^2 without a square of theta alone, which underflows float32 at 1e-30.
    steep = phi * phi * _quotient(rates.low, relative) * sums.left
    steep = steep + theta * _quotient(theta, relative) * sums.right
    return value * _quotient(value, steep), relative


@jax.custom_jvp
def _at_roots(solids, rates):
    """Return the `_roots` and the `_Sums` there."""
    rest, weight = solids.total
    small, right = _roots(rest, weight, rates)
    return small, right, _sums(solids, rates, small, right)


def _at_roots_jvp(primals, tangents):
    """Differentiate the sums at fixed shares, and add the change of the shares, which keeps H = 0."""
    small, right, sums = _at_roots(*primals)
    leaves, tree = jax.tree.flatten(primals)
    along = jax.tree.leaves(tangents)
    moving = [i for i, tangent in enumerate(along) if not isinstance(tangent, SymbolicZero)]

    def at(moved, small):
        every = leaves.copy()
        for i, leaf in zip(moving, moved, strict=True):
            every[i] = leaf
        solids, rates = jax.tree.unflatten(tree, every)
        return _sums(solids, rates, small, right)

    here = [leaves[i] for i in moving]
    _, by_solids = jax.jvp(lambda moved: at(moved, small), (here,), ([along[i] for i in moving],))
    _, by_share = jax.jvp(lambda small: at(here, small), (small,), (jnp.ones_like(small),))
    _, slope = jax.jvp(
        lambda sums, small: _balance(sums, small, right), (sums, small), (by_share, jnp.ones_like(small))
    )
    move = -_balance(by_solids, small, right) / slope
    change = jax.tree.map(lambda fixed, by_share: fixed + by_share * move, by_solids, by_share)
    fixed = np.zeros(right.shape, jax.dtypes.float0)
    return (small, right, sums), (move, fixed, change)


_at_roots.defjvp(_at_roots_jvp, symbolic_zeros=True)


def _roots(rest, weight, rates):
    """Return the smaller of theta and phi for every interval, and a mask that is True if phi is smaller."""
    half = jnp.full_like(weight, 0.5)
    right = _residual(rest, weight, rates, half, jnp.zeros(half.shape, bool)) > 0

    def step(k, progress):
        low, high, before, balance_before, secant = progress
        here = jnp.where(k < _HALVINGS, jnp.sqrt(low) * jnp.sqrt(high), secant)
        balance = _residual(rest, weight, rates, here, right)
        further = (balance > 0) != right
        low, high = jnp.where(further, here, low), jnp.where(further, high, here)
        change = balance_before - balance
        part = jnp.where(change != 0, _quotient(balance, jnp.where(change != 0, change, 1.0)), 0.0)
        # In the logarithm, in which the balance of two ends is nearly linear. At the root `part` is rounding.
        secant = here * jnp.exp(jnp.clip(part, -2.0, 2.0) * jnp.log(here / before))
        return low, high, here, balance, secant

    # Smaller than the shares of the smallest weights in the widest intervals.
    low = jnp.full_like(half, 1e-200 if half.dtype == jnp.float64 else 1e-36)
    progress = low, half, half, jnp.zeros_like(half), half
    return jax.lax.fori_loop(0, _HALVINGS + _SECANTS, step, progress)[-1], right
