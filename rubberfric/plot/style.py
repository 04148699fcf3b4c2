"""Common elements of plots: labels with units, colours and markers, axes and legends.

Temperatures differ in colour (of increasing lightness, distinct in grey), pressures in line style and marker.
Parts of a quantity are thin lines. Axes of velocities, wavevectors and times have ticks 10^n at log10 of the
values.
"""

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rubberfric.base.checks import POSITIVE, ArrayLike, check_values
from rubberfric.base.units import ZERO_CELSIUS

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.container import Container
    from matplotlib.figure import Figure, FigureBase
    from matplotlib.lines import Line2D

    Panels = Sequence[Axes] | np.ndarray
    Handle = Artist | Container  # of a legend
else:  # matplotlib is imported by functions that draw
    Axes = Colormap = Figure = FigureBase = Handle = Line2D = Panels = Any

# Quantities with a panel: label, and scale and offset from the SI unit.
PANELS = {
    "area": ("contact area\n$A/A_0$ [-]", 1.0, 0.0),
    "friction": ("friction coefficient\n$\\mu$ [-]", 1.0, 0.0),
    "separation": ("mean separation\n$\\bar u$ [µm]", 1e6, 0.0),
    "transverse_friction": ("transverse friction\n$\\mu_\\perp$ [-]", 1.0, 0.0),
    "flash_temperature": ("flash temperature\n$T$ [°C]", 1.0, -ZERO_CELSIUS),
}
VELOCITY = "velocity $v$ [m/s]"
MARKERS = "os^DvPX<>p"
# Line styles of pressures: solid, long dashes, dots, dashes and dots, short dashes.
DASHES = ("-", (0, (7, 2)), (0, (1.5, 1.5)), (0, (7, 2, 1.5, 2)), (0, (3, 2)))
# Decades of an axis below which the ticks are 1, 2 and 5 times a power of ten.
_FEW_DECADES = 1.5
# Most decades with a tick each, and most decades with minor ticks.
_MOST_DECADES = 9
_MARKERS_OF_A_LINE = 7  # markers along a line with more points
# Largest distance of contour labels from the middle of an axis, as a share of the axis. Labels stay inside.
_INSIDE = 0.38
# Largest distance for contours that are farther from the middle.
_NEAR_FRAME = 0.43
# Extent of a contour that has no label, as a share of the axes.
_TINY = 0.12
# Smallest distance between contour labels, as a share of an axis. Labels do not cover each other.
_APART = 0.09
# Largest distance from the middle for levels without any other label.
_AT_FRAME = 0.44
# Smallest distance between labels for levels without any other label.
_CLOSE = 0.055
# Last place in viridis. Colours beyond are too light for lines on white.
_LIGHTEST = 0.85
# Darkening of the last colour. With it the contrast ratio of every colour to white is at least 3.3 (WCAG 2.1,
# 1.4.11 requires 3 for lines), and lightness still increases.
_DARKENED = 0.3


def colours(count: int) -> np.ndarray:
    """Return `count` RGBA colours from dark to light, of shape (count, 4).

    The colours are taken from viridis without its yellow end. Light colours are darkened.
    """
    from matplotlib import colormaps

    lightest = min(0.55 + 0.05 * count, _LIGHTEST)
    places = np.linspace(0.0, lightest, count) if count > 1 else np.array([0.25])
    rgba = colormaps["viridis"](places)
    rgba[:, :3] *= 1 - _DARKENED * ((places / _LIGHTEST) ** 2)[:, None]
    return rgba


