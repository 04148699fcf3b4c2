r"""Split data into isothermal sweeps, guess the shifts that superpose the sweeps, and join shifted sweeps.

The guess models ln E of two neighbouring sweeps as one smooth random function of ln omega, an integrated
Wiener process.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fitting.data.kinds import ModulusData

_FEWEST = 2  # points of a sweep with E', and with E''
_TRIED = 81  # shifts of one neighbour to the other
# Largest factor by which E' may rise on heating in addition to T / T_ref, see `sweeps_of`.
_RISE = 2.0
_BENDING = 0.03  # variance of the slope of ln E that a change of ln omega by 1 adds


class Sweep(NamedTuple):
    """E' and E'' over frequency at one temperature."""

    T: float  # mean [K]
    at: np.ndarray  # temperature of every point [K]
    t: np.ndarray  # ln omega
    y: np.ndarray  # ln E' and ln E'', shape (2, points); NaN where E <= 0
    error: np.ndarray | None  # standard errors of y, shape (2, points)


def sweeps_of(data: ModulusData | Sequence[ModulusData], same: float) -> list[Sweep]:
    """Return the sweeps of all data, by rising temperature.

    Rows whose temperatures lie within `same` [K] of a neighbour belong to one sweep. Raise ValueError if
    `data` is not ModulusData, if rows have no temperature, if all rows have one temperature, if only some
    data sets have errors, if a sweep has too few points > 0, or if the sweeps cannot superpose.
    """
    sets = [data] if isinstance(data, ModulusData) else data
    if not isinstance(sets, list | tuple) or not sets:
        raise ValueError(f"isotherms is a {type(data).__name__}: must be ModulusData, or a list of them")
    rows = [_rows(i, dataset) for i, dataset in enumerate(sets)]
    errors = [error for *_, error in rows if error is not None]
    known = [error is not None for *_, error in rows]
    if any(known) and not all(known):
        raise ValueError(
            f"isotherms[{known.index(False)}] has no errors, but other data sets do; give all errors or none"
        )
    T, t, y = (np.concatenate(columns, axis=-1) for columns in list(zip(*rows, strict=True))[:3])
    error = np.concatenate(errors, axis=1) if errors else None
    order = np.lexsort((t, T))
    groups = np.split(order, np.flatnonzero(np.diff(T[order]) > same) + 1)
    if len(groups) < 2:
        raise ValueError(
            f"isotherms: all rows are at {T.mean():.6g} K within {same:g} K: must have several temperatures"
        )
    sweeps = []
    for group in groups:
        group = group[np.argsort(t[group], kind="stable")]
        count = int(np.isfinite(y[:, group]).sum(axis=1).min())
        if count < _FEWEST:
            raise ValueError(
                f"the sweep at {T[group].mean():.6g} K has {count} points > 0: must have at least"
                f" {_FEWEST}; temperatures within {same:g} K belong to one sweep (argument same)"
            )
        errors = None if error is None else error[:, group]
        sweeps.append(Sweep(float(T[group].mean()), T[group], t[group], y[:, group], errors))
    _check_falling(sweeps)
    return sweeps


def superposed(
    isotherms: ModulusData | Sequence[ModulusData],
    sweeps: Sequence[Sweep],
    t: np.ndarray,
    y: np.ndarray,
    order: np.ndarray,
) -> ModulusData:
    """Return the points `order` of all sweeps at the reduced ln omega t, with ln E = y."""
    sets = [isotherms] if isinstance(isotherms, ModulusData) else isotherms
    errors = {}
    if sweeps[0].error is not None:
        relative = np.concatenate([sweep.error for sweep in sweeps if sweep.error is not None], axis=1)
        sigma = np.exp(y) * relative
        errors = {"sigma_storage": sigma[0, order], "sigma_loss": sigma[1, order]}
    bodies = {dataset.body for dataset in sets}
    return ModulusData(
        np.exp(t[order]),
        *np.exp(y[:, order]),
        **errors,
        name=f"master curve of {sets[0].name}" if sets[0].name and len(sets) == 1 else "master curve",
        body=bodies.pop() if len(bodies) == 1 else None,
        check_units=False,
    )


def _check_falling(sweeps):
    """Raise ValueError if E' at equal frequencies rises on heating by more than a vertical shift explains.

    E' of a relaxing solid rises with frequency, and heating shifts the curve to higher frequencies. E' at
    one frequency therefore falls on heating, except for a vertical shift.
    """
    worst = (np.log(_RISE), None, None, 1.0)
    for cold, warm in itertools.combinations(sweeps, 2):
        (t, y), (s, z) = (
            (sweep.t[ok], sweep.y[0, ok]) for sweep in (cold, warm) for ok in [np.isfinite(sweep.y[0])]
        )
        shared = (t >= s[0]) & (t <= s[-1])
        if not shared.any():
            continue
        rise = float(np.median(np.interp(t[shared], s, z) - y[shared]))
        beyond = rise - np.log(warm.T / cold.T)
        if beyond > worst[0]:
            worst = (beyond, cold.T, warm.T, np.exp(rise))
    _, cold, warm, factor = worst
    if cold is not None:
        raise ValueError(
            f"isotherms: E' at equal frequencies rises by a factor {factor:.2g} from {cold:.6g} to {warm:.6g}"
            " K; such sweeps do not superpose, because E' of the master curve would fall with frequency;"
            " remove the temperatures at which the sample gels, cures or ages"
        )


