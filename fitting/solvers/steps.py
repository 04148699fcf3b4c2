"""Starts and steps of several fits of one structure, the same for single fits and ensembles.

For least squares, the model and the step are separate compiled functions, because the model takes most of the
compilation time. A step of Levenberg-Marquardt evaluates the residuals several times.
"""

import functools
from typing import NamedTuple

import jax
import numpy as np

from fitting.solvers.devices import Devices, OverFits, default_device
from fitting.solvers.evaluation import evaluate_rows, memory_of_evaluation
from fitting.solvers.levenberg_marquardt import (
    LevenbergMarquardt,
    accept,
    after_evaluation,
    first_trial,
    plan_step,
)
from fitting.solvers.objective import CONVERGED, NOT_FINITE, RUNNING, Iterate, negligible
from fitting.solvers.options import Solver
from fitting.solvers.ordered import put_on_bounds, slopes_of_x, x_of, z_of
from fitting.solvers.problem import FitStructure, Numbers, Problem, Targets
from fitting.solvers.residuals import (
    cost_of,
    in_errors,
    loss_of,
    padded,
    rounding,
    slopes_in_errors,
    solver_objective,
)
from rubberfric.base import quick_jit


class Engine(NamedTuple):
    """Solver, structure, numbers and devices of fits that run side by side, see `start` and `advance`.

    Attributes
    ----------
    solver : Solver
    structure, numbers : of the problem, see `fitting.solvers.residuals.padded`
    placed : the numbers on all devices
    size : largest number of fits of a device in one batch
    devices : Devices on which the fits run
    """

    solver: Solver
    structure: FitStructure
    numbers: Numbers
    placed: Numbers
    size: int
    devices: Devices

    @property
    def count(self) -> int:
        """Largest number of fits in one batch."""
        return self.size * self.devices.count

    def blank(self, targets: Targets, starts: np.ndarray) -> Iterate:
        """Return the iterates of fits before the evaluation of their starts, shape (fits, size)."""
        fits, x = len(starts), np.asarray(starts)
        z = z_of(self.structure.variables, self.numbers.constants, x, np.asarray(targets.moving))
        own = jax.tree.map(np.array, self.solver.own(z))
        count = np.zeros(fits, int)
        return Iterate(z, np.full(fits, np.inf, z.dtype), count + RUNNING, count.copy(), count.copy(), own)

    def memory(self, targets: Targets, starts: np.ndarray) -> int:
        """Return the memory of a device for a step [B], after compilation of its largest function."""
        if isinstance(self.solver, LevenbergMarquardt):
            return memory_of_evaluation(self.structure, self.placed, starts, self.devices)
        iterate = self.blank(targets, starts)
        static, arguments = (self.solver, self.structure), self._full((targets, iterate))
        return _step_of_solver.memory(self.devices, static, self.placed, *arguments)

    def _full(self, tree):
        """Repeat rows of the arrays of a pytree, so that their number is `count`."""
        return jax.tree.map(lambda a: a[np.resize(np.arange(len(a)), self.count)], tree)

    def _call(self, function, *arguments):
        return function(self.structure, self.numbers, *arguments)

    def _evaluated(self, targets, z, which=None, slopes=False):
        """Return predicted rows of the fits `which`, and their derivatives by z, with 0 for other fits."""
        which = np.arange(len(z)) if which is None else which
        variables = self.structure.variables
        at = variables, self.numbers.constants, z[which], targets.moving[which]
        x = np.asarray(x_of(*at))
        rows, by_x = evaluate_rows(self.structure, self.placed, x, slopes, self.devices)
        if slopes and variables.order:
            by_x = by_x @ slopes_of_x(*at)
        full = [np.zeros((len(z), *part.shape[1:]), part.dtype) for part in (rows, by_x)]
        full[0][which], full[1][which] = rows, by_x
        return full

    def _levenberg_marquardt_step(self, targets, iterate):
        """Take one step of each running fit, with one Jacobian and several evaluations of the residuals."""
        x, running = np.asarray(iterate.x), np.asarray(iterate.status) == RUNNING
        rows_and_slopes = self._evaluated(targets, x, np.flatnonzero(running), slopes=True)
        plan, trial = self._call(_plan_step, targets, iterate, *rows_and_slopes)
        while (which := np.flatnonzero(running & ~np.asarray(trial.done))).size:
            rows, _ = self._evaluated(targets, x + np.asarray(trial.move), which)
            trial = self._call(_after_evaluation, targets, iterate, plan, trial, rows)
        tolerance = np.full(len(x), self.solver.tolerance, x.dtype)
        return self._call(_accept, targets, iterate, plan, trial, tolerance)

    def _at_bounds(self, targets, before, after):
        """Take other steps from x with elements near a bound on it, and return the iterates of lower cost.

        The second step is for fits that the first left above the cost of `after`. Elements stay on the bound
        as well if the cost is higher by far less than a negligible gain. Otherwise they approach the bound by
        ever smaller steps.
        """
        after, variables = jax.tree.map(np.array, after), self.structure.variables
        on_bounds = put_on_bounds(variables, self.numbers.constants, before.x, after.x, targets.moving)
        x = np.where(after.status[:, None] == RUNNING, on_bounds, after.x)
        tried = (x != after.x).any(1)
        if not tried.any():
            return after
        costs = np.asarray(self._call(_costs, targets, self._evaluated(targets, x)[0]))
        status = np.where(tried & np.isfinite(costs), after.status, CONVERGED)
        if not np.any(status == RUNNING):
            return after
        there = after._replace(x=x, cost=costs, status=status, nfev=after.nfev + 1, njev=after.njev + 1)
        highest = after.cost + 0.01 * negligible(after.cost)
        for _ in range(2):
            there = self._levenberg_marquardt_step(targets, there)
            lower = tried & (np.asarray(there.cost) < highest)
            if np.all(lower | (status != RUNNING)):
                break
        for old, new in zip(after, there, strict=True):
            old[lower] = np.asarray(new)[lower]
        return after


