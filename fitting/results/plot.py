"""Plots of fits: data, fit, residuals; profiles; correlations (`fitting.results.correlation_plot`).

They need matplotlib: pip install 'rubberfric[plot]'.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from fitting.data.kinds import KINDS
from fitting.results.correlation_plot import plot_correlation
from fitting.results.record import FitRecord
from fitting.solvers.evaluation import at_conditions, model_rows, residual_rows
from fitting.solvers.problem import SLIP_QUANTITIES, Block
from fitting.solvers.residuals import forward, predictions
from fitting.uncertainty.intervals import LEVEL, Band
from fitting.uncertainty.likelihood_profile import plot_profile
from rubberfric.base import StrPath, quick_jit
from rubberfric.plot import save_figure, style

__all__ = ["plot_correlation", "plot_fit", "plot_profile", "save_plot"]

# Labels of the axes of every quantity.
LABELS = {
    "friction": (style.VELOCITY, style.PANELS["friction"][0]),
    "area": (style.VELOCITY, style.PANELS["area"][0]),
    "modulus": ("angular frequency $\\omega$ [rad/s]", "modulus\n$E'$, $E''$ [Pa]"),
    "spectrum": ("wavevector $q$ [1/m]", "power spectrum\n$C$ [m$^4$]"),
    "force": ("slip, angle [rad] or ratio [-]", "tangential force\n[N]"),
    "moment": ("slip angle [rad]", "aligning moment\n[N m]"),
}
# A residual is drawn at the edge of the axes if it exceeds this multiple of the median, and the rest by half.
_OUTLYING = 8.0
# Largest number of conditions that are drawn with lines. Above it data sets are drawn without lines.
_CURVES = 10
# Number of points of a line.
_POINTS = 120
# Conditions that the line style and the marker show.
_BY_MARKER = ("pressure", "load")
# Texts of conditions in legends, in order.
_TEXTS = {
    "pressure": lambda p: f"{p / 1e6:.4g} MPa",
    "load": lambda load: f"{load:.4g} N",
    "speed": lambda speed: f"{speed:.4g} m/s",
    "temperature": lambda T: f"{style.signed(round(T - 273.15, 2) + 0.0)} °C",
}


def plot_fit(result: FitRecord, ax: style.Panels | None = None) -> style.Panels:
    """Draw measured and fitted values, and below each panel the residuals in standard errors.

    Friction and area are drawn against the velocity, with one colour for each temperature, and one line style
    and marker for each pressure. E' and E'' are drawn against omega, and C against q, with logarithmic axes.
    E'' has open symbols and dashed lines. Forces and moments are drawn against the slip without its sign. The
    95 % band of each curve is shaded. Measured points have the error bars that the fit used. Points at
    velocities <= 0 and without slip are left out. With more than ten different conditions, small crosses show
    the fitted values instead of lines.

    Parameters
    ----------
    result : FitResult
    ax : sequence of matplotlib axes, or None
        Two axes for each quantity among the data, a panel and the residuals below, in the order friction,
        area, modulus, spectrum, force, moment. If None, the axes belong to a new figure, `ax[0].figure`,
        which is not registered with pyplot.

    Returns
    -------
    sequence of the axes, top to bottom

    Examples
    --------
    >>> omega, scene = np.logspace(0, 4, 9), rf.load_scene("data/tread_on_asphalt.toml")
    >>> scene = scene.replace("upper.material", rf.Prony(E_inf=2e6, E=[1e7], tau=[1e-2]))
    >>> E = np.asarray(rf.complex_modulus(scene.upper.material, omega))
    >>> data = fitting.ModulusData(omega, E.real, E.imag, relative=0.05, body="upper")
    >>> axes = fitting.plot.plot_fit(fitting.fit(scene, data, {"upper.material.E": fitting.Positive()}))
    >>> len(axes)  # E' and E'' above, residuals below
    2
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
        fitted = _fitted_lines(result, quantity, points, curves)
        handles = _draw(quantity, points, curves, fitted, upper, lower)
        handles += _dress(quantity, points, upper, lower)
        if handles:
            upper.legend(handles=handles, fontsize="small", loc="upper left", bbox_to_anchor=(1.0, 1.02))
    return ax


