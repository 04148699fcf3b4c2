r"""A Prony series on given relaxation times as a least-squares problem in NumPy.

.. math:: E' = E_\infty + \sum_i E_i \frac{a_i^2}{1 + a_i^2},\qquad
          E'' = \sum_i E_i \frac{a_i}{1 + a_i^2},\qquad a_i = \omega\tau_i

The model is linear in E, so its derivatives with respect to ln E are E times the columns of the model's
matrix, and nothing is compiled. Bounded least squares finds exact zeros.
"""

import dataclasses
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy.optimize import least_squares, nnls

import rubberfric as rf
from fitting.data.kinds import CreepData, ModulusData, RelaxationData
from fitting.parameters.constraints import is_number
from fitting.parameters.variables import Group, Variables, element_names
from fitting.solvers.problem import ASSUMED
from fitting.uncertainty.covariance import Uncertainty, from_jacobian
from rubberfric.base import POSITIVE, ArrayLike, as_leaf, check_values, shown
from rubberfric.materials import Shift, log_factors

# Kinds of data that a Prony series describes.
Response = ModulusData | RelaxationData | CreepData
_Response = TypeVar("_Response", bound=Response)

# Decades between neighbouring frequencies. A term in the middle of a wider gap would not be determined: its
# loss is less than a fifth of its peak at all frequencies.
_GAP = 2.0
# Largest distance of a given relaxation time from the range of 1/omega in decades, where its loss is 1 % of
# its modulus.
_REACH = 2.0
# Most Gauss-Newton steps of the bounded problem. They end earlier where the cost does not fall any further.
_STEPS = 50
# Most evaluations of the fit with a prior by Levenberg-Marquardt steps.
_EVALUATIONS = 200
# A term is dropped if it is below this share of E' and E'' at all frequencies.
_ROUNDING = 1e-9
# Number of fits, each weighted with the errors estimated by the previous fit.
_ROUNDS = 2
# Strengths of a smooth prior that are tried, in changes of the slope from term to term.
_STRENGTHS = np.geomspace(0.03, 30.0, 19)


def reduced(data: _Response, shift: Shift | None) -> _Response:
    """Return the data shifted to the reference temperature of `shift`.

    The shifted modulus is E(a_T omega) = E(omega, T) / b_T or E(t / a_T) = E(t, T) / b_T, and the shifted
    compliance D(t / a_T) = b_T D(t, T). Data without temperatures, and data over time at one temperature
    without a shift, are returned unchanged.
    """
    if not isinstance(data, Response):
        raise ValueError(
            f"data is a {type(data).__name__}: must be ModulusData, RelaxationData or CreepData, for example"
            " from fitting.read"
        )
    if data.temperature is None:
        return data
    if shift is None:
        if not isinstance(data, ModulusData) and np.ptp(data.temperature) == 0:
            return data
        raise ValueError(
            f"data {data.label!r} have temperatures, but no shift is given; give shift = WLF, Arrhenius or"
            " TabulatedShift, or a master curve: curve = fit_master_curve(data), then curve.data"
        )
    shift.check_temperature(data.temperature)
    T = data.temperature
    # A solid with a modulus of 1 Pa at the reference temperature has the modulus b_T.
    solid = rf.Prony(1.0, [1.0], [1.0], shift=shift)
    vertical = np.broadcast_to(np.asarray(rf.complex_modulus(solid, 0.0, T).real, float), T.shape)
    faster = np.exp(log_factors(shift, T))
    names = [name for name in (*data.values, *data.sigmas) if getattr(data, name) is not None]
    inverse = isinstance(data, CreepData)
    moved = {n: getattr(data, n) * vertical if inverse else getattr(data, n) / vertical for n in names}
    if isinstance(data, ModulusData):
        moved["omega"] = data.omega * faster
    else:
        moved["time"] = data.time / faster
    return dataclasses.replace(data, temperature=None, name=data.label, check_units=False, **moved)


def grid(omega: np.ndarray, per_decade: float) -> np.ndarray:
    """Return relaxation times, evenly spaced in ln tau from 1/omega_max to 1/omega_min [s].

    There are at least `per_decade` times per decade.
    """
    if not (is_number(per_decade) and 0 < per_decade <= 100):
        raise ValueError(f"per_decade = {shown(per_decade)}: must be a number > 0, at most 100")
    decades = np.log10(omega.max() / omega.min())
    # 5.000000001 decades are five.
    return np.geomspace(1 / omega.max(), 1 / omega.min(), int(np.ceil(per_decade * decades - 1e-6)) + 1)


