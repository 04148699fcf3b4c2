"""What the pictures share: labels with units, looks that differ in grey too, axes and legends.

Conditions differ by colour (of increasing lightness) and marker, parts of a quantity by line style.
"""

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jax.typing import ArrayLike

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
else:  # matplotlib is there only where it draws
    Axes = Colormap = Figure = FigureBase = Handle = Line2D = Panels = Any

# Quantities that have a panel: label, and scale and offset from the unit they are computed in.
PANELS = {
    "area": ("contact area\n$A/A_0$ [-]", 1.0, 0.0),
    "friction": ("friction coefficient\n$\\mu$ [-]", 1.0, 0.0),
    "separation": ("mean separation\n$\\bar u$ [µm]", 1e6, 0.0),
    "transverse_friction": ("transverse friction\n$\\mu_\\perp$ [-]", 1.0, 0.0),
    "flash_temperature": ("flash temperature\n$T$ [°C]", 1.0, -ZERO_CELSIUS),
}
LOG_V = "$\\log_{10}(v\\;/\\;\\mathrm{m\\,s^{-1}})$"
MARKERS = "os^DvPX<>p"
# Markers along a line that has more points.
_MARKERS_OF_A_LINE = 7
# Labels of contours: how far from the middle they may be and how far apart, in widths of the axes.
_INSIDE, _APART = 0.38, 0.09
# Where viridis ends, and how much darker it is there: every colour has 3.3 times the contrast to white that
# white itself has, or more (3 is asked of lines by WCAG 2.1, 1.4.11), and lightness still rises.
_LIGHTEST, _DARKENED = 0.85, 0.3


def colours(count: int) -> np.ndarray:
    """As many colours, dark to light: viridis without its yellow, its light half darkened; RGBA."""
    from matplotlib import colormaps

    lightest = min(0.55 + 0.05 * count, _LIGHTEST)
    places = np.linspace(0.0, lightest, count) if count > 1 else np.array([0.25])
    found = colormaps["viridis"](places)
    found[:, :3] *= 1 - _DARKENED * ((places / _LIGHTEST) ** 2)[:, None]
    return found


def diverging() -> Colormap:
    """Red above, blue below, white at 0; not so dark at its ends that black lines were lost on it."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["RdBu_r"](np.linspace(0.15, 0.85, 256)))


def looks(count: int, points: int) -> list[dict[str, Any]]:
    """Colour and markers of `count` lines of so many points; those of neighbours are staggered."""
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


def signed(value: float, digits: int = 6) -> str:
    """A number as the axes write it, with a minus instead of a hyphen."""
    return f"{value:.{digits}g}".replace("-", "\u2212")


def label_contours(axes: Axes, lines: Any) -> None:
    """Write the levels on contours, once each, where neither the frame nor another label cuts them."""
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    size = np.array([x1 - x0, y1 - y0])
    places: list[np.ndarray] = []
    for path in lines.get_paths():
        parts = (path.vertices - [x0, y0]) / size
        parts = parts[(np.abs(parts - 0.5) < _INSIDE).all(1)]
        if not parts.size:
            continue
        # As near to the middle as the others allow.
        apart = np.min([np.hypot(*(parts - one).T) for one in places], 0) if places else np.ones(len(parts))
        free = apart > _APART
        if free.any():
            middle = np.hypot(*(parts - 0.5).T)
            places.append(parts[np.argmin(np.where(free, middle, np.inf))])
    if places:
        where = [tuple(place * size + [x0, y0]) for place in places]
        axes.clabel(lines, fontsize="x-small", fmt=signed, manual=where)


def new_figure(size: tuple[float, float], title: str = "") -> Figure:
    """A figure that pyplot does not know."""
    from matplotlib.figure import Figure

    _show_in_notebooks(Figure)
    figure = Figure(figsize=size, layout="constrained")
    if title:
        figure.suptitle(title, fontsize="medium", wrap=True)
    return figure


def _show_in_notebooks(kind):
    """Let a notebook show figures that pyplot does not know: by itself it learns that with pyplot's first."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if shell is None or kind in shell.display_formatter.formatters["image/png"]:
        return
    from IPython.core.pylabtools import select_figure_formats

    select_figure_formats(shell, {"png"})


