r"""Confidence intervals from the covariance, from profile likelihoods, and from simulated data.

Intervals from the covariance are linear in x and need no further fits. A profile likelihood
(`fitting.uncertainty.profile`) fixes one parameter at several values and fits all others again. A parametric
bootstrap fits data drawn from the fitted model.

`valleys` checks the linear intervals of closely correlated parameters. At their ends, :math:`\hat x_i \pm q
\sigma_i`, all others are fitted again by a few Gauss-Newton steps. If the rows are linear in x, twice the
cost rises by q^2 there, as in the profile [Bates & Watts, Nonlinear Regression Analysis and Its Applications,
Wiley 1988, ch. 6]. If it does not, the profile's end is extrapolated from the root of the rise, which is
nearly linear in x.
"""

import dataclasses
import warnings
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy

import rubberfric as rf
from fitting.parameters.scenes import chosen_scene
from fitting.parameters.variables import Array, to_x
from fitting.solvers.evaluation import (
    at_conditions,
    errors_of_rows,
    errors_of_slopes,
    evaluate_rows,
    model_rows,
    residual_rows,
)
from fitting.solvers.levenberg_marquardt import NEAR_MINIMUM, LevenbergMarquardt
from fitting.solvers.objective import succeeded, was_interrupted
from fitting.solvers.options import check_options
from fitting.solvers.problem import CURVE_QUANTITIES, Problem, Targets
from fitting.solvers.residuals import forward, padded
from fitting.solvers.runs import Callback, Runs, run_fits
from fitting.uncertainty.covariance import OPEN, Uncertainty, WithUncertainty, inside_bounds
from fitting.uncertainty.likelihood_profile import LikelihoodProfile
from fitting.uncertainty.profile import Anchor, profile_from
from fitting.uncertainty.verdict import MEDIAN
from rubberfric.base import ArrayLike, broadcast_shape, quick_jit

# Confidence level of intervals in reports, figures and checks.
LEVEL = 0.95
# Correlation above which the error bars of a pair are checked. They are then five times as long as with the
# other parameter fixed, and the linear model may not hold at their ends.
_CORRELATED = 0.98
# Most pairs whose error bars are checked. Each takes fits at the four ends of two intervals.
_PAIRS = 2
# Limits of rise / expected rise for error bars that are correct to a tenth of their length.
_HOLD = (0.8, 1.25)
# Most Gauss-Newton steps at the ends of an interval. The rise of chi-square is needed to about a fifth only.
_STEPS = 4
# Gain in cost below which the steps end. The expected rise of the cost is 1.9 at 95 % for many data.
_LITTLE = 0.05


