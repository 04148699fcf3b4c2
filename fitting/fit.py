"""Fit free parameters of a scene to measured data, the inverse problem."""

import time
from collections.abc import Callable, Mapping

import jax
import numpy as np

import rubberfric as rf
from fitting.budget.contact_model import NoLawError, log_ratio_to_law
from fitting.data.kinds import DataSets, data_by_scene, warn_of_repeated
from fitting.parameters.constraints import Constraint
from fitting.parameters.discrepancy import Discrepancy
from fitting.parameters.plausible import implausible
from fitting.parameters.priors import Prior
from fitting.parameters.scenes import as_scenes, each_scene
from fitting.results.at_bounds import along_bounds
from fitting.results.record import Minimum
from fitting.results.result import FitResult
from fitting.solvers.evaluation import model_rows, residual_rows
from fitting.solvers.further import fit_further
from fitting.solvers.objective import (
    INTERRUPTED,
    NEGLIGIBLE,
    OUT_OF_STEPS,
    RUNNING,
    STALLED,
    UNMOVED,
    succeeded,
    was_interrupted,
)
from fitting.solvers.options import check_options, make_solver
from fitting.solvers.problem import ASSUMED, finer, make_problem
from fitting.solvers.runs import FIT_BATCH, Callback, run_fits
from fitting.solvers.search import confirm_minimum, is_high, random_starts, search
from fitting.uncertainty.covariance import at_bounds, linearised, uncertainty
from fitting.uncertainty.discrepancy import (
    averaged,
    check_discrepancy,
    first_guess,
    is_open,
    with_discrepancy,
    with_remark,
)
from fitting.uncertainty.intervals import SolvedProblem
from fitting.uncertainty.verdict import common_ratio, rescaled_errors

# Number of fits, each weighted with the errors that the previous fit estimated.
ROUNDS = 2


