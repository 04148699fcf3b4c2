r"""Shift isothermal sweeps of E' and E'' onto one smooth curve.

Measured data are split into sweeps by temperature and checked. An initial guess compares neighbours; then

.. math:: \min_{a, b, S', S''} \sum_k \left(\frac{\ln E'_k - \ln b_T - S'(\ln a_T\omega_k)}{s'}\right)^2
          + \left(\frac{\ln E''_k - \ln b_T - S''(\ln a_T\omega_k)}{s''}\right)^2

is solved. S' and S'' are cubic splines. Their coefficients enter linearly and are eliminated (variable
projection) [Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413;
Kaufman, BIT 15 (1975) 49].
"""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

from fitting.data.kinds import ModulusData

# Points that a sweep needs, and points of each of two neighbours that must overlap.
_FEWEST, _OVERLAP = 3, 2
# Number of trial shifts, misfit of ln E allowed to a cubic, and the mean square distance in units of the
# scatter beyond which neighbours do not meet.
_TRIED, _BLUR, _CLOSE = 241, 0.01, 12.0
# Fits, each weighted with the scatter that the one before it left; the least scatter.
_FIRST, _ROUNDS, _EXACT = 2, 4, 1e-6
_STEPS = 40  # of each
_SEEN = 1e-11  # squared singular value below which the data do not determine a combination of splines
_LEAST = 0.01  # least part of a squared slope that is not noise
# Knots per decade that are tried.
_KNOTS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)


class Sweep(NamedTuple):
    """E' and E'' over frequency at one temperature."""

    T: float  # mean [K]
    at: np.ndarray  # temperature of every point [K]
    t: np.ndarray  # ln omega
    y: np.ndarray  # ln E' and ln E'', shape (2, points)
    error: np.ndarray | None  # of them, shape (2, points)


def sweeps_of(data: ModulusData | Sequence[ModulusData], same: float) -> list[Sweep]:
    """Return the sweeps in order of temperature; rows within `same` [K] form one sweep.

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
        if group.size < _FEWEST:
            raise ValueError(
                f"the sweep at {T[group].mean():.6g} K has {group.size} points: must have {_FEWEST} at least;"
                f" temperatures within {same:g} K count as one (same=...)"
            )
        errors = None if error is None else error[:, group]
        found.append(Sweep(float(T[group].mean()), T[group], t[group], y[:, group], errors))
    return found


def _rows(i, one):
    """Return the temperature, ln omega, ln E and its error of one data set."""
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
    """Return ln a_T of every sweep, 0 of the first: where each comes closest to its colder neighbour.

    Minimises the mean square distance of ln E' and ln E'' to a cubic through the other sweep over all shifts
    with shared points. The unit is the scatter about the sweep's own cubic, or the given error if larger.
    ValueError with the temperatures and distance of neighbours that do not meet at any shift.
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
    """Return cubics through ln E' and ln E'' over ln omega, and errors: the larger of scatter and given."""
    degree = min(3, sweep.t.size - 2)
    found = [np.polynomial.Polynomial.fit(sweep.t, y, degree) for y in sweep.y]
    rest = [np.sum((y - p(sweep.t)) ** 2) for y, p in zip(sweep.y, found, strict=True)]
    variance = np.array(rest) / (sweep.t.size - degree - 1)
    if sweep.error is not None:
        variance = np.maximum(variance, np.mean(sweep.error**2, axis=1))
    return found, np.sqrt(variance)


def _distance(cold, warm, by, cubics, s):
    """Return the mean square distance after the shift in units of the scatter; inf without overlap."""
    low, high = max(cold.t.min(), warm.t.min() + by), min(cold.t.max(), warm.t.max() + by)
    total, count = 0.0, 0
    for one, other, moved in ((cold, cubics[1], by), (warm, cubics[0], -by)):
        at = one.t if moved == by else one.t + by
        shared = (at >= low) & (at <= high)
        if shared.sum() < _OVERLAP:
            return np.inf
        for y, p, scatter in zip(one.y, other, s, strict=True):
            total += float(np.sum(((y[shared] - p(one.t[shared] - moved)) / scatter) ** 2))
            count += int(shared.sum())
    # Few points are met by chance.
    return total / count + 2 / np.sqrt(count)


