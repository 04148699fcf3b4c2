r"""Importance sampling from the posteriors of many fits at once, and diagnostics of the weights.

.. math:: x_s = m + L z_s, \qquad \ln w_s = \ln p(x_s | data) - \sum_k \ln t_\nu(z_{sk}), \qquad
          L L^T = C

A draw costs one evaluation of the residuals, so the posteriors of a thousand fits take minutes. A chain
(`FitResult.sample`) is better for posteriors that are far from normal. Along the principal axes of C, the
columns of L, z has Student's distribution with d degrees of freedom in d dimensions. Its tails exceed any
posterior with Gaussian priors, so the weights are bounded. C is widened by 1 + 1/d, which covers posteriors
that deviate from the normal one.

m and C are the fit's minimum and covariance. If a pilot run shows that they are a poor proposal, the mean and
covariance of its weighted draws replace them in a part that grows with the effective sample size [population
Monte Carlo: Cappé, Guillin, Marin & Robert, J. Comput. Graph. Stat. 13 (2004) 907].

The effective sample size of weights is

.. math:: n_\mathrm{eff} = \Big(\sum_s w_s\Big)^2 \Big/ \sum_s w_s^2

A rare large weight can invalidate this number. The index k of a generalised Pareto distribution of the
largest weights measures this risk, which is too high above 0.7 [Vehtari, Simpson, Gelman, Yao & Gabry, J.
Mach. Learn. Res. 25 (2024) 72, arXiv:1507.02646; Zhang & Stephens, Technometrics 51 (2009) 316]. A hundred
draws give k to 0.4 only, so two standard errors of k are allowed for. Weights are stored as logarithms, up to
a constant for each fit, shape (fits, draws).

In a calibration the true x is drawn from the prior, so it is itself a draw from the posterior. Among the true
x and the draws, each is the true one with a probability proportional to its weight. Therefore

.. math:: u = \frac{\sum_s w_s \, [x_s < x_\mathrm{true}] + U w_\mathrm{true}}
                   {\sum_s w_s + w_\mathrm{true}}

with uniform U is uniform between 0 and 1, for any number of draws and any proposal. With equal weights it is
the rank of the truth [weighted exchangeability: Tibshirani, Foygel Barber, Candès &
Ramdas, Adv. Neural Inf. Process. Syst. 32 (2019), arXiv:1904.06019, section 3]. The power of a test
of uniformity depends on the effective sample size.
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
# Smallest effective sample size of weights that describe a posterior. Fewer draws give no interval.
_ENOUGH = 10
# Largest tail index of such weights. Means over weights with heavier tails converge too slowly (Vehtari et
# al.).
_HEAVY = 0.7
# Smallest number of degrees of freedom. In few dimensions it costs little.
_FEWEST = 4
# Pilot draws over all draws. Fewer describe the posterior less well, and more take longer.
_PILOT = 0.2
# Share of pilot draws that must be effective. Below it the proposal is improved.
_GUIDE = 0.25
# Most pilot runs. Each further one takes as many draws as the final run, for fits with a poor proposal only.
_ROUNDS = 4
# Points in one call of the compiled function. Calls are distributed over cores.
_POINTS = 256


def relative(log_weight: np.ndarray) -> np.ndarray:
    """Return the weights, scaled so that the largest weight of each fit is 1."""
    largest = np.max(log_weight, 1, keepdims=True)
    # All weights are 0 if the model is finite at no point.
    return np.exp(log_weight - np.where(np.isfinite(largest), largest, 0.0))


def effective(log_weight: np.ndarray) -> np.ndarray:
    """Return the effective sample size of every fit, shape (fits,)."""
    weight = relative(log_weight)
    squares = np.sum(weight**2, 1)
    return np.sum(weight, 1) ** 2 / np.where(squares > 0, squares, 1.0)


def tail_index(log_weight: np.ndarray) -> np.ndarray:
    """Return the tail index k of the weights of every fit, shape (fits,), -inf if all are equal."""
    rows = log_weight.shape[1]
    count = _tail(rows)
    ordered = np.sort(relative(log_weight), 1)
    return np.array([_pareto_shape(column[-count:] - column[-count - 1]) for column in ordered])


def doubtful(size: np.ndarray, index: np.ndarray, draws: int) -> np.ndarray:
    """Return True for fits with an effective size below 10 or a tail index well above 0.7, shape (fits,)."""
    tail = np.maximum(index, -1.0)
    return (size < _ENOUGH) | (tail - 2 * (1 + tail) / np.sqrt(_tail(draws)) > _HEAVY)


def _tail(draws):
    return int(min(0.2 * draws, 3 * np.sqrt(draws)))


def _pareto_shape(excess):
    """Return the shape of the generalised Pareto distribution of increasing values > 0.

    It is regularised as if ten more values had a shape of 1/2 (Vehtari et al.).
    """
    if not excess[-1] > _EVEN:
        return -np.inf
    count = excess.size
    tried = 30 + int(np.sqrt(count))
    quartile = excess[int(count / 4 + 0.5) - 1]
    steps = 1 - np.sqrt(tried / (np.arange(1, tried + 1) - 0.5))
    # The quartile is 0 if weights equal the smallest one of the tail.
    theta = 1 / excess[-1] + steps / (3 * max(quartile, _EVEN * excess[-1]))
    shape = np.mean(np.log1p(-theta[:, None] * excess), 1)
    likelihood = count * (np.log(-theta / shape) - shape - 1)
    best = np.sum(theta * scipy.special.softmax(likelihood))
    mean_log = np.mean(np.log1p(-best * excess))
    return (count * mean_log + 10 * 0.5) / (count + 10)


class Proposal(NamedTuple):
    """Proposal distribution of every fit."""

    centre: np.ndarray  # m, shape (fits, size)
    axes: np.ndarray  # L, shape (fits, size, size)

    @classmethod
    def of(cls, centre: np.ndarray, covariance: np.ndarray) -> "Proposal":
        """Return the proposal with mean m and covariance C, widened as in the module's docstring."""
        variance, directions = np.linalg.eigh(covariance)
        wider = 1 + 1 / centre.shape[1]
        return cls(np.array(centre), directions * np.sqrt(wider * variance)[:, None])

    def draws(self, count: int, random: np.random.Generator) -> np.ndarray:
        """Draw `count` points x for every fit, of shape (fits, count, size)."""
        size = self.centre.shape[1]
        z = random.standard_t(max(_FEWEST, size), (len(self.centre), count, size))
        return self.centre[:, None] + np.einsum("fij,fsj->fsi", self.axes, z)

    def log_density(self, x: np.ndarray) -> np.ndarray:
        """Return the log density at x of shape (fits, rows, size), up to a constant for each fit."""
        z = np.linalg.solve(self.axes, np.swapaxes(np.asarray(x - self.centre[:, None], float), 1, 2))
        freedom = max(_FEWEST, x.shape[2])
        return -0.5 * (freedom + 1) * np.sum(np.log1p(z**2 / freedom), 1)

    def some(self, rows: np.ndarray) -> "Proposal":
        """Return the proposals of the fits `rows`."""
        return Proposal(self.centre[rows], self.axes[rows])


