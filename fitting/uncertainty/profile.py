r"""Profile likelihood of one parameter: the cost over its values, with all others fitted again.

The interval is where twice the cost is less than q^2 above its minimum, q being the normal (or Student's)
quantile. A profile begins as a row of fits about the solution. Three things follow:

- If the parameters of a neighbouring value give a lower cost, the fit is repeated from them. The interval
  refers to the lowest minimum found, which may lie below the fit.
- Each side is extended geometrically until the threshold is crossed, or the parameter is at the end of the
  range that its rule allows, or `FARTHEST` from the fit.
- Near the threshold, values are added until interpolation finds the end.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fitting.solvers.evaluation import costs_at
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.objective import negligible, succeeded, was_interrupted
from fitting.solvers.problem import Problem
from fitting.solvers.runs import Runs, run_fits
from fitting.uncertainty.likelihood_profile import LikelihoodProfile

# How far in x a profile goes: a factor of a million, or to a millionth of the range of a Bounded parameter.
FARTHEST = np.log(1e6)
# A Free parameter, which has no natural range, goes as many times as far as its first row of values.
_FREE = 64.0
# Factor by which the distance from the minimum grows.
_GROWTH = 1.6
# Times that a step is halved after a failed fit. The side is then reported as not found.
_MOST_HALVINGS = 4
# Most values added near the threshold. Interpolation usually meets `_CLOSE` after a few, bisection after ten.
_MOST_NEAR = 30
# Change of slope between neighbours, as a difference of roots. A larger change indicates two branches.
_JUMP = 0.1
# Rise of the root between the neighbours of the threshold, as a part of the threshold. After a larger rise,
# two interpolations may agree that are both wrong.
_COMPARABLE = 0.5
# Accuracy of an end of the interval, relative to its distance from the minimum.
_CLOSE = 0.005


class Anchor(NamedTuple):
    """Solution about which a profile is computed."""

    problem: Problem
    x: np.ndarray
    cost: float
    inside: np.ndarray  # x without parameters at a bound or at zero, see `inside_bounds`


def profile_from(
    anchor: Anchor,
    i: int,
    q: float,
    runs: Runs,
    extend: bool = True,
    callback: Callable[[int, float], object] | None = None,
) -> LikelihoodProfile:
    """Return the profile of element i, given the results `runs` of its first fits, in increasing order.

    q is the square root of the rise of chi-square at the ends of the interval. If `extend`, values are added
    until this threshold is reached.
    """
    trace = _Trace(anchor, i, runs, callback)
    trace.mend()
    trace.descend()
    ends = tuple(_end(trace, side, q, extend) for side in (-1, 1))
    # The added values may have found a lower minimum, which moves both ends.
    if trace.descend():
        ends = tuple(_end(trace, side, q, extend) for side in (-1, 1))
    return _told(trace, q, ends)


class _Trace:
    """Fits of a profile, sorted by the x of the profiled element."""

    def __init__(self, anchor, i, runs, callback):
        self.anchor, self.i, self.callback = anchor, i, callback
        self.kind = anchor.problem.variables.kinds[i]
        self.stopped = bool(was_interrupted(runs.status).any())
        self.x, self.cost = np.array(runs.x, float), np.array(runs.cost, float)
        self.good = succeeded(runs.status)
        self.better = None  # the lowest minimum, (x, cost), if it is not the anchor
        k = int(np.argmin(np.abs(self.at - anchor.x[i])))
        if self.at[k] != anchor.x[i]:
            self._append(anchor.x[None], anchor.cost, True)
        elif not self.good[k] or self.cost[k] > anchor.cost:
            self.x[k], self.cost[k], self.good[k] = anchor.x, anchor.cost, True

    @property
    def at(self):
        """x of the profiled element in all fits, in increasing order."""
        return self.x[:, self.i]

    @property
    def lowest(self):
        return min(self.anchor.cost, self.cost[self.good].min(initial=np.inf))

    @property
    def best(self):
        """Index of the fit with the lowest cost among the fits that converged."""
        return int(np.argmin(np.where(self.good, self.cost, np.inf)))

    def root(self):
        """Return the root, nearly linear in x, of the rise of twice the cost; NaN for failed fits."""
        with np.errstate(invalid="ignore"):
            rise = np.maximum(2 * (self.cost - self.lowest), 0.0)
        return np.sqrt(np.where(self.good, rise, np.nan))

    def add(self, starts, free=False):
        """Return the results of fits from `starts`, with the profiled element fixed unless `free`."""
        problem, size = self.anchor.problem, self.x.shape[1]
        moving = np.ones((1, size)) if free else (np.arange(size) != self.i).astype(float)[None]
        targets = problem.targets.of_several(moving=moving.astype(problem.start.dtype))
        starts = self.off_bounds(np.asarray(starts, problem.start.dtype))
        runs = run_fits(LevenbergMarquardt(), problem, starts, targets, None, self.callback)
        self.stopped |= bool(was_interrupted(runs.status).any())
        return runs

    def off_bounds(self, starts):
        """Return starts from which parameters that are at a bound at the anchor can leave it."""
        x, inside = self.anchor.x, self.anchor.inside
        moved = np.where(inside < x, np.minimum(starts, inside), np.maximum(starts, inside))
        others = (inside != x) & (np.arange(x.size) != self.i)
        return np.where(others, moved, starts)

    def include(self, runs):
        """Add the results of fits to the profile."""
        self._append(runs.x, runs.cost, succeeded(runs.status))

    def _append(self, x, cost, good):
        self.x, self.cost = np.concatenate([self.x, x]), np.append(self.cost, cost)
        self.good, order = np.append(self.good, good), np.argsort(self.at, kind="stable")
        self.x, self.cost, self.good = self.x[order], self.cost[order], self.good[order]

    def mend(self):
        """Repeat a fit if the parameters of a neighbouring fit give a lower cost."""
        if self.is_smooth():
            return
        # A lower branch is passed on from neighbour to neighbour.
        for _ in range(len(self.x)):
            pairs = [(k, n) for k in range(len(self.x)) for n in (k - 1, k + 1) if 0 <= n < len(self.x)]
            pairs = [(k, n) for k, n in pairs if self.good[n]]
            if self.stopped or not pairs:
                return
            starts = np.array([self.x[n] for _, n in pairs])
            starts[:, self.i] = [self.at[k] for k, _ in pairs]
            costs, chosen = costs_at(self.anchor.problem, starts), {}
            for row, (k, _) in enumerate(pairs):
                worse = not self.good[k] or costs[row] < self.cost[k] - negligible(self.cost[k])
                if np.isfinite(costs[row]) and worse and (k not in chosen or costs[row] < costs[chosen[k]]):
                    chosen[k] = row
            if not chosen:
                return
            runs = self.add(starts[list(chosen.values())])
            mended = False
            for place, k in enumerate(chosen):
                if succeeded(runs.status[place]) and (not self.good[k] or runs.cost[place] < self.cost[k]):
                    self.x[k], self.cost[k], self.good[k] = runs.x[place], runs.cost[place], True
                    mended = True
            if not mended:
                return

    def is_smooth(self):
        """Return True if the signed root of the rise has no kinks, as with a single branch of minima."""
        root = self.root()
        signed = np.where(np.arange(root.size) < self.best, -root, root)
        steps = np.diff(signed) / np.diff(self.at)
        return bool(np.all(np.abs(np.diff(steps)) * np.diff(self.at)[1:] < _JUMP))

    def descend(self):
        """Fit all parameters again from a fit with a cost below the known minimum; True if there is one."""
        known = self.anchor.cost if self.better is None else self.better[1]
        k = self.best
        if self.stopped or self.cost[k] >= known - negligible(known):
            return False
        runs = self.add(self.x[k : k + 1], free=True)
        lower = bool(succeeded(runs.status[0])) and runs.cost[0] <= self.cost[k]
        self.better = (runs.x[0], float(runs.cost[0])) if lower else (self.x[k], float(self.cost[k]))
        if lower:
            self.include(runs)
            self.mend()
        return True

    @property
    def scale(self):
        """Change of x that is large, also where the minimum is far away, at a bound."""
        return np.inf if self.kind == "Free" else 1.0

    def range(self):
        """Return the lowest and the highest x of the profiled element that a profile may reach."""
        here, reach = float(self.anchor.x[self.i]), FARTHEST
        if self.kind == "Bounded":
            return min(-FARTHEST, here), max(FARTHEST, here)
        if self.kind == "Free":
            reach = max(FARTHEST, _FREE * float(np.max(np.abs(self.at - here))))
        return here - reach, max(here, float(self.anchor.inside[self.i])) + reach


def _outermost(trace, side, q):
    """Return the index of the last value below the threshold on one side, and of the next value or None."""
    order = np.arange(trace.best, len(trace.x)) if side > 0 else np.arange(trace.best, -1, -1)
    order = order[trace.good[order]]
    below = np.flatnonzero(trace.root()[order] < q)
    last = int(below[-1])
    return int(order[last]), int(order[last + 1]) if last + 1 < order.size else None


def _end(trace, side, q, extend):
    """Return x at one end of the interval, and "reached" or the reason why the end was not reached."""
    if not trace.good.any():
        return np.nan, "not found: no fit converged"
    limit = trace.range()[side > 0]
    shorter = 0
    while True:
        inner, outer = _outermost(trace, side, q)
        if outer is not None or not extend or trace.stopped or shorter >= _MOST_HALVINGS:
            break
        here, distance = trace.at[inner], abs(trace.at[inner] - trace.at[trace.best])
        if side * (limit - here) <= 1e-9 * max(1.0, abs(limit)):
            break
        others = np.sort(np.abs(trace.at[trace.good] - here))
        step = max((_GROWTH - 1) * distance, others[1] if others.size > 1 else 1e-3) / 2**shorter
        target = here + side * min(step, side * (limit - here))
        runs = trace.add([_ahead(trace, inner, side, target)])
        if succeeded(runs.status[0]):
            trace.include(runs)
            shorter = 0
        else:
            shorter += 1
    if outer is None:
        return _left_open(trace, side, q, inner, extend, shorter)
    # No values are added if the caller gave values.
    return _approach(trace, side, q) if extend else _crossing(trace, side, q)[0], "reached"


def _ahead(trace, inner, side, target):
    """Return the start of a fit on the line through the last two values; others change by at most 1 in x."""
    start, before = trace.x[inner].copy(), inner - side
    if 0 <= before < len(trace.x) and trace.good[before]:
        change = trace.x[inner] - trace.x[before]
        span = change[trace.i]
        if span:
            start += np.clip(change * (target - start[trace.i]) / span, -1.0, 1.0)
    start[trace.i] = target
    return start


def _crossing(trace, side, q):
    """Return two estimates of the x at which the root of the rise of chi-square reaches q.

    They are from a parabola through three values and a line through two, or from the line and inf.
    """
    inner, outer = _outermost(trace, side, q)
    root, x = trace.root(), trace.at
    line = x[inner] + (q - root[inner]) / (root[outer] - root[inner]) * (x[outer] - x[inner])
    before = inner - side
    if not (0 <= before < len(x) and root[before] < root[inner]):
        return line, np.inf
    known = np.array([before, inner, outer])
    # The parabola x(root): weights of Lagrange's interpolation.
    weights = [np.prod([(q - root[m]) / (root[k] - root[m]) for m in known if m != k]) for k in known]
    curve = float(np.dot(weights, x[known]))
    low, high = sorted((x[inner], x[outer]))
    # Next to a bound the root does not change with x, and no parabola describes it.
    return (curve, line) if low < curve < high else (line, np.inf)


def _approach(trace, side, q):
    """Add values near the threshold until interpolation finds x at the threshold, and return this x."""
    last, width = np.inf, np.inf
    for turn in range(_MOST_NEAR):
        curve, line = _crossing(trace, side, q)
        enough = _CLOSE * min(abs(curve - trace.at[trace.best]), trace.scale)
        inner, outer = _outermost(trace, side, q)
        before, width = width, abs(trace.at[outer] - trace.at[inner])
        rise = float(np.diff(trace.root()[[inner, outer]])[0])
        agrees = abs(curve - (line if turn == 0 else last)) <= enough and rise < _COMPARABLE * q
        if trace.stopped or agrees or rise < _CLOSE * q:
            break
        part = (curve - trace.at[inner]) / (trace.at[outer] - trace.at[inner])
        # Bisection where interpolation gains little.
        part = float(np.clip(part, 0.1, 0.9)) if width < 0.5 * before else 0.5
        runs = trace.add([trace.x[inner] + part * (trace.x[outer] - trace.x[inner])])
        if not succeeded(runs.status[0]):
            break
        trace.include(runs)
        last = curve
    return curve


def _left_open(trace, side, q, inner, extend, shorter):
    """Return the end of a profile that stays below its threshold, and the reason as text."""
    value = trace.anchor.problem.values(trace.x[inner])[trace.i]
    rise = trace.root()[inner] ** 2
    tried = f"chi-square rises by {rise:.4g}, less than {q**2:.4g}, at {value:.6g}"
    if trace.stopped:
        return np.nan, f"not found: interrupted; {tried}"
    if not extend:
        return np.nan, f"not reached by the values given: {tried}"
    if shorter >= _MOST_HALVINGS:
        return np.nan, f"not found: fits beyond did not converge; {tried}"
    where = {"Bounded": "a millionth of its range from its bound", "Positive": "a factor of 1e6 from the fit"}
    before = trace.root()[inner - side] ** 2 if 0 <= inner - side < len(trace.x) else np.nan
    there = trace.anchor.problem.values(trace.x[inner - side])[trace.i]
    return side * np.inf, (
        f"open: {tried}, the last value tried, {where.get(trace.kind, 'as far as a profile goes')}"
        f" (by {before:.4g} at {there:.6g})"
    )


def _told(trace, q, ends):
    anchor, i, names = trace.anchor, trace.i, trace.anchor.problem.names
    at = np.where(np.arange(anchor.x.size) == i, np.array([[x] for x, _ in ends]), anchor.x)
    low, high = anchor.problem.values(at)[:, i].tolist()
    better, warning = None, ""
    if trace.better is not None:
        x, cost = trace.better
        better = dict(zip(names, anchor.problem.values(x).tolist(), strict=True))
        values = ", ".join(f"{name} = {value:.6g}" for name, value in better.items())
        warning = (
            f"the fit is not at the lowest minimum: cost {cost:.6g} instead of {anchor.cost:.6g} with"
            f" {values}; the interval refers to that minimum; continue with"
            " fitting.fit(scene.replace(profile.better), data, free)"
        )
    texts = [text for _, text in ends]
    inside = trace.good & (trace.at > ends[0][0]) & (trace.at < ends[1][0])
    if np.any(trace.root()[inside] >= q):
        apart = "the interval is not connected: within it chi-square rises above the threshold"
        warning += "; " * bool(warning) + apart
    values = anchor.problem.values(trace.x)
    rise = trace.root() ** 2
    return LikelihoodProfile(
        names[i], values[:, i], rise, low, high, q**2, names, values, (texts[0], texts[1]), better, warning
    )
