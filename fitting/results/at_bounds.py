r"""Error bars of a fit with a parameter at a bound, from fits along that parameter.

A parameter at a bound, driven towards zero, or not identified within its bounds makes the covariance useless
for correlated parameters: the covariance describes a small region, and the data may allow values far outside.
The parameter is therefore held at further and further values :math:`t_k`, and all others are fitted again.
With the rise :math:`\Delta_k` of twice the cost, the other parameters :math:`x_j(t_k)` and their standard
deviations :math:`s_j(t_k)` at fixed :math:`t_k`, the profile likelihood interval of the parameter j is the
union over k of

.. math:: x_j(t_k) \pm s_j(t_k) \sqrt{q^2 - \Delta_k}, \qquad \Delta_k < q^2

if the rows are linear in the other parameters at each :math:`t_k` [Murphy & van der Vaart, J. Am. Stat.
Assoc. 95 (2000) 449, for profile likelihoods]. An error bar from the covariance that misses a part of this
interval is withheld, and the report lists the interval instead. An error bar that excludes another known
minimum of nearly the same cost is withheld, too.
"""

import time
from typing import NamedTuple

import numpy as np

from fitting.parameters.plausible import implausible
from fitting.parameters.variables import to_x
from fitting.solvers.evaluation import costs_at, errors_of_slopes, evaluate_rows
from fitting.solvers.levenberg_marquardt import NEAR_MINIMUM
from fitting.solvers.objective import negligible, was_interrupted
from fitting.solvers.ordered import edges, put_in_order
from fitting.solvers.residuals import padded
from fitting.solvers.runs import run_fits
from fitting.uncertainty.covariance import OPEN, Uncertainty
from fitting.uncertainty.intervals import LEVEL, SolvedProblem

# Values at which a parameter with two bounds is held, as shares of the distance between the bounds.
_PLACES = (0.01, 0.06, 0.2, 0.35, 0.5, 0.65, 0.8, 0.94, 0.99)

# Values of a parameter at a neighbour in an order, as steps in x from the neighbour.
_AWAY = (0.1, 0.5, 1.5, 3.0)

# Values of a parameter that was driven towards zero, as factors of its start. Values beyond the interval are
# not tried.
_FROM_ZERO = (1e-3, 1e-2, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)

# Values of any other parameter, as steps in x from the solution.
_STEPS = (0.5, 1.5, 3.0, 6.0, 10.0)

# Least distance of such a value from the solution, in x.
_NEAREST = 0.01

# Largest number of parameters that are followed.
_FOLLOWED = 4

# Largest number of steps of each fit.
_MOST = 8
# Intervals that are wider than this, in x, are not listed.
_WIDE = 10.0
# Part of half an error bar by which the interval may exceed it.
_TOLERATED = 0.2
# Correlation beyond which an error bar is withheld if the parameter without one could not be followed.
_CORRELATED = 0.5


class AtBound(NamedTuple):
    """Fits along a parameter that is at a bound, or that is not identified within its bounds.

    Attributes
    ----------
    name, value : the parameter and its fitted value
    where : "at its lower bound 0.3", or another reason why it has no error bar
    held, rises : values at which it was held, and rises of chi-square after fitting all others again
    interval : lowest and highest value at which chi-square rises by less than at the 95 % level
    complete : False if time ended before chi-square had risen, or the end of the range was reached
    intervals : 95 % intervals of parameters without an error bar, {name: (low, high)}
    """

    name: str
    value: float
    where: str
    held: tuple[float, ...]
    rises: tuple[float, ...]
    interval: tuple[float, float]
    complete: bool
    intervals: dict[str, tuple[float, float]]


class _Path(NamedTuple):
    """Solutions along a parameter, by increasing x of this parameter."""

    x: np.ndarray  # shape (k, size)
    rise: np.ndarray  # shape (k,)
    complete: bool


