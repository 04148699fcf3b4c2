"""The stages of a fit: search, confirmation, further starts, errors from the scatter, and bounds."""

import time
from collections.abc import Callable, Sequence

import jax
import numpy as np

import rubberfric as rf
from fitting.budget.contact_model import NoLawError, log_ratio_to_law
from fitting.data.measured import Measured
from fitting.parameters.discrepancy import Discrepancy
from fitting.parameters.plausible import implausible
from fitting.parameters.variables import Array
from fitting.results.at_bounds import AtBound, along_bounds
from fitting.results.record import Minimum
from fitting.solvers.evaluation import model_rows, residual_rows
from fitting.solvers.further import fit_further
from fitting.solvers.objective import (
    INTERRUPTED,
    OUT_OF_STEPS,
    RUNNING,
    STALLED,
    UNMOVED,
    negligible,
    succeeded,
    was_interrupted,
)
from fitting.solvers.options import Solver
from fitting.solvers.problem import ASSUMED, Problem, finer
from fitting.solvers.runs import Callback, Runs, run_fits
from fitting.solvers.search import confirm_minimum, is_high, search
from fitting.uncertainty.covariance import at_bounds, linearised, uncertainty
from fitting.uncertainty.discrepancy import (
    averaged,
    first_guess,
    is_open,
    with_discrepancy,
    with_remark,
)
from fitting.uncertainty.intervals import SolvedProblem
from fitting.uncertainty.verdict import common_ratio, rescaled_errors

# Number of fits, each weighted with the errors that the previous fit estimated.
ROUNDS = 2
# Number of other minima whose fits are continued after the errors have changed.
_CONTINUED = 8
# Decimals of x to which the ends of fits are compared.
_DECIMALS = 3


