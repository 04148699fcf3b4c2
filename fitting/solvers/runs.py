"""Running solvers: many fits of one structure side by side, stopped one by one.

A solver is a hashable object with pure functions `init` and `step` (`fitting.solvers.levenberg_marquardt`,
`fitting.solvers.first_order`). Fits that differ in their start, their data or what is held run in a
few lanes of one vmapped step; a lane whose fit is done takes the next. So one compiled
step serves a thousand fits, none waits for the slowest, and memory stays that of the lanes.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitting.solvers.status import INTERRUPTED, OUT_OF_STEPS, RUNNING

LANES = 4


class Runs(NamedTuple):
    """Ends of several fits, NumPy arrays; rows that were never begun have status RUNNING."""

    x: np.ndarray  # shape (fits, size)
    cost: np.ndarray
    status: np.ndarray  # of `fitting.solvers.status`
    nfev: np.ndarray
    njev: np.ndarray

    def row(self, i):
        """One fit's end, in the same fields."""
        return Runs(*(array[i] for array in self))


@functools.partial(jax.jit, static_argnums=(0, 1))
def _init(solver, structure, numbers, targets, x):
    return jax.vmap(functools.partial(solver.init, structure, numbers))(targets, x)


@functools.partial(jax.jit, static_argnums=(0, 1))
def _step(solver, structure, numbers, targets, state):
    return jax.vmap(functools.partial(solver.step, structure, numbers))(targets, state)


@jax.jit
def _choose(new, mask, old):
    """Lanes of `new` where the mask says so."""
    return jax.tree.map(lambda n, o: jnp.where(mask.reshape(-1, *[1] * (n.ndim - 1)), n, o), new, old)


def run(solver, structure, numbers, targets, starts, max_steps=None, callback=None, lanes=None):
    """Run one fit for every row of `starts`.

    Parameters
    ----------
    solver : hashable, with init(structure, numbers, targets, x), step(..., state), max_steps
    structure, numbers : of `fitting.solvers.problem`, shared
    targets : Targets, every array with a leading axis of one entry a fit, or of one for all
    starts : shape (fits, size)
    max_steps : of a fit; None: the solver's own
    callback : called as callback(step, lowest cost) after every step of the lanes, or None
        KeyboardInterrupt, from it or the keyboard, ends the run with the values reached.
    lanes : how many fits run side by side; None: `LANES`, or as many as there are
        Another number is another program to compile.

    Returns
    -------
    Runs
    """
    starts = np.asarray(starts)
    fits, max_steps = len(starts), max_steps or solver.max_steps
    targets = jax.tree.map(lambda a: np.broadcast_to(a, (fits, *a.shape[1:])), targets)
    lanes = lanes or min(LANES, fits)
    at = np.arange(lanes) % fits  # which fit a lane holds
    waiting, done, steps = min(lanes, fits), np.arange(lanes) >= fits, np.zeros(lanes, int)
    ends = Runs(starts.copy(), np.full(fits, np.inf), *(np.full(fits, RUNNING, int) for _ in range(3)))

    def loaded(at):
        return jax.tree.map(lambda a: jnp.asarray(a[at]), (targets, starts))

    def keep(state, which, status=None):
        values = [np.asarray(getattr(state, name)) for name in Runs._fields]
        for kept, value in zip(ends, values, strict=True):
            kept[at[which]] = value[which]
        if status is not None:
            ends.status[at[which]] = status

    here, x = loaded(at)
    state = _init(solver, structure, numbers, here, x)
    total = 0
    try:
        while True:
            status = np.asarray(state.status)
            finished = ~done & (status != RUNNING)
            late = ~done & (status == RUNNING) & (steps >= max_steps)
            keep(state, finished)
            keep(state, late, OUT_OF_STEPS)
            done |= finished | late
            free = np.flatnonzero(done)[: fits - waiting]
            if free.size:
                following = at.copy()
                following[free] = waiting + np.arange(free.size)
                here, x = loaded(following)
                fresh = _init(solver, structure, numbers, here, x)
                state = _choose(fresh, np.isin(np.arange(lanes), free), state)
                # Last, so that an interrupt before it finds the lanes as they were.
                at, waiting = following, waiting + free.size
                done[free], steps[free] = False, 0
                continue
            if done.all():
                return ends
            state = _step(solver, structure, numbers, here, state)
            steps += 1
            total += 1
            if callback is not None:
                lowest = np.min(np.asarray(state.cost)[~done], initial=np.inf)
                callback(total, float(min(lowest, ends.cost.min())))
    except KeyboardInterrupt:
        keep(state, ~done, INTERRUPTED)
        return ends


def run_problem(solver, problem, starts, max_steps=None, callback=None, lanes=None):
    """`run` for one problem from several starts."""
    targets = jax.tree.map(lambda a: a[None], problem.targets)
    return run(solver, problem.structure, problem.numbers, targets, starts, max_steps, callback, lanes)
