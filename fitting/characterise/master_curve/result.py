"""What a fit of a master curve gives back."""

import dataclasses

import numpy as np

import rubberfric as rf
from fitting.characterise.master_curve.laws import ShiftLaw
from fitting.characterise.master_curve.overlap import Shifts
from fitting.characterise.master_curve.picture import plot_master_curve
from fitting.data.kinds import ModulusData
from fitting.parameters.priors import Prior
from fitting.uncertainty.posterior.as_prior import joint_prior
from rubberfric.plot import style


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MasterCurve:
    """Sweeps brought together, and by how much each was shifted.

    Attributes
    ----------
    data : the master curve at T_ref, of all points, by rising reduced frequency, for `fit_prony`,
        `kramers_kronig`, or `rubberfric.TabulatedModulus` after smoothing
    T : temperatures of the sweeps, rising [K], shape (n,)
    reference : which of them is T_ref
    log_aT, stderr : ln a_T and its standard errors (0 at T_ref) [-], shape (n,)
    log_bT, stderr_bT : ln b_T likewise; 0 without vertical shifts
    covariance : of ln a_T, shape (n, n)
    wlf, arrhenius : laws through the shifts with errors, or None where there is none
    law : the better of both by Akaike's criterion, or None
    shift : that law's `WLF` or `Arrhenius`; `table` where neither holds within the errors
    table : `TabulatedShift` of the shifts themselves
    residuals : ln E' and ln E'' less the smooth curve, in the order of `data`, shape (2, points)
    of_sweep : number of the sweep of every point of `data`
    scatter : relative errors of E' and E'': of the points about the curve, or those given (median)
    redchi : sum of squares by degrees of freedom, 1 where errors are estimated
    """

    data: ModulusData
    T: np.ndarray
    reference: int
    shifts: Shifts = dataclasses.field(repr=False)
    wlf: ShiftLaw | None
    arrhenius: ShiftLaw | None
    of_sweep: np.ndarray
    residuals: np.ndarray
    vertical: bool

    @property
    def T_ref(self) -> float:
        """Temperature of the master curve [K]."""
        return float(self.T[self.reference])

    @property
    def log_aT(self) -> np.ndarray:
        """ln a_T of every sweep."""
        return self.shifts.log_a

    @property
    def log_bT(self) -> np.ndarray:
        """ln b_T of every sweep."""
        return self.shifts.log_b

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of ln a_T."""
        return self.shifts.covariance[: self.T.size, : self.T.size]

    @property
    def stderr(self) -> np.ndarray:
        """Standard errors of ln a_T."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def stderr_bT(self) -> np.ndarray:
        """Standard errors of ln b_T."""
        return np.sqrt(np.diag(self.shifts.covariance)[self.T.size :])

    @property
    def scatter(self) -> tuple[float, float]:
        """Relative errors of E' and of E''."""
        return self.shifts.scatter

    @property
    def redchi(self) -> float:
        """Sum of squares by degrees of freedom, 1 where errors are estimated."""
        return self.shifts.redchi

    @property
    def law(self) -> ShiftLaw | None:
        """The better of both laws."""
        laws = [one for one in (self.wlf, self.arrhenius) if one is not None]
        return min(laws, key=lambda one: one.aic) if laws else None

    @property
    def table(self) -> rf.TabulatedShift:
        """The shifts themselves, a monotone cubic in between."""
        return rf.TabulatedShift(self.T, np.exp(self.log_aT), self.T_ref)

    @property
    def shift(self) -> rf.WLF | rf.Arrhenius | rf.TabulatedShift:
        """The better law where it holds within the errors, else the table."""
        law = self.law
        return law.shift if law is not None and law.holds else self.table

    def as_prior(self, body: str = "lower", widen: float = 1.0) -> dict[str, Prior]:
        """What the sweeps know of `shift`, for the `prior` of another fit.

        The other scene must have this `shift`; of a law its parameters are known, of a table a_T at all
        temperatures but T_ref.

        Parameters
        ----------
        body : "lower" or "upper", whose material it is there
        widen : factor of all deviations

        Returns
        -------
        dict of one `Correlated`, to be joined with other priors by "|"
        """
        law, owner = self.law, "lower.material.shift"
        if law is not None and law.holds:
            covariance = law.covariance / np.outer(law.values, law.values)
            paths, mean, places = [f"{owner}.{name}" for name in law.names], law.values, None
        else:
            r, moving = self.reference, np.delete(np.arange(self.T.size), self.reference)
            ends = [f"{owner}.aT[:{r}]"] * (r > 0) + [f"{owner}.aT[{r + 1}:]"] * (r + 1 < self.T.size)
            paths, mean, places = ends, np.exp(self.log_aT[moving]), self.T[moving]
            covariance = self.covariance[np.ix_(moving, moving)]
        none = np.full(mean.size, np.inf)
        places = np.full(mean.size, np.nan) if places is None else places
        return dict(joint_prior(paths, mean, covariance, (np.zeros(mean.size), none), places, body, widen))

    def __repr__(self) -> str:
        name = type(self.shift).__name__
        return f"<MasterCurve: {self.T.size} sweeps, T_ref = {self.T_ref:.6g} K, {name}>"

    def report(self) -> str:
        """Shifts, laws and scatter, as text of several lines."""
        low, high = self.data.omega[[0, -1]]
        lines = [
            f"Master curve of {self.T.size} sweeps at {self.T_ref:.6g} K, {low:.3g} ... {high:.3g} rad/s",
            f"    scatter: E' {self.scatter[0]:.2%}, E'' {self.scatter[1]:.2%}",
        ]
        if self.data.error is not None:
            lines.append(f"    errors given; reduced chi-square {self.redchi:.4g}")
        lines.append(f"    {'T [K]':>8} {'log10 a_T':>10}" + " " * 12 * self.vertical)
        for i, T in enumerate(self.T):
            bar = "(reference)" if i == self.reference else f"+/- {self.stderr[i] / np.log(10):.2g}"
            line = f"    {T:8.6g} {self.log_aT[i] / np.log(10):10.4f}  {bar}"
            if self.vertical and i != self.reference:
                line += f"   b_T {np.exp(self.log_bT[i]):.4f} +/- {self.stderr_bT[i]:.2g}"
            lines.append(line)
        for name, law in (("WLF", self.wlf), ("Arrhenius", self.arrhenius)):
            if law is None:
                lines.append(f"    {name}: none goes through these shifts")
                continue
            units = {"C1": "", "C2": " K", "energy": " eV"}
            each = zip(law.names, law.values, law.stderr, strict=True)
            said = ", ".join(f"{key} = {value:.4g} +/- {error:.2g}{units[key]}" for key, value, error in each)
            fit = f"chi-square {law.chisqr:.3g} of {law.freedom} degrees of freedom"
            better = "; the better" if law is self.law and None not in (self.wlf, self.arrhenius) else ""
            lines.append(f"    {name}: {said}; {fit}{'' if law.holds else ', does not hold'}{better}")
        if self.law is not None and not self.law.holds:
            lines.append("    no law holds within the errors: shift is the table")
        return "\n".join(lines)

    def plot(self, ax: style.Panels | None = None) -> style.Panels:
        """Shifted E' and E'', a colour for every temperature, and ln a_T with 95 % bars and the laws.

        Needs matplotlib: pip install 'rubberfric[plot]'.

        Parameters
        ----------
        ax : two matplotlib axes, or None for those of a new figure, `ax[0].figure`

        Returns
        -------
        the axes: moduli, shifts
        """
        shifts = (self.log_aT, self.stderr, self.reference)
        laws = {name: one.shift for name, one in (("WLF", self.wlf), ("Arrhenius", self.arrhenius)) if one}
        return plot_master_curve(self.data, self.of_sweep, self.T, shifts, laws, ax)