class _Side:
    """Solutions with element i held further and further away on one side of the solution of a fit.

    Attributes
    ----------
    places : values of the element that are left, nearest first
    points : solutions so far, with their rises of chi-square; the first is the solution of the fit
    complete : True if the rise passed the threshold, or if no place is left
    """

    def __init__(self, solved: SolvedProblem, i: int, places: np.ndarray) -> None:
        self.i, self.places = i, list(places)
        self.points = [(np.asarray(solved.x, float), 0.0)]
        self.complete = not self.places

    def start(self) -> np.ndarray:
        """Return the x of the next fit, on the line through the last two solutions."""
        (here, _), place = self.points[-1], self.places.pop(0)
        start = here.copy()
        if len(self.points) > 1:
            before, _ = self.points[-2]
            share = (place - here[self.i]) / (here[self.i] - before[self.i])
            start += np.clip(share * (here - before), -1.0, 1.0)
        start[self.i] = place
        return start

    def add(self, x: np.ndarray, rise: float, threshold: float) -> None:
        """Add the solution of a fit. If it ran out of steps, its rise is an upper limit."""
        self.points.append((np.asarray(x, float), rise))
        self.complete = rise > threshold or not self.places


def along_bounds(
    solved: SolvedProblem, minima: np.ndarray, seconds: float
) -> tuple[tuple[AtBound, ...], Uncertainty, np.ndarray | None]:
    """Follow the parameters without error bars, and withhold the error bars that hold at the solution only.

    Parameters
    ----------
    solved : a fit that has converged
    minima : x of other minima, shape (minima, size)
    seconds : time after which no further fit begins

    Returns
    -------
    The result for each parameter, the uncertainty without the error bars that do not hold, and the x of a
    solution with a lower cost, or None.
    """
    known, names = solved.uncertainty, solved.names
    linear = solved.problem.structure.loss == "linear"
    which = sorted(
        (i for i in range(len(names)) if names[i] in known.withheld), key=lambda i: _rank(solved, i)
    )
    which, bounds, reasons = which[:_FOLLOWED], [], {}
    paths = _follow(solved, which, seconds) if linear else [None] * len(which)
    for i, path in zip(which, paths, strict=True):
        where = known.withheld[names[i]].split(", see")[0]
        if path is None:
            others = _correlated(known, i)
            bounds.append(_unknown(solved, i, where, others))
        else:
            lowest = int(np.argmin(path.rise))
            if _is_lower(solved, path.rise[lowest]):
                return (), known, path.x[lowest]
            bounds.append(_at_bound(solved, i, where, path))
            others = [names.index(name) for name in bounds[-1].intervals if name not in known.withheld]
        value = f"{names[i]} = {bounds[-1].value:.4g}"
        reasons |= {names[j]: f"holds only at {value}, see [[Bounds]]" for j in others}
    reasons = _missed_by_minima(solved, minima) | reasons if linear else reasons
    return tuple(bounds), without_bars(known, names, reasons), None


def _missed_by_minima(solved, minima):
    """Return reasons, by name, to withhold error bars that exclude another minimum of similar cost."""
    rises = 2 * (costs_at(solved.problem, minima) - solved.cost) if len(minima) else np.zeros(0)
    reasons = {}
    for x, rise in sorted(zip(minima, rises, strict=True), key=lambda pair: -pair[1]):
        if rise < solved.quantile(LEVEL) ** 2:
            path = _Path(np.stack([solved.x, x]), np.array([0.0, rise]), True)
            low, high = _union(solved, None, path, solved.quantile(LEVEL))
            values = solved.problem.values(x)
            for j in np.flatnonzero(_misses(solved, low, high)):
                text = f"a minimum of chi-square {rise:+.2g} has {values[j]:.4g}"
                reasons[solved.names[j]] = text
    return reasons


def _misses(solved, low, high):
    """Return True for elements with an error bar that misses a considerable part of low ... high, in x."""
    reach = solved.quantile(LEVEL) * solved.uncertainty.deviation
    with np.errstate(invalid="ignore"):
        return np.maximum(solved.x - reach - low, high - solved.x - reach) > _TOLERATED * reach