def fit(
    scene: rf.Scene | Mapping[str, rf.Scene],
    data: DataSets | Mapping[str, DataSets],
    free: Mapping[str, Constraint],
    method: str = "lm",
    starts: int = 1,
    key: jax.Array | None = None,
    prior: Mapping[str, Prior] | None = None,
    callback: Callback | None = None,
    *,
    loss: str = "linear",
    loss_width: float | None = None,
    decades: float = 1.0,
    max_steps: int | None = None,
    tolerance: float | None = None,
    quadrature: rf.Quadrature | None = None,
    scale_errors: bool | str = "auto",
    discrepancy: Discrepancy | None = None,
    further_time: float = 30.0,
    progress: Callable[[str], object] | None = None,
) -> FitResult:
    r"""Fit free parameters of a scene to measured data.

    .. math:: \min_\theta \; \frac12 \sum_i \rho(r_i^2) + \frac12 \sum_k p_k^2

    over the residuals r of the data and p of the priors, in units of their errors
    (`fitting.solvers.residuals`, `fitting.parameters.priors`), in variables that keep the parameters within
    their rules (`fitting.parameters.variables`).

    Parameters
    ----------
    scene : Scene, or dict of name -> Scene
        gives the values of fixed parameters, and the initial guess of free ones.
    data : FrictionData, AreaData, ModulusData, SpectrumData, or a list of them, fitted jointly
        For several scenes, give a dict from the names of the scenes to data: {"R20": data, "R40": [a, b]}.
    free : dict of key path -> Positive, Bounded, Free, Tied or RmsSlope
        Such as {"upper.material.E": Positive(), "lower.spectrum.hurst": Bounded(0.3, 1)}. For several scenes
        `R20.shear.tau_f0` is a parameter of one scene, `*.shear.tau_f0` a parameter that all scenes share.
    method : "lm" (Levenberg-Marquardt), "lbfgs" or "adam"
    starts : number of starts; the first has the values of the scene, the others are random (see `decades`)
    key : jax.random.key for random starts, or None for key(0)
    prior : dict of key path -> Gaussian, Smooth, Sum or Correlated, or None
        A Gaussian on a fixed number states its error for `FitResult.budget`.
        The result of another fit can be a prior: prior=fit_prony(data).as_prior("lower") | {...}.
    callback : called as callback(step, cost) after every step, or None
    loss, loss_width : "linear", "huber", "soft_l1" or "cauchy", and its width in standard errors
        If the width is None, the loss is 95 % efficient for Gaussian data (`fitting.solvers.objective`).
    decades : random starts of Positive parameters lie within a factor 10^decades of the scene's values
    max_steps, tolerance : limits of the method. If None, the method has default limits.
    quadrature : Quadrature of the forward model
        If None, the quadrature is chosen for the scene at the start. If the scene at the end needs a finer
        quadrature, the fit continues with the finer one.
    scale_errors : "auto", True or False
        Estimate the size of the errors from the scatter about the fit. Error bars, bands and densities use
        this estimate. With "auto", only errors of data without given errors are estimated. If the scene does
        not explain data with given errors, the report lists error bars with and without scaling by the
        scatter. With True, given errors are relative weights, all multiplied by `FitResult.error_scale`.
        With False, nothing is estimated, and data without errors have an error of 10 %.
    discrepancy : Discrepancy or None
        error of the theory of friction, see `fitting.Discrepancy`. Error bars, bands and verdict include it,
        and the report states its size. If None, the theory is treated as exact.
    further_time : time after which no further fits begin [s]; 0: none
        If a fit from one start ends at a bound, at an implausible value, or too far from the data for chance,
        up to 8 fits begin at further random points, see `fitting.solvers.further`. Parameters without an
        error bar are then held at other values, because error bars of correlated parameters may hold at the
        bound only, see `fitting.results.at_bounds`. The report describes these fits.
    progress : function of a line of text, or None
        called before steps that take seconds without callbacks, such as compiling.

    Returns
    -------
    FitResult
        the fit from the start with the lowest cost. An interrupt from the keyboard during the steps ends the
        fit with the best values so far and `success` False.

    Raises
    ------
    ValueError : an invalid path, start, prior or option, data that the scene cannot predict, or more free
        parameters than values and priors.
    FloatingPointError : the model or a prior is not finite at any start.
    KeyboardInterrupt : an interrupt before the first evaluation, or while the covariance is computed.

    Notes
    -----
    Each data set without errors has one relative error, which is estimated from its scatter about the fit.
    If this can move the minimum (several data sets, priors or a robust loss), a second fit uses the first
    estimate as weights. The report states the estimate. The `verdict` of the result states if the scene
    explains the data.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> v = np.logspace(-5, 0, 12)
    >>> data = fitting.FrictionData(v, rf.friction(scene, v, 0.15e6), pressure=0.15e6, relative=0.03)
    >>> guess = scene.replace("lower.spectrum.hurst", 0.7)
    >>> found = fitting.fit(guess, data, {"lower.spectrum.hurst": fitting.Bounded(0.3, 1.0)})
    >>> round(float(found.scene.lower.spectrum.hurst), 4)
    0.8
    """
    began = time.perf_counter()
    check_options(method=method, starts=starts, key=key, prior=prior, callback=callback)
    check_options(decades=decades, max_steps=max_steps, tolerance=tolerance, scale_errors=scale_errors)
    check_options(further_time=further_time)
    scene = as_scenes(scene)
    data, of = data_by_scene(data, scene if isinstance(scene, dict) else None)
    warn_of_repeated(data, of)
    problem = make_problem(scene, data, free, prior, loss, loss_width, quadrature, of)
    scenes = each_scene(scene, of)
    if discrepancy is not None:
        check_discrepancy(discrepancy, data, loss, scale_errors)
        problem = with_discrepancy(problem, scenes, data, first_guess(discrepancy, scenes))
    tell = progress or (lambda _: None)
    tell(f"compiling a fit of {problem.variables.size} numbers to {problem.targets.measured.size} values")
    run = _Run(problem, data, make_solver(method, tolerance, max_steps), max_steps, callback, tell)
    runs = run.search(random_starts(problem.variables, problem.start, key, starts, decades))
    if quadrature is None:
        run.refine_quadrature()
    run.confirm()
    runs += run.fit_further(further_time if starts == 1 else 0.0, key, decades)
    minima = _minima(problem, runs)
    run.estimate_errors(scale_errors)
    if discrepancy is not None:
        discrepancy = run.estimate_discrepancy(discrepancy, scenes)
    minima_x = np.array([one.x for one in runs if succeeded(one.status)])
    bounds = run.follow_bounds(further_time - run.further_seconds, minima_x)
    return FitResult(
        scene_at_start=scene,
        free=dict(free),
        prior=dict(prior or {}),
        method=method,
        data=tuple(data),
        data_scenes=tuple(of),
        problem=run.problem,
        x=run.end.x,
        status=int(run.end.status),
        cost=float(run.end.cost),
        nfev=int(run.evaluations[0]),
        njev=int(run.evaluations[1]),
        minima=minima,
        estimated=tuple(run.scales),
        assumed=run.assumed,
        error_scale=run.error_scale,
        uncertainty=run.known,
        discrepancy=discrepancy,
        further=run.further,
        bounds=bounds,
        seconds=time.perf_counter() - began,
    )