def _rows(i, dataset):
    """Return T [K], ln omega, ln E and the error of ln E for the data set with the index i.

    ln E and its error have shape (2, points), for E' and E''. ln E is NaN where E <= 0. The error is None if
    the data have no errors.
    """
    if not isinstance(dataset, ModulusData):
        raise ValueError(f"isotherms[{i}] is a {type(dataset).__name__}: must be ModulusData")
    if dataset.temperature is None:
        raise ValueError(
            f"isotherms[{i}], {dataset.label!r}, has no temperature: must have one for every row; give"
            " temperature=... when reading it if only the name of the file states it"
        )
    positive = np.where(dataset.measured > 0, dataset.measured, np.nan)
    error = dataset.error
    if error is not None:
        error = (error if dataset.logarithmic else error / np.abs(dataset.measured)).reshape(2, -1)
    return dataset.temperature, np.log(dataset.omega), np.log(positive).reshape(2, -1), error


def first_shifts(sweeps: Sequence[Sweep], phase: float, offsets: tuple[float, float]) -> np.ndarray:
    """Return an initial guess of ln a_T of every sweep relative to the first sweep, shape (sweeps,).

    The likelihood of a common smooth curve through two neighbouring sweeps is tabulated over the relative
    shift. One pair alone may be ambiguous, so the WLF law with the largest sum of log likelihoods over all
    pairs is found. Every shift is then chosen for a large likelihood and a small distance from this law.

    Parameters
    ----------
    phase : phase error [rad]
    offsets : standard deviation of the offsets of ln E' and of ln E'' between sweeps
    """
    T = np.array([sweep.T for sweep in sweeps])
    pairs = [_pair(cold, warm, phase, offsets) for cold, warm in itertools.pairwise(sweeps)]
    middle, best = np.median(T), (-np.inf, np.zeros(T.size - 1))
    for C2 in np.geomspace(3, 3000, 40) + max(0.0, middle - T[0]):
        steps = np.diff(-(T - middle) / (C2 + T - middle))
        C1 = np.geomspace(0.3, 300, 60) * (1 + C2 / 100)
        each = [
            np.maximum(np.interp(C1 * np.log(10) * step, s, L, left=-np.inf, right=-np.inf) - L.max(), -15)
            for (s, L), step in zip(pairs, steps, strict=True)
        ]
        total = np.sum(each, axis=0)
        if total.max() > best[0]:
            best = float(total.max()), steps * C1[np.argmax(total)] * np.log(10)
    chosen = [
        s[np.argmax(L - 0.5 * ((s - step) / (0.3 + 0.3 * abs(step))) ** 2)]
        for (s, L), step in zip(pairs, best[1], strict=True)
    ]
    return np.concatenate([[0.0], np.cumsum(chosen)])


def _pair(cold, warm, phase, offsets):
    """Return trial shifts of the warmer sweep, and the log likelihood of every trial shift."""
    shifts = np.linspace(cold.t.min() - warm.t.max() - 2 * np.log(10), 1.0, _TRIED)
    likelihood = np.zeros(_TRIED)
    first = np.arange(cold.t.size + warm.t.size) < cold.t.size
    with np.errstate(invalid="ignore"):
        tan = np.nan_to_num(
            np.exp(np.concatenate([sweep.y[1] - sweep.y[0] for sweep in (cold, warm)])), nan=0.1
        )
    for k, offset in enumerate(offsets):
        y = np.concatenate([cold.y[k], warm.y[k]])
        scatter = np.hypot(
            np.where(first, *(max(_roughness(sweep, k), 0.01) for sweep in (cold, warm))),
            phase * tan ** (1 - 2 * k),
        )
        if cold.error is not None:
            scatter = np.maximum(scatter, np.concatenate([cold.error[k], warm.error[k]]))
        ok = np.isfinite(y)
        t = np.where(first, 0.0, shifts[:, None])[:, ok] + np.concatenate([cold.t, warm.t])[ok]
        t -= t.mean(axis=1, keepdims=True)
        # Integrated Wiener process about a straight line with wide priors (the constants).
        V = (
            _BENDING * np.abs(t[:, :, None] - t[:, None, :]) ** 3 / 12
            + 1e5
            + 100 * t[:, :, None] * t[:, None]
        )
        V += offset**2 * (first[ok][:, None] == first[ok]) + np.diag(scatter[ok] ** 2)
        L = np.linalg.cholesky(V)
        z = np.linalg.solve(L, np.broadcast_to((y[ok] - y[ok].mean())[:, None], (*t.shape, 1)))
        likelihood -= np.sum(z**2, axis=(1, 2)) / 2 + np.log(np.diagonal(L, axis1=1, axis2=2)).sum(axis=1)
    return shifts, likelihood


def _roughness(sweep, k):
    """Return the standard deviation of ln E' (k = 0) or ln E'' (k = 1) about a cubic in ln omega.

    The estimate uses the median absolute deviation of one sweep.
    """
    ok = np.isfinite(sweep.y[k])
    t, y = sweep.t[ok], sweep.y[k][ok]
    fitted = np.polynomial.Polynomial.fit(t, y, min(3, t.size - 2))(t)
    return 1.4826 * float(np.median(np.abs(y - fitted)))
