r"""Fit a Prony series to a measured modulus or compliance.

.. math:: E'(\omega) = E_\infty + \sum_i E_i \frac{\omega^2\tau_i^2}{1 + \omega^2\tau_i^2},\qquad
          E''(\omega) = \sum_i E_i \frac{\omega\tau_i}{1 + \omega^2\tau_i^2},\qquad
          E(t) = E_\infty + \sum_i E_i e^{-t/\tau_i}

On a fixed grid of times the model is linear in E >= 0, so bounded least squares finds the global minimum and
the terms that are zero there. Errors, correlations and unidentified directions follow from the derivatives
with respect to ln E, which equal the terms. A creep compliance is linear in its own terms, see
`fitting.characterise.responses`.
"""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import numpy as np

import rubberfric as rf
from fitting.characterise.prony_fit import PronyFit
from fitting.characterise.prony_series import (
    Response,
    SeriesProblem,
    check_gaps,
    checked_times,
    fixed_modulus,
    grid,
    reduced,
)
from fitting.characterise.responses import converted, flow_time, frequencies, guess, matrix
from fitting.data.kinds import TRANSIENTS, CreepData, ModulusData
from fitting.parameters.constraints import is_number
from rubberfric.base import ArrayLike, shown
from rubberfric.materials import Shift

# Default number of relaxation times per decade.
_PER_DECADE = 1.0
# Default number for data over time, because exp(-t/tau) falls more steeply than the terms of E' and E''.
_PER_DECADE_OF_TRANSIENTS = 2.0


def fit_prony(
    data: Response,
    per_decade: float | None = None,
    *,
    tau: ArrayLike | None = None,
    E_inf: float | str = "fit",
    poisson: float = 0.5,
    shift: Shift | None = None,
    smooth: float | str | None = None,
    weights: Sequence[float] = (1.0, 1.0),
) -> PronyFit:
    r"""Fit a Prony series to a measured modulus or creep compliance.

    .. math:: \min_{E \ge 0} w' \sum_k \left(\frac{\ln E'(\omega_k)/E'_k}{e_k}\right)^2
              + w'' \sum_k \left(\frac{\ln E''(\omega_k)/E''_k}{e_k}\right)^2

    If the data have absolute errors, the differences are absolute instead of logarithmic. RelaxationData are
    fitted by E(t), and CreepData by D(t) = D_0 + sum_i D_i (1 - exp(-t/tau_i)) + phi t, D_i >= 0, whose exact
    Prony series is the `material`. `PronyFit.moduli` returns E' and E'' with errors.

    Parameters
    ----------
    data : ModulusData, RelaxationData or CreepData
        Data with temperatures are raw curves, which `shift` superposes. Data without temperatures are a
        master curve.
    per_decade : minimum number of relaxation times per decade, > 0; None: 1, or 2 for data over time
        The times are evenly spaced in ln tau from 1/omega_max to 1/omega_min of the (reduced) frequencies, so
        the loss of the first and the last term peaks at the ends of the data. Relaxation outside this
        range is represented by the end terms and E_inf. Data over time have 1/t instead of omega.
    tau : relaxation times [s] that replace the grid of `per_decade`, all different
        For CreepData, these are retardation times.
    E_inf : "fit", or a fixed value of the relaxed modulus [Pa] (0: a liquid)
        For CreepData, "fit" is a solid, and 0 a material that may flow.
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
        `data` has another type, or has temperatures without a shift or outside the range of the shift.
        There are fewer measured values than unknowns. The frequencies leave a gap of more than two decades
        (curves that do not overlap). Relaxation times lie more than two decades outside the data. The
        instantaneous compliance of CreepData vanishes. The message is one line.

    Notes
    -----
    The minimum over E >= 0 is found by the active sets of `fitting.characterise.prony_series`, which give
    exact zeros. Terms with E = 0 are dropped. If D_0 of a creep compliance would vanish, the shortest
    retardation times are left out until D_0 > 0, because the data hardly distinguish the two. With `smooth`,
    Levenberg-Marquardt steps in ln E begin at E_i = (2/pi) E''(1/tau_i) d ln tau, the value from the loss at
    the peak of each term, or at the slope of the response over time.

    Examples
    --------
    >>> omega = np.logspace(-1, 3, 20)
    >>> rubber = rf.Prony(1e6, [1e7], [1e-2], 0.5)
    >>> E = np.asarray(rf.complex_modulus(rubber, omega))
    >>> series = fitting.fit_prony(fitting.ModulusData(omega, E.real, E.imag), tau=[1e-2])
    >>> np.asarray(series.material.E).round(-3)
    array([10000000.])
    """
    rf.Prony(1.0, [1.0], [1.0], poisson, shift)  # checks poisson and shift
    _check_smooth(smooth)
    weight = _weights(weights, data)
    reference = reduced(data, shift)
    omega = frequencies(reference)
    is_creep = isinstance(reference, CreepData)
    if per_decade is None:
        per_decade = _PER_DECADE if isinstance(data, ModulusData) else _PER_DECADE_OF_TRANSIENTS
    times = grid(omega, per_decade) if tau is None else checked_times(data, tau, omega)
    fixed = fixed_modulus(E_inf)
    if is_creep:
        _check_creep(E_inf, fixed, smooth)
        tau = np.append(times, [*([] if fixed is None else [flow_time(reference)]), np.inf])
        fixed = None
    else:
        tau = np.append(times, np.inf) if fixed is None else times
    series = _series(reference, tau, fixed, weight)
    E = _start(data, reference, series, smooth)
    if is_creep:
        series, E = _with_instantaneous(series, E)
    kept = E > 0
    if not (kept & np.isfinite(series.tau)).any():
        raise ValueError(f"data {data.label!r}: the fit has no relaxing term; {_needed(data)}")
    used = series.only(kept)
    strength = used.cross_validated(E[kept]) if isinstance(smooth, str) else smooth
    solution = used.solved(E[kept], strength)
    fitted = matrix(reference, used.tau) @ solution.E + _known(reference, fixed)
    compliance = None
    if is_creep:
        try:
            material, used, solution, compliance = converted(
                used, solution, flow_time(reference), poisson, shift
            )
        except ValueError as error:
            raise ValueError(f"data {data.label!r}: {error}") from None
    else:
        terms = np.isfinite(used.tau)
        relaxed = float(solution.E[~terms].sum()) if fixed is None else fixed
        material = rf.Prony(relaxed, solution.E[terms], used.tau[terms], poisson, shift)
    measured = np.where(reference.measured > 0, reference.measured, np.nan)
    again = functools.partial(
        fit_prony, data, E_inf=E_inf, poisson=poisson, shift=shift, smooth=strength, weights=weights
    )
    return PronyFit(
        material=material,
        dropped=np.setdiff1d(tau, series.tau[kept]),
        residuals=np.log(fitted / measured).reshape(len(data.values), -1),
        data=data,
        smooth=strength,
        weights=(float(weight[0]), float(weight[-1])),
        names=used.names,
        solution=solution,
        count=series.measured.size,
        refit=again,
        grid=times,
        compliance=compliance,
    )


