"""Picture of what each relaxation time does to a quantity. It needs matplotlib, as `rubberfric.plot`."""

from typing import Any

import numpy as np
from jax.typing import ArrayLike

from rubberfric.plot.style import LOG_V, Axes, diverging, label_contours, one_axes, vector

_LABEL = "$\\partial \\ln \\mu \\;/\\; \\partial \\ln E_i$ [-]"


def plot_sensitivity(
    velocity: ArrayLike,
    tau: ArrayLike,
    values: ArrayLike,
    ax: Axes | None = None,
    *,
    label: str = _LABEL,
) -> Axes:
    r"""Draw d ln mu / d ln E_i as a heat map over log10 v and log10 tau_i.

    Colours are balanced about 0. Contours say the sign without them: solid above 0, dashed below,
    thick at 0.

    Parameters
    ----------
    velocity : [m/s], shape (n,), two different ones > 0 or more; those <= 0 are left out
    tau : relaxation times [s], > 0, all different, shape (m,), m >= 2
    values : [-], shape (m, n)
        of `fitting.sensitivity(scene, velocity, pressure, "upper.material.E")`
    ax : matplotlib axes, or None for those of a new figure
        The scale of colours is the last of `ax.figure.axes`.
    label : text beside the scale of colours

    Returns
    -------
    the axes

    Raises
    ------
    ValueError : shapes that do not fit, too few velocities or times, values that are not finite, or
        `ax` is no axes.
    """
    columns, x = _axis("velocity", vector("velocity", velocity))
    rows, y = _axis("tau", vector("tau", tau, positive=True))
    if rows.size < np.size(tau):
        raise ValueError("tau has equal entries: must all be different, to lie beside each other")
    shape, table = (np.size(tau), np.size(velocity)), np.asarray(values, float)
    if table.shape != shape:
        raise ValueError(f"values has shape {table.shape}: must be {shape}, (tau, velocity)")
    table = table[rows][:, columns]
    if not np.isfinite(table).all():
        raise ValueError("values has a number that is not finite: must be finite where v > 0")
    axes = one_axes(ax, (6.8, 4.2))
    _draw(axes, x, y, table, label)
    axes.set_xlabel(LOG_V)
    axes.set_ylabel("$\\log_{10}(\\tau_i\\;/\\;\\mathrm{s})$")
    return axes


def _axis(name: str, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the different values > 0 in increasing order, and their logarithms."""
    unique, index = np.unique(values, return_index=True)
    index = index[(unique > 0) & np.isfinite(unique)]
    if index.size < 2:
        raise ValueError(f"{name} has {index.size} different values > 0: must have 2 or more for a map")
    return index, np.log10(values[index])


def _draw(axes: Axes, x: np.ndarray, y: np.ndarray, values: np.ndarray, label: str) -> None:
    from matplotlib.ticker import MaxNLocator

    largest = float(np.abs(values).max()) or 1.0
    look: dict[str, Any] = {
        "cmap": diverging(),
        "vmin": -largest,
        "vmax": largest,
        "shading": "nearest",
        "rasterized": True,
    }
    mesh = axes.pcolormesh(x, y, values, **look)
    axes.grid(False)  # which a notebook may have switched on
    levels = MaxNLocator(9, symmetric=True).tick_values(-largest, largest)
    levels = [level for level in levels if values.min() < level < values.max()]
    if levels:
        style: dict[str, Any] = {
            "linestyles": ["dashed" if level < 0 else "solid" for level in levels],
            "linewidths": [1.6 if level == 0 else 0.7 for level in levels],
        }
        lines = axes.contour(x, y, values, levels, colors="black", **style)
        label_contours(axes, lines)
    axes.figure.colorbar(mesh, ax=axes).set_label(label)
