r"""Shifts that bring sweeps onto one smooth curve.

.. math:: \min_{a, b, S', S''} \sum_k \left(\frac{\ln E'_k - \ln b_T - S'(\ln a_T\omega_k)}{s'}\right)^2
          + \left(\frac{\ln E''_k - \ln b_T - S''(\ln a_T\omega_k)}{s''}\right)^2

S' and S'' are cubic splines, linear in their coefficients: those are eliminated, and the derivatives by the
shifts projected onto what the splines cannot follow [Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413;
Kaufman, BIT 15 (1975) 49].
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import least_squares

from fitting.characterise.master_curve.sweeps import Sweep, first_shifts

# Fits, each weighted with the scatter that the one before it left; the least scatter.
_FIRST, _ROUNDS, _EXACT = 2, 4, 1e-6
_STEPS = 40  # of each
_SEEN = 1e-11  # of a combination of splines, squared: less is no data
_LEAST = 0.01  # of a squared slope that is taken for real
# Knots per decade that are tried.
_KNOTS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)


class Shifts(NamedTuple):
    """Shifts of all sweeps; those of the reference are 0 and have no error."""

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
        """(ln a, ln b) of every sweep."""
        parts = np.split(x, 2) if self.vertical else (x, np.zeros_like(x))
        return [np.insert(part, self.reference, 0.0) for part in parts]

    def projected(self, x, calm=False):
        """Residuals at x and their derivatives, both without what the splines can follow."""
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
        """The shifts of least squares."""
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
    """Shifts of all sweeps onto that with the number `reference`.

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
    """(x, Shifts, criterion) after fits that are each weighted with the scatter that the last one left."""
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
    """Knots of cubic splines over all t, each interval with some points on either side."""
    low, high = t.min(), t.max()
    count = max(int(np.ceil(per_decade * (high - low) / np.log(10))), 1)
    count = min(count, max(t.size // 3, 1))
    inner = np.linspace(low, high, count + 1)
    step = inner[1] - inner[0]
    return np.concatenate([low - step * np.arange(3, 0, -1), inner, high + step * np.arange(1, 4)])
