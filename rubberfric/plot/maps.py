"""Plots of friction maps and of sensitivities as heat maps. They need matplotlib."""

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from rubberfric.base.checks import ArrayLike, closest
from rubberfric.base.units import to_celsius
from rubberfric.io.results import QUANTITY_FORMATS, Conditions, Result, curves_of
from rubberfric.plot.style import (
    PANELS,
    VELOCITY,
    Axes,
    Figure,
    Panels,
    decades,
    diverging,
    label_contours,
    new_figure,
    one_axes,
    several_axes,
    signed,
    vector,
)

# Most panels of a figure. Evenly spaced pressures are drawn if there are more.
_PANELS = 4
# Most points drawn along an axis. More would be finer than the pixels of a usual figure.
_DRAWN = 800

_SHADED = 50_000  # most points for which colours are interpolated, which is slow

# Invisible difference: relative to the range of a linear scale, or to the value on a logarithmic scale.
_ALIKE = 1e-2

_LOGARITHMIC = ("area",)  # logarithmic colours if > 0


def plot_map(
    result: object,
    quantity: str = "friction",
    ax: Panels | None = None,
    *,
    temperature: int | None = None,
    pressure: int | None = None,
) -> Panels:
    """Draw a quantity over log10 v and temperature with labelled contours, one panel per pressure.

    If the result has one temperature, or if `temperature` selects one, a single panel over log10 v and
    log10 p is drawn.

    Parameters
    ----------
    result : FrictionMap, or any Result
        The result must have at least two velocities > 0, and at least two pressures or temperatures.
        Velocities <= 0 are omitted.
    quantity : name of a field of the solution
    ax : sequence of matplotlib axes, one per panel, or None for a new figure
    temperature : index of the temperature to draw over the pressure, or None
    pressure : index of the pressure to draw over the temperature, or None
        If None, up to four pressures from the first to the last are drawn, or one panel if all panels look
        alike.

    Returns
    -------
    sequence of the axes, one per panel

    Raises
    ------
    ValueError : if there are too few conditions, if the quantity was not computed, or if `ax` has the wrong
        number of axes.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> result = rf.friction_map(scene, np.logspace(-4, 0, 9), [0.1e6, 0.2e6, 0.4e6])
    >>> axes = rf.plot.plot_map(result)
    >>> len(axes), axes[0].get_ylabel()  # one temperature
    (1, 'pressure $p$ [MPa]')
    """
    result = curves_of(result)
    check_map(result.conditions, temperature, pressure)
    field = getattr(result.solution, quantity) if quantity in QUANTITY_FORMATS else None
    if field is None:
        known = [name for name, values in result.solution._asdict().items() if values is not None]
        raise ValueError(f"quantity = {quantity!r}: {closest(quantity, known)}")
    other = (f"{quantity.replace('_', ' ')} [{QUANTITY_FORMATS[quantity].unit}]", 1.0, 0.0)
    label, scale, offset = PANELS.get(quantity, other)
    panels = _panels(result.conditions, temperature, pressure)
    alike = _as_one(panels, result.conditions, {quantity: field})
    if ax is None or len(ax) == len(alike):
        panels = alike
    names = [title or "the map" for _, _, title, _ in panels]
    ax = several_axes(ax, names, _size(len(panels), 1), result.title, across=True)
    columns, log_v = _axis(np.log10, result.conditions.velocity)
    drawn = []
    for (rows, y, title, place), axes in zip(panels, ax, strict=True):
        values = scale * np.asarray(field[place][rows][:, columns]) + offset
        drawn.append((axes, y, values))
        axes.set_title(title, fontsize="small")
        decades(axes.xaxis, VELOCITY)
    _draw(drawn, log_v, label.replace("\n", " "), quantity in _LOGARITHMIC)
    over_pressure = _over_pressure(result.conditions, temperature)
    if over_pressure:
        decades(ax[0].yaxis, "pressure $p$ [MPa]")
    else:
        ax[0].set_ylabel("temperature [°C]")
    return ax


def figure_of_map(result: Result) -> Figure:
    """Draw a row of panels for every quantity of a map, with one panel for panels that look alike."""
    conditions = result.conditions
    fields = {name: values for name, values in result.solution._asdict().items() if values is not None}
    panels = _panels(conditions, None, None)
    counts = [len(_as_one(panels, conditions, {name: fields[name]})) for name in fields]
    figure = new_figure(_size(max(counts), len(fields)), result.title)
    rows = figure.subfigures(len(fields), 1, squeeze=False)[:, 0]
    shared = max(counts) == min(counts)
    for i, (name, count, row) in enumerate(zip(fields, counts, rows, strict=True)):
        axes = row.subplots(1, count, sharex=True, sharey=True, squeeze=False)[0]
        plot_map(result, name, axes)
        if shared and i > 0:
            for below in axes:
                below.set_title("")
    return figure


