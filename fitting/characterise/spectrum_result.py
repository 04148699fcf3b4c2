"""What a fit of a self-affine spectrum gives back."""

import dataclasses

import numpy as np

import rubberfric as rf
from fitting.results.result import FitResult
from rubberfric.base.html import table


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class SpectrumFit:
    """A self-affine spectrum and how well it meets the one it was fitted to.

    Attributes
    ----------
    spectrum : SelfAffine
    residuals : ln(fit / measured) of the points within q0 ... q1; NaN where measured <= 0
    notes : tuple of text: what was held because the data do not show it, and points left out
    fit : FitResult of what is left; `stderr`, `correlation`, `interval`, `profile` ... are its own
    """

    spectrum: rf.SelfAffine
    residuals: np.ndarray
    notes: tuple
    fit: FitResult

    @property
    def rms(self):
        """Root-mean-square of the residuals."""
        return float(np.sqrt(np.nanmean(self.residuals**2)))

    @property
    def stderr(self):
        """dict of field -> standard error, of those that were fitted; NaN where withheld."""
        return dict(zip((name.rsplit(".", 1)[1] for name in self.fit.names), self.fit.stderr, strict=True))

    def __repr__(self):
        s = self.spectrum
        return (
            f"<SpectrumFit: h_rms {float(s.h_rms):.3g} m, H {float(s.hurst):.3g}, qr {float(s.qr):.3g} 1/m,"
            f" {self.rms:.2g} rms of ln C>"
        )

    def report(self):
        """The spectrum and its error bars in words and numbers."""
        lines = [
            f"Self-affine spectrum of {self.fit.data[0].label}",
            f"    {self.fit.message}",
            f"    rms of ln(fit / measured): {self.rms:.2%}",
            *(f"    {note}" for note in self.notes),
        ]
        lines += [f"    {name:>6} [{unit}] {value:>11}  {more}" for name, unit, value, more in self._rows()]
        slope = float(rf.rms_slope(self.spectrum))
        lines.append(f"    rms slope up to q1: {slope:.3g}")
        return "\n".join(lines)

    def _repr_html_(self):
        """A table for notebooks."""
        rows = [
            (name, f"{value} {unit}".removesuffix(" -"), more) for name, unit, value, more in self._rows()
        ]
        rows += [*self.notes, f"rms of ln(fit / measured): {self.rms:.2%}"]
        caption = f"Self-affine spectrum of {self.fit.data[0].label}: {self.fit.message}"
        return table(rows, ("parameter", "value", "error"), caption)

    def _rows(self):
        """Texts of every parameter: name, unit, value, and its error or why it has none."""
        errors, rows = self.stderr, []
        withheld = {name.rsplit(".", 1)[1]: why for name, why in self.fit.withheld.items()}
        for name, unit in (("h_rms", "m"), ("hurst", "-"), ("qr", "1/m"), ("q0", "1/m"), ("q1", "1/m")):
            value = float(getattr(self.spectrum, name))
            if name in withheld:
                more = f"error bar withheld: {withheld[name]}"
            elif name in errors:
                more = f"+/- {errors[name]:.2g} ({errors[name] / value:.1%})"
            else:
                more = "(fixed)"
            rows.append((name, unit, f"{value:.4g}", more))
        return rows
