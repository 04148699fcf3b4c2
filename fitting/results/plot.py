"""Plots of fits: data, fit, residuals; correlations. They need matplotlib: pip install 'rubberfric[plot]'."""

import numpy as np

from fitting.results.pictures import curve_colours, fitted_curves, lines, measured_points, plot_correlation
from fitting.results.record import FitRecord
from fitting.uncertainty.likelihood_profile import plot_profile
from rubberfric.base import StrPath
from rubberfric.plot import save_figure, style

__all__ = ["plot_correlation", "plot_fit", "plot_profile", "save_plot"]

# Labels of the axes of every quantity.
LABELS = {
    "friction": (style.LOG_V, style.PANELS["friction"][0]),
    "area": (style.LOG_V, style.PANELS["area"][0]),
    "modulus": ("angular frequency $\\omega$ [rad/s]", "modulus\n$E'$, $E''$ [Pa]"),
    "spectrum": ("wavenumber $q$ [1/m]", "power spectrum\n$C$ [m$^4$]"),
}
_LEVEL = 0.95
# A residual is drawn at the edge of the axes if it exceeds this multiple of the median, and the rest by half.
_OUTLYING = 8.0


def plot_fit(result: FitRecord, ax: style.Panels | None = None) -> style.Panels:
    """Draw measured and fitted values, and below each panel the residuals in standard errors.

    Friction and area are drawn against log10 v, with one curve for each temperature and pressure. E' and E''
    are drawn against omega, and C is drawn against q, with logarithmic axes. E'' has open symbols and dashed
    lines. The 95 % band of each curve is shaded. Measured points have the error bars that the fit used.

    Parameters
    ----------
    result : FitResult
        Points at velocities <= 0 have no logarithm and are left out. If the data have more than ten
        different conditions, small crosses show the fitted values instead of lines.
    ax : sequence of matplotlib axes, or None
        Two axes for each quantity among the data, a panel and the residuals below, in the order friction,
        area, modulus, spectrum. If None, the axes belong to a new figure, `ax[0].figure`, which is not
        registered with pyplot.

    Returns
    -------
    sequence of the axes, top to bottom

    Raises
    ------
    ValueError
        `ax` has the wrong number of axes.
    """
    if not isinstance(result, FitRecord):
        raise ValueError(f"result is a {type(result).__name__}: must be of class FitResult")
    present = _present(result)
    ax = _new_axes(present) if ax is None else ax
    if len(ax) != 2 * len(present):
        raise ValueError(
            f"ax has {len(ax)} axes: must have {2 * len(present)},"
            f" a panel and its residuals for each of {', '.join(present)}"
        )
    for quantity, upper, lower in zip(present, ax[::2], ax[1::2], strict=True):
        points = measured_points(result, quantity)
        curves = fitted_curves(points)
        fitted = lines(result, quantity, points, curves, _LEVEL)
        handles = _draw(quantity, points, curves, fitted, upper, lower)
        handles += _dress(quantity, points, upper, lower)
        if handles:
            upper.legend(handles=handles, fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.02))
    return ax


def save_plot(path: StrPath, result: FitRecord, title: str = "") -> None:
    """Write the plot of a fit to a file, completely or not at all."""
    save_figure(path, plot_fit(result, _new_axes(_present(result), title))[0].figure)


def _present(result):
    return [name for name in LABELS if any(one.quantity == name for one in result.data)]


def _new_axes(present, title=""):
    panels = len(present)
    figure = style.new_figure((8.0, 0.4 + 4.2 * panels), title)
    ax = figure.subplots(2 * panels, 1, squeeze=False, height_ratios=[3, 1] * panels)[:, 0]
    for upper, lower in zip(ax[::2], ax[1::2], strict=True):
        upper.sharex(lower)
        upper.tick_params(labelbottom=False)
    figure.align_ylabels()
    return ax


