"""Curves of a result over the sliding velocity. Needs matplotlib: pip install 'rubberfric[plot]'."""

import numpy as np

from rubberfric._atomic import replacing

PANELS = {
    "area": (1.0, "contact area\n$A/A_0$ [-]"),
    "friction": (1.0, "friction coefficient\n$\\mu$ [-]"),
    "separation": (1e6, "mean separation\n$\\bar u$ [µm]"),
}


def plot_result(result, ax=None):
    """Draw A/A0, mu and mean separation over log10 v: one panel each, one line per temperature and pressure.

    Parameters
    ----------
    result : Result
        see `rubberfric.results`. Velocities <= 0 have no logarithm and are left out.
    ax : sequence of as many matplotlib axes as the solution has quantities, or None
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
        scale, label = PANELS[name]
        for (i, j), text in curve_labels(result.conditions).items():
            curve = scale * np.asarray(getattr(result.solution, name))[i, j, shown]
            marker = "o" if shown.size < 2 else None
            axes.plot(np.log10(velocity[shown]), curve, label=text, marker=marker)
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
    ax[-1].set_xlabel("$\\log_{10}(v\\;/\\;\\mathrm{m\\,s^{-1}})$")
    if len(curve_labels(result.conditions)) > 1:
        ax[0].legend(fontsize="small")
    return ax


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