def check_map(conditions: Conditions, temperature: int | None = None, pressure: int | None = None) -> None:
    """Raise ValueError unless velocity, and either pressure or temperature, have several values."""
    count = np.unique(conditions.velocity[conditions.velocity > 0]).size
    if count < 2:
        raise ValueError(f"velocity has {count} different values > 0; a map needs 2 or more")
    for name, index in (("temperature", temperature), ("pressure", pressure)):
        values = getattr(conditions, name)
        size = 1 if values is None else values.size
        if index is not None and not (isinstance(index, int | np.integer) and -size <= index < size):
            raise ValueError(f"{name} = {index!r}: must be an index of {size} values, or None")
    name = "pressure" if _over_pressure(conditions, temperature) else "temperature"
    values = getattr(conditions, name)
    picked = pressure if name == "pressure" else temperature
    if picked is not None or np.unique(values).size < 2:
        raise ValueError(f"{name} has one value; a map needs 2 or more pressures or temperatures")


def _over_pressure(conditions: Conditions, temperature: int | None) -> bool:
    T = conditions.temperature
    return temperature is not None or T is None or T.size == 1


def _panels(conditions: Conditions, temperature: int | None, pressure: int | None) -> list[tuple]:
    """Return (rows, y, title, place) for every panel: indices of rows, their y, index into the solution."""
    T, p = conditions.temperature, conditions.pressure
    if _over_pressure(conditions, temperature):
        i = 0 if temperature is None else temperature
        rows, y = _axis(lambda x: np.log10(x / 1e6), p)
        return [(rows, y, "" if T is None else f"{signed(to_celsius(T[i]))} °C", i)]
    assert T is not None  # otherwise the map is over the pressure
    chosen = range(p.size) if pressure is None else [pressure]
    if len(chosen) > _PANELS:
        chosen = np.linspace(0, p.size - 1, _PANELS).round().astype(int)
    rows, y = _axis(to_celsius, T)
    return [(rows, y, f"{p[j] / 1e6:.4g} MPa", (slice(None), j)) for j in chosen]


def _as_one(panels: list[tuple], conditions: Conditions, fields: dict[str, Any]) -> list[tuple]:
    """Return the panels, or a list with one panel if all panels look alike."""
    for name, field in fields.items():
        drawn = [np.asarray(field[place]) for *_, place in panels]
        shown = np.concatenate([values.ravel() for values in drawn])
        relative = name in _LOGARITHMIC and shown.min() > 0
        rtol, atol = (_ALIKE, 0.0) if relative else (0.0, _ALIKE * np.ptp(shown))
        if not all(np.allclose(values, drawn[0], rtol=rtol, atol=atol) for values in drawn[1:]):
            return panels
    if len(panels) == 1:
        return panels
    low, high = conditions.pressure.min() / 1e6, conditions.pressure.max() / 1e6
    rows, y, _, place = panels[0]
    return [(rows, y, f"{low:.4g} … {high:.4g} MPa, no difference", place)]


