r"""A self-affine spectrum from a measured one: how rough, how fractal, where it rolls off, how certain.

.. math:: \ln C = \ln C_0 \; (q < q_r), \qquad \ln C = \ln C_0 - 2(1 + H) \ln(q/q_r) \; (q > q_r)

For a roll-off between two given neighbours among the data this is linear in what is left: every
such gap is searched, so that the start is the minimum itself, and no other has to be feared.
`fitting.fit` starts there and gives errors, correlations and what the data leave open.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

import rubberfric as rf
from fitting.characterise.spectrum_result import SpectrumFit
from fitting.data.kinds import SpectrumData
from fitting.data.measured import one_line
from fitting.fit import fit
from fitting.parameters.constraints import Bounded, Positive, is_number

# Slopes that H = 0 and 1 stand for, and how near to them H is held there instead of fitted.
_SLOPES = (2.0, 4.0)
_AT_END = 1e-6
# Variance of ln C that is rounding, not scatter.
_EXACT = 1e-20


class Line(NamedTuple):
    """A broken line in t = ln q."""

    cost: float  # weighted sum of squares
    level: float  # ln C of the plateau
    slope: float  # of the fall, > 0
    kink: float  # t of the roll-off


def fit_spectrum(data, *, q0=None, q1=None, qr="fit", hurst="fit", relative=None, body=None):
    r"""Self-affine spectrum of a measured one.

    .. math:: \min \sum_k \left( \frac{\ln C(q_k) - \ln C_k}{e_k} \right)^2

    over h_rms, H and q_r, with absolute instead of logarithmic differences for data with absolute
    errors.

    Parameters
    ----------
    data : SpectrumData, TabulatedSpectrum, or a pair (q, C) [1/m], [m^4]
    q0, q1 : cut-offs of the surface [1/m]; None: the first and the last wavevector of the data.
        Data outside are not used; h_rms counts q0 < q < q1 whether or not the data reach as far.
    qr : "fit", or the roll-off wavevector [1/m], held; q0 is a surface without plateau
    hurst : "fit", or H [-], held
    relative : standard error of ln C, a number or one for each [-], for data that have none
    body : "lower" or "upper", where `fit`'s key paths say the spectrum is; None: the data's, or "lower"

    Returns
    -------
    SpectrumFit

    Raises
    ------
    ValueError : one line: what the data are instead, cut-offs in wrong order, fewer values than unknowns.

    Notes
    -----
    Data without errors get one relative error each from their scatter (`fitting.fit`). If no plateau is
    seen, that is if a straight line meets the data as well by Schwarz's criterion, or one point at most
    lies below the roll-off, q_r is held at q0; if the fall is flatter than H = 0 or steeper than H = 1,
    H is held there. `SpectrumFit.notes` says so.
    """
    data = _data(data, relative, body)
    body = data.body or "lower"
    q0 = _cutoff("q0", q0, data.q.min())
    q1 = _cutoff("q1", q1, data.q.max())
    if not q0 < q1:
        raise ValueError(f"q1 = {q1:g}: must be > q0 = {q0:g}")
    held_H = _held("hurst", hurst, 0.0, 1.0)
    held_qr = _held("qr", qr, q0, q1)
    inside = (data.q >= q0) & (data.q <= q1)
    unknowns = 1 + (held_H is None) + (held_qr is None)
    if inside.sum() < unknowns + 1:
        raise ValueError(
            f"data {data.label!r}: {inside.sum()} values within {q0:g} ... {q1:g} 1/m for {unknowns}"
            " unknowns: must be more"
        )
    notes = (
        [] if inside.all() else [f"{(~inside).sum()} of {inside.size} points lie outside q0 ... q1: not used"]
    )
    data = _part(data, inside)
    t, y = np.log(data.q), np.log(np.maximum(data.C, 1e-12 * data.C.max()))
    weight = _weights(data)
    slopes = _SLOPES if held_H is None else (2 * (1 + held_H),) * 2
    line, kink_note = _start(t, y, weight, slopes, held_qr, q0, q1, known=data.error is not None)
    notes += kink_note
    H = line.slope / 2 - 1
    spectrum = rf.SelfAffine.from_C0(q0, *_between(line, q0, q1, H), np.exp(line.level))
    free = {f"{body}.spectrum.h_rms": Positive()}
    if held_H is None:
        if _AT_END < H < 1 - _AT_END:
            free[f"{body}.spectrum.hurst"] = Bounded(0.0, 1.0)
        else:
            steeper = "steeper than H = 1" if H > 0.5 else "flatter than H = 0"
            notes.append(f"the fall is {steeper}: H is held there")
    if held_qr is None and not kink_note:
        free[f"{body}.spectrum.qr"] = Positive()
    other = "upper" if body == "lower" else "lower"
    scene = rf.Scene(
        **{
            body: rf.Body(rf.Rigid(), spectrum),
            other: rf.Body(rf.Elastic(1e6, 0.5)),  # some solid must deform; its modulus is not asked for
        }
    )
    result = fit(scene, data, free)
    spectrum = getattr(result.scene, body).spectrum
    if not q0 <= spectrum.qr <= q1:  # absolute errors may want what logarithms do not
        at = q0 if spectrum.qr < q0 else q1
        found = fit_spectrum(data, q0=q0, q1=q1, qr=at, hurst=hurst, body=None if data.body else body)
        notes.append(f"the roll-off is not within q0 ... q1: qr is held at {at:.4g} 1/m")
        return dataclasses.replace(found, notes=tuple(notes))
    model = np.asarray(rf.power_spectrum(spectrum, np.clip(data.q, q0 * (1 + 1e-12), q1 * (1 - 1e-12))))
    residuals = np.log(model / np.where(data.C > 0, data.C, np.nan))
    return SpectrumFit(spectrum, residuals, tuple(notes), result)


def _data(data, relative, body):
    """The data as SpectrumData."""
    if isinstance(data, rf.TabulatedSpectrum):
        data = (data.q, data.C)
    if isinstance(data, tuple) and len(data) == 2:
        return SpectrumData(*(np.asarray(x) for x in data), relative=relative, body=body)
    if not isinstance(data, SpectrumData):
        raise ValueError(
            f"data is a {type(data).__name__}: must be SpectrumData, TabulatedSpectrum or (q, C)"
        )
    for name, value, own in (("relative", relative, data.error), ("body", body, data.body)):
        if value is not None and own is not None:
            raise ValueError(f"{name} = {one_line(value)}: must not be given; the data have it")
    if relative is None and body is None:
        return data
    relative = data.relative if relative is None else relative
    return SpectrumData(
        data.q,
        data.C,
        data.sigma,
        relative=relative,
        body=body or data.body,
        name=data.name,
        check_units=False,
    )


def _part(data, inside):
    """The data at some of their points."""
    sigma, relative = (None if x is None else x[inside] for x in (data.sigma, data.relative))
    return SpectrumData(
        data.q[inside],
        data.C[inside],
        sigma,
        relative=relative,
        body=data.body,
        name=data.name,
        check_units=False,
    )


def _weights(data):
    """1 / variance of ln C, 1 where unknown."""
    if data.error is None:
        return np.ones(len(data))
    error = data.error if data.logarithmic else data.error / np.maximum(data.C, data.error)
    return error**-2.0


def _cutoff(name, value, default):
    if value is None:
        return float(default)
    if not (is_number(value) and value > 0):
        raise ValueError(f"{name} = {one_line(value)}: must be None or a number > 0 [1/m]")
    return float(value)


def _held(name, value, low, high):
    """A number that is not fitted, else None."""
    if isinstance(value, str) and value == "fit":
        return None
    if not (is_number(value) and low <= value <= high):
        raise ValueError(f"{name} = {one_line(value)}: must be 'fit' or a number, {low:g} ... {high:g}")
    return float(value)


def _between(line, q0, q1, H):
    """(qr, q1, H) of a line; the logarithm's rounding must not make a roll-off apart from a cut-off."""
    qr = next((q for q in (q0, q1) if abs(line.kink - np.log(q)) < 1e-12), np.exp(line.kink))
    return float(np.clip(qr, q0, q1)), q1, float(np.clip(H, 0.0, 1.0))


