r"""Fit a Prony series to a measured modulus.

.. math:: E'(\omega) = E_\infty + \sum_i E_i \frac{\omega^2\tau_i^2}{1 + \omega^2\tau_i^2},\qquad
          E''(\omega) = \sum_i E_i \frac{\omega\tau_i}{1 + \omega^2\tau_i^2}

On a fixed grid of times the model is linear in E >= 0, so bounded least squares finds the global minimum and
the terms that are zero there. Errors, correlations and unidentified directions follow from the derivatives
with respect to ln E, which equal the terms.
"""

import dataclasses
import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

import rubberfric as rf
from fitting.characterise.pictures import plot_series
from fitting.characterise.prony_series import (
    SeriesMinimum,
    SeriesProblem,
    check_gaps,
    columns,
    fixed_modulus,
    given,
    grid,
    reduced,
)
from fitting.data.kinds import ModulusData
from fitting.fit import fit
from fitting.parameters.constraints import Constraint, Positive, is_number
from fitting.parameters.priors import Prior, Smooth
from fitting.results.report import error_text
from fitting.results.result import FitResult
from fitting.solvers.objective import CONVERGED, MESSAGES, PERFECT, STALLED
from fitting.uncertainty.covariance import Uncertainty, WithUncertainty
from fitting.uncertainty.posterior import joint_prior
from rubberfric.base import html, shown
from rubberfric.materials import Shift
from rubberfric.plot import style

