"""Parts of the plots of fits: points, curves with bands, and the correlation matrix.

They need matplotlib: pip install 'rubberfric[plot]'.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from fitting.results.record import FitRecord
from fitting.solvers.evaluation import at_conditions, model_rows, residual_rows
from fitting.solvers.problem import Block
from fitting.solvers.residuals import forward, predictions
from fitting.uncertainty.intervals import Band
from rubberfric.base import quick_jit
from rubberfric.plot import style

# Largest number of conditions that are drawn with lines; above it data sets are drawn without lines.
_CURVES = 10
# Number of points of a line.
_POINTS = 120
# Share of white in the colour of the highest pressure of a temperature.
_LIGHTER = 0.5
# Marks a missing temperature or pressure.
_ABSENT = -1.0
# Largest number of parameters with a number in every cell, and with signs in cells of large correlations.
_NUMBERS, _SIGNS = 14, 40
_LARGE = 0.5
# Size of the cells in a new figure, and the margin around them [inch].
_CELL, _AROUND = 0.38, 2.6


class PlottedPoints(NamedTuple):
    """All measured and fitted points of one quantity, as arrays of equal length."""

    x: np.ndarray  # velocity, omega or q
    measured: np.ndarray
    below: np.ndarray  # lengths of the error bar
    above: np.ndarray
    fitted: np.ndarray
    residual: np.ndarray  # (measured - fitted) / error, of the logarithms where errors are relative
    part: np.ndarray  # 0, and 1 for E''
    body: np.ndarray  # "lower", "upper", or ""
    temperature: np.ndarray  # _ABSENT if missing
    pressure: np.ndarray
    source: np.ndarray  # label of the data set
    scene: np.ndarray  # name of the scene, "" for a single scene


class PlottedCurve(NamedTuple):
    """Points that share one line of a plot, or the points of one data set if the plot has no lines."""

    text: str
    conditions: tuple[str, str, float, float] | None  # (scene, body, temperature, pressure), None: no line
    part: int
    look: int  # number of the colour and marker
    where: np.ndarray  # indices of its points, by increasing x


def measured_points(result: FitRecord, quantity: str) -> PlottedPoints:
    """Return the points of all data sets of a quantity, except points at velocities <= 0."""
    problem = result.problem
    model, residual = model_rows(problem, result.x), residual_rows(problem, result.x)
    parts = []
    for one, rows, scene in zip(result.data, problem.order, result.data_scenes, strict=True):
        if one.quantity != quantity:
            continue
        parts_of_one, size = len(one.values), rows.size // len(one.values)
        body = next(b.body for b in problem.structure.blocks if b.rows[0] <= rows[0] < b.rows[1])
        measured, error, fitted = one.measured, np.asarray(problem.targets.error)[rows], model[rows]
        below = above = error
        if one.logarithmic:
            below, above, fitted = -measured * np.expm1(-error), measured * np.expm1(error), np.exp(fitted)

        def every(name, size=size, count=parts_of_one, one=one):
            value = getattr(one, name, None)
            return np.tile(np.full(size, _ABSENT) if value is None else value, count)

        parts.append(
            (
                every(one.conditions[0]), measured, below, above, fitted, -residual[rows],
                np.repeat(np.arange(parts_of_one), size), np.full(rows.size, body or ""),
                every("temperature"), every("pressure"), np.full(rows.size, one.label),
                np.full(rows.size, scene),
            )
        )  # fmt: skip
    points = PlottedPoints(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return PlottedPoints(*(column[points.x > 0] for column in points))


def fitted_curves(points: PlottedPoints) -> list[PlottedCurve]:
    """Return one curve for each combination of scene, body, temperature and pressure.

    E' and E'' have separate curves. If there are more than ten combinations, the points are grouped by data
    set, and the curves have no conditions.
    """
    columns = (points.scene, points.body, points.temperature, points.pressure)
    keys = sorted(set(zip(*(column.tolist() for column in columns), strict=True)))
    if len(keys) <= _CURVES:
        several = len({key[1] for key in keys}) > 1
        masks = [
            np.all([column == value for column, value in zip(columns, key, strict=True)], 0) for key in keys
        ]
        groups = [(_text(key, several), key, mask) for key, mask in zip(keys, masks, strict=True)]
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


def curve_colours(curves: list[PlottedCurve]) -> np.ndarray:
    """Return the RGBA colour of every `look`, shape (looks, 4).

    With several temperatures and pressures, each temperature has its own tone, and higher pressures are
    lighter.
    """
    conditions = {curve.look: curve.conditions for curve in curves}
    keys = [None if key is None else key[:3] for key in conditions.values()]
    families = list(dict.fromkeys(keys))
    if None in keys or len(families) in (0, 1, len(keys)):
        return style.colours(max(len(keys), 1))
    colours = style.colours(len(families))[[families.index(key) for key in keys]]
    for look, key in enumerate(keys):
        members = [k for k, other in enumerate(keys) if other == key]
        share = members.index(look) / max(len(members) - 1, 1)
        colours[look, :3] += _LIGHTER * share * (1 - colours[look, :3])
    return colours


def _text(key, several):
    scene, body, temperature, pressure = key
    texts = [scene] * bool(scene) + [body] * several
    if pressure != _ABSENT:
        texts.append(f"{pressure / 1e6:.4g} MPa")
    if temperature != _ABSENT:
        texts.append(f"{style.signed(round(temperature - 273.15, 2) + 0.0)} °C")
    return ", ".join(texts)


def lines(
    result: FitRecord, quantity: str, points: PlottedPoints, curves: list[PlottedCurve], level: float
) -> list[tuple[np.ndarray, Band] | None]:
    """Return a pair (x, Band) for every curve, or None for a curve without conditions.

    The bands are computed as in `FitResult.band`.
    """
    ends, groups = {}, {}
    for curve in curves:
        if curve.conditions is not None:
            ends[curve.conditions] = points.x[curve.where][[0, -1]]
    for key in ends:
        groups.setdefault((key[0], key[1], key[2] != _ABSENT), []).append(key)
    grids = {key: np.geomspace(end[0], end[1], _POINTS) for key, end in ends.items()}
    parts, first, blocks, conditions = 2 if quantity == "modulus" else 1, 0, [], []
    for (scene, body, warm), keys in groups.items():
        x = np.concatenate([grids[key] for key in keys])
        T, p = (np.repeat([key[k] for key in keys], _POINTS) for k in (2, 3))
        T = T if warm else None
        conditions.append({"modulus": (x, T), "spectrum": (x,)}.get(quantity, (x, p, T)))
        blocks.append(Block(quantity, body or None, False, (first, first + parts * x.size), scene))
        first += parts * x.size
    if not blocks:
        return [None] * len(curves)
    band, found = _band(result, tuple(blocks), tuple(conditions), level), {}
    for block, keys in zip(blocks, groups.values(), strict=True):
        columns = (array[slice(*block.rows)].reshape(parts, len(keys), _POINTS) for array in band)
        for values in zip(keys, *(np.swapaxes(column, 0, 1) for column in columns), strict=True):
            for part in range(parts):
                found[values[0], part] = grids[values[0]], Band(*(column[part] for column in values[1:]))
    return [found[curve.conditions, curve.part] if curve.conditions else None for curve in curves]


def _band(result, blocks, conditions, level):
    x, found = result.uncertainty.x, []
    for block, columns in zip(blocks, conditions, strict=True):
        key = block.quantity, block.body, block.scene
        found.append(at_conditions(result.problem, key, columns, x) or _compiled(result, block, columns, x))
    return result.widened(*(np.concatenate(part) for part in zip(*found, strict=True)), level)


def _compiled(result, block, columns, x):
    # Predictions and derivatives at conditions that the compiled function of the fit does not cover.
    structure = result.problem.structure._replace(blocks=(block,))
    numbers = result.problem.numbers._replace(conditions=(columns,))
    found = quick_jit()(lambda x: forward(lambda x: predictions(structure, numbers, x)[0], x))(jnp.asarray(x))
    return tuple(map(np.asarray, found))


def plot_correlation(result: Any, ax: style.Axes | None = None) -> style.Axes:
    """Draw the correlation matrix of a fit's free parameters.

    Each cell shows the correlation as a number. With more than 14 parameters, a cell shows only the sign, and
    only if the correlation is beyond +-0.5. With more than 40 parameters, the cells have no text. Cells of
    parameters without an error bar are hatched.

    Parameters
    ----------
    result : FitResult, PronyFit or SpectrumFit
    ax : matplotlib axes, or None
        If None, the axes belong to a new figure, `ax.figure`, which is not registered with pyplot. The
        colour bar is the last of `ax.figure.axes`.

    Returns
    -------
    the axes

    Raises
    ------
    ValueError : `result` is not a fit, or `ax` is not an axes.
    """
    if not hasattr(result, "correlation"):
        result = getattr(result, "fit", result)
    if not (hasattr(result, "names") and hasattr(result, "correlation")):
        raise ValueError(f"result is a {type(result).__name__}: must be a FitResult, PronyFit or SpectrumFit")
    names, correlation = list(result.names), np.asarray(result.correlation)
    side = _AROUND + max(_CELL * min(len(names), 2 * _NUMBERS), 1.5)
    axes = style.one_axes(ax, (side + 0.8, side))
    mesh = axes.imshow(correlation, cmap=style.diverging(), vmin=-1, vmax=1, interpolation="nearest")
    axes.grid(False)  # which a notebook may have switched on
    small = "small" if len(names) <= _NUMBERS else "x-small"
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
        axes.text(j, i, text, ha="center", va="center", fontsize="x-small")


def _hatch(axes, correlation):
    from matplotlib.patches import Patch, Rectangle

    look = {"facecolor": "0.9", "edgecolor": "0.6", "hatch": "////", "linewidth": 0}
    for i, j in np.argwhere(~np.isfinite(correlation)):
        axes.add_patch(Rectangle((j - 0.5, i - 0.5), 1, 1, **look))
    if not np.isfinite(correlation).all():
        patch = Patch(label="error bar withheld", **look)
        axes.legend(handles=[patch], fontsize="small", loc="lower left", bbox_to_anchor=(0, 1))
