"""Plots over the velocity, over the wavevector, and of errors over run time. They need matplotlib."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy

from rubberfric.analysis.scales.profiles import Profile
from rubberfric.analysis.sweep import Accuracy, Row
from rubberfric.base.checks import ArrayLike, check_choice, check_kind
from rubberfric.base.units import to_celsius
from rubberfric.io.results import Conditions, Curves, curves_of
from rubberfric.plot.style import (
    PANELS,
    VELOCITY,
    Axes,
    Line2D,
    Panels,
    decades,
    legend,
    looks,
    looks_of_conditions,
    one_axes,
    several_axes,
    shown_velocities,
    signed,
    vector,
)

# Parts of the friction: line style, marker of a single point, name.
PARTS = {"viscoelastic_friction": ("--", "s", "viscoelastic"), "shear_friction": (":", "^", "contact shear")}
# Fewest points of a curve that is drawn smooth. Fewer do not determine a curve.
_FEWEST_FOR_SMOOTH = 8
# Points of a smooth curve, enough that its straight pieces are invisible.
_DRAWN_POINTS = 400


def plot_result(
    result: object,
    ax: Panels | None = None,
    *,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> Panels:
    """Draw all quantities of a result over the velocity: one panel per quantity, one line per condition.

    Transverse friction and flash temperature have panels if the solution has them. Parts of the friction are
    thin dashed and dotted lines in the panel of the friction.

    Parameters
    ----------
    result : Result of `rubberfric.friction_map` or a file, or the Solution of `rubberfric.solve`
        Velocities <= 0 are omitted.
    ax : sequence of matplotlib axes, one for each quantity, or None for a new figure
    velocity, pressure, temperature : conditions of a Solution, as given to `solve`

    Returns
    -------
    sequence of the axes, top to bottom

    Raises
    ------
    ValueError : if `result` is not a result, or if `ax` has another number of axes.
    """
    curves = curves_of(result, velocity, pressure, temperature)
    names = [name for name in PANELS if getattr(curves.solution, name) is not None]
    ax = several_axes(ax, names, (6.4, 0.8 + 2.3 * len(names)), curves.title)
    for i, (name, axes) in enumerate(zip(names, ax, strict=True)):
        _draw(axes, curves, name, named=i == 0)
    decades(ax[-1].xaxis, VELOCITY)
    return ax


def plot_friction(
    result: object,
    ax: Axes | None = None,
    *,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> Axes:
    """Draw the friction coefficient mu over the velocity, with one line per pressure and temperature.

    Thin lines show the parts of mu.

    Parameters
    ----------
    result : Result of `rubberfric.friction_map` or a file, the Solution of `rubberfric.solve`, or mu itself
        Velocities <= 0 are omitted.
    ax : matplotlib axes, or None for a new figure
    velocity, pressure, temperature : conditions of a Solution or of mu

    Returns
    -------
    the axes

    Raises
    ------
    ValueError : as in `rubberfric.io.curves_of`, if the quantity was not computed, if no velocity is > 0, or
        if `ax` is not axes.
    """
    return _quantity(curves_of(result, velocity, pressure, temperature, "friction"), "friction", ax)


def plot_area(
    result: object,
    ax: Axes | None = None,
    *,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> Axes:
    """Draw A/A0 over the velocity. The arguments are the same as for `plot_friction`."""
    return _quantity(curves_of(result, velocity, pressure, temperature, "area"), "area", ax)


def plot_separation(
    result: object,
    ax: Axes | None = None,
    *,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> Axes:
    """Draw the mean separation in µm over the velocity. The arguments are the same as for `plot_friction`."""
    return _quantity(curves_of(result, velocity, pressure, temperature, "separation"), "separation", ax)


def plot_curve(
    velocity: ArrayLike,
    values: ArrayLike | Mapping[str, ArrayLike],
    quantity: str = "friction",
    ax: Axes | None = None,
) -> Axes:
    """Draw one quantity over the velocity from arrays.

    Parameters
    ----------
    velocity : [m/s], shape (n,); values <= 0 are omitted
    values : values of the quantity in SI units, shape (n,), or a dict of label -> array
    quantity : "friction", "area", "separation", "transverse_friction" or "flash_temperature"
    ax : matplotlib axes, or None for a new figure

    Returns
    -------
    the axes

    Raises
    ------
    ValueError : if the shapes differ, if the quantity is unknown, if no velocity is > 0, or if `ax` is not
        axes.
    """
    check_choice("quantity", quantity, PANELS)
    velocity = vector("velocity", velocity)
    several = isinstance(values, Mapping)
    curves = {f"values[{label!r}]": x for label, x in values.items()} if several else {"values": values}
    curves = [vector(name, curve, velocity.size) for name, curve in curves.items()]
    shown = _some_velocities(velocity)
    axes = one_axes(ax)
    styles = looks(len(curves), _points(shown))
    _lines(axes, velocity, curves, list(values) if several else [None], styles, shown, quantity)
    _from_zero(axes, quantity)
    decades(axes.xaxis, VELOCITY)
    if several:
        legend(axes)
    return axes


def curve_labels(conditions: Conditions) -> dict[tuple[int, int], str]:
    """Return a dict that maps (index of temperature, index of pressure) to the label of the curve."""
    temperatures = [None] if conditions.temperature is None else conditions.temperature
    return {
        (i, j): f"{p / 1e6:.6g} MPa" + ("" if T is None else f", {signed(to_celsius(T))} °C")
        for i, T in enumerate(temperatures)
        for j, p in enumerate(conditions.pressure)
    }


def _quantity(result: Curves, name: str, ax: Axes | None) -> Axes:
    if getattr(result.solution, name) is None:
        known = [one for one, values in result.solution._asdict().items() if values is not None]
        raise ValueError(f"result has no {name}, only {', '.join(known) or 'nothing'}; compute it first")
    _some_velocities(result.conditions.velocity)
    axes = one_axes(ax, title=result.title)
    _draw(axes, result, name)
    decades(axes.xaxis, VELOCITY)
    return axes


def _draw(axes: Axes, result: Curves, name: str, named: bool = True) -> None:
    """Draw one quantity, with a legend of the parts of the friction and, if `named`, of the conditions."""
    labels, velocity = curve_labels(result.conditions), np.asarray(result.conditions.velocity)
    shown = shown_velocities(velocity)
    curves = [np.asarray(getattr(result.solution, name))[i, j] for i, j in labels]
    temperatures, pressures = ([key[k] for key in labels] for k in (0, 1))
    # Line styles show the parts of the friction, if there are parts.
    dashed = name != "friction" or all(getattr(result.solution, part) is None for part in PARTS)
    styles = looks_of_conditions(pressures, temperatures, _points(shown), dashed)
    lines = _lines(axes, velocity, curves, labels.values(), styles, shown, name)
    parts = _parts(axes, result, shown, lines) if name == "friction" else []
    _from_zero(axes, name)
    if named and len(labels) == 1 and not axes.get_title():
        axes.set_title(next(iter(labels.values())), fontsize="small", loc="left")
    legend(axes, (lines if named and len(labels) > 1 else []) + parts)


def _points(shown):
    """Return the number of points of a drawn curve."""
    return shown.size if shown.size < _FEWEST_FOR_SMOOTH else _DRAWN_POINTS


def _lines(axes, velocity, curves, labels, styles, shown, quantity):
    label, scale, offset = PANELS[quantity]
    log_v = np.log10(velocity[shown])
    drawn = [_without_kinks(log_v, scale * curve[shown] + offset) for curve in curves]
    handles = [
        axes.plot(x, y, label=text, **look)[0]
        for (x, y), text, look in zip(drawn, labels, styles, strict=True)
    ]
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)
    return handles


def _without_kinks(log_v, values):
    """Return points of a monotone cubic curve through the given points, or few points unchanged.

    Between two points the curve stays between their values, also where a heated branch jumps.
    """
    if log_v.size < _FEWEST_FOR_SMOOTH or not (np.diff(log_v) > 0).all() or not np.isfinite(values).all():
        return log_v, values
    dense = np.union1d(np.linspace(log_v[0], log_v[-1], _DRAWN_POINTS), log_v)
    return dense, scipy.interpolate.PchipInterpolator(log_v, values)(dense)


def _from_zero(axes: Axes, quantity: str) -> None:
    if quantity in ("area", "friction", "separation") and axes.dataLim.y0 >= 0:
        axes.set_ylim(bottom=0, auto=None)  # later curves may raise the top


def _parts(axes: Axes, result: Curves, shown: np.ndarray, lines: list[Line2D]) -> list[Line2D]:
    from matplotlib.lines import Line2D

    labels = curve_labels(result.conditions)
    log_v = np.log10(np.asarray(result.conditions.velocity)[shown])
    handles = []
    for name, (style, marker, label) in PARTS.items():
        if getattr(result.solution, name) is None:
            continue
        point = marker if shown.size < 2 else None
        look: dict[str, Any] = {"linestyle": style, "linewidth": 1.2, "marker": point}
        for (i, j), line in zip(labels, lines, strict=True):
            part = np.asarray(getattr(result.solution, name))[i, j, shown]
            axes.plot(*_without_kinks(log_v, part), color=line.get_color(), **look)
        handles.append(Line2D([], [], color="0.3", label=label, **look))
    return handles


def _some_velocities(velocity: np.ndarray) -> np.ndarray:
    shown = shown_velocities(velocity)
    if shown.size == 0:
        raise ValueError("velocity has no value > 0; log10 v needs at least one")
    return shown


# Fields of Profile and axis labels, from top to bottom.
_PROFILE_PANELS = (
    ("area", "area in contact\n$P(q)$ [-]"),
    ("friction_density", "friction per e-fold\n$d\\mu/d\\ln q$ [-]"),
    ("rms_slope", "rms slope up to $q$\n[-]"),
)


def plot_profile(profile: Profile, ax: Panels | None = None, labels: Sequence[str] | None = None) -> Panels:
    r"""Draw P(q), d mu / d ln q and the rms slope over the wavevector, one line per condition.

    In the panel of d mu / d ln q, equal areas are equal parts of the friction. A second scale above the top
    panel gives the wavelength 2 pi / q.

    Parameters
    ----------
    profile : Profile, from `rubberfric.analysis.profile`
    ax : sequence of three matplotlib axes, or None for a new figure
    labels : legend labels of the flattened conditions, or None

    Returns
    -------
    sequence of the axes, top to bottom

    Raises
    ------
    ValueError : if `labels` or `ax` has the wrong length.
    """
    check_kind("profile", profile, Profile)
    count = int(np.prod(np.shape(profile.area)[:-1]))
    if labels is not None and len(labels) != count:
        raise ValueError(f"labels has {len(labels)} names: must have {count}, one for each condition")
    ax = several_axes(ax, [name for name, _ in _PROFILE_PANELS], (6.4, 7.0))
    order = np.argsort(np.asarray(profile.q), kind="stable")
    log_q = np.log10(np.asarray(profile.q)[order])
    for (name, label), axes in zip(_PROFILE_PANELS, ax, strict=True):
        values = np.asarray(getattr(profile, name))[..., order]
        curves = values.reshape(-1, log_q.size)
        names = [None] * len(curves) if labels is None or values.ndim < 2 else labels
        for curve, text, look in zip(curves, names, looks(len(curves), log_q.size), strict=True):
            axes.plot(log_q, curve, label=text, **look)
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
    decades(ax[-1].xaxis, "wavevector $q$ [1/m]")
    if labels is not None:
        legend(ax[0])
    shift = np.log10(2 * np.pi)
    above = ax[0].secondary_xaxis("top", functions=(lambda x: shift - x, lambda x: shift - x))
    decades(above.xaxis, "wavelength $2\\pi/q$ [m]")
    return ax


# Lines of a sweep: (method, precision, attribute of errors and times) -> line style, marker, filled or open,
# colour, name.
_SWEEPS = {
    ("panels", "float64", "value"): ("-", "o", True, "C0", "values, float64"),
    ("panels", "float64", "gradient"): ("-", "s", True, "C3", "gradients, float64"),
    ("panels", "float32", "value"): ("--", "o", False, "C0", "values, float32"),
    ("panels", "float32", "gradient"): ("--", "s", False, "C3", "gradients, float32"),
    ("textbook", "float64", "value"): (":", "D", True, "0.5", "values, textbook method"),
}


def plot_accuracy(accuracy: Accuracy, ax: Axes | None = None, *, unit: Row | None = None) -> Axes:
    """Draw the largest error of area, friction and separation over run time, for values and gradients.

    Errors of gradients are drawn over the run time of values and gradients together. Errors below the
    resolution of the reference are drawn at that resolution. Errors that are not finite are omitted.

    Parameters
    ----------
    accuracy : Accuracy
    ax : matplotlib axes, or None for a new figure
    unit : row of `accuracy` whose forward run time is the unit of time, or None for milliseconds

    Returns
    -------
    the axes

    Raises
    ------
    ValueError : if `accuracy` or `ax` has the wrong type.
    """
    check_kind("accuracy", accuracy, Accuracy)
    ax = one_axes(ax, (8.0, 4.2))
    second = 1e3 if unit is None else 1 / unit.forward
    for (method, dtype, what), (line, marker, filled, colour, label) in _SWEEPS.items():
        rows = [row for row in accuracy.rows if (row.method, row.dtype) == (method, dtype)]
        time = "forward" if what == "value" else "gradient"
        drawn = [(second * getattr(row, time), getattr(accuracy.known(row), what)) for row in rows]
        drawn = [point for point in drawn if np.isfinite(point[1]) and point[1] > 0]
        if drawn:
            look: dict[str, Any] = {"linestyle": line, "marker": marker, "color": colour, "markersize": 5}
            ax.loglog(*zip(*drawn, strict=True), **look, mfc=colour if filled else "white", label=label)
    ax.axhline(accuracy.error, color="0.6", linewidth=0.8, label="wanted")
    ax.set_xlabel("run time [ms]" if unit is None else f"run time / run time of the {unit.method} method")
    ax.set_ylabel("largest relative error [-]")
    _label_times(ax)
    ax.grid(alpha=0.3)
    legend(ax)
    return ax


def _label_times(axes: Axes) -> None:
    """Label run times with plain numbers, because a sweep spans at most four decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis = axes.xaxis
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 1e3 * low else (1,)))
    axis.set_major_formatter(FuncFormatter(lambda time, _: f"{time:g}"))
    axis.set_minor_formatter(NullFormatter())
