r"""What weighted draws are worth.

As much as so many equal ones,

.. math:: n_\mathrm{eff} = \Big(\sum_s w_s\Big)^2 \Big/ \sum_s w_s^2

of which single large weights, not met yet, may leave less. Their tail says how likely that is: the index k of
a generalised Pareto distribution of the largest ones, above 0.7 too likely [Vehtari, Simpson, Gelman, Yao &
Gabry, J. Mach. Learn. Res. 25 (2024) 72, arXiv:1507.02646; Zhang & Stephens, Technometrics 51 (2009) 316]. Of
a hundred draws k itself is known to 0.4 only: what chance can do to it is allowed for.

Weights are given as their logarithms but for a constant of each fit, shape (fits, draws).

Draws from the posteriors of many fits at once: from the normal one about each minimum, with weights.

.. math:: x_s = m + L z_s, \qquad \ln w_s = \ln p(x_s | data) - \sum_k \ln t_\nu(z_{sk}), \qquad
          L L^T = C

A draw costs one evaluation of the residuals and depends on no other: the posteriors of a thousand fits take
minutes; a chain (`FitResult.sample`) is worth more where no normal distribution is a guide. Along the
principal axes of C, the columns of L, z has Student's distribution, whose tails are longer than those of any
posterior with Gaussian priors: weights are bounded. Of d axes it has d degrees of freedom, and C is widened
by 1 + 1/d, which costs a fifth of the draws and finds what a bent posterior has beside its normal one.

m and C are the fit's minimum and covariance. Where a few draws say that these are a poor guide, mean and
covariance of weighted draws take their place, as far as these are worth it [population Monte Carlo: Cappé,
Guillin, Marin & Robert, J. Comput. Graph. Stat. 13 (2004) 907]; they are thrown away then.

Where one row of x is no such draw but the truth behind the data, drawn from the prior, it is a draw from the
posterior itself. Of all rows, not told apart, each is that one with a probability as its weight, so that

.. math:: u = \frac{\sum_s w_s \, [x_s < x_\mathrm{true}] + U w_\mathrm{true}}
                   {\sum_s w_s + w_\mathrm{true}}

with uniform U is uniform between 0 and 1, however many draws there are and however well they are placed: of
equal weights it is the rank of the truth [weighted exchangeability: Tibshirani, Foygel Barber, Candès &
Ramdas, Adv. Neural Inf. Process. Syst. 32 (2019), arXiv:1904.06019, section 3]. What it can see is
another matter: as much as the weights are worth (`fitting.uncertainty.importance`).
"""

import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import jax
import numpy as np
import scipy

from fitting.solvers.problem import Problem, Targets
from fitting.solvers.residuals import padded
from fitting.uncertainty.posterior import density_at
from rubberfric.base import cores

# Weights that differ by less than this part of the largest have no tail.
_EVEN = 1e-6
# Effective draws with which they say something of a posterior, and index of their tail above which not.
_ENOUGH, _HEAVY = 10, 0.7
# Degrees of freedom of draws in few dimensions, where they cost little.
_FEWEST = 4
# Draws that are thrown away: part of all, what of them must be effective, and rounds where it is not.
_PILOT, _GUIDE, _ROUNDS = 0.2, 0.25, 4
# Points in one call of the compiled program: shared out over cores.
_POINTS = 256


def relative(log_weight: np.ndarray) -> np.ndarray:
    """Weights, the largest of each fit 1."""
    largest = np.max(log_weight, 1, keepdims=True)
    # Where the model is finite nowhere all are 0.
    return np.exp(log_weight - np.where(np.isfinite(largest), largest, 0.0))


def effective(log_weight: np.ndarray) -> np.ndarray:
    """Number of equal draws that are worth as much, of every fit, shape (fits,)."""
    weight = relative(log_weight)
    squares = np.sum(weight**2, 1)
    return np.sum(weight, 1) ** 2 / np.where(squares > 0, squares, 1.0)


def tail_index(log_weight: np.ndarray) -> np.ndarray:
    """k of the largest weights of every fit, shape (fits,); -inf where weights are all the same."""
    rows = log_weight.shape[1]
    count = _tail(rows)
    ordered = np.sort(relative(log_weight), 1)
    return np.array([_pareto_shape(one[-count:] - one[-count - 1]) for one in ordered])


def doubtful(worth: np.ndarray, index: np.ndarray, draws: int) -> np.ndarray:
    """Which of the fits, with these `effective` numbers and tail indices of so many draws, are known badly.

    Fewer than 10 effective, or an index that is above 0.7 by more than two of its standard errors.
    """
    tail = np.maximum(index, -1.0)
    return (worth < _ENOUGH) | (tail - 2 * (1 + tail) / np.sqrt(_tail(draws)) > _HEAVY)


def _tail(draws):
    """Number of the largest weights."""
    return int(min(0.2 * draws, 3 * np.sqrt(draws)))


def _pareto_shape(excess):
    """Shape of the generalised Pareto distribution of values > 0 in increasing order (Zhang & Stephens).

    With so many values as ten at a shape of 1/2 beside them (Vehtari et al.): a few alone say little.
    """
    if not excess[-1] > _EVEN:
        return -np.inf
    count = excess.size
    tried = 30 + int(np.sqrt(count))
    quartile = excess[int(count / 4 + 0.5) - 1]
    steps = 1 - np.sqrt(tried / (np.arange(1, tried + 1) - 0.5))
    # Equal weights stand on the border of the tail.
    theta = 1 / excess[-1] + steps / (3 * max(quartile, _EVEN * excess[-1]))
    shape = np.mean(np.log1p(-theta[:, None] * excess), 1)
    likelihood = count * (np.log(-theta / shape) - shape - 1)
    best = np.sum(theta * scipy.special.softmax(likelihood))
    found = np.mean(np.log1p(-best * excess))
    return (count * found + 10 * 0.5) / (count + 10)


