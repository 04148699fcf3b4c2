"""From start values to a minimum, past two traps that least squares in logarithms has.

A robust loss takes all data for outliers while the fit is far off, and has minima everywhere:
its fits begin where least squares - the same loss, much wider - ends. And a Positive parameter
that one bad step drives to nothing, or a Bounded one that it drives to a bound, stays there,
for its slope is gone: it is put back at its start once, and the lower of both minima kept.
"""

import numpy as np

from fitting.solvers import run_problem
from fitting.status import CONVERGED, INTERRUPTED, PERFECT, STALLED
from fitting.uncertainty import VANISHED

WIDE = 1e4  # times the width of a robust loss: least squares


def search(solver, problem, starts, max_steps=None, callback=None):
    """Fits from every row of `starts`; `Runs` as of `fitting.solvers.run`."""
    spent = np.zeros((2, len(starts)), int)
    x = starts = np.asarray(starts)
    for times in (1.0,) if problem.structure.loss == "linear" else (WIDE, 1.0):
        stage = problem._replace(numbers=problem.numbers._replace(width=times * problem.numbers.width))
        runs = run_problem(solver, stage, x, max_steps, callback)
        spent += np.stack([runs.nfev, runs.njev])
        gone = _escaped(problem, runs.x, starts)
        again = np.flatnonzero(gone.any(1) & np.isin(runs.status, (CONVERGED, PERFECT, STALLED)))
        if again.size:
            second = run_problem(solver, stage, np.where(gone, starts, runs.x)[again], max_steps, callback)
            spent[:, again] += np.stack([second.nfev, second.njev])
            lower = again[second.cost < runs.cost[again]]
            for kept, new in zip(runs, second, strict=True):
                kept[lower] = new[np.isin(again, lower)]
        if INTERRUPTED in runs.status:
            break
        # Outliers may drive least squares where the data do not want to be.
        x = np.where(_escaped(problem, runs.x, starts), starts, runs.x)
    return runs._replace(nfev=spent[0], njev=spent[1])


def _escaped(problem, x, start):
    """Which elements went to where their value hardly depends on x any more, shape of x."""
    kinds = np.empty(x.shape[1], object)
    for group in problem.structure.layout.groups:
        if group.kind != "Tied":
            kinds[slice(*group.slot)] = group.kind
    far = np.log(VANISHED)
    return ((kinds == "Positive") & (x < start - far)) | ((kinds == "Bounded") & (np.abs(x - start) > far))
