"""Isothermal sweeps as a laboratory hands them in: sorted out by temperature, checked, with a first guess."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fitting.data.kinds import ModulusData

# Of a sweep's frequencies and moduli: fewer points say nothing about a shift.
FEWEST = 3
ENOUGH = 2  # points of each of two neighbours that must overlap
# Shifts that are tried first; differences of ln E that a cubic may leave; the mean square distance, in units
# of the scatter, beyond which neighbours do not meet.
_TRIED, _BLUR, _CLOSE = 241, 0.01, 12.0


class Sweep(NamedTuple):
    """E' and E'' over frequency at one temperature."""

    T: float  # mean [K]
    at: np.ndarray  # temperature of every point [K]
    t: np.ndarray  # ln omega
    y: np.ndarray  # ln E' and ln E'', shape (2, points)
    error: np.ndarray | None  # of them, shape (2, points)


def sweeps_of(data: ModulusData | Sequence[ModulusData], same: float) -> list[Sweep]:
    """Sweeps of all the data, by rising temperature; rows within `same` [K] of a neighbour belong together.

    ValueError for other data, values <= 0, no temperature, one temperature only, or too short a sweep.
    """
    sets = [data] if isinstance(data, ModulusData) else data
    if not isinstance(sets, list | tuple) or not sets:
        raise ValueError(f"isotherms is a {type(data).__name__}: must be ModulusData, or a list of them")
    rows = [_rows(i, one) for i, one in enumerate(sets)]
    errors = [one[3] for one in rows if one[3] is not None]
    known = [one[3] is not None for one in rows]
    if any(known) and not all(known):
        raise ValueError(f"isotherms[{known.index(False)}] have no errors, others have: must be all or none")
    T, t = np.concatenate([one[0] for one in rows]), np.concatenate([one[1] for one in rows])
    y = np.concatenate([one[2] for one in rows], axis=1)
    error = np.concatenate(errors, axis=1) if errors else None
    order = np.lexsort((t, T))
    groups = np.split(order, np.flatnonzero(np.diff(T[order]) > same) + 1)
    if len(groups) < 2:
        raise ValueError(
            f"isotherms: all are at {T.mean():.6g} K within {same:g} K: must be of two temperatures at least"
        )
    found = []
    for group in groups:
        group = group[np.argsort(t[group], kind="stable")]
        if group.size < FEWEST:
            raise ValueError(
                f"the sweep at {T[group].mean():.6g} K has {group.size} points: must have {FEWEST} at least;"
                f" temperatures within {same:g} K count as one (same=...)"
            )
        errors = None if error is None else error[:, group]
        found.append(Sweep(float(T[group].mean()), T[group], t[group], y[:, group], errors))
    return found


def _rows(i, one):
    """Temperature, ln omega, ln E and its error of one data set."""
    if not isinstance(one, ModulusData):
        raise ValueError(f"isotherms[{i}] is a {type(one).__name__}: must be ModulusData")
    if one.temperature is None:
        raise ValueError(f"isotherms[{i}], {one.label!r}: have no temperature: must have one for every row")
    if not (one.measured > 0).all():
        raise ValueError(f"isotherms[{i}], {one.label!r}: have values <= 0: E' and E'' must be > 0")
    error = one.error
    if error is not None:
        error = (error if one.logarithmic else error / one.measured).reshape(2, -1)
    return one.temperature, np.log(one.omega), np.log(one.measured).reshape(2, -1), error


def first_shifts(sweeps: list[Sweep]) -> np.ndarray:
    """ln a_T of every sweep, 0 of the first: where each comes closest to its colder neighbour.

    Of all shifts at which both share points, that of the least mean square distance of ln E' and ln E'' to a
    cubic through the other's, in units of their scatter about their own cubics or of their given errors, if
    these are larger. ValueError with the temperatures and distance of neighbours that come nowhere close.
    """
    cubics, scatter = zip(*(_cubic(one) for one in sweeps), strict=True)
    log_a = [0.0]
    for i, (cold, warm) in enumerate(itertools.pairwise(sweeps)):
        s = np.sqrt(0.5 * (scatter[i] ** 2 + scatter[i + 1] ** 2) + _BLUR**2)
        # The warmer sweep looks like the colder one at lower frequencies.
        ends = cold.t.min() - warm.t.max(), cold.t.max() - warm.t.min()
        tried = np.linspace(*ends, _TRIED)
        cost = [_distance(cold, warm, by, cubics[i : i + 2], s) for by in tried]
        best = int(np.argmin(cost))
        if not cost[best] < _CLOSE:
            raise ValueError(_apart(cold, warm, cost[best], s))
        log_a.append(log_a[-1] + float(tried[best]))
    return np.array(log_a)


