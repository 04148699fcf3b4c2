"""Members of an ensemble, which are many fits of one structure, and the results of their runs.

Members differ in their start, their data, or their fixed parameters. All share the compiled functions, the
conditions and the constants. `fitting.run_ensemble` runs them.

Files of an `EnsembleResult`::

    /           attributes format = "rubberfric ensemble", format_version = 1, kind, seconds,
                devices, batch, peak
    /report     the report as text
    /names      key paths of the free elements
    /x, values  a row for each member; likewise cost, status, nfev, njev
"""

import dataclasses
import hashlib
import warnings
from collections.abc import Mapping, Sequence
from typing import Self

import jax
import numpy as np

import rubberfric as rf
from fitting.data.kinds import DataSets, data_by_scene
from fitting.parameters.constraints import Constraint
from fitting.parameters.priors import Prior
from fitting.parameters.scenes import as_scenes
from fitting.solvers.levenberg_marquardt import NEAR_MINIMUM
from fitting.solvers.objective import MESSAGES, succeeded
from fitting.solvers.options import Solver, check_options, make_solver
from fitting.solvers.problem import Problem, Targets, make_problem
from fitting.solvers.runs import Runs
from fitting.solvers.search import random_starts
from fitting.uncertainty.intervals import SolvedProblem
from fitting.uncertainty.likelihood_profile import LikelihoodProfile
from rubberfric.base import ArrayLike, StrPath, check_writable, replacing
from rubberfric.io import hdf5

