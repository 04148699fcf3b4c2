"""Pictures of results and of accuracy. They need matplotlib: pip install 'rubberfric[plot]'."""

import importlib.util

import numpy as np

from rubberfric._atomic import check_writable, replacing

# Quantities that have a panel: label, and scale and offset from the unit they are computed in.
PANELS = {
    "area": ("contact area\n$A/A_0$ [-]", 1.0, 0.0),
    "friction": ("friction coefficient\n$\\mu$ [-]", 1.0, 0.0),
    "separation": ("mean separation\n$\\bar u$ [µm]", 1e6, 0.0),
    "transverse_friction": ("transverse friction\n$\\mu_\\perp$ [-]", 1.0, 0.0),
    "flash_temperature": ("flash temperature\n$T$ [°C]", 1.0, -273.15),
}
# Parts of the friction: line style, marker of a single point, and name.
PARTS = {
    "viscoelastic_friction": ("--", "s", "viscoelastic"),
    "shear_friction": (":", "^", "contact shear"),
}


def plot_result(result, ax=None):
    """Draw A/A0, mu, mean separation and more over log10 v: a panel each, a line per condition.

    Transverse friction and flash temperature have a panel where the solution has them.

    The parts of the friction, where the solution has them, are thin dashed and dotted lines in its panel.

    Parameters
    ----------
    result : Result
        see `rubberfric.results`. Velocities <= 0 have no logarithm and are left out.
    ax : sequence of as many matplotlib axes as the solution has of these quantities, or None
        None: axes of a new figure of its own, `ax[0].figure`, which pyplot does not know.

    Returns
    -------
    sequence of the axes, top to bottom
    """
    names = [name for name in PANELS if getattr(result.solution, name) is not None]
    if ax is None:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6.4, 0.8 + 2.3 * len(names)), layout="constrained")
        ax = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        if result.title:
            figure.suptitle(result.title, fontsize="medium", wrap=True)
    velocity = np.asarray(result.conditions.velocity)
    shown = np.flatnonzero(velocity > 0)
    shown = shown[np.argsort(velocity[shown], kind="stable")]
    for name, axes in zip(names, ax, strict=True):
        label, scale, offset = PANELS[name]
        for (i, j), text in curve_labels(result.conditions).items():
            curve = scale * np.asarray(getattr(result.solution, name))[i, j, shown] + offset
            marker = "o" if shown.size < 2 else None
            axes.plot(np.log10(velocity[shown]), curve, label=text, marker=marker)
        axes.set_ylabel(label)
        if name in ("area", "friction", "separation"):
            axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
    ax[-1].set_xlabel("$\\log_{10}(v\\;/\\;\\mathrm{m\\,s^{-1}})$")
    if len(curve_labels(result.conditions)) > 1:
        ax[0].legend(fontsize="small")
    if "friction" in names:
        _draw_parts(ax[names.index("friction")], result, shown)
    return ax


def _draw_parts(axes, result, shown):
    """Parts of the friction in the colours of the curves already drawn, and a legend of the line styles."""
    from matplotlib.lines import Line2D

    parts = {name: look for name, look in PARTS.items() if getattr(result.solution, name) is not None}
    if not parts:
        return
    log_v = np.log10(np.asarray(result.conditions.velocity)[shown])
    above = axes.get_legend()
    handles, labels = axes.get_legend_handles_labels() if above else ([], [])
    colours = [line.get_color() for line in axes.lines[-len(curve_labels(result.conditions)) :]]
    for name, (style, marker, label) in parts.items():
        look = {"linestyle": style, "linewidth": 1.0, "marker": marker if shown.size < 2 else None}
        for (i, j), colour in zip(curve_labels(result.conditions), colours, strict=True):
            axes.plot(log_v, np.asarray(getattr(result.solution, name))[i, j, shown], color=colour, **look)
        handles.append(Line2D([], [], color="0.3", **look))
        labels.append(label)
    axes.legend(handles, labels, fontsize="small")


def curve_labels(conditions):
    """(index of temperature, index of pressure) -> text naming that curve's conditions."""
    temperatures = [None] if conditions.temperature is None else conditions.temperature
    return {
        (i, j): f"{p / 1e6:.6g} MPa" + ("" if T is None else f", {T - 273.15:.6g} °C")
        for i, T in enumerate(temperatures)
        for j, p in enumerate(conditions.pressure)
    }


def save_plot(path, result):
    """Draw a result to a file, whole or not at all."""
    figure = plot_result(result)[0].figure
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=150)


# What is drawn of a sweep: method, precision, attribute of errors and times; line style, marker,
# filled or open, colour, and name.
SWEEPS = {
    ("panels", "float64", "value"): ("-", "o", True, "C0", "values, float64"),
    ("panels", "float64", "gradient"): ("-", "s", True, "C3", "gradients, float64"),
    ("panels", "float32", "value"): ("--", "o", False, "C0", "values, float32"),
    ("panels", "float32", "gradient"): ("--", "s", False, "C3", "gradients, float32"),
    ("textbook", "float64", "value"): (":", "D", True, "0.5", "values, textbook method in NumPy"),
}


def plot_accuracy(accuracy, ax=None, *, unit=None):
    """Draw error over run time: the largest over area, friction and separation, a line for each use.

    A gradient is drawn over the time for values and gradients. Errors that the reference cannot tell
    from less are drawn at what it can, those that are not finite are left out.

    Parameters
    ----------
    accuracy : Accuracy
    ax : matplotlib axes, or None
        None: axes of a new figure of its own, `ax.figure`, which pyplot does not know.
    unit : a row of `accuracy` whose forward run time is the unit of time, or None
        None: milliseconds.

    Returns
    -------
    the axes
    """
    if ax is None:
        from matplotlib.figure import Figure

        ax = Figure(figsize=(6.4, 4.4), layout="constrained").subplots()
    second = 1e3 if unit is None else 1 / unit.forward
    for (method, dtype, what), (line, marker, filled, colour, label) in SWEEPS.items():
        rows = [row for row in accuracy.rows if (row.method, row.dtype) == (method, dtype)]
        time = "forward" if what == "value" else "gradient"
        drawn = [(second * getattr(row, time), getattr(accuracy.known(row), what)) for row in rows]
        drawn = [point for point in drawn if np.isfinite(point[1]) and point[1] > 0]
        if drawn:
            look = {"linestyle": line, "marker": marker, "color": colour, "markersize": 5}
            ax.loglog(*zip(*drawn, strict=True), **look, mfc=colour if filled else "white", label=label)
    ax.axhline(accuracy.error, color="0.6", linewidth=0.8, label="wanted")
    ax.set_xlabel("run time [ms]" if unit is None else f"run time / that of the {unit.method} method")
    ax.set_ylabel("largest relative error [-]")
    ax.grid(alpha=0.3)
    ax.legend(fontsize="small")
    return ax


def save_accuracy_plot(path, accuracy, title=""):
    """Draw a sweep to a file, whole or not at all."""
    ax = plot_accuracy(accuracy)
    ax.set_title(title, fontsize="medium", wrap=True)
    with replacing(path) as temporary:
        ax.figure.savefig(temporary, dpi=150)


def check_plot(path):
    """ValueError unless a plot could be drawn to `path`."""
    check_writable(path, (".png", ".pdf", ".svg"))
    if importlib.util.find_spec("matplotlib") is None:
        raise ValueError("--plot needs matplotlib; install it with: pip install 'rubberfric[plot]'")
