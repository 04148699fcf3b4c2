r"""Shift isothermal sweeps of E' and E'' onto one smooth curve.

The model of point k in the sweep s at temperature T_s is

.. math:: \ln E'_k = S'(\ln a_s + \ln\omega_k) + \ln b_s + u'_s + e'_k

and the same for E''. S' and S'' are cubic splines with a penalty on their second differences, u' and u'' are
offsets that the sweeps do not share, and e' and e'' scatter. The phase error of an instrument adds
phase^2 tan^2(delta) to the variance of ln E' and phase^2 / tan^2(delta) to the variance of ln E''.
E' and E'' of a glass hardly determine shifts. A prior therefore limits the change of the slope of ln a_T over
temperature between neighbouring sweeps to about 30 %. Coefficients and offsets enter linearly and are
eliminated (variable projection) [Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413]. Gauss-Newton steps
find the shifts. The variances and the penalty maximise the restricted likelihood [Wood & Fasiolo, Biometrics
73 (2017) 1071, doi:10.1111/biom.12666].
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline

from fitting.characterise.sweeps import Sweep, first_shifts
from rubberfric import Entropic
from rubberfric.materials import log_factors

# Phase error [rad] and offsets of ln E' and ln E'' that the initial guesses assume.
_GUESSES = (0.003, (0.02, 0.02)), (0.03, (0.002, 0.02))
_KNOTS = 2.5  # knots per decade
_ROUNDS = 50  # most iterations from the best initial guess
_HOLD = 6  # iterations with fixed variances, in which the shifts approach their values
_SCREEN = 14  # iterations from each initial guess, after which their misfits are compared
_OFFSET = 0.01  # expected offset of ln E of a sweep
_BELIEF = 20.0  # weight of the expected offset, as a number of sweeps
_STIFFEST = 300.0  # largest penalty; beyond it sharp bends pass for offsets
_UNEVEN = 0.3  # standard deviation of the change of d ln a_T / dT from sweep to sweep, relative to the slope
_PHASE = (1e-4, 0.1)  # range of the phase error [rad]
_EXACT = 1e-5  # least scatter of ln E
_OUTLIER = 4.0  # standard deviations beyond which a point loses weight
ENTROPIC = Entropic(6e-4)  # vertical shift "entropic", with the thermal expansion of a typical rubber
# Standard deviation of m in the unknown factor (T/T_ref)^m of b_T = 1. A larger one widens the error bars.
_POWER_OF_ONE = 0.25
# Standard deviation of m in the unknown factor (T/T_ref)^m of the entropic b_T.
_POWER_OF_ENTROPIC = 0.3
# Decrease of -2 ln(likelihood) above which data need a factor near the entropic b_T. Chance gives as much in
# 0.5 % of cases.
_GAIN = 8.0
_FREE = 0.3  # standard deviation of free ln b_T


class Shifts(NamedTuple):
    """Shifts of all sweeps, and the smooth curve through the shifted sweeps.

    The shift of the reference sweep is 0 and has no error.
    """

    log_a: np.ndarray  # ln a_T, shape (sweeps,)
    log_b: np.ndarray  # ln b_T, shape (sweeps,); 0 without vertical shifts
    covariance: np.ndarray  # of ln a_T and ln b_T, shape (2 sweeps, 2 sweeps), with temperature errors
    scatter: tuple[float, float]  # of ln E' and ln E'', estimated, or the median of the given errors
    phase: float  # phase error [rad]
    offset: tuple[float, float]  # standard deviation of the offsets of ln E' and ln E''
    hidden: np.ndarray  # ln b_T that the curve allows for in addition to log_b, shape (sweeps,)
    scaled: bool  # True if moduli are not shifted, but change with a power of about T
    redchi: float  # sum of squares / degrees of freedom; 1 if errors are estimated
    t: np.ndarray  # reduced ln omega of all points, sweep by sweep
    smooth: np.ndarray  # the splines at t, shape (2, points)
    bad: np.ndarray  # True for points <= 0 or beyond 4 standard deviations, shape (2, points)
    correlated: np.ndarray  # number of points equivalent to one independent point, shape (2,)
    knots: np.ndarray  # of both splines, ln omega
    splines: np.ndarray  # their coefficients, shape (2, n)
    covariances: np.ndarray  # of (coefficients, ln a_T) without errors of temperature, shape (2, m, m)

    def curve(self, t: np.ndarray) -> np.ndarray:
        """Return ln E' and ln E'' of the smooth curve at the reduced ln omega t, shape (2, points)."""
        inside = np.clip(t, self.knots[3], self.knots[-4] - 1e-9)
        return np.array([BSpline(self.knots, c, 3)(inside) for c in self.splines])

    def offsets(self, residuals: np.ndarray, of_sweep: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the means of residuals, shape (2, points), over each sweep, and their standard errors.

        Bad points are left out, and so is `hidden`, the vertical shift that the curve allows for. `of_sweep`
        is the index of the sweep of each point. The results have the shape (2, sweeps).
        """
        rest = np.where(self.bad, np.nan, residuals - self.hidden[of_sweep])
        sweeps = [rest[:, of_sweep == i] for i in range(self.log_a.size)]
        count = np.transpose([np.maximum(np.isfinite(own).sum(axis=1), 1) for own in sweeps])
        errors = np.array(self.scatter)[:, None] * np.sqrt(self.correlated[:, None] / count)
        return np.stack([np.nanmean(own, axis=1) for own in sweeps], axis=1), errors


@dataclasses.dataclass
class _Superposition:
    """Points, variances and shifts of the sweeps, which the iterations of the fit update."""

    sweeps: Sequence[Sweep]
    reference: int
    x: np.ndarray  # ln a_T
    vertical: np.ndarray  # factors of the coefficients of ln b of every sweep, shape (sweeps, coefficients)
    wide: float  # standard deviation of the coefficients
    phase: float  # initial guess of the phase error [rad]

    def __post_init__(self):
        sweeps, n = self.sweeps, len(self.sweeps)
        self.T = np.array([sweep.T for sweep in sweeps])
        self.which = np.repeat(np.arange(n), [sweep.t.size for sweep in sweeps])
        self.measured = np.concatenate([sweep.t for sweep in sweeps])
        self.drift = np.concatenate([sweep.at for sweep in sweeps]) - self.T[self.which]
        y = np.concatenate([sweep.y for sweep in sweeps], axis=1)
        self.ok = np.isfinite(y)
        self.y = np.where(self.ok, y, 0.0)
        tan = np.clip(np.where(self.ok.all(axis=0), np.exp(self.y[1] - self.y[0]), 0.1), 1e-3, 1e3)
        self.by_phase = np.array([tan**2, tan**-2])
        self.each = sparse.csr_array(np.eye(n)[self.which])
        self.moving = np.delete(np.arange(n), self.reference)
        errors = [sweep.error for sweep in sweeps if sweep.error is not None]
        self.errors = np.concatenate(errors, axis=1) if errors else None
        self.sigma2, self.phase2 = np.array([0.01, 0.02]) ** 2, self.phase**2
        self.tau2, self.penalty, self.inflation = np.full(2, _OFFSET**2), np.full(2, 30.0), np.ones(2)
        self.weight = self.ok.astype(float)
        self.x = self.x - self.x[self.reference]
        slopes = np.diff(np.eye(n), axis=0) / np.diff(self.T)[:, None]
        level = _UNEVEN * np.abs(slopes @ self.x) + 1e-3
        self.bends = np.diff(slopes, axis=0) / np.maximum(level[1:], level[:-1])[:, None]

    def variance(self):
        """Return the variance of every ln E' and ln E'', shape (2, points)."""
        return self.sigma2[:, None] + self.phase2 * self.by_phase if self.errors is None else self.errors**2

    def curve(self, x):
        """Solve for the splines, offsets and coefficients of ln b_T at fixed shifts x = ln a_T."""
        t = self.measured + x[self.which]
        inside = np.clip(t, self.knots[3] + 1e-9, self.knots[-4] - 1e-9)
        B = BSpline.design_matrix(inside, self.knots, 3)
        X: Any = sparse.hstack([B, self.each, sparse.csr_array(self.vertical[self.which])], format="csr")
        b, v = self.knots.size - 4, self.vertical.shape[1]
        q = b + len(self.sweeps)
        D = np.diff(np.eye(b), 2, axis=0)
        prior = np.zeros((2, q + v, q + v))
        # The last term keeps coefficients finite where a penalty of 2 differences leaves a straight line.
        prior[:, :b, :b] = self.penalty[:, None, None] * (D.T @ D) + 1e-8 * np.eye(b)
        prior[:, range(b, q), range(b, q)] = 1 / self.tau2[:, None]
        prior[:, range(q, q + v), range(q, q + v)] = 0.5 * self.wide**-2  # half of the common prior
        w = self.weight / self.variance() / self.inflation[:, None]
        H = np.array([_normal(X, weights) for weights in w]) + prior
        c = solve_blocks(H, (X.T @ (w * self.y).T).T, q)
        r = self.y - (X @ c.T).T
        slope = np.array([BSpline(self.knots, spline, 3).derivative()(inside) for spline in c[:, :b]])
        bends = self.bends @ x
        objective = float(np.sum(w * r**2) + np.einsum("ki,kij,kj", c, prior, c) + bends @ bends)
        return _Curve(objective, H, c, r, slope, w, X, D, t)

    def bordered(self, curve):
        """Return the covariance of all unknowns, the Gauss-Newton step of the shifts, and the Jacobian.

        The covariance, shape (2, m, m), is of the coefficients of ln E' or ln E'', followed by the shifts.
        The Jacobian contains the derivatives of the model with respect to the shifts. `curve` is the `_Curve`
        at the present shifts.
        """
        J = [self.each[:, self.moving].multiply(slope[:, None]) for slope in curve.slope]
        size, bends = curve.c.shape[1], self.bends[:, self.moving]
        H = np.array(
            [_normal(sparse.hstack([curve.X, columns]), w) for columns, w in zip(J, curve.w, strict=True)]
        )
        H[:, :size, :size] = curve.H
        # Half of the prior, for each modulus; the last term keeps shifts within 100 e-folds.
        H[:, size:, size:] += 0.5 * (bends.T @ bends + 1e-4 * np.eye(self.moving.size))
        C = invert_blocks(H, size - self.vertical.shape[1])
        right = sum(columns.T @ r for columns, r in zip(J, curve.w * curve.r, strict=True))
        right -= bends.T @ (self.bends @ self.x)
        return C, C[0, size:, size:] @ right, J

    def iterate(self, update):
        """Make one Gauss-Newton step of the shifts.

        If `update` is True, update variances and weights too, and return the largest change. Otherwise return
        inf.
        """
        gradient = np.gradient(self.x, self.T)
        self.measured = np.concatenate([sweep.t for sweep in self.sweeps]) + (
            self.drift * gradient[self.which]
        )
        t, h = self.measured + self.x[self.which], np.log(10) / _KNOTS
        self.knots = h * np.arange(np.floor(t.min() / h) - 8, np.ceil(t.max() / h) + 9)
        curve = self.curve(self.x)
        C, step, J = self.bordered(curve)
        step *= min(1.0, 2.0 / max(np.abs(step).max(), 1e-12))
        for _ in range(6):
            x = self.x.copy()
            x[self.moving] += step
            if self.curve(x).objective <= curve.objective + 1e-9:
                break
            step *= 0.5
        else:
            x = self.x
        change, self.x = np.abs(x - self.x).max(), x
        return max(change, self.reweigh(curve, C, J)) if update else np.inf

    def reweigh(self, curve, C, J):
        """Update variances, penalties and weights of outliers, and return a measure of their change.

        The measure is a fiftieth of the largest |ln(new / old)| of all variances and penalties. The tolerance
        of `run`, 0.2 % for shifts, thus corresponds to 10 % for variances.
        """
        old = np.concatenate([self.sigma2, self.tau2, self.penalty])
        variance, phase, leverage = self.variance(), np.zeros(2), _leverage(curve, C, J)
        for k, inner in enumerate(C):
            free = variance[k] * (1 - leverage[k])
            square, per = self.weight[k] * curve.r[k] ** 2, self.ok[k] / variance[k] ** 2
            self.sigma2[k] = max(self.sigma2[k] * (per @ square) / max(per @ free, 1e-9), _EXACT**2)
            phase += (per * self.by_phase[k]) @ np.stack([square, free], axis=1)
            b = curve.D.shape[1]
            c, u, S = curve.c[k, :b], curve.c[k, b : b + self.T.size], curve.D.T @ curve.D
            rank = b - 2 - self.penalty[k] * np.sum(S * inner[:b, :b])
            self.penalty[k] = np.clip(max(rank, 0.1) / (c @ S @ c), 1.0, _STIFFEST)
            used = self.T.size - np.trace(inner[b : b + u.size, b : b + u.size]) / self.tau2[k]
            self.tau2[k] = (u @ u + _BELIEF * _OFFSET**2) / (max(used, 0.0) + _BELIEF)
            z = np.where(self.ok[k], np.abs(curve.r[k]) / np.sqrt(variance[k]), 0.0)
            if self.errors is None:
                self.inflation[k] = np.sqrt(self.inflation[k] * self.correlated(z * np.sign(curve.r[k])))
            self.weight[k] = self.ok[k] * np.minimum(1.0, (_OUTLIER / np.maximum(z, 1e-9)) ** 2)
        self.phase2 = np.clip(self.phase2 * phase[0] / phase[1], _PHASE[0] ** 2, _PHASE[1] ** 2)
        return np.abs(np.log(np.concatenate([self.sigma2, self.tau2, self.penalty]) / old)).max() / 50

    def correlated(self, z):
        """Return the number of points that carry as much information as one independent point.

        The number follows from the correlation of neighbouring residuals z, shape (points,).
        """
        z = np.clip(z, -_OUTLIER, _OUTLIER)
        within = self.which[1:] == self.which[:-1]
        rho = np.mean((z[1:] * z[:-1])[within]) / max(np.mean(z**2), 1e-30)
        return (1 + np.clip(rho, 0, 0.9)) / (1 - np.clip(rho, 0, 0.9))

    def run(self, rounds):
        """Iterate until shifts change by less than 0.2 % and variances by less than 10 %."""
        for i in range(rounds):
            if self.iterate(update=i >= _HOLD) < 2e-3 and i > 2 * _HOLD:
                break
        return self

    def misfit(self):
        """Return the sum over E' and E'' of ln(rms deviation of ln E from the smooth curve).

        Offsets of the sweeps count as deviations.
        """
        curve = self.curve(self.x)
        b, n = curve.D.shape[1], self.T.size
        rest = curve.r + (self.each @ curve.c[:, b : b + n].T).T
        squares = np.sum(self.weight * rest**2, axis=1) / self.ok.sum(axis=1)
        return 0.5 * float(np.sum(np.log(squares + _EXACT**2)))


def solve_blocks(H: np.ndarray, right: np.ndarray, q: int) -> np.ndarray:
    """Solve the normal equations of both moduli, shape (2, m, m), whose unknowns from q on are common.

    Each modulus contributes its part to the equations of the common unknowns. Blocks of half the size take a
    fraction of the time of one dense system.
    """
    both = np.linalg.solve(H[:, :q, :q], np.concatenate([H[:, :q, q:], right[:, :q, None]], axis=2))
    Z, own = both[..., :-1], both[..., -1]
    rest = (right[:, q:] - np.einsum("kij,kj->ki", H[:, q:, :q], own)).sum(axis=0)
    common = np.linalg.solve((H[:, q:, q:] - H[:, q:, :q] @ Z).sum(axis=0), rest)
    return np.concatenate([own - Z @ common, np.tile(common, (2, 1))], axis=1)


def invert_blocks(H: np.ndarray, q: int) -> np.ndarray:
    """Return the inverse of the matrix of `solve_blocks`: for each modulus the part of its unknowns."""
    inner, C = np.linalg.inv(H[:, :q, :q]), np.empty_like(H)
    Z = inner @ H[:, :q, q:]
    C[:, q:, q:] = np.linalg.inv((H[:, q:, q:] - H[:, q:, :q] @ Z).sum(axis=0))
    C[:, :q, q:] = -Z @ C[:, q:, q:]
    C[:, q:, :q] = np.swapaxes(C[:, :q, q:], 1, 2)
    C[:, :q, :q] = inner - C[:, :q, q:] @ np.swapaxes(Z, 1, 2)
    return C


def _normal(X, w):
    """Return X^T diag(w) X of a sparse matrix X as a dense array."""
    return (X.T @ X.multiply(w[:, None])).toarray()


def _leverage(curve, C, J):
    """Return d (fitted value) / d (measured value) of every point, shape (2, points)."""
    X = [sparse.hstack([curve.X, columns]) for columns in J]
    return (
        np.array([design.multiply(design @ inner).sum(axis=1) for design, inner in zip(X, C, strict=True)])
        * curve.w
    )


class _Curve(NamedTuple):
    """Solution of the linear least-squares problem at fixed shifts."""

    objective: float  # squared residuals and penalties
    H: np.ndarray  # normal matrices, see `solve_blocks`
    c: np.ndarray  # of ln E' and ln E'': spline, offsets, and the common coefficients of ln b_T, shape (2, m)
    r: np.ndarray  # residuals of ln E' and ln E'', shape (2, points)
    slope: np.ndarray  # derivatives of the splines at the points, shape (2, points)
    w: np.ndarray  # weights, shape (2, points)
    X: sparse.csr_array  # columns of the model for ln E' or ln E''
    D: np.ndarray  # second differences of the coefficients of a spline
    t: np.ndarray  # reduced ln omega of the points


def shifts_of(
    sweeps: Sequence[Sweep], reference: int, vertical: bool | str, temperature_error: float
) -> Shifts:
    """Return the shifts of all sweeps onto the sweep with the index `reference`.

    Parameters
    ----------
    sweeps : sweeps, sorted by rising temperature
    vertical : True: free b_T; "entropic": T rho / (T_ref rho_ref); False: none
        With False, ln a_T allows for about the entropic b_T if the moduli then fit much better.
    temperature_error : standard deviation of the temperature of a sweep [K]
    """
    T, n = np.array([sweep.T for sweep in sweeps]), len(sweeps)
    power = ((T - T[reference]) / T[reference])[:, None]
    entropic = log_factors(ENTROPIC, T, T[reference])
    none = np.zeros(n)
    free = np.delete(np.eye(n), reference, axis=1)

    def best(known, columns, wide):
        moved = [sweep._replace(y=sweep.y - b) for sweep, b in zip(sweeps, known, strict=True)]
        tried = [
            _Superposition(moved, reference, first_shifts(moved, *guess), columns, wide, guess[0]).run(
                _SCREEN
            )
            for guess in _GUESSES
        ]
        return min(tried, key=_Superposition.misfit).run(_ROUNDS)

    if vertical is True:
        return _result(best(none, free, _FREE), none, temperature_error, free=True)
    rubber = best(entropic, power, _POWER_OF_ENTROPIC)
    if vertical == "entropic":
        return _result(rubber, entropic, temperature_error)
    plain = best(none, power[:, :0], 1.0)
    if 2 * n * (plain.misfit() - rubber.misfit()) > _GAIN:
        return _result(rubber, none, temperature_error, unseen=entropic)
    plain.vertical, plain.wide = power, _POWER_OF_ONE
    return _result(plain, none, temperature_error)


def _result(fit, log_b, temperature_error, *, free=False, unseen=None):
    """Return the `Shifts` of a converged fit, with a covariance that includes errors of temperature.

    free : True if the coefficients include ln b_T of the sweeps
    unseen : ln b_T that the moduli show although no vertical shift was requested
    """
    n, moving = fit.T.size, fit.moving
    linear = fit.curve(fit.x)
    C, _, J = fit.bordered(linear)
    size, b = linear.c.shape[1], linear.D.shape[1]
    covariance, log_b, hidden = np.zeros((2 * n, 2 * n)), log_b.copy(), np.zeros(n)
    # The common unknowns are ln b_T of the sweeps, if they are free, followed by ln a_T.
    places, targets = np.arange(size, C.shape[1]), moving
    if free:
        of_b = np.arange(size - moving.size, size)
        places, targets = np.concatenate([places, of_b]), np.concatenate([moving, n + moving])
        log_b[moving] = linear.c[0, of_b]
    else:
        hidden = fit.vertical @ linear.c[0, b + n :] + (0.0 if unseen is None else unseen)
    covariance[np.ix_(targets, targets)] = C[0][np.ix_(places, places)]
    both = np.zeros((2, b + n, b + n))
    inner, known = np.concatenate([np.arange(b), b + moving]), np.r_[:b, size : C.shape[1]]
    for block, inverse in zip(both, C, strict=True):
        block[np.ix_(inner, inner)] = inverse[np.ix_(known, known)]
    slope = np.gradient(fit.x, fit.T) * temperature_error
    contrast = np.eye(n) - np.eye(n)[fit.reference]
    covariance[:n, :n] += (contrast * slope**2) @ contrast.T
    splines = linear.c[:, :b]
    freedom = fit.ok.sum() - _leverage(linear, C, J).sum()
    variance = fit.sigma2 if fit.errors is None else np.median(fit.errors, axis=1) ** 2
    return Shifts(
        log_a=fit.x,
        log_b=log_b,
        covariance=covariance,
        scatter=(float(np.sqrt(variance[0])), float(np.sqrt(variance[1]))),
        phase=float(np.sqrt(fit.phase2)) if fit.errors is None else 0.0,
        offset=(float(np.sqrt(fit.tau2[0])), float(np.sqrt(fit.tau2[1]))),
        hidden=hidden,
        scaled=unseen is not None,
        redchi=1.0 if fit.errors is None else float(np.sum(linear.w * linear.r**2)) / max(freedom, 1),
        t=linear.t,
        smooth=(linear.X[:, :b] @ splines.T).T,
        bad=fit.weight < 1,
        correlated=fit.inflation,
        knots=fit.knots,
        splines=splines,
        covariances=both,
    )
