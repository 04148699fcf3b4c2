"""Members of an ensemble: many fits of one structure, as starts and targets.

A member differs from its neighbours in its start, its data, or what may move. All share one
compiled step, and one set of conditions and constants. `fitting.run_ensemble` runs them.
"""

import dataclasses
import hashlib
import warnings
from collections.abc import Mapping, Sequence

import jax
import numpy as np
from numpy.typing import ArrayLike

import rubberfric as rf
from fitting.data.kinds import DataSets, data_by_scene
from fitting.ensemble.result import EnsembleResult
from fitting.parameters.constraints import Rule
from fitting.parameters.priors import Prior
from fitting.parameters.scenes import as_scenes
from fitting.solvers.methods.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.options import Solver, check_options, make_solver
from fitting.solvers.problem import Problem, Targets, make_problem
from fitting.solvers.runs import Runs
from fitting.solvers.search import random_starts
from fitting.uncertainty.intervals import Bootstrap, SolvedProblem
from fitting.uncertainty.profile import LikelihoodProfile

# For fits that start near their minimum: a quarter of the steps less than with the damping that is
# meant for starts far off.
NEAR = LevenbergMarquardt(damping=1e-7)


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
    parameter : shape (members,), which parameter stays at its start; -1: none
    source : FitResult that the members were drawn around, or None
    level : of the intervals of a profile
    """

    kind: str
    problem: Problem
    starts: np.ndarray
    targets: Targets
    solver: Solver
    max_steps: int
    parameter: np.ndarray
    source: SolvedProblem | None = None
    level: float = 0.95

    def __len__(self) -> int:
        return len(self.starts)

    def __repr__(self) -> str:
        return f"<Members: {len(self)} of kind {self.kind!r}, {self.starts.shape[1]} parameters>"

    @property
    def names(self) -> tuple[str, ...]:
        """Key path of every free element."""
        return self.problem.names

    def bootstrap(self, ensemble: EnsembleResult) -> Bootstrap:
        """What a run of these members makes."""
        if self.kind != "bootstrap" or self.source is None:
            raise ValueError(f"members are of kind {self.kind!r}: must be 'bootstrap'")
        return self.source.bootstrap_of(ensemble.x, ensemble.status)

    def profiles(self, ensemble: EnsembleResult) -> dict[str, LikelihoodProfile]:
        """The profiles that begin with a run of these members, by the names of the parameters.

        Like those of `FitResult.profile` they go on to the threshold with a few more fits, and warn of a
        minimum below the fit.
        """
        if self.kind != "profile" or self.source is None:
            raise ValueError(f"members are of kind {self.kind!r}: must be 'profile'")
        found = {}
        for i in dict.fromkeys(self.parameter.tolist()):
            name, own = self.names[i], self.parameter == i
            runs = Runs(*(getattr(ensemble, field)[own] for field in Runs._fields))
            found[name] = self.source.profile_of(name, self.level, runs)
            if found[name].warning:
                text = f"profile of {name!r}: {found[name].warning}"
                warnings.warn(text, RuntimeWarning, stacklevel=2)
        return found

    def fingerprint(self) -> str:
        """sha256 of all that decides the numbers of a run: structure, constants, data, starts, solver."""
        digest = hashlib.sha256()
        # Of the scene's tree and the variables the text says all: classes, static fields, key paths.
        for part in (self.kind, self.problem.structure, self.solver, self.max_steps):
            digest.update(repr(part).encode() + b"\0")
        for array in jax.tree.leaves((self.problem.numbers, self.targets, self.starts)):
            array = np.ascontiguousarray(array)
            digest.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
        return digest.hexdigest()


def multi_start(
    scene: rf.Scene | Mapping[str, rf.Scene],
    data: DataSets | Mapping[str, DataSets],
    free: Mapping[str, Rule],
    starts: int | ArrayLike,
    key: jax.Array | None = None,
    prior: Mapping[str, Prior] | None = None,
    *,
    method: str = "lm",
    loss: str = "linear",
    loss_width: float | None = None,
    decades: float = 1.0,
    max_steps: int | None = None,
    tolerance: float | None = None,
    quadrature: rf.Quadrature | None = None,
) -> Members:
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
    check_options(method=method, starts=count, key=key, prior=prior)
    check_options(decades=decades, max_steps=max_steps, tolerance=tolerance)
    scene = as_scenes(scene)
    data, of = data_by_scene(data, scene if isinstance(scene, dict) else None)
    problem = make_problem(scene, data, free, prior, loss, loss_width, quadrature, of)
    size = problem.variables.size
    if isinstance(starts, int):
        x = np.asarray(random_starts(problem.variables, problem.start, key, starts, decades))
    else:
        x = np.array(starts, problem.start.dtype)
        if x.ndim != 2 or x.shape[1] != size or not len(x):
            raise ValueError(f"starts has shape {x.shape}: must be (members, {size})")
    targets = jax.tree.map(lambda a: a[None], problem.targets)
    return _members("starts", problem, x, targets, make_solver(method, tolerance, max_steps), max_steps)


def bootstrap_members(
    result: SolvedProblem,
    count: int = 1000,
    key: jax.Array | None = None,
    tolerance: float | None = None,
) -> Members:
    """Fits of data drawn from a fitted model with the errors of the data, from its minimum.

    Parameters
    ----------
    result : FitResult
    count : number of data sets
    key : jax.random.key, or None for key(0): the data sets of `FitResult.bootstrap`
    tolerance : of the solver, None: its own; 1e-6 leaves a member within a fiftieth of a standard
        error of its minimum, in two thirds of the steps
    """
    check_options(count=count)
    starts, targets = result.bootstrap_fits(count, key)
    solver = NEAR if tolerance is None else dataclasses.replace(NEAR, tolerance=tolerance)
    return _members("bootstrap", result.problem, starts, targets, solver, source=result)


def profile_members(
    result: SolvedProblem,
    names: str | Sequence[str] | None = None,
    level: float = 0.95,
    points: int = 8,
) -> Members:
    """Fits with one parameter fixed at each of 2 points + 1 values, for several parameters.

    Parameters
    ----------
    result : FitResult
    names : of its parameters; None: all
    level, points : as for `FitResult.profile`
    """
    check_options(level=level, points=points)
    names = result.names if names is None else (names,) if isinstance(names, str) else tuple(names)
    fits = [result.profile_fits(name, level, points) for name in dict.fromkeys(names)]
    rows = 2 * points + 1
    moving = np.concatenate([np.repeat(targets.moving, rows, axis=0) for _, targets in fits])
    targets = jax.tree.map(lambda a: a[None], result.problem.targets)._replace(moving=moving)
    parameter = np.argmin(moving, axis=1)
    starts = np.concatenate([starts for starts, _ in fits])
    return _members("profile", result.problem, starts, targets, NEAR, None, parameter, result, level)


def _members(kind, problem, starts, targets, solver, max_steps=None, parameter=None, source=None, level=0.95):
    """`Members` in the dtype of the problem."""
    dtype = problem.start.dtype
    targets = jax.tree.map(lambda a: np.asarray(a, dtype), targets)
    parameter = np.full(len(starts), -1) if parameter is None else parameter
    starts = np.asarray(starts, dtype)
    steps = solver.max_steps if max_steps is None else max_steps
    return Members(kind, problem, starts, targets, solver, steps, parameter, source, level)
