"""Picture of roughness power spectra. It needs matplotlib, as `rubberfric.plot`."""

from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.typing import ArrayLike

from rubberfric.plot.style import Axes, Line2D, colours, legend, one_axes, vector
from rubberfric.roughness.moments import rms_slope
from rubberfric.roughness.spectra import Spectrum, log_power_spectrum, power_law_of
from rubberfric.roughness.tabulated import TabulatedSpectrum

_POINTS = 200
# Entries of a table that are drawn as points.
_ENTRIES = 100
_STYLES = ("-", "--", "-.", ":")
# Wavevectors that are drawn with a marker: marker, and name.
_NAMED = {"q0": ("o", "$q_0$, first"), "qr": ("s", "$q_r$, roll-off"), "q1": ("D", "$q_1$, cut-off")}


class _Curve(NamedTuple):
    """What is drawn of one spectrum."""

    q: np.ndarray
    C: np.ndarray
    points: bool  # measured: points with error bars, no line
    errors: np.ndarray | None  # below and above, shape (2, n)
    slope: np.ndarray | None  # rms slope up to q
    named: dict[str, tuple[float, float]]  # name in _NAMED -> (q, C)
    entries: tuple[np.ndarray, np.ndarray] | None  # (q, C) of a table


def plot_spectrum(spectra: Any, ax: Axes | None = None, q: ArrayLike | None = None) -> Axes:
    r"""Draw C(q) in log-log, and the rms slope of all roughness up to q on a scale of its own.

    .. math:: h_\mathrm{rms}^2 = 2\pi \int q\, C\, dq, \qquad
              \mathrm{slope}(q) = \sqrt{2\pi\int_{q_0}^{q} q'^3\, C\, dq'}

    Parameters
    ----------
    spectra : a spectrum, or a dict of label -> spectrum
        SelfAffine, TabulatedSpectrum, Anisotropic, TabulatedAnisotropic (the mean over all
        directions) are lines, with their first, roll-off and cut-off wavevectors marked; what has
        arrays q [1/m] and C [m^4] (`MeasuredSpectrum` of a map, `fitting.SpectrumData`) is points,
        with error bars if it has `relative` or `sigma`.
    ax : matplotlib axes, or None for those of a new figure
        The scale of the slope is the last of `ax.figure.axes`.
    q : wavevectors of the lines [1/m], > 0, shape (n,); None: 200 from end to end, and all kinks

    Returns
    -------
    the axes of C

    Raises
    ------
    ValueError : no spectrum, one that is smooth, a wrong q, or `ax` is no axes.
    """
    several = isinstance(spectra, Mapping)
    spectra = spectra if isinstance(spectra, Mapping) else {"spectrum": spectra}
    if not spectra:
        raise ValueError("spectra is empty: must have one at least")
    at = None if q is None else np.unique(vector("q", q, positive=True))
    curves = {label: _curve(label, one, at) for label, one in spectra.items()}
    axes = one_axes(ax, (7.6, 4.0))
    right = axes.twinx()
    handles = [
        _draw(axes, right, curve, label, colour, _STYLES[i % len(_STYLES)])
        for i, ((label, curve), colour) in enumerate(zip(curves.items(), colours(len(curves)), strict=True))
    ]
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("wavevector $q$ [1/m]")
    axes.set_ylabel("power spectrum $C$ [m$^4$]")
    right.set_yscale("log")
    right.set_ylabel("rms slope up to $q$ [-]")
    axes.grid(alpha=0.3)
    _keep_slopes_in_view(right, curves.values())
    handles = (handles if several else []) + _explained(curves.values())
    legend(axes, handles, scale_right=True, inside="lower center")
    return axes


def _curve(label: str, spectrum: Any, q: np.ndarray | None) -> _Curve:
    if isinstance(spectrum, Spectrum):
        return _line(label, spectrum, q)
    if not (hasattr(spectrum, "q") and hasattr(spectrum, "C")):
        raise ValueError(f"{label} is a {type(spectrum).__name__}: must be a spectrum, or have q and C")
    q = vector(f"{label}.q", spectrum.q, positive=True)
    C = vector(f"{label}.C", spectrum.C, q.size)
    relative, sigma = (getattr(spectrum, name, None) for name in ("relative", "sigma"))
    errors = None
    if relative is not None:
        errors = C * np.stack([-np.expm1(-np.asarray(relative)), np.expm1(relative)])
    elif sigma is not None:
        errors = np.stack([np.asarray(sigma)] * 2)
    order = np.argsort(q, kind="stable")
    order = order[C[order] > 0]
    q, C = q[order], C[order]
    if q.size == 0:
        raise ValueError(f"{label}.C has no value > 0: must have one at least, for its logarithm")
    table = TabulatedSpectrum(q, C) if q.size > 1 and (np.diff(q) > 0).all() else None
    slope = None if table is None else _values(table, q)[1]
    return _Curve(q, C, True, None if errors is None else errors[:, order], slope, {}, None)


