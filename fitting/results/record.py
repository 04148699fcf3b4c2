"""What a fit gives back, as a record: all that reports, files and pictures read."""

import dataclasses
from typing import NamedTuple

import numpy as np

import rubberfric as rf
from fitting.data.measured import Measured
from fitting.parameters.constraints import Rule
from fitting.parameters.priors import Prior
from fitting.parameters.variables import Variables
from fitting.solvers.iterate import MESSAGES, succeeded
from fitting.uncertainty.covariance import Direction
from fitting.uncertainty.intervals import SolvedProblem


class Minimum(NamedTuple):
    """A minimum that some of the starts reached."""

    cost: float
    count: int  # starts that reached it
    values: np.ndarray  # of the free elements


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FitRecord(SolvedProblem):
    """All that it takes to use or repeat a fit.

    Attributes
    ----------
    scene_at_start, free, prior, method, data : as given to `fitting.fit`
    status : how it ended, one of `fitting.solvers.iterate`
    nfev, njev, seconds : evaluations of residuals and of their Jacobian, wall time
    minima : the distinct ones that the starts found
    """

    scene_at_start: rf.Scene
    free: dict[str, Rule]
    prior: dict[str, Prior]
    method: str
    data: tuple[Measured, ...]
    status: int
    nfev: int
    njev: int
    minima: tuple[Minimum, ...]
    seconds: float

    @property
    def variables(self) -> Variables:
        """Structure of the free elements."""
        return self.problem.variables

    @property
    def scene(self) -> rf.Scene:
        """The scene with the fitted values."""
        return self.problem.scene(self.x)

    @property
    def values(self) -> np.ndarray:
        """Fitted values of the free elements."""
        return self.problem.values(self.x)

    @property
    def start_values(self) -> np.ndarray:
        """Their values at the first start."""
        return self.problem.values(self.problem.start)

    @property
    def stderr(self) -> np.ndarray:
        """Standard errors of the values, NaN where withheld."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the values, NaN where withheld."""
        return self.uncertainty.covariance

    @property
    def correlation(self) -> np.ndarray:
        """Correlation of x, NaN where withheld."""
        return self.uncertainty.correlation

    @property
    def withheld(self) -> dict[str, str]:
        """Why an element has no error bar, by its name."""
        return self.uncertainty.withheld

    @property
    def unidentified(self) -> tuple[Direction, ...]:
        """What the data leave open."""
        return self.uncertainty.unidentified

    @property
    def success(self) -> bool:
        """Whether the fit ended at a minimum."""
        return bool(succeeded(self.status))

    @property
    def message(self) -> str:
        """How it ended."""
        return MESSAGES[self.status]

    @property
    def chisqr(self) -> float:
        """Sum of squares of the data's residuals."""
        return self.uncertainty.chisqr

    @property
    def redchi(self) -> float:
        """The same by the degrees of freedom, NaN without any."""
        return self.chisqr / self.freedom if self.freedom > 0.5 else np.nan

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.message}; {len(self.names)} parameters, cost {self.cost:.6g}>"
