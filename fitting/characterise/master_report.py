"""Report on a master curve: shifts, laws, signs that the sweeps do not superpose, and data frames."""

from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import brentq

from fitting.characterise.sweep_shifts import ENTROPIC
from rubberfric.base import Labelled, LabelledArrays, shown
from rubberfric.materials import log_factors

# Largest error of temperatures that is considered as the reason of a misfit [K].
_WARMEST = 5.0
# Standard errors beyond which a fall of E' with frequency, or a rise of a_T on heating, is named. The most
# significant of many pairs is compared, so that a few standard errors are due to chance.
_SIGNIFICANT = 4.0
# Smallest rise of a_T on heating that is named, in decades.
_SMALLEST_RISE = 0.1
# Smallest fall of ln E' with frequency that is named.
_SMALLEST_FALL = 0.03
# Points of the smooth curve between which falls are sought.
_POINTS = 80


class Fall(NamedTuple):
    """A fall of E' of a master curve with frequency, which no relaxing solid shows.

    Attributes
    ----------
    omega : reduced frequencies [rad/s] between which E' falls, (lower, upper)
    change, stderr : ln E' at the upper frequency minus ln E' at the lower one, < 0, and its standard error
    temperatures : temperatures of the sweeps nearest to both frequencies [K]
    """

    omega: tuple[float, float]
    change: float
    stderr: float
    temperatures: tuple[float, float]


def report_of(curve: Any, command: bool) -> str:
    """Return a report on a `MasterCurve`: shifts, laws, scatter, and sweeps that do not superpose.

    If `command` is True, the report names options of `rubberfric-fit mastercurve` instead of arguments.
    """
    low, high = curve.data.omega[[0, -1]]
    lines = [
        f"Master curve of {curve.T.size} sweeps at {curve.T_ref:.6g} K, {low:.3g} ... {high:.3g} rad/s",
        f"    scatter: E' {curve.scatter[0]:.2%}, E'' {curve.scatter[1]:.2%}; temperatures are"
        f" taken as known to {curve.temperature_error:g} K",
    ]
    if curve.shifts.phase > 1e-3:
        lines[-1] += f"; phase error {curve.shifts.phase:.2g} rad"
    if curve.data.error is not None:
        lines.append(f"    errors given; reduced chi-square {curve.redchi:.4g}")
    lines.append(f"    {'T [K]':>8} {'log10 a_T':>10}")
    for i, T in enumerate(curve.T):
        bar = "(reference)" if i == curve.reference else f"+/- {curve.stderr[i] / np.log(10):.2g}"
        line = f"    {T:8.6g} {curve.log_aT[i] / np.log(10):10.4f}  {bar}"
        if curve.vertical and i != curve.reference:
            line += f"   b_T {np.exp(curve.log_bT[i]):.4f}"
            line += f" +/- {curve.stderr_bT[i]:.2g}" if curve.vertical is True else ""
        lines.append(line)
    lines += _misfits(curve, command)
    for name, law in (("WLF", curve.wlf), ("Arrhenius", curve.arrhenius)):
        if law is None:
            lines.append(f"    {name}: the law does not fit these shifts")
            continue
        units = {"C1": "", "C2": " K", "energy": " eV"}
        each = zip(law.names, law.values, law.stderr, strict=True)
        said = ", ".join(f"{key} = {value:.4g} +/- {error:.2g}{units[key]}" for key, value, error in each)
        fit = f"chi-square {law.chisqr:.3g} of {law.freedom} degrees of freedom"
        better = "; the better" if law is curve.law and None not in (curve.wlf, curve.arrhenius) else ""
        lines.append(f"    {name}: {said}; {fit}{'' if law.holds else ', does not hold'}{better}")
    if curve.law is not None and not curve.law.holds:
        lines.append("    no law holds within the errors: shift is the table")
        lines += _temperatures(curve)
    return "\n".join(lines)


