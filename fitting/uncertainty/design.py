"""Design of the next experiment: the measurements that reduce errors of parameters or predictions most.

Plots need matplotlib: pip install 'rubberfric[plot]'.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np

import rubberfric as rf
from fitting.parameters.constraints import Constraint
from fitting.parameters.priors import Prior
from fitting.parameters.variables import slopes, to_values
from fitting.uncertainty.information import Conditions, exchange, gain, information, known_of, variance
from fitting.uncertainty.intervals import SolvedProblem
from rubberfric.base import POSITIVE, ArrayLike, StrPath, as_leaf, check_count, check_values, shown
from rubberfric.io import write_table
from rubberfric.plot import style

# Draws about a scene without a fit, which may be off by some ten per cent.
_DRAWS = 16
# Default relative error of a new measurement.
_ERROR = 0.05
# Criteria that are chosen by name: determinant and trace of the covariance.
_CRITERIA = ("D", "A")
# Most measurements of a design, which are chosen one after the other.
MOST_MEASUREMENTS = 10_000
# Greatest number of panels of a figure.
_PANELS = 4


@dataclasses.dataclass(frozen=True)
class prediction:
    """Criterion of a design: variance of the logarithm of a predicted quantity, averaged over conditions.

    Parameters
    ----------
    velocity, pressure, temperature : broadcastable [m/s], [Pa], [K]
    quantity : name of a quantity of `rubberfric.solve` that is > 0 at the conditions
    """

    velocity: ArrayLike
    pressure: ArrayLike
    temperature: ArrayLike | None = None
    quantity: str = "friction"


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Design:
    """Result of `design`: measurements to make, most useful first, and the expected errors.

    Attributes
    ----------
    velocity, pressure, temperature : conditions of every measurement, shape (n,) [m/s], [Pa], [K];
        temperature is None without shifts
    index : indices of the measurements among the candidates, shape (n,)
    names : key path of every free element
    before, after : standard deviations of x without and with the measurements, shape (size,); for Positive
        parameters these are relative errors
    rate : absolute value of d ln(value) / dx of every element, shape (size,); `rate * before` are relative
        errors of values
    predicted : (before, after) root mean square relative error of the prediction of the criterion, or None
    candidates : conditions of all candidates, each of shape (candidates,)
    gain : gain of one measurement at each candidate, shape (candidates,): for D in nats, for A and
        predictions the share by which the variance decreases
    criterion : name of the criterion
    rows : row of the Jacobian of every candidate at the first draw, in units of the candidate's error
    """

    velocity: np.ndarray
    pressure: np.ndarray
    temperature: np.ndarray | None
    index: np.ndarray
    names: tuple[str, ...]
    before: np.ndarray
    after: np.ndarray
    rate: np.ndarray
    predicted: tuple[float, float] | None
    candidates: Conditions
    gain: np.ndarray
    criterion: str
    rows: np.ndarray

    def report(self) -> str:
        """Return the measurements and the expected errors, as text of several lines."""
        lines = [f"Design of {self.index.size} measurements ({self.criterion}), most useful first"]
        repeats = {i: int(np.sum(self.index == i)) for i in self.index.tolist()}
        for i, count in repeats.items():
            v, p, T = self.candidates
            at = f"  v = {v[i]:.4g} m/s, p = {p[i] / 1e6:.4g} MPa"
            at += "" if T is None else f", T = {rf.units.to_celsius(T[i]):.4g} °C"
            lines.append(at + (f", {count} times" if count > 1 else ""))
        if self.predicted is not None:
            old, new = self.predicted
            lines.append(f"error of the prediction: {_percent(old)} before, {_percent(new)} after")
        lines.append("expected errors of the parameters (relative), before and after")
        width = max(map(len, self.names))
        for name, old, new in zip(self.names, self.rate * self.before, self.rate * self.after, strict=True):
            lines.append(f"  {name:<{width}}  {_percent(old):>10}  {_percent(new):>10}")
        return "\n".join(lines) + "\n"

    def plot(self, ax: style.Panels | None = None) -> style.Panels:
        """Draw the gain of one measurement at each candidate, and the chosen measurements.

        The axes are log10 v and temperature or pressure. With several temperatures there is a panel for each
        pressure, otherwise one for each temperature. The number in a circle is the number of measurements to
        make at a candidate. If only the velocity varies, the gain is drawn as a line. The axes, by default of
        a new figure, are returned.
        """
        return _drawn(self, ax)

    def write(self, path: StrPath) -> None:
        """Write the conditions of the measurements to a CSV table with the columns v, p and, if used, T."""
        table = {"v": self.velocity, "p": self.pressure}
        table |= {} if self.temperature is None else {"T": self.temperature}
        write_table(path, table, f"{self.index.size} measurements to make ({self.criterion}), in this order")


def design(
    source: SolvedProblem | rf.Scene,
    free: Mapping[str, Constraint] | None = None,
    *,
    candidates: tuple[ArrayLike, ...],
    n: float,
    criterion: str | prediction = "D",
    cost: ArrayLike | Callable[..., ArrayLike] | None = None,
    relative: ArrayLike | None = None,
    quantity: str = "friction",
    prior: Mapping[str, Prior] | None = None,
    draws: int | None = None,
    reach: float = 0.3,
    key: jax.Array | None = None,
    already: Design | None = None,
    quadrature: rf.Quadrature | None = None,
) -> Design:
    """Choose the most informative measurements among candidates.

    Parameters
    ----------
    source : FitResult or Scene
        The data and priors of a FitResult are the prior information. A Scene is for a first experiment.
    free : for a Scene: dict of key path -> rule, as for `fitting.fit`
    candidates : (velocity, pressure) or (velocity, pressure, temperature), broadcastable [m/s], [Pa], [K]
        Conditions of possible measurements, such as (v[:, None], p) for every combination.
    n : number of measurements, or their largest total cost, of at most 10 000 of the cheapest measurements; a
        candidate may be repeated
    criterion : "D", "A" or `prediction(...)`
        "D" minimises the volume of the ellipsoid of errors, "A" the mean variance of x (relative for
        Positive parameters), `prediction` the mean variance of a prediction.
    cost : cost of every candidate, or a function of (velocity, pressure, temperature) that returns the cost
        If None, each measurement costs 1.
    relative : relative error of a measurement, one for all candidates or one for each
        If None, the mean relative error of the fit's data of this quantity is used, or 5 %.
    quantity : measured quantity, "friction" or "area"
    prior : for a Scene: dict of key path -> Gaussian or Smooth
    draws : number of draws from the prior information over which the criterion is averaged
        If 1, only the present values are used. If None, the number is 16 for a scene and 1 for a fit. The
        average is over logarithms of the criterion.
    reach : largest standard deviation of the draws along a direction; 0.3 is 30 %
        This limits draws of parameters without prior information.
    key : jax.random.key of the draws, or None for key(0)
    already : a Design from the same candidates, whose measurements will be made as well
    quadrature : Quadrature of a Scene

    Raises
    ------
    ValueError : an unknown criterion, candidates or costs that do not broadcast or are <= 0, a budget below
        the cost of every candidate or beyond 10 000 measurements; a fit with a `Discrepancy`, whose error
        further measurements share; and as in `fitting.fit` for `free` and `prior`.

    Notes
    -----
    Errors follow from the model linearised at the scene, with exact derivatives, and are only as accurate as
    the scene. If the scene is uncertain, give a `prior` with this uncertainty; the design is then only
    slightly worse. A design is most useful for predictions outside the range of the candidates. Inside the
    range, errors depend on the number of measurements more than on their conditions
    (`tests/fitting/uncertainty/test_design_twins.py` has numbers for both).

    Examples
    --------
    Four measurements with errors of 3 % determine h_rms to 1.5 %, because mu is proportional to it:

    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> free = {"lower.spectrum.h_rms": fitting.Positive()}
    >>> options = {"criterion": fitting.prediction(10.0, 0.3e6), "relative": 0.03, "draws": 1}
    >>> candidates = np.logspace(-4, 0, 5)[:, None], np.array([0.1e6, 0.3e6])
    >>> plan = fitting.design(scene, free, candidates=candidates, n=4, **options)
    >>> plan.velocity, plan.after.round(3)
    (array([1., 1., 1., 1.]), array([0.015]))
    """
    known = known_of(source, free, prior, quadrature)
    at = _points(candidates)
    error = np.broadcast_to(
        np.asarray(_error(source, quantity) if relative is None else relative), at[0].shape
    )
    check_values("relative", error, POSITIVE)
    price = _cost(cost, at)
    if isinstance(n, bool) or not isinstance(n, int | float) or not n >= price.min():
        raise ValueError(f"n = {shown(n)}: must be >= {price.min():g}, the cost of the cheapest measurement")
    if n > MOST_MEASUREMENTS * price.min():
        most = f"{MOST_MEASUREMENTS * price.min():g}, the cost of {MOST_MEASUREMENTS} measurements"
        raise ValueError(f"n = {shown(n)}: must be <= {most}")
    draws = draws if draws is not None else 1 if isinstance(source, SolvedProblem) else _DRAWS
    if not isinstance(draws, int) or draws < 1:
        raise ValueError(f"draws = {shown(draws)}: must be an integer >= 1")
    xs = known.draws(draws, reach, jax.random.key(0) if key is None else key)
    rows = np.stack([known.rows(x, at, quantity) / error[:, None] for x in xs])
    target, base = _target(known, xs, criterion), known.information
    if already is not None:
        if already.rows.shape != rows[0].shape:
            raise ValueError("already: must be a Design of the same candidates and free parameters")
        base = base + information(already.rows[None], 0.0 * base, already.index)[0]
    index = exchange(rows, base, n, price, target)
    single = gain(rows, np.broadcast_to(base, (draws, *base.shape)), target)
    return Design(
        velocity=at[0][index],
        pressure=at[1][index],
        temperature=None if at[2] is None else at[2][index],
        index=index,
        candidates=at,
        gain=single if target is None else -np.expm1(-single),
        criterion=criterion if isinstance(criterion, str) else "prediction",
        rows=rows[0],
        **_expected(known, base[None], information(rows[:1], base, index), criterion, target),
    )


def _expected(known, old, new, criterion, target):
    """Return the fields of `Design` for the expected errors, with the information `old` and `new`."""
    before, after = (
        known.stretch * np.sqrt(np.diag(np.linalg.inv(information[0]))) for information in (old, new)
    )
    predicted = None
    if isinstance(criterion, prediction):
        predicted = tuple(float(np.sqrt(variance(information, target[:1])[0])) for information in (old, new))
    values = np.asarray(to_values(known.variables, known.constants, known.x))
    rate = np.abs(slopes(known.variables, known.constants, known.x) / np.where(values == 0, np.nan, values))
    return {"names": known.names, "before": before, "after": after, "rate": rate, "predicted": predicted}


def _points(candidates) -> Conditions:
    if not isinstance(candidates, tuple) or len(candidates) not in (2, 3):
        raise ValueError("candidates: must be (velocity, pressure) or (velocity, pressure, temperature)")
    columns = candidates if len(candidates) == 3 and candidates[2] is not None else candidates[:2]
    arrays = []
    for name, values in zip(("velocity", "pressure", "temperature"), columns, strict=False):
        arrays.append(np.asarray(as_leaf(f"candidates: {name}", values, np.ndim(values)), float))
        check_values(f"candidates: {name}", arrays[-1], POSITIVE)
    try:
        columns = np.broadcast_arrays(*arrays)
    except ValueError:
        shapes = ", ".join(str(x.shape) for x in arrays)
        raise ValueError(f"candidates: shapes {shapes}: must broadcast") from None
    check_count(columns[0].shape, "candidates: the conditions")
    flat = [np.array(x).ravel() for x in columns]
    return flat[0], flat[1], flat[2] if len(flat) == 3 else None


def _cost(cost, at):
    values = cost(*at) if callable(cost) else 1.0 if cost is None else cost
    try:
        values = np.broadcast_to(np.ravel(np.asarray(values, float)), at[0].shape)
    except (TypeError, ValueError):
        raise ValueError(f"cost: must be a number, or {at[0].size} numbers, one for each candidate") from None
    check_values("cost", values, POSITIVE)
    return values


def _error(source, quantity):
    """Return the mean relative error of the data of a fit, or the default."""
    errors = []
    if isinstance(source, SolvedProblem):
        blocks = [b for b in source.problem.structure.blocks if b.quantity == quantity and b.logarithmic]
        errors = [np.asarray(source.problem.targets.error)[slice(*b.rows)] for b in blocks]
    return float(np.mean(np.concatenate(errors))) if errors else _ERROR


def _target(known, xs, criterion):
    """Return the matrix L of the criterion for every draw, of shape (draws, size, size), or None for "D"."""
    if isinstance(criterion, prediction):
        at = _points((criterion.velocity, criterion.pressure, criterion.temperature))
        each = np.stack([known.rows(x, at, criterion.quantity) for x in xs])
        return np.swapaxes(each, 1, 2) @ each / at[0].size
    if not isinstance(criterion, str) or criterion not in _CRITERIA:
        raise ValueError(f"criterion = {shown(criterion)}: must be 'D', 'A' or fitting.prediction(...)")
    # Variances of x, not of x / stretch.
    return None if criterion == "D" else np.tile(np.diag(known.stretch**2), (len(xs), 1, 1))


def _percent(error: float) -> str:
    return "value is 0" if np.isnan(error) else f"{100 * error:.3g} %" if error < 10 else "open"


def _drawn(design, ax):
    v, p, T = design.candidates
    over_temperature = T is not None and np.unique(T).size > 1
    # Each panel has one pressure, or one temperature (NaN: none).
    key = p if over_temperature else np.full(p.size, np.nan) if T is None else T
    is_chosen = np.isin(np.arange(p.size), design.index)
    groups = np.unique(key[is_chosen], equal_nan=True)[:_PANELS]
    y = rf.units.to_celsius(T) if T is not None and over_temperature else np.log10(p / 1e6)
    names = [_title(g, over_temperature) for g in groups]
    if np.unique(p).size == 1 and not over_temperature:
        names = [", ".join(filter(None, (_title(p[0], True), name))) for name in names]
    ax = style.several_axes(ax, names, (1.8 + 3.6 * len(names), 3.9), across=True)
    unit = "[nat]" if design.criterion == "D" else "[part of the variance, -]"
    label, flat = f"gain of one measurement\n{unit}", np.unique(y).size == 1
    low, high = float(design.gain.min()), float(design.gain.max())
    for group, axes, name in zip(groups, ax, names, strict=True):
        shown = np.isnan(key) if np.isnan(group) else key == group
        axes.set_title(name, fontsize="small", loc="left")
        style.decades(axes.xaxis, style.VELOCITY)
        height = design.gain if flat else y
        if flat:
            order = np.flatnonzero(shown)[np.argsort(v[shown])]
            axes.plot(np.log10(v[order]), design.gain[order], color="0.3", linewidth=1.4)
            axes.grid(alpha=0.3)
        else:
            look: dict[str, Any] = {"vmin": low, "vmax": high, "cmap": "cividis", "linewidths": 0}
            drawn = axes.scatter(np.log10(v[shown]), y[shown], c=design.gain[shown], s=46, marker="s", **look)
        for i in np.flatnonzero(is_chosen & shown):
            where = (np.log10(v[i]), height[i])
            box = {"boxstyle": "circle,pad=0.25", "facecolor": "white", "edgecolor": "black"}
            count = int(np.sum(design.index == i))
            axes.annotate(str(count), where, ha="center", va="center", fontsize="small", bbox=box)
    if flat:
        ax[0].set_ylabel(label)
    else:
        if over_temperature:
            ax[0].set_ylabel("temperature [°C]")
        else:
            style.decades(ax[0].yaxis, "pressure $p$ [MPa]")
        ax[0].figure.colorbar(drawn, ax=list(ax)).set_label(label)
    return ax


def _title(value, over_temperature):
    if over_temperature:
        return f"{value / 1e6:.4g} MPa"
    return "" if np.isnan(value) else f"{style.signed(rf.units.to_celsius(value), 4)} °C"
