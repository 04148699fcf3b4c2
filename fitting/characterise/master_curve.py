"""Fit a master curve to isothermal sweeps of E' and E'': shift factors, and laws fitted to them."""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, PchipInterpolator

import rubberfric as rf
from fitting.characterise.master_report import Fall, labelled_part, largest_fall, report_of
from fitting.characterise.pictures import plot_master_curve
from fitting.characterise.prony import over_frequency
from fitting.characterise.prony_series import Response
from fitting.characterise.shift_laws import ShiftLaw, arrhenius_through, wlf_through
from fitting.characterise.sweep_shifts import ENTROPIC, Shifts, shifts_of
from fitting.characterise.sweeps import superposed, sweeps_of
from fitting.data.kinds import ModulusData
from fitting.parameters.constraints import is_number
from fitting.parameters.priors import Prior
from fitting.uncertainty.posterior import joint_prior
from rubberfric.base import shown
from rubberfric.materials import log_factors
from rubberfric.plot import style

# Temperature of a room [K], near which the sweep of the default reference lies.
_ROOM = 293.15


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MasterCurve:
    """Master curve: the shifted sweeps, the shifts with their errors, and the laws fitted to the shifts.

    Attributes
    ----------
    data : the master curve at T_ref: all points with E' and E'' > 0, by rising reduced frequency, for
        `fit_prony`, `kramers_kronig`, or `rubberfric.TabulatedModulus` after smoothing
    T : temperatures of the sweeps, rising [K], shape (n,)
    reference : index of the sweep at T_ref
    wlf, arrhenius : laws through the shifts with errors, whose `shift` includes b_T; None if no law fits
    residuals : ln E' and ln E'' minus the smooth curve, in the order of `data`, shape (2, points)
    of_sweep : index of the sweep that contains each point of `data`
    offsets : mean of ln E' and of ln E'' minus the smooth curve for every sweep, shape (2, n)
    offset_errors : standard errors of `offsets`, from the scatter of the points, shape (2, n)
    bad_points : ("E'" or "E''", T [K], omega [rad/s]) of points <= 0 or beyond four standard deviations

    Examples
    --------
    >>> curve = fitting.fit_master_curve(fitting.read("data/laboratory/dma_isothermen.csv"))
    >>> law = curve.wlf.shift
    >>> round(float(law.C1)), round(float(law.C2)), round(float(curve.T_ref))
    (12, 151, 293)
    >>> print(curve.report().splitlines()[0])
    Master curve of 15 sweeps at 293.153 K, 0.000219 ... 2.2e+13 rad/s
    >>> list(curve.to_dataframe("shifts"))[:2]
    ['T [K]', 'aT [-]']
    """

    data: ModulusData
    T: np.ndarray
    reference: int
    shifts: Shifts = dataclasses.field(repr=False)
    wlf: ShiftLaw | None
    arrhenius: ShiftLaw | None
    of_sweep: np.ndarray
    residuals: np.ndarray
    offsets: np.ndarray
    offset_errors: np.ndarray
    bad_points: tuple[tuple[str, float, float], ...]
    vertical: bool | str
    temperature_error: float

    @property
    def T_ref(self) -> float:
        """Temperature of the master curve [K]."""
        return float(self.T[self.reference])

    @property
    def log_aT(self) -> np.ndarray:
        """ln a_T of every sweep [-], shape (n,)."""
        return self.shifts.log_a

    @property
    def log_bT(self) -> np.ndarray:
        """ln b_T of every sweep [-], 0 without vertical shifts, shape (n,)."""
        return self.shifts.log_b

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of ln a_T, shape (n, n)."""
        return self.shifts.covariance[: self.T.size, : self.T.size]

    @property
    def stderr(self) -> np.ndarray:
        """Standard errors of ln a_T [-], 0 at T_ref, shape (n,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def stderr_bT(self) -> np.ndarray:
        """Standard errors of ln b_T [-], shape (n,)."""
        return np.sqrt(np.diag(self.shifts.covariance)[self.T.size :])

    @property
    def scatter(self) -> tuple[float, float]:
        """Relative errors of E' and of E'': scatter within sweeps, or medians of the given errors."""
        return self.shifts.scatter

    @property
    def redchi(self) -> float:
        """Sum of squared residuals divided by the degrees of freedom, or 1 if errors are estimated."""
        return self.shifts.redchi

    @property
    def law(self) -> ShiftLaw | None:
        """The better of `wlf` and `arrhenius` by Akaike's criterion; None if no law fits."""
        laws = [law for law in (self.wlf, self.arrhenius) if law is not None]
        return min(laws, key=lambda law: law.aic) if laws else None

    @functools.cached_property
    def fall(self) -> Fall | None:
        """The most significant fall of E' with frequency, None if none exceeds 4 standard errors and 3 %.

        A vertical shift that the data show is removed before. A fall shows that the sweeps do not superpose.
        """
        return largest_fall(self)

    @functools.cached_property
    def table(self) -> rf.TabulatedShift:
        """The shifts as a `TabulatedShift`, with monotone cubic interpolation between the sweeps.

        The field `vertical` of `table`, of `shift` and of the laws is a `TabulatedVertical` if the argument
        `vertical` is True, `Entropic` if it is "entropic", and otherwise None. A `TabulatedVertical` covers
        the temperatures of the sweeps only.
        """
        return rf.TabulatedShift(
            self.T, np.exp(self.log_aT), self.T_ref, vertical=self._vertical(self.log_aT)
        )

    @functools.cached_property
    def shift(self) -> rf.WLF | rf.Arrhenius | rf.TabulatedShift:
        """Shift of `law` if `law` fits ln a_T within the errors, otherwise `table`.

        With a law, b_T of each sweep is fitted again with the a_T of the law, so that the shifted curve keeps
        the mean moduli of the sweep.
        """
        law = self.law
        if law is None or not law.holds:
            return self.table
        return law.shift

    def _with_vertical(self, law):
        """Return a law, or None, whose shift includes the law for b_T."""
        if law is None or not self.vertical:
            return law
        vertical = self._vertical(log_factors(law.shift, self.T))
        return law._replace(shift=law.shift.replace(vertical=vertical))

    def _vertical(self, log_aT):
        """Return the law for b_T if ln a_T of the sweeps is log_aT, shape (n,)."""
        if self.vertical == "entropic":
            return ENTROPIC
        if not self.vertical:
            return None
        t, log_b = np.log(self.data.omega), self.log_bT.copy()
        change = self.shifts.curve(t) - self.shifts.curve(t + (log_aT - self.log_aT)[self.of_sweep])
        for i in np.delete(np.unique(self.of_sweep), self.reference):
            log_b[i] += change[:, self.of_sweep == i].mean()
        return rf.TabulatedVertical(self.T, np.exp(log_b))

    def to_dataframe(self, part: str = "curve") -> Any:
        """Return the "curve" or the "shifts" as a pandas.DataFrame, see `master_report.labelled_part`."""
        return labelled_part(self, part).to_dataframe()

    def to_xarray(self, part: str = "curve") -> Any:
        """Return the "curve" over omega, or the "shifts" over T, as an xarray.Dataset."""
        return labelled_part(self, part).to_xarray()

    def as_prior(self, body: str = "lower", widen: float = 1.0) -> dict[str, Prior]:
        """Return the fitted `shift` and its covariance as the `prior` of another fit.

        The scene of the other fit must have this `shift`. The prior contains the parameters of a law, or a_T
        of a table at all temperatures except T_ref. The prior does not contain b_T.

        Parameters
        ----------
        body : "lower" or "upper", the body of the other scene that has this shift
        widen : factor that multiplies all standard deviations

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

    def moduli(self, omega: np.ndarray, temperature: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the expected ln E' and ln E'' of a further sweep, and their standard errors.

        The errors include the errors of the curve and of the shift, an error of the temperature, the offset
        of a sweep, and the scatter of its points.

        Parameters
        ----------
        omega : angular frequencies [rad/s], shape (points,)
        temperature : temperature of the further sweep [K], within the range of the measured sweeps

        Returns
        -------
        values and standard errors, each of shape (2, points)

        Raises
        ------
        ValueError : the temperature is outside the range of the sweeps
        """
        if not self.T[0] <= temperature <= self.T[-1]:
            raise ValueError(
                f"temperature = {temperature:g} K: must be {self.T[0]:.6g} ... {self.T[-1]:.6g} K, the range"
                " of the sweeps"
            )
        shifts, n = self.shifts, self.T.size
        between = np.array([np.interp(temperature, self.T, e) for e in np.eye(n)])
        log_a = PchipInterpolator(self.T, self.log_aT)(temperature)
        log_b = np.interp(temperature, self.T, self.log_bT + shifts.hidden)
        t = np.log(omega) + log_a
        inside = np.clip(t, shifts.knots[3], shifts.knots[-4] - 1e-9)
        B = BSpline.design_matrix(inside, shifts.knots, 3).toarray()
        y = shifts.splines @ B.T
        slope = np.array([BSpline(shifts.knots, c, 3).derivative()(inside) for c in shifts.splines])
        # Temperature errors of the sweep itself and of its neighbours.
        thermal = self.temperature_error * PchipInterpolator(self.T, self.log_aT).derivative()(temperature)
        variance = np.array(shifts.offset)[:, None] ** 2 + np.array(shifts.scatter)[:, None] ** 2
        variance = variance + 1.5 * (slope * thermal) ** 2
        variance += shifts.phase**2 * np.exp(2 * (y[1] - y[0]) * np.array([[1], [-1]]))
        for k in (0, 1):
            X = np.concatenate([B, slope[k][:, None] * between], axis=1)
            variance[k] += np.einsum("ij,ij->i", X @ shifts.covariances[k], X)
        return y + log_b, np.sqrt(variance)

    def __repr__(self) -> str:
        name = type(self.shift).__name__
        return f"<MasterCurve: {self.T.size} sweeps, T_ref = {self.T_ref:.6g} K, {name}>"

    def report(self, *, command: bool = False) -> str:
        """Return a report of several lines: shifts, laws, scatter, and sweeps that do not superpose.

        Parameters
        ----------
        command : True names options of `rubberfric-fit mastercurve`, False arguments of this package
        """
        return report_of(self, command)

    def plot(self, ax: style.Panels | None = None, series: Any = None) -> style.Panels:
        """Draw shifted E' and E'' coloured by temperature, and ln a_T with 95 % error bars and laws.

        Needs matplotlib: pip install 'rubberfric[plot]'.

        Parameters
        ----------
        ax : two matplotlib axes; None: a new figure, `ax[0].figure`
        series : PronyFit of this curve, drawn as lines, or None

        Returns
        -------
        the axes: moduli, shifts
        """
        return plot_master_curve(self, ax, series)


def fit_master_curve(
    isotherms: Response | Sequence[Response],
    reference: float | None = None,
    *,
    vertical: bool | str = False,
    same: float = 1.0,
    temperature_error: float = 0.5,
) -> MasterCurve:
    r"""Fit shift factors, their law, and the master curve of sweeps at several temperatures.

    .. math:: E(\omega, T) = b_T E(a_T \omega, T_\mathrm{ref})

    One smooth curve of ln E' and one of ln E'' go through all sweeps at once
    (`fitting.characterise.sweep_shifts`). The laws are fitted to the shifts with their covariance
    [Williams, Landel & Ferry, J. Am. Chem. Soc. 77 (1955) 3701, doi:10.1021/ja01619a008]. The
    Vogel-Fulcher-Tammann law is the WLF law with T_0 = T_ref - C2.

    Parameters
    ----------
    isotherms : ModulusData with a temperature for every row, or a list of them
        RelaxationData and CreepData are converted at each temperature by `fit_prony(...).moduli()`.
        Rows may be in any order, and a sweep may be spread over several data sets. Data with absolute errors
        may contain E' or E'' <= 0; these values are ignored and named in the report.
    reference : temperature of the master curve [K]; the nearest sweep is used
        None: the sweep nearest to 20 °C.
    vertical : True: b_T of every sweep is fitted; False: b_T = 1
        "entropic": b_T = T rho / (T_ref rho_ref), `rubberfric.Entropic` with an expansion of 6e-4 1/K.
        The `vertical` of the fitted `shift` is the law for b_T.
        The right setting gives the smallest contradiction, `kramers_kronig(curve.data).rms`.
    same : largest difference between neighbouring temperatures within a sweep [K]
        A drift within a sweep is corrected with the shifts of the other sweeps.
    temperature_error : standard deviation of the temperature of a sweep [K]
        Superposition cannot detect an error of the temperature. temperature_error times the slope of ln a_T
        therefore contributes to the standard errors. With 0, temperatures count as exact; if they are not,
        the standard errors of the shifts are too small, and the report names the error that they show.

    Returns
    -------
    MasterCurve

    Raises
    ------
    ValueError
        `reference` is far from all sweeps, the data have no temperatures or fewer than two, a sweep has
        fewer than two points > 0, or E' rises on heating by more than a vertical shift explains, as it does
        in a gel that stiffens. The message is one line.

    Notes
    -----
    Neighbours that share few points or none are joined by the smoothness of the curve and get large errors. A
    prior limits the change of d ln a_T / dT between neighbouring sweeps to about 30 %.
    If errors of the data are not given, they follow from the scatter. The standard errors also include an
    offset of each sweep (1 % or more), correlated scatter, a phase error of the instrument, and an unknown
    vertical shift (T/T_ref)^m, m = 0 +/- 0.25. If `vertical` is False, but the moduli fit much better with
    a power of T/T_ref, ln a_T allows for this factor, and the report says so. The report recommends
    "entropic" only if the moduli rise about as the entropic b_T, otherwise True.

    Examples
    --------
    At -50 °C a_T is e^24, as of the WLF shift with C1 = 12 and C2 = 150 K that made these data:

    >>> data = fitting.read("data/laboratory/dma_isothermen.csv")
    >>> curve = fitting.fit_master_curve(data, reference=293.15)
    >>> round(float(curve.T[0]) - 273.15), round(float(curve.log_aT[0])), round(float(curve.stderr[0]), 1)
    (-50, 24, 0.3)
    """
    _check(reference, vertical, same, temperature_error)
    measured: Any = over_frequency(isotherms, float(same))
    sweeps = sweeps_of(measured, float(same))
    T = np.array([sweep.T for sweep in sweeps])
    nearest = int(np.argmin(np.abs(T - (_ROOM if reference is None else reference))))
    if reference is not None and abs(T[nearest] - reference) > same:
        raise ValueError(
            f"reference = {reference:g} K: must be the temperature of a sweep:"
            f" {', '.join(f'{kelvin:.6g}' for kelvin in T)} K"
        )
    shifts = shifts_of(sweeps, nearest, vertical, float(temperature_error))
    moving = np.delete(np.arange(T.size), nearest)
    known = (T[moving], shifts.log_a[moving], shifts.covariance[np.ix_(moving, moving)], float(T[nearest]))
    which = np.repeat(np.arange(T.size), [sweep.t.size for sweep in sweeps])
    y = np.concatenate([sweep.y for sweep in sweeps], axis=1) - shifts.log_b[which]
    order = np.argsort(shifts.t, kind="stable")
    order = order[np.all(np.isfinite(y), axis=0)[order]]
    residuals = y - shifts.smooth
    offsets, offset_errors = shifts.offsets(residuals, which)
    omega = np.exp(np.concatenate([sweep.t for sweep in sweeps]))
    curve = MasterCurve(
        data=superposed(measured, sweeps, shifts.t, y, order),
        T=T,
        reference=nearest,
        shifts=shifts,
        wlf=wlf_through(*known),
        arrhenius=arrhenius_through(*known),
        of_sweep=which[order],
        residuals=residuals[:, order],
        offsets=offsets,
        offset_errors=offset_errors,
        bad_points=tuple(
            (("E'", "E''")[k], float(T[which[i]]), float(omega[i]))
            for k, i in zip(*np.nonzero(shifts.bad), strict=True)
        ),
        vertical=vertical,
        temperature_error=float(temperature_error),
    )
    laws = {name: curve._with_vertical(getattr(curve, name)) for name in ("wlf", "arrhenius")}
    return dataclasses.replace(curve, **laws)


def _check(reference, vertical, same, temperature_error):
    if not (isinstance(vertical, bool) or vertical == "entropic"):
        raise ValueError(f'vertical = {shown(vertical)}: must be True, False or "entropic"')
    if not (is_number(same) and same > 0):
        raise ValueError(f"same = {shown(same)}: must be a number > 0 [K]")
    if not (is_number(temperature_error) and temperature_error >= 0):
        raise ValueError(f"temperature_error = {shown(temperature_error)}: must be a number >= 0 [K]")
    if reference is not None and not (is_number(reference) and reference > 0):
        raise ValueError(f"reference = {shown(reference)}: must be None or a temperature > 0 [K]")