def diverging() -> Colormap:
    """Return a colour map that is red above 0, blue below 0, and light enough for black contours."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["RdBu_r"](np.linspace(0.15, 0.85, 256)))


def looks(count: int, points: int) -> list[dict[str, Any]]:
    """Return the plot options of `count` lines with `points` points, with staggered markers."""
    several = count > 1
    step = max(1, -(-points // _MARKERS_OF_A_LINE))
    return [
        {
            "color": colour,
            "marker": MARKERS[i % len(MARKERS)] if several or points < 2 else None,
            "markevery": (i * step // count, step),
            "markersize": 4.5,
        }
        for i, colour in enumerate(colours(count))
    ]


def looks_of_conditions(
    pressures: Sequence[int], temperatures: Sequence[int], points: int, dashed: bool = True
) -> list[dict[str, Any]]:
    """Return the plot options of lines at the given indices of pressure and temperature.

    Temperatures have different colours, pressures different markers and, if `dashed`, line styles. If all
    temperatures are equal, pressures have different colours, too, and vice versa for markers.
    """
    several_p, several_T = (len(set(values)) > 1 for values in (pressures, temperatures))
    tone = temperatures if several_T else pressures
    sign = pressures if several_p else temperatures
    tones, step = colours(max(tone) + 1), max(1, -(-points // _MARKERS_OF_A_LINE))
    return [
        {
            "color": tones[tone[k]],
            "linestyle": DASHES[pressures[k] % len(DASHES)] if dashed and several_p else "-",
            "marker": MARKERS[sign[k] % len(MARKERS)] if several_p or several_T or points < 2 else None,
            "markevery": (k * step // len(sign), step),
            "markersize": 4.5,
        }
        for k in range(len(sign))
    ]


def decades(axis: Any, label: str) -> None:
    """Label an axis of log10(x) with the values of x, such as 10^n, and with the name of x."""
    from matplotlib.ticker import FuncFormatter, Locator

    class Decades(Locator):
        """Ticks at powers of ten, on short axes also at 2 and 5 times powers of ten; minor ticks between."""

        minor = False

        def __call__(self):
            """Return the ticks of the present limits."""
            return self.tick_values(*sorted(self.axis.get_view_interval()))  # pyright: ignore

        def tick_values(self, vmin: float, vmax: float) -> np.ndarray:
            """Return the ticks from vmin to vmax."""
            most = min(_MOST_DECADES, max(self.axis.get_tick_space(), 1))  # pyright: ignore
            step = max(1, int(np.ceil((vmax - vmin) / most)))
            if not self.minor and vmax - vmin >= _FEW_DECADES:
                return np.arange(np.ceil(vmin / step) * step, vmax + 1e-9, step)
            if step > 1:
                return np.arange(np.ceil(vmin), vmax)
            powers = np.arange(np.floor(vmin), np.ceil(vmax) + 1)
            digits = np.arange(2.0, 10.0) if self.minor else np.array([1.0, 2.0, 5.0])
            ticks = np.sort((powers[:, None] + np.log10(digits)).ravel())
            return ticks[(ticks > vmin - 1e-9) & (ticks < vmax + 1e-9)]

    class Between(Decades):
        minor = True

    axis.set_major_locator(Decades())
    axis.set_minor_locator(Between())
    axis.set_major_formatter(FuncFormatter(lambda x, _: _power(x)))
    axis.set_label_text(label)


def _power(log_value: float) -> str:
    """Return 10^n, or a number of one digit times 10^n, as the label of a tick."""
    n = int(np.floor(log_value + 1e-9))
    digit = round(10 ** (log_value - n))
    if digit != 1 and -3 <= n <= 3:
        return f"{digit * 10.0**n:g}"
    return f"$10^{{{n}}}$" if digit == 1 else f"${digit}\\cdot 10^{{{n}}}$"


def signed(value: float, digits: int = 6) -> str:
    """Format a number with a minus sign instead of a hyphen."""
    return f"{value:.{digits}g}".replace("-", "\u2212")


def label_contours(axes: Axes, lines: Any) -> None:
    """Label each contour line once, away from the frame and from other labels. Tiny loops have no label.

    If a level then has no label, its label may be closer to the frame and to others. Levels for which this
    leaves no place are removed.
    """
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    size = np.array([x1 - x0, y1 - y0])
    paths = lines.get_paths()
    pieces = [(level, piece) for level, path in enumerate(paths) for piece in _lines_of(path, [x0, y0], size)]
    places: list[np.ndarray] = []
    labelled: set[int] = set()
    for level, line in pieces:
        if np.ptp(line, 0).max() < _TINY:
            continue
        middle = np.abs(line - 0.5).max(1)
        parts = line[middle < max(_INSIDE, min(middle.min() + 0.01, _NEAR_FRAME))]
        free = parts[_distances(parts, places) > _APART]
        if free.size:  # the place that is closest to the middle
            places.append(free[np.argmin(np.hypot(*(free - 0.5).T))])
            labelled.add(level)
    for level, line in sorted(pieces, key=lambda piece: -len(piece[1])):
        if level in labelled:
            continue
        parts = line[np.abs(line - 0.5).max(1) < _AT_FRAME]
        distances = _distances(parts, places)
        if parts.size and distances.max() > _CLOSE:
            places.append(parts[np.argmax(distances)])
            labelled.add(level)
    for level, path in enumerate(paths):
        if level not in labelled:
            paths[level] = type(path)(np.empty((0, 2)))
    if places:
        where = [tuple(place * size + [x0, y0]) for place in places]
        axes.clabel(lines, fontsize="x-small", fmt=signed, manual=where)


def _lines_of(path, corner, size):
    """Return the lines of a contour level as shares of the axes."""
    begins = [] if path.codes is None else np.flatnonzero(path.codes == path.MOVETO)[1:]
    return [line for line in np.split((path.vertices - corner) / size, begins) if line.size]


def _distances(parts, places):
    """Return the distance of each point to the closest place, or 1 if `places` is empty."""
    return np.min([np.hypot(*(parts - place).T) for place in places] or [np.ones(len(parts))], 0)


def new_figure(size: tuple[float, float], title: str = "") -> Figure:
    """Create a figure that is not registered with pyplot."""
    from matplotlib.figure import Figure

    _show_in_notebooks(Figure)
    figure = Figure(figsize=size, layout="constrained")
    if title:
        figure.suptitle(title, fontsize="medium", wrap=True)
    return figure


def _show_in_notebooks(kind):
    """Let a notebook show figures, also if pyplot has not created a figure yet."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if shell is None or kind in shell.display_formatter.formatters["image/png"]:
        return
    from IPython.core.pylabtools import select_figure_formats

    select_figure_formats(shell, {"png"})