class _Run:
    """A fit in progress: its problem, the best result so far, the estimated errors, and the uncertainty."""

    def __init__(self, problem, data, solver, max_steps, callback, tell):
        self.problem, self.data, self.tell = problem, data, tell
        self.solver, self.limits = solver, (max_steps, callback)
        self.scales = [None if one.error is not None else ASSUMED for one in data]
        self.error_scale, self.assumed = 1.0, self.scales.count(None) < len(data)

    def search(self, x):
        """Fit from all starts x, keep the result with the lowest cost, and return all results."""
        runs = search(self.solver, self.problem, x, *self.limits)
        # Further fits keep the batch size, because another one would need a compilation.
        self.batch = min(FIT_BATCH, len(x))
        self.evaluations = np.array([runs.nfev.sum(), runs.njev.sum()])
        costs = np.where(np.isfinite(runs.cost), runs.cost, np.inf)  # argmin would return a NaN
        if not np.isfinite(costs).any():
            if was_interrupted(runs.status).any():
                raise KeyboardInterrupt
            raise FloatingPointError(_not_finite(self.problem, self.data))
        self.end = runs.row(int(np.argmin(costs)))
        return [runs.row(i) for i in range(len(costs))]

    def onward(self, x, is_late=lambda: False):
        """Return the result of a fit from x, which ends when `is_late()` is True."""
        most, callback = self.limits

        def called(*progress):
            if callback is not None:
                callback(*progress)
            if is_late():
                raise KeyboardInterrupt

        end = run_fits(self.solver, self.problem, x[None], None, most, called, self.batch).row(0)
        self.evaluations += end.nfev, end.njev
        return end

    def go_on(self, problem):
        """Continue with another problem, and return False if an interrupt came before its evaluation."""
        before, self.problem = self.problem, problem
        end = self.onward(self.end.x)
        if end.status == RUNNING:  # no cost of the other problem is known
            self.problem, self.end = before, self.end._replace(status=INTERRUPTED)
            return False
        self.end = end
        return True

    def judge(self):
        """Compute the uncertainty of the result."""
        self.model = linearised(self.problem, self.end.x)
        self.known = uncertainty(self.problem, self.end.x, self.model)

    def refine_quadrature(self):
        """Continue the fit as long as the scene at its end needs a finer quadrature."""
        while succeeded(self.end.status) and (more := finer(self.problem, self.end.x, self.data)) is not None:
            self.tell("fitting on, with the quadrature that the scene at the end of the fit needs")
            self.go_on(more)

    def confirm(self):
        """Check the minimum, continue from a lower point if there is one, and compute the uncertainty."""
        self.end, spent = confirm_minimum(self.problem, self.end, self.onward)
        self.evaluations += spent
        self.tell("compiling and computing the covariance")
        self.judge()

    def faults(self, end):
        """Return reasons for further starts: bounds, implausible values, and a cost too high for chance."""
        problem = self.problem
        known = at_bounds(problem, end.x)
        found = [f"{name} is {text}" for name, text in known.items()]
        values = problem.values(end.x)
        for name, (low, high) in implausible(problem.names, values).items():
            if name not in known:
                value = values[problem.names.index(name)]
                found.append(f"{name} = {value:.3g} is outside {low:g} ... {high:g}")
        if end.status in (STALLED, UNMOVED):
            found.append("the fit did not converge")
        elif not self.assumed and is_high(problem, end.cost):
            found.append("the scene does not explain the data")
        return tuple(found)

    def fit_further(self, seconds, key, decades):
        """Fit from further starts if the result has faults, and return the results of these fits."""
        self.further = None
        if was_interrupted(self.end.status) or self.end.status == OUT_OF_STEPS:
            return []
        before = self.end
        # The other half is for `follow_bounds`.
        found = fit_further(self.problem, before, self.faults, self.onward, seconds / 2, key, decades)
        self.end, runs, self.further = found
        if self.end is not before:
            self.judge()
        return runs

    @property
    def further_seconds(self):
        """Time that further starts took [s]."""
        return 0.0 if self.further is None else self.further.seconds

    def follow_bounds(self, seconds, minima):
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
            bounds, self.known, lower = along_bounds(
                solved, minima, seconds + began - time.perf_counter(), self.batch
            )
            if lower is None:
                return bounds
            before = self.end
            self.end = self.onward(lower)
            if not succeeded(self.end.status) or not self.end.cost < before.cost:
                self.end = before
                return ()
            self.judge()
        return ()

    def estimate_errors(self, scale_errors):
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
                self.problem, self.end = problem, self.end._replace(cost=self.end.cost / ratio**2)
            self.scales, self.error_scale, self.assumed = scales, self.error_scale * factor, False
            if ratio is not None:
                self.known = uncertainty(self.problem, self.end.x, self.model)
                return
            self.judge()

    def estimate_discrepancy(self, asked, scenes):
        """Return the discrepancy with its estimated amplitude and width, for which the fit is repeated."""
        found = first_guess(asked, scenes)
        for _ in range(ROUNDS if succeeded(self.end.status) and is_open(asked) else 0):
            known = self.difference_to_law() if asked.amplitude is None else None
            estimate = averaged(self.problem, self.model, scenes, self.data, asked, known)
            if not self.go_on(with_discrepancy(self.problem, scenes, self.data, estimate)):
                break
            found = estimate
            self.judge()
        solved = self.problem, self.model, scenes, self.data, asked
        return with_remark(found, asked, solved if succeeded(self.end.status) else None)

    def difference_to_law(self):
        """Return ln(law / theory) of all friction and area values, or None without the comparison."""
        try:
            return log_ratio_to_law(self.problem, self.end.x)
        except NoLawError:
            return None


