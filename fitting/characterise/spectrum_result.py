"""What a fit of a self-affine spectrum gives back."""

import dataclasses

import numpy as np

import rubberfric as rf
from fitting.results.numbers import error_text
from fitting.results.result import FitResult
from rubberfric.base import html, unit_of


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class SpectrumFit:
    """A self-affine spectrum and how well it meets the one it was fitted to.

    Attributes
    ----------
    spectrum : SelfAffine
    residuals : ln(fit / measured) of the points within q0 ... q1; NaN where measured <= 0
    remarks : tuple of text: what was fixed because the data do not show it, and points left out
    fit : FitResult of what is left; `stderr`, `correlation`, `interval`, `profile` ... are its own
    """

    spectrum: rf.SelfAffine
    residuals: np.ndarray
    remarks: tuple[str, ...]
    fit: FitResult

    @property
    def rms(self) -> float:
        """Root-mean-square of the residuals."""
        return float(np.sqrt(np.nanmean(self.residuals**2)))

    @property
    def stderr(self) -> dict[str, float]:
        """Standard errors of the fields that were fitted, by name; NaN where withheld."""
        return dict(zip((name.rsplit(".", 1)[1] for name in self.fit.names), self.fit.stderr, strict=True))

    def __repr__(self) -> str:
        s = self.spectrum
        return (
            f"<SpectrumFit: h_rms {float(s.h_rms):.3g} m, H {float(s.hurst):.3g}, qr {float(s.qr):.3g} 1/m,"
            f" {self.rms:.2g} rms of ln C>"
        )

    def report(self) -> str:
        """The spectrum and its error bars, as text of several lines."""
        lines = [
            f"Self-affine spectrum of {self.fit.data[0].label}",
            f"    {self.fit.message}",
            f"    rms of ln(fit / measured): {self.rms:.2%}",
            *(f"    {remark}" for remark in self.remarks),
        ]
        lines += [f"    {name:>6} [{unit}] {value:>11}  {more}" for name, unit, value, more in self._rows()]
        slope = float(rf.rms_slope(self.spectrum))
        lines.append(f"    rms slope up to q1: {slope:.3g}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        rows = [
            (name, f"{value} {unit}".removesuffix(" -"), more) for name, unit, value, more in self._rows()
        ]
        rows += [*self.remarks, f"rms of ln(fit / measured): {self.rms:.2%}"]
        caption = f"Self-affine spectrum of {self.fit.data[0].label}: {self.fit.message}"
        return html.table(rows, ("parameter", "value", "error"), caption)

    def _rows(self):
        """Texts of every parameter: name, unit, value, and its error or why it has none."""
        rows = []
        for name in ("h_rms", "hurst", "qr", "q0", "q1"):
            value = float(getattr(self.spectrum, name))
            rows.append(
                (name, unit_of(rf.SelfAffine, name), f"{value:.4g}", error_text(self.fit, name, value))
            )
        return rows
