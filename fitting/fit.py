"""Fit free parameters of a scene to measured data, the inverse problem."""

import time
from collections.abc import Callable, Mapping

import jax

import rubberfric as rf
from fitting.data.kinds import DataSets, data_by_scene, warn_of_repeated
from fitting.parameters.constraints import Constraint
from fitting.parameters.discrepancy import Discrepancy
from fitting.parameters.priors import Prior
from fitting.parameters.scenes import as_scenes, each_scene
from fitting.results.result import FitResult
from fitting.solvers.options import check_options, make_solver
from fitting.solvers.problem import make_problem
from fitting.solvers.runs import Callback
from fitting.solvers.search import random_starts
from fitting.stages import FitInProgress, distinct_minima
from fitting.uncertainty.discrepancy import (
    check_discrepancy,
    first_guess,
    with_discrepancy,
)


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
    >>> result = fitting.fit(guess, data, {"lower.spectrum.hurst": fitting.Bounded(0.3, 1.0)})
    >>> round(float(result.scene.lower.spectrum.hurst), 4)
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
    run = FitInProgress(problem, data, make_solver(method, tolerance, max_steps), max_steps, callback, tell)
    runs = run.search(random_starts(problem.variables, problem.start, key, starts, decades))
    if quadrature is None:
        run.refine_quadrature()
    run.confirm()
    runs += run.fit_further(further_time if starts == 1 else 0.0, key, decades)
    minima = distinct_minima(problem, runs)
    run.estimate_errors(scale_errors)
    if discrepancy is not None:
        discrepancy = run.estimate_discrepancy(discrepancy, scenes)
    bounds = run.follow_bounds(further_time - run.further_seconds, run.other_minima(runs))
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