def _temperatures(curve):
    """Return a line with the error of the temperatures that would explain the misfit of the better law."""
    law, others = curve.law, np.arange(curve.T.size) != curve.reference
    rest = (curve.log_aT - log_factors(law.shift, curve.T))[others]
    contrast = np.eye(curve.T.size) - np.eye(curve.T.size)[curve.reference]
    thermal = ((contrast * np.gradient(curve.log_aT, curve.T) ** 2) @ contrast.T)[np.ix_(others, others)]
    known = curve.covariance[np.ix_(others, others)] - curve.temperature_error**2 * thermal

    def misfit(error):
        return rest @ np.linalg.solve(known + error**2 * thermal, rest) - law.freedom

    if misfit(_WARMEST) > 0:
        return []
    error, name = (
        brentq(misfit, curve.temperature_error, _WARMEST),
        "WLF" if law is curve.wlf else "Arrhenius",
    )
    return [
        f"    {name} would hold if the temperatures had errors of {error:.2g} K instead of"
        f" {curve.temperature_error:g} K; the error bars of the table are then too small"
    ]


def _misfits(curve, command):
    lines = []
    if curve.fall is not None:
        (low, high), (first, second) = curve.fall.omega, curve.fall.temperatures
        fall, error = -np.expm1(curve.fall.change), curve.fall.stderr * np.exp(curve.fall.change)
        lines.append(
            f"    E' FALLS WITH FREQUENCY by {fall:.1%} +/- {error:.1%} from {low:.3g} to {high:.3g} rad/s,"
            f" which no relaxing solid does: the sweeps at {first:.6g} and {second:.6g} K do not superpose"
        )
    if (rise := _rising(curve)) is not None:
        i, k, change, error = rise
        lines.append(
            f"    a_T RISES WITH TEMPERATURE by {change:.2g} +/- {error:.2g} decades from {curve.T[i]:.6g} to"
            f" {curve.T[k]:.6g} K: relaxation that slows down on heating is not a time-temperature shift"
        )
    if advised := _advised(curve):
        low, high = np.exp(curve.shifts.hidden[[0, -1]])
        words = {"entropic": 'vertical="entropic"', "free": "vertical=True"}
        beyond = " beyond the entropic b_T" if curve.vertical else ""
        lines.append(
            f"    moduli change with temperature by factors of {low:.3f} to {high:.3f}{beyond}."
            " The shifts allow for this change, but the master curve contains it;"
            f" {f'--vertical {advised}' if command else words[advised]} removes it"
        )
    expected = np.hypot(curve.offset_errors, np.array(curve.shifts.offset)[:, None])
    off = np.flatnonzero((np.abs(curve.offsets) > 2.5 * expected).any(axis=0))
    for i in off:
        storage, loss = np.expm1(curve.offsets[:, i])
        tan = np.expm1(curve.offsets[1, i] - curve.offsets[0, i])
        lines.append(
            f"    the sweep at {curve.T[i]:.6g} K does not superpose: E' {storage:+.1%}, E'' {loss:+.1%}"
            f" off the curve; tan(delta), and with it roughly mu, {tan:+.1%}"
        )
    if curve.bad_points:
        shown_points = [f"{name} at {T:.6g} K, {omega:.3g} rad/s" for name, T, omega in curve.bad_points[:5]]
        more = f" and {len(curve.bad_points) - 5} more" if len(curve.bad_points) > 5 else ""
        lines.append(f"    points with little or no weight: {'; '.join(shown_points)}{more}")
    return lines


