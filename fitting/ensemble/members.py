"""Members of an ensemble: many fits of one structure, as starts and targets.

A member differs from its neighbours in its start, its data, or what is held. All share one
compiled step, and one set of conditions and constants. `fitting.run_ensemble` runs them.
"""

import dataclasses
import hashlib

import jax
import numpy as np

from fitting.fit import METHODS
from fitting.parameters.constraints import is_number
from fitting.parameters.layout import element_names, random_starts
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.options import check_friction, check_options, data_sets
from fitting.solvers.problem import Problem, Targets, make_problem
from fitting.uncertainty.intervals import bootstrap_fits, bootstrap_of, profile_fits, profile_of

# First damping of fits that start near their minimum: a quarter of the steps less than with the
# solver's own, which is meant for starts far off.
NEAR = 1e-7


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Members:
    """Fits to be run; made by `multi_start`, `bootstrap_members` or `profile_members`.

    Attributes
    ----------
    kind : "starts", "bootstrap" or "profile"
    problem : structure and numbers, shared
    starts : shape (members, size)
    targets : arrays with a leading axis of one entry a member, or of one for all
    solver : as of `fitting.solvers.runs`
    max_steps : of a member
    parameter : shape (members,), which parameter is held; -1: none
    source : FitResult that the members were drawn around, or None
    level : of the intervals of a profile
    """

    kind: str
    problem: Problem
    starts: np.ndarray
    targets: Targets
    solver: object
    max_steps: int
    parameter: np.ndarray
    source: object = None
    level: float = 0.95

    def __len__(self):
        return len(self.starts)

    def __repr__(self):
        return f"<Members: {len(self)} of kind {self.kind!r}, {self.starts.shape[1]} parameters>"

    @property
    def names(self):
        return tuple(element_names(self.problem.structure.layout))

    def bootstrap(self, ensemble):
        """The `fitting.uncertainty.intervals.Bootstrap` that a run of these members makes."""
        if self.kind != "bootstrap":
            raise ValueError(f"members are of kind {self.kind!r}: must be 'bootstrap'")
        return bootstrap_of(self.source, ensemble.x, ensemble.status)

    def profiles(self, ensemble):
        """dict of name -> `fitting.uncertainty.intervals.Profile` that a run of these members makes."""
        if self.kind != "profile":
            raise ValueError(f"members are of kind {self.kind!r}: must be 'profile'")
        rows = {self.names[i]: self.parameter == i for i in dict.fromkeys(self.parameter.tolist())}
        return {
            name: profile_of(
                self.source, name, self.level, self.starts[own], ensemble.cost[own], ensemble.status[own]
            )
            for name, own in rows.items()
        }

    def fingerprint(self):
        """sha256 of all that decides the numbers of a run: structure, constants, data, starts, solver."""
        digest = hashlib.sha256()
        # Of the scene's tree and the layout the text says all: classes, static fields, key paths.
        for part in (self.kind, self.problem.structure, self.solver, self.max_steps):
            digest.update(repr(part).encode() + b"\0")
        for array in jax.tree.leaves((self.problem.numbers, self.targets, self.starts)):
            array = np.ascontiguousarray(array)
            digest.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
        return digest.hexdigest()


def multi_start(
    scene,
    data,
    free,
    starts,
    key=None,
    prior=None,
    *,
    method="lm",
    loss="linear",
    loss_width=None,
    decades=1.0,
    max_steps=None,
    tolerance=None,
    quadrature=None,
):
    """Fits of one problem from several starts.

    Parameters
    ----------
    starts : number of starts (the first is the scene's, the others random), or start vectors of
        shape (members, size) in the variables of the solver
    others : as for `fitting.fit`

    Returns
    -------
    Members

    Notes
    -----
    Every member is one plain run of the solver. `fitting.fit` does more for each of its few
    starts: robust losses begin with least squares, and a fit that drove a parameter to nothing
    is tried again. Give it the best member's scene to finish.
    """
    count = starts if isinstance(starts, int) else 1
    check_options(method, METHODS, count, key, prior, None, decades, max_steps, tolerance, quadrature)
    data = data_sets(data)
    problem = make_problem(scene, data, free, prior, loss, loss_width, quadrature)
    check_friction(scene, data)
    options = {} if tolerance is None else {"tolerance": tolerance}
    if method == "adam" and max_steps is not None:
        options["max_steps"] = max_steps
    solver = METHODS[method](**options)
    layout, dtype = problem.structure.layout, problem.start.dtype
    if isinstance(starts, int):
        key = jax.random.key(0) if key is None else key
        x = np.asarray(random_starts(layout, problem.start, key, starts, decades))
    else:
        x = np.array(starts, dtype)
        if x.ndim != 2 or x.shape[1] != layout.size or not len(x):
            raise ValueError(f"starts has shape {x.shape}: must be (members, {layout.size})")
    targets = jax.tree.map(lambda a: a[None], problem.targets)
    return _members("starts", problem, x, targets, solver, max_steps)


def bootstrap_members(result, count=1000, key=None, tolerance=None):
    """Fits of data drawn from a fitted model with the errors of the data, from its minimum.

    Parameters
    ----------
    result : FitResult
    count : number of data sets
    key : jax.random.key, or None for key(0): the data sets of `FitResult.bootstrap`
    tolerance : of the solver, None: its own; 1e-6 leaves a member within a fiftieth of a standard
        error of its minimum, in two thirds of the steps
    """
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise ValueError(f"count = {count!r}: must be an integer >= 1")
    starts, targets = bootstrap_fits(result, count, key)
    return _members("bootstrap", result.problem, starts, targets, _near(tolerance), source=result)


def _near(tolerance=None):
    """The solver of fits that start near their minimum."""
    options = {} if tolerance is None else {"tolerance": tolerance}
    return LevenbergMarquardt(damping=NEAR, **options)


def profile_members(result, names=None, level=0.95, points=8):
    """Fits with one parameter held at each of 2 points + 1 values, for several parameters.

    Parameters
    ----------
    result : FitResult
    names : of its parameters; None: all
    level, points : as for `FitResult.profile`
    """
    if not (is_number(level) and 0 < level < 1):
        raise ValueError(f"level = {level!r}: must be between 0 and 1")
    if isinstance(points, bool) or not isinstance(points, int) or points < 1:
        raise ValueError(f"points = {points!r}: must be an integer >= 1")
    names = result.names if names is None else (names,) if isinstance(names, str) else tuple(names)
    fits = [profile_fits(result, name, level, points) for name in dict.fromkeys(names)]
    rows = 2 * points + 1
    held = np.concatenate([np.repeat(targets.held, rows, axis=0) for _, targets in fits])
    targets = jax.tree.map(lambda a: a[None], result.problem.targets)._replace(held=held)
    parameter = np.argmin(held, axis=1)
    starts = np.concatenate([starts for starts, _ in fits])
    return _members("profile", result.problem, starts, targets, _near(), None, parameter, result, level)


def _members(kind, problem, starts, targets, solver, max_steps=None, parameter=None, source=None, level=0.95):
    """`Members` in the dtype of the problem."""
    dtype = problem.start.dtype
    targets = jax.tree.map(lambda a: np.asarray(a, dtype), targets)
    parameter = np.full(len(starts), -1) if parameter is None else parameter
    starts = np.asarray(starts, dtype)
    steps = solver.max_steps if max_steps is None else max_steps
    return Members(kind, problem, starts, targets, solver, steps, parameter, source, level)
