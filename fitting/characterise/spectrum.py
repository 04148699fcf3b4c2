r"""Fit a self-affine spectrum to a measured one: h_rms, H, q_r and their errors.

.. math:: \ln C = \ln C_0 \; (q < q_r), \qquad \ln C = \ln C_0 - 2(1 + H) \ln(q/q_r) \; (q > q_r)

`fitting.characterise.broken_line` finds the global minimum. `fitting.fit` starts there and computes errors,
correlations and the directions that the data do not determine.
"""

import dataclasses

import numpy as np

import rubberfric as rf
from fitting.characterise.broken_line import limited_by_height, start_line
from fitting.data.heights import resolved_ends, spectrum_data
from fitting.data.kinds import SpectrumData
from fitting.fit import fit
from fitting.parameters.constraints import Bounded, Constraint, Positive, is_number
from fitting.results.report import error_text
from fitting.results.result import FitResult
from rubberfric.base import ArrayLike, html, shown, unit_of
from rubberfric.roughness import ArealSpectrum, MeasuredSpectrum

# Slopes for H = 0 and H = 1.
_SLOPES = (2.0, 4.0)
# Distance of H from 0 or 1 below which H is fixed there.
_AT_END = 1e-6
# Largest rms of ln(fit / measured) of a self-affine surface. Heights, as sqrt(C), are then 20 % off.
_POOR = 0.4
# Difference of the fitted rms height from that of the heights, which the report questions if it also exceeds
# two standard errors. Single surfaces scatter by some percent.
_OTHER_HEIGHT = 0.1


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class SpectrumFit:
    """Result of `fit_spectrum`: a self-affine spectrum, its residuals, and the uncertainty of its parameters.

    Attributes
    ----------
    spectrum : SelfAffine
    residuals : ln(fit / measured) of the points within q0 ... q1; NaN where measured <= 0
    remarks : texts on points that were not used, and on parameters that were fixed because the data do not
        determine them
    fit : FitResult of the free parameters, with `stderr`, `correlation`, `interval`, `profile` ...
    rms_height : rms height of the heights, or of the points of a table if all are > 0 [m]; None if unknown

    Examples
    --------
    A slope -2 (1 + H) of 21 points with errors of 10 % over two decades determines H to 0.8 %:

    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> q = np.geomspace(100.0, 1e5, 31)
    >>> road_fit = fitting.fit_spectrum(fitting.SpectrumData(q, rf.power_spectrum(road, q), relative=0.1))
    >>> round(float(road_fit.spectrum.hurst), 3), round(float(road_fit.stderr["hurst"]), 3)
    (0.8, 0.008)
    >>> print(road_fit.report().splitlines()[0])
    Self-affine spectrum of spectrum, 31 points
    """

    spectrum: rf.SelfAffine
    residuals: np.ndarray
    remarks: tuple[str, ...]
    fit: FitResult
    rms_height: float | None = None

    @property
    def rms(self) -> float:
        """Root-mean-square of the residuals."""
        return float(np.sqrt(np.nanmean(self.residuals**2)))

    @property
    def stderr(self) -> dict[str, float]:
        """Dict of name of a fitted field -> standard error, NaN for a field without an error bar."""
        return dict(zip((name.rsplit(".", 1)[1] for name in self.fit.names), self.fit.stderr, strict=True))

    def __repr__(self) -> str:
        s = self.spectrum
        return (
            f"<SpectrumFit: h_rms {float(s.h_rms):.3g} m, H {float(s.hurst):.3g}, qr {float(s.qr):.3g} 1/m,"
            f" {self.rms:.2g} rms of ln C>"
        )

    def report(self) -> str:
        """Return a report of several lines: the spectrum, its misfit and its error bars."""
        lines = [
            f"Self-affine spectrum of {self.fit.data[0].label}",
            f"    {self.fit.message}",
            f"    {self._misfit}",
            *(f"    {text}" for text in self._heights),
            *(f"    {remark}" for remark in self.remarks),
        ]
        lines += [f"    {name:>6} [{unit}] {value:>11}  {more}" for name, unit, value, more in self._rows()]
        slope = float(rf.rms_slope(self.spectrum))
        lines.append(f"    rms slope up to q1: {slope:.3g}")
        return "\n".join(lines)

    @property
    def _misfit(self):
        """Rms of the residuals, and a recommendation if it is large."""
        text = f"rms of ln(fit / measured): {self.rms:.2g}, a factor of {np.exp(self.rms):.2f}"
        if self.rms > _POOR:
            text += ": poor; the surface is not self-affine: use a TabulatedSpectrum (--table)"
        return text

    @property
    def _heights(self):
        """Rms heights of the fit and of the data, and a judgement if they differ much; or ()."""
        if self.rms_height is None:
            return ()
        fitted = float(self.spectrum.h_rms)
        change, error = fitted / self.rms_height - 1, self.stderr.get("h_rms", np.nan) / fitted
        percent = round(100 * change, 1) + 0.0  # no -0.0
        text = f"rms height: fit {fitted:.4g} m, data {self.rms_height:.4g} m, {percent:+.1f} %"
        if abs(change) > max(_OTHER_HEIGHT, 2 * np.nan_to_num(error)):
            text += f", more than {_OTHER_HEIGHT:.0%} and two standard errors: C below qr is uncertain, or"
            text += " the surface has waves outside q0 ... q1 or is not self-affine:"
            text += " use a TabulatedSpectrum (--table)"
        return (text,)

    def _repr_html_(self) -> str:
        rows = [
            (name, f"{value} {unit}".removesuffix(" -"), more) for name, unit, value, more in self._rows()
        ]
        rows += [*self.remarks, self._misfit, *self._heights]
        caption = f"Self-affine spectrum of {self.fit.data[0].label}: {self.fit.message}"
        return html.table(rows, ("parameter", "value", "error"), caption)

    def _rows(self):
        """Return a tuple of texts (name, unit, value, error) for every parameter.

        If a parameter has no error bar, the last text is the reason.
        """
        rows = []
        for name in ("h_rms", "hurst", "qr", "q0", "q1"):
            value = float(getattr(self.spectrum, name))
            rows.append(
                (name, unit_of(rf.SelfAffine, name), f"{value:.4g}", error_text(self.fit, name, value))
            )
        return rows