class Proposal(NamedTuple):
    """Where draws of every fit are taken from."""

    centre: np.ndarray  # m, shape (fits, size)
    axes: np.ndarray  # L, shape (fits, size, size)

    @classmethod
    def of(cls, centre: np.ndarray, covariance: np.ndarray) -> "Proposal":
        """From m and C of the module's docstring."""
        variance, directions = np.linalg.eigh(covariance)
        wider = 1 + 1 / centre.shape[1]
        return cls(np.array(centre), directions * np.sqrt(wider * variance)[:, None])

    def draws(self, count: int, random: np.random.Generator) -> np.ndarray:
        """Points x, shape (fits, count, size)."""
        size = self.centre.shape[1]
        z = random.standard_t(max(_FEWEST, size), (len(self.centre), count, size))
        return self.centre[:, None] + np.einsum("fij,fsj->fsi", self.axes, z)

    def log_density(self, x: np.ndarray) -> np.ndarray:
        """At points (fits, rows, size), but for a constant of every fit, shape (fits, rows)."""
        z = np.linalg.solve(self.axes, np.swapaxes(np.asarray(x - self.centre[:, None], float), 1, 2))
        freedom = max(_FEWEST, x.shape[2])
        return -0.5 * (freedom + 1) * np.sum(np.log1p(z**2 / freedom), 1)

    def some(self, rows: np.ndarray) -> "Proposal":
        """Those of some fits."""
        return Proposal(self.centre[rows], self.axes[rows])


def guided(
    problem: Problem,
    targets: Targets,
    centre: np.ndarray,
    covariance: np.ndarray,
    count: int,
    random: np.random.Generator,
) -> Proposal:
    """Where `count` draws of every fit are best taken from.

    Parameters
    ----------
    problem : what all fits share
    targets : arrays with a leading axis of one entry a fit, or of one for all
    centre, covariance : of the fits, shapes (fits, size) and (fits, size, size)
    count : of draws to come
    """
    found = Proposal.of(centre, covariance)
    rows, pilot = np.arange(len(centre)), max(int(_PILOT * count), 10)
    for _ in range(_ROUNDS):
        here = found.some(rows)
        x = here.draws(pilot, random)
        weight = log_weights(problem, _some(targets, rows), here, x)
        worth = effective(weight)
        poor = (worth > 0) & (worth < _GUIDE * pilot)
        if not poor.any():
            break
        rows, x, weight, worth = rows[poor], x[poor], relative(weight[poor]), worth[poor]
        if pilot < count:  # from now on of few fits, and as many draws as it takes
            pilot = count
            continue
        weight /= np.sum(weight, 1, keepdims=True)
        part = (worth / (worth + x.shape[2]))[:, None]
        centres, axes = here.some(poor)
        mean = np.einsum("fs,fsi->fi", weight, x)
        away = x - mean[:, None]
        spread = np.einsum("fs,fsi,fsj->fij", weight, away, away)
        centres = part * mean + (1 - part) * centres
        before = axes @ np.swapaxes(axes, 1, 2) / (1 + 1 / x.shape[2])
        spread = part[..., None] * spread + (1 - part[..., None]) * before
        better = Proposal.of(centres, spread)
        found.centre[rows], found.axes[rows] = better
    return found


def log_weights(
    problem: Problem,
    targets: Targets,
    proposal: Proposal,
    x: np.ndarray,
    callback: Callable[[int, int], object] | None = None,
) -> np.ndarray:
    """ln w of the module's docstring but for a constant of each fit, shape (fits, rows); -inf: not finite.

    Parameters
    ----------
    problem, targets : as for `guided`
    proposal : that x was drawn from
    x : where, shape (fits, rows, size)
    callback : called as callback(fits done, fits), or None
    """
    of, (fits, rows, size) = padded(problem, targets), x.shape
    points, count = x.reshape(-1, size).astype(problem.start.dtype), fits * rows

    def density(first):
        which = np.minimum(np.arange(first, first + _POINTS), count - 1)
        given = jax.tree.map(lambda a: a[which // rows if len(a) == fits else 0 * which], of.targets)
        return np.asarray(_densities(of.structure, of.numbers, given, points[which]))[: count - first]

    # The first call compiles. A program keeps one core busy, and lets go of Python's lock; an accelerator
    # takes one call at a time.
    found = [density(0)]
    with ThreadPoolExecutor(cores() if jax.default_backend() == "cpu" else 1) as pool:
        try:
            for values in pool.map(density, range(_POINTS, count, _POINTS)):
                found.append(values)
                if callback is not None:
                    callback(min(len(found) * _POINTS, count) // rows, fits)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    values = np.concatenate(found).reshape(fits, rows) - proposal.log_density(x)
    return np.where(np.isfinite(values), values, -np.inf)


def places(x: np.ndarray, log_weight: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """U of the module's docstring of the last row among all, number by number, shape (fits, size)."""
    weight = relative(log_weight)
    below = np.einsum("fs,fsi->fi", weight, x < x[:, -1:])
    own = weight[:, -1:] * random.random(below.shape)
    return (below + own) / np.sum(weight, 1, keepdims=True)


def _some(targets, rows):
    """Targets of some fits."""
    return jax.tree.map(lambda a: a[rows] if len(a) > 1 else a, targets)


@functools.partial(jax.jit, static_argnums=0)
def _densities(structure, numbers, targets, x):
    """Log densities of points, each with its own targets; at once on an accelerator, idle with one."""

    def one(pair):
        return density_at(structure, "x", numbers, *pair)

    return jax.vmap(one)((targets, x)) if jax.default_backend() != "cpu" else jax.lax.map(one, (targets, x))
