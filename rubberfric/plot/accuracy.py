"""Picture of a sweep over accuracy settings. It needs matplotlib, as `rubberfric.plot`."""

from typing import Any

import numpy as np

from rubberfric.analysis.error_and_time.report import Accuracy, Row
from rubberfric.plot.style import Axes, check_kind, legend, one_axes

# What is drawn of a sweep: method, precision, attribute of errors and times; line style, marker,
# filled or open, colour, and name.
SWEEPS = {
    ("panels", "float64", "value"): ("-", "o", True, "C0", "values, float64"),
    ("panels", "float64", "gradient"): ("-", "s", True, "C3", "gradients, float64"),
    ("panels", "float32", "value"): ("--", "o", False, "C0", "values, float32"),
    ("panels", "float32", "gradient"): ("--", "s", False, "C3", "gradients, float32"),
    ("textbook", "float64", "value"): (":", "D", True, "0.5", "values, textbook method in NumPy"),
}


def plot_accuracy(accuracy: Accuracy, ax: Axes | None = None, *, unit: Row | None = None) -> Axes:
    """Draw error over run time: the largest over area, friction and separation, a line for each use.

    A gradient is drawn over the time for values and gradients. Errors that the reference cannot tell
    from less are drawn at what it can, those that are not finite are left out.

    Parameters
    ----------
    accuracy : Accuracy
    ax : matplotlib axes, or None for those of a new figure
    unit : a row of `accuracy` whose forward run time is the unit of time, or None
        None: milliseconds.

    Returns
    -------
    the axes

    Raises
    ------
    ValueError : `accuracy` or `ax` is something else.
    """
    check_kind("accuracy", accuracy, Accuracy)
    ax = one_axes(ax, (8.0, 4.2))
    second = 1e3 if unit is None else 1 / unit.forward
    for (method, dtype, what), (line, marker, filled, colour, label) in SWEEPS.items():
        rows = [row for row in accuracy.rows if (row.method, row.dtype) == (method, dtype)]
        time = "forward" if what == "value" else "gradient"
        drawn = [(second * getattr(row, time), getattr(accuracy.known(row), what)) for row in rows]
        drawn = [point for point in drawn if np.isfinite(point[1]) and point[1] > 0]
        if drawn:
            look: dict[str, Any] = {"linestyle": line, "marker": marker, "color": colour, "markersize": 5}
            ax.loglog(*zip(*drawn, strict=True), **look, mfc=colour if filled else "white", label=label)
    ax.axhline(accuracy.error, color="0.6", linewidth=0.8, label="wanted")
    ax.set_xlabel("run time [ms]" if unit is None else f"run time / that of the {unit.method} method")
    ax.set_ylabel("largest relative error [-]")
    _label_times(ax)
    ax.grid(alpha=0.3)
    legend(ax)
    return ax


def _label_times(axes: Axes) -> None:
    """Plain numbers, as many as there is room for: a sweep may span less than a decade, or four."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis = axes.xaxis
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 1e3 * low else (1,)))
    axis.set_major_formatter(FuncFormatter(lambda time, _: f"{time:g}"))
    axis.set_minor_formatter(NullFormatter())
