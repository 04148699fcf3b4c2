r"""Prony series from a measured modulus: which relaxation times, how strong, how certain.

.. math:: E'(\omega) = E_\infty + \sum_i E_i \frac{\omega^2\tau_i^2}{1 + \omega^2\tau_i^2},\qquad
          E''(\omega) = \sum_i E_i \frac{\omega\tau_i}{1 + \omega^2\tau_i^2}

On a fixed grid of times the model is linear in E >= 0, so least squares with bounds finds
the minimum, and says which terms the data want absent. `fitting.fit` starts there, in
ln E, and gives errors, correlations and what the data leave open.
"""

import numpy as np
from numpy.typing import ArrayLike

import rubberfric as rf
from fitting.characterise.bounded import nonnegative, nonnegative_logarithmic
from fitting.characterise.prony_result import PronyFit
from fitting.data.kinds import ModulusData
from fitting.fit import fit
from fitting.parameters.constraints import Positive, Rule, is_number
from fitting.parameters.priors import Prior, Smooth
from rubberfric.base import POSITIVE, as_leaf, check_values, shown
from rubberfric.materials import Shift

# Decades between neighbouring frequencies; in a wider gap the loss of a term in its middle is
# down to a fifth wherever it is measured.
_GAP = 2.0
# Decades a given relaxation time may lie outside 1/omega; beyond, its loss is 1 % of its modulus.
_REACH = 2.0
# Part of E' or E'' that a term makes up somewhere, or it is none.
_ROUNDING = 1e-9


def fit_prony(
    data: ModulusData,
    per_decade: float = 1.0,
    *,
    tau: ArrayLike | None = None,
    E_inf: float | str = "fit",
    poisson: float = 0.5,
    shift: Shift | None = None,
    smooth: float | None = None,
) -> PronyFit:
    r"""Prony series of a measured modulus.

    .. math:: \min_{E \ge 0} \sum_k \left(\frac{\ln E'(\omega_k)/E'_k}{e_k}\right)^2
              + \left(\frac{\ln E''(\omega_k)/E''_k}{e_k}\right)^2

    with absolute instead of logarithmic differences for data with absolute errors.

    Parameters
    ----------
    data : ModulusData
        with temperatures: raw curves, superposed by `shift`; without: a master curve.
    per_decade : relaxation times per decade, at least; > 0
        evenly in ln tau from 1/omega_max to 1/omega_min of the (reduced) frequencies: the loss
        of the first and the last term peaks at the ends of the data. Of terms further out
        only a flank would be seen, which the ends and E_inf stand for.
    tau : relaxation times [s] instead of that grid, all different
    E_inf : "fit", or the relaxed modulus [Pa], fixed (0: a liquid)
    poisson, shift : of the material; a shift is not fitted here
    smooth : sigma of a `Smooth` prior [-], or None
        for noisy data: no term is absent then, and gaps in the frequencies are bridged.

    Returns
    -------
    PronyFit

    Raises
    ------
    ValueError
        one line: data of another kind, temperatures without a shift or outside its range,
        fewer measured values than unknowns, frequencies that leave a gap of more than two
        decades (curves that do not overlap), relaxation times more than two decades outside.

    Notes
    -----
    The bounded minimum is found by the steps of `fitting.characterise.bounded`, not by updates
    that keep E > 0 and approach zeros for ever; terms at 0 there are dropped, as a modulus of
    1e-30 Pa would help no scene. With `smooth` the start is E_i = (2/pi) E''(1/tau_i) d ln tau
    instead, the loss at a term's peak.
    """
    rf.Prony(1.0, [1.0], [1.0], poisson, shift)  # refuses what no material can have
    if smooth is not None and not (is_number(smooth) and smooth > 0):
        raise ValueError(f"smooth = {shown(smooth)}: must be None or a number > 0")
    omega = _reduced(data, shift)
    tau = _grid(omega, per_decade) if tau is None else _given(data, tau, omega)
    fixed = _fixed(E_inf)
    unknowns = tau.size + (fixed is None)
    values = len(data) + (0 if smooth is None else tau.size - 2)
    if values < unknowns:
        raise ValueError(
            f"data {data.label!r}: {len(data)} values for {unknowns} unknowns:"
            " must be as many at least; lower per_decade, give tau, or smooth"
        )
    _check_gaps(data, omega, smooth)
    if smooth is None:
        E, relaxed = _bounded(data, omega, tau, fixed)
    else:
        E, relaxed = _peaks(data, omega, tau, fixed)
    kept = E > 0
    body = data.body or "lower"
    material = rf.Prony(relaxed, E[kept], tau[kept], poisson, shift)
    own, other = rf.Body(material), rf.Body(rf.Rigid())
    scene = rf.Scene(own, other) if body == "lower" else rf.Scene(other, own)
    free: dict[str, Rule] = {f"{body}.material.E": Positive()}
    if fixed is None and relaxed > 0:
        free[f"{body}.material.E_inf"] = Positive()
    prior: dict[str, Prior] = {} if smooth is None else {f"{body}.material.E": Smooth(smooth)}
    result = fit(scene, data, free, prior=prior)
    material = getattr(result.scene, body).material
    model = _columns(omega, tau[kept]) @ np.asarray(material.E)
    model[: omega.size] += float(material.E_inf)
    measured = np.where(data.measured > 0, data.measured, np.nan)
    ratio = (model / measured).reshape(2, -1)
    dropped = np.append(tau[~kept], np.inf if fixed is None and relaxed == 0 else [])
    return PronyFit(material, dropped, np.log(ratio), result)