def _cubic(sweep):
    """Cubics through ln E' and ln E'' over ln omega, and errors: the scatter, or those given if larger."""
    degree = min(3, sweep.t.size - 2)
    found = [np.polynomial.Polynomial.fit(sweep.t, y, degree) for y in sweep.y]
    rest = [np.sum((y - p(sweep.t)) ** 2) for y, p in zip(sweep.y, found, strict=True)]
    variance = np.array(rest) / (sweep.t.size - degree - 1)
    if sweep.error is not None:
        variance = np.maximum(variance, np.mean(sweep.error**2, axis=1))
    return found, np.sqrt(variance)


def _distance(cold, warm, by, cubics, s):
    """Mean square distance in units of the scatter, once the warmer sweep is moved; inf without overlap."""
    low, high = max(cold.t.min(), warm.t.min() + by), min(cold.t.max(), warm.t.max() + by)
    total, count = 0.0, 0
    for one, other, moved in ((cold, cubics[1], by), (warm, cubics[0], -by)):
        at = one.t if moved == by else one.t + by
        shared = (at >= low) & (at <= high)
        if shared.sum() < ENOUGH:
            return np.inf
        for y, p, scatter in zip(one.y, other, s, strict=True):
            total += float(np.sum(((y[shared] - p(one.t[shared] - moved)) / scatter) ** 2))
            count += int(shared.sum())
    # Few points are met by chance.
    return total / count + 2 / np.sqrt(count)


def _apart(cold, warm, distance, s):
    """The message on neighbours that do not meet at any shift."""
    where = f"the sweeps at {cold.T:.6g} and {warm.T:.6g} K do not"
    if cold.y[0].min() > warm.y[0].max() or warm.y[0].min() > cold.y[0].max():
        return (
            f"{where} overlap: E' of one is {_range(cold)}, of the other {_range(warm)}; measure between"
            " them, or over more frequencies"
        )
    if not np.isfinite(distance):
        return f"{where} share {ENOUGH} points of each at any shift: must; measure at more frequencies"
    unit = "the scatter" if cold.error is None else "the larger of scatter and given errors"
    return (
        f"{where} meet: at the best shift the mean square distance of ln E' and ln E'' is {distance:.3g} in"
        f" units of {unit} (E' {s[0]:.2g}, E'' {s[1]:.2g}), must be < {_CLOSE:g}; give errors (relative=...)"
        " if moduli are less certain than that, or leave one sweep out"
    )


def _range(sweep):
    return f"{np.exp(sweep.y[0].min()):.3g} ... {np.exp(sweep.y[0].max()):.3g} Pa"


def check_overlap(sweeps: list[Sweep], log_a: np.ndarray) -> None:
    """ValueError naming neighbours that share less than two points of each, once they are shifted."""
    for i, (cold, warm) in enumerate(itertools.pairwise(sweeps)):
        one, other = cold.t + log_a[i], warm.t + log_a[i + 1]
        low, high = max(one.min(), other.min()), min(one.max(), other.max())
        slack = 1e-9
        shared = [int(np.sum((x >= low - slack) & (x <= high + slack))) for x in (one, other)]
        if min(shared) < ENOUGH:
            raise ValueError(
                f"the sweeps at {cold.T:.6g} and {warm.T:.6g} K do not overlap: once shifted they share"
                f" {shared[0]} and {shared[1]} points, must be {ENOUGH} of each; measure between them, or"
                " over more frequencies"
            )
