"""Fit a master curve: shift factors of isothermal sweeps of E' and E'', and the laws through them."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.stats
from scipy.optimize import least_squares

import rubberfric as rf
from fitting.characterise.pictures import plot_master_curve
from fitting.characterise.sweep_shifts import Shifts, check_overlap, shifts_of, sweeps_of
from fitting.data.kinds import ModulusData
from fitting.parameters.constraints import is_number
from fitting.parameters.priors import Prior
from fitting.uncertainty.posterior import joint_prior
from rubberfric.base import shown
from rubberfric.plot import style

# Chance of as large a misfit below which a law does not hold.
_CHANCE = 1e-3
_FAR = 1e5  # C2 [K] beyond which WLF is a straight line over any temperatures
_ROOM = 293.15


class ShiftLaw(NamedTuple):
    """A law through shift factors.

    Attributes
    ----------
    shift : WLF or Arrhenius
    names : of its parameters, ("C1", "C2") or ("energy",)
    values, stderr, covariance : of them; C1 [-], C2 [K], energy [eV]
    chisqr, freedom : sum of squares of the misfit in standard errors, and shifts less parameters
    """

    shift: rf.WLF | rf.Arrhenius
    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    chisqr: float
    freedom: int

    @property
    def stderr(self) -> np.ndarray:
        """Standard errors of the parameters."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def holds(self) -> bool:
        """True if chance exceeds the misfit, by chi-square, with a probability above 0.1 %."""
        return self.freedom == 0 or bool(scipy.stats.chi2.sf(self.chisqr, self.freedom) > _CHANCE)

    @property
    def aic(self) -> float:
        """Akaike's criterion up to a constant; lower is better."""
        return self.chisqr + 2 * len(self.names)


def wlf_through(T: np.ndarray, log_a: np.ndarray, covariance: np.ndarray, T_ref: float) -> ShiftLaw | None:
    r"""Return log10 a_T = -C1 (T - T_ref) / (C2 + T - T_ref) through ln a_T with their covariance.

    T, log_a and covariance exclude T_ref, shape (n,). None for n < 2, which leaves a parameter undetermined,
    and if the shifts do not fall with temperature.
    """
    if T.size < 2:
        return None
    above, whiten = T - T_ref, _whitener(covariance)
    aim = -log_a / np.log(10)

    def rows(p):
        return whiten @ ((p[0] * above / (p[1] + above) - aim) * np.log(10))

    def slopes(p):
        by = np.stack([above / (p[1] + above), -p[0] * above / (p[1] + above) ** 2], axis=1)
        return whiten @ (by * np.log(10))

    lowest = max(1e-3, 1e-3 - above.min())  # no pole among the temperatures
    # (T - T_ref)/aim = C2/C1 + (T - T_ref)/C1 is a straight line.
    slope, offset = np.polyfit(above, above / np.where(aim == 0, 1e-12, aim), 1)
    starts = [(17.4, 51.6 + lowest), (8.86, 101.6 + lowest), (100.0, 1000.0 + lowest)]
    if slope > 0 and offset / slope > lowest:
        starts.insert(0, (1 / slope, offset / slope))
    bounds = ([1e-6, lowest], [np.inf, _FAR])
    found = [
        least_squares(
            rows,
            np.clip(p, bounds[0], bounds[1]),
            slopes,  # pyright: ignore[reportArgumentType]  # the stub knows text only
            bounds=bounds,
            x_scale="jac",
            xtol=1e-13,
        )
        for p in starts
    ]
    best = min(found, key=lambda one: one.cost)
    if not best.x[0] > 1e-5:
        return None
    J = slopes(best.x)
    inner = np.linalg.pinv(J.T @ J, rcond=1e-14, hermitian=True)
    law = rf.WLF(float(best.x[0]), float(best.x[1]), T_ref)
    return ShiftLaw(law, ("C1", "C2"), best.x, inner, 2 * float(best.cost), T.size - 2)


def arrhenius_through(
    T: np.ndarray, log_a: np.ndarray, covariance: np.ndarray, T_ref: float
) -> ShiftLaw | None:
    """Return the Arrhenius law through ln a_T with their covariance; None if its energy is not > 0."""
    whiten = _whitener(covariance)
    of_one_eV = np.asarray(rf.Arrhenius(1.0, T_ref).log_factor(T), float)
    column, aim = whiten @ of_one_eV, whiten @ log_a
    size = column @ column
    energy = float(column @ aim / size)
    if not energy > 0:
        return None
    rest = aim - energy * column
    law = rf.Arrhenius(energy, T_ref)
    return ShiftLaw(
        law, ("energy",), np.array([energy]), np.array([[1 / size]]), float(rest @ rest), T.size - 1
    )


