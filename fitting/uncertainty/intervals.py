r"""Intervals: from the covariance, from the profile of the cost, and from simulated data.

The first are linear in x and cost nothing. A profile holds one parameter at a row of values,
fits all others again, and takes as interval where the cost has risen by q^2/2, q being the
normal (or Student's) quantile. A parametric bootstrap fits data drawn from the fitted model.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from fitting.parameters.layout import to_scene, to_values
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.problem import forward
from fitting.solvers.runs import run
from fitting.solvers.status import CONVERGED, PERFECT
from fitting.uncertainty.covariance import OPEN, model_rows


class Profile(NamedTuple):
    """Cost of a fit over one of its parameters."""

    name: str
    values: np.ndarray  # of the parameter, increasing
    rise: np.ndarray  # twice the cost above its minimum; NaN where a fit did not converge
    low: float  # ends of the interval; -inf and inf (0 and inf if Positive, a bound if Bounded)
    high: float  # where the profile stays below
    threshold: float  # rise at the ends of the interval


class Bootstrap(NamedTuple):
    """Fits of simulated data."""

    names: tuple
    values: np.ndarray  # shape (fits that converged, free elements)
    failed: int  # fits that did not converge

    def interval(self, level=0.95):
        """Quantiles of the fits."""
        tail = 50 * (1 - level)
        return np.percentile(self.values, tail, axis=0), np.percentile(self.values, 100 - tail, axis=0)


def quantile(level, freedom=np.inf):
    """Two-sided quantile: normal, or Student's with `freedom` degrees of freedom."""
    if not 0 < level < 1:
        raise ValueError(f"level = {level!r}: must be between 0 and 1")
    if not np.isfinite(freedom):
        return float(jax.scipy.special.ndtri(0.5 + 0.5 * np.float64(level)))
    low, high = 0.0, 1e8
    for _ in range(200):
        middle = 0.5 * (low + high)
        # P(|t| > q) = I_{n / (n + q^2)}(n / 2, 1 / 2)
        outside = jax.scipy.special.betainc(0.5 * freedom, 0.5, freedom / (freedom + middle**2))
        low, high = (middle, high) if outside > 1 - level else (low, middle)
    return high


def _quantile(result, level):
    """Student's where errors come from the scatter of the same data."""
    estimated = any(scale is not None for scale in result.estimated)
    return quantile(level, max(result.freedom, 0.5) if estimated else np.inf)


def interval(result, level=0.95):
    """Ends of the intervals of all values, linear in x: arrays (low, high), NaN where withheld."""
    reach = _quantile(result, level) * result.uncertainty.deviation
    layout, constants = result.layout, result.problem.numbers.constants
    return tuple(np.asarray(to_values(layout, constants, result.x + sign * reach)) for sign in (-1, 1))


class Band(NamedTuple):
    """A prediction with its band."""

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray


def band(result, velocity, pressure, temperature=None, quantity="friction", level=0.95):
    """Prediction of the fitted scene and the band that the fit's uncertainty leaves it.

    Linear in the logarithm of the quantity (in the quantity itself where it is not > 0). What
    the data leave open widens the band only as far as the prediction depends on it.

    Returns
    -------
    Band of arrays of the broadcast shape
    """
    structure, numbers = result.problem.structure, result.problem.numbers

    def predicted(x):
        scene = to_scene(structure.layout, numbers.constants, x)
        solution = rf.solve(
            scene, velocity, pressure, temperature, quadrature=structure.quadrature, quantities=(quantity,)
        )
        return getattr(solution, quantity)

    return widened(result, predicted, level)


def widened(result, predicted, level):
    """Band of what a function of x predicts."""
    value, slope = jax.jit(lambda x: forward(predicted, x))(jnp.asarray(result.uncertainty.x))
    value, slope = np.asarray(value), np.asarray(slope) * result.uncertainty.stretch
    reach = _quantile(result, level) * np.sqrt(
        np.einsum("...i,ij,...j->...", slope, result.uncertainty.spread, slope)
    )
    positive = value > 0
    # exp(700) is the largest power of e: a band beyond it is no band.
    factor = np.exp(np.minimum(reach / np.where(positive, value, 1.0), 700.0))
    return Band(
        value,
        np.where(positive, value / factor, value - reach),
        np.where(positive, value * factor, value + reach),
    )