def _apart(cold, warm, distance, s):
    """Return the message on neighbours that do not meet at any shift."""
    where = f"the sweeps at {cold.T:.6g} and {warm.T:.6g} K do not"
    if cold.y[0].min() > warm.y[0].max() or warm.y[0].min() > cold.y[0].max():
        return (
            f"{where} overlap: E' of one is {_range(cold)}, of the other {_range(warm)}; measure between"
            " them, or over more frequencies"
        )
    if not np.isfinite(distance):
        return f"{where} share {_OVERLAP} points of each at any shift: must; measure at more frequencies"
    unit = "the scatter" if cold.error is None else "the larger of scatter and given errors"
    return (
        f"{where} meet: at the best shift the mean square distance of ln E' and ln E'' is {distance:.3g} in"
        f" units of {unit} (E' {s[0]:.2g}, E'' {s[1]:.2g}), must be < {_CLOSE:g}; give errors (relative=...)"
        " if moduli are less certain than that, or leave one sweep out"
    )


def _range(sweep):
    return f"{np.exp(sweep.y[0].min()):.3g} ... {np.exp(sweep.y[0].max()):.3g} Pa"


def check_overlap(sweeps: list[Sweep], log_a: np.ndarray) -> None:
    """Raise ValueError naming neighbours that share less than two points of each, once they are shifted."""
    for i, (cold, warm) in enumerate(itertools.pairwise(sweeps)):
        one, other = cold.t + log_a[i], warm.t + log_a[i + 1]
        low, high = max(one.min(), other.min()), min(one.max(), other.max())
        slack = 1e-9
        shared = [int(np.sum((x >= low - slack) & (x <= high + slack))) for x in (one, other)]
        if min(shared) < _OVERLAP:
            raise ValueError(
                f"the sweeps at {cold.T:.6g} and {warm.T:.6g} K do not overlap: once shifted they share"
                f" {shared[0]} and {shared[1]} points, must be {_OVERLAP} of each; measure between them, or"
                " over more frequencies"
            )


class Shifts(NamedTuple):
    """Shifts of all sweeps; the reference has shift 0 without error."""

    log_a: np.ndarray  # ln a_T, shape (sweeps,)
    log_b: np.ndarray  # ln b_T, shape (sweeps,); 0 without vertical shifts
    covariance: np.ndarray  # of both, shape (2 sweeps, 2 sweeps)
    scatter: tuple[float, float]  # of ln E' and ln E'', estimated; of given errors their median
    redchi: float  # sum of squares by degrees of freedom, 1 where errors are estimated
    t: np.ndarray  # reduced ln omega of all points, sweep by sweep
    smooth: np.ndarray  # the splines there, shape (2, points)


@dataclasses.dataclass(frozen=True, eq=False)
class _Points:
    """All points of all sweeps, and which sweep each is of."""

    t: np.ndarray
    y: np.ndarray  # (2, points)
    error: np.ndarray  # (2, points)
    which: np.ndarray
    reference: int
    vertical: bool
    knots: np.ndarray

    def unpacked(self, x):
        """Return (ln a, ln b) of every sweep."""
        parts = np.split(x, 2) if self.vertical else (x, np.zeros_like(x))
        return [np.insert(part, self.reference, 0.0) for part in parts]

    def projected(self, x, calm=False):
        """Return the residuals at x and their derivatives, projected orthogonally to the splines."""
        log_a, log_b = self.unpacked(x)
        t = self.t + log_a[self.which]
        inside = np.clip(t, self.knots[3], self.knots[-4] * (1 - 1e-12))
        B = BSpline.design_matrix(inside, self.knots, 3).toarray()
        at = np.delete(np.eye(log_a.size), self.reference, axis=1)[self.which]
        rows, slopes, ranks, smooth = [], [], 0, []
        for y, error in zip(self.y, self.error, strict=True):
            weighted = B / error[:, None]
            values, vectors = np.linalg.eigh(weighted.T @ weighted)
            seen = values > _SEEN * values[-1]
            vectors = vectors[:, seen] / np.sqrt(values[seen])
            U = weighted @ vectors
            z = (y - log_b[self.which]) / error
            c = vectors @ (U.T @ z)
            dS = BSpline(self.knots, c, 3).derivative()(inside)
            if calm:
                # Noise makes slopes, too, which would pass for information about the shifts.
                noise = np.sum(BSpline(self.knots, vectors, 3).derivative()(inside) ** 2, axis=1)
                dS = dS * np.sqrt(np.maximum(1 - noise / np.maximum(dS**2, 1e-300), _LEAST))
            J = -at * (dS / error)[:, None]
            if self.vertical:
                J = np.concatenate([J, -at / error[:, None]], axis=1)
            rows.append(z - U @ (U.T @ z))
            slopes.append(J - U @ (U.T @ J))
            smooth.append(B @ c)
            ranks += U.shape[1]
        return np.concatenate(rows), np.concatenate(slopes), ranks, t, np.array(smooth)

    def solved(self, x):
        """Return the shifts of least squares."""
        last: dict[bytes, tuple] = {}

        def both(x):
            if (key := x.tobytes()) not in last:
                last.clear()
                last[key] = self.projected(x)
            return last[key]

        found = least_squares(
            lambda x: both(x)[0],
            x,
            lambda x: both(x)[1],  # pyright: ignore[reportArgumentType]  # the stub knows text only
            xtol=1e-6,
            ftol=1e-8,
            gtol=1e-12,
            max_nfev=_STEPS,
        )
        return found.x


