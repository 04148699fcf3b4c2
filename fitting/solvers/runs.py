"""Run many fits of one structure side by side. Each fit stops at its minimum.

Fits that differ in their start, their data or their fixed elements run in small batches. When a fit ends,
another one takes its place, so that no fit waits for the slowest. `Progress` keeps the state of all fits and
chooses the next ones, here and in ensembles (`fitting.ensemble.run`).

For least squares, the model and the step are separate compiled functions, because the model takes most of the
compilation time. A step of Levenberg-Marquardt evaluates the residuals several times.
"""

import dataclasses
import functools
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from fitting.parameters.variables import Array
from fitting.solvers.evaluation import evaluate_rows
from fitting.solvers.levenberg_marquardt import (
    LevenbergMarquardt,
    accept,
    after_evaluation,
    first_trial,
    plan_step,
)
from fitting.solvers.objective import (
    CONVERGED,
    INTERRUPTED,
    NEGLIGIBLE,
    NOT_FINITE,
    OUT_OF_STEPS,
    RUNNING,
    Iterate,
)
from fitting.solvers.options import Solver
from fitting.solvers.ordered import each_fit, put_on_bounds, slopes_of_x, x_of, z_of
from fitting.solvers.problem import FitStructure, Numbers, Problem, Targets
from fitting.solvers.residuals import in_errors, loss_of, padded, rounding, slopes_in_errors, solver_objective
from rubberfric.base import quick_jit