def guided(
    problem: Problem,
    targets: Targets,
    centre: np.ndarray,
    covariance: np.ndarray,
    count: int,
    random: np.random.Generator,
) -> Proposal:
    """Return the proposal for `count` draws of every fit, improved by pilot runs.

    `targets` has a leading axis with one entry per fit or one for all. `centre` and `covariance`, of shapes
    (fits, size) and (fits, size, size), describe the minimum of each fit.
    """
    proposal = Proposal.of(centre, covariance)
    rows, pilot = np.arange(len(centre)), max(int(_PILOT * count), 10)
    for _ in range(_ROUNDS):
        here = proposal.some(rows)
        x = here.draws(pilot, random)
        weight = log_weights(problem, _some(targets, rows), here, x)
        size = effective(weight)
        poor = (size > 0) & (size < _GUIDE * pilot)
        if not poor.any():
            break
        rows, x, weight, size = rows[poor], x[poor], relative(weight[poor]), size[poor]
        if pilot < count:  # repeat for the remaining fits with as many draws as the final run
            pilot = count
            continue
        weight /= np.sum(weight, 1, keepdims=True)
        part = (size / (size + x.shape[2]))[:, None]
        centres, axes = here.some(poor)
        mean = np.einsum("fs,fsi->fi", weight, x)
        away = x - mean[:, None]
        spread = np.einsum("fs,fsi,fsj->fij", weight, away, away)
        centres = part * mean + (1 - part) * centres
        before = axes @ np.swapaxes(axes, 1, 2) / (1 + 1 / x.shape[2])
        spread = part[..., None] * spread + (1 - part[..., None]) * before
        better = Proposal.of(centres, spread)
        proposal.centre[rows], proposal.axes[rows] = better
    return proposal


def log_weights(
    problem: Problem,
    targets: Targets,
    proposal: Proposal,
    x: np.ndarray,
    callback: Callable[[int, int], object] | None = None,
) -> np.ndarray:
    """Return ln w of points x, (fits, rows, size), up to a constant for each fit, shape (fits, rows).

    The result is -inf if ln w is not finite. `callback` is called as callback(fits done, fits).
    """
    of, (fits, rows, size) = padded(problem, targets), x.shape
    points, count = x.reshape(-1, size).astype(problem.start.dtype), fits * rows

    def density(first):
        which = np.minimum(np.arange(first, first + _POINTS), count - 1)
        repeated = jax.tree.map(lambda a: a[which // rows if len(a) == fits else 0 * which], of.targets)
        return np.asarray(_densities(of.structure, of.numbers, repeated, points[which]))[: count - first]

    # The first call compiles. A call keeps one core busy and releases Python's lock; an accelerator takes
    # one call at a time.
    log_densities = [density(0)]
    with ThreadPoolExecutor(cores() if jax.default_backend() == "cpu" else 1) as pool:
        try:
            for values in pool.map(density, range(_POINTS, count, _POINTS)):
                log_densities.append(values)
                if callback is not None:
                    callback(min(len(log_densities) * _POINTS, count) // rows, fits)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    values = np.concatenate(log_densities).reshape(fits, rows) - proposal.log_density(x)
    return np.where(np.isfinite(values), values, -np.inf)


def places(x: np.ndarray, log_weight: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the rank u of the true x, which is the last row of the x of each fit, shape (fits, size)."""
    weight = relative(log_weight)
    below = np.einsum("fs,fsi->fi", weight, x < x[:, -1:])
    own = weight[:, -1:] * random.random(below.shape)
    return (below + own) / np.sum(weight, 1, keepdims=True)


def _some(targets, rows):
    # Arrays of length 1 belong to all fits.
    return jax.tree.map(lambda a: a[rows] if len(a) > 1 else a, targets)


@functools.partial(jax.jit, static_argnums=0)
def _densities(structure, numbers, targets, x):
    """Return the log density of each point with its targets; a processor takes one point after the other."""

    def log_density(pair):
        return density_at(structure, "x", numbers, *pair)

    return (
        jax.vmap(log_density)((targets, x))
        if jax.default_backend() != "cpu"
        else jax.lax.map(log_density, (targets, x))
    )