def largest_fall(curve: Any) -> Fall | None:
    """Return the most significant `Fall` of E' of a `MasterCurve`, or None if no fall is significant."""
    shifts = curve.shifts
    t = np.linspace(shifts.knots[3], shifts.knots[-4] - 1e-9, _POINTS)
    t = t[(t >= shifts.t.min()) & (t <= shifts.t.max())]
    B = BSpline.design_matrix(t, shifts.knots, 3).toarray()
    y, V = B @ shifts.splines[0], B @ shifts.covariances[0][: B.shape[1], : B.shape[1]] @ B.T
    change = y - y[:, None]  # from the row's frequency to the column's
    error = np.sqrt(np.maximum(np.diag(V) + np.diag(V)[:, None] - 2 * V, 0.0))
    falls = (change < -_SMALLEST_FALL) & (error > 0)
    pull = np.triu(np.where(falls, -change / np.where(error, error, 1.0), 0.0))
    i, k = np.unravel_index(np.argmax(pull), pull.shape)
    if not pull[i, k] > _SIGNIFICANT:
        return None
    near = [curve.of_sweep[np.argmin(np.abs(np.log(curve.data.omega) - at))] for at in (t[i], t[k])]
    ends = float(np.exp(t[i])), float(np.exp(t[k]))
    temperatures = float(curve.T[near[0]]), float(curve.T[near[1]])
    return Fall(ends, float(change[i, k]), float(error[i, k]), temperatures)


def _rising(curve):
    """Return (i, k, rise of log10 a_T, error) of the sweeps between which a_T rises most, or None."""
    V = curve.covariance / np.log(10) ** 2
    change = (curve.log_aT - curve.log_aT[:, None]) / np.log(10)  # from the row's sweep to the column's
    error = np.sqrt(np.maximum(np.diag(V) + np.diag(V)[:, None] - 2 * V, 1e-30))
    pull = np.triu(np.where(change > _SMALLEST_RISE, change / error, 0.0), 1)
    i, k = np.unravel_index(np.argmax(pull), pull.shape)
    return (i, k, change[i, k], error[i, k]) if pull[i, k] > _SIGNIFICANT else None


def _advised(curve):
    """Return the vertical shift that the data show and the curve lacks: "entropic", "free", or None."""
    seen, entropic = curve.shifts.hidden, log_factors(ENTROPIC, curve.T, curve.T_ref)
    if curve.vertical == "entropic":
        # The entropic b_T changes by 10 % in 30 K, more than errors of the moduli.
        return "free" if np.linalg.norm(seen) > np.linalg.norm(entropic) else None
    if not curve.shifts.scaled:
        return None
    return "entropic" if np.linalg.norm(seen - entropic) < 0.5 * np.linalg.norm(seen) else "free"


def labelled_part(curve: Any, part: str) -> LabelledArrays:
    """Return a part of a master curve as arrays with units, for data frames.

    Parameters
    ----------
    part : "curve": omega, E_stor and E_loss at T_ref, T_sweep and the residuals of every point
        "shifts": T, aT, bT, and the standard errors of ln a_T and ln b_T, for every sweep

    Raises
    ------
    ValueError : unknown part
    """
    if part not in ("curve", "shifts"):
        raise ValueError(f"part = {shown(part)}: must be 'curve' or 'shifts'")
    attributes = {"T_ref": curve.T_ref}
    if part == "shifts":
        quantities = {
            "aT": Labelled(np.exp(curve.log_aT), "-"),
            "bT": Labelled(np.exp(curve.log_bT), "-"),
            "aT_relative_error": Labelled(curve.stderr, "-"),
            "bT_relative_error": Labelled(curve.stderr_bT, "-"),
        }
        return LabelledArrays({"T": Labelled(curve.T, "K")}, quantities, ("T",), attributes)
    quantities = {
        "E_stor": Labelled(curve.data.storage, "Pa"),
        "E_loss": Labelled(curve.data.loss, "Pa"),
        "T_sweep": Labelled(curve.T[curve.of_sweep], "K"),
        "E_stor_residual": Labelled(curve.residuals[0], "-"),
        "E_loss_residual": Labelled(curve.residuals[1], "-"),
    }
    omega = {"omega": Labelled(curve.data.omega, "rad/s")}
    return LabelledArrays(omega, quantities, ("omega",), attributes)
