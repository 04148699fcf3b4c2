"""Search for a minimum: random starts, smoothing, and checks of fits that have converged.

Two problems occur with least squares in logarithms:

- Far from the minimum a robust loss treats all data as outliers and has many local minima. Robust fits
  therefore begin at the minimum of least squares, computed with a much larger width of the same loss.
- One bad step may drive a Positive parameter towards zero, or a Bounded one to a bound. It then tends to stay
  there, because its neighbours compensate for it. Such fits are repeated with additional rows, which keep the
  elements of an array smooth, and whose weight is reduced to zero in steps. The lower of both minima is kept.

A solver also stops if no parameter changes the data, as in full contact, or if nothing depends on a parameter
near a bound. `confirm_minimum` therefore tries points inside a bound and, if the residuals are larger than
chance allows, points in all directions, and continues from a point with a lower cost. If no point has a lower
cost, further fits begin at points inside a bound. The lowest cost is returned.
"""

import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import scipy

from fitting.parameters.variables import VANISHED, Array, Variables
from fitting.solvers.evaluation import costs_at, errors_of_rows, errors_of_slopes, evaluate_rows
from fitting.solvers.objective import (
    INTERRUPTED,
    PERFECT,
    STALLED,
    UNMOVED,
    negligible,
    succeeded,
    was_interrupted,
)
from fitting.solvers.options import Solver
from fitting.solvers.ordered import edges, put_in_order
from fitting.solvers.problem import Problem
from fitting.solvers.residuals import data_rows, padded, smooth_slots
from fitting.solvers.runs import Callback, Runs, run_fits
from rubberfric.base import quick_jit

WIDE = 1e4  # factor of the width of a robust loss that gives least squares
# Weights of the smoothing rows, in standard errors per factor e between neighbouring slopes.
SMOOTHING = (30.0, 10.0, 3.0, 1.0, 0.3, 0.0)


def random_starts(
    variables: Variables, x: Array, key: jax.Array | None, count: int, decades: float = 1.0
) -> Array:
    """Return start vectors of shape (count, size): x itself, followed by random vectors.

    Positive elements are uniform in the logarithm within `decades` of x. Bounded elements are uniform in the
    middle 98 % between the bounds. Free elements are uniform within x +- their scale. If `key` is None,
    jax.random.key(0) is used.
    """
    if count == 1:
        return x[None]
    return _drawn_starts(variables, count, decades, jnp.asarray(x), jax.random.key(0) if key is None else key)


@quick_jit(static_argnums=(0, 1, 2))
def _drawn_starts(variables, count, decades, x, key):
    draws = jax.random.uniform(key, (count, variables.size), x.dtype, minval=-1.0, maxval=1.0)
    starts = []
    for group in variables.own:
        part = slice(*group.slot)
        drawn = draws[:, part]
        if group.kind == "Positive":
            starts.append(x[part] + decades * math.log(10.0) * drawn)
        elif group.kind == "Bounded":
            place = 0.5 + 0.49 * drawn
            starts.append(jnp.log(place / (1 - place)))
        else:
            starts.append(x[part] + drawn)
    return jnp.concatenate(starts, 1).at[0].set(x)


def search(
    solver: Solver,
    problem: Problem,
    starts: Array,
    max_steps: int | None = None,
    callback: Callback | None = None,
) -> Runs:
    """Return the results of fits from every row of `starts`, as `fitting.solvers.runs.run_fits` does."""
    spent = np.zeros((2, len(starts)), int)
    x = starts = np.asarray(starts)
    for times in (1.0,) if problem.structure.loss == "linear" else (WIDE, 1.0):
        width = problem.numbers.width if times == 1.0 else times * problem.numbers.width
        stage = problem._replace(numbers=problem.numbers._replace(width=width))
        runs = run_fits(solver, stage, x, None, max_steps, callback)
        spent += np.stack([runs.nfev, runs.njev])
        escaped = _escaped(problem, runs.x, starts).any(1)
        again = np.flatnonzero(escaped & (succeeded(runs.status) | (runs.status == STALLED)))
        # All six fits would be equal without an array to smooth.
        if again.size and smooth_slots(problem.variables):
            second = _smoothed(solver, stage, starts[again], max_steps, callback)
            spent[:, again] += np.stack([second.nfev, second.njev])
            if was_interrupted(second.status).any():
                runs.status[again] = INTERRUPTED
            else:
                lower = second.cost < runs.cost[again]
                for kept, new in zip(runs, second, strict=True):
                    kept[again[lower]] = new[lower]
        if was_interrupted(runs.status).any():
            break
        # Outliers may drive least squares far from the other data.
        x = np.where(_escaped(problem, runs.x, starts), starts, runs.x)
    return runs._replace(nfev=spent[0], njev=spent[1])