class Bootstrap(NamedTuple):
    """Result of a parametric bootstrap: fits of simulated data."""

    names: tuple[str, ...]
    values: np.ndarray  # shape (fits that converged, free elements)
    failed: int  # fits that did not converge

    def interval(self, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Return the lower and upper quantiles of the fitted values, each of shape (size,)."""
        check_options(level=level)
        tail = 50 * (1 - level)
        return np.percentile(self.values, tail, axis=0), np.percentile(self.values, 100 - tail, axis=0)


class Band(NamedTuple):
    """A prediction, and the lower and upper limits of the confidence band."""

    value: np.ndarray
    low: np.ndarray
    high: np.ndarray


def quantile(level: float, freedom: float = np.inf) -> float:
    """Return the two-sided quantile of the normal distribution, or of Student's with finite `freedom`."""
    check_options(level=level)
    if not np.isfinite(freedom):
        return float(scipy.special.ndtri(0.5 + 0.5 * level))
    return float(scipy.special.stdtrit(freedom, 0.5 + 0.5 * level))


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SolvedProblem(WithUncertainty):
    """A least-squares problem with solution and uncertainty, the base class of `fitting.FitResult`.

    Attributes
    ----------
    problem : Problem, whose errors are estimated for data without given errors
    x : the solution, shape (size,)
    cost : half the sum of the squared residuals of data (rho with a robust loss) and priors
    estimated : estimated relative error of every data set, None if errors were given
    error_scale : factor by which given errors were multiplied, 1 unless they were scaled
    uncertainty : uncertainty of the solution
    """

    problem: Problem
    x: np.ndarray
    cost: float
    estimated: tuple[float | None, ...]
    error_scale: float = 1.0
    uncertainty: Uncertainty

    @property
    def names(self) -> tuple[str, ...]:
        """Key path of every free element."""
        return self.problem.names

    @property
    def freedom(self) -> float:
        """Degrees of freedom: number of measured values minus the effective number of parameters."""
        return self.problem.targets.measured.size - self.uncertainty.parameters

    def quantile(self, level: float) -> float:
        """Return the two-sided normal quantile, or Student's if errors were estimated from the scatter."""
        estimated = self.error_scale != 1 or any(scale is not None for scale in self.estimated)
        by_median = self.problem.structure.loss != "linear"
        freedom = self.freedom / (MEDIAN if by_median else 1.0)
        return quantile(level, max(freedom, 0.5) if estimated else np.inf)

    def interval(self, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of the confidence intervals; NaN if an error bar is withheld.

        The intervals are symmetric in x. Those of Bounded parameters contain the intervals that are symmetric
        in the value, too, up to the bounds: near a bound, x changes much for a small change of the value.
        """
        q, constants = self.quantile(level), self.problem.numbers.constants
        steps = self.x + q * self.uncertainty.deviation * np.array([[-1.0], [0.0], [1.0]])
        low, value, high = self.problem.values(steps)
        bounded, reach = np.array(self.problem.variables.kinds) == "Bounded", q * self.stderr
        least, width = np.asarray(constants.low, float), np.asarray(constants.width, float)
        low = np.where(bounded, np.minimum(low, np.maximum(value - reach, least)), low)
        return low, np.where(bounded, np.maximum(high, np.minimum(value + reach, least + width)), high)

    @property
    def _inside(self) -> np.ndarray:
        """x from which a fit can leave a bound, see `inside_bounds`."""
        return inside_bounds(self.problem, self.x, self.uncertainty)

    def predicted(self, x: Array, conditions: tuple[Any, ...], quantity: str, scene: str | None) -> jax.Array:
        """Return a quantity of `rubberfric.solve` for the scene at x, under (v, p, T)."""
        there, quadrature = chosen_scene(self.problem.scene(x), scene), self.problem.structure.quadrature
        solution = rf.solve(there, *conditions, quadrature=quadrature, quantities=(quantity,))
        return getattr(solution, quantity)

    def band(
        self,
        velocity: ArrayLike,
        pressure: ArrayLike,
        temperature: ArrayLike | None = None,
        quantity: str = "friction",
        level: float = 0.95,
        scene: str | None = None,
    ) -> Band:
        """Return the prediction of the fitted scene with the confidence band, of the broadcast shape.

        If the quantity is > 0, the band is symmetric in the logarithm of the quantity, otherwise in the
        quantity. Unidentified directions widen the band only as far as the prediction depends on them.

        Parameters
        ----------
        velocity, pressure, temperature : broadcastable [m/s], [Pa], [K], as for `rubberfric.solve`
        quantity : name of a quantity of `rubberfric.solve`
        level : confidence level
        scene : name of the scene if there are several
        """
        conditions = velocity, pressure, temperature
        broadcast_shape(velocity=velocity, pressure=pressure, temperature=temperature)
        arrays = np.broadcast_arrays(*(np.asarray(c, float) for c in conditions if c is not None))
        columns = (*(c.reshape(-1) for c in arrays), *[None] * (temperature is None))

        def predicted(x):
            return self.predicted(x, conditions, quantity, scene)

        x = jnp.asarray(self.uncertainty.x)
        shape = jax.eval_shape(predicted, x).shape  # checks the arguments without computing
        value_and_slope = None
        if quantity in CURVE_QUANTITIES:
            value_and_slope = at_conditions(self.problem, (quantity, None, scene or ""), columns, x)
        if value_and_slope is None:
            value, slope = map(np.asarray, quick_jit()(lambda x: forward(predicted, x))(x))
        else:
            value, slope = (part.reshape((*shape, *part.shape[1:])) for part in value_and_slope)
        return self.widened(value, slope, level)

    def widened(self, value: np.ndarray, slope: np.ndarray, level: float, signed: bool = False) -> Band:
        """Return the band of a prediction, shape (...), from its derivatives by x, shape (..., size).

        The band of a quantity that is `signed` is symmetric in the quantity, also where the value is > 0.
        """
        known = self.uncertainty
        slope = slope * known.stretch
        reach = self.quantile(level) * np.sqrt(np.einsum("...i,ij,...j->...", slope, known.spread, slope))
        positive = (value > 0) & (not signed)
        # exp(700) is near the largest float64; a wider band has no meaning.
        factor = np.exp(np.minimum(reach / np.where(positive, value, 1.0), 700.0))
        low = np.where(positive, value / factor, value - reach)
        return Band(value, low, np.where(positive, value * factor, value + reach))

    def profile(
        self,
        name: str,
        level: float = 0.95,
        points: int = 8,
        callback: Callback | None = None,
        *,
        values: ArrayLike | None = None,
    ) -> LikelihoodProfile:
        """Return the profile likelihood of one parameter, on both sides of its fitted value.

        The cost is taken as -ln likelihood, also with a robust loss. Values are added on each side until
        chi-square has risen by the threshold, or the parameter is a factor of 1e6 from the fit or a millionth
        of its range from a bound. `ends` of the result states the reason. A RuntimeWarning reports a minimum
        below the fit (`better` of the result), or an interval of several parts.

        Parameters
        ----------
        name : one of `names`
        level : confidence level of the interval
        points : number of initial values on each side, up to 1.6 times the linear interval
        callback : as for `fitting.fit`
        values : values of the parameter at which to compute the profile, on both sides of the fitted value
            If None, the profile has `points` values on each side, and further values as needed.
        """
        starts, targets = self.profile_fits(name, level, points, values)
        # Values that a user gives may lie far from the fit.
        solver = NEAR_MINIMUM if values is None else LevenbergMarquardt()
        runs = run_fits(solver, self.problem, starts, targets, callback=callback)
        result = self.profile_of(name, level, runs, values is None, callback)
        if result.warning:
            warnings.warn(f"profile of {name!r}: {result.warning}", RuntimeWarning, stacklevel=2)
        return result

    def profile_fits(
        self, name: str, level: float, points: int, values: ArrayLike | None = None
    ) -> tuple[np.ndarray, Targets]:
        """Return the start vectors and targets of the first fits of a profile."""
        names, known = list(self.names), self.uncertainty
        if name not in names:
            raise ValueError(f"name = {name!r}: must be one of {', '.join(names)}")
        i = names.index(name)
        deviation = np.sqrt(known.spread[i, i]) if known.stretch[i] == 1 else np.inf
        reach = min(1.6 * self.quantile(level) * deviation, OPEN / 10)
        offsets = reach * np.linspace(-1, 1, 2 * points + 1)
        if values is not None:
            offsets = np.sort(np.append(self._x_of(i, values) - self.x[i], 0.0))
        # The other parameters start at the values predicted by the covariance, except at bounds.
        toward = np.where(known.stretch == 1, known.spread[i] / known.spread[i, i], 0.0)
        # Far away the covariance predicts nothing.
        others = offsets[:, None] * toward
        others = others if values is None else np.clip(others, -1.0, 1.0)
        moving = (np.arange(len(names)) != i).astype(float)
        starts = self._inside + others
        starts[:, i] = self.x[i] + offsets
        return starts, self.problem.targets.of_several(moving=moving[None])

    def _x_of(self, i: int, values: ArrayLike) -> np.ndarray:
        """Return the x of element `i` for given values of this element."""
        constants, wanted = self.problem.numbers.constants, np.atleast_1d(np.asarray(values, float))
        kind = self.problem.variables.kinds[i]
        low, width = float(constants.low[i]), float(constants.width[i])
        inside = (wanted > low) & (wanted < low + width if kind == "Bounded" else wanted < np.inf)
        if not np.all(inside | (kind == "Free")):
            raise ValueError(f"values = {wanted}: must be allowed by the rule of {self.names[i]}")
        return to_x(kind, np.asarray(low), np.asarray(width), wanted)

    def profile_of(
        self, name: str, level: float, runs: Runs, extend: bool = True, callback: Callback | None = None
    ) -> LikelihoodProfile:
        """Return the profile of a parameter, given the results of the fits of `profile_fits`, in order."""
        anchor, q = Anchor(self.problem, self.x, self.cost, self._inside), self.quantile(level)
        return profile_from(anchor, self.names.index(name), q, runs, extend, callback)

    def bootstrap(
        self, count: int = 100, key: jax.Array | None = None, callback: Callback | None = None
    ) -> Bootstrap:
        """Fit `count` data sets drawn from the fitted model with the errors of the data.

        Means of priors are drawn with the errors of the priors. Parameters at a bound or driven to zero start
        one standard deviation away, so that they can leave it. The key is jax.random.key(0) if None. For many
        data sets, see `fitting.bootstrap_members`.
        """
        starts, targets = self.bootstrap_fits(count, key)
        runs = run_fits(NEAR_MINIMUM, self.problem, starts, targets, callback=callback)
        good = succeeded(runs.status)
        if was_interrupted(runs.status).any() and not good.any():
            raise KeyboardInterrupt
        return Bootstrap(self.names, self.problem.values(runs.x[good]), int((~good).sum()))

    def bootstrap_fits(self, count: int, key: jax.Array | None) -> tuple[np.ndarray, Targets]:
        """Return the start vectors of the fits of a bootstrap, and the targets with drawn data and priors.

        A prior is drawn like a measurement: otherwise all fits would agree about what the prior says.
        """
        check_options(count=count, key=key)
        key = jax.random.key(0) if key is None else key
        drawn = model_rows(self.problem, self.x) + drawn_errors(self.problem, count, key)
        shape = count, self.problem.targets.prior.size
        known = residual_rows(self.problem, self.x)[drawn.shape[1] :][: shape[1]]
        prior = known + np.asarray(jax.random.normal(jax.random.fold_in(key, 1), shape))
        return np.tile(self._inside, (count, 1)), self.problem.targets.of_several(measured=drawn, prior=prior)


def drawn_errors(problem: Problem, count: int, key: jax.Array) -> np.ndarray:
    """Draw errors of `count` data sets, including model errors, of logarithms if relative, (count, rows)."""
    noise = np.asarray(jax.random.normal(key, (count, problem.targets.measured.size)))
    if problem.numbers.whitening is not None:
        noise = np.linalg.solve(np.asarray(problem.numbers.whitening), noise.T).T
    return np.asarray(problem.targets.error) * noise


class Valley(NamedTuple):
    """A parameter closely correlated with another one, and a check of its linear confidence interval."""

    name: str
    other: str
    correlation: float
    expected: float  # rise of twice the cost at the ends of its linear interval, if error bars hold
    rises: tuple[float, float]  # rise found at the lower and the upper end
    linear: tuple[float, float]  # its linear interval
    interval: tuple[float, float]  # estimate of the profile's; an end is inf if the cost does not rise

    @property
    def holds(self) -> bool:
        """True if the linear interval agrees with the profile."""
        low, high = _HOLD
        return all(low <= rise / self.expected <= high for rise in self.rises)

    @property
    def text(self) -> str:
        """Description of both intervals, with the call that computes the profile."""
        (a, b), (low, high) = self.linear, self.interval
        return (
            f"{self.name} and {self.other} compensate each other (correlation {self.correlation:+.3f}),"
            f" so the {100 * LEVEL:.0f} % interval of {self.name} is about {low:.3g} ... {high:.3g},"
            f" not {a:.3g} ... {b:.3g} as its error bar states: call result.profile({self.name!r})"
        )


def valleys(solved: SolvedProblem) -> tuple[Valley, ...]:
    """Check the linear intervals of the (at most two) pairs of parameters with correlations above 0.98.

    The result is empty for robust losses, whose cost is not a likelihood. Parameters are left out if the
    model is not finite at the ends of their intervals.
    """
    known, names = solved.uncertainty, solved.names
    size = np.triu(np.abs(known.correlation), 1)
    # NaN, of parameters without an error bar, is not above it.
    pairs = sorted(np.argwhere(size > _CORRELATED).tolist(), key=lambda pair: -size[*pair])[:_PAIRS]
    if not pairs or solved.problem.structure.loss != "linear":
        return ()
    partners = {}
    for i, j in pairs:
        partners.setdefault(i, j)
        partners.setdefault(j, i)
    which, q = np.array(list(partners)), solved.quantile(LEVEL)
    deviation = np.sqrt(known.spread[which, which])
    steps = q * known.spread[which] / deviation[:, None]
    ends = np.concatenate([solved.x - steps, solved.x + steps])
    rises = np.maximum(2 * (_refitted(solved, ends, np.tile(which, 2)) - solved.cost), 0.0).reshape(2, -1)
    with np.errstate(divide="ignore"):
        reach = q * deviation * (q / np.sqrt(rises)) * np.array([[-1], [1]])
    linear, interval = (
        np.stack([_values(solved, which, side) for side in offsets], 1)
        for offsets in ((-q * deviation, q * deviation), reach)
    )
    return tuple(
        Valley(names[i], names[j], float(known.correlation[i, j]), q**2, *map(tuple, rows))
        for (i, j), *rows in zip(
            partners.items(), rises.T.tolist(), linear.tolist(), interval.tolist(), strict=True
        )
        if np.isfinite(rows[0]).all()
    )


def _values(solved, which, offsets):
    """Return the values of the parameters `which`, each with its x moved by an offset."""
    x = np.tile(solved.x, (len(which), 1))
    x[np.arange(len(which)), which] += offsets
    return solved.problem.values(x)[np.arange(len(which)), which]


def _refitted(solved, x, held):
    """Return the cost after Gauss-Newton steps from every row k of x with the parameter `held[k]` fixed.

    The cost is inf if the model is not finite.
    """
    of = padded(solved.problem)
    best, cost = x, np.full(len(x), np.inf)
    step = np.zeros_like(x)
    for _ in range(_STEPS + 1):
        evaluated = evaluate_rows(of.structure, of.numbers, x.astype(solved.problem.start.dtype), slopes=True)
        # One by one, with the shapes of the covariance: nothing is compiled.
        rows = np.array([errors_of_rows(of, r) for r in evaluated[0]])
        slopes = [errors_of_slopes(of, s) for s in evaluated[1]]
        here = 0.5 * np.sum(rows**2, 1)
        better = here < cost  # False where not finite
        done = np.all(here > cost - _LITTLE)
        cost, best = np.where(better, here, cost), np.where(better[:, None], x, best)
        if done:
            break
        for k in range(len(x)):
            # Halve a step that raised the cost, else take the next full step.
            if better[k]:
                others = np.arange(x.shape[1]) != held[k]
                step[k, others] = -np.linalg.lstsq(slopes[k][:, others], rows[k], rcond=None)[0]
            else:
                step[k] *= 0.5
        x = best + step
    return cost