# Largest cosine between the residuals and a change of ln E at a minimum. A larger one counts as stalled.
_FLAT = 1e-4
# Relative rms deviation below which data are exact, so that their cosine is due to rounding.
_EXACT = 1e-9


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PronyFit(WithUncertainty):
    """Result of `fit_prony`: a Prony series, its residuals, and the uncertainty of its moduli.

    Attributes
    ----------
    material : Prony, without the terms that vanish at the minimum
    dropped : relaxation times of the terms that vanish [s]; inf stands for E_inf
    residuals : ln(fit / measured) of E' and of E'', shape (2, n); NaN where measured <= 0
    data : the data that were fitted
    smooth : sigma of the `Smooth` prior, given or chosen by "auto"; None without a prior
    weights : weights of E' and of E''
    names : key paths of the moduli that were fitted
    """

    material: rf.Prony
    dropped: np.ndarray
    residuals: np.ndarray
    data: ModulusData
    smooth: float | None
    weights: tuple[float, float]
    names: tuple[str, ...]
    solution: SeriesMinimum = dataclasses.field(repr=False)
    count: int

    @property
    def rms_storage(self) -> float:
        """Root-mean-square of the residuals of E'."""
        return float(np.sqrt(np.nanmean(self.residuals[0] ** 2)))

    @property
    def rms_loss(self) -> float:
        """Root-mean-square of the residuals of E''."""
        return float(np.sqrt(np.nanmean(self.residuals[1] ** 2)))

    @property
    def values(self) -> np.ndarray:
        """Fitted moduli [Pa]."""
        return self.solution.E

    @property
    def uncertainty(self) -> Uncertainty:
        """Uncertainty of the moduli, in Pa, and of their logarithms x."""
        return self.solution.uncertainty

    @property
    def estimated(self) -> float | None:
        """Relative error estimated from the scatter, or None if the data have errors."""
        return self.solution.scale

    @property
    def freedom(self) -> float:
        """Degrees of freedom: number of measured values minus the effective number of moduli."""
        return self.count - self.uncertainty.parameters

    @property
    def _status(self) -> int:
        if max(self.rms_storage, self.rms_loss) < _EXACT:
            return PERFECT
        return CONVERGED if self.solution.slope < _FLAT else STALLED

    @property
    def success(self) -> bool:
        """True if the minimum was reached."""
        return self._status != STALLED

    @property
    def message(self) -> str:
        """Statement whether the fit converged."""
        return MESSAGES[self._status]

    def as_prior(self, body: str | None = None, widen: float = 1.0) -> dict[str, Prior]:
        """Return the fitted moduli and their covariance as the `prior` of another fit.

        The scene of the other fit must have this `material`, or a Prony series with the same relaxation
        times.

        Parameters
        ----------
        body : "lower" or "upper", body of the other scene with this material; None: the body of the data, or
            "lower"
        widen : factor that multiplies all standard deviations, to allow for differences between oscillation
            and sliding

        Returns
        -------
        dict of one `Correlated`, to be joined with other priors by "|"
        """
        if not self.success:
            raise ValueError(f"as_prior: the fit did not converge ({self.message}); use a converged fit")
        known, tau = self.uncertainty, np.asarray(self.material.tau)
        none = np.full(known.x.size, np.inf)
        return dict(
            joint_prior(
                list(dict.fromkeys(name.split("[")[0] for name in self.names)),
                self.values,
                known.spread,
                (np.zeros(known.x.size), none),
                np.append(tau, np.nan)[: known.x.size],
                body,
                widen,
            )
        )

    @functools.cached_property
    def fit(self) -> FitResult:
        """Result of `fitting.fit` for the fitted moduli, with intervals, profiles, bootstrap and files.

        The first access runs the fit, which takes seconds to compile. ValueError is raised if the weights of
        E' and E'' differ.
        """
        if self.weights[0] != self.weights[1]:
            raise ValueError(
                f"weights = {self.weights}: must be equal for `.fit`; fitting.fit weights E' and E'' equally"
            )
        body = self.names[0].split(".")[0]
        own, other = rf.Body(self.material), rf.Body(rf.Rigid())
        scene = rf.Scene(own, other) if body == "lower" else rf.Scene(other, own)
        free: dict[str, Constraint] = {f"{body}.material.E": Positive()}
        if self.names[-1].endswith("E_inf"):
            free[f"{body}.material.E_inf"] = Positive()
        prior: dict[str, Prior] = {}
        if self.smooth is not None:
            prior[f"{body}.material.E"] = Smooth(self.smooth)
        return fit(scene, self.data, free, prior=prior)

    def plot(self, ax: style.Panels | None = None) -> style.Panels:
        """Draw measured E' and E'' with the fitted series and its terms, and the residuals below.

        Needs matplotlib: pip install 'rubberfric[plot]'.

        Parameters
        ----------
        ax : two matplotlib axes; None: a new figure, `ax[0].figure`

        Returns
        -------
        the axes: moduli, residuals
        """
        return plot_series(self, ax)

    def __repr__(self) -> str:
        terms = self.material.tau.size
        return f"<PronyFit: {terms} terms, E' to {self.rms_storage:.2g}, E'' to {self.rms_loss:.2g} rms>"

    def report(self) -> str:
        """Return a report of several lines: the series, its misfit and its error bars."""
        tau = np.asarray(self.material.tau)
        times = f"tau = {tau.min():.3g} ... {tau.max():.3g} s"
        lines = [
            f"Prony series of {self.data.label}: {tau.size} terms, {times}",
            f"    {self.message}",
            f"    rms of ln(fit / measured): E' {self.rms_storage:.2%}, E'' {self.rms_loss:.2%}",
        ]
        if self.smooth is not None:
            lines.append(f"    smooth: slopes change by about {self.smooth:.3g} from term to term")
        if self.weights[0] != self.weights[1]:
            lines.append(f"    weights: E' {self.weights[0]:g}, E'' {self.weights[1]:g}")
        if self.dropped.size:
            times = ", ".join(f"{t:.3g}" for t in self.dropped)
            lines.append(f"    absent, because E = 0 in the best fit: tau = {times} s")
        lines.append(f"    {'tau [s]':>10} {'E [Pa]':>11}")
        lines += [f"    {time:>10} {value:>11}  {more}" for time, value, more in self._rows()]
        if np.inf in self.dropped:
            lines.append("    without E_inf the material is a liquid; for a solid, give E_inf")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        rows: list[tuple[str, ...] | str] = [*self._rows()]
        rows.append(f"rms of ln(fit / measured): E' {self.rms_storage:.2%}, E'' {self.rms_loss:.2%}")
        if self.dropped.size:
            rows.append(f"absent: tau = {', '.join(f'{t:.3g}' for t in self.dropped)} s")
        caption = f"Prony series of {self.data.label}: {self.message}"
        return html.table(rows, ("tau [s]", "E [Pa]", "error [Pa]"), caption)

    def _rows(self):
        """Return a tuple of texts (time, modulus, error) for every term, with E_inf first.

        If a modulus has no error bar, the third text is the reason.
        """
        tau, E = np.asarray(self.material.tau), np.asarray(self.material.E)
        rows = [("inf", "E_inf", float(self.material.E_inf))]
        rows += [(f"{tau[i]:.4g}", f"E[{i}]", float(E[i])) for i in range(tau.size)]
        return [(time, f"{value:.4g}", error_text(self, name, value)) for time, name, value in rows]