def one_axes(ax: Axes | None, size: tuple[float, float] = (6.4, 4.0), title: str = "") -> Axes:
    """Return `ax`, or the axes of a new figure if `ax` is None."""
    if ax is None:
        return new_figure(size, title).subplots()
    from matplotlib.axes import Axes

    if not isinstance(ax, Axes):
        raise ValueError(f"ax must be one matplotlib axes or None, got {type(ax).__name__}")
    return ax


def several_axes(
    ax: Panels | None,
    names: Sequence[object],
    size: tuple[float, float],
    title: str = "",
    across: bool = False,
) -> Panels:
    """Return `ax`, or one axes per name in a new figure if `ax` is None.

    In a new figure, the axes are stacked and share x. If `across` is True, the axes stand side by side and
    share x and y. ValueError is raised if `ax` is not a sequence with one axes per name.
    """
    if ax is None:
        rows, columns = (1, len(names)) if across else (len(names), 1)
        figure = new_figure(size, title)
        return figure.subplots(rows, columns, sharex=True, sharey=across, squeeze=False).ravel()
    from matplotlib.axes import Axes

    rule = f"must have {len(names)} ({', '.join(map(str, names))}), or be None"
    if isinstance(ax, Axes):
        raise ValueError(f"ax is one axes, not a sequence: {rule}")
    if not isinstance(ax, Sequence | np.ndarray) or not all(isinstance(axes, Axes) for axes in ax):
        raise ValueError(f"ax is a {type(ax).__name__}, not a sequence of axes: {rule}")
    if len(ax) != len(names):
        raise ValueError(f"ax has {len(ax)} axes: {rule}")
    return ax


def legend(
    axes: Axes, handles: Iterable[Handle] | None = None, scale_right: bool = False, inside: str = "best"
) -> None:
    """Add a legend outside the axes if the layout makes room for it, otherwise inside.

    `scale_right` is True if the axes have a second y axis on the right. The location "best" would ignore the
    lines of this second axis.
    """
    handles = list(axes.get_legend_handles_labels()[0] if handles is None else handles)
    if not handles:
        return
    look: dict[str, Any] = {"loc": inside}
    if axes.figure.get_layout_engine() is not None:
        look = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.02)}
        if scale_right:
            # The pad acts in both directions: only at mid-height it causes no vertical shift.
            look = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5), "borderaxespad": 6.0}
    axes.legend(handles=handles, fontsize="small", **look)


def shown_velocities(velocity: ArrayLike) -> np.ndarray:
    """Return the indices of the velocities > 0, sorted by velocity."""
    velocity = np.asarray(velocity)
    shown = np.flatnonzero(velocity > 0)
    return shown[np.argsort(velocity[shown], kind="stable")]


def vector(name: str, values: ArrayLike, size: int | None = None, positive: bool = False) -> np.ndarray:
    """Convert `values` to a one-dimensional array of floats.

    ValueError is raised if `values` are not numbers, if their shape is not (size,), or if `positive` is True
    and a number is not > 0 and finite.
    """
    try:
        array = np.asarray(values, float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be an array of numbers, got {type(values).__name__}") from None
    if array.ndim != 1 or array.size == 0 or (size is not None and array.size != size):
        rule = "one number or more" if size is None else f"{size} numbers"
        raise ValueError(f"{name} has shape {array.shape}: must be one-dimensional, {rule}")
    if positive:
        check_values(name, array, POSITIVE)
    return array