def checked_times(data: Response, tau: ArrayLike, omega: np.ndarray) -> np.ndarray:
    """Return the relaxation times `tau` as an array [s]. Raise ValueError if one is invalid.

    Relaxation times must be > 0, all different, and within two decades of the range of 1/omega.
    """
    tau = np.asarray(as_leaf("tau", tau, 1), float)
    check_values("tau", tau, POSITIVE)
    if tau.size == 0:
        raise ValueError("tau is empty: must have at least one relaxation time")
    if np.unique(tau).size < tau.size:
        raise ValueError("tau has equal relaxation times; all must be different")
    beyond = np.maximum(np.log10(tau * omega.min()), -np.log10(tau * omega.max()))
    worst = int(np.argmax(beyond))
    if beyond[worst] > _REACH:
        raise ValueError(
            f"tau[{worst}] = {tau[worst]:g} s: outside the data {data.label!r}; must be within"
            f" {_REACH:g} decades of 1/omega, {1 / omega.max():.3g} ... {1 / omega.min():.3g} s"
        )
    return tau


def fixed_modulus(E_inf: float | str) -> float | None:
    """Return the relaxed modulus [Pa] as a number, or None if `E_inf` is "fit"."""
    if isinstance(E_inf, str) and E_inf == "fit":
        return None
    if isinstance(E_inf, str) or not (is_number(E_inf) and E_inf >= 0):
        raise ValueError(f"E_inf = {shown(E_inf)}: must be 'fit' or a number >= 0 [Pa]")
    return float(E_inf)


def check_gaps(data: Response, omega: np.ndarray) -> None:
    """Raise ValueError if neighbouring frequencies are more than two decades apart.

    The data would not determine a relaxation time in the middle of a wider gap.
    """
    sorted_omega = np.sort(omega)
    gaps = np.diff(np.log10(sorted_omega))
    if gaps.size and gaps.max() > _GAP:
        i = int(np.argmax(gaps))
        raise ValueError(
            f"data {data.label!r}: no values between the reduced frequencies {sorted_omega[i]:.3g} and"
            f" {sorted_omega[i + 1]:.3g} rad/s; curves must overlap or be less than {_GAP:g} decades"
            " apart, or smooth must be given"
        )


