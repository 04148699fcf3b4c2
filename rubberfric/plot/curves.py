"""Plots over the velocity. They need matplotlib."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy

from rubberfric.base.checks import ArrayLike, check_choice
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

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> axes = rf.plot.plot_result(rf.friction_map(scene, [1e-3, 1e-2, 1e-1], 0.15e6))
    >>> [ax.get_ylabel().split()[0] for ax in axes]
    ['contact', 'friction']
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

    Examples
    --------
    Measured friction at two temperatures:

    >>> v, T = np.array([1e-3, 1e-2, 1e-1]), np.array([[273.15], [293.15]])
    >>> mu = np.array([[0.9, 1.1, 1.0], [0.7, 0.9, 1.1]])
    >>> ax = rf.plot.plot_friction(mu, velocity=v, pressure=2e5, temperature=T)
    >>> [line.get_label() for line in ax.lines]
    ['0.2 MPa, 0 °C', '0.2 MPa, 20 °C']
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
    """Draw A/A0 over the velocity. The arguments are the same as for `plot_friction`.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> v, p = np.array([1e-3, 1e-2, 1e-1]), 0.15e6
    >>> ax = rf.plot.plot_area(rf.solve(scene, v, p, quantities="area"), velocity=v, pressure=p)
    >>> round(float(ax.lines[0].get_ydata()[1]), 4)
    0.0164
    """
    return _quantity(curves_of(result, velocity, pressure, temperature, "area"), "area", ax)


def plot_separation(
    result: object,
    ax: Axes | None = None,
    *,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> Axes:
    """Draw the mean separation in µm over the velocity. The arguments are the same as for `plot_friction`.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> v, p = np.array([1e-3, 1e-2, 1e-1]), 0.15e6
    >>> ax = rf.plot.plot_separation(rf.solve(scene, v, p, quantities="separation"), velocity=v, pressure=p)
    >>> round(float(ax.lines[0].get_ydata()[1]))  # in µm
    812
    """
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

    Examples
    --------
    >>> v = np.array([1e-3, 1e-2, 1e-1])
    >>> ax = rf.plot.plot_curve(v, {"dry": [0.8, 1.0, 0.9], "wet": [0.6, 0.7, 0.65]})
    >>> [text.get_text() for text in ax.get_legend().get_texts()], ax.get_xlabel()
    (['dry', 'wet'], 'velocity $v$ [m/s]')
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
    """Return a dict that maps (index of temperature, index of pressure) to the label of the curve.

    Examples
    --------
    >>> mu, v, p = np.ones((2, 3)), np.array([1e-3, 1e-2, 1e-1]), np.array([[1e5], [2e5]])
    >>> rf.plot.curve_labels(rf.io.curves_of(mu, v, p, 293.15).conditions)
    {(0, 0): '0.1 MPa, 20 °C', (0, 1): '0.2 MPa, 20 °C'}
    """
    temperatures = [None] if conditions.temperature is None else conditions.temperature
    return {
        (i, j): f"{p / 1e6:.6g} MPa" + ("" if T is None else f", {signed(to_celsius(T))} °C")
        for i, T in enumerate(temperatures)
        for j, p in enumerate(conditions.pressure)
    }


def _quantity(result: Curves, name: str, ax: Axes | None) -> Axes:
    if getattr(result.solution, name) is None:
        known = [field for field, values in result.solution._asdict().items() if values is not None]
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