def _axis(scale: Callable[[np.ndarray], np.ndarray], values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of at most `_DRAWN` distinct values > 0 in increasing order, and their `scale`."""
    unique, index = np.unique(values, return_index=True)
    index = index[(unique > 0) & np.isfinite(unique)]
    if index.size > _DRAWN:
        index = index[np.linspace(0, index.size - 1, _DRAWN).round().astype(int)]
    return index, scale(np.asarray(values)[index])


def _draw(drawn, x, label, logarithmic):
    """Draw (axes, y, values) as heat maps with one colour scale, and contours in a contrasting colour."""
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.ticker import LogLocator, MaxNLocator

    low = min(float(values.min()) for _, _, values in drawn)
    high = max(float(values.max()) for _, _, values in drawn)
    logarithmic = logarithmic and low > 0
    norm = (LogNorm if logarithmic else Normalize)(low, high if high > low else low + 1.0)
    locator = MaxNLocator(7)
    if logarithmic:
        locator = LogLocator(subs=(1, 2, 5) if high < 1e3 * low else (1, 3))
    # Large cells would be visible as stripes: interpolate their colours.
    few = max(values.size for _, _, values in drawn) <= _SHADED
    # cividis is perceptually uniform, also in grey and for colour-blind readers.
    look = {"cmap": "cividis", "norm": norm, "shading": "gouraud" if few else "nearest"}
    levels = locator.tick_values(low, high)
    colours = ["white" if norm(level) < 0.55 else "black" for level in levels]
    style = {"colors": colours, "linewidths": [0.7] * len(levels)}
    meshes = [_coloured_map(axes, x, y, values, look, levels, style) for axes, y, values in drawn]
    bar = drawn[0][0].figure.colorbar(meshes[-1], ax=[axes for axes, _, _ in drawn])
    bar.set_label(label)


def _coloured_map(axes, x, y, values, look, levels, style):
    """Draw colours and labelled contours, with a list in `style` for all levels, and return the mesh."""
    mesh = axes.pcolormesh(x, y, values, rasterized=True, **look)
    axes.grid(False)  # a notebook may have switched it on
    inside = (values.min() < levels) & (levels < values.max())
    if inside.any():
        own = {name: list(itertools.compress(of_levels, inside)) for name, of_levels in style.items()}
        label_contours(axes, axes.contour(x, y, values, levels[inside], **own))
    return mesh


def _size(columns: int, rows: int) -> tuple[float, float]:
    # Width and height [inch].
    return 1.6 + max(3.0 * columns, 4.2), 0.7 + (3.2 if rows == 1 else 2.7 * rows)


_LABEL = "$\\partial \\ln \\mu \\;/\\; \\partial \\ln E_i$ [-]"


def plot_sensitivity(
    velocity: ArrayLike, tau: ArrayLike, values: ArrayLike, ax: Axes | None = None, *, label: str = _LABEL
) -> Axes:
    r"""Draw d ln mu / d ln E_i as a heat map over log10 v and log10 tau_i.

    Colours are symmetric about 0. Contours are solid above 0, dashed below, and thick at 0.

    Parameters
    ----------
    velocity : [m/s], shape (n,), at least two different values > 0; values <= 0 are omitted
    tau : relaxation times [s], > 0, all different, shape (m,), m >= 2
    values : d ln mu / d ln E_i [-], shape (m, n)
        Such values are returned by `fitting.sensitivity(scene, velocity, pressure, "upper.material.E")`.
    ax : matplotlib axes, or None for a new figure
        The colour bar is the last of `ax.figure.axes`.
    label : label of the colour bar

    Returns
    -------
    the axes

    Raises
    ------
    ValueError : if shapes are wrong, if there are too few velocities or times, if values are not finite, or
        if `ax` is not axes.

    Examples
    --------
    Terms matter most at v tau = 1 mm here; `fitting.sensitivity` returns such values:

    >>> v, tau = np.logspace(-6, 1, 8), np.array([1e-5, 1e-3, 1e-1])
    >>> values = np.exp(-(np.log10(v * tau[:, None] / 1e-3) ** 2))
    >>> ax = rf.plot.plot_sensitivity(v, tau, values)
    >>> ax.get_xlabel(), len(ax.figure.axes)
    ('velocity $v$ [m/s]', 2)
    """
    velocity, tau = vector("velocity", velocity), vector("tau", tau, positive=True)
    columns, x = _axis(np.log10, velocity)
    rows, y = _axis(np.log10, tau)
    for name, index in (("velocity", columns), ("tau", rows)):
        if index.size < 2:
            raise ValueError(f"{name} has {index.size} different values > 0: must have 2 or more for a map")
    if np.unique(tau).size < tau.size:
        raise ValueError("tau has equal entries; all must be different")
    shape, table = (tau.size, velocity.size), np.asarray(values, float)
    if table.shape != shape:
        raise ValueError(f"values has shape {table.shape}: must be {shape}, (tau, velocity)")
    if not np.isfinite(table[:, velocity > 0]).all():
        raise ValueError("values has a number that is not finite; it must be finite where v > 0")
    table = table[rows][:, columns]
    from matplotlib.ticker import MaxNLocator

    axes, largest = one_axes(ax, (6.8, 4.2)), float(np.abs(table).max()) or 1.0
    look = {"cmap": diverging(), "vmin": -largest, "vmax": largest, "shading": "nearest"}
    levels = MaxNLocator(9, symmetric=True).tick_values(-largest, largest)
    style = {
        "colors": ["black"] * len(levels),
        "linestyles": ["dashed" if level < 0 else "solid" for level in levels],
        "linewidths": [1.6 if level == 0 else 0.7 for level in levels],
    }
    mesh = _coloured_map(axes, x, y, table, look, levels, style)
    axes.figure.colorbar(mesh, ax=axes).set_label(label)
    decades(axes.xaxis, VELOCITY)
    decades(axes.yaxis, "relaxation time $\\tau_i$ [s]")
    return axes