def nonnegative(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the x >= 0 that minimises |A x - b|^2.

    Elements of x at the limit are exactly 0. The active-set method of Lawson and Hanson is used (Solving
    least squares problems, 1974, ch. 23).
    """
    # The columns are scaled to length 1, so that the tolerance of the search suits all of them.
    length = np.linalg.norm(A, axis=0)
    length = np.where(length > 0, length, 1.0)
    return nnls(A / length, b)[0] / length


def nonnegative_logarithmic(
    A: np.ndarray, b: np.ndarray, known: np.ndarray, error: np.ndarray, ignored: np.ndarray | None = None
) -> np.ndarray:
    r"""Return the x >= 0 that minimises the squared logarithmic differences of A x + known from b.

    .. math:: \min_{x \ge 0} \sum_k \left(\frac{\ln (A x + known)_k / b_k}{error_k}\right)^2

    Elements of x at the limit are exactly 0.

    Parameters
    ----------
    A : shape (rows, unknowns), >= 0
    b, error : shape (rows,), > 0
    known : shape (rows,), >= 0
    ignored : linearly independent columns, shape (rows, directions), or None
        The part of the logarithmic differences along these columns does not contribute to the sum.

    Returns
    -------
    array, shape (unknowns,)
    """
    basis = None if ignored is None else np.linalg.qr(ignored / error[:, None])[0]

    def counted(rows):
        return rows if basis is None else rows - basis @ (basis.T @ rows)

    def cost(x):
        model = A @ x + known
        return np.sum(counted(np.log(model / b) / error) ** 2) if (model > 0).all() else np.inf

    # Gauss-Newton: the logarithm is linear in a small relative change of the model, so that
    # every step is a bounded problem. The first is linearised about the data.
    model, x, solution, lowest = b, np.zeros(A.shape[1]), np.zeros(A.shape[1]), np.inf
    for _ in range(_STEPS):
        scale = 1 / (model * error)
        aim = (model - known) * scale - np.log(model / b) / error
        solution = nonnegative(counted(A * scale[:, None]), counted(aim))
        # The first step, from x = 0, is a full step; later steps are shortened as needed.
        parts = 0.5 ** np.arange(20 if np.isfinite(lowest) else 1)
        tried = [x + part * (solution - x) for part in parts]
        costs = [cost(trial) for trial in tried]
        best = int(np.argmin(costs))
        gained = lowest - costs[best]
        if not gained > 0:
            break
        x, lowest = tried[best], costs[best]
        model = A @ x + known
        if gained <= 1e-14 * lowest:
            break
    return np.where(solution > 0, x, 0.0)


class SeriesMinimum(NamedTuple):
    """Fitted moduli of a Prony series, their uncertainty, and a measure of convergence."""

    E: np.ndarray  # E_i, and E_inf last if it is fitted; > 0
    scale: float | None  # relative error estimated from the scatter; None if the data have errors
    uncertainty: Uncertainty  # of ln E
    slope: float  # largest cosine between the residuals and a change of ln E, 0 at a minimum


@dataclasses.dataclass(frozen=True, eq=False)
class SeriesProblem:
    """Least-squares problem of a Prony series: measured values, and a column for each term.

    Attributes
    ----------
    columns : model matrix, shape (rows, terms): E' and, in the rows below, E'' of every term with E = 1
    known : part of the model that is not fitted, shape (rows,)
    measured, error : measured values and standard errors, shape (rows,)
    logarithmic : True if `error` is the standard error of ln(measured) instead of measured
    estimate : True if only the ratios of the errors are known, and the fit estimates the size of the errors
    tau : relaxation times [s]; inf, at the end, stands for E_inf
    body : "lower" or "upper", part of the key paths of the moduli
    """

    columns: np.ndarray
    known: np.ndarray
    measured: np.ndarray
    error: np.ndarray
    logarithmic: bool
    estimate: bool
    tau: np.ndarray
    body: str

    @property
    def variables(self) -> Variables:
        """Moduli as free Positive parameters of the scene's body."""
        terms, path = int(np.isfinite(self.tau).sum()), f"{self.body}.material"
        groups = [Group(f"{path}.E", "Positive", 0, tuple(range(terms)), (0, terms))]
        if terms < self.tau.size:
            groups.append(Group(f"{path}.E_inf", "Positive", 1, None, (terms, self.tau.size)))
        return Variables(None, tuple(groups), self.tau.size)

    @property
    def names(self) -> tuple[str, ...]:
        """Key paths of the moduli."""
        return tuple(element_names(self.variables))

    def only(self, kept: np.ndarray) -> "SeriesProblem":
        """Return the problem with only the terms for which `kept` is True."""
        return dataclasses.replace(self, columns=self.columns[:, kept], tau=self.tau[kept])

    def bounded(self) -> np.ndarray:
        """Return the moduli E >= 0 that minimise the sum of squared residuals.

        Moduli at the limit are exactly 0.
        """
        if self.logarithmic:
            E = nonnegative_logarithmic(self.columns, self.measured, self.known, self.error)
        else:
            E = nonnegative(self.columns / self.error[:, None], (self.measured - self.known) / self.error)
        # Terms at rounding level, which occur with noise-free data, are set to 0.
        model = self.columns @ E + self.known
        return np.where((self.columns * E > _ROUNDING * model[:, None]).any(0), E, 0.0)

    def rows(self, x: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals at x = ln E divided by `error`, and their derivatives with respect to x.

        Residuals have shape (rows,), derivatives have shape (rows, terms).
        """
        parts = self.columns * np.exp(x)
        model = parts.sum(1) + self.known
        if self.logarithmic:
            return np.log(model / self.measured) / error, parts / (model * error)[:, None]
        return (model - self.measured) / error, parts / error[:, None]

    def solved(self, E: np.ndarray, smooth: float | None = None) -> SeriesMinimum:
        """Return the minimum near the moduli E > 0, with a `Smooth` prior of standard deviation `smooth`.

        If `smooth` is None, there is no prior, and E must be the minimum itself. Unknown errors are estimated
        from the scatter, as in `fitting.fit`.
        """
        bends = np.zeros((0, E.size)) if smooth is None else self._bends() / smooth
        x, error, scale = np.log(E), self.error, None
        if self.estimate:
            scale, error = ASSUMED, ASSUMED * self.error
        for i in range(_ROUNDS + 1):
            if smooth is not None:
                x = self._minimum(x, error, bends)
            known, slope = self._known(x, error, bends)
            if scale is None or i == _ROUNDS or self.measured.size - known.parameters < 0.5:
                break
            scatter = np.sqrt(known.chisqr / (self.measured.size - known.parameters))
            # Data without noise are fitted to rounding; their error must not become zero.
            scale = max(scale * float(scatter), 1e-10)
            error = scale * self.error
        return SeriesMinimum(np.exp(x), scale, known, slope)

    def cross_validated(self, E: np.ndarray) -> float:
        r"""Return the sigma of `Smooth` with the smallest prediction error of left-out data [-].

        .. math:: \min_\sigma \frac{n \sum_k r_k^2}{(n - \mathrm{tr} H)^2}

        This is generalised cross-validation [Golub, Heath & Wahba, Technometrics 21 (1979) 215] with n
        residuals r_k and the matrix H that maps the data to the fit. If only the ratios of the errors are
        known, the residuals with the weakest prior give the size of the errors. E > 0 is the initial guess.
        """
        bends, x, count = self._bends(), np.log(E), self.measured.size
        scores, unit = [], None
        for sigma in _STRENGTHS[::-1]:
            scaled = bends / sigma
            if unit is None:
                # The weakest prior hardly changes the fit, so the residuals are noise.
                x = self._minimum(x, ASSUMED * self.error if self.estimate else self.error, scaled)
                r, _ = self.rows(x, self.error)
                unit = max(float(np.sqrt(np.mean(r**2))), 1e-10) if self.estimate else 1.0
            error = unit * self.error
            x = self._minimum(x, error, scaled)
            known, _ = self._known(x, error, scaled)
            scores.append(known.chisqr / max(count - known.parameters, 1e-3) ** 2)
        return float(_STRENGTHS[::-1][int(np.argmin(scores))])

    def _bends(self) -> np.ndarray:
        """Return the matrix that maps ln E to second differences of ln E, shape (terms - 2, unknowns).

        Second differences are the changes of the slope d ln E / d log10 tau from term to term.
        """
        terms = np.flatnonzero(np.isfinite(self.tau))
        order = terms[np.argsort(self.tau[terms])]
        if order.size < 3:
            raise ValueError("smooth needs at least three different relaxation times")
        slopes = np.diff(np.eye(self.tau.size)[order], axis=0) / np.diff(np.log10(self.tau[order]))[:, None]
        return np.diff(slopes, axis=0)

    def _minimum(self, x, error, bends):
        """Return the x = ln E that minimises the squared residuals of data and prior, from the guess x."""
        options: Any = {"xtol": 1e-14, "ftol": 1e-15, "gtol": 1e-15, "max_nfev": _EVALUATIONS}
        options["jac"] = lambda x: self._all(x, error, bends)[1]
        return least_squares(lambda x: self._all(x, error, bends)[0], x, method="lm", **options).x

    def _all(self, x, error, bends):
        r, J = self.rows(x, error)
        return np.concatenate([r, bends @ x]), np.concatenate([J, bends])

    def _known(self, x, error, bends):
        r, J = self._all(x, error, bends)
        count = self.measured.size
        known = from_jacobian(
            self.variables, J, count, slope=np.exp(x), chisqr=float(r[:count] @ r[:count]), x=x
        )
        size = np.linalg.norm(J, axis=0) * np.linalg.norm(r)
        return known, float(np.max(np.abs(J.T @ r) / np.where(size > 0, size, 1.0)))


def columns(omega: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Return the matrix that maps moduli to E' and E'', shape (2 n, terms) for n frequencies.

    The first n rows are E' of every term with E = 1, the last n rows are E''. tau = inf stands for E_inf.
    """
    finite = np.isfinite(tau)
    a = omega[:, None] * np.where(finite, tau, 1.0)
    terms = np.concatenate([a**2 / (1 + a**2), a / (1 + a**2)])
    return np.where(finite, terms, np.repeat([1.0, 0.0], omega.size)[:, None])
