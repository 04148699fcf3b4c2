"""Plot of the correlations of fitted parameters. It needs matplotlib: pip install 'rubberfric[plot]'."""

from typing import Any

import numpy as np

from rubberfric.plot import style

# Most parameters with a number in every cell. More numbers would not fit their cells.
_NUMBERS = 14
# Most parameters with signs in the cells of large correlations. More signs would not fit their cells.
_SIGNS = 40
# Smallest correlation with a sign.
_LARGE = 0.5
# Size of a cell in a new figure [inch]. A number of two decimals fits into it.
_CELL = 0.45
# Size of a cell with a sign.
_SMALL_CELL = 0.27
# Margin around the cells in a new figure [inch], for names of parameters and the colour bar.
_AROUND = 2.6


def plot_correlation(result: Any, ax: style.Axes | None = None) -> style.Axes:
    """Draw the correlation matrix of a fit's free parameters.

    Each cell shows the correlation as a number. With more than 14 parameters, a cell shows only the sign, and
    only if the correlation is beyond +-0.5. With more than 40 parameters, the cells have no text. Cells of
    parameters without an error bar are hatched.

    Parameters
    ----------
    result : FitResult, PronyFit or SpectrumFit
    ax : matplotlib axes, which are returned
        If None, they belong to a new figure, `ax.figure`, which is not registered with pyplot. The colour bar
        is the last of `ax.figure.axes`.

    Examples
    --------
    Neighbouring relaxation times are correlated:

    >>> omega, scene = np.logspace(0, 4, 9), rf.load_scene("data/tread_on_asphalt.toml")
    >>> scene = scene.replace("upper.material", rf.Prony(E_inf=2e6, E=[1e7, 1e7], tau=[1e-2, 3e-3]))
    >>> E = np.asarray(rf.complex_modulus(scene.upper.material, omega))
    >>> data = fitting.ModulusData(omega, E.real, E.imag, relative=0.05, body="upper")
    >>> result = fitting.fit(scene, data, {"upper.material.E": fitting.Positive()})
    >>> ax = fitting.plot.plot_correlation(result)
    >>> round(float(result.correlation[0, 1]), 2), len(ax.texts)  # a text in each of 2 x 2 cells
    (-0.68, 4)
    """
    if not hasattr(result, "correlation"):
        result = getattr(result, "fit", result)
    if not (hasattr(result, "names") and hasattr(result, "correlation")):
        raise ValueError(f"result is a {type(result).__name__}: must be a FitResult, PronyFit or SpectrumFit")
    names, correlation = list(result.names), np.asarray(result.correlation)
    side = _AROUND + max(min((_CELL if len(names) <= _NUMBERS else _SMALL_CELL) * len(names), 11.0), 1.5)
    axes = style.one_axes(ax, (side + 0.8, side))
    mesh = axes.imshow(correlation, cmap=style.diverging(), vmin=-1, vmax=1, interpolation="nearest")
    axes.grid(False)  # which a notebook may have switched on
    small = "medium" if len(names) <= _NUMBERS else "small"
    axes.set_xticks(range(len(names)), names, rotation=90, fontsize=small)
    axes.set_yticks(range(len(names)), names, fontsize=small)
    _write(axes, correlation)
    _hatch(axes, correlation)
    axes.figure.colorbar(mesh, ax=axes, shrink=0.8).set_label("correlation [-]")
    return axes


def _write(axes, correlation):
    # Numbers or signs, so that the signs can be read without colours.
    count = len(correlation)
    if count > _SIGNS:
        return
    for (i, j), value in np.ndenumerate(correlation):
        if not np.isfinite(value):
            continue
        text = f"{round(value, 2) + 0.0:.2f}".replace("-", "\N{MINUS SIGN}")
        if count > _NUMBERS:
            text = "" if i == j or abs(value) < _LARGE else "\N{MINUS SIGN}" if value < 0 else "+"
        axes.text(j, i, text, ha="center", va="center", fontsize="small")


def _hatch(axes, correlation):
    from matplotlib.patches import Patch, Rectangle

    look = {"facecolor": "0.9", "edgecolor": "0.6", "hatch": "////", "linewidth": 0}
    for i, j in np.argwhere(~np.isfinite(correlation)):
        axes.add_patch(Rectangle((j - 0.5, i - 0.5), 1, 1, **look))
    if not np.isfinite(correlation).all():
        patch = Patch(label="error bar withheld", **look)
        axes.legend(handles=[patch], fontsize="small", loc="lower left", bbox_to_anchor=(0, 1))
