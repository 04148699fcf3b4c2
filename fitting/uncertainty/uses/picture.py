"""Picture of a design. It needs matplotlib: pip install 'rubberfric[plot]'."""

from typing import Any

import numpy as np

import rubberfric as rf
from rubberfric.plot import style

# Panels of a figure; a picture has no room for more.
_PANELS = 4


def plot_design(design: Any, ax: style.Panels | None = None) -> style.Panels:
    """Draw what one measurement would tell over log10 v and temperature or pressure, and those chosen.

    A panel for each pressure where there are several temperatures; the number in a circle is how often one
    measures there. Over the velocity alone, a line.

    Parameters
    ----------
    design : fitting.Design
    ax : sequence of as many matplotlib axes as there are panels, or None for those of a new figure

    Returns
    -------
    sequence of the axes
    """
    v, p, T = design.candidates
    over_temperature = T is not None and np.unique(T).size > 1
    celsius = np.zeros_like(v) if T is None else rf.units.to_celsius(T)
    groups = np.unique(p) if over_temperature else np.unique(T) if T is not None else np.array([np.nan])
    groups = [g for g in groups if _chosen(design, g, over_temperature).any()][:_PANELS]
    y = celsius if over_temperature else np.log10(p / 1e6)
    names = [_title(g, over_temperature) for g in groups]
    if np.unique(p).size == 1 and not over_temperature:
        names = [", ".join(filter(None, (_title(p[0], True), name))) for name in names]
    ax = style.several_axes(ax, names, (1.8 + 3.6 * len(names), 3.9), across=True)
    label = "gain of one measurement\n" + (
        "[nat]" if design.criterion == "D" else "[part of the variance, -]"
    )
    flat = np.unique(y).size == 1
    low, high = float(design.gain.min()), float(design.gain.max())
    for group, axes, name in zip(groups, ax, names, strict=True):
        shown = _group(design, group, over_temperature)
        axes.set_title(name, fontsize="small", loc="left")
        axes.set_xlabel(style.LOG_V)
        height = design.gain if flat else y
        if flat:
            order = np.flatnonzero(shown)[np.argsort(v[shown])]
            axes.plot(np.log10(v[order]), design.gain[order], color="0.3", linewidth=1.4)
            axes.grid(alpha=0.3)
        else:
            look: dict[str, Any] = {"vmin": low, "vmax": high, "cmap": "cividis", "linewidths": 0}
            drawn = axes.scatter(np.log10(v[shown]), y[shown], c=design.gain[shown], s=46, marker="s", **look)
        chosen = np.flatnonzero(_chosen(design, group, over_temperature))
        for i in chosen:
            where = (np.log10(v[i]), height[i])
            box = {"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": "black"}
            count = int(np.sum(design.index == i))
            axes.annotate(str(count), where, ha="center", va="center", fontsize="small", bbox=box)
    if flat:
        ax[0].set_ylabel(label)
    else:
        ax[0].set_ylabel("temperature [°C]" if over_temperature else "$\\log_{10}(p\\;/\\;\\mathrm{MPa})$")
        ax[0].figure.colorbar(drawn, ax=list(ax)).set_label(label)
    return ax


def _group(design, value, over_temperature):
    """Which candidates belong to a panel."""
    _, p, T = design.candidates
    if over_temperature:
        return p == value
    return np.ones(p.size, bool) if T is None else value == T


def _chosen(design, value, over_temperature):
    mask = np.zeros(design.gain.size, bool)
    mask[design.index] = True
    return mask & _group(design, value, over_temperature)


def _title(value, over_temperature):
    if over_temperature:
        return f"{value / 1e6:.4g} MPa"
    return "" if np.isnan(value) else f"{style.signed(rf.units.to_celsius(value), 4)} °C"
