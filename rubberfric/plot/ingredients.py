"""Plots of a complex modulus and of roughness power spectra. They need matplotlib."""

from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import ArrayLike
from rubberfric.base.compilation import quick_jit
from rubberfric.base.units import to_celsius
from rubberfric.materials.material import Material, complex_modulus
from rubberfric.materials.shifts import log_factors, log_vertical
from rubberfric.materials.tabulated_modulus import TabulatedModulus
from rubberfric.plot.style import Axes, Line2D, colours, legend, one_axes, signed, vector
from rubberfric.roughness.moments import rms_slope
from rubberfric.roughness.spectra import Spectrum, log_power_spectrum, power_law_of
from rubberfric.roughness.tabulated import TabulatedSpectrum

_POINTS = 400  # of a curve, enough to look smooth
_LARGE = 60  # more points have smaller markers
# Decades drawn beyond the relaxation times, at which E'' has fallen to 2 % of the peak of a relaxation.
_BEYOND_TIMES = 2.0
# Decades drawn beyond a table and beyond measured points, to show how the modulus continues.
_BEYOND_TABLE = 1.0
# Line style, marker of points, and name of E', E'' and tan delta.
_LOOKS = (("-", "o", "storage $E'$"), ("--", "s", "loss $E''$"), (":", "^", "$\\tan\\delta$ (right)"))

Points = tuple[np.ndarray, np.ndarray, np.ndarray]  # omega, E', E''

_modulus = jax.jit(complex_modulus)


def plot_modulus(
    material: Material,
    ax: Axes | None = None,
    omega: ArrayLike | None = None,
    temperature: float | None = None,
    data: Any = None,
) -> Axes:
    r"""Draw E' and E'' over omega in log-log, and tan delta = E''/E' on a linear right axis.

    Parameters
    ----------
    material : Elastic, Prony, PronyShear or TabulatedModulus
        Entries of a table are drawn as points.
    ax : matplotlib axes, or None for a new figure
        The axis of tan delta is the last of `ax.figure.axes`.
    omega : angular frequencies [rad/s], > 0, shape (n,)
        If None, the range of the material and the data is extended by two decades at either end (one decade
        for a table or an elastic solid).
    temperature : [K], or None for the reference temperature
    data : measured points with arrays omega, storage and loss, such as `fitting.ModulusData`, or None
        Points at other temperatures are shifted with the material's shift.

    Returns
    -------
    the axes of E' and E''

    Raises
    ------
    ValueError : if the material is not deformable, if a temperature is given for a material without a shift,
        or if omega, data or ax is invalid.

    Examples
    --------
    >>> rubber = rf.Prony(E_inf=1e6, E=[1e7], tau=[1e-3])
    >>> data = fitting.ModulusData([1e2, 1e3], storage=[1.1e6, 6e6], loss=[1e6, 5e6])
    >>> ax = rf.plot.plot_modulus(rubber, data=data)
    >>> rf.plot.save_figure("modulus.png", ax)
    >>> loss_factor = ax.figure.axes[-1].lines[0].get_ydata()
    >>> round(float(max(loss_factor)), 1)  # tan delta, at most 5 / sqrt(1 + 10)
    1.5
    """
    if not isinstance(material, Material) or not material.deforms:
        raise ValueError(f"material must be deformable, got {type(material).__name__}")
    _check_temperature(material, temperature)
    points = None if data is None else _shifted(material, temperature, data)
    table = _table(material, temperature)
    if omega is None:
        omega = _range(
            material, temperature, [columns[0] for columns in (points, table) if columns is not None]
        )
    else:
        omega = np.sort(vector("omega", omega, positive=True))
    modulus = np.asarray(_modulus(material, omega, temperature))
    axes = one_axes(ax, (7.4, 4.0))
    right = axes.twinx()
    storage, loss = np.real(modulus), np.imag(modulus)
    lines = (storage, loss, loss / storage)
    handles = []
    for tone, place, (style, _, name), line in zip(
        colours(3), (axes, axes, right), _LOOKS, lines, strict=True
    ):
        if (line > 0).any():  # elastic solids have no loss
            look: dict[str, Any] = {"color": tone, "linestyle": style, "linewidth": 1.8, "label": name}
            handles += place.plot(omega, np.where(line > 0, line, np.nan), **look)
    handles += _points(axes, right, table, "entries of the table", "white")
    handles += _points(axes, right, points, "measured", None)
    if temperature is None and material.shift is not None:
        temperature = float(material.shift.reference_temperature)
    _dress(axes, right, temperature)
    right.set_visible(bool(right.lines))
    legend(axes, handles, scale_right=bool(right.lines), inside="upper left")
    return axes