def _smoothed(solver, problem, starts, max_steps, callback):
    """Run fits with smoothing rows of decreasing weight."""
    x, spent = starts, np.zeros((2, len(starts)), int)
    for weight in SMOOTHING:
        numbers = problem.numbers._replace(smoothing=jnp.asarray(weight, problem.numbers.smoothing.dtype))
        ends = run_fits(solver, problem._replace(numbers=numbers), x, None, max_steps, callback)
        x, spent = ends.x, spent + np.stack([ends.nfev, ends.njev])
        if was_interrupted(ends.status).any():
            break
    return ends._replace(nfev=spent[0], njev=spent[1])


def _escaped(problem, x, start):
    """Return booleans of the shape of x, True for elements that a fit drove towards zero or to a bound."""
    kinds, far = np.array(problem.variables.kinds), np.log(VANISHED)
    return ((kinds == "Positive") & (x < start - far)) | ((kinds == "Bounded") & (np.abs(x - start) > far))


# Significance level of the chi-square test; points around fits with a larger chi-square are tried.
_CHANCE = 1e-3
# Number of random points.
_DRAWN = 8
# Steps along each x.
_STEPS = (1.0, -1.0)
# Largest number of random points and steps, which take as long as a few steps of the solver.
_MOST = 32
# Steps away from a neighbour to which a number is equal.
_INWARD = (0.01, 0.1, 0.3, 1.0)
# Largest number of times that a fit continues from a lower point.
_TIMES = 3
# A parameter has no effect if a step of 1 changes the residuals by less than this part of them.
_UNMOVED = 1e-6


def confirm_minimum(
    problem: Problem, end: Runs, onward: Callable[[np.ndarray], Runs]
) -> tuple[Runs, np.ndarray]:
    """Check a converged fit, and continue from a point with a lower cost if there is one.

    `end`, one row of `Runs`, is the result of a fit, and `onward(x)` returns the result of a fit from x. The
    final result is returned with the numbers of evaluations of residuals and of derivatives that `onward` did
    not count. Its status is UNMOVED if no free parameter changes the data.
    """
    spent = np.zeros(2, int)
    for _ in range(_TIMES):
        if not succeeded(end.status) or end.status == PERFECT:
            break
        places, inner = _places_to_try(problem, end)
        if not len(places):
            break
        costs = costs_at(problem, places)
        spent[0] += len(places)
        least = end.cost - negligible(end.cost)
        lower = costs.min() < least
        tried = [int(np.argmin(costs))] if lower else [i for i in inner if np.isfinite(costs[i])]
        before = end
        for i in tried:
            again = onward(places[i])
            end = again if again.cost < least else end
            if was_interrupted(again.status):
                return end._replace(status=INTERRUPTED), spent
            if end is again:
                break
        if end is before:
            break
    if succeeded(end.status) and end.status != PERFECT and is_high(problem, float(end.cost)):
        spent += 1
        if not _moves(problem, end.x):
            end = end._replace(status=UNMOVED)
    return end, spent


def is_high(problem: Problem, cost: float) -> bool:
    """Return True if the cost is too high to be due to chance."""
    return cost > float(scipy.special.gammainccinv(problem.targets.measured.size / 2, _CHANCE))


def _moves(problem, x):
    """Return True if the data depend on any free parameter at x."""
    of, count = padded(problem), data_rows(problem.structure)
    rows, slopes = evaluate_rows(of.structure, of.numbers, np.asarray(x)[None], slopes=True)
    size = np.linalg.norm(errors_of_slopes(of, slopes[0])[:count], axis=0)
    return bool(np.any(size > _UNMOVED * np.linalg.norm(errors_of_rows(of, rows[0])[:count])))


def _places_to_try(problem, end):
    """Return points to try as rows of x, and the indices of inner points.

    An inner point is, for each parameter at a bound that another parameter sets (such as q0 <= qr), the point
    farthest from this bound. All points obey the order of the scene.
    """
    x, variables, constants = np.asarray(end.x), problem.variables, problem.numbers.constants
    places, inner = [], []

    def moved(i, value):
        there = x.copy()
        there[i] = value
        places.append(there)

    for i, side, _ in edges(variables, constants, x):
        for far in _INWARD:
            moved(i, x[i] + far * (1 if side == "lower" else -1))
        inner.append(len(places) - 1)
    for i, kind in enumerate(variables.kinds):
        vanished = kind == "Positive" and x[i] < problem.start[i] - np.log(VANISHED)
        # e^-7 is a thousandth of the range.
        bounded = kind == "Bounded" and abs(x[i]) > max(7.0, abs(problem.start[i]))
        if vanished or bounded:
            moved(i, problem.start[i])
    if is_high(problem, end.cost):
        pairs = [(step, i) for step in _STEPS for i in range(x.size)]
        for step, i in pairs[: _MOST - _DRAWN]:
            moved(i, x[i] + step)
        places += list(np.asarray(random_starts(variables, x, None, 1 + _DRAWN)))[1:]
    if not places:
        return np.empty((0, x.size)), inner
    moving = np.broadcast_to(problem.targets.moving, (len(places), x.size))
    return put_in_order(variables, constants, np.stack(places), moving), inner
