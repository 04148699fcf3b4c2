"""Pictures of quantities over the sliding velocity. They need matplotlib, as `rubberfric.plot`."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import closest
from rubberfric.base.units import to_celsius
from rubberfric.io.results import Conditions, Curves, curves_of
from rubberfric.plot.style import (
    LOG_V,
    PANELS,
    Axes,
    Line2D,
    Panels,
    legend,
    looks,
    one_axes,
    several_axes,
    shown_velocities,
    signed,
    vector,
)

# Parts of the friction: line style, marker of a single point, and name.
PARTS = {
    "viscoelastic_friction": ("--", "s", "viscoelastic"),
    "shear_friction": (":", "^", "contact shear"),
}


def plot_result(
    result: object,
    ax: Panels | None = None,
    *,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> Panels:
    """Draw A/A0, mu, mean separation and more over log10 v: a panel each, a line per condition.

    Transverse friction and flash temperature have a panel where the solution has them.

    The parts of the friction, where the solution has them, are thin dashed and dotted lines in its panel.

    Parameters
    ----------
    result : Result of `rubberfric.friction_map` or a file, or the Solution of `rubberfric.solve`
        Velocities <= 0 have no logarithm and are left out.
    ax : sequence of a matplotlib axes for each quantity drawn, or None for those of a new figure
    velocity, pressure, temperature : of a Solution, as they were given to `solve`

    Returns
    -------
    sequence of the axes, top to bottom

    Raises
    ------
    ValueError : `result` is none, or `ax` has another number of axes.
    """
    found = curves_of(result, velocity, pressure, temperature)
    names = [name for name in PANELS if getattr(found.solution, name) is not None]
    ax = several_axes(ax, names, (6.4, 0.8 + 2.3 * len(names)), found.title)
    for i, (name, axes) in enumerate(zip(names, ax, strict=True)):
        _draw(axes, found, name, named=i == 0)
    ax[-1].set_xlabel(LOG_V)
    return ax


def plot_friction(
    result: object,
    ax: Axes | None = None,
    *,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> Axes:
    """Draw mu over log10 v, a line for each pressure and temperature, its parts thin below it.

    Parameters
    ----------
    result : Result of `rubberfric.friction_map` or a file, the Solution of `rubberfric.solve`, or mu itself
        Velocities <= 0 have no logarithm and are left out.
    ax : matplotlib axes, or None for those of a new figure
    velocity, pressure, temperature : of a Solution and of mu, as they were given for it

    Returns
    -------
    the axes

    Raises
    ------
    ValueError : as `rubberfric.io.curves_of`; the quantity was not computed, no velocity is > 0, or `ax`
        is no axes.
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
    """Draw A/A0 over log10 v, a line for each pressure and temperature; all else as `plot_friction`."""
    return _quantity(curves_of(result, velocity, pressure, temperature, "area"), "area", ax)


def plot_separation(
    result: object,
    ax: Axes | None = None,
    *,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> Axes:
    """Draw the mean separation over log10 v in µm; all else as `plot_friction`."""
    return _quantity(curves_of(result, velocity, pressure, temperature, "separation"), "separation", ax)


def plot_curve(
    velocity: ArrayLike,
    values: ArrayLike | Mapping[str, ArrayLike],
    quantity: str = "friction",
    ax: Axes | None = None,
) -> Axes:
    """Draw one quantity over log10 v from arrays.

    Parameters
    ----------
    velocity : [m/s], shape (n,); those <= 0 have no logarithm and are left out
    values : of the quantity, in SI units, shape (n,); or a dict of label -> such an array
    quantity : "friction", "area", "separation", "transverse_friction" or "flash_temperature"
    ax : matplotlib axes, or None for those of a new figure

    Returns
    -------
    the axes

    Raises
    ------
    ValueError : shapes that differ, an unknown quantity, no velocity > 0, or `ax` is no axes.
    """
    if quantity not in PANELS:
        raise ValueError(f"quantity = {quantity!r}: {closest(quantity, tuple(PANELS))}")
    velocity = vector("velocity", velocity)
    curves = values if isinstance(values, Mapping) else {None: values}
    names = [f"values[{name!r}]" if isinstance(values, Mapping) else "values" for name in curves]
    curves = {
        label: vector(name, curve, velocity.size)
        for name, (label, curve) in zip(names, curves.items(), strict=True)
    }
    shown = _some_velocities(velocity)
    axes = one_axes(ax)
    _lines(axes, velocity, list(curves.values()), curves, shown, quantity)
    _from_zero(axes, quantity)
    axes.set_xlabel(LOG_V)
    if isinstance(values, Mapping):
        legend(axes)
    return axes


def curve_labels(conditions: Conditions) -> dict[tuple[int, int], str]:
    """(index of temperature, index of pressure) -> text naming that curve's conditions."""
    temperatures = [None] if conditions.temperature is None else conditions.temperature
    return {
        (i, j): f"{p / 1e6:.6g} MPa" + ("" if T is None else f", {signed(to_celsius(T))} °C")
        for i, T in enumerate(temperatures)
        for j, p in enumerate(conditions.pressure)
    }


def _quantity(result: Curves, name: str, ax: Axes | None) -> Axes:
    if getattr(result.solution, name) is None:
        known = [one for one, values in result.solution._asdict().items() if values is not None]
        raise ValueError(f"result has no {name}, only {', '.join(known) or 'nothing'}: must be computed")
    _some_velocities(result.conditions.velocity)
    axes = one_axes(ax, title=result.title)
    _draw(axes, result, name)
    axes.set_xlabel(LOG_V)
    return axes


def _draw(axes: Axes, result: Curves, name: str, named: bool = True) -> None:
    """One quantity of a result; a legend of its conditions if `named`, and of its parts."""
    labels, velocity = curve_labels(result.conditions), np.asarray(result.conditions.velocity)
    shown = shown_velocities(velocity)
    curves = [np.asarray(getattr(result.solution, name))[i, j] for i, j in labels]
    lines = _lines(axes, velocity, curves, labels.values(), shown, name)
    parts = _parts(axes, result, shown, lines) if name == "friction" else []
    _from_zero(axes, name)
    if named and len(labels) == 1 and not axes.get_title():
        axes.set_title(next(iter(labels.values())), fontsize="small", loc="left")
    legend(axes, (lines if named and len(labels) > 1 else []) + parts)


def _lines(axes, velocity, curves, labels, shown, quantity):
    """Draw the curves in a quantity's panel; the handles of a legend."""
    label, scale, offset = PANELS[quantity]
    drawn = looks(len(labels), shown.size)
    handles = [
        axes.plot(np.log10(velocity[shown]), scale * curve[shown] + offset, label=text, **look)[0]
        for curve, text, look in zip(curves, labels, drawn, strict=True)
    ]
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)
    return handles


def _from_zero(axes: Axes, quantity: str) -> None:
    """Begin the panel of what is >= 0 at zero."""
    if quantity in ("area", "friction", "separation") and axes.dataLim.y0 >= 0:
        axes.set_ylim(bottom=0, auto=None)  # what is drawn next may still raise the top


def _parts(axes: Axes, result: Curves, shown: np.ndarray, lines: list[Line2D]) -> list[Line2D]:
    """Parts of the friction in the colours of its lines; the handles of a legend."""
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
            axes.plot(log_v, part, color=line.get_color(), **look)
        handles.append(Line2D([], [], color="0.3", label=label, **look))
    return handles


def _some_velocities(velocity: np.ndarray) -> np.ndarray:
    shown = shown_velocities(velocity)
    if shown.size == 0:
        raise ValueError("velocity has no value > 0: must have one at least, for log10 v")
    return shown
