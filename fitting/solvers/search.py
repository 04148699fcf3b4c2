"""From start values to a minimum, past two traps that least squares in logarithms has.

A robust loss takes all data for outliers while the fit is far off, and has minima everywhere:
its fits begin where least squares - the same loss, much wider - ends. And a Positive parameter
that one bad step drives to nothing, or a Bounded one that it drives to a bound, tends to stay
there, its neighbours having taken its place. Fits that end so are tried again with rows that keep
the elements of an array smooth - as relaxation spectra are - and that are weakened to nothing;
the lower of both minima is kept.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.variables import VANISHED, Array, Variables
from fitting.solvers.iterate import INTERRUPTED, STALLED, succeeded
from fitting.solvers.options import Solver
from fitting.solvers.problem import Problem
from fitting.solvers.residuals import has_arrays
from fitting.solvers.runs import BATCH, Callback, Runs, run

WIDE = 1e4  # times the width of a robust loss: least squares
SMOOTHING = (30.0, 10.0, 3.0, 1.0, 0.3, 0.0)  # standard errors for a factor e between slopes


def random_starts(
    variables: Variables, x: Array, key: jax.Array | None, count: int, decades: float = 1.0
) -> Array:
    """`count` start vectors: x itself, then random ones, shape (count, size).

    Positive elements are drawn from within `decades` of x, evenly in the logarithm;
    Bounded ones from the middle 98 % between their bounds; Free ones from x +- their scale. The key is
    jax.random.key(0) if None.
    """
    if count == 1:
        return x[None]
    x, key = jnp.asarray(x), jax.random.key(0) if key is None else key
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
    """Fits from every row of `starts`; `Runs` as of `fitting.solvers.runs.run`."""
    spent = np.zeros((2, len(starts)), int)
    x = starts = np.asarray(starts)
    for times in (1.0,) if problem.structure.loss == "linear" else (WIDE, 1.0):
        width = problem.numbers.width if times == 1.0 else times * problem.numbers.width
        stage = problem._replace(numbers=problem.numbers._replace(width=width))
        runs = run(solver, stage, x, None, max_steps, callback)
        spent += np.stack([runs.nfev, runs.njev])
        escaped = _escaped(problem, runs.x, starts).any(1)
        again = np.flatnonzero(escaped & (succeeded(runs.status) | (runs.status == STALLED)))
        # Without an array to keep smooth it would be the same fit again, six times.
        if again.size and has_arrays(problem.variables):
            second = _smoothed(solver, stage, starts[again], max_steps, callback, min(BATCH, len(starts)))
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


def _smoothed(solver, problem, starts, max_steps, callback, batch):
    """Fits whose arrays are kept smooth, ever less; in a batch of the size that is compiled."""
    x, spent = starts, np.zeros((2, len(starts)), int)
    for weight in SMOOTHING:
        numbers = problem.numbers._replace(smoothing=jnp.asarray(weight, problem.numbers.smoothing.dtype))
        ends = run(solver, problem._replace(numbers=numbers), x, None, max_steps, callback, batch)
        x, spent = ends.x, spent + np.stack([ends.nfev, ends.njev])
        if INTERRUPTED in ends.status:
            break
    return ends._replace(nfev=spent[0], njev=spent[1])


def _escaped(problem, x, start):
    """Which elements went to where their value hardly depends on x any more, shape of x."""
    kinds = np.empty(x.shape[1], object)
    for group in problem.variables.own:
        kinds[slice(*group.slot)] = group.kind
    far = np.log(VANISHED)
    return ((kinds == "Positive") & (x < start - far)) | ((kinds == "Bounded") & (np.abs(x - start) > far))
