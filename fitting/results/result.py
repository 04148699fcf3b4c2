"""What a fit gives back, and what can be asked of it."""

import dataclasses
from typing import Self

import jax
import numpy as np
from jax.typing import ArrayLike

import rubberfric as rf
from fitting.parameters.cutoffs import cutoff_path, last_wavevector
from fitting.parameters.scenes import by_name, chosen_scene
from fitting.parameters.variables import Array
from fitting.results import hdf5
from fitting.results.numbers import tied_lines, variable_rows
from fitting.results.plot import plot_fit
from fitting.results.record import FitRecord
from fitting.results.report import headlines, report
from fitting.solvers.runs import Callback
from fitting.uncertainty.density import log_density
from fitting.uncertainty.intervals import LikelihoodProfile
from rubberfric.base import StrPath, html, object_html
from rubberfric.plot import style


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FitResult(FitRecord):
    """A fit: its values, what they are worth, and all that it takes to use or repeat it.

    What it knows are its attributes, what can be asked of it its methods.
    """

    def predict(
        self,
        velocity: ArrayLike,
        pressure: ArrayLike,
        temperature: ArrayLike | None = None,
        quantity: str = "friction",
        scene: str | None = None,
    ) -> jax.Array:
        """A quantity of the fitted scene (any that `rubberfric.solve` knows), of several the one named."""
        at, quadrature = (velocity, pressure, temperature), self.problem.structure.quadrature
        solution = rf.solve(
            chosen_scene(self.scene, scene), *at, quadrature=quadrature, quantities=(quantity,)
        )
        return getattr(solution, quantity)

    def profile_cutoff(
        self,
        path: str | None = None,
        level: float = 0.95,
        values: ArrayLike | None = None,
        callback: Callback | None = None,
    ) -> LikelihoodProfile:
        """How well the data know where a spectrum ends: the cost over its q1, all else fitted again.

        Parameters
        ----------
        path : key path that ends in .q1, free in this fit or not; None: of the one rough solid
        level : of the interval
        values : of q1 [1/m]; None: from a tenth to ten times the fitted one, no farther than a table reaches

        Returns
        -------
        LikelihoodProfile
            its `parameters` are what the others become: `fitting.plot.plot_profile` draws them.
        """
        path = cutoff_path(self.scene, path)
        fit = self if path in self.names else self.freed(path)
        if values is None:
            around = fit[path].value * np.geomspace(0.1, 10.0, 12)
            values = around[around <= last_wavevector(self.scene, path)]
        return fit.profile(path, level, callback=callback, values=values)

    def log_density(self, x: Array) -> jax.Array:
        """Log density at x but for a constant, -cost; see `fitting.log_density`."""
        return log_density(self)(x)

    def report(self) -> str:
        """The fit as text of several lines, laid out as lmfit does; see `fitting.results.report`."""
        return report(self)

    def plot(self, ax: style.Panels | None = None) -> style.Panels:
        """Data, fit and band with residuals below; see `fitting.plot.plot_fit`."""
        return plot_fit(self, ax)

    def save(self, path: StrPath) -> None:
        """Write an HDF5 file (.h5), whole or not at all; see `fitting.results.hdf5`."""
        hdf5.save(path, self)

    @classmethod
    def load(cls, path: StrPath) -> Self:
        """Read back what `save` wrote; see `fitting.results.hdf5.load`."""
        return hdf5.load(path, cls)

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        return _html(self)


def _html(result: FitRecord) -> str:
    """The values of a fit as a table for notebooks, and its report and scene folded below."""
    rows = []
    for row in variable_rows(result):
        if isinstance(row, tuple):
            name, value, error, unit, share, start, remark = row
            row = (name, f"{value} +/- {error} {unit}", share, f"{start} {unit}", remark)
        rows.append(row)
    rows += tied_lines(result)
    rows += [f"not identified, {i}: {d.text}" for i, d in enumerate(result.unidentified, 1)]
    redchi = f"{result.redchi:.4g}" if np.isfinite(result.redchi) else "none"
    count = result.problem.targets.measured.size
    rows.append(f"measured values: {count}; reduced chi-square [-]: {redchi}; cost [-]: {result.cost:.6g}")
    caption = "; ".join(headlines(result)) or f"{result.message}; the scene {result.verdict.text}"
    headings = ("parameter", "value", "relative error", "start", "")
    below = (
        html.folded("report", html.preformatted(report(result))),
        *(
            html.folded(f"scene {name}".rstrip(), object_html(scene))
            for name, scene in by_name(result.scene).items()
        ),
    )
    return "\n".join([html.table(rows, headings, caption), *below])