def _check_temperature(material: Material, temperature: float | None) -> None:
    if temperature is None:
        return
    if material.shift is None:
        raise ValueError(f"temperature = {temperature!r}: must be None because the material has no shift")
    if np.ndim(temperature) != 0:
        raise ValueError(f"temperature has shape {np.shape(temperature)}: must be one number")
    material.shift.check_temperature(temperature)


def _log_shift(material: Material, temperature: ArrayLike | None) -> np.ndarray | float:
    """Return ln a_T, which is 0 if `temperature` is None or the material has no shift."""
    if temperature is None or material.shift is None:
        return 0.0
    return log_factors(material.shift, temperature)


def _vertical(material: Material, temperature: ArrayLike | None) -> np.ndarray | float:
    """Return b_T, which is 1 if `temperature` is None or the material has no vertical shift."""
    at = None if temperature is None else jnp.asarray(temperature, float)
    log_factor = log_vertical(material.shift, at)
    return 1.0 if log_factor is None else np.exp(np.asarray(log_factor, float))


def _range(material: Material, temperature: float | None, known: list[np.ndarray]) -> np.ndarray:
    """Return frequencies [rad/s] that cover the material's frequency range and all `known` frequencies."""
    ends = [np.array([omegas.min(), omegas.max()]) for omegas in known]
    beyond = _BEYOND_TABLE
    if not isinstance(material, TabulatedModulus) and (own := material.frequency_range()) is not None:
        beyond = _BEYOND_TIMES
        ends.append(np.exp(-_log_shift(material, temperature)) * np.asarray(own, float))
    ends = np.concatenate(ends) if ends else np.array([1e-2, 1e2])  # elastic: arbitrary
    return np.geomspace(ends.min() / 10**beyond, ends.max() * 10**beyond, _POINTS)


def _table(material: Material, temperature: float | None) -> Points | None:
    """Return (omega, E', E'') of the entries of a table at a temperature, or None for other materials."""
    if not isinstance(material, TabulatedModulus):
        return None
    omega, storage, loss = (np.asarray(x, float) for x in (material.omega, material.storage, material.loss))
    vertical = _vertical(material, temperature)
    return omega * np.exp(-_log_shift(material, temperature)), vertical * storage, vertical * loss


def _shifted(material: Material, temperature: float | None, data: Any) -> Points:
    """Return (omega, E', E'') of measured points, shifted to a temperature."""
    for name in ("omega", "storage", "loss"):
        if not hasattr(data, name):
            raise ValueError(f"data must have omega, storage, loss, got {type(data).__name__} without {name}")
    omega = vector("data.omega", data.omega, positive=True)
    storage, loss = (vector(f"data.{x}", getattr(data, x), omega.size) for x in ("storage", "loss"))
    at = getattr(data, "temperature", None)
    if at is not None:
        at = np.broadcast_to(np.asarray(at, float), omega.shape)
        if material.shift is None and np.ptp(at) > 0:
            raise ValueError("data.temperature has several values; then the material must have a shift")
        if material.shift is not None:
            material.shift.check_temperature(at)
        omega = omega * np.exp(_log_shift(material, at) - _log_shift(material, temperature))
        ratio = _vertical(material, temperature) / _vertical(material, at)
        storage, loss = ratio * storage, ratio * loss
    return omega, storage, loss


def _points(axes, right, points, name, face):
    from matplotlib.lines import Line2D

    if points is None:
        return []
    omega, storage, loss = points
    with np.errstate(divide="ignore", invalid="ignore"):
        values = (storage, loss, loss / storage)
    size = 3.5 if omega.size <= _LARGE else 2.0
    look: dict[str, Any] = {"linestyle": "none", "markersize": size, "markeredgewidth": 0.8}
    for tone, place, (_, marker, _), value in zip(
        colours(3), (axes, axes, right), _LOOKS, values, strict=True
    ):
        place.plot(omega, value, marker=marker, color=tone, markerfacecolor=face or tone, **look)
    return [Line2D([], [], color="0.3", marker="o", markerfacecolor=face or "0.3", label=name, **look)]


