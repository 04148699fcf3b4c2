"""Plots of errors over run time. They need matplotlib."""

from typing import Any

import numpy as np

from rubberfric.analysis.sweep import Accuracy, Row
from rubberfric.base.checks import check_kind
from rubberfric.plot.style import Axes, legend, one_axes

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
