"""Text of the report on a master curve."""

from typing import Any

import numpy as np
from scipy.optimize import brentq

from fitting.characterise.sweep_shifts import ENTROPIC

# Largest error of temperatures that is considered as the reason of a misfit [K].
_WARMEST = 5.0
# Standard errors beyond which a fall of E' with frequency, or a rise of a_T on heating, is named, and the
# smallest rise that is named, in decades.
SIGNIFICANT, _SLIGHT = 4.0, 0.1


def report_of(curve: Any, command: bool) -> str:
    """Return a report on a `MasterCurve`: shifts, laws, scatter, and sweeps that do not superpose.

    If `command` is True, the report names options of `rubberfric-fit mastercurve` instead of arguments.
    """
    low, high = curve.data.omega[[0, -1]]
    lines = [
        f"Master curve of {curve.T.size} sweeps at {curve.T_ref:.6g} K, {low:.3g} ... {high:.3g} rad/s",
        f"    scatter: E' {curve.scatter[0]:.2%}, E'' {curve.scatter[1]:.2%}; temperatures to"
        f" {curve.temperature_error:g} K",
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
    rest = (curve.log_aT - np.asarray(law.shift.log_factor(curve.T), float))[others]
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


def _rising(curve):
    """Return (i, k, rise of log10 a_T, error) of the sweeps between which a_T rises most, or None."""
    V = curve.covariance / np.log(10) ** 2
    change = (curve.log_aT - curve.log_aT[:, None]) / np.log(10)  # from the row's sweep to the column's
    error = np.sqrt(np.maximum(np.diag(V) + np.diag(V)[:, None] - 2 * V, 1e-30))
    pull = np.triu(np.where(change > _SLIGHT, change / error, 0.0), 1)
    i, k = np.unravel_index(np.argmax(pull), pull.shape)
    return (i, k, change[i, k], error[i, k]) if pull[i, k] > SIGNIFICANT else None


def _advised(curve):
    """Return the vertical shift that the data show and the curve lacks: "entropic", "free", or None."""
    seen, entropic = curve.shifts.hidden, np.asarray(ENTROPIC.log_factor(curve.T, curve.T_ref), float)
    if curve.vertical == "entropic":
        # The entropic b_T changes by 10 % in 30 K, more than errors of the moduli.
        return "free" if np.linalg.norm(seen) > np.linalg.norm(entropic) else None
    if not curve.shifts.scaled:
        return None
    return "entropic" if np.linalg.norm(seen - entropic) < 0.5 * np.linalg.norm(seen) else "free"