def _dress(axes: Axes, right: Axes, temperature: float | None) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("angular frequency $\\omega$ [rad/s]")
    axes.set_ylabel("modulus $E'$, $E''$ [Pa]")
    if temperature is not None:
        axes.set_title(f"{signed(to_celsius(float(temperature)))} °C", fontsize="medium")
    right.set_ylabel("$\\tan\\delta = E''/E'$ [-]")
    right.set_ylim(bottom=0)
    axes.grid(alpha=0.3)


# Points of a spectrum between its smallest and largest wavevector, in addition to its kinks.
_LINE_POINTS = 200
# Most entries of a table that are drawn as points.
_MOST_ENTRIES = 100
_STYLES = ("-", "--", "-.", ":")
# Marked wavevectors: marker, name.
_NAMED = {"q0": ("o", "$q_0$, first"), "qr": ("s", "$q_r$, roll-off"), "q1": ("D", "$q_1$, cut-off")}


class _Curve(NamedTuple):
    q: np.ndarray
    C: np.ndarray
    points: bool  # measured: points with error bars, no line
    errors: np.ndarray | None  # below and above, shape (2, n)
    slope: np.ndarray | None  # rms slope up to q
    named: dict[str, tuple[float, float]]  # name in _NAMED -> (q, C)
    entries: tuple[np.ndarray, np.ndarray] | None  # (q, C) of a table
    profile: bool = False  # C is C_1D [m^3]


def plot_spectrum(spectra: Any, ax: Axes | None = None, q: ArrayLike | None = None) -> Axes:
    r"""Draw C(q) in log-log, and the rms slope of all roughness up to q on the right axis.

    .. math:: h_\mathrm{rms}^2 = 2\pi \int q\, C\, dq, \qquad
              \mathrm{slope}(q) = \sqrt{2\pi\int_{q_0}^{q} q'^3\, C\, dq'}

    Parameters
    ----------
    spectra : a spectrum, or a dict of label -> spectrum
        SelfAffine, TabulatedSpectrum, Anisotropic and TabulatedAnisotropic (mean over all directions) are
        lines with marked first, roll-off and cut-off wavevectors. Objects with arrays q [1/m] and C [m^4]
        (`MeasuredSpectrum`, `fitting.SpectrumData`) are points, with error bars if they have `relative` or
        `sigma`. A `MeasuredSpectrum` of profiles has C_1D [m^3] and the slope along the profile,
        (2 int q^2 C_1D dq)^(1/2). It cannot share axes with C of surfaces, but its `areal()` can.
    ax : matplotlib axes, or None for a new figure
        The axis of the slope is the last of `ax.figure.axes`.
    q : wavevectors of the lines [1/m], > 0, shape (n,), or None for 200 from end to end and all kinks

    Returns
    -------
    the axes of C

    Raises
    ------
    ValueError : if an object is not a spectrum, if a spectrum is smooth, if q is invalid, or if `ax` is not
        axes.

    Examples
    --------
    The right axis ends at the rms slope:

    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> ax = rf.plot.plot_spectrum({"new": road, "worn": road.replace(h_rms=0.3e-3)})
    >>> slope = ax.figure.axes[-1].lines[0].get_ydata()
    >>> round(float(slope[-1]), 3), round(float(rf.rms_slope(road)), 3)
    (1.738, 1.738)
    """
    several = isinstance(spectra, Mapping)
    spectra = spectra if isinstance(spectra, Mapping) else {"spectrum": spectra}
    if not spectra:
        raise ValueError("spectra is empty; give at least one")
    at = None if q is None else np.unique(vector("q", q, positive=True))
    curves = {label: _curve(label, spectrum, at) for label, spectrum in spectra.items()}
    profiles = [label for label, curve in curves.items() if curve.profile]
    if profiles and len(profiles) < len(curves):
        raise ValueError(
            f"{profiles[0]} is C_1D of profiles, others are C of surfaces: draw its areal() with them, or"
            " each kind on its own axes"
        )
    axes = one_axes(ax, (7.6, 4.0))
    right = axes.twinx()
    handles = [
        _draw_spectrum(axes, right, curve, label, colour, _STYLES[i % len(_STYLES)])
        for i, ((label, curve), colour) in enumerate(zip(curves.items(), colours(len(curves)), strict=True))
    ]
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("wavevector $q$ [1/m]")
    symbol = "$C_{1D}$ [m$^3$]" if profiles else "$C$ [m$^4$]"
    axes.set_ylabel(f"power spectrum {symbol}")
    right.set_yscale("log")
    right.set_ylabel(f"rms slope {'of the profile ' if profiles else ''}up to $q$ [-]")
    axes.grid(alpha=0.3)
    _keep_slopes_in_view(right, curves.values())
    handles = (handles if several else []) + _explained(curves.values())
    legend(axes, handles, scale_right=True, inside="lower center")
    return axes