def fit_spectrum(
    data: SpectrumData
    | MeasuredSpectrum
    | ArealSpectrum
    | rf.TabulatedSpectrum
    | tuple[ArrayLike, ArrayLike],
    *,
    q0: float | None = None,
    q1: float | None = None,
    qr: float | str = "fit",
    hurst: float | str = "fit",
    relative: ArrayLike | None = None,
    body: str | None = None,
) -> SpectrumFit:
    r"""Fit a self-affine spectrum to a measured one.

    .. math:: \min \sum_k \left( \frac{\ln C(q_k) - \ln C_k}{e_k} \right)^2

    The sum is minimised over h_rms, H and q_r. If the data have absolute errors, the differences are absolute
    instead of logarithmic.

    Parameters
    ----------
    data : SpectrumData, TabulatedSpectrum, or a pair (q, C) [1/m], [m^4]; or heights: the result of
        `rubberfric.roughness.spectrum_of_topography`, `spectrum_of_profile` or `areal_spectrum`
        `spectrum_data` states which wavevectors of heights are used.
    q0, q1 : cut-offs of the surface [1/m]; None: q0 and q1 of the table, or the first and the last wavevector
        of the data. For heights, q1 is the end of the resolved range, and q0 of profiles their first
        wavevector. Data outside are not used. h_rms is the rms height of the range q0 < q < q1, even if
        this range is larger than the range of the data.
    qr : "fit", or a fixed value of the roll-off wavevector [1/m]; qr = q0 means no plateau
    hurst : "fit", or a fixed value of H [-]
    relative : standard error of ln C [-], for data without errors; a number, or an array with a value for
        each point
    body : "lower" or "upper", body in the key paths of the result's `fit`; None: the body of the data, or
        "lower"

    Returns
    -------
    SpectrumFit

    Raises
    ------
    ValueError
        `data` has another type, the cut-offs are in the wrong order, or there are not more values than
        unknowns. The message is one line.

    Notes
    -----
    The relative error of data without errors is estimated from their scatter (`fitting.fit`). q_r is fixed at
    q0 if the data show no plateau, that is, if a straight line fits as well by Schwarz's criterion, or if
    at most one point lies below the roll-off. If h_rms of profiles would then be more than twice their rms
    height, q_r is fixed where both agree. If the decrease is flatter than for H = 0 or steeper than for
    H = 1, H is fixed at this limit. `SpectrumFit.remarks` names the parameters that were fixed.

    The standard errors are those of Gaussian surfaces. For maps of one longest wave, deviations of h_rms, H
    and q_r from the truth were 1.1, 0.9 and 0.9 standard errors (rms of 60 random surfaces), and up to 1.3
    and 1.6 if the directions of the surface differ by axes of 3 and 6 to one (40). For 12 profiles of 1.6
    longest waves they were 1.3, 1.3 and 1.8, and 1.0, 1.2 and 1.3 for 6 profiles of two (40). Standard errors
    of few short profiles are therefore too small.

    Examples
    --------
    >>> x, traces = rf.io.read_traces("data/laboratory/stylus.csv")
    >>> measured = rf.roughness.spectrum_of_profile(x, traces, per_decade=10)
    >>> spectrum = fitting.fit_spectrum(measured).spectrum
    >>> round(float(spectrum.hurst), 2), round(1e6 * float(spectrum.h_rms))  # the height in µm
    (0.86, 155)
    """
    q0, q1 = (end if cutoff is None else cutoff for cutoff, end in zip((q0, q1), _ends(data), strict=True))
    rms_height = data.rms_height if isinstance(data, MeasuredSpectrum) else None
    of_profiles = isinstance(data, MeasuredSpectrum) and data.dimensions == 1
    if isinstance(data, MeasuredSpectrum | ArealSpectrum):
        data = spectrum_data(data)
    data = _data(data, relative, body)
    body = data.body or "lower"
    q0 = _cutoff("q0", q0, data.q.min())
    q1 = _cutoff("q1", q1, data.q.max())
    if not q0 < q1:
        raise ValueError(f"q1 = {q1:g}: must be > q0 = {q0:g}")
    fixed_H = _fixed("hurst", hurst, 0.0, 1.0)
    fixed_qr = _fixed("qr", qr, q0, q1)
    data, remarks = _within(data, q0, q1, 1 + (fixed_H is None) + (fixed_qr is None))
    t, y = np.log(data.q), np.log(np.maximum(data.C, 1e-12 * data.C.max()))
    weight = _weights(data)
    slopes = _SLOPES if fixed_H is None else (2 * (1 + fixed_H), 2 * (1 + fixed_H))
    line, no_kink = start_line(t, y, weight, slopes, fixed_qr, q0, q1, known=data.error is not None)
    if no_kink and of_profiles and rms_height is not None:
        line, no_kink = limited_by_height(line, no_kink, q0, q1, rms_height, data.q.min())
    remarks += no_kink
    H = line.slope / 2 - 1
    spectrum = rf.SelfAffine.from_C0(q0, *_ordered(line, q0, q1, H), np.exp(line.level))
    free, held = _free(body, H, fixed_H is None, fixed_qr is None and not no_kink)
    remarks += held
    result = fit(_scene(spectrum, body), data, free)
    spectrum = getattr(result.scene, body).spectrum
    why = result.withheld.get(f"{body}.spectrum.qr", "")
    if why.startswith("at its"):  # with absolute errors the minimum may differ from the logarithmic start
        at = q0 if "lower" in why else q1
        fitted = fit_spectrum(data, q0=q0, q1=q1, qr=at, hurst=hurst, body=None if data.body else body)
        remarks.append(f"the roll-off is not within q0 ... q1: qr is held at {at:.4g} 1/m")
        return dataclasses.replace(fitted, remarks=tuple(remarks), rms_height=rms_height or fitted.rms_height)
    model = np.asarray(rf.power_spectrum(spectrum, np.clip(data.q, q0 * (1 + 1e-12), q1 * (1 - 1e-12))))
    residuals = np.log(model / np.where(data.C > 0, data.C, np.nan))
    if rms_height is None and q0 == data.q.min() and q1 == data.q.max():
        rms_height = _height_of_points(data)
    return SpectrumFit(spectrum, residuals, tuple(remarks), result, rms_height)


