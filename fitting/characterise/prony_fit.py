"""Result of `fitting.fit_prony`: a Prony series, its residuals, and the uncertainty of its moduli."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np

import rubberfric as rf
from fitting.characterise.pictures import plot_series
from fitting.characterise.prony_series import Response, SeriesMinimum, reduced
from fitting.characterise.responses import Compliance, matrix, modulus_slopes
from fitting.data.kinds import CreepData, ModulusData, RelaxationData
from fitting.fit import fit
from fitting.parameters.constraints import Constraint, Positive
from fitting.parameters.priors import Prior, Smooth
from fitting.results.report import error_text
from fitting.results.result import FitResult
from fitting.solvers.objective import CONVERGED, MESSAGES, PERFECT, STALLED
from fitting.uncertainty.covariance import Uncertainty, WithUncertainty
from fitting.uncertainty.posterior import joint_prior
from rubberfric.base import POSITIVE, ArrayLike, as_leaf, check_values, html
from rubberfric.plot import style

# Largest cosine between the residuals and a change of ln E at a minimum. A larger one counts as stalled.
_FLAT = 1e-4
# Largest rms deviation of a good series: friction is as E'' / |E|, and measured moduli scatter by 2 to 5 %.
_POOR = 0.1
# Relative rms deviation below which data are exact, so that their cosine is due to rounding.
_EXACT = 1e-9
# Measured quantities of each kind of data.
_QUANTITIES = {ModulusData: ("E'", "E''"), RelaxationData: ("E(t)",), CreepData: ("D(t)",)}
# Frequencies per decade at which `moduli` evaluates E' and E''.
_PER_DECADE = 5
# Places of other relaxation times, in steps of the grid.
_PARTS = (0.25, 0.5, 0.75)
# Smallest relative standard error of converted moduli. Exact data have none.
_SMALLEST = 1e-9


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PronyFit(WithUncertainty):
    """Result of `fit_prony`: a Prony series, its residuals, and the uncertainty of its moduli.

    Attributes
    ----------
    material : Prony, without the terms that vanish at the minimum
    dropped : relaxation times of the terms that vanish [s]; inf stands for E_inf
    residuals : ln(fit / measured), NaN where measured <= 0
        E' and E'' in shape (2, n), or E(t) or D(t) in shape (1, n).
    data : the data that were fitted
    smooth : sigma of the `Smooth` prior, given or chosen by "auto"; None without a prior
    weights : weights of E' and of E''
    names : key paths of the moduli that were fitted
    compliance : the fitted creep compliance and its covariance, or None for other data

    Examples
    --------
    >>> omega = np.logspace(-1, 3, 20)
    >>> E = np.asarray(rf.complex_modulus(rf.Prony(1e6, [1e7], [1e-2]), omega))
    >>> series = fitting.fit_prony(fitting.ModulusData(omega, E.real, E.imag, relative=0.02), tau=[1e-2])
    >>> print(series.report())
    Prony series of modulus, 20 points: 1 terms, tau = 0.01 ... 0.01 s
        converged: the data are met to rounding
        rms of ln(fit / measured): E' 0.00%, E'' 0.00%
           tau [s]      E [Pa]
               inf       1e+06  +/- 5.9e+03 (0.6%)
              0.01       1e+07  +/- 4e+04 (0.4%)
    >>> series.moduli([1e2]).loss.round(-3)
    array([5000000.])
    """

    material: rf.Prony
    dropped: np.ndarray
    residuals: np.ndarray
    data: Response
    smooth: float | None
    weights: tuple[float, float]
    names: tuple[str, ...]
    solution: SeriesMinimum = dataclasses.field(repr=False)
    count: int
    refit: Callable[..., "PronyFit"] = dataclasses.field(repr=False)  # on other relaxation times
    grid: np.ndarray = dataclasses.field(repr=False)  # times with those that vanished [s]
    compliance: Compliance | None = None

    @property
    def rms_storage(self) -> float:
        """Root-mean-square of the residuals of E', or of E(t) or D(t)."""
        return float(np.sqrt(np.nanmean(self.residuals[0] ** 2)))

    @property
    def rms_loss(self) -> float:
        """Root-mean-square of the residuals of E'', or of E(t) or D(t)."""
        return float(np.sqrt(np.nanmean(self.residuals[-1] ** 2)))

    @property
    def rms(self) -> dict[str, float]:
        """Root-mean-square of the residuals of each measured quantity, such as {"E'": 0.01, "E''": 0.02}."""
        return {
            name: float(np.sqrt(np.nanmean(row**2)))
            for name, row in zip(_QUANTITIES[type(self.data)], self.residuals, strict=True)
        }

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
        if not isinstance(self.data, ModulusData):
            raise ValueError(f"`.fit` needs ModulusData, got {type(self.data).__name__}; use moduli()")
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

    def model(self, x: ArrayLike) -> np.ndarray:
        """Return the fitted quantities at the reference temperature.

        Parameters
        ----------
        x : angular frequencies [rad/s] if `data` are ModulusData, otherwise times [s]; shape (n,)

        Returns
        -------
        array, shape (2, n): E' and E'' [Pa]; or shape (1, n): E(t) [Pa] or D(t) [1/Pa]
        """
        x = np.asarray(as_leaf("x", x, 1), float)
        check_values("x", x, POSITIVE)
        if self.compliance is not None:
            return self.compliance.at(x)[None]
        material = self.material
        terms, E = np.append(np.asarray(material.tau), np.inf), np.append(material.E, material.E_inf)
        name = self.data.conditions[0]
        ones = {own: np.ones(x.size) for own in self.data.values}
        arrays: dict[str, Any] = {name: x, **ones}
        at = type(self.data)(**arrays, check_units=False)
        return (matrix(at, terms) @ E).reshape(-1, x.size)

    def moduli(self, omega: ArrayLike | None = None) -> ModulusData:
        r"""Return E' and E'' of the fitted series with an estimate of their errors.

        This converts a relaxation modulus or a creep compliance to data for `fitting.fit`,
        `fit_master_curve` and `kramers_kronig`.

        .. math:: \sigma^2 = \sigma_\mathrm{noise}^2 + \max (E_\mathrm{grid} - E)^2 + \Delta E^2

        The first part follows from the covariance of the terms. The second part is the largest difference
        from three fits on relaxation times between those of this fit, which estimates the error of a discrete
        spectrum. The third part, for data over time, is the change if the spectrum of relaxation continued
        unchanged before the first and after the last measured time.

        Parameters
        ----------
        omega : angular frequencies [rad/s], shape (n,); None: 5 per decade from 1/t_max to 1/t_min

        Returns
        -------
        ModulusData with absolute errors, at the reference temperature of the shift. If data over time have
        one temperature and no shift, this temperature.

        Raises
        ------
        ValueError : omega is invalid, or the series on other times cannot be fitted
        """
        data = reduced(self.data, self.material.shift)
        if omega is None:
            x = np.sort(data.omega if isinstance(data, ModulusData) else 1 / data.time)
            count = max(int(np.ceil(_PER_DECADE * np.log10(x[-1] / x[0]))) + 1, 2)
            omega = np.geomspace(x[0], x[-1], count)
        omega = np.asarray(as_leaf("omega", omega, 1), float)
        check_values("omega", omega, POSITIVE)
        own = self.material.replace(shift=None)
        E = _parts_of(own, omega)
        tau = np.append(np.asarray(self.material.tau), np.inf)[: self.values.size]
        slopes = modulus_slopes(omega, tau, self.values, self.compliance)
        spread = self.uncertainty.spread if self.compliance is None else self.compliance.spread
        others = [self.refit(tau=tau).material.replace(shift=None) for tau in _other_grids(self.grid)]
        moved = np.abs([_parts_of(other, omega) - E for other in others]).max(axis=0)
        if not isinstance(data, ModulusData):
            moved = np.hypot(moved, _unseen(own, omega))
        noise = [np.sqrt(np.einsum("ij,jk,ik->i", part, spread, part)) for part in slopes]
        errors = np.maximum(np.hypot(noise, moved), _SMALLEST * E)
        T = None if data.temperature is None else data.temperature[0]
        name, body = f"{self.data.label}, converted", self.data.body
        return ModulusData(omega, *E, *errors, temperature=T, body=body, name=name, check_units=False)

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
        return f"<PronyFit: {terms} terms, {_listed(self.rms, ' to {:.2g}')} rms>"

    def report(self) -> str:
        """Return a report of several lines: the series, its misfit and its error bars."""
        tau = np.asarray(self.material.tau)
        times = f"tau = {tau.min():.3g} ... {tau.max():.3g} s"
        lines = [
            f"Prony series of {self.data.label}: {tau.size} terms, {times}",
            f"    {self.message}",
            f"    {self._misfit}",
        ]
        if self.smooth is not None:
            lines.append(f"    smooth: slopes change by about {self.smooth:.3g} from term to term")
        if self.weights[0] != self.weights[1]:
            lines.append(f"    weights: E' {self.weights[0]:g}, E'' {self.weights[1]:g}")
        if self.dropped.size:
            times, letter = (
                ", ".join(f"{t:.3g}" for t in self.dropped),
                "E" if self.compliance is None else "D",
            )
            lines.append(f"    absent, because {letter} = 0 in the best fit: tau = {times} s")
        lines.append(f"    {'tau [s]':>10} {'E [Pa]':>11}")
        lines += [f"    {time:>10} {value:>11}  {more}" for time, value, more in self._rows()]
        if np.inf in self.dropped and self.compliance is None:
            lines.append("    without E_inf the material is a liquid; for a solid, give E_inf")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        rows: list[tuple[str, ...] | str] = [*self._rows()]
        rows.append(self._misfit)
        if self.dropped.size:
            rows.append(f"absent: tau = {', '.join(f'{t:.3g}' for t in self.dropped)} s")
        caption = f"Prony series of {self.data.label}: {self.message}"
        return html.table(rows, ("tau [s]", "E [Pa]", "error [Pa]"), caption)

    @property
    def _misfit(self):
        """Rms of the residuals, and a recommendation if it is large."""
        text = f"rms of ln(fit / measured): {_listed(self.rms, ' {:.2%}')}"
        if max(self.rms.values()) > _POOR:
            text += ": poor; use more terms per decade, and check the data with fitting.kramers_kronig"
        return text

    def _rows(self):
        """Return a tuple of texts (time, modulus, error) for every term, with E_inf first.

        If a modulus has no error bar, the third text is the reason.
        """
        tau, E = np.asarray(self.material.tau), np.asarray(self.material.E)
        rows = [("inf", "E_inf", float(self.material.E_inf))]
        rows += [(f"{tau[i]:.4g}", f"E[{i}]", float(E[i])) for i in range(tau.size)]
        return [(time, f"{value:.4g}", error_text(self, name, value)) for time, name, value in rows]


