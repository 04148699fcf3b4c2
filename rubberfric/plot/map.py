"""Pictures of friction maps. They need matplotlib: pip install 'rubberfric[plot]'."""

from collections.abc import Callable
from typing import Any

import numpy as np

from rubberfric.base.checks import closest
from rubberfric.base.units import to_celsius
from rubberfric.io.results import QUANTITY_FORMATS, Conditions, Result, curves_of
from rubberfric.plot.style import (
    LOG_V,
    PANELS,
    Figure,
    Panels,
    label_contours,
    new_figure,
    several_axes,
    signed,
)

# Panels of a figure, and points drawn along an axis: a picture has no room for more.
_PANELS = 4
_DRAWN = 800

# Points up to which colours are interpolated, which takes long.
_SHADED = 50_000

# Difference that no colour shows: of the range of a linear scale, of the value of a logarithmic one.
_ALIKE = 1e-2

# Drawn over a logarithmic scale if it is > 0: it spans decades.
_LOGARITHMIC = ("area",)


def plot_map(
    result: object,
    quantity: str = "friction",
    ax: Panels | None = None,
    *,
    temperature: int | None = None,
    pressure: int | None = None,
) -> Panels:
    """Draw a quantity over log10 v and temperature, a panel for each pressure; contours are labelled.

    With one temperature, or where `temperature` picks one, a single panel over log10 v and log10 p.

    Parameters
    ----------
    result : FrictionMap, or any Result
        at two velocities > 0 or more (others have no logarithm and are left out), and at two
        pressures or temperatures or more.
    quantity : name of a field of its solution
    ax : sequence of as many matplotlib axes as there are panels, or None for those of a new figure
    temperature : index of the one temperature to draw over the pressure, or None
    pressure : index of the one pressure to draw over the temperature, or None
        None: every pressure; of more than four, four from the first to the last; one panel where all are
        alike.

    Returns
    -------
    sequence of the axes, one for each panel

    Raises
    ------
    ValueError : nothing to draw, as above; the quantity was not computed; `ax` has another number of axes.
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
        axes.set_xlabel(LOG_V)
    _draw(drawn, log_v, label.replace("\n", " "), quantity in _LOGARITHMIC)
    over_pressure = _over_pressure(result.conditions, temperature)
    ax[0].set_ylabel("$\\log_{10}(p\\;/\\;\\mathrm{MPa})$" if over_pressure else "temperature [°C]")
    return ax


def figure_of_map(result: Result) -> Figure:
    """A figure of all quantities of a map, a row of panels for each; one where its panels would repeat."""
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
        if i < len(fields) - 1:
            for above in axes:
                above.set_xlabel("")
    return figure


def check_map(conditions: Conditions, temperature: int | None = None, pressure: int | None = None) -> None:
    """ValueError unless conditions, and indices that pick some of them, leave a plane to draw."""
    count = np.unique(conditions.velocity[conditions.velocity > 0]).size
    if count < 2:
        raise ValueError(f"velocity has {count} different values > 0: must have 2 or more for a map")
    for name, index in (("temperature", temperature), ("pressure", pressure)):
        values = getattr(conditions, name)
        size = 1 if values is None else values.size
        if index is not None and not (isinstance(index, int | np.integer) and -size <= index < size):
            raise ValueError(f"{name} = {index!r}: must be an index of {size} values, or None")
    name = "pressure" if _over_pressure(conditions, temperature) else "temperature"
    values = getattr(conditions, name)
    picked = pressure if name == "pressure" else temperature
    if picked is not None or np.unique(values).size < 2:
        raise ValueError(f"{name} has one value: must have 2 or more for a map, unless the other has")


def _over_pressure(conditions: Conditions, temperature: int | None) -> bool:
    T = conditions.temperature
    return temperature is not None or T is None or T.size == 1


def _panels(conditions: Conditions, temperature: int | None, pressure: int | None) -> list[tuple]:
    """(rows, their y, title, where in the result) of every panel."""
    T, p = conditions.temperature, conditions.pressure
    if _over_pressure(conditions, temperature):
        i = 0 if temperature is None else temperature
        rows, y = _axis(lambda x: np.log10(x / 1e6), p)
        return [(rows, y, "" if T is None else f"{signed(to_celsius(T[i]))} °C", i)]
    assert T is not None  # as else the map is over the pressure
    chosen = range(p.size) if pressure is None else [pressure]
    if len(chosen) > _PANELS:
        chosen = np.linspace(0, p.size - 1, _PANELS).round().astype(int)
    rows, y = _axis(to_celsius, T)
    return [(rows, y, f"{p[j] / 1e6:.4g} MPa", (slice(None), j)) for j in chosen]


def _as_one(panels: list[tuple], conditions: Conditions, fields: dict[str, Any]) -> list[tuple]:
    """The panels, or one for all of them where nobody would see a difference."""
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
    return [(rows, y, f"{low:.4g} … {high:.4g} MPa, all alike", place)]


def _axis(scale: Callable[[np.ndarray], np.ndarray], values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the values > 0 in increasing order, as many as are drawn, and these values scaled."""
    unique, index = np.unique(values, return_index=True)
    index = index[unique > 0]
    if index.size > _DRAWN:
        index = index[np.linspace(0, index.size - 1, _DRAWN).round().astype(int)]
    return index, scale(np.asarray(values)[index])


def _draw(drawn, x, label, logarithmic):
    """Heat maps (axes, y, values) with one colour scale and contours in the contrary of what is below."""
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.ticker import LogLocator, MaxNLocator

    low = min(float(values.min()) for _, _, values in drawn)
    high = max(float(values.max()) for _, _, values in drawn)
    logarithmic = logarithmic and low > 0
    norm = (LogNorm if logarithmic else Normalize)(low, high if high > low else low + 1.0)
    locator = MaxNLocator(7)
    if logarithmic:
        locator = LogLocator(subs=(1, 2, 5) if high < 1e3 * low else (1, 3))
    # Cells that are large enough to be seen as stripes are shaded.
    few = max(values.size for _, _, values in drawn) <= _SHADED
    # cividis: equal steps look equal, in grey and to the colour-blind as well.
    look = {"cmap": "cividis", "norm": norm, "rasterized": True, "shading": "gouraud" if few else "nearest"}
    for axes, y, values in drawn:
        mesh = axes.pcolormesh(x, y, values, **look)
        axes.grid(False)  # which a notebook may have switched on
        levels = [level for level in locator.tick_values(low, high) if values.min() < level < values.max()]
        if levels:
            colours = ["white" if norm(level) < 0.55 else "black" for level in levels]
            lines = axes.contour(x, y, values, levels, colors=colours, linewidths=0.7)
            label_contours(axes, lines)
    bar = drawn[0][0].figure.colorbar(mesh, ax=[axes for axes, _, _ in drawn])
    bar.set_label(label)


def _size(columns: int, rows: int) -> tuple[float, float]:
    """Width and height of a figure of panels [inch]."""
    return 1.6 + max(3.0 * columns, 4.2), 0.7 + (3.2 if rows == 1 else 2.7 * rows)