def _ends(data):
    """Return the cut-offs (q0, q1) that a table or heights state, or (None, None)."""
    if isinstance(data, rf.TabulatedSpectrum):
        return tuple(None if end is None else float(end) for end in (data.q0, data.q1))
    return resolved_ends(data) if isinstance(data, MeasuredSpectrum | ArealSpectrum) else (None, None)


def _scene(spectrum, body):
    """Return a scene of a rigid body with the spectrum and a smooth body, whose modulus is not used."""
    rough, smooth = rf.Body(rf.Rigid(), spectrum), rf.Body(rf.Elastic(1e6, 0.5))
    return rf.Scene(rough, smooth) if body == "lower" else rf.Scene(smooth, rough)


def _free(body, H, fits_hurst, fits_rolloff):
    """Return the free parameters of the fit, and remarks on parameters that are fixed at their limits."""
    free: dict[str, Constraint] = {f"{body}.spectrum.h_rms": Positive()}
    remarks = []
    if fits_hurst and _AT_END < H < 1 - _AT_END:
        free[f"{body}.spectrum.hurst"] = Bounded(0.0, 1.0)
    elif fits_hurst:
        steeper = "steeper than H = 1" if H > 0.5 else "flatter than H = 0"
        remarks = [f"the decrease is {steeper}: H is fixed at this limit"]
    if fits_rolloff:
        free[f"{body}.spectrum.qr"] = Positive()
    return free, remarks


