"""The record of a fit, from which reports, files and plots are made."""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from fitting.budget.changes import Sizes
from fitting.budget.contributions import CONTACT, Contribution, SolvedFit, contributions, largest_error
from fitting.data.measured import Measured
from fitting.parameters.constraints import Constraint, Positive
from fitting.parameters.discrepancy import Discrepancy
from fitting.parameters.plausible import implausible
from fitting.parameters.priors import Prior
from fitting.parameters.scenes import ALL, Scenes, each_scene, unit
from fitting.parameters.variables import Variables
from fitting.results.at_bounds import AtBound
from fitting.solvers.evaluation import residual_rows
from fitting.solvers.further import FurtherStarts
from fitting.solvers.objective import MESSAGES, succeeded
from fitting.solvers.problem import make_problem
from fitting.uncertainty.covariance import uncertainty
from fitting.uncertainty.intervals import SolvedProblem, Valley, valleys
from fitting.uncertainty.verdict import Verdict, verdict
from rubberfric.base import Labelled, LabelledArrays, closest


class Minimum(NamedTuple):
    """A minimum that one or several starts reached."""

    cost: float
    count: int  # starts that reached it
    values: np.ndarray  # of the free elements


class Fitted(NamedTuple):
    """Value, standard error and start value of one free number, or of all free elements of an array."""

    value: Any
    stderr: Any  # NaN if the error bar is withheld
    start: Any


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FitRecord(SolvedProblem):
    """Everything needed to use or repeat a fit.

    Attributes
    ----------
    scene_at_start, free, prior, method, data : as given to `fitting.fit`
    discrepancy : as given, with the estimated amplitude and width
    data_scenes : name of the scene of each data set, "" for a single scene
    status : how the fit ended, a constant of `fitting.solvers.objective`
    nfev, njev : number of evaluations of the residuals and of their Jacobian
    seconds : wall time [s]
    minima : distinct minima that the starts found
    further : fits from further starts, None if there was no reason for them
    bounds : fits along parameters at a bound, see `fitting.results.at_bounds`
    assumed : True if data without errors have an assumed relative error, False if this error was estimated
    """

    scene_at_start: Scenes
    free: dict[str, Constraint]
    prior: dict[str, Prior]
    method: str
    data: tuple[Measured, ...]
    data_scenes: tuple[str, ...]
    discrepancy: Discrepancy | None = None
    status: int
    nfev: int
    njev: int
    minima: tuple[Minimum, ...]
    seconds: float
    further: FurtherStarts | None = None
    bounds: tuple[AtBound, ...] = ()
    assumed: bool = False

    def __getitem__(self, path: str) -> Fitted:
        """Return a free parameter, or all free elements of an array, as in result["gamma"].stderr.

        Raise KeyError if the path was not free.
        """
        columns = self.values, self.stderr, self.start_values
        scene, _, below = path.partition(".")
        if isinstance(self.scene_at_start, dict) and scene in self.scene_at_start:
            # The shared name, such as *.shear.tau_f0, if all scenes share the parameter.
            shared = {name.split("[")[0] for name in self.names if name.startswith(ALL)}
            path = f"{ALL}{below}" if f"{ALL}{below}".split("[")[0] in shared else path
        if path in self.names:
            return Fitted(*(float(column[self.names.index(path)]) for column in columns))
        which = [i for i, name in enumerate(self.names) if name.startswith(f"{path}[")]
        if not which:
            paths = tuple(dict.fromkeys(name.split("[")[0] for name in self.names))
            raise KeyError(f"{path!r} was not free: {closest(path, paths)}")
        return Fitted(*(column[which] for column in columns))

    def freed(self, path: str, rule: Constraint | None = None) -> Self:
        """Return this record with the parameter `path` free in addition, by default Positive().

        Nothing is fitted again, so the result is not a minimum with respect to the new parameter. Raise
        ValueError as `fitting.fit`.
        """
        of, loss, width = self.data_scenes, self.problem.structure.loss, float(self.problem.numbers.width)
        free = self.free | {path: Positive() if rule is None else rule}
        settings = loss, width, self.problem.structure.quadrature, of
        problem = make_problem(self.scene, self.data, free, self.prior, *settings)
        problem = problem._replace(targets=problem.targets._replace(error=self.problem.targets.error))
        known = uncertainty(problem, problem.start)
        return dataclasses.replace(self, free=free, problem=problem, x=problem.start, uncertainty=known)

    def to_dataframe(self) -> Any:
        """Return the free parameters as a pandas.DataFrame indexed by key path.

        The columns are value, stderr, start, unit and withheld. Raise ImportError without pandas.
        """
        return self._labelled().to_dataframe().set_index("parameter").rename_axis(None)

    def to_xarray(self) -> Any:
        """Return the free parameters as an xarray.Dataset over "parameter", with their correlation.

        The correlation has the dimensions "parameter" and "other". Raise ImportError without xarray.
        """
        data = self._labelled().to_xarray()
        correlation = ("parameter", "other"), self.correlation, {"units": "-"}
        return data.assign(correlation=correlation).assign_coords(other=list(self.names))

    def _labelled(self) -> LabelledArrays:
        withheld = [self.withheld.get(name, "") for name in self.names]
        arrays = {"value": self.values, "stderr": self.stderr, "start": self.start_values}
        quantities = arrays | {"unit": self.units, "withheld": withheld}
        attributes = {"message": self.message, "cost": self.cost, "redchi": self.redchi}
        return LabelledArrays(
            {"parameter": Labelled(list(self.names))},
            {name: Labelled(values) for name, values in quantities.items()},
            ("parameter",),
            attributes,
        )

    @property
    def units(self) -> list[str]:
        """Unit of each free element, "-" if it is dimensionless."""
        slots = [(free.path, free.slot[1] - free.slot[0]) for free in self.variables.own]
        return [text for path, n in slots for text in [unit(self.scene_at_start, path) or "-"] * n]

    @property
    def variables(self) -> Variables:
        """Structure of the free elements."""
        return self.problem.variables

    @property
    def scene(self) -> Any:
        """The scene with the fitted values, or a dict of the scenes by name."""
        return self.problem.scene(self.x)

    @property
    def values(self) -> np.ndarray:
        """Fitted values of the free elements."""
        return self.problem.values(self.x)

    @property
    def start_values(self) -> np.ndarray:
        """Values of the free elements at the first start."""
        return self.problem.values(self.problem.start)

    @property
    def success(self) -> bool:
        """True if the fit ended at a minimum."""
        return bool(succeeded(self.status))

    @property
    def message(self) -> str:
        """Description of the end of the fit."""
        return MESSAGES[self.status]

    @functools.cached_property
    def residuals(self) -> tuple[np.ndarray, ...]:
        """Residuals (model - measured) / error of every data set, with the given or the estimated errors."""
        rows = residual_rows(self.problem, self.x)
        sets = zip(self.problem.order, self.estimated, strict=True)
        return tuple(rows[where] * (self.error_scale if scale is None else 1.0) for where, scale in sets)

    @functools.cached_property
    def verdict(self) -> Verdict:
        """Verdict of the tests whether the scene explains the data. See `fitting.uncertainty.verdict`."""
        return self._judged(range(len(self.data)))

    @functools.cached_property
    def largest_error(self) -> str:
        """Sentence on the largest error beyond the noise that `budget` finds, or "" if the noise is larger.

        It compares the theory with the law fitted to boundary elements, and uses stated errors of fixed
        numbers. The first call compiles the law. It is "" for a fit without success.
        """
        if not self.success:
            return ""
        return self.sentence_on(contributions(solved_fit(self), Sizes(), only=(CONTACT, "stated"))[0])

    def sentence_on(self, rows: Sequence[Contribution]) -> str:
        """Return the sentence on the largest of some contributions. See `Budget.largest`."""
        is_linear, has = self.problem.structure.loss == "linear", self.discrepancy is not None
        return largest_error(self.names, self.values, self.stderr, rows, self.data, is_linear, has)

    @functools.cached_property
    def valleys(self) -> tuple[Valley, ...]:
        """Pairs of closely correlated parameters, with a check of the linear confidence intervals."""
        return valleys(self)

    @functools.cached_property
    def verdicts(self) -> dict[str, Verdict]:
        """Verdict on every scene, as a dict by name. The name of a single scene is ""."""
        own: dict[str, list[int]] = {}
        for i, name in enumerate(self.data_scenes):
            own.setdefault(name, []).append(i)
        return {name: self._judged(which) for name, which in own.items()}

    def _judged(self, which: Sequence[int]) -> Verdict:
        """Return the verdict on the data sets `which`, with their share of the number of parameters."""
        data, rows = [self.data[i] for i in which], [self.residuals[i] for i in which]
        estimated = [self.estimated[i] for i in which]
        share = sum(map(len, rows)) / self.problem.targets.measured.size
        known, loss = self.uncertainty.parameters * share, self.problem.structure.loss
        plausible = not implausible(self.names, self.values)
        return verdict(data, rows, known, estimated, loss, plausible)

    @property
    def chisqr(self) -> float:
        """Sum of squares of `residuals`."""
        if self.error_scale == 1:
            return self.uncertainty.chisqr
        return float(sum(np.sum(rows**2) for rows in self.residuals))

    @property
    def redchi(self) -> float:
        """Reduced chi-square: `chisqr` divided by `freedom`, or NaN if there are no degrees of freedom."""
        return self.chisqr / self.freedom if self.freedom > 0.5 else np.nan

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.message}; {len(self.names)} parameters, cost {self.cost:.6g}>"


def solved_fit(fit: FitRecord) -> SolvedFit:
    """Return what `fitting.budget` needs of a fit."""
    scenes = each_scene(fit.scene, fit.data_scenes)
    known = fit.problem, fit.x, fit.uncertainty, fit.prior, fit.data, scenes
    return SolvedFit(*known, fit.discrepancy is not None)