def _start(t, y, weight, slopes, held_qr, q0, q1, known):
    """(Line, notes): the best broken line, without a plateau unless the data show one."""
    if held_qr is not None:
        return _line(t, y, weight, slopes, np.log(held_qr)), []
    flat = _line(t, y, weight, slopes, np.log(q0))
    broken = broken_line(t, y, weight, slopes, np.log(q0), np.log(q1))
    # Schwarz: what one more parameter must be worth. Errors that are unknown follow from the scatter.
    floor = _EXACT * t.size
    ratio = (flat.cost + floor) / (broken.cost + floor)
    gain = flat.cost - broken.cost if known else t.size * np.log(ratio)
    below = np.sum(t < broken.kink)
    if below > 1 and gain > np.log(t.size):
        return broken, []
    return flat, [f"no roll-off is seen above {np.exp(t.min()):.3g} 1/m: qr is held at q0 = {q0:.4g} 1/m"]


def broken_line(t, y, weight, slopes, low, high):
    """The line of least squares that is flat up to a kink and then falls by a slope within bounds.

    Every interval between neighbouring t is tried: the best kink inside is where the best level
    and the best straight line of the points beyond meet; else it is at one of the ends.
    """
    order = np.argsort(t, kind="stable")
    t, y, weight = t[order], y[order], weight[order]
    best = min(
        (_line(t, y, weight, slopes, kink) for kink in np.clip(t, low, high)), key=lambda one: one.cost
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
            best = min(best, Line(float(cost), float(level), slope, float(kink)), key=lambda one: one.cost)
    return best


def _line(t, y, weight, slopes, kink):
    """The best line with a given kink."""
    fall = np.maximum(t - kink, 0.0)
    middle, height = np.average(fall, weights=weight), np.average(y, weights=weight)
    spread = np.sum(weight * (fall - middle) ** 2)
    slope = -np.sum(weight * (fall - middle) * (y - height)) / spread if spread > 0 else slopes[0]
    slope = float(np.clip(slope, *slopes))
    level = height + slope * middle
    return Line(float(np.sum(weight * (y - level + slope * fall) ** 2)), float(level), slope, float(kink))