def _listed(values: dict[str, float], form: str) -> str:
    """Return names and values as one text."""
    return ", ".join(f"{name}{form.format(value)}" for name, value in values.items())


def _parts_of(material: rf.Prony, omega: np.ndarray) -> np.ndarray:
    """Return E' and E'' [Pa] of a material without a shift, shape (2, n)."""
    modulus = rf.complex_modulus(material, omega)
    return np.stack([np.asarray(modulus.real), np.asarray(modulus.imag)])


def _other_grids(tau: np.ndarray) -> list[np.ndarray]:
    """Return relaxation times at three places between the times `tau`, up to a step beyond the ends."""
    log = np.sort(np.log(tau))
    step = np.diff(log) if log.size > 1 else np.ones(1)
    longer = np.concatenate([log[:1] - step[:1], log, log[-1:] + step[-1:]])
    return [np.exp(longer[:-1] + part * np.diff(longer)) for part in _PARTS]


def _unseen(material: rf.Prony, omega: np.ndarray) -> np.ndarray:
    r"""Return E' and E'' of relaxation outside the fitted times, if its spectrum H continued unchanged.

    .. math:: \Delta E' = \tfrac12 H \ln(1 + a^2),\qquad \Delta E'' = H \arctan a

    with a = omega tau below the shortest time tau, and a = 1 / (omega tau) above the longest. H is the mean
    of the terms of the last decade.
    """
    tau, E = np.asarray(material.tau), np.asarray(material.E)
    parts = np.zeros((2, omega.size))
    for end, inside in ((tau.min(), tau < 10 * tau.min()), (tau.max(), tau > tau.max() / 10)):
        H = E[inside].sum() / np.log(10)
        a = omega * end if end == tau.min() else 1 / (omega * end)
        parts = np.hypot(parts, H * np.stack([np.log1p(a**2) / 2, np.arctan(a)]))
    return parts
