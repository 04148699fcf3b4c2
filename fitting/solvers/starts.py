"""From start values to a minimum, past two traps that least squares in logarithms has.

A robust loss takes all data for outliers while the fit is far off, and has minima everywhere:
its fits begin where least squares - the same loss, much wider - ends. And a Positive parameter
that one bad step drives to nothing, or a Bounded one that it drives to a bound, tends to stay
there, its neighbours having taken its place. Fits that end so are tried again on a leash, which
keeps the elements of an array in a smooth row - as relaxation spectra are - and is then let go;
the lower of both minima is kept.
"""

import jax.numpy as jnp
import numpy as np

from fitting.solvers.runs import LANES, run_problem
from fitting.solvers.status import CONVERGED, INTERRUPTED, PERFECT, STALLED
from fitting.uncertainty.covariance import VANISHED

WIDE = 1e4  # times the width of a robust loss: least squares
PULLS = (30.0, 10.0, 3.0, 1.0, 0.3, 0.0)  # of the leash: standard errors for a factor e between slopes


def search(solver, problem, starts, max_steps=None, callback=None):
    """Fits from every row of `starts`; `Runs` as of `fitting.solvers.runs.run`."""
    spent = np.zeros((2, len(starts)), int)
    x = starts = np.asarray(starts)
    for times in (1.0,) if problem.structure.loss == "linear" else (WIDE, 1.0):
        stage = problem._replace(numbers=problem.numbers._replace(width=times * problem.numbers.width))
        runs = run_problem(solver, stage, x, max_steps, callback)
        spent += np.stack([runs.nfev, runs.njev])
        escaped = _escaped(problem, runs.x, starts).any(1)
        again = np.flatnonzero(escaped & np.isin(runs.status, (CONVERGED, PERFECT, STALLED)))
        if again.size:
            second = _on_a_leash(solver, stage, starts[again], max_steps, callback, min(LANES, len(starts)))
            spent[:, again] += np.stack([second.nfev, second.njev])
            if INTERRUPTED in second.status:
                runs.status[again] = INTERRUPTED
            else:
                lower = second.cost < runs.cost[again]
                for kept, new in zip(runs, second, strict=True):
                    kept[again[lower]] = new[lower]
        if INTERRUPTED in runs.status:
            break
        # Outliers may drive least squares where the data do not want to be.
        x = np.where(_escaped(problem, runs.x, starts), starts, runs.x)
    return runs._replace(nfev=spent[0], njev=spent[1])


def _on_a_leash(solver, problem, starts, max_steps, callback, lanes):
    """Fits whose arrays are kept smooth, ever less; in as many lanes as there are compiled."""
    x, spent = starts, np.zeros((2, len(starts)), int)
    for pull in PULLS:
        numbers = problem.numbers._replace(leash=jnp.asarray(pull, problem.numbers.leash.dtype))
        ends = run_problem(solver, problem._replace(numbers=numbers), x, max_steps, callback, lanes)
        x, spent = ends.x, spent + np.stack([ends.nfev, ends.njev])
        if INTERRUPTED in ends.status:
            break
    return ends._replace(nfev=spent[0], njev=spent[1])


def _escaped(problem, x, start):
    """Which elements went to where their value hardly depends on x any more, shape of x."""
    kinds = np.empty(x.shape[1], object)
    for group in problem.structure.layout.own:
        kinds[slice(*group.slot)] = group.kind
    far = np.log(VANISHED)
    return ((kinds == "Positive") & (x < start - far)) | ((kinds == "Bounded") & (np.abs(x - start) > far))