def fit_prony(
    data: ModulusData,
    per_decade: float = 1.0,
    *,
    tau: ArrayLike | None = None,
    E_inf: float | str = "fit",
    poisson: float = 0.5,
    shift: Shift | None = None,
    smooth: float | str | None = None,
    weights: Sequence[float] = (1.0, 1.0),
) -> PronyFit:
    r"""Fit a Prony series to a measured modulus.

    .. math:: \min_{E \ge 0} w' \sum_k \left(\frac{\ln E'(\omega_k)/E'_k}{e_k}\right)^2
              + w'' \sum_k \left(\frac{\ln E''(\omega_k)/E''_k}{e_k}\right)^2

    If the data have absolute errors, the differences are absolute instead of logarithmic.

    Parameters
    ----------
    data : ModulusData
        Data with temperatures are raw curves, which `shift` superposes. Data without temperatures are a
        master curve.
    per_decade : minimum number of relaxation times per decade, > 0
        The times are evenly spaced in ln tau from 1/omega_max to 1/omega_min of the (reduced) frequencies, so
        the loss of the first and the last term peaks at the ends of the data. Relaxation outside this
        range is represented by the end terms and E_inf.
    tau : relaxation times [s] that replace the grid of `per_decade`, all different
    E_inf : "fit", or a fixed value of the relaxed modulus [Pa] (0: a liquid)
    poisson, shift : fields of the material; `fit_master_curve` fits a shift
    smooth : sigma of a `Smooth` prior [-], or "auto", or None
        A prior suits noisy data: no term vanishes, and gaps in the frequencies are bridged. "auto" chooses
        the sigma with the smallest prediction error by generalised cross-validation [Golub, Heath &
        Wahba, Technometrics 21 (1979) 215, doi:10.1080/00401706.1979.10489751].
    weights : (w', w''), >= 0 [-]
        Weights of E' and E''. A weight of 0 leaves out E' or E''.

    Returns
    -------
    PronyFit

    Raises
    ------
    ValueError
        `data` is not a ModulusData, or has temperatures without a shift or outside the range of the shift.
        There are fewer measured values than unknowns. The frequencies leave a gap of more than two decades
        (curves that do not overlap). Relaxation times lie more than two decades outside the data. The
        message is one line.

    Notes
    -----
    The minimum over E >= 0 is found by the active sets of `fitting.characterise.prony_series`, which give
    exact zeros. Terms with E = 0 are dropped. With `smooth`, Levenberg-Marquardt steps in ln E begin at
    E_i = (2/pi) E''(1/tau_i) d ln tau, the value from the loss at the peak of each term.
    """
    rf.Prony(1.0, [1.0], [1.0], poisson, shift)  # checks poisson and shift
    if smooth != "auto" if isinstance(smooth, str) else smooth is not None and not _strength(smooth):
        raise ValueError(f"smooth = {shown(smooth)}: must be None, a number > 0, or 'auto'")
    weight = _weights(weights)
    reference = reduced(data, shift)
    omega = reference.omega
    tau = grid(omega, per_decade) if tau is None else given(data, tau, omega)
    fixed = fixed_modulus(E_inf)
    series = _series(reference, omega, tau, fixed, weight)
    E = _start(data, reference, series, smooth)
    kept = E > 0
    if not (kept & np.isfinite(series.tau)).any():
        raise ValueError(f"data {data.label!r}: the fit has no relaxing term; E'' must be > 0")
    found = series.only(kept)
    strength = found.cross_validated(E[kept]) if isinstance(smooth, str) else smooth
    solution = found.solved(E[kept], strength)
    terms = np.isfinite(found.tau)
    relaxed = float(solution.E[~terms].sum()) if fixed is None else fixed
    material = rf.Prony(relaxed, solution.E[terms], found.tau[terms], poisson, shift)
    model = columns(omega, found.tau) @ solution.E
    model[: omega.size] += fixed or 0.0
    measured = np.where(reference.measured > 0, reference.measured, np.nan)
    return PronyFit(
        material=material,
        dropped=series.tau[~kept],
        residuals=np.log(model / measured).reshape(2, -1),
        data=data,
        smooth=strength,
        weights=(float(weight[0]), float(weight[1])),
        names=found.names,
        solution=solution,
        count=series.measured.size,
    )