def _reduced(data, shift):
    """Frequencies at the reference temperature [rad/s]."""
    if not isinstance(data, ModulusData):
        raise ValueError(f"data is a {type(data).__name__}: must be ModulusData, such as fitting.read gives")
    if data.temperature is None:
        return data.omega
    if shift is None:
        raise ValueError(
            f"data {data.label!r}: have a temperature, but no shift is given: must be WLF, Arrhenius or"
            " TabulatedShift, or the data a master curve, without temperature"
        )
    shift.check_temperature(data.temperature)
    return data.omega * np.exp(np.asarray(shift.log_factor(data.temperature), float))


def _grid(omega, per_decade):
    if not (is_number(per_decade) and 0 < per_decade <= 100):
        raise ValueError(f"per_decade = {shown(per_decade)}: must be a number > 0, at most 100")
    decades = np.log10(omega.max() / omega.min())
    # 5.000000001 decades are five.
    return np.geomspace(1 / omega.max(), 1 / omega.min(), int(np.ceil(per_decade * decades - 1e-6)) + 1)


def _given(data, tau, omega):
    """Relaxation times that the caller chose, checked."""
    tau = np.asarray(as_leaf("tau", tau, 1), float)
    check_values("tau", tau, POSITIVE)
    if tau.size == 0:
        raise ValueError("tau is empty: must have at least one relaxation time")
    if np.unique(tau).size < tau.size:
        raise ValueError("tau: has equal relaxation times; must all be different")
    beyond = np.maximum(np.log10(tau * omega.min()), -np.log10(tau * omega.max()))
    worst = int(np.argmax(beyond))
    if beyond[worst] > _REACH:
        raise ValueError(
            f"tau[{worst}] = {tau[worst]:g} s: data {data.label!r} do not reach it; must be within"
            f" {_REACH:g} decades of 1/omega, {1 / omega.max():.3g} ... {1 / omega.min():.3g} s"
        )
    return tau


def _fixed(E_inf: float | str) -> float | None:
    """A relaxed modulus that is not fitted, else None."""
    if isinstance(E_inf, str) and E_inf == "fit":
        return None
    if isinstance(E_inf, str) or not (is_number(E_inf) and E_inf >= 0):
        raise ValueError(f"E_inf = {shown(E_inf)}: must be 'fit' or a number >= 0 [Pa]")
    return float(E_inf)


def _check_gaps(data, omega, smooth):
    sorted_omega = np.sort(omega)
    gaps = np.diff(np.log10(sorted_omega))
    if smooth is None and gaps.size and gaps.max() > _GAP:
        i = int(np.argmax(gaps))
        raise ValueError(
            f"data {data.label!r}: nothing between the reduced frequencies {sorted_omega[i]:.3g} and"
            f" {sorted_omega[i + 1]:.3g} rad/s: curves must overlap, or be less than {_GAP:g} decades apart;"
            " or give smooth"
        )


def _columns(omega, tau):
    """E' and E'' of every term with E = 1, shape (2 frequencies, terms)."""
    a = omega[:, None] * tau
    return np.concatenate([a**2 / (1 + a**2), a / (1 + a**2)])


def _bounded(data, omega, tau, fixed):
    """(E, E_inf) at the minimum over E >= 0, zeros exact."""
    A = _columns(omega, tau)
    relaxed = np.repeat([1.0, 0.0], omega.size)  # the column of E_inf
    known = np.zeros(len(data)) if fixed is None else fixed * relaxed
    if fixed is None:
        A = np.column_stack([A, relaxed])
    error = np.ones(len(data)) if data.error is None else data.error
    if data.logarithmic:
        x = nonnegative_logarithmic(A, data.measured, known, error)
    else:
        x = nonnegative(A / error[:, None], (data.measured - known) / error)
    # What is nowhere more than rounding is absent, too: data without noise leave such terms.
    x = np.where((A * x > _ROUNDING * (A @ x + known)[:, None]).any(0), x, 0.0)
    if not x[: tau.size].any():
        raise ValueError(f"data {data.label!r}: want no relaxing term at all: their loss must be > 0")
    return x[: tau.size], float(x[-1]) if fixed is None else fixed


def _peaks(data, omega, tau, fixed):
    """(E, E_inf), all > 0: the loss at the peak of every term, and half the lowest storage."""
    order, at = np.argsort(omega), np.argsort(tau)
    floor = 1e-6 * np.abs(data.storage).max()
    loss = np.log(np.maximum(data.loss, floor)[order])
    width = np.gradient(np.log(tau[at])) if tau.size > 1 else np.ones(1)
    E = np.empty(tau.size)
    E[at] = 2 / np.pi * np.exp(np.interp(-np.log(tau[at]), np.log(omega[order]), loss)) * width
    return E, 0.5 * max(data.storage.min(), floor) if fixed is None else fixed
