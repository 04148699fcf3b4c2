r"""Responses of a Prony series that are linear in its terms: E', E'', E(t), and D(t) of its compliance.

.. math:: E(t) = E_\infty + \sum_i E_i e^{-t/\tau_i},\qquad
          D(t) = D_0 + \sum_i D_i (1 - e^{-t/\tau_i}) + \varphi t

A relaxation modulus is fitted by the terms of E, as E' and E'' are. A creep compliance is fitted by the
terms of D, whose times are retardation times. `rubberfric.materials.prony_from_compliance` converts them to
the terms of E. In all fits, tau = inf stands for E_inf or D_0.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

import rubberfric as rf
from fitting.characterise.prony_series import Response, SeriesMinimum, SeriesProblem, columns
from fitting.data.kinds import CreepData, ModulusData, RelaxationData
from fitting.uncertainty.covariance import from_jacobian
from rubberfric.materials import Shift, prony_from_compliance, terms_from_compliance

# Retardation time of the column that represents flow, in units of the longest time. Its compliance is linear
# in t.
_FLOW = 1e6
# Step of ln D in derivatives by central differences. The error is about _STEP^2, and rounding 1e-16 / _STEP.
_STEP = 1e-5
# Smallest standard deviation of ln E, for data without noise.
_SHARPEST = 1e-12


class Compliance(NamedTuple):
    """Creep compliance of a fit, and the covariance of the logarithms of its terms."""

    D_0: float  # instantaneous compliance [1/Pa]
    D: np.ndarray  # retarded compliances [1/Pa], shape (n,)
    tau: np.ndarray  # retardation times [s], shape (n,)
    fluidity: float  # rate of flow divided by the stress [1/(Pa s)]; 0 for a solid
    spread: np.ndarray  # covariance of the logarithms of D, fluidity if > 0, and D_0

    def at(self, t: np.ndarray) -> np.ndarray:
        """Return D(t) [1/Pa] at times t [s] of shape (n,)."""
        return self.D_0 + self.fluidity * t - np.expm1(-t[:, None] / self.tau) @ self.D

    def terms(self, omega: np.ndarray) -> np.ndarray:
        """Return the terms of D* = D' - i D'' at omega, in the order of `spread`, shape (n, terms)."""
        parts = self.D / (1 + 1j * omega[:, None] * self.tau)
        flow = self.fluidity / (1j * omega[:, None])
        return np.concatenate(
            [parts, *([flow] if self.fluidity else []), np.full((omega.size, 1), self.D_0 + 0j)], axis=1
        )


def frequencies(data: Response) -> np.ndarray:
    """Return omega [rad/s] of oscillation data, and 1/t [1/s] of data over time."""
    return data.omega if isinstance(data, ModulusData) else 1 / data.time


def flow_time(data: CreepData) -> float:
    """Return the retardation time that stands for flow in `matrix` [s]."""
    return _FLOW * float(data.time.max())


def matrix(data: Response, tau: np.ndarray) -> np.ndarray:
    """Return the matrix that maps terms to the measured values, shape (values, terms).

    tau = inf stands for E_inf or D_0. In creep data, `flow_time` stands for flow.
    """
    if isinstance(data, ModulusData):
        return columns(data.omega, tau)
    decay = np.exp(-data.time[:, None] / tau)
    if isinstance(data, RelaxationData):
        return decay
    flow = flow_time(data)
    creep = np.where(np.isfinite(tau), -np.expm1(-data.time[:, None] / tau), 1.0)
    return np.where(tau == flow, data.time[:, None] / flow, creep)


def guess(data: Response, tau: np.ndarray) -> np.ndarray:
    """Return initial terms > 0 of data over time, shape (terms,), from the slope of the response in ln t."""
    assert not isinstance(data, ModulusData)
    order = np.argsort(data.time)
    log_t, values = np.log(data.time[order]), data.measured[order]
    finite = np.isfinite(tau)
    times = np.log(tau[finite])
    floor = 1e-6 * np.abs(values).max()
    at = np.interp(np.concatenate([times - 0.5, times + 0.5]), log_t, values).reshape(2, -1)
    width = np.abs(np.gradient(times)) if times.size > 1 else np.ones(1)
    terms = np.full(tau.size, 0.5 * max(values.min(), floor))
    terms[finite] = np.maximum(np.abs(at[1] - at[0]) * width, floor)
    return terms


def converted(
    series: SeriesProblem, solution: SeriesMinimum, flow: float, poisson: float, shift: Shift | None
) -> tuple[rf.Prony, SeriesProblem, SeriesMinimum, Compliance]:
    """Return the material, the moduli and their uncertainty for the fitted terms of a compliance.

    The derivatives of the conversion transform the covariance of ln D into the covariance of ln E.

    Parameters
    ----------
    series, solution : problem with the terms of D that do not vanish, and its minimum
    flow : the retardation time that stands for flow

    Raises
    ------
    ValueError : the instantaneous compliance vanishes, so that E would have no bound
    """
    flows, instantaneous = series.tau == flow, np.isinf(series.tau)
    if not instantaneous.any():
        raise ValueError(
            "the instantaneous compliance is 0 in the best fit, so the glassy modulus is unknown; give"
            " smooth = 'auto', longer retardation times tau, or data at shorter times"
        )
    retarded = ~flows & ~instantaneous

    def terms_of(D):
        fluidity = float(D[flows].sum() / flow)
        return float(D[instantaneous][0]), D[retarded], series.tau[retarded], fluidity

    def logarithms(x):
        relaxed, E, _ = terms_from_compliance(*terms_of(np.exp(x)))
        return np.log(np.append(E, [relaxed] * (not flows.any())))

    x, terms = np.log(solution.E), terms_of(solution.E)
    material = prony_from_compliance(*terms, poisson=poisson, shift=shift)
    steps = _STEP * np.eye(x.size)
    slopes = np.stack([(logarithms(x + s) - logarithms(x - s)) / (2 * _STEP) for s in steps], axis=1)
    spread = solution.uncertainty.spread
    sizes, along = np.linalg.eigh(slopes @ spread @ slopes.T)
    E = np.exp(logarithms(x))
    tau = np.append(np.asarray(material.tau), [np.inf] * (not flows.any()))
    of_E = dataclasses.replace(series, tau=tau)
    known = from_jacobian(
        of_E.variables,
        (along / np.sqrt(np.maximum(sizes, _SHARPEST**2))).T,
        E.size,
        slope=E,
        chisqr=solution.uncertainty.chisqr,
        x=np.log(E),
    )
    known = known._replace(parameters=solution.uncertainty.parameters)
    return material, of_E, solution._replace(E=E, uncertainty=known), Compliance(*terms, spread)


def modulus_slopes(
    omega: np.ndarray, tau: np.ndarray, E: np.ndarray, compliance: Compliance | None
) -> np.ndarray:
    """Return the derivatives of E' and E'' at omega with respect to the logarithms of the fitted terms.

    Parameters
    ----------
    omega : angular frequencies [rad/s], shape (n,)
    tau, E : relaxation times, inf for E_inf, and moduli that were fitted
    compliance : the compliance that was fitted instead, or None

    Returns
    -------
    array, shape (2, n, terms)
    """
    if compliance is None:
        return (columns(omega, tau) * E).reshape(2, omega.size, -1)
    terms = compliance.terms(omega)
    slopes = -terms / np.sum(terms, axis=1, keepdims=True) ** 2
    return np.stack([np.real(slopes), np.imag(slopes)])
