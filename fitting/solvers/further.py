"""Further starts of a fit that ended at a bound, far from the data, or at an implausible value.

Random points around the start are evaluated, and fits begin at the points with the lowest costs, one after
the other. They end when a fit has no such fault, when several fits have reached the same lowest minimum, or
after a number of fits or seconds.
"""

import time
from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np

from fitting.parameters.variables import Array
from fitting.solvers.evaluation import costs_at
from fitting.solvers.objective import negligible, succeeded, was_interrupted
from fitting.solvers.ordered import put_in_order
from fitting.solvers.problem import Problem
from fitting.solvers.runs import Runs
from fitting.solvers.search import random_starts

# Number of random points.
_DRAWN = 64

# Largest number of fits, from the points with the lowest costs.
_FITS = 8

# Number of fits that must reach the lowest minimum.
_AGREE = 3


class FurtherStarts(NamedTuple):
    """Fits from further starts, and the reasons for them.

    Attributes
    ----------
    reasons : faults of the first result
    count : number of further fits
    agreed : number of further fits that reached the final minimum
    before, after : cost of the first result, and the lowest cost
    seconds : wall time of the further fits
    timed_out : True if time ended before the search was complete
    """

    reasons: tuple[str, ...]
    count: int
    agreed: int
    before: float
    after: float
    seconds: float
    timed_out: bool


def fit_further(
    problem: Problem,
    end: Runs,
    faults: Callable[[Runs], tuple[str, ...]],
    onward: Callable[[Array, Callable[[], bool]], Runs],
    seconds: float,
    key: jax.Array | None,
    decades: float,
) -> tuple[Runs, list[Runs], FurtherStarts | None]:
    """Fit from further starts if the result of a fit has faults.

    Parameters
    ----------
    end : result of the fit, one row of `Runs`
    faults : returns reasons for further starts from a result, or ()
    onward : returns the result of a fit from x, which ends early when the function of no argument is True
    seconds : time after which the fits end
    key, decades : as in `fitting.solvers.search.random_starts`

    Returns
    -------
    the result with the lowest cost, the results of all further fits, and their summary, or None without
    reasons for further starts
    """
    reasons, began = faults(end), time.monotonic()
    if not reasons or seconds <= 0:
        return end, [], None
    first, results, agreed, timed_out, fault = end.cost, [], 0, False, reasons
    for x in _starts(problem, jax.random.key(0) if key is None else key, decades):
        if time.monotonic() - began > seconds:
            timed_out = True
            break
        new = onward(x, lambda: time.monotonic() - began > seconds)
        if was_interrupted(new.status):
            timed_out = time.monotonic() - began > seconds
            if not timed_out:  # an interrupt from the keyboard
                end = end._replace(status=new.status)
            break
        results.append(new)
        little = negligible(float(end.cost))
        if succeeded(new.status) and new.cost < end.cost + little:
            lower = new.cost < end.cost - little or not succeeded(end.status)
            agreed = 1 if lower else agreed + 1
            if lower:
                end, fault = new, faults(new)
        if not fault or agreed >= _AGREE:
            break
    summary = FurtherStarts(
        reasons, len(results), agreed, float(first), float(end.cost), time.monotonic() - began, timed_out
    )
    return end, results, summary


def _starts(problem, key, decades):
    """Return the start vectors with the lowest costs among random points, shape (fits, size)."""
    variables, constants = problem.variables, problem.numbers.constants
    drawn = np.asarray(random_starts(variables, problem.start, key, 1 + _DRAWN, decades))[1:]
    moving = np.broadcast_to(problem.targets.moving, drawn.shape)
    drawn = put_in_order(variables, constants, drawn, moving)
    costs = costs_at(problem, drawn)
    lowest = np.argsort(costs)[:_FITS]
    return drawn[lowest[np.isfinite(costs[lowest])]]
