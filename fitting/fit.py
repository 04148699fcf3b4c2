"""Fit free parameters of a scene to measured data, the inverse problem."""

import functools
import time
from collections.abc import Callable, Mapping

import jax
import numpy as np

import rubberfric as rf
from fitting.data.kinds import DataSets, data_by_scene, warn_of_repeated
from fitting.parameters.constraints import Constraint
from fitting.parameters.discrepancy import Discrepancy
from fitting.parameters.priors import Prior
from fitting.parameters.scenes import as_scenes, each_scene
from fitting.results.record import Minimum
from fitting.results.result import FitResult
from fitting.solvers.evaluation import residual_rows
from fitting.solvers.objective import NEGLIGIBLE, succeeded
from fitting.solvers.options import check_options, make_solver
from fitting.solvers.problem import ASSUMED, finer, make_problem
from fitting.solvers.runs import FIT_BATCH, Callback, run_fits
from fitting.solvers.search import confirm_minimum, random_starts, search
from fitting.uncertainty.covariance import linearised, uncertainty
from fitting.uncertainty.discrepancy import (
    averaged,
    check_discrepancy,
    first_guess,
    is_open,
    with_discrepancy,
    with_remark,
)
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
    progress : function of a line of text, or None
        called before steps that take seconds without callbacks, such as compiling.

    Returns
    -------
    FitResult
        the fit from the start with the lowest cost. An interrupt from the keyboard ends the fit with the best
        values so far and `success` False.

    Raises
    ------
    ValueError : an invalid path, start, prior or option, data that the scene cannot predict, or more free
        parameters than values and priors.
    FloatingPointError : the model is not finite at any start.

    Notes
    -----
    Each data set without errors has one relative error, which is estimated from its scatter about the fit.
    If this can move the minimum (several data sets, priors or a robust loss), a second fit uses the first
    estimate as weights. The report states the estimate. The `verdict` of the result states if the scene
    explains the data.
    """
    began = time.perf_counter()
    check_options(method=method, starts=starts, key=key, prior=prior, callback=callback)
    check_options(decades=decades, max_steps=max_steps, tolerance=tolerance, scale_errors=scale_errors)
    scene = as_scenes(scene)
    data, of = data_by_scene(data, scene if isinstance(scene, dict) else None)
    warn_of_repeated(data, of)
    problem = make_problem(scene, data, free, prior, loss, loss_width, quadrature, of)
    scenes = each_scene(scene, of)
    if discrepancy is not None:
        check_discrepancy(discrepancy, data, loss, scale_errors)
        problem = with_discrepancy(problem, scenes, data, first_guess(discrepancy, scenes))
    solver = make_solver(method, tolerance, max_steps)
    tell = progress or (lambda _: None)
    tell(f"compiling a fit of {problem.variables.size} numbers to {problem.targets.measured.size} values")
    x = random_starts(problem.variables, problem.start, key, starts, decades)
    runs = search(solver, problem, x, max_steps, callback)
    end, minima = _lowest(problem, runs, data), _minima(problem, runs)
    evaluations = np.array([runs.nfev.sum(), runs.njev.sum()])

    def onward(problem, x):
        # Keep the batch size, because another one would need a compilation.
        batch = min(FIT_BATCH, starts)
        end = run_fits(solver, problem, x[None], None, max_steps, callback, batch).row(0)
        evaluations[:] += end.nfev, end.njev
        return end

    def judged(problem, end):
        model = linearised(problem, end.x)
        return end, model, uncertainty(problem, end.x, model)

    while quadrature is None and succeeded(end.status) and (more := finer(problem, end.x, data)) is not None:
        tell("fitting on, with the quadrature that the scene at the end of the fit needs")
        problem, end = more, onward(more, end.x)
    end, spent = confirm_minimum(problem, end, functools.partial(onward, problem))
    evaluations += spent
    tell("compiling and computing the covariance")
    end, model, known = judged(problem, end)
    scales = [None if one.error is not None else ASSUMED for one in data]
    error_scale, rescaled = 1.0, scale_errors is True and None in scales
    assumed = any(scale is not None for scale in scales)
    to_estimate = assumed and scale_errors is not False
    for _ in range(ROUNDS if to_estimate or rescaled else 0):
        if problem.targets.measured.size - known.parameters < 0.5 or not succeeded(end.status):
            break
        before = problem
        problem, scales, factor = rescaled_errors(problem, scales, known, model, rescaled, error_scale)
        error_scale, assumed = error_scale * factor, False
        ratio = common_ratio(before, problem)
        if ratio is not None:
            end = end._replace(cost=end.cost / ratio**2)
            known = uncertainty(problem, end.x, model)
            break
        tell("fitting again, with errors from the scatter")
        end, model, known = judged(problem, onward(problem, end.x))
    if discrepancy is not None:
        asked, discrepancy = discrepancy, first_guess(discrepancy, scenes)
        for _ in range(ROUNDS if succeeded(end.status) and is_open(asked) else 0):
            discrepancy = averaged(problem, model, scenes, data, asked)
            problem = with_discrepancy(problem, scenes, data, discrepancy)
            end, model, known = judged(problem, onward(problem, end.x))
        found = (problem, model, scenes, data, asked) if succeeded(end.status) else None
        discrepancy = with_remark(discrepancy, asked, found)
    return FitResult(
        scene_at_start=scene,
        free=dict(free),
        prior=dict(prior or {}),
        method=method,
        data=tuple(data),
        data_scenes=tuple(of),
        problem=problem,
        x=end.x,
        status=int(end.status),
        cost=float(end.cost),
        nfev=int(evaluations[0]),
        njev=int(evaluations[1]),
        minima=minima,
        estimated=tuple(scales),
        assumed=assumed,
        error_scale=error_scale,
        uncertainty=known,
        discrepancy=discrepancy,
        seconds=time.perf_counter() - began,
    )


def _minima(problem, runs):
    """Return the distinct minima that the starts found, lowest first."""
    found = []
    for i in np.argsort(runs.cost):
        if not succeeded(runs.status[i]):
            continue
        cost = float(runs.cost[i])
        if found and cost - found[-1].cost <= NEGLIGIBLE * max(1.0, found[-1].cost):
            found[-1] = found[-1]._replace(count=found[-1].count + 1)
        else:
            found.append(Minimum(cost, 1, problem.values(runs.x[i])))
    return tuple(found)


def _lowest(problem, runs, data):
    """Return the result with the lowest cost, or raise FloatingPointError if the model is never finite."""
    costs = np.where(np.isfinite(runs.cost), runs.cost, np.inf)  # argmin would return a NaN
    if not np.isfinite(costs).any():
        raise FloatingPointError(_not_finite(problem, data))
    return runs.row(int(np.argmin(costs)))


def _not_finite(problem, data):
    """Return the error message for a model that is not finite at the start."""
    rows = residual_rows(problem, problem.start)
    for one, where in zip(data, problem.order, strict=True):
        bad = np.flatnonzero(~np.isfinite(rows[where]))
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
    return "a prior is not finite at the start; check the start values of the parameters in the prior"