def _whitener(covariance):
    """Return W with W C W^T = 1."""
    values, vectors = np.linalg.eigh(covariance)
    values = np.maximum(values, 1e-14 * values.max())
    return (vectors / np.sqrt(values)).T


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
    wlf, arrhenius : laws through the shifts with errors; None if no law fits
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
        """Return the fitted `shift` and its covariance as the `prior` of another fit.

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
        """Return the shifts, laws and scatter, as text of several lines."""
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
        """Draw shifted E' and E'' coloured by temperature, and ln a_T with 95 % error bars and laws.

        Needs matplotlib: pip install 'rubberfric[plot]'.

        Parameters
        ----------
        ax : two matplotlib axes; None: a new figure, `ax[0].figure`

        Returns
        -------
        the axes: moduli, shifts
        """
        shifts = (self.log_aT, self.stderr, self.reference)
        laws = {name: one.shift for name, one in (("WLF", self.wlf), ("Arrhenius", self.arrhenius)) if one}
        return plot_master_curve(self.data, self.of_sweep, self.T, shifts, laws, ax)


def fit_master_curve(
    isotherms: ModulusData | Sequence[ModulusData],
    reference: float | None = None,
    *,
    vertical: bool = False,
    same: float = 1.0,
) -> MasterCurve:
    r"""Shift factors, their law, and the master curve of sweeps at several temperatures.

    .. math:: E(\omega, T) = b_T E(a_T \omega, T_\mathrm{ref})

    The shifts bring ln E' and ln E'' of all sweeps closest to one smooth curve
    (`fitting.characterise.sweep_shifts`); the laws are fitted to them with their covariance
    [Williams, Landel & Ferry, J. Am. Chem. Soc. 77 (1955) 3701, doi:10.1021/ja01619a008].

    Parameters
    ----------
    isotherms : ModulusData with a temperature for every row, or a list of them
        in any order and several files; a sweep may be spread over them.
    reference : temperature of the master curve [K]; the nearest sweep is used
        None: the sweep nearest to 20 °C.
    vertical : whether moduli are shifted, too, by b_T
    same : rows belong to one sweep whose temperatures lie closer together than this [K]
        a drift within a sweep is allowed for by the shifts of the others.

    Returns
    -------
    MasterCurve

    Raises
    ------
    ValueError
        one line: neighbouring sweeps that do not overlap, by their temperatures; a reference away from all
        sweeps; less than two temperatures or three points in a sweep; values <= 0; no temperature.

    Notes
    -----
    Errors of the data that are not given follow from the scatter of E' and of E'' about the curve, each by
    itself. Time-temperature superposition is an assumption: where E' and E'' want different shifts, the
    residuals show it. Bars hold for smooth relaxation spectra; with single terms a decade apart, whose
    ripples the curve cannot follow through the scatter, they are a quarter too small.
    """
    if not isinstance(vertical, bool):
        raise ValueError(f"vertical = {shown(vertical)}: must be True or False")
    if not (is_number(same) and same > 0):
        raise ValueError(f"same = {shown(same)}: must be a number > 0 [K]")
    if reference is not None and not (is_number(reference) and reference > 0):
        raise ValueError(f"reference = {shown(reference)}: must be None or a temperature > 0 [K]")
    sweeps = sweeps_of(isotherms, float(same))
    T = np.array([one.T for one in sweeps])
    nearest = int(np.argmin(np.abs(T - (_ROOM if reference is None else reference))))
    if reference is not None and abs(T[nearest] - reference) > same:
        raise ValueError(
            f"reference = {reference:g} K: must be the temperature of a sweep:"
            f" {', '.join(f'{one:.6g}' for one in T)} K"
        )
    shifts = shifts_of(sweeps, nearest, vertical)
    check_overlap(sweeps, shifts.log_a)
    moving = np.delete(np.arange(T.size), nearest)
    known = (T[moving], shifts.log_a[moving], shifts.covariance[np.ix_(moving, moving)], float(T[nearest]))
    sets = [isotherms] if isinstance(isotherms, ModulusData) else list(isotherms)
    order = np.argsort(shifts.t, kind="stable")
    which = np.repeat(np.arange(T.size), [one.t.size for one in sweeps])
    y = np.concatenate([one.y for one in sweeps], axis=1)
    moduli = np.exp(y - shifts.log_b[which])[:, order]
    errors = {}
    if sweeps[0].error is not None:
        sigma = (
            moduli * np.concatenate([one.error for one in sweeps if one.error is not None], axis=1)[:, order]
        )
        errors = {"sigma_storage": sigma[0], "sigma_loss": sigma[1]}
    bodies = {one.body for one in sets}
    data = ModulusData(
        np.exp(shifts.t[order]),
        *moduli,
        **errors,
        name=f"master curve of {sets[0].name}" if sets[0].name and len(sets) == 1 else "master curve",
        body=bodies.pop() if len(bodies) == 1 else None,
        check_units=False,
    )
    return MasterCurve(
        data=data,
        T=T,
        reference=nearest,
        shifts=shifts,
        wlf=wlf_through(*known),
        arrhenius=arrhenius_through(*known),
        of_sweep=which[order],
        residuals=(y - shifts.log_b[which] - shifts.smooth)[:, order],
        vertical=vertical,
    )