def _draw(quantity, points, curves, fitted, upper, lower):
    from matplotlib.patches import Patch

    tones, scaled = curve_colours(curves), _scale(quantity)
    handles = []
    for curve, line in zip(curves, fitted, strict=True):
        colour, where = tones[curve.look], curve.where
        look = {
            "color": colour,
            "marker": style.MARKERS[curve.look % len(style.MARKERS)],
            "markersize": 3.5,
            "markerfacecolor": "white" if curve.part else colour,
            "linestyle": "none",
        }
        x, dashes = scaled(points.x[where]), "--" if curve.part else "-"
        errors = points.below[where], points.above[where]
        upper.errorbar(x, points.measured[where], errors, elinewidth=0.7, **look)
        lower.plot(x, points.residual[where], **look)
        if line is None or where.size == 1:
            upper.plot(x, points.fitted[where], "x", color=colour, markersize=3)
        if line is not None:
            upper.plot(scaled(line[0]), line[1].value, dashes, color=colour, linewidth=1.2)
            upper.fill_between(
                scaled(line[0]), line[1].low, line[1].high, color=colour, alpha=0.25, linewidth=0
            )
            look["linestyle"] = dashes
        handles.append(upper.plot([], [], label=curve.text or "data, fit", **look)[0])
    if any(fitted):
        handles.append(Patch(color="0.75", label=f"{100 * _LEVEL:g} % band"))
    return handles


def _scale(quantity):
    """Return the function of x that is drawn."""
    return np.log10 if quantity in ("friction", "area") else np.asarray


def _dress(quantity, points, upper, lower):
    """Set scales, limits and labels, and return a legend entry if outliers lie beyond the axes."""
    logarithmic = quantity in ("modulus", "spectrum")
    if logarithmic:
        for axes in (upper, lower):
            axes.set_xscale("log")
        upper.set_yscale("log")
    size = np.abs(points.residual)
    reach = np.max(size, initial=3.0)
    usual = max(3.0, _OUTLYING * np.median(size)) if size.size else 3.0
    near = np.full(size.shape, True) if reach < 1.5 * usual else size <= usual
    reach = np.max(size[near], initial=3.0)
    _limit(points, near, logarithmic, upper)
    for level in (-2, 0, 2):
        lower.axhline(level, color="0.5", linewidth=0.8, linestyle="--" if level else "-")
    lower.set_ylim(-1.15 * reach, 1.15 * reach)
    if reach < 5:
        lower.set_yticks([-2, 0, 2])
    upper.set_ylabel(LABELS[quantity][1])
    lower.set_ylabel("(data \u2212 fit)\n/ error [-]")
    lower.set_xlabel(LABELS[quantity][0])
    for axes in (upper, lower):
        axes.grid(alpha=0.3)
    return [] if near.all() else [_mark_outliers(quantity, points, ~near, upper, lower)]


def _limit(points, near, logarithmic, upper):
    """Set the limits of y from measured and fitted values, because bands may be extremely wide."""
    measured = np.concatenate([points.measured - points.below, points.measured + points.above])
    ends = np.append(measured[np.tile(near, 2)], points.fitted)
    if logarithmic:
        ends = ends[ends > 0]
    if ends.size:
        low, high = ends.min(), ends.max()
        if logarithmic:
            upper.set_ylim(low / (high / low) ** 0.05, high * (high / low) ** 0.05)
        else:
            upper.set_ylim(min(low - 0.05 * (high - low), 0.0), high + 0.05 * (high - low))


def _mark_outliers(quantity, points, outlying, upper, lower):
    """Draw arrows at the edge of the axes for points beyond, and return a legend entry."""
    x, look = _scale(quantity)(points.x), {"color": "C3", "markersize": 6, "linestyle": "none"}
    for axes, y in ((upper, points.measured), (lower, points.residual)):
        inside = axes.get_ylim()
        for marker, beyond, height in (("v", y < inside[0], 0.06), ("^", y > inside[1], 0.94)):
            at = x[outlying & beyond]
            axes.plot(at, np.full(at.size, height), marker, transform=axes.get_xaxis_transform(), **look)
    return upper.plot([], [], "^", label="outlier, beyond the axes", **look)[0]
