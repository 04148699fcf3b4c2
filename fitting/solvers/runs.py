"""Running solvers: many fits of one structure side by side, stopped one by one.

A solver is a hashable object with pure functions `init` and `step` (`fitting.solvers.methods`). Fits that
differ in their start, their data or what may move run in a batch of a few; a fit that is done makes place
for the next. So what is compiled once serves a thousand fits, none waits for the slowest, and memory stays
that of the batch.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.variables import Array
from fitting.solvers.iterate import INTERRUPTED, OUT_OF_STEPS, RUNNING
from fitting.solvers.methods.steps import advance, start
from fitting.solvers.options import Solver
from fitting.solvers.ordered import inside, outside
from fitting.solvers.problem import Problem, Targets
from fitting.solvers.residuals import padded

BATCH = 4

Callback = Callable[[int, float], object]


class Runs(NamedTuple):
    """Ends of several fits, NumPy arrays; rows that were never begun have status RUNNING."""

    x: np.ndarray  # shape (fits, size)
    cost: np.ndarray
    status: np.ndarray  # of `fitting.solvers.iterate`
    nfev: np.ndarray
    njev: np.ndarray

    def row(self, i: int) -> "Runs":
        """One fit's end, in the same fields."""
        return Runs(*(array[i] for array in self))


@jax.jit
def _choose(new, mask, old):
    """Rows of `new` where the mask says so."""
    return jax.tree.map(lambda n, o: jnp.where(mask.reshape(-1, *[1] * (n.ndim - 1)), n, o), new, old)


def run(
    solver: Solver,
    problem: Problem,
    starts: Array,
    targets: Targets | None = None,
    max_steps: int | None = None,
    callback: Callback | None = None,
    batch: int | None = None,
) -> Runs:
    """Run one fit for every row of `starts`.

    Parameters
    ----------
    solver : hashable, with init(objective, x), step(objective, iterate), max_steps
    problem : whose structure and numbers the fits share
    starts : shape (fits, size)
    targets : Targets, every array with a leading axis of one entry a fit, or of one for all;
        None: those of the problem
    max_steps : of a fit; None: the solver's own
    callback : called as callback(step, lowest cost) after every step of the batch, or None
        KeyboardInterrupt, from it or the keyboard, ends the run with the values reached.
    batch : how many fits run side by side; None: `BATCH`, or as many as there are
        Another number is another program to compile.

    Returns
    -------
    Runs
    """
    targets = jax.tree.map(lambda a: a[None], problem.targets) if targets is None else targets
    structure, numbers, targets, _ = padded(problem, targets)
    starts = np.asarray(starts)
    fits, max_steps = len(starts), max_steps or solver.max_steps
    targets = jax.tree.map(lambda a: np.broadcast_to(a, (fits, *a.shape[1:])), targets)
    batch = batch or min(BATCH, fits)
    at = np.arange(batch) % fits  # which fit has a place
    waiting, done, steps = min(batch, fits), np.arange(batch) >= fits, np.zeros(batch, int)
    variables, constants = structure.variables, numbers.constants
    moving: np.ndarray = np.asarray(targets.moving)  # pyright: ignore[reportOptionalMemberAccess]
    starts = inside(variables, constants, starts, moving)
    ends = Runs(starts.copy(), np.full(fits, np.inf), *(np.full(fits, RUNNING, int) for _ in range(3)))

    def loaded(at):
        return jax.tree.map(lambda a: np.asarray(a[at]), (targets, starts))

    def keep(iterate, which, status=None):
        values = [np.asarray(getattr(iterate, name)) for name in Runs._fields]
        for kept, value in zip(ends, values, strict=True):
            kept[at[which]] = value[which]
        if status is not None:
            ends.status[at[which]] = status

    here, x = loaded(at)
    iterate = start(solver, structure, numbers, here, x)
    total = 0
    try:
        while True:
            status = np.asarray(iterate.status)
            finished = ~done & (status != RUNNING)
            late = ~done & (status == RUNNING) & (steps >= max_steps)
            keep(iterate, finished)
            keep(iterate, late, OUT_OF_STEPS)
            done |= finished | late
            free = np.flatnonzero(done)[: fits - waiting]
            if free.size:
                following = at.copy()
                following[free] = waiting + np.arange(free.size)
                here, x = loaded(following)
                fresh = start(solver, structure, numbers, here, x)
                iterate = _choose(fresh, np.isin(np.arange(batch), free), iterate)
                # Last, so that an interrupt before it finds the batch as it was.
                at, waiting = following, waiting + free.size
                done[free], steps[free] = False, 0
                continue
            if done.all():
                return ends._replace(x=outside(variables, constants, ends.x, moving))
            iterate = advance(solver, structure, numbers, here, iterate)
            steps += 1
            total += 1
            if callback is not None:
                lowest = np.min(np.asarray(iterate.cost)[~done], initial=np.inf)
                callback(total, float(min(lowest, ends.cost.min())))
    except KeyboardInterrupt:
        keep(iterate, ~done, INTERRUPTED)
        return ends._replace(x=outside(variables, constants, ends.x, moving))
