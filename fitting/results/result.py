"""What a fit gives back."""

import dataclasses
from typing import NamedTuple

import numpy as np

import rubberfric as rf
from fitting.parameters.layout import element_names, to_scene, to_values
from fitting.solvers.status import CONVERGED, MESSAGES, PERFECT
from fitting.uncertainty import intervals
from fitting.uncertainty.covariance import Uncertainty
from fitting.uncertainty.density import log_density


class Minimum(NamedTuple):
    """A minimum that some of the starts reached."""

    cost: float
    count: int  # starts that reached it
    values: np.ndarray  # of the free elements


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class FitResult:
    """A fit: its values, what they are worth, and all that it takes to use or repeat it.

    Attributes
    ----------
    scene : Scene with the fitted values
    names, values, start_values : free elements, their fitted and their first values
    stderr : standard errors of the values; NaN where withheld
    covariance, correlation : NaN where withheld
    withheld : dict of name -> why it has no error bar
    unidentified : tuple of `fitting.uncertainty.covariance.Direction`: what the data leave open
    success, status, message : whether and how the fit ended
    cost : half the sum of squares of data and priors (rho of them, with a robust loss)
    chisqr, freedom, redchi : sum of squares of the data's residuals, data minus the
        parameters that they determine, and their ratio (NaN without freedom)
    nfev, njev, seconds : evaluations of residuals and of their Jacobian, wall time
    minima : tuple of `Minimum`, the distinct ones that the starts found
    estimated : for every data set its estimated relative error, None where it was given
    """

    scene_at_start: rf.Scene
    free: dict
    prior: dict
    method: str
    data: tuple
    problem: object
    x: np.ndarray
    status: int
    cost: float
    nfev: int
    njev: int
    minima: tuple
    estimated: tuple
    uncertainty: Uncertainty
    seconds: float

    @property
    def layout(self):
        return self.problem.structure.layout

    @property
    def scene(self):
        return to_scene(self.layout, self.problem.numbers.constants, self.x)

    @property
    def names(self):
        return tuple(element_names(self.layout))

    @property
    def values(self):
        return np.asarray(to_values(self.layout, self.problem.numbers.constants, self.x))

    @property
    def start_values(self):
        return np.asarray(to_values(self.layout, self.problem.numbers.constants, self.problem.start))

    @property
    def stderr(self):
        return np.sqrt(np.diag(self.covariance))

    @property
    def covariance(self):
        return self.uncertainty.covariance

    @property
    def correlation(self):
        return self.uncertainty.correlation

    @property
    def withheld(self):
        return self.uncertainty.withheld

    @property
    def unidentified(self):
        return self.uncertainty.unidentified

    @property
    def success(self):
        return self.status in (CONVERGED, PERFECT)

    @property
    def message(self):
        return MESSAGES[self.status]

    @property
    def chisqr(self):
        return self.uncertainty.chisqr

    @property
    def freedom(self):
        return self.problem.targets.measured.size - self.uncertainty.parameters

    @property
    def redchi(self):
        return self.chisqr / self.freedom if self.freedom > 0.5 else np.nan

    def __repr__(self):
        return f"<FitResult: {self.message}; {len(self.names)} parameters, cost {self.cost:.6g}>"

    def _repr_html_(self):
        """A table for notebooks."""
        from fitting.results.html import fit_html

        return fit_html(self)

    def interval(self, level=0.95):
        """Lower and upper ends of every value's interval, NaN where withheld; see `fitting.uncertainty.intervals`."""
        return intervals.interval(self, level)

    def predict(self, velocity, pressure, temperature=None, quantity="friction"):
        """A quantity of the fitted scene (any that `rf.solve` knows)."""
        solution = rf.solve(
            self.scene,
            velocity,
            pressure,
            temperature,
            quadrature=self.problem.structure.quadrature,
            quantities=(quantity,),
        )
        return getattr(solution, quantity)

    def band(self, velocity, pressure, temperature=None, quantity="friction", level=0.95):
        """Prediction, and the ends of its band; see `fitting.uncertainty.intervals.band`."""
        return intervals.band(self, velocity, pressure, temperature, quantity, level)

    def profile(self, name, level=0.95, points=8, callback=None):
        """Profile likelihood of one parameter; see `fitting.uncertainty.intervals.profile`."""
        return intervals.profile(self, name, level, points, callback)

    def bootstrap(self, count=100, key=None, callback=None):
        """Refits of simulated data; see `fitting.uncertainty.intervals.bootstrap`."""
        return intervals.bootstrap(self, count, key, callback)

    def log_density(self, x):
        """Log density at x but for a constant, -cost; see `fitting.log_density`."""
        return log_density(self)(x)

    def report(self):
        """The fit in words and numbers, laid out as lmfit does."""
        from fitting.results.report import report

        return report(self)

    def plot(self, ax=None):
        """Data, fit and band with residuals below; see `fitting.plot.plot_fit`."""
        from fitting.results.plot import plot_fit

        return plot_fit(self, ax)

    def save(self, path):
        """Write an HDF5 file (.h5), whole or not at all; see `fitting.results.hdf5`."""
        from fitting.results.hdf5 import save

        save(path, self)

    @classmethod
    def load(cls, path):
        """Read back what `save` wrote."""
        from fitting.results.hdf5 import load

        return load(path)