def _line(label: str, spectrum: Spectrum, q: np.ndarray | None) -> _Curve:
    if not spectrum.height_scale() > 0:
        raise ValueError(f"{label} is smooth: must be rough, for log C")
    kinks = np.unique(np.asarray(power_law_of(spectrum).q, float))  # those cut off are one
    formula = spectrum.entries() is None
    if q is None:
        q = np.union1d(np.geomspace(kinks[0], kinks[-1], _POINTS)[1:-1], kinks)
    q = q[(q >= kinks[0]) & (q <= kinks[-1])]
    if q.size == 0:
        raise ValueError(f"{label}: no q lies within {kinks[0]:g} ... {kinks[-1]:g} 1/m; one must at least")
    C, slope = _values(spectrum, np.concatenate([q, kinks]))  # together, for one program
    C, slope, at_kinks = C[: q.size], slope[: q.size], C[q.size :]
    rolls_off = formula and kinks.size == 3
    places = {"q0": 0, "qr": 1, "q1": 2} if rolls_off else {"q0": 0, "q1": -1}
    named = {name: (kinks[i], at_kinks[i]) for name, i in places.items()}
    entries = None if formula or kinks.size > _ENTRIES else (kinks, at_kinks)
    return _Curve(q, C, False, None, slope, named, entries)


def _values(spectrum: Spectrum, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """C and the rms slope at q, in double precision: in single, C itself may be 0."""
    log_C, slope = (np.asarray(x, float) for x in _log_C_and_slope(spectrum, q))
    return np.exp(log_C), slope


@jax.jit
def _log_C_and_slope(spectrum: Spectrum, q: jax.Array) -> tuple[jax.Array, jax.Array]:
    return log_power_spectrum(spectrum.power_law(), q), rms_slope(spectrum, q)


def _draw(axes, right, curve, label, colour, style):
    """Draw one spectrum; its handle of a legend."""
    look: dict[str, Any] = {"color": colour, "linestyle": style}
    if curve.slope is not None:
        rises = curve.slope > 0  # 0 at the first wavevector
        right.plot(curve.q[rises], curve.slope[rises], linewidth=0.9, **look)
    if curve.points:
        look = {"color": colour, "elinewidth": 0.8, "markersize": 5, "zorder": 2.5}
        return axes.errorbar(curve.q, curve.C, curve.errors, fmt=".", label=label, **look)
    (handle,) = axes.plot(curve.q, curve.C, linewidth=1.8, label=label, **look)
    if curve.entries:
        axes.plot(*curve.entries, ".", color=colour, markersize=4)
    for name, place in curve.named.items():
        axes.plot(*place, _NAMED[name][0], color=colour, markerfacecolor="white", markersize=6)
    return handle


def _keep_slopes_in_view(right: Axes, curves: Collection[_Curve]) -> None:
    """Just above the first wavevector a slope falls to 0, through all decades: four are enough."""
    highest = max((curve.slope.max() for curve in curves if curve.slope is not None), default=0.0)
    if highest > 0:
        low, high = right.get_ylim()
        right.set_ylim(max(low, 1e-4 * highest), high)


def _explained(curves: Collection[_Curve]) -> list[Line2D]:
    """Handles of a legend for what the lines and marks of the curves are."""
    from matplotlib.lines import Line2D

    look: dict[str, Any] = {"color": "0.3", "markerfacecolor": "white"}
    named = {name for curve in curves for name in curve.named}
    handles = [
        Line2D([], [], linestyle="none", marker=marker, label=name, **look)
        for key, (marker, name) in _NAMED.items()
        if key in named
    ]
    if any(curve.slope is not None for curve in curves):
        handles.append(Line2D([], [], color="0.3", linewidth=0.9, label="rms slope (thin, right)"))
    return handles