def one_axes(ax: Axes | None, size: tuple[float, float] = (6.4, 4.0), title: str = "") -> Axes:
    """The axes to draw into: `ax`, or of a new figure if it is None."""
    if ax is None:
        return new_figure(size, title).subplots()
    from matplotlib.axes import Axes

    if not isinstance(ax, Axes):
        raise ValueError(f"ax is a {type(ax).__name__}: must be one matplotlib axes, or None")
    return ax


def several_axes(
    ax: Panels | None,
    names: Sequence[object],
    size: tuple[float, float],
    title: str = "",
    across: bool = False,
) -> Panels:
    """The axes to draw into, one for each name: `ax`, or of a new figure with that title if it is None.

    Those of a new figure share their x axis and are one below the other; `across`, one beside the other,
    they share both. ValueError if `ax` is no such sequence.
    """
    if ax is None:
        rows, columns = (1, len(names)) if across else (len(names), 1)
        figure = new_figure(size, title)
        return figure.subplots(rows, columns, sharex=True, sharey=across, squeeze=False).ravel()
    from matplotlib.axes import Axes

    rule = f"must have {len(names)}, for {', '.join(map(str, names))}; or be None"
    if isinstance(ax, Axes):
        raise ValueError(f"ax is one axes, not a sequence: {rule}")
    if not isinstance(ax, Sequence | np.ndarray) or not all(isinstance(one, Axes) for one in ax):
        raise ValueError(f"ax is a {type(ax).__name__}, not a sequence of axes: {rule}")
    if len(ax) != len(names):
        raise ValueError(f"ax has {len(ax)} axes: {rule}")
    return ax


def check_kind(name: str, value: object, kind: type) -> None:
    """ValueError unless a value is an object of a class."""
    if not isinstance(value, kind):
        raise ValueError(f"{name} is a {type(value).__name__}: must be of class {kind.__name__}")


def legend(
    axes: Axes,
    handles: Iterable[Handle] | None = None,
    scale_right: bool = False,
    inside: str = "best",
) -> None:
    """A legend beside the axes if their figure makes room for it, else inside.

    `scale_right`: the axes have a second scale on the right, whose lines "best" would not see.
    """
    handles = list(axes.get_legend_handles_labels()[0] if handles is None else handles)
    if not handles:
        return
    look: dict[str, Any] = {"loc": inside}
    if axes.figure.get_layout_engine() is not None:
        look = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.02)}
        if scale_right:
            # A pad counts in both directions: only beside the middle it moves nothing up or down.
            look = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5), "borderaxespad": 6.0}
    axes.legend(handles=handles, fontsize="small", **look)


def shown_velocities(velocity: ArrayLike) -> np.ndarray:
    """Indices of the velocities > 0, which have a logarithm, in increasing order."""
    velocity = np.asarray(velocity)
    shown = np.flatnonzero(velocity > 0)
    return shown[np.argsort(velocity[shown], kind="stable")]


def vector(name: str, values: ArrayLike, size: int | None = None, positive: bool = False) -> np.ndarray:
    """Numbers of a plot as a one-dimensional array; ValueError if they are none."""
    try:
        array = np.asarray(values, float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is a {type(values).__name__}: must be an array of numbers") from None
    if array.ndim != 1 or array.size == 0 or (size is not None and array.size != size):
        rule = "one number or more" if size is None else f"{size} numbers"
        raise ValueError(f"{name} has shape {array.shape}: must be one-dimensional, {rule}")
    if positive and not (np.isfinite(array) & (array > 0)).all():
        bad = int(np.argmin(np.isfinite(array) & (array > 0)))
        raise ValueError(f"{name}[{bad}] = {array[bad]:g}: must be > 0 and finite")
    return array