FIT_BATCH = 4

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

    def schedule(self, max_steps: int, batch: int) -> Iterator[tuple[np.ndarray, bool]]:
        """Yield the indices of at most `batch` fits to advance next, and True for a step, False for a start.

        The caller passes the new iterates to `keep` before the next iteration.
        """
        while (left := self.unfinished(max_steps)).any():
            running, fresh = np.flatnonzero(left & self.begun), np.flatnonzero(~self.begun)
            stepping = running.size >= batch or not fresh.size
            yield (running if stepping else fresh)[:batch], stepping

    def keep(self, which: np.ndarray, iterate: Iterate, stepped: bool, seconds: float = 0.0) -> None:
        """Store the new iterates of the fits `which`."""
        self.pending = which, iterate, self.steps[which] + stepped, seconds
        self.take_in()

    def take_in(self) -> None:
        """Copy the pending rows. After an interrupt, the next call copies them again."""
        if self.pending is None:
            return
        which, iterate, steps, seconds = self.pending
        if self.iterate.own is None:
            own = jax.tree.map(lambda a: np.zeros((len(self.steps), *a.shape[1:]), a.dtype), iterate.own)
            self.iterate = self.iterate._replace(own=own)
        for old, new in zip(jax.tree.leaves(self.iterate), jax.tree.leaves(iterate), strict=True):
            old[which] = new
        self.steps[which], self.begun[which], self.seconds = steps, True, seconds
        self.pending = None

    def ends(self, problem: Problem, moving: Any, interrupted: bool) -> Runs:
        """Return the results; fits that run still have the status INTERRUPTED or OUT_OF_STEPS."""
        iterate, late = self.iterate, INTERRUPTED if interrupted else OUT_OF_STEPS
        moving = np.broadcast_to(moving, np.shape(iterate.x))
        return Runs(
            each_fit(x_of, problem.variables, problem.numbers.constants, np.asarray(iterate.x), moving),
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
    batch: int | None = None,
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
    batch : number of fits that run side by side. If None, `FIT_BATCH`, or the number of fits if smaller.
        Each batch size needs its own compilation.
    """
    targets = jax.tree.map(lambda a: a[None], problem.targets) if targets is None else targets
    structure, numbers, targets, _ = padded(problem, targets)
    starts = np.asarray(starts)
    fits, max_steps = len(starts), max_steps or solver.max_steps
    targets = jax.tree.map(lambda a: np.broadcast_to(a, (fits, *a.shape[1:])), targets)
    batch = batch or min(FIT_BATCH, fits)
    moving: np.ndarray = np.asarray(targets.moving)  # pyright: ignore[reportOptionalMemberAccess]
    z, zero = each_fit(z_of, structure.variables, numbers.constants, starts, moving), np.zeros(fits, int)
    cost = np.full(fits, np.inf, z.dtype)
    progress = Progress.blank(Iterate(z.copy(), cost, zero + RUNNING, zero.copy(), zero.copy(), None))
    total, interrupted = 0, False
    try:
        for which, stepping in progress.schedule(max_steps, batch):
            places = np.resize(which, batch)
            here, iterate = jax.tree.map(lambda a, at=places: a[at], (targets, progress.iterate))
            if stepping:
                status = np.where(np.arange(batch) < which.size, iterate.status, CONVERGED)
                new = advance(solver, structure, numbers, here, iterate._replace(status=status))
            else:
                new = start(solver, structure, numbers, here, iterate.x)
            progress.keep(which, jax.tree.map(lambda a, n=which.size: np.asarray(a)[:n], new), stepping)
            total += stepping
            if stepping and callback is not None:
                cost = progress.iterate.cost
                callback(total, float(np.min(cost, where=np.isfinite(cost), initial=np.inf)))
    except KeyboardInterrupt:
        progress.take_in()
        interrupted = True
    runs = progress.ends(problem._replace(structure=structure, numbers=numbers), moving, interrupted)
    return runs._replace(status=np.where(progress.begun, runs.status, RUNNING))


def start(solver: Solver, structure: FitStructure, numbers: Numbers, targets: Targets, x: Array) -> Iterate:
    """Return the iterates at the start vectors x. `targets` and x have a leading axis of fits."""
    if not isinstance(solver, LevenbergMarquardt):
        return _by_solver("init", solver, structure, numbers, targets, x)
    problem, x = (structure, numbers, targets), np.asarray(x)
    costs = np.asarray(_costs(*problem, _evaluated(*problem, x)[0]))
    status, one = np.where(np.isfinite(costs), RUNNING, NOT_FINITE), np.ones(len(x), int)
    return Iterate(x, costs, status, one, 0 * one, np.full(len(x), solver.damping, x.dtype))


def advance(
    solver: Solver, structure: FitStructure, numbers: Numbers, targets: Targets, iterate: Iterate
) -> Iterate:
    """Take one step of each running fit, and return the new iterates."""
    if not isinstance(solver, LevenbergMarquardt):
        return _by_solver("step", solver, structure, numbers, targets, iterate)
    problem = structure, numbers, targets
    if not np.any(np.asarray(iterate.status) == RUNNING):
        return iterate
    after = _levenberg_marquardt_step(solver, *problem, iterate)
    return _at_bounds(solver, *problem, iterate, after) if structure.variables.order else after


@functools.partial(jax.jit, static_argnums=(0, 1, 2))
def _by_solver(name, solver, structure, numbers, targets, state):
    def one(targets, state):
        return getattr(solver, name)(solver_objective(structure, numbers, targets), state)

    return jax.vmap(one)(targets, state)


def _over_fits(function):
    """Compile a function with a leading axis of fits in all arguments except `structure` and `numbers`."""

    @quick_jit(static_argnums=(0,))
    @functools.wraps(function)
    def several(structure, numbers, *arguments):
        return jax.vmap(functools.partial(function, structure, numbers))(*arguments)

    return several


@_over_fits
def _costs(structure, numbers, targets, rows):
    return loss_of(structure, numbers).cost(in_errors(structure, numbers, targets, rows))


@_over_fits
def _plan_step(structure, numbers, targets, iterate, rows, slopes):
    plain = in_errors(structure, numbers, targets, rows)
    jacobian = slopes_in_errors(structure, numbers, targets, slopes)
    plan = plan_step(plain, jacobian, iterate, loss_of(structure, numbers))
    return plan, first_trial(plan)


@_over_fits
def _after_evaluation(structure, numbers, targets, iterate, plan, trial, rows):
    ahead = in_errors(structure, numbers, targets, rows)
    return after_evaluation(plan, trial, ahead, iterate, loss_of(structure, numbers))


@_over_fits
def _accept(structure, _, targets, iterate, plan, trial, tolerance):
    return accept(plan, trial, iterate, tolerance=tolerance, rounding=rounding(structure, targets))


def _levenberg_marquardt_step(solver, structure, numbers, targets, iterate):
    """Take one step of each running fit, with one Jacobian and several evaluations of the residuals."""
    problem, x = (structure, numbers, targets), np.asarray(iterate.x)
    running = np.asarray(iterate.status) == RUNNING
    rows_and_slopes = _evaluated(*problem, x, np.flatnonzero(running), slopes=True)
    plan, trial = _plan_step(*problem, iterate, *rows_and_slopes)
    while (which := np.flatnonzero(running & ~np.asarray(trial.done))).size:
        rows, _ = _evaluated(*problem, x + np.asarray(trial.move), which)
        trial = _after_evaluation(*problem, iterate, plan, trial, rows)
    return _accept(*problem, iterate, plan, trial, np.full(len(x), solver.tolerance, x.dtype))


def _at_bounds(solver, structure, numbers, targets, before, after):
    """Take other steps from x with elements near a bound on it, and return the iterates of lower cost.

    The second step is for fits that the first left above the cost of `after`. Elements stay on the bound as
    well if the cost is higher by far less than a negligible gain. Otherwise they approach the bound by ever
    smaller steps.
    """
    problem, x = (structure, numbers, targets), np.array(after.x)
    for i in np.flatnonzero(np.asarray(after.status) == RUNNING):
        known = structure.variables, numbers.constants, np.asarray(before.x)[i], x[i]
        x[i] = put_on_bounds(*known, np.asarray(targets.moving)[i])
    tried = (x != np.asarray(after.x)).any(1)
    if not tried.any():
        return after
    costs = _costs(*problem, _evaluated(*problem, x)[0])
    status = np.where(tried & np.isfinite(costs), after.status, CONVERGED)
    if not np.any(status == RUNNING):
        return after
    there = after._replace(x=x, cost=costs, status=status, nfev=after.nfev + 1, njev=after.njev + 1)
    after = Iterate(*map(np.array, after))
    highest = after.cost + 0.01 * NEGLIGIBLE * np.maximum(1.0, after.cost)
    for _ in range(2):
        there = _levenberg_marquardt_step(solver, *problem, there)
        lower = tried & (np.asarray(there.cost) < highest)
        if np.all(lower | (status != RUNNING)):
            break
    for old, new in zip(after, there, strict=True):
        old[lower] = np.asarray(new)[lower]
    return after


def _evaluated(structure, numbers, targets, z, which=None, slopes=False):
    """Return the predicted rows of the fits `which` and the derivatives with respect to z, 0 for others."""
    variables, constants, z = structure.variables, numbers.constants, np.asarray(z)
    which = np.arange(len(z)) if which is None else which
    known = variables, constants, z[which], np.asarray(targets.moving)[which]
    rows, by_x = evaluate_rows(structure, numbers, each_fit(x_of, *known), slopes)
    if slopes and variables.order:
        by_x = by_x @ each_fit(slopes_of_x, *known)
    found = []
    for part in (rows, by_x):
        found.append(np.zeros((len(z), *part.shape[1:]), part.dtype))
        found[-1][which] = part
    return found