def save_plot(path: StrPath, result: FitRecord, title: str = "") -> None:
    """Write the plot of a fit to a file, completely or not at all.

    Examples
    --------
    >>> omega, scene = np.logspace(0, 4, 9), rf.load_scene("data/tread_on_asphalt.toml")
    >>> scene = scene.replace("upper.material", rf.Prony(E_inf=2e6, E=[1e7], tau=[1e-2]))
    >>> E = np.asarray(rf.complex_modulus(scene.upper.material, omega))
    >>> data = fitting.ModulusData(omega, E.real, E.imag, relative=0.05, body="upper")
    >>> result = fitting.fit(scene, data, {"upper.material.E": fitting.Positive()})
    >>> fitting.plot.save_plot("fit.png", result, title="DMA of the tread")
    >>> with open("fit.png", "rb") as file:
    ...     print(file.read(4)[1:])
    b'PNG'
    """
    save_figure(path, plot_fit(result, _new_axes(_present(result), title))[0].figure)


def _present(result):
    return [name for name in LABELS if any(dataset.quantity == name for dataset in result.data)]


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

    looks, scaled = curve_looks(curves), _scale(quantity)
    handles = []
    for curve, line in zip(curves, fitted, strict=True):
        colour, where = looks[curve.look]["color"], curve.where
        look = {"color": colour, "marker": looks[curve.look]["marker"] or "o", "markersize": 3.5}
        look |= {"markerfacecolor": "white" if curve.part else colour, "linestyle": "none"}
        x, dashes = scaled(points.x[where]), "--" if curve.part else looks[curve.look]["linestyle"]
        errors = points.below[where], points.above[where]
        upper.errorbar(x, points.measured[where], errors, elinewidth=0.7, **look)
        lower.plot(x, points.residual[where], **look)
        if line is None or where.size == 1:
            upper.plot(x, points.fitted[where], "x", color=colour, markersize=3)
        if line is not None:
            at, band = scaled(line[0]), line[1]
            upper.plot(at, band.value, linestyle=dashes, color=colour, linewidth=1.2)
            upper.fill_between(at, band.low, band.high, color=colour, alpha=0.25, linewidth=0)
            look["linestyle"] = dashes
        handles.append(upper.plot([], [], label=curve.text or "data, fit", **look)[0])
    if any(fitted):
        handles.append(Patch(color="0.75", label=f"{100 * LEVEL:g} % band"))
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
    if quantity in ("friction", "area"):
        style.decades(lower.xaxis, LABELS[quantity][0])
    else:
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


class PlottedPoints(NamedTuple):
    """All measured and fitted points of one quantity, as arrays of equal length."""

    x: np.ndarray  # velocity, omega, q, or slip without its sign, > 0
    measured: np.ndarray
    below: np.ndarray  # lengths of the error bar
    above: np.ndarray
    fitted: np.ndarray
    residual: np.ndarray  # (measured - fitted) / error, of the logarithms where errors are relative
    part: np.ndarray  # 0, and 1 for E''
    source: np.ndarray  # label of the data set
    conditions: np.ndarray  # `CurveConditions` of every point


class CurveConditions(NamedTuple):
    """Conditions that the points of one line share."""

    scene: str  # name of the scene, "" for a single scene
    body: str  # "lower", "upper", or ""
    abscissa: str  # name of the condition that x is
    others: tuple[tuple[str, float], ...]  # name and value of the other conditions

    @property
    def family(self) -> tuple:
        """Everything but the pressure or the load."""
        return *self[:3], tuple(pair for pair in self.others if pair[0] not in _BY_MARKER)

    @property
    def text(self) -> str:
        """Name of the scene and values of the other conditions."""
        values = dict(self.others)
        return ", ".join(
            [self.scene] * bool(self.scene) + [_TEXTS[n](values[n]) for n in _TEXTS if n in values]
        )


class PlottedCurve(NamedTuple):
    """Points that share one line of a plot, or the points of one data set if the plot has no lines."""

    text: str
    conditions: CurveConditions | None  # None: no line
    part: int
    look: int  # number of the colour and marker
    where: np.ndarray  # indices of its points, by increasing x