class FitInProgress:
    """A fit in progress: its problem, the best result so far, the estimated errors, and the uncertainty."""

    def __init__(
        self,
        problem: Problem,
        data: Sequence[Measured],
        solver: Solver,
        max_steps: int | None,
        callback: Callback | None,
        tell: Callable[[str], object],
    ) -> None:
        self.problem, self.data, self.tell = problem, data, tell
        self.solver, self.limits = solver, (max_steps, callback)
        self.scales = [None if dataset.error is not None else ASSUMED for dataset in data]
        self.error_scale, self.assumed = 1.0, self.scales.count(None) < len(data)

    def search(self, x: Array) -> list[Runs]:
        """Fit from all starts x, keep the result with the lowest cost, and return all results."""
        runs = search(self.solver, self.problem, x, *self.limits)
        self.evaluations = np.array([runs.nfev.sum(), runs.njev.sum()])
        costs = np.where(np.isfinite(runs.cost), runs.cost, np.inf)  # argmin would return a NaN
        if not np.isfinite(costs).any():
            if was_interrupted(runs.status).any():
                raise KeyboardInterrupt
            raise FloatingPointError(why_not_finite(self.problem, self.data))
        self.end = runs.row(int(np.argmin(costs)))
        return [runs.row(i) for i in range(len(costs))]

    def onward(self, x: Array, is_late: Callable[[], bool] = lambda: False) -> Runs:
        """Return the result of a fit from x, which ends when `is_late()` is True."""
        most, callback = self.limits

        def called(*progress):
            if callback is not None:
                callback(*progress)
            if is_late():
                raise KeyboardInterrupt

        end = run_fits(self.solver, self.problem, x[None], None, most, called).row(0)
        self.evaluations += end.nfev, end.njev
        return end

    def go_on(self, problem: Problem) -> bool:
        """Continue with another problem, and return False if an interrupt came before its evaluation."""
        before, self.problem = self.problem, problem
        end = self.onward(self.end.x)
        if end.status == RUNNING:  # no cost of the other problem is known
            self.problem, self.end = before, self.end._replace(status=INTERRUPTED)
            return False
        self.end = end
        return True

    def judge(self) -> None:
        """Compute the uncertainty of the result."""
        self.model = linearised(self.problem, self.end.x)
        self.known = uncertainty(self.problem, self.end.x, self.model)

    def refine_quadrature(self) -> None:
        """Continue the fit as long as the scene at its end needs a finer quadrature."""
        while succeeded(self.end.status) and (more := finer(self.problem, self.end.x, self.data)) is not None:
            self.tell("fitting on, with the quadrature that the scene at the end of the fit needs")
            self.go_on(more)

    def confirm(self) -> None:
        """Check the minimum, continue from a lower point if there is one, and compute the uncertainty."""
        self.searched = self.problem
        self.end, spent = confirm_minimum(self.problem, self.end, self.onward)
        self.evaluations += spent
        self.tell("compiling and computing the covariance")
        self.judge()

    def faults(self, end: Runs) -> tuple[str, ...]:
        """Return reasons for further starts: bounds, implausible values, and a cost too high for chance."""
        problem = self.problem
        known = at_bounds(problem, end.x)
        reasons = [f"{name} is {text}" for name, text in known.items()]
        values = problem.values(end.x)
        for name, (low, high) in implausible(problem.names, values).items():
            if name not in known:
                value = values[problem.names.index(name)]
                reasons.append(f"{name} = {value:.3g} is outside {low:g} ... {high:g}")
        if end.status in (STALLED, UNMOVED):
            reasons.append("the fit did not converge")
        elif not self.assumed and is_high(problem, float(end.cost)):
            reasons.append("the scene does not explain the data")
        return tuple(reasons)

    def fit_further(self, seconds: float, key: jax.Array | None, decades: float) -> list[Runs]:
        """Fit from further starts if the result has faults, and return the results of these fits."""
        self.further = None
        if was_interrupted(self.end.status) or self.end.status == OUT_OF_STEPS:
            return []
        before = self.end
        # The other half is for `follow_bounds`.
        result = fit_further(self.problem, before, self.faults, self.onward, seconds / 2, key, decades)
        self.end, runs, self.further = result
        if self.end is not before:
            self.judge()
        return runs

    @property
    def further_seconds(self) -> float:
        """Time that further starts took [s]."""
        return 0.0 if self.further is None else self.further.seconds

    def follow_bounds(self, seconds: float, minima: np.ndarray) -> tuple[AtBound, ...]:
        """Withhold error bars that hold at a bound only, and return the fits along the bounds."""
        began = time.perf_counter()
        for _ in range(ROUNDS if seconds > 0 and succeeded(self.end.status) else 0):
            solved = SolvedProblem(
                problem=self.problem,
                x=self.end.x,
                cost=float(self.end.cost),
                estimated=tuple(self.scales),
                error_scale=self.error_scale,
                uncertainty=self.known,
            )
            left = seconds + began - time.perf_counter()
            bounds, self.known, lower = along_bounds(solved, minima, left)
            if lower is None:
                return bounds
            before = self.end
            self.end = self.onward(lower)
            if not succeeded(self.end.status) or not self.end.cost < before.cost:
                self.end = before
                return ()
            self.judge()
        return ()

    def estimate_errors(self, scale_errors: bool | str) -> None:
        """Estimate errors from the scatter, and fit again where they move the minimum."""
        rescaled = scale_errors is True and None in self.scales
        to_estimate = self.assumed and scale_errors is not False
        for _ in range(ROUNDS if to_estimate or rescaled else 0):
            freedom = self.problem.targets.measured.size - self.known.parameters
            if freedom < 0.5 or not succeeded(self.end.status):
                return
            before, known = self.problem, (self.known, self.model)
            problem, scales, factor = rescaled_errors(before, self.scales, *known, rescaled, self.error_scale)
            ratio = common_ratio(before, problem)
            if ratio is None:
                self.tell("fitting again, with errors from the scatter")
                if not self.go_on(problem):
                    return
            else:
                if self.searched is before:  # minima do not move
                    self.searched = problem
                self.problem, self.end = problem, self.end._replace(cost=self.end.cost / ratio**2)
            self.scales, self.error_scale, self.assumed = scales, self.error_scale * factor, False
            if ratio is not None:
                self.known = uncertainty(self.problem, self.end.x, self.model)
                return
            self.judge()

    def estimate_discrepancy(self, asked: Discrepancy, scenes: Sequence[rf.Scene]) -> Discrepancy:
        """Return the discrepancy with its estimated amplitude and width, for which the fit is repeated."""
        latest = first_guess(asked, scenes)
        for _ in range(ROUNDS if succeeded(self.end.status) and is_open(asked) else 0):
            known = self.difference_to_law() if asked.amplitude is None else None
            estimate = averaged(self.problem, self.model, scenes, self.data, asked, known)
            if not self.go_on(with_discrepancy(self.problem, scenes, self.data, estimate)):
                break
            latest = estimate
            self.judge()
        solved = self.problem, self.model, scenes, self.data, asked
        return with_remark(latest, asked, solved if succeeded(self.end.status) else None)

    def other_minima(self, runs: Sequence[Runs]) -> np.ndarray:
        """Return x of the minima that several fits found, shape (minima, size).

        If the errors of the data have changed since, the fits of the lowest minima are continued, because
        minima move with the errors.
        """
        x = np.array([run.x for run in sorted(runs, key=lambda run: run.cost) if succeeded(run.status)])
        if self.problem is self.searched or not succeeded(self.end.status):
            return x
        # Fits that end in the same minimum agree to about the root of the tolerance.
        first = np.sort(np.unique(np.round(x, _DECIMALS), axis=0, return_index=True)[1])
        x = x[first]
        most, callback = self.limits
        ends = run_fits(self.solver, self.problem, x[:_CONTINUED], None, most, callback)
        self.evaluations += ends.nfev.sum(), ends.njev.sum()
        return ends.x[succeeded(ends.status)]

    def difference_to_law(self) -> np.ndarray | None:
        """Return ln(law / theory) of all friction and area values, or None without the comparison."""
        try:
            return log_ratio_to_law(self.problem, self.end.x)
        except NoLawError:
            return None