def _rank(solved, i):
    """Return a key that sorts parameters at a bound before unidentified parameters."""
    return (solved.withheld[solved.names[i]].startswith("not identified"), i)


def without_bars(known: Uncertainty, names: tuple[str, ...], reasons: dict[str, str]) -> Uncertainty:
    """Return the uncertainty with further error bars withheld, for `reasons` by name."""
    hidden, both = np.array([name in reasons for name in names]), reasons | known.withheld
    covariance, correlation = np.array(known.covariance), np.array(known.correlation)
    for array in (covariance, correlation):
        array[hidden, :] = array[:, hidden] = np.nan
    return known._replace(
        deviation=np.where(hidden, np.nan, known.deviation),
        covariance=covariance,
        correlation=correlation,
        withheld={name: both[name] for name in names if name in both},
    )


def _places(solved, i):
    """Return the x below and above the solution at which element i is held, nearest first."""
    problem, x = solved.problem, float(solved.x[i])
    constants = problem.numbers.constants
    if problem.variables.kinds[i] == "Bounded":
        low, width = np.asarray(constants.low[i]), np.asarray(constants.width[i])
        places = to_x("Bounded", low, width, low + width * np.array(_PLACES))
    elif sides := [side for k, side, _ in edges(problem.variables, constants, solved.x) if k == i]:
        places = np.concatenate(
            [x + np.array(_AWAY) * (1 if which_side == "lower" else -1) for which_side in sides]
        )
    elif solved.uncertainty.stretch[i] != 1:
        places = problem.start[i] + np.log(_FROM_ZERO)
    else:
        places = x + np.array([*_STEPS, *(-step for step in _STEPS)])
    there = np.tile(np.asarray(solved.x, float), (len(places), 1))
    there[:, i] = places
    places = np.unique(put_in_order(problem.variables, constants, there, np.ones_like(there))[:, i])
    places = places[np.abs(places - x) > _NEAREST]
    # Implausible values are not of interest, except between the solution and plausible values.
    there = np.tile(np.asarray(solved.x, float), (len(places) + 1, 1))
    there[:-1, i] = places
    name, values = solved.names[i], problem.values(there)[:, i]
    bad = np.array([bool(implausible([name], np.array([value]))) for value in values])
    places = places if bad[-1] else places[~bad[:-1]]
    return np.sort(places[places < x])[::-1], np.sort(places[places > x])


def _follow(solved, which, seconds):
    """Return the `_Path` along each of the elements `which`, or None if not a single fit ended.

    All sides of all elements advance together, because fits side by side share calls of compiled functions.
    A solution with a lower cost ends the search.
    """
    problem, threshold, end = solved.problem, solved.quantile(LEVEL) ** 2, time.monotonic() + seconds

    def check(*_):
        if time.monotonic() > end:
            raise KeyboardInterrupt  # ends `run_fits`

    sides = [_Side(solved, i, places) for i in which for places in _places(solved, i)]
    begun = [side for side in sides if not side.complete]
    lowest = np.inf
    while begun and time.monotonic() < end and not _is_lower(solved, lowest):
        starts = np.array([side.start() for side in begun], problem.start.dtype)
        held = np.array([[side.i] for side in begun])
        moving = (np.arange(starts.shape[1]) != held).astype(starts.dtype)
        targets = problem.targets.of_several(moving=moving)
        runs = run_fits(NEAR_MINIMUM, problem, starts, targets, _MOST, check)
        rises = 2 * (runs.cost - solved.cost)
        ended = np.isfinite(rises) & ~was_interrupted(runs.status)
        for k in np.flatnonzero(ended):
            begun[k].add(runs.x[k], float(rises[k]), threshold)
        if was_interrupted(runs.status).any():  # by `check`, or from the keyboard
            break
        lowest = np.min(rises, where=ended, initial=lowest)
        begun = [begun[k] for k in np.flatnonzero(ended) if not begun[k].complete]
    return [_path(i, [side for side in sides if side.i == i]) for i in which]


