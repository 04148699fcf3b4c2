r"""Fit a broken line to ln C over t = ln q: constant up to the roll-off, then falling.

.. math:: \ln C = a \; (t < t_r), \qquad \ln C = a - s (t - t_r) \; (t > t_r), \qquad s = 2(1 + H)

If the interval between neighbouring points that contains the roll-off is known, the fit is a linear problem.
All intervals are tried, which gives the global minimum.
"""

from typing import NamedTuple

import numpy as np
import scipy

import rubberfric as rf

# Variance of ln C due to rounding.
_EXACT = 1e-20
# Ratio of the h_rms of a fit to the rms height of profiles from which on they contradict each other. Few long
# waves fit into a profile, so its rms height scatters.
_TOO_HIGH = 2.0
# Distance of ln q_r from the ends of a spectrum, whose table has an entry at each.
_INSIDE = 1e-9


class Line(NamedTuple):
    """Broken line of ln C over t = ln q, which is constant up to a kink and then falls."""

    cost: float  # weighted sum of squares
    level: float  # ln C of the plateau
    slope: float  # of the decrease, -d ln C / dt > 0
    kink: float  # t of the roll-off


def start_line(
    t: np.ndarray,
    y: np.ndarray,
    weight: np.ndarray,
    slopes: tuple[float, float],
    fixed_qr: float | None,
    q0: float,
    q1: float,
    known: bool,
) -> tuple[Line, list[str]]:
    """Return the best `Line`, and a list of remarks on parameters that are fixed.

    If `fixed_qr` is a number, the kink is at this wavevector. Otherwise the line has a plateau only if the
    data show a roll-off. `known` is True if the weights are those of known errors.
    """
    if fixed_qr is not None:
        return _line(t, y, weight, slopes, np.log(fixed_qr)), []
    flat = _line(t, y, weight, slopes, np.log(q0))
    broken = broken_line(t, y, weight, slopes, np.log(q0), np.log(q1))
    # Schwarz's penalty of one more parameter. Unknown errors follow from the scatter.
    floor = _EXACT * t.size
    ratio = (flat.cost + floor) / (broken.cost + floor)
    gain = flat.cost - broken.cost if known else t.size * np.log(ratio)
    below = np.sum(t < broken.kink)
    if below > 1 and gain > np.log(t.size):
        return broken, []
    return flat, [f"no roll-off is seen above {np.exp(t.min()):.3g} 1/m: qr is held at q0 = {q0:.4g} 1/m"]


def limited_by_height(
    line: Line, remarks: list[str], q0: float, q1: float, height: float, first: float
) -> tuple[Line, list[str]]:
    """Return a `Line` without roll-off and its remarks, or with the roll-off that the rms height requires."""
    qr = rolloff_for_height(line.level, line.slope, q0, q1, height)
    if qr is None:
        return line, remarks
    level = line.level - line.slope * np.log(qr / q0)
    remark = (
        f"C is unknown below {first:.3g} 1/m: qr is held at {qr:.4g} 1/m, so that h_rms agrees with the rms"
        f" height of the profiles, {height:.3g} m"
    )
    return line._replace(level=level, kink=float(np.log(qr))), [remark]


def broken_line(
    t: np.ndarray, y: np.ndarray, weight: np.ndarray, slopes: tuple[float, float], low: float, high: float
) -> Line:
    """Fit a line that is constant up to a kink and then falls, by weighted least squares.

    The slope lies within the bounds `slopes`, and the kink lies between `low` and `high`. Every interval
    between neighbouring t is tried. The best kink inside an interval is the intersection of the best level
    before the interval and the best straight line behind the interval. If the intersection is outside the
    interval, the best kink is at an end of the interval.
    """
    order = np.argsort(t, kind="stable")
    t, y, weight = t[order], y[order], weight[order]
    best = min(
        (_line(t, y, weight, slopes, kink) for kink in np.clip(t, low, high)), key=lambda line: line.cost
    )
    for k in range(1, t.size - 1):
        level = np.average(y[:k], weights=weight[:k])
        w, x, z = weight[k:], t[k:], y[k:]
        middle, height = np.average(x, weights=w), np.average(z, weights=w)
        spread = np.sum(w * (x - middle) ** 2)
        slope = -np.sum(w * (x - middle) * (z - height)) / spread if spread > 0 else slopes[0]
        slope = float(np.clip(slope, *slopes))
        kink = middle + (height - level) / slope
        if t[k - 1] <= kink <= t[k] and low <= kink <= high:
            fall = level - slope * (x - kink)
            cost = np.sum(weight[:k] * (y[:k] - level) ** 2) + np.sum(w * (z - fall) ** 2)
            best = min(best, Line(float(cost), float(level), slope, float(kink)), key=lambda line: line.cost)
    return best


def _line(t, y, weight, slopes, kink):
    fall = np.maximum(t - kink, 0.0)
    middle, height = np.average(fall, weights=weight), np.average(y, weights=weight)
    spread = np.sum(weight * (fall - middle) ** 2)
    slope = -np.sum(weight * (fall - middle) * (y - height)) / spread if spread > 0 else slopes[0]
    slope = float(np.clip(slope, *slopes))
    level = height + slope * middle
    return Line(float(np.sum(weight * (y - level + slope * fall) ** 2)), float(level), slope, float(kink))


def rolloff_for_height(level: float, slope: float, q0: float, q1: float, height: float) -> float | None:
    r"""Return the roll-off q_r [1/m] for which C has a given rms height, or None if q_r = q0 agrees with it.

    .. math:: C = C_0 (\max(q, q_r) / q_0)^{-s}, \qquad h^2 = 2\pi \int_{q_0}^{q_1} q\, C\, dq

    Long waves decide h_rms of a spectrum without a roll-off. If their C is unknown, the heights limit it.

    Parameters
    ----------
    level, slope : ln C_0 [m^4], and s > 0, of the decrease
    q0, q1 : ends of the spectrum [1/m]
    height : rms height of the profiles [m]
    """
    ends = np.log(q0) + _INSIDE, np.log(q1) - _INSIDE

    def excess(log_qr):
        qr = np.exp(log_qr)
        plateau, end = np.exp(level - slope * np.log(np.array([qr, q1]) / q0))
        spectrum = rf.TabulatedSpectrum([q0, qr, q1], [plateau, plateau, end])
        return float(rf.roughness.rms_height(spectrum)) - height

    if excess(ends[0]) < (_TOO_HIGH - 1) * height:
        return None
    # The rms height decreases with q_r, because C decreases at all q < q_r.
    return q1 if excess(ends[1]) > 0 else float(np.exp(scipy.optimize.brentq(excess, *ends)))
