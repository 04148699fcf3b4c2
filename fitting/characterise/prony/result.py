"""What a fit of a Prony series gives back."""

import dataclasses
import functools

import numpy as np

import rubberfric as rf
from fitting.characterise.prony.picture import plot_series
from fitting.characterise.prony.series import Solution
from fitting.data.kinds import ModulusData
from fitting.fit import fit
from fitting.parameters.constraints import Positive, Rule
from fitting.parameters.priors import Prior, Smooth
from fitting.results.result import FitResult
from fitting.solvers.iterate import CONVERGED, MESSAGES, PERFECT, STALLED
from fitting.uncertainty.covariance import Direction
from fitting.uncertainty.posterior.as_prior import joint_prior
from rubberfric.base import html
from rubberfric.plot import style

# Cosine between the residuals and a change of ln E that is a minimum still, and rms that is rounding.
_FLAT, _EXACT = 1e-4, 1e-9


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PronyFit:
    """A Prony series and how well it meets the modulus it was fitted to.

    Attributes
    ----------
    material : Prony, terms that the data want absent left out
    dropped : relaxation times of those [s]; inf stands for E_inf
    residuals : ln(fit / measured) of E' and of E'', shape (2, n); NaN where measured <= 0
    rms_storage, rms_loss : their root mean squares
    data : what was fitted
    smooth : sigma of the prior that was used, the one found for "auto", or None
    weights : of E' and of E''
    names : key paths of the moduli that were fitted
    values, stderr, covariance : the moduli [Pa], their errors and covariance; NaN where withheld
    correlation : of ln E; NaN where withheld
    withheld : why a modulus has no error bar, by its name
    unidentified : directions that the data leave open
    estimated : relative error estimated from the scatter, None where errors were given
    freedom : measured values minus the moduli that they determine
    success, message : whether and how the minimum was reached
    """

    material: rf.Prony
    dropped: np.ndarray
    residuals: np.ndarray
    data: ModulusData
    smooth: float | None
    weights: tuple[float, float]
    names: tuple[str, ...]
    solution: Solution = dataclasses.field(repr=False)
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
    def covariance(self) -> np.ndarray:
        """Covariance of the moduli [Pa^2], NaN where withheld."""
        return self.solution.uncertainty.covariance

    @property
    def stderr(self) -> np.ndarray:
        """Standard errors of the moduli [Pa], NaN where withheld."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> np.ndarray:
        """Correlation of the logarithms of the moduli, NaN where withheld."""
        return self.solution.uncertainty.correlation

    @property
    def withheld(self) -> dict[str, str]:
        """Why a modulus has no error bar, by its name."""
        return self.solution.uncertainty.withheld

    @property
    def unidentified(self) -> tuple[Direction, ...]:
        """What the data leave open."""
        return self.solution.uncertainty.unidentified

    @property
    def estimated(self) -> float | None:
        """Relative error estimated from the scatter, None where errors were given."""
        return self.solution.scale

    @property
    def freedom(self) -> float:
        """Measured values minus the moduli that they determine."""
        return self.count - self.solution.uncertainty.parameters

    @property
    def _status(self) -> int:
        if max(self.rms_storage, self.rms_loss) < _EXACT:
            return PERFECT
        return CONVERGED if self.solution.slope < _FLAT else STALLED

    @property
    def success(self) -> bool:
        """Whether the minimum was reached."""
        return self._status != STALLED

    @property
    def message(self) -> str:
        """How the fit ended."""
        return MESSAGES[self._status]

    def as_prior(self, body: str | None = None, widen: float = 1.0) -> dict[str, Prior]:
        """What the data know of the moduli, for the `prior` of another fit: of friction, for one.

        The other scene must have this `material`, or one of the same relaxation times.

        Parameters
        ----------
        body : "lower" or "upper", whose material it is there; None: that of the data, or "lower"
        widen : factor of all deviations, for what a modulus measured in oscillation leaves out

        Returns
        -------
        dict of one `Correlated`, to be joined with other priors by "|"
        """
        if not self.success:
            raise ValueError(f"as_prior: the fit did not succeed, {self.message}: must have converged")
        known, tau = self.solution.uncertainty, np.asarray(self.material.tau)
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
        """The same moduli by `fitting.fit`, which can do more: intervals, profiles, bootstrap, files.

        Made when it is asked for, in seconds, as its derivatives are compiled. It weighs E' and E'' alike:
        ValueError if others were given.
        """
        if self.weights[0] != self.weights[1]:
            raise ValueError(f"weights = {self.weights}: fitting.fit weighs E' and E'' alike; must be (1, 1)")
        body = self.names[0].split(".")[0]
        own, other = rf.Body(self.material), rf.Body(rf.Rigid())
        scene = rf.Scene(own, other) if body == "lower" else rf.Scene(other, own)
        free: dict[str, Rule] = {f"{body}.material.E": Positive()}
        if self.names[-1].endswith("E_inf"):
            free[f"{body}.material.E_inf"] = Positive()
        prior: dict[str, Prior] = {}
        if self.smooth is not None:
            prior[f"{body}.material.E"] = Smooth(self.smooth)
        return fit(scene, self.data, free, prior=prior)

    def plot(self, ax: style.Panels | None = None) -> style.Panels:
        """Measured E' and E'', the series, its terms, and the residuals below.

        Needs matplotlib: pip install 'rubberfric[plot]'.

        Parameters
        ----------
        ax : two matplotlib axes, or None for those of a new figure, `ax[0].figure`

        Returns
        -------
        the axes: moduli, residuals
        """
        return plot_series(self.material, self.data, self.residuals, ax)

    def __repr__(self) -> str:
        terms = self.material.tau.size
        return f"<PronyFit: {terms} terms, E' to {self.rms_storage:.2g}, E'' to {self.rms_loss:.2g} rms>"

    def report(self) -> str:
        """The series and its error bars, as text of several lines."""
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
            lines.append(f"    absent, since the data are met best without them: tau = {times} s")
        lines.append(f"    {'tau [s]':>10} {'E [Pa]':>11}")
        lines += [f"    {time:>10} {value:>11}  {more}" for time, value, more in self._rows()]
        if np.inf in self.dropped:
            lines.append("    without E_inf it is a liquid; if it is a solid, give its E_inf")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """A table for notebooks."""
        rows: list[tuple[str, ...] | str] = [*self._rows()]
        rows.append(f"rms of ln(fit / measured): E' {self.rms_storage:.2%}, E'' {self.rms_loss:.2%}")
        if self.dropped.size:
            rows.append(f"absent: tau = {', '.join(f'{t:.3g}' for t in self.dropped)} s")
        caption = f"Prony series of {self.data.label}: {self.message}"
        return html.table(rows, ("tau [s]", "E [Pa]", "error [Pa]"), caption)

    def _rows(self):
        """Texts of every term, E_inf first: relaxation time, modulus, and its error or why it has none."""
        tau, E = np.asarray(self.material.tau), np.asarray(self.material.E)
        rows = [("inf", "E_inf", float(self.material.E_inf))]
        rows += [(f"{tau[i]:.4g}", f"E[{i}]", float(E[i])) for i in range(tau.size)]
        return [(time, f"{value:.4g}", self._error(name, value)) for time, name, value in rows]

    def _error(self, name, value):
        """Error of a modulus, why it has none, or that it was fixed."""
        names = [full.rsplit(".", 1)[1] for full in self.names]
        if name not in names:
            return "(fixed)"
        i = names.index(name)
        if self.names[i] in self.withheld:
            return f"error bar withheld: {self.withheld[self.names[i]]}"
        return f"+/- {self.stderr[i]:.2g} ({self.stderr[i] / value:.1%})"
