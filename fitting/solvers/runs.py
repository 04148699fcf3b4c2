"""Run many fits of one structure side by side. Each fit stops at its minimum.

Fits that differ in their start, their data or their fixed elements run in small batches. When a fit ends,
another one takes its place, so that no fit waits for the slowest. `Progress` keeps the state of all fits and
chooses the next ones, here and in ensembles (`fitting.ensemble.run`).
"""

import dataclasses
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.parameters.variables import Array
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.objective import INTERRUPTED, OUT_OF_STEPS, RUNNING, Iterate
from fitting.solvers.options import Solver
from fitting.solvers.ordered import x_of
from fitting.solvers.problem import Problem, Targets
from fitting.solvers.steps import Engine, advance, make_engine, start

# Largest number of fits in a batch. More fits of one run wait for the slowest one at the end. Fewer fits take
# the same batch, because another batch takes another second of compilation.
FIT_BATCH = 8

Callback = Callable[[int, float], object]


class Runs(NamedTuple):
    """Results of several fits, as NumPy arrays. A fit that was never begun has the status RUNNING."""

    x: np.ndarray  # shape (fits, size)
    cost: np.ndarray
    status: np.ndarray  # of `fitting.solvers.objective`
    nfev: np.ndarray
    njev: np.ndarray

    def row(self, i: int) -> "Runs":
        """Return the result of fit `i`."""
        return Runs(*(array[i] for array in self))


@dataclasses.dataclass
class Progress:
    """State of several fits between two steps. The arrays have one row per fit and change in place."""

    begun: np.ndarray  # bool: True if the start of the fit was evaluated
    steps: np.ndarray  # number of steps taken since the start was evaluated
    iterate: Iterate
    seconds: float = 0.0  # wall time so far
    pending: Any = dataclasses.field(default=None, repr=False)  # rows to copy, and their indices

    @classmethod
    def blank(cls, iterate: Iterate) -> "Progress":
        """Return the state before the first evaluation."""
        return cls(np.zeros(len(iterate.x), bool), np.zeros(len(iterate.x), int), iterate)

    def unfinished(self, max_steps: int) -> np.ndarray:
        """Return True for fits that have neither ended nor taken `max_steps` steps."""
        return ~self.begun | ((self.iterate.status == RUNNING) & (self.steps < max_steps))

    def advance(self, engine: Engine, targets: Targets, max_steps: int) -> Iterator[bool]:
        """Advance all fits in batches. After each batch, yield True if it took a step, False for starts.

        `targets` have one entry for each fit.
        """
        before, began = self.seconds, time.monotonic()
        while (left := self.unfinished(max_steps)).any():
            running, fresh = np.flatnonzero(left & self.begun), np.flatnonzero(~self.begun)
            stepping = running.size >= engine.count or not fresh.size
            which = (running if stepping else fresh)[: engine.count]
            here, iterate = jax.tree.map(lambda a, at=which: a[at], (targets, self.iterate))
            new = advance(engine, here, iterate) if stepping else start(engine, here, iterate)
            self.pending = which, new, self.steps[which] + stepping, before + time.monotonic() - began
            self.take_in()
            yield stepping

    def take_in(self) -> None:
        """Copy the pending rows. After an interrupt, the next call copies them again."""
        if self.pending is None:
            return
        which, iterate, steps, seconds = self.pending
        for old, new in zip(jax.tree.leaves(self.iterate), jax.tree.leaves(iterate), strict=True):
            old[which] = new
        self.steps[which], self.begun[which], self.seconds = steps, True, seconds
        self.pending = None

    def ends(self, problem: Problem, moving: Array, interrupted: bool) -> Runs:
        """Return the results; fits that run still have the status INTERRUPTED or OUT_OF_STEPS."""
        iterate, late = self.iterate, INTERRUPTED if interrupted else OUT_OF_STEPS
        return Runs(
            np.asarray(x_of(problem.variables, problem.numbers.constants, iterate.x, moving)),
            np.where(self.begun, iterate.cost, np.inf),
            np.where(iterate.status == RUNNING, late, iterate.status),
            np.asarray(iterate.nfev),
            np.asarray(iterate.njev),
        )


def run_fits(
    solver: Solver,
    problem: Problem,
    starts: Array,
    targets: Targets | None = None,
    max_steps: int | None = None,
    callback: Callback | None = None,
    batch: int = FIT_BATCH,
) -> Runs:
    """Run one fit for every row of `starts`, shape (fits, size).

    Parameters
    ----------
    problem : Problem, whose structure and numbers the fits share
    targets : Targets with a leading axis, which has one entry per fit or one entry for all
        If None, the targets of the problem are used.
    max_steps : largest number of steps of a fit. If None, `max_steps` of the solver is used.
    callback : called as callback(step, lowest cost) after every step of the batch, or None
        A KeyboardInterrupt, raised here or from the keyboard, ends the run with the values reached. A fit
        whose start was not evaluated has the cost inf, see `fitting.solvers.objective.was_interrupted`.
    batch : largest number of fits that run side by side. Each number needs its own compilation.
    """
    starts, max_steps = np.asarray(starts), max_steps or solver.max_steps
    # First-order solvers evaluate the model in empty places as well.
    size = batch if isinstance(solver, LevenbergMarquardt) else min(batch, len(starts))
    engine, targets = make_engine(solver, problem, targets, len(starts), size)
    progress, total, interrupted = Progress.blank(engine.blank(targets, starts)), 0, False
    try:
        for stepping in progress.advance(engine, targets, max_steps):
            total += stepping
            if stepping and callback is not None:
                cost = progress.iterate.cost
                callback(total, float(np.min(cost, where=np.isfinite(cost), initial=np.inf)))
    except KeyboardInterrupt:
        progress.take_in()
        interrupted = True
    runs = progress.ends(problem, targets.moving, interrupted)
    return runs._replace(status=np.where(progress.begun, runs.status, RUNNING))