def measured_points(result: FitRecord, quantity: str) -> PlottedPoints:
    """Return the points of all data sets of a quantity, except points at velocities <= 0."""
    problem = result.problem
    model, residual = model_rows(problem, result.x), residual_rows(problem, result.x)
    parts = []
    for dataset, rows, scene in zip(result.data, problem.order, result.data_scenes, strict=True):
        if dataset.quantity != quantity:
            continue
        parts_of_one, size = len(dataset.values), rows.size // len(dataset.values)
        body = next(b.body for b in problem.structure.blocks if b.rows[0] <= rows[0] < b.rows[1])
        measured, error, fitted = dataset.measured, np.asarray(problem.targets.error)[rows], model[rows]
        below = above = error
        if dataset.logarithmic:
            below, above, fitted = -measured * np.expm1(-error), measured * np.expm1(error), np.exp(fitted)

        abscissa, *others = [name for name in dataset.conditions if getattr(dataset, name) is not None]
        conditions = np.empty(size, object)
        for k in range(size):
            values = tuple((name, float(getattr(dataset, name)[k])) for name in others)
            conditions[k] = CurveConditions(scene, body or "", abscissa, values)
        x = np.abs(dataset.abscissa) if quantity in SLIP_QUANTITIES else dataset.abscissa
        parts.append(
            (
                np.tile(x, parts_of_one), measured, below, above, fitted, -residual[rows],
                np.repeat(np.arange(parts_of_one), size), np.full(rows.size, dataset.label),
                np.tile(conditions, parts_of_one),
            )
        )  # fmt: skip
    points = PlottedPoints(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return PlottedPoints(*(column[points.x > 0] for column in points))


def fitted_curves(points: PlottedPoints) -> list[PlottedCurve]:
    """Return one curve for each combination of scene, body and other conditions, and for E' and E''.

    If there are more than ten combinations, the points are grouped by data set, without conditions.
    """
    each = points.conditions.tolist()
    keys = sorted(set(each), key=lambda key: (*key[:3], key.others[::-1]))
    if len(keys) <= _CURVES:
        several = len({key.body for key in keys}) > 1
        groups = [
            (
                ", ".join([key.body] * several + [key.text] * bool(key.text)),
                key,
                np.array([k == key for k in each]),
            )
            for key in keys
        ]
    else:
        groups = [(label, None, points.source == label) for label in dict.fromkeys(points.source.tolist())]
    curves = []
    for look, (text, key, mask) in enumerate(groups):
        for part in range(int(points.part.max()) + 1):
            where = np.flatnonzero(mask & (points.part == part))
            where = where[np.argsort(points.x[where], kind="stable")]
            name = ("$E''$" if part else "$E'$") if points.part.any() else ""
            curves.append(PlottedCurve(", ".join(filter(None, (text, name))), key, part, look, where))
    return curves


def curve_looks(curves: list[PlottedCurve]) -> list[dict[str, Any]]:
    """Return the colour, line style and marker of every `look`.

    Each temperature has its own colour, each pressure or load its own line style and marker.
    """
    of_looks = {curve.look: curve.conditions for curve in curves}
    keys = [key for key in of_looks.values() if key is not None]
    count = max(len(of_looks), 1)
    if len(keys) < count:  # data sets
        return style.looks_of_conditions([0] * count, list(range(count)), 2)
    families = list(dict.fromkeys(key.family for key in keys))
    loads = [tuple(pair for pair in key.others if pair[0] in _BY_MARKER) for key in keys]
    order = sorted(set(loads))
    return style.looks_of_conditions(
        [order.index(load) for load in loads], [families.index(key.family) for key in keys], 2
    )


def _fitted_lines(result, quantity, points, curves):
    """Return a pair (x, Band) for every curve, as in `FitResult.band`, or None without conditions."""
    bands = {}
    for curve in curves:
        if curve.conditions is not None and curve.conditions not in bands:
            low, high = points.x[curve.where][[0, -1]]
            x = np.geomspace(low, high, _POINTS)
            bands[curve.conditions] = x, _band(result, quantity, x, curve.conditions)
    pairs = [bands.get(curve.conditions) for curve in curves]
    return [
        pair and (pair[0], Band(*(column[curve.part] for column in pair[1])))
        for curve, pair in zip(curves, pairs, strict=True)
    ]


def _band(result, quantity, x, key):
    """Return the `Band` at x with a row for each part, E' and E'' of a modulus."""
    values = {name: np.full(x.size, value) for name, value in key.others} | {key.abscissa: x}
    conditions = tuple(values.get(name) for name in KINDS[quantity].conditions)
    body, at = key.body or None, result.uncertainty.x
    values_and_slopes = at_conditions(result.problem, (quantity, body, key.scene), conditions, at)
    if values_and_slopes is None:  # the compiled function of the fit does not cover these conditions
        parts = len(KINDS[quantity].values)
        block = Block(quantity, body, False, (0, x.size * parts), key.scene)
        structure = result.problem.structure._replace(blocks=(block,))
        numbers = result.problem.numbers._replace(conditions=(conditions,))
        values_and_slopes = map(np.asarray, _value_and_slopes(structure, numbers, jnp.asarray(at)))
    band = result.widened(*values_and_slopes, LEVEL, signed=quantity == "moment")
    return Band(*(column.reshape(-1, x.size) for column in band))


@quick_jit(static_argnums=(0,))
def _value_and_slopes(structure, numbers, x):
    return forward(lambda x: predictions(structure, numbers, x)[0], x)