def _height_of_points(data):
    """Return the rms height of a log-log linear table of the points, or None if it has values <= 0."""
    q, first = np.unique(data.q, return_index=True)
    C = data.C[first]
    return float(rf.roughness.rms_height(rf.TabulatedSpectrum(q, C))) if np.all(C > 0) else None


def _data(data, relative, body):
    if isinstance(data, rf.TabulatedSpectrum):
        data = (data.q, data.C)
    if isinstance(data, tuple) and len(data) == 2:
        return SpectrumData(*(np.asarray(x) for x in data), relative=relative, body=body)
    if not isinstance(data, SpectrumData):
        raise ValueError(
            f"data is a {type(data).__name__}: must be SpectrumData, TabulatedSpectrum, MeasuredSpectrum,"
            " ArealSpectrum or (q, C)"
        )
    for name, value, own in (("relative", relative, data.error), ("body", body, data.body)):
        if value is not None and own is not None:
            raise ValueError(f"{name} = {shown(value)}: must not be given, because the data specify it")
    if relative is None and body is None:
        return data
    relative = data.relative if relative is None else relative
    return dataclasses.replace(data, relative=relative, body=body or data.body, check_units=False)


def _within(data, q0, q1, unknowns):
    """Return the data within the cut-offs, and a list with a remark on points outside."""
    inside = (data.q >= q0) & (data.q <= q1)
    if inside.sum() < unknowns + 1:
        raise ValueError(
            f"data {data.label!r}: {inside.sum()} values within {q0:g} ... {q1:g} 1/m for {unknowns}"
            " unknowns: must have more values than unknowns"
        )
    if inside.all():
        return data, []
    part = {name: None if (x := getattr(data, name)) is None else x[inside] for name in data.fields()}
    remark = f"{(~inside).sum()} of {inside.size} points lie outside q0 ... q1: not used"
    return dataclasses.replace(data, **part, check_units=False), [remark]


def _weights(data):
    """Return the weight of every ln C: 1 / variance, or 1 if the data have no errors."""
    if data.error is None:
        return np.ones(len(data))
    error = data.error if data.logarithmic else data.error / np.maximum(data.C, data.error)
    return error**-2.0


def _cutoff(name, value, default):
    if value is None:
        return float(default)
    if not (is_number(value) and value > 0):
        raise ValueError(f"{name} = {shown(value)}: must be None or a number > 0 [1/m]")
    return float(value)


def _fixed(name: str, value: float | str, low: float, high: float) -> float | None:
    if isinstance(value, str) and value == "fit":
        return None
    if isinstance(value, str) or not (is_number(value) and low <= value <= high):
        raise ValueError(f"{name} = {shown(value)}: must be 'fit' or a number, {low:g} ... {high:g}")
    return float(value)


def _ordered(line, q0, q1, H):
    """Return (qr, q1, H) of a `Line`, limited to q0 <= qr <= q1 and 0 <= H <= 1.

    If qr differs from q0 or q1 only by rounding, qr is exactly q0 or q1.
    """
    qr = next((q for q in (q0, q1) if abs(line.kink - np.log(q)) < 1e-12), np.exp(line.kink))
    return float(np.clip(qr, q0, q1)), q1, float(np.clip(H, 0.0, 1.0))