def distinct_minima(problem: Problem, runs: Sequence[Runs]) -> tuple[Minimum, ...]:
    """Return the minima of distinct cost that several fits found, lowest first."""
    minima = []
    for run in sorted(runs, key=lambda run: run.cost):
        if not succeeded(run.status):
            continue
        cost = float(run.cost)
        if minima and cost - minima[-1].cost <= negligible(minima[-1].cost):
            minima[-1] = minima[-1]._replace(count=minima[-1].count + 1)
        else:
            minima.append(Minimum(cost, 1, problem.values(run.x)))
    return tuple(minima)


def why_not_finite(problem: Problem, data: Sequence[Measured]) -> str:
    """Return the error message for a cost that is not finite at the start."""
    model, errors = model_rows(problem, problem.start), np.asarray(problem.targets.error)
    for dataset, where in zip(data, problem.order, strict=True):
        bad = np.flatnonzero(~np.isfinite(model[where]))
        if bad.size == 0:
            continue
        advice = "check the start values of the free parameters"
        if dataset.logarithmic:
            advice += (
                ", and give absolute errors (sigma) where the model may be 0 or less, as at velocities <= 0"
            )
        return (
            f"data {dataset.label!r}: the model is not finite at the start at {bad.size} of {where.size}"
            f" values, first at {dataset.place(bad[0])}: {advice}"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        overflows = ~np.isfinite(residual_rows(problem, problem.start) ** 2)
    for dataset, where in zip(data, problem.order, strict=True):
        bad = np.flatnonzero(overflows[where])
        if bad.size:
            error, place = errors[where][bad[0]], dataset.place(bad[0])
            return (
                f"data {dataset.label!r}: the error {error:.3g} at {place} is so small that the cost"
                " overflows: check the errors of the data and their unit"
            )
    if overflows[model.size :].any():
        return (
            "a prior is not finite at the start: check the start values of the parameters in the prior, and"
            " its sigma"
        )
    return "the cost overflows at the start: check the start values and the errors of the data"