def start(engine: Engine, targets: Targets, iterate: Iterate) -> Iterate:
    """Evaluate the cost at the starts of at most `count` fits, and return the new iterates."""
    rows, _ = engine._evaluated(targets, iterate.x)
    cost = np.asarray(engine._call(_costs, *engine._full((targets, rows))))[: len(iterate.x)]
    status = np.where(np.isfinite(cost), RUNNING, NOT_FINITE)
    return iterate._replace(cost=cost, status=status, nfev=iterate.nfev + 1)


def advance(engine: Engine, targets: Targets, iterate: Iterate) -> Iterate:
    """Take one step of each running fit, at most `count`, and return the new iterates."""
    if not np.any(iterate.status == RUNNING):
        return iterate
    fits = len(iterate.x)
    targets, iterate = engine._full((targets, iterate))
    iterate.status[fits:] = CONVERGED
    if not isinstance(engine.solver, LevenbergMarquardt):
        static = engine.solver, engine.structure
        after = _step_of_solver(engine.devices, static, engine.placed, targets, iterate)
    else:
        after = engine._levenberg_marquardt_step(targets, iterate)
        if engine.structure.variables.order:
            after = engine._at_bounds(targets, iterate, after)
    return jax.tree.map(lambda a: np.asarray(a)[:fits], after)


def make_engine(
    solver: Solver,
    problem: Problem,
    targets: Targets | None,
    fits: int,
    size: int,
    devices: Devices | None = None,
) -> tuple[Engine, Targets]:
    """Return the engine of a problem for batches of `size` fits on each device, and the targets of all fits.

    `targets` have a leading axis, which has one entry for each fit or one entry for all. If `targets` or
    `devices` are None, the targets of the problem or JAX's default device are used.
    """
    devices = default_device() if devices is None else devices
    targets = problem.targets.of_several() if targets is None else targets
    of = padded(problem, targets)
    full = jax.tree.map(lambda a: np.broadcast_to(a, (fits, *a.shape[1:])), of.targets)
    placed = devices.everywhere(of.numbers)
    return Engine(solver, of.structure, of.numbers, placed, size, devices), full


def _by_fit(function):
    """Compile a short function of one fit for a batch of fits, on one device of each process.

    Several processors would wait for each other's threads.
    """

    @quick_jit(static_argnums=(0,))
    @functools.wraps(function)
    def several(structure, numbers, *arguments):
        return jax.vmap(functools.partial(function, structure, numbers))(*arguments)

    return several


_costs = _by_fit(cost_of)


@_by_fit
def _plan_step(structure, numbers, targets, iterate, rows, slopes):
    plain = in_errors(structure, numbers, targets, rows)
    jacobian = slopes_in_errors(structure, numbers, targets, slopes)
    plan = plan_step(plain, jacobian, iterate, loss_of(structure, numbers))
    return plan, first_trial(plan)


@_by_fit
def _after_evaluation(structure, numbers, targets, iterate, plan, trial, rows):
    ahead = in_errors(structure, numbers, targets, rows)
    return after_evaluation(plan, trial, ahead, iterate, loss_of(structure, numbers))


@_by_fit
def _accept(structure, _, targets, iterate, plan, trial, tolerance):
    return accept(plan, trial, iterate, tolerance=tolerance, rounding=rounding(structure, targets))


@OverFits
def _step_of_solver(static, numbers, targets, iterate):
    """Take one step of a first-order solver."""
    solver, structure = static
    return solver.step(solver_objective(structure, numbers, targets), iterate)