def shifts_of(sweeps: list[Sweep], reference: int, vertical: bool) -> Shifts:
    """Return the shifts of all sweeps onto that with the number `reference`.

    The splines have as many knots as Akaike's criterion (corrected for few points) wants.

    Parameters
    ----------
    sweeps : by rising temperature
    vertical : whether moduli are shifted, too
    """
    log_a = first_shifts(sweeps)
    x = np.delete(log_a - log_a[reference], reference)
    if vertical:
        x = np.concatenate([x, np.zeros(len(sweeps) - 1)])
    tried = [_rounds(sweeps, reference, vertical, knots, x, _FIRST) for knots in _KNOTS]
    best = int(np.argmin([one[2] for one in tried]))
    return _rounds(sweeps, reference, vertical, _KNOTS[best], tried[best][0], _ROUNDS)[1]


def _rounds(sweeps, reference, vertical, per_decade, x, rounds):
    """Return (x, Shifts, criterion) after fits weighted by the scatter of the previous fit."""
    count = len(sweeps)
    T, which = (
        np.array([one.T for one in sweeps]),
        np.repeat(np.arange(count), [one.t.size for one in sweeps]),
    )
    y, t = (np.concatenate([one[k] for one in sweeps], axis=-1) for k in (3, 2))
    drift = np.concatenate([one.at for one in sweeps]) - T[which]
    given = [one.error for one in sweeps if one.error is not None]
    error = np.concatenate(given, axis=1) if given else np.ones_like(y)
    points = _Points(t, y, error, which, reference, vertical, np.empty(0))
    for _ in range(rounds):
        log_a, log_b = points.unpacked(x)
        # Points a little off their sweep's temperature are moved along with the shifts of the others.
        moved = t + drift * np.gradient(log_a, T)[which]
        knots = _knots(moved + log_a[which], per_decade)
        points = dataclasses.replace(points, t=moved, error=error, knots=knots)
        x = points.solved(x)
        r, J, rank, reduced, smooth = points.projected(x)
        freedom = max(r.size - rank - x.size, 1)
        redchi = float(r @ r) / freedom
        squares = np.sum(r.reshape(2, -1) ** 2, axis=1)
        if not given:
            before = error
            error = error * np.maximum(np.sqrt(squares * 2 / freedom), 1e-30)[:, None]
            error = np.maximum(error, _EXACT)
    used = rank + x.size
    penalty = 2 * used * r.size / max(r.size - used - 1, 0.1)
    if given:
        fit = float(squares.sum())
    else:
        fit = float(np.sum(np.log(squares * before[:, 0] ** 2 / y.shape[1] + _EXACT**2)) * y.shape[1])
    log_a, log_b = points.unpacked(x)
    moving = np.delete(np.arange(count), reference)
    moving = np.concatenate([moving, count + moving]) if vertical else moving
    covariance = np.zeros((2 * count, 2 * count))
    J = dataclasses.replace(points, error=error).projected(x, calm=True)[1]
    inner = np.linalg.pinv(J.T @ J, hermitian=True)
    covariance[np.ix_(moving, moving)] = inner
    scatter = (float(np.median(error[0])), float(np.median(error[1])))
    shifts = Shifts(log_a, log_b, covariance, scatter, redchi if given else 1.0, reduced, smooth)
    return x, shifts, fit + penalty


def _knots(t: np.ndarray, per_decade: float) -> np.ndarray:
    """Return the knots of cubic splines over all t, each interval with some points on either side."""
    low, high = t.min(), t.max()
    count = max(int(np.ceil(per_decade * (high - low) / np.log(10))), 1)
    count = min(count, max(t.size // 3, 1))
    inner = np.linspace(low, high, count + 1)
    step = inner[1] - inner[0]
    return np.concatenate([low - step * np.arange(3, 0, -1), inner, high + step * np.arange(1, 4)])