def over_frequency(data: Response | Sequence[Response], same: float) -> Response | Sequence[Response]:
    """Return measured data with E' and E'' and their errors in place of data over time.

    Data over time become a data set for each temperature.

    Parameters
    ----------
    data : a data set, or a list of data sets
        The result is `data` itself if it contains no data over time.
    same : largest difference between neighbouring temperatures within a measurement [K]
    """
    sets: list[Any] = list(data) if isinstance(data, list | tuple) else [data]
    if not any(isinstance(dataset, TRANSIENTS) for dataset in sets):
        return data
    return [sweep for dataset in sets for sweep in _sweeps_of(dataset, same)]


def _sweeps_of(data, same):
    """Return a data set as a list, or data over time as E' and E'' at each temperature."""
    if not isinstance(data, TRANSIENTS):
        return [data]
    if data.temperature is None:
        return [fit_prony(data).moduli()]
    order = np.argsort(data.temperature, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(data.temperature[order]) > same) + 1)
    arrays = {name: getattr(data, name) for name in data.fields()}
    sweeps = []
    for group in groups:
        own = {name: values[group] for name, values in arrays.items() if values is not None}
        own["temperature"] = np.full(group.size, own["temperature"].mean())
        sweeps.append(fit_prony(dataclasses.replace(data, **own, check_units=False)).moduli())
    return sweeps


def _check_smooth(smooth):
    is_sigma = is_number(smooth) and smooth > 0
    if not (smooth == "auto" if isinstance(smooth, str) else smooth is None or is_sigma):
        raise ValueError(f"smooth = {shown(smooth)}: must be None, a number > 0, or 'auto'")


def _check_creep(E_inf, fixed, smooth):
    """Raise ValueError for options that a creep compliance does not have."""
    if fixed not in (None, 0.0):
        raise ValueError(f"E_inf = {shown(E_inf)}: must be 'fit' or 0 for creep data")
    if fixed is not None and smooth is not None:
        raise ValueError(f"smooth = {shown(smooth)}: must be None for creep data with E_inf = 0")


def _needed(data):
    if isinstance(data, ModulusData):
        return "E'' must be > 0"
    return "D(t) must rise" if isinstance(data, CreepData) else "E(t) must fall"


def _weights(weights, data):
    """Return the weights of E' and E'', or one weight for data over time."""
    weight = np.array([w if is_number(w) else np.nan for w in np.ravel(np.array(weights, object))], float)
    if weight.shape != (2,) or not (np.isfinite(weight) & (weight >= 0)).all() or not weight.any():
        raise ValueError(f"weights = {shown(weights)}: must be two numbers >= 0, for E' and E'', not both 0")
    if not isinstance(data, ModulusData):
        if weight[0] != weight[1]:
            raise ValueError(f"weights = {shown(weights)}: must be equal for data over time")
        return np.ones(1)
    return weight


def _known(data, relaxed):
    """Return the part of the model that is not fitted, of a fixed relaxed modulus."""
    count = getattr(data, data.values[0]).size
    parts = (relaxed or 0.0, 0.0) if isinstance(data, ModulusData) else (relaxed or 0.0,)
    return np.repeat(parts, count)


def _series(data, tau, relaxed, weight):
    """Return the least-squares problem without the rows whose weight is 0."""
    error = np.ones(len(data)) if data.error is None else data.error
    each = np.repeat(weight, getattr(data, data.values[0]).size)
    used = each > 0
    return SeriesProblem(
        matrix(data, tau)[used],
        _known(data, relaxed)[used],
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
        if isinstance(reference, ModulusData):
            return _peaks(reference, reference.omega, series.tau)
        return guess(reference, series.tau)
    check_gaps(data, frequencies(reference))
    return series.bounded()


def _with_instantaneous(series, D):
    """Return a compliance and its terms without the shortest retardation times that make D_0 vanish.

    A retardation much shorter than the measured times hardly differs from D_0.
    """
    while not D[-1] > 0 and np.isfinite(series.tau).sum() > 1:
        series = series.only(series.tau > series.tau.min())
        D = series.bounded()
    return series, D


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
