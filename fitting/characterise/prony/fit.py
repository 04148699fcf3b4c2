r"""Prony series from a measured modulus: which relaxation times, how strong, how certain.

.. math:: E'(\omega) = E_\infty + \sum_i E_i \frac{\omega^2\tau_i^2}{1 + \omega^2\tau_i^2},\qquad
          E''(\omega) = \sum_i E_i \frac{\omega\tau_i}{1 + \omega^2\tau_i^2}

On a fixed grid of times the model is linear in E >= 0, so least squares with bounds finds
the minimum, and says which terms the data want absent. Errors, correlations and what the
data leave open follow from its derivatives by ln E, which are the terms themselves.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

import rubberfric as rf
from fitting.characterise.prony.result import PronyFit
from fitting.characterise.prony.series import Series, columns
from fitting.characterise.prony.times import check_gaps, fixed_modulus, given, grid, reduced
from fitting.data.kinds import ModulusData
from fitting.parameters.constraints import is_number
from rubberfric.base import shown
from rubberfric.materials import Shift


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
    r"""Prony series of a measured modulus.

    .. math:: \min_{E \ge 0} w' \sum_k \left(\frac{\ln E'(\omega_k)/E'_k}{e_k}\right)^2
              + w'' \sum_k \left(\frac{\ln E''(\omega_k)/E''_k}{e_k}\right)^2

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
    poisson, shift : of the material; a shift is not fitted here, see `fit_master_curve`
    smooth : sigma of a `Smooth` prior [-], or "auto", or None
        for noisy data: no term is absent then, and gaps in the frequencies are bridged. "auto" takes
        the sigma that predicts best what is left out: generalised cross-validation [Golub, Heath & Wahba,
        Technometrics 21 (1979) 215, doi:10.1080/00401706.1979.10489751]; no L-curve is drawn.
    weights : (w', w''), >= 0 [-]
        how much E' and E'' count; 0 leaves one of them out.

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
    The bounded minimum is found by active sets (`fitting.characterise.prony.bounded`), not by updates
    that keep E > 0 and approach zeros for ever; terms at 0 there are dropped, as a modulus of
    1e-30 Pa would help no scene. With `smooth` the start is E_i = (2/pi) E''(1/tau_i) d ln tau
    instead, the loss at a term's peak, and the steps are those of Levenberg and Marquardt in ln E.
    """
    rf.Prony(1.0, [1.0], [1.0], poisson, shift)  # refuses what no material can have
    if smooth != "auto" if isinstance(smooth, str) else smooth is not None and not _strength(smooth):
        raise ValueError(f"smooth = {shown(smooth)}: must be None, a number > 0, or 'auto'")
    weight = _weights(weights)
    reference = reduced(data, shift)
    omega = reference.omega
    tau = grid(omega, per_decade) if tau is None else given(data, tau, omega)
    fixed = fixed_modulus(E_inf)
    series = _series(reference, omega, tau, fixed, weight)
    count = series.measured.size + (0 if smooth is None else tau.size - 2)
    if count < series.tau.size:
        raise ValueError(
            f"data {data.label!r}: {series.measured.size} values for {series.tau.size} unknowns:"
            " must be as many at least; lower per_decade, give tau, or smooth"
        )
    if smooth is None:
        check_gaps(data, omega)
        E = series.bounded()
    else:
        E = _peaks(reference, omega, series.tau)
    kept = E > 0
    if not kept[: tau.size].any():
        raise ValueError(f"data {data.label!r}: want no relaxing term at all: their loss must be > 0")
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
    """The weights of E' and E'' as an array, checked."""
    weight = np.array([w if is_number(w) else np.nan for w in np.ravel(np.array(weights, object))], float)
    if weight.shape != (2,) or not (np.isfinite(weight) & (weight >= 0)).all() or not weight.any():
        raise ValueError(
            f"weights = {shown(weights)}: must be two numbers >= 0, of E' and of E'', not both 0"
        )
    return weight


def _series(data, omega, tau, relaxed, weight):
    """The problem: what counts of the data, and the columns of every term."""
    tau = np.append(tau, np.inf) if relaxed is None else tau
    known = np.repeat([relaxed or 0.0, 0.0], omega.size)
    error = np.ones(len(data)) if data.error is None else data.error
    each = np.repeat(weight, omega.size)
    used = each > 0
    return Series(
        columns(omega, tau)[used],
        known[used],
        data.measured[used],
        error[used] / np.sqrt(each[used]),
        data.logarithmic,
        data.error is None,
        tau,
        data.body or "lower",
    )


def _peaks(data, omega, tau):
    """E, all > 0: the loss at the peak of every term, and half the lowest storage for tau = inf."""
    finite = np.isfinite(tau)
    order, at = np.argsort(omega), np.argsort(tau[finite])
    floor = 1e-6 * np.abs(data.storage).max()
    loss = np.log(np.maximum(data.loss, floor)[order])
    times = tau[finite]
    width = np.gradient(np.log(times[at])) if times.size > 1 else np.ones(1)
    E = np.full(tau.size, 0.5 * max(data.storage.min(), floor))
    E[at] = 2 / np.pi * np.exp(np.interp(-np.log(times[at]), np.log(omega[order]), loss)) * width
    return E
