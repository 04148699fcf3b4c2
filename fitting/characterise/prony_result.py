"""What a fit of a Prony series gives back."""

import dataclasses

import numpy as np

import rubberfric as rf
from fitting.results.report import error_text
from fitting.results.result import FitResult
from rubberfric.base import html


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class PronyFit:
    """A Prony series and how well it meets the modulus it was fitted to.

    Attributes
    ----------
    material : Prony, terms that the data want absent left out
    dropped : relaxation times of those [s]; inf stands for E_inf
    residuals : ln(fit / measured) of E' and of E'', shape (2, n); NaN where measured <= 0
    rms_storage, rms_loss : their root mean squares
    fit : FitResult of the terms that are left, in ln E; its names count only those
    """

    material: rf.Prony
    dropped: np.ndarray
    residuals: np.ndarray
    fit: FitResult

    @property
    def rms_storage(self) -> float:
        """Root-mean-square of the residuals of E'."""
        return float(np.sqrt(np.nanmean(self.residuals[0] ** 2)))

    @property
    def rms_loss(self) -> float:
        """Root-mean-square of the residuals of E''."""
        return float(np.sqrt(np.nanmean(self.residuals[1] ** 2)))

    def __repr__(self) -> str:
        terms = self.material.tau.size
        return f"<PronyFit: {terms} terms, E' to {self.rms_storage:.2g}, E'' to {self.rms_loss:.2g} rms>"

    def report(self) -> str:
        """The series and its error bars, as text of several lines."""
        result, material = self.fit, self.material
        tau = np.asarray(material.tau)
        lines = [
            f"Prony series of {result.data[0].label}: {tau.size} terms, tau = {tau.min():.3g} ..."
            f" {tau.max():.3g} s",
            f"    {result.message}",
            f"    rms of ln(fit / measured): E' {self.rms_storage:.2%}, E'' {self.rms_loss:.2%}",
        ]
        if self.dropped.size:
            times = ", ".join(f"{t:.3g}" for t in self.dropped)
            lines.append(f"    absent, since the data are met best without them: tau = {times} s")
        lines.append(f"    {'tau [s]':>10} {'E [Pa]':>11}")
        lines += [f"    {time:>10} {value:>11}  {more}" for time, value, more in self._rows()]
        if np.inf in self.dropped:
            lines.append("    without E_inf it is a liquid; if it is a solid, give its E_inf")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        rows: list[tuple[str, ...] | str] = [*self._rows()]
        rows.append(f"rms of ln(fit / measured): E' {self.rms_storage:.2%}, E'' {self.rms_loss:.2%}")
        if self.dropped.size:
            rows.append(f"absent: tau = {', '.join(f'{t:.3g}' for t in self.dropped)} s")
        caption = f"Prony series of {self.fit.data[0].label}: {self.fit.message}"
        return html.table(rows, ("tau [s]", "E [Pa]", "error [Pa]"), caption)

    def _rows(self):
        """Texts of every term, E_inf first: relaxation time, modulus, and its error or why it has none."""
        material = self.material
        terms = zip(np.asarray(material.tau), np.asarray(material.E), strict=True)
        rows = [("inf", "E_inf", float(material.E_inf))]
        rows += [(f"{t:.4g}", f"E[{i}]", e) for i, (t, e) in enumerate(terms)]
        return [(time, f"{value:.4g}", error_text(self.fit, name, value)) for time, name, value in rows]
