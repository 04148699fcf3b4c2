"""Fit the WLF and Arrhenius laws to shift factors with their covariance."""

from typing import NamedTuple

import numpy as np
import scipy
from scipy.optimize import least_squares

import rubberfric as rf
from fitting.parameters.correlated import whitener
from rubberfric.materials import log_factors

_CHANCE = 1e-3  # probability of a misfit as large, below which a law does not hold
_FAR = 1e5  # C2 [K] beyond which WLF is a straight line over any temperatures


class ShiftLaw(NamedTuple):
    """Shift law that was fitted to shift factors.

    Attributes
    ----------
    shift : WLF or Arrhenius
    names : names of its parameters, ("C1", "C2") or ("energy",)
    values, stderr, covariance : parameters, their standard errors and covariance; C1 [-], C2 [K], energy [eV]
        The covariance includes a factor chisqr / freedom where the misfit exceeds the errors of the shifts
        [Birge, Phys. Rev. 40 (1932) 207], as it does if `temperature_error` is too small.
    chisqr, freedom : chi-square of the misfit, and degrees of freedom
    """

    shift: rf.WLF | rf.Arrhenius
    names: tuple[str, ...]
    values: np.ndarray
    covariance: np.ndarray
    chisqr: float
    freedom: int

    @property
    def stderr(self) -> np.ndarray:
        """Standard errors of the parameters, shape (parameters,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def holds(self) -> bool:
        """True if the chi-square probability of a misfit at least as large is above 0.1 %.

        A law without degrees of freedom always holds.
        """
        return self.freedom == 0 or bool(scipy.special.chdtrc(self.freedom, self.chisqr) > _CHANCE)

    @property
    def aic(self) -> float:
        """Akaike's information criterion up to a constant. The law with the lower value is better."""
        return self.chisqr + 2 * len(self.names)


def wlf_through(T: np.ndarray, log_a: np.ndarray, covariance: np.ndarray, T_ref: float) -> ShiftLaw | None:
    """Fit the WLF law log10 a_T = -C1 (T - T_ref) / (C2 + T - T_ref) to ln a_T with the given covariance.

    T and log_a have shape (n,). T, log_a and the covariance exclude the reference temperature. Return None if
    n < 2, because a single shift does not determine two parameters. Return None if the shifts do not decrease
    with temperature.
    """
    if T.size < 2:
        return None
    above, whiten = T - T_ref, whitener(covariance)
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
    fits = [
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
    best = min(fits, key=lambda fit: fit.cost)
    if not best.x[0] > 1e-5:
        return None
    J = slopes(best.x)
    inner = np.linalg.pinv(J.T @ J, rcond=1e-14, hermitian=True)
    law = rf.WLF(float(best.x[0]), float(best.x[1]), T_ref)
    misfit, freedom = 2 * float(best.cost), T.size - 2
    return ShiftLaw(law, ("C1", "C2"), best.x, inner * _birge(misfit, freedom), misfit, freedom)


def arrhenius_through(
    T: np.ndarray, log_a: np.ndarray, covariance: np.ndarray, T_ref: float
) -> ShiftLaw | None:
    """Fit the Arrhenius law to ln a_T with the given covariance.

    T, log_a and the covariance exclude the reference temperature. Return None if the fitted energy is <= 0.
    """
    whiten = whitener(covariance)
    of_one_eV = log_factors(rf.Arrhenius(1.0, T_ref), T)
    column, aim = whiten @ of_one_eV, whiten @ log_a
    size = column @ column
    energy = float(column @ aim / size)
    if not energy > 0:
        return None
    rest = aim - energy * column
    law, misfit, freedom = rf.Arrhenius(energy, T_ref), float(rest @ rest), T.size - 1
    covariance = np.array([[_birge(misfit, freedom) / size]])
    return ShiftLaw(law, ("energy",), np.array([energy]), covariance, misfit, freedom)


def _birge(chisqr, freedom):
    """Return the factor of the covariance by which the misfit exceeds the errors, at least 1."""
    return max(1.0, chisqr / freedom) if freedom else 1.0