def _curve(label: str, spectrum: Any, q: np.ndarray | None) -> _Curve:
    if isinstance(spectrum, Spectrum):
        return _line(label, spectrum, q)
    if not (hasattr(spectrum, "q") and hasattr(spectrum, "C")):
        raise ValueError(f"{label} must be a spectrum or have q and C, got {type(spectrum).__name__}")
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
        raise ValueError(f"{label}.C has no value > 0; log C needs at least one")
    profile = getattr(spectrum, "dimensions", 2) == 1
    # The spectrum C_1D / (pi q) of a surface has the same mean square slope, 2 pi int q^3 C dq.
    surface = C / (np.pi * q) if profile else C
    table = TabulatedSpectrum(q, surface) if q.size > 1 and (np.diff(q) > 0).all() else None
    slope = None if table is None else np.asarray(rms_slope(table, q), float)
    return _Curve(q, C, True, None if errors is None else errors[:, order], slope, {}, None, profile)


def _line(label: str, spectrum: Spectrum, q: np.ndarray | None) -> _Curve:
    if not float(spectrum.height_scale()) > 0:
        raise ValueError(f"{label} is smooth; log C needs roughness")
    kinks = np.unique(np.asarray(power_law_of(spectrum).q, float))  # kinks cut off coincide
    formula = spectrum.entries() is None
    if q is None:
        q = np.union1d(np.geomspace(kinks[0], kinks[-1], _LINE_POINTS)[1:-1], kinks)
    q = q[(q >= kinks[0]) & (q <= kinks[-1])]
    if q.size == 0:
        raise ValueError(f"{label}: no q lies within {kinks[0]:g} ... {kinks[-1]:g} 1/m")
    C, slope = _values(spectrum, np.concatenate([q, kinks]))  # together, to compile once
    C, slope, at_kinks = C[: q.size], slope[: q.size], C[q.size :]
    rolls_off = formula and kinks.size == 3
    places = {"q0": 0, "qr": 1, "q1": 2} if rolls_off else {"q0": 0, "q1": -1}
    named = {name: (kinks[i], at_kinks[i]) for name, i in places.items()}
    entries = None if formula or kinks.size > _MOST_ENTRIES else (kinks, at_kinks)
    return _Curve(q, C, False, None, slope, named, entries)


def _values(spectrum: Spectrum, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return C and the rms slope at q in double precision, because C may underflow in single precision."""
    log_C, slope = (np.asarray(x, float) for x in _log_C_and_slope(spectrum, q))
    return np.exp(log_C), slope


@quick_jit()
def _log_C_and_slope(spectrum: Spectrum, q: jax.Array | np.ndarray) -> tuple[jax.Array, jax.Array]:
    return log_power_spectrum(spectrum.power_law(), q), rms_slope(spectrum, q)


def _draw_spectrum(axes, right, curve, label, colour, style):
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
    """Limit the slope axis to four decades, because the slope is 0 at the first wavevector."""
    highest = max((curve.slope.max() for curve in curves if curve.slope is not None), default=0.0)
    if highest > 0:
        low, high = right.get_ylim()
        right.set_ylim(max(low, 1e-4 * highest), high)


def _explained(curves: Collection[_Curve]) -> list[Line2D]:
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