_FORMAT = "rubberfric ensemble"
_ATTRIBUTES = {"kind": str, "seconds": float, "devices": int, "batch": int, "peak": int}
_UNITS = {"x": "-", "values": "as of the parameters", "cost": "-"}
_COUNTS = ("status", "nfev", "njev")


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class EnsembleResult:
    """Results of all members of an ensemble, with one row per member.

    Attributes
    ----------
    kind : kind of the members, see `Members`
    names : key paths of the free elements
    x, values : variables of the solver, and values of the elements, shape (members, size)
    cost : cost at x, shape (members,)
    status : how each member ended, a constant of `fitting.solvers.objective`, shape (members,)
    nfev, njev : evaluations of the residuals and of their Jacobian, shape (members,)
    seconds : wall time, with compilation in the first run, summed over all runs that a checkpoint joins
    devices : number of devices in the (last) run
    batch : number of members per device that took a step together; 0 if no step was left to take
    peak : memory of each device for a step, as stated by the compiler [B]
    """

    kind: str
    names: tuple[str, ...]
    x: np.ndarray
    values: np.ndarray
    cost: np.ndarray
    status: np.ndarray
    nfev: np.ndarray
    njev: np.ndarray
    seconds: float
    devices: int
    batch: int
    peak: int

    def __len__(self) -> int:
        return len(self.x)

    def __repr__(self) -> str:
        return f"<EnsembleResult: {len(self)} members of kind {self.kind!r}, {self.failed.size} failed>"

    @property
    def good(self) -> np.ndarray:
        """True for members that converged, shape (members,)."""
        return succeeded(self.status)

    @property
    def failed(self) -> np.ndarray:
        """Indices of the members that did not converge."""
        return np.flatnonzero(~self.good)

    @property
    def best(self) -> int:
        """Index of the member with the lowest finite cost."""
        if not np.isfinite(self.cost).any():
            raise ValueError("no member has a finite cost; check the start values")
        return int(np.argmin(np.where(np.isfinite(self.cost), self.cost, np.inf)))

    def interval(self, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Return the lower and upper quantiles of the converged members' values, each of shape (size,)."""
        check_options(level=level)
        if not self.good.any():
            raise ValueError("no member converged, so there are no quantiles")
        tail = 50 * (1 - level)
        low, high = np.percentile(self.values[self.good], [tail, 100 - tail], axis=0)
        return low, high

    def report(self) -> str:
        """Return the results of the members as text of several lines."""
        listed = ", ".join(map(str, self.failed[:10])) + ", ..." * (self.failed.size > 10)
        ended = [(np.sum(self.status == s), text) for s, text in MESSAGES.items() if s in self.status]
        lines = [
            "[[Ensemble]]",
            f"    kind     = {self.kind}",
            f"    members  = {len(self)}",
            *(f"    {count:8d} {text}" for count, text in ended),
            *[f"    failed: {listed}"] * bool(self.failed.size),
            f"    {self.nfev.sum()} evaluations, {self.njev.sum()} of them with derivatives,"
            f" in {self.seconds:.4g} s on {self.devices} device{'s' * (self.devices > 1)}",
        ]
        if self.batch:  # a checkpoint of a complete run needs no step
            lines += [f"    a step took {self.peak / 1e6:.4g} MB of each for a batch of {self.batch}"]
        if self.good.any():
            width = max(map(len, self.names))
            low, middle, high = np.percentile(self.values[self.good], [2.5, 50, 97.5], axis=0)
            lines += ["[[Values: median, and 95 % between]]"]
            rows = zip(self.names, middle, low, high, strict=True)
            lines += [f"    {n:{width}s} {m:12.6g}   {a:12.6g} ... {b:.6g}" for n, m, a, b in rows]
        return "\n".join(lines) + "\n"

    def save(self, path: StrPath) -> None:
        """Write the results to an HDF5 file (.h5), completely or not at all."""
        check_writable(path, (".h5",))
        with replacing(path) as temporary, hdf5.creating(temporary, _FORMAT) as file:
            for name, kind in _ATTRIBUTES.items():
                file.attrs[name] = kind(getattr(self, name))
            file["report"] = self.report()
            hdf5.write_texts(file, "names", self.names)
            for name, units in _UNITS.items():
                hdf5.write_values(file, name, getattr(self, name), units)
            for name in _COUNTS:
                file[name] = getattr(self, name)

    @classmethod
    def load(cls, path: StrPath) -> Self:
        """Load results from a file written by `save`. Raise ValueError if the file is invalid."""
        with hdf5.reading(path, _FORMAT) as file:
            shown = ("format", "format_version", "rubberfric_version", *_ATTRIBUTES)
            hdf5.check_names(file, ("report", "names", *_UNITS, *_COUNTS), shown)
            names = tuple(hdf5.read_texts(file, "names"))
            count = np.size(hdf5.read_values(file, "cost", _UNITS["cost"]))
            rows = {name: (count,) if name == "cost" else (count, len(names)) for name in _UNITS}
            arrays = {name: hdf5.read_array(file, name, _UNITS[name], shape) for name, shape in rows.items()}
            arrays |= {name: hdf5.read_counts(file, name, count) for name in _COUNTS}
            if not np.isin(arrays["status"], list(MESSAGES)).all():
                raise ValueError(f"/status: must be one of {', '.join(map(str, MESSAGES))}")
            return cls(names=names, **arrays, **hdf5.attributes(file, _ATTRIBUTES))


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Members:
    """The fits of an ensemble, made by `multi_start`, `bootstrap_members` or `profile_members`.

    Attributes
    ----------
    kind : "starts", "bootstrap" or "profile"
    problem : Problem, whose structure and numbers all members share
    starts : shape (members, size)
    targets : `Targets` with a leading axis, which has one entry per member or one entry for all
    solver : solver as for `fitting.solvers.runs.run_fits`
    max_steps : largest number of steps of a member
    parameter : for profiles, index of the parameter that is fixed at its start, shape (members,)
    source : FitResult from which the members were derived, or None
    level : confidence level of the intervals of a profile
    """

    kind: str
    problem: Problem
    starts: np.ndarray
    targets: Targets
    solver: Solver
    max_steps: int
    parameter: np.ndarray | None = None
    source: SolvedProblem | None = None
    level: float = 0.95

    def __post_init__(self) -> None:
        dtype = self.problem.start.dtype
        object.__setattr__(self, "starts", np.asarray(self.starts, dtype))
        object.__setattr__(self, "targets", jax.tree.map(lambda a: np.asarray(a, dtype), self.targets))

    def __len__(self) -> int:
        return len(self.starts)

    def __repr__(self) -> str:
        return f"<Members: {len(self)} of kind {self.kind!r}, {self.starts.shape[1]} parameters>"

    @property
    def names(self) -> tuple[str, ...]:
        """Key path of every free element."""
        return self.problem.names

    def profiles(self, ensemble: EnsembleResult) -> dict[str, LikelihoodProfile]:
        """Return the profiles that follow from the results of these members, as a dict by parameter name.

        Further fits are made until the threshold is reached, with warnings as in `FitResult.profile`.
        """
        if self.parameter is None or self.source is None:
            raise ValueError(f"members are of kind {self.kind!r}: must be 'profile', from profile_members")
        by_name = {}
        for i in dict.fromkeys(self.parameter.tolist()):
            name, own = self.names[i], self.parameter == i
            runs = Runs(*(getattr(ensemble, field)[own] for field in Runs._fields))
            by_name[name] = self.source.profile_of(name, self.level, runs)
            if by_name[name].warning:
                text = f"profile of {name!r}: {by_name[name].warning}"
                warnings.warn(text, RuntimeWarning, stacklevel=2)
        return by_name

    def fingerprint(self) -> str:
        """Return the SHA-256 hash of structure, constants, data, starts and solver of a run."""
        digest = hashlib.sha256()
        # The text of the scene's tree and the variables is complete: classes, static fields, key paths.
        static = self.problem.structure, jax.tree.structure(self.problem.numbers)
        for part in (self.kind, static, self.solver, self.max_steps):
            digest.update(repr(part).encode() + b"\0")
        for array in jax.tree.leaves((self.problem.numbers, self.targets, self.starts)):
            array = np.ascontiguousarray(array)
            digest.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
        return digest.hexdigest()


def multi_start(
    scene: rf.Scene | Mapping[str, rf.Scene],
    data: DataSets | Mapping[str, DataSets],
    free: Mapping[str, Constraint],
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
    """Return `Members` for the fit of one problem from several starts.

    Every member is a single run of the solver. `fitting.fit` does more for each of its few starts: robust
    losses begin with least squares, and a fit that drove a parameter towards zero is repeated. To finish,
    call `fitting.fit` with the scene of the best member.

    Parameters
    ----------
    starts : number of starts, or start vectors of shape (members, size) in the variables of the solver
        If a number is given, the first start has the values of the scene, and the other starts are random.
    other arguments : as for `fitting.fit`

    Examples
    --------
    Four starts, of which the first is the scene:

    >>> scene, q = rf.load_scene("data/tread_on_asphalt.toml"), np.logspace(2.5, 4, 4)
    >>> C = rf.power_spectrum(scene.lower.spectrum, q)
    >>> data = fitting.SpectrumData(q, C, relative=0.2, body="lower")
    >>> guess, h = scene.replace("lower.spectrum.h_rms", 1e-3), "lower.spectrum.h_rms"
    >>> ensemble = fitting.run_ensemble(fitting.multi_start(guess, data, {h: fitting.Positive()}, starts=4))
    >>> int(ensemble.good.sum()), round(1e3 * float(ensemble.values[ensemble.best, 0]), 6)  # height in mm
    (4, 0.5)
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
    targets = problem.targets.of_several()
    solver = make_solver(method, tolerance, max_steps)
    return Members("starts", problem, x, targets, solver, max_steps or solver.max_steps)


def bootstrap_members(
    result: SolvedProblem, count: int = 1000, key: jax.Array | None = None, tolerance: float | None = None
) -> Members:
    """Return `Members` for a parametric bootstrap, which fits data drawn from a fitted model.

    The data are drawn with the errors that the fit used. Each fit starts at the minimum of `result`.

    Parameters
    ----------
    result : FitResult
    count : number of data sets
    key : jax.random.key, or None for key(0); the data sets are the same as in `FitResult.bootstrap`
    tolerance : tolerance of the solver, or None for its default
        With 1e-6, a member ends within 1/50 of a standard error of the minimum, in two thirds of the steps.

    Examples
    --------
    The scatter of 200 fits agrees with the standard error of ln h_rms, 0.2 / 2 / sqrt(4):

    >>> scene, q = rf.load_scene("data/tread_on_asphalt.toml"), np.logspace(2.5, 4, 4)
    >>> C = rf.power_spectrum(scene.lower.spectrum, q)
    >>> data = fitting.SpectrumData(q, C, relative=0.2, body="lower")
    >>> result = fitting.fit(scene, data, {"lower.spectrum.h_rms": fitting.Positive()})
    >>> ensemble = fitting.run_ensemble(fitting.bootstrap_members(result, count=200))
    >>> round(float(np.std(np.log(ensemble.values))), 2)
    0.05
    """
    starts, targets = result.bootstrap_fits(count, key)
    solver = NEAR_MINIMUM if tolerance is None else dataclasses.replace(NEAR_MINIMUM, tolerance=tolerance)
    return Members("bootstrap", result.problem, starts, targets, solver, solver.max_steps, source=result)


def profile_members(
    result: SolvedProblem, names: str | Sequence[str] | None = None, level: float = 0.95, points: int = 8
) -> Members:
    """Return `Members` for profiles: each parameter is fixed in turn at 2 * `points` + 1 values.

    Parameters
    ----------
    result : FitResult
    names : names of the parameters. If None, all parameters are used.
    level, points : as for `FitResult.profile`

    Examples
    --------
    The 95 % interval of a height of 0.5 mm with an error of 5 %, which is 0.5 mm exp(+-1.96 0.05):

    >>> scene, q = rf.load_scene("data/tread_on_asphalt.toml"), np.logspace(2.5, 4, 4)
    >>> C = rf.power_spectrum(scene.lower.spectrum, q)
    >>> data = fitting.SpectrumData(q, C, relative=0.2, body="lower")
    >>> h = "lower.spectrum.h_rms"
    >>> members = fitting.profile_members(fitting.fit(scene, data, {h: fitting.Positive()}), h, points=4)
    >>> profile = members.profiles(fitting.run_ensemble(members))[h]
    >>> round(1e3 * float(profile.low), 3), round(1e3 * float(profile.high), 3)
    (0.453, 0.551)
    """
    check_options(level=level, points=points)
    names = result.names if names is None else (names,) if isinstance(names, str) else tuple(names)
    fits = [result.profile_fits(name, level, points) for name in dict.fromkeys(names)]
    rows = 2 * points + 1
    moving = np.concatenate([np.repeat(targets.moving, rows, axis=0) for _, targets in fits])
    targets = result.problem.targets.of_several(moving=moving)
    starts = np.concatenate([starts for starts, _ in fits])
    steps, parameter = NEAR_MINIMUM.max_steps, np.argmin(moving, axis=1)
    return Members("profile", result.problem, starts, targets, NEAR_MINIMUM, steps, parameter, result, level)