def _minima(problem, runs):
    """Return the distinct minima that the starts found, lowest first."""
    found = []
    for run in sorted(runs, key=lambda run: run.cost):
        if not succeeded(run.status):
            continue
        cost = float(run.cost)
        if found and cost - found[-1].cost <= NEGLIGIBLE * max(1.0, found[-1].cost):
            found[-1] = found[-1]._replace(count=found[-1].count + 1)
        else:
            found.append(Minimum(cost, 1, problem.values(run.x)))
    return tuple(found)


def _not_finite(problem, data):
    """Return the error message for a cost that is not finite at the start."""
    model, errors = model_rows(problem, problem.start), np.asarray(problem.targets.error)
    for one, where in zip(data, problem.order, strict=True):
        bad = np.flatnonzero(~np.isfinite(model[where]))
        if bad.size == 0:
            continue
        advice = "check the start values of the free parameters"
        if one.logarithmic:
            advice += (
                ", and give absolute errors (sigma) where the model may be 0 or less, as at velocities <= 0"
            )
        return (
            f"data {one.label!r}: the model is not finite at the start at {bad.size} of {where.size} values,"
            f" first at {one.place(bad[0])}: {advice}"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        overflows = ~np.isfinite(residual_rows(problem, problem.start) ** 2)
    for one, where in zip(data, problem.order, strict=True):
        bad = np.flatnonzero(overflows[where])
        if bad.size:
            error, place = errors[where][bad[0]], one.place(bad[0])
            return (
                f"data {one.label!r}: the error {error:.3g} at {place} is so small that the cost overflows:"
                " check the errors of the data and their unit"
            )
    if overflows[model.size :].any():
        return (
            "a prior is not finite at the start: check the start values of the parameters in the prior, and"
            " its sigma"
        )
    return "the cost overflows at the start: check the start values and the errors of the data"