def _strength(smooth):
    return is_number(smooth) and smooth > 0


def _weights(weights):
    weight = np.array([w if is_number(w) else np.nan for w in np.ravel(np.array(weights, object))], float)
    if weight.shape != (2,) or not (np.isfinite(weight) & (weight >= 0)).all() or not weight.any():
        raise ValueError(f"weights = {shown(weights)}: must be two numbers >= 0, for E' and E'', not both 0")
    return weight


def _series(data, omega, tau, relaxed, weight):
    """Return the least-squares problem without the rows whose weight is 0."""
    tau = np.append(tau, np.inf) if relaxed is None else tau
    known = np.repeat([relaxed or 0.0, 0.0], omega.size)
    error = np.ones(len(data)) if data.error is None else data.error
    each = np.repeat(weight, omega.size)
    used = each > 0
    return SeriesProblem(
        columns(omega, tau)[used],
        known[used],
        data.measured[used],
        error[used] / np.sqrt(each[used]),
        data.logarithmic,
        data.error is None,
        tau,
        data.body or "lower",
    )


def _start(data, reference, series, smooth):
    """Return the moduli of the minimum without a prior, or an initial guess > 0 with a prior."""
    times = np.isfinite(series.tau).sum()
    if series.measured.size + (0 if smooth is None else times - 2) < series.tau.size:
        raise ValueError(
            f"data {data.label!r}: {series.measured.size} values for {series.tau.size} unknowns:"
            " must have at least as many values; lower per_decade, or give tau or smooth"
        )
    if smooth is not None:
        return _peaks(reference, reference.omega, series.tau)
    check_gaps(data, reference.omega)
    return series.bounded()


def _peaks(data, omega, tau):
    """Return initial moduli E > 0, shape (terms,).

    E_i is estimated from E'' at the loss peak of term i. E_inf is half of the lowest E'.
    """
    finite = np.isfinite(tau)
    order, at = np.argsort(omega), np.argsort(tau[finite])
    floor = 1e-6 * np.abs(data.storage).max()
    loss = np.log(np.maximum(data.loss, floor)[order])
    times = tau[finite]
    width = np.gradient(np.log(times[at])) if times.size > 1 else np.ones(1)
    E = np.full(tau.size, 0.5 * max(data.storage.min(), floor))
    E[at] = 2 / np.pi * np.exp(np.interp(-np.log(times[at]), np.log(omega[order]), loss)) * width
    return E