def _is_lower(solved, rise):
    """Return True if a rise of chi-square is negative, by more than a negligible gain of the cost."""
    return rise < -2 * negligible(solved.cost)


def _path(i, sides):
    """Return the `_Path` of both sides of element i, or None if no fit along it has ended."""
    points = sides[0].points + [point for side in sides[1:] for point in side.points[1:]]
    if len(points) == 1:
        return None
    points.sort(key=lambda point: point[0][i])
    x, rise = (np.array(part) for part in zip(*points, strict=True))
    return _Path(x, rise, all(side.complete for side in sides))


def _at_bound(solved, i, where, path):
    """Return the `AtBound` of element i, with intervals of parameters whose error bar misses a part."""
    q, names = solved.quantile(LEVEL), solved.names
    low, high = _union(solved, i, path, q)
    missed, bare = _misses(solved, low, high), ~np.isfinite(solved.uncertainty.deviation)
    bare &= (high - low < _WIDE) & (np.arange(solved.x.size) != i)
    values = solved.problem.values(np.stack([low, high]))
    held = solved.problem.values(path.x)[:, i]
    return AtBound(
        name=names[i],
        value=float(solved.problem.values(solved.x)[i]),
        where=where,
        held=tuple(held.tolist()),
        rises=tuple(path.rise.tolist()),
        interval=(float(values[0, i]), float(values[1, i])),
        complete=path.complete,
        intervals={
            names[j]: (float(values[0, j]), float(values[1, j])) for j in np.flatnonzero(missed | bare)
        },
    )


def _union(solved, i, path, q):
    """Return the ends in x of the intervals of all parameters, as in the module's docstring.

    Element i is held along the path; None: the path consists of minima.
    """
    of = padded(solved.problem)
    accepted = np.flatnonzero(path.rise < q**2)
    _, slopes = evaluate_rows(
        of.structure, of.numbers, path.x[accepted].astype(solved.problem.start.dtype), slopes=True
    )
    low, high = np.full(solved.x.size, np.inf), np.full(solved.x.size, -np.inf)
    others = np.arange(solved.x.size) != i
    for k, slope in zip(accepted, slopes, strict=True):
        reach = np.zeros(solved.x.size)
        reach[others] = _deviations(errors_of_slopes(of, slope)[:, others])
        reach *= np.sqrt(q**2 - max(path.rise[k], 0.0))
        low, high = np.minimum(low, path.x[k] - reach), np.maximum(high, path.x[k] + reach)
    # Between an accepted and a rejected solution the root of the rise is nearly linear.
    for k in accepted:
        for n in (k - 1, k + 1):
            if i is not None and 0 <= n < len(path.rise) and path.rise[n] >= q**2:
                first, second = np.sqrt(np.maximum(path.rise[[k, n]], 0.0))
                end = path.x[k] + (q - first) / (second - first) * (path.x[n] - path.x[k])
                low, high = np.minimum(low, end), np.maximum(high, end)
    return low, high


def _deviations(jacobian):
    """Return standard deviations of x, at most `OPEN`."""
    _, s, Vt = np.linalg.svd(jacobian, full_matrices=False)
    length = 1 / np.maximum(s, 1 / OPEN)
    return np.sqrt(((Vt.T * length) ** 2).sum(axis=1))


def _correlated(known, i):
    """Return the elements with error bars that are correlated with element i, which has none."""
    size = np.sqrt(np.diag(known.spread))
    correlation = np.abs(known.spread[i] / (size[i] * size))
    return [j for j in np.flatnonzero(correlation > _CORRELATED) if np.isfinite(known.deviation[j])]


def _unknown(solved, i, where, others):
    value = float(solved.problem.values(solved.x)[i])
    nothing = {solved.names[j]: (np.nan, np.nan) for j in others}
    return AtBound(solved.names[i], value, where, (value,), (0.0,), (np.nan, np.nan), False, nothing)
