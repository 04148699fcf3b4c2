r"""Whether measured E' and E'' can be of one material.

A causal linear solid has E' and E'' that follow from each other (Kramers and Kronig); if it relaxes
without oscillating, both are of one relaxation spectrum H >= 0,

.. math:: E' = E_\infty + \int H \frac{\omega^2\tau^2}{1 + \omega^2\tau^2} d\ln\tau,\qquad
          E'' = \int H \frac{\omega\tau}{1 + \omega^2\tau^2} d\ln\tau

[J. D. Ferry, Viscoelastic Properties of Polymers, 1980, ch. 3]. Master curves of several sweeps, of raw data
with a wrong compliance of the instrument, or at a strain that softens, need not be.
"""

import numpy as np

from fitting.characterise.kramers_kronig.result import KNOWN, KramersKronig
from fitting.characterise.prony.bounded import nonnegative_logarithmic
from fitting.characterise.prony.series import columns
from fitting.characterise.prony.times import reduced
from fitting.data.kinds import ModulusData
from fitting.parameters.constraints import is_number
from rubberfric.base import shown
from rubberfric.materials import Shift

# Relaxation times per decade: a power law is met to 1e-4. How many decades they reach beyond the data.
_TIMES, _BEYOND = 3, 2.0
# Fits, each weighted with the scatter of E' and E'' about the one before it; the least scatter.
_ROUNDS, _EXACT = 4, 1e-4
# Standard deviation of a term before the data are seen, in what the loss at its peak says.
_ALIKE = 2.0
_FEWEST = 6  # frequencies


def kramers_kronig(
    data: ModulusData, per_decade: float = 2.0, *, shift: Shift | None = None
) -> KramersKronig:
    r"""How far measured E' and E'' contradict each other, and where.

    .. math:: \min_{H \ge 0, k} \sum_j \left(\frac{\ln E'_j / E'(\omega_j)}{s'}\right)^2
              + \left(\frac{\ln E''_j / E''(\omega_j) - k(\omega_j)}{s''}\right)^2

    k, linear in ln omega from node to node, is free: the logarithm of what E'' is too large by. Relaxation
    times lie at three a decade up to two decades beyond the data, so that the ends are not forced.

    Parameters
    ----------
    data : ModulusData
        with temperatures: raw curves, superposed by `shift`; without: a master curve.
    per_decade : nodes of k per decade, if there are twice as many frequencies [-]
        more of them find narrower contradictions, and each is known less well.
    shift : of data with temperatures

    Returns
    -------
    KramersKronig

    Raises
    ------
    ValueError
        one line: data of another kind, with values <= 0, with temperatures and no shift, or fewer than
        six frequencies.

    Notes
    -----
    Errors of the data that are not given follow from the scatter of E' and of E'', each by itself. Smooth
    mistakes that are as broad as E' itself are seen only as far as they are no relaxation: E' times a
    constant is one, E'' times a constant is not.

    What a contradiction does to friction is the difference between the tabulated modulus, which takes both
    as they are, and the series, which makes a compromise:

        table = rubberfric.TabulatedModulus(data.omega, data.storage, data.loss)
        series = fitting.fit_prony(data, 2.0).material
        mu = [rubberfric.friction(scene.replace("lower.material", m), v, p) for m in (table, series)]
    """
    if not (is_number(per_decade) and 0 < per_decade <= 10):
        raise ValueError(f"per_decade = {shown(per_decade)}: must be a number > 0, at most 10")
    data = reduced(data, shift)
    omega = data.omega
    if not (data.measured > 0).all():
        raise ValueError(f"data {data.label!r}: have values <= 0: E' and E'' must be > 0")
    t, n = np.log10(omega), omega.size
    if n < _FEWEST:
        raise ValueError(f"data {data.label!r}: {n} frequencies: must be {_FEWEST} at least")
    count = min(max(round(per_decade * np.ptp(t)), 1) + 1, n // 2)
    nodes = np.linspace(t.min(), t.max(), count)
    hats = np.stack([np.interp(t, nodes, one) for one in np.eye(count)], axis=1)
    ends = t.min() - _BEYOND, t.max() + _BEYOND
    times = 10.0 ** -np.linspace(*ends, int(np.ceil(_TIMES * np.ptp(ends))) + 1)
    A = columns(omega, np.append(times, np.inf))
    free = np.concatenate([np.zeros_like(hats), hats])
    order = np.argsort(omega)
    peaks = np.exp(np.interp(-np.log(times), np.log(omega[order]), np.log(data.loss[order])))
    typical = np.append(2 / np.pi * np.log(10) / _TIMES * peaks, 0.1 * data.storage.min())
    error, known = _relative(data)
    for _ in range(1 if known else _ROUNDS):
        E = nonnegative_logarithmic(A, data.measured, np.zeros(2 * n), error, free)
        model = A @ E
        apart = np.log(data.measured / model)
        contradiction = np.linalg.lstsq(hats / error[n:, None], apart[n:] / error[n:], rcond=None)[0]
        # Terms at 0 might as well be there: all may change by as much as the loss at their peak says, so
        # that the bars hold for any of the spectra that fit, not for this one alone.
        width = _ALIKE * np.maximum(E, typical)
        J = np.concatenate([A * width / model[:, None], free], axis=1) / error[:, None]
        precision = J.T @ J + np.diag(np.append(np.ones(E.size), np.zeros(count)))
        covariance = np.linalg.pinv(precision, hermitian=True)
        if not known:
            rest = np.concatenate([apart[:n], apart[n:] - hats @ contradiction]) ** 2
            used = np.sum((J @ covariance) * J, axis=1)
            scatter = [
                max(np.sqrt(rest[part].sum() / max(n - used[part].sum(), 1.0)), _EXACT)
                for part in (slice(n), slice(n, None))
            ]
            error = np.repeat(scatter, n)
    covariance = covariance[-count:, -count:]
    return KramersKronig(
        10.0**nodes,
        contradiction,
        covariance,
        np.sqrt(np.diag(covariance)) < KNOWN,
        (float(np.median(error[:n])), float(np.median(error[n:]))),
        data,
        omega,
        model[n:],
    )


def _relative(data):
    """Relative errors of E' and E'', and whether they were given; of equal size if not."""
    if data.error is None:
        return np.ones(len(data)), False
    return data.error if data.logarithmic else data.error / data.measured, True