def profile(result, name, level=0.95, points=8, callback=None):
    """Profile of one parameter's cost on both sides of its fitted value.

    Parameters
    ----------
    result : FitResult, not of a robust loss's outliers only: its cost is taken as -ln likelihood
    name : one of result.names
    points : on each side, reaching to 1.6 times the linear interval
    callback : as for `fitting.fit`

    Returns
    -------
    Profile
    """
    starts, targets = profile_fits(result, name, level, points)
    problem = result.problem
    runs = run(LevenbergMarquardt(), problem.structure, problem.numbers, targets, starts, callback=callback)
    return profile_of(result, name, level, starts, runs.cost, runs.status)


def profile_fits(result, name, level, points):
    """Start vectors of the fits that a profile is made of, and their targets."""
    names = list(result.names)
    if name not in names:
        raise ValueError(f"name = {name!r}: must be one of {', '.join(names)}")
    i, known = names.index(name), result.uncertainty
    deviation = np.sqrt(known.spread[i, i]) if known.stretch[i] == 1 else np.inf
    reach = min(1.6 * _quantile(result, level) * deviation, OPEN / 10)
    offsets = reach * np.linspace(-1, 1, 2 * points + 1)
    # The others start where the covariance expects them, but for those at a bound.
    toward = np.where(known.stretch == 1, known.spread[i] / known.spread[i, i], 0.0)
    toward[i] = 1.0
    held = np.ones(result.layout.size)
    held[i] = 0.0
    targets = jax.tree.map(lambda a: a[None], result.problem.targets._replace(held=held))
    return result.x + offsets[:, None] * toward, targets


def profile_of(result, name, level, starts, cost, status):
    """The `Profile` that fits from `profile_fits` make."""
    i, q, points = list(result.names).index(name), _quantile(result, level), len(starts) // 2
    good = np.isin(status, (CONVERGED, PERFECT))
    rise = np.where(good, 2 * (cost - min(result.cost, cost[good].min(initial=np.inf))), np.nan)
    layout, constants = result.layout, result.problem.numbers.constants
    values = np.asarray(jax.vmap(lambda x: to_values(layout, constants, x))(starts))[:, i]
    sides = np.arange(points, -1, -1), np.arange(points, 2 * points + 1)
    ends = [_crossing(starts[side, i], np.sqrt(np.maximum(rise[side], 0.0)), q) for side in sides]
    at = [np.where(np.arange(layout.size) == i, end, result.x) for end in ends]
    low, high = (float(np.asarray(to_values(layout, constants, x))[i]) for x in at)
    return Profile(name, values, rise, low, high, q**2)


def _crossing(x, root, q):
    """x where the root of the rise, nearly linear in x, first reaches q; +-inf if it does not."""
    for k in range(1, x.size):
        if not np.isfinite(root[k]):
            break
        if root[k] >= q:
            part = (q - root[k - 1]) / (root[k] - root[k - 1])
            return x[k - 1] + part * (x[k] - x[k - 1])
    return np.inf * np.sign(x[-1] - x[0])


def bootstrap(result, count=100, key=None, callback=None):
    """Fit `count` data sets drawn from the fitted model with the errors of the data.

    Parameters
    ----------
    result : FitResult
    key : jax.random.key, or None for key(0)
    callback : as for `fitting.fit`

    Returns
    -------
    Bootstrap
    """
    problem = result.problem
    starts, targets = bootstrap_fits(result, count, key)
    runs = run(LevenbergMarquardt(), problem.structure, problem.numbers, targets, starts, callback=callback)
    return bootstrap_of(result, runs.x, runs.status)


def bootstrap_fits(result, count, key):
    """Start vectors of the fits of a bootstrap, and the data drawn for them."""
    key = jax.random.key(0) if key is None else key
    targets = result.problem.targets
    noise = np.asarray(jax.random.normal(key, (count, targets.measured.size)))
    drawn = model_rows(result.problem, result.x) + targets.error * noise
    targets = targets._replace(measured=drawn, error=targets.error[None], held=targets.held[None])
    return np.tile(result.x, (count, 1)), targets


def bootstrap_of(result, x, status):
    """The `Bootstrap` that fits from `bootstrap_fits` make."""
    good = np.isin(status, (CONVERGED, PERFECT))
    layout, constants = result.layout, result.problem.numbers.constants
    values = jax.vmap(lambda x: to_values(layout, constants, x))(x[good])
    return Bootstrap(result.names, np.asarray(values), int((~good).sum()))
