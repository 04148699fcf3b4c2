"""The inverse fit: free parameters of a scene from measured data."""

import dataclasses
import time

import jax
import numpy as np

from fitting.parameters.layout import random_starts, to_values
from fitting.results.result import FitResult, Minimum
from fitting.solvers.first_order import LBFGS, Adam
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.options import check_friction, check_options, data_sets, not_finite
from fitting.solvers.problem import ASSUMED, make_problem
from fitting.solvers.runs import LANES, run_problem
from fitting.solvers.starts import search
from fitting.solvers.status import CONVERGED, PERFECT
from fitting.uncertainty.covariance import residual_rows, uncertainty

METHODS = {"lm": LevenbergMarquardt, "lbfgs": LBFGS, "adam": Adam}

# Fits, each weighted with the errors that the one before it estimated.
ROUNDS = 2
# Costs that differ by less belong to one minimum: a hundredth of a standard error.
SAME_COST = 5e-5


def fit(
    scene,
    data,
    free,
    method="lm",
    starts=1,
    key=None,
    prior=None,
    callback=None,
    *,
    loss="linear",
    loss_width=None,
    decades=1.0,
    max_steps=None,
    tolerance=None,
    quadrature=None,
):
    r"""Fit free parameters of a scene to measured data.

    .. math:: \min_\theta \; \frac12 \sum_i \rho(r_i^2) + \frac12 \sum_k p_k^2

    over the residuals r of the data and p of the priors, in units of their errors
    (`fitting.solvers.problem`, `fitting.parameters.priors`), in variables that keep the parameters within their
    rules (`fitting.parameters.layout`).

    Parameters
    ----------
    scene : Scene
        gives every number that is not free, and the start of those that are.
    data : FrictionData, AreaData, ModulusData, SpectrumData, or a list of them, fitted jointly
    free : dict of key path -> Positive, Bounded, Free or Tied
        such as {"upper.material.E": Positive(), "lower.spectrum.hurst": Bounded(0.3, 1)}.
    method : "lm" (Levenberg-Marquardt), "lbfgs" or "adam"
    starts : number of starts; the first is the scene's, the others random (`decades`)
    key : jax.random.key for random starts, or None for key(0)
    prior : dict of key path -> Gaussian or Smooth, or None
    callback : called as callback(step, cost) after every step, or None
    loss, loss_width : "linear", "huber", "soft_l1" or "cauchy", and its width in standard errors
        None: the width at which Gaussian data lose 5 % of their weight (`fitting.solvers.losses`).
    decades : random starts of Positive parameters lie within a factor 10^decades
    max_steps, tolerance : of the method; None: its own
    quadrature : Quadrature of the forward model, or None for the default

    Returns
    -------
    FitResult
        of the start that reached the lowest cost. An interrupt from the keyboard ends the fit
        with the best values so far, `success` False.

    Raises
    ------
    ValueError
        one line: a bad path, start, prior or option, data that the scene cannot predict, or
        more free parameters than values and priors.
    FloatingPointError
        the model is not finite at any start.

    Notes
    -----
    Data without errors are taken to have one relative error each, which is estimated from
    their scatter about the fit (twice, the second fit weighted with the first estimate); the
    report says so.
    """
    begin = time.perf_counter()
    check_options(method, METHODS, starts, key, prior, callback, decades, max_steps, tolerance, quadrature)
    data = data_sets(data)
    problem = make_problem(scene, data, free, prior, loss, loss_width, quadrature)
    check_friction(scene, data)
    solver = METHODS[method](**({} if tolerance is None else {"tolerance": tolerance}))
    if method == "adam" and max_steps is not None:
        solver = dataclasses.replace(solver, max_steps=max_steps)  # its rate falls until then
    key = jax.random.key(0) if key is None else key
    x = random_starts(problem.structure.layout, problem.start, key, starts, decades)
    runs = search(solver, problem, x, max_steps, callback)
    # argmin would take a NaN for the least.
    best = int(np.argmin(np.where(np.isfinite(runs.cost), runs.cost, np.inf)))
    if not np.isfinite(runs.cost[best]):
        raise FloatingPointError(not_finite(problem, data))
    minima = _minima(problem, runs)
    end, evaluations = runs.row(best), np.array([runs.nfev.sum(), runs.njev.sum()])
    known = uncertainty(problem, end.x)
    scales = [None if one.error is not None else ASSUMED for one in data]
    for _ in range(ROUNDS if ASSUMED in scales else 0):
        if problem.targets.measured.size - known.parameters < 0.5 or end.status not in (CONVERGED, PERFECT):
            break
        problem, scales = _estimated(problem, data, scales, known, end.x)
        again = run_problem(solver, problem, end.x[None], max_steps, callback, min(LANES, starts))
        end = again.row(0)
        evaluations += np.array([again.nfev[0], again.njev[0]])
        known = uncertainty(problem, end.x)
    return FitResult(
        scene_at_start=scene,
        free=dict(free),
        prior=dict(prior or {}),
        method=method,
        data=tuple(data),
        problem=problem,
        x=end.x,
        status=int(end.status),
        cost=float(end.cost),
        nfev=int(evaluations[0]),
        njev=int(evaluations[1]),
        minima=minima,
        estimated=tuple(scales),
        uncertainty=known,
        seconds=time.perf_counter() - begin,
    )


def _minima(problem, runs):
    """Distinct minima that the starts found, lowest first."""
    found = []
    for i in np.argsort(runs.cost):
        if runs.status[i] not in (CONVERGED, PERFECT):
            continue
        cost = float(runs.cost[i])
        if found and cost - found[-1].cost <= SAME_COST * max(1.0, found[-1].cost):
            found[-1] = found[-1]._replace(count=found[-1].count + 1)
            continue
        values = to_values(problem.structure.layout, problem.numbers.constants, runs.x[i])
        found.append(Minimum(cost, 1, np.asarray(values)))
    return tuple(found)


def _estimated(problem, data, scales, known, x):
    """The problem with the errors of data without any taken from their scatter about the fit."""
    rows = residual_rows(problem, x)
    freedom = 1 - known.parameters / problem.targets.measured.size
    error, scales = problem.targets.error.copy(), list(scales)
    for i, (one, where) in enumerate(zip(data, problem.order, strict=True)):
        if one.error is not None:
            continue
        here = rows[where]
        if problem.structure.loss == "linear":
            scatter = np.sqrt(np.mean(here**2))
        else:
            # Outliers, which a robust fit is asked to expect, must not widen all error bars.
            scatter = 1.4826 * np.median(np.abs(here))
        # Data without noise are met to rounding; they must not get an error of zero.
        scales[i] = max(float(scales[i] * scatter / np.sqrt(freedom)), 1e-10)
        error[where] = scales[i]
    return problem._replace(targets=problem.targets._replace(error=error)), scales
