r"""Tests whether a scene explains its data, and estimates of errors from the scatter.

Three tests reject the scene, each at a level of 0.001:

- the sum of squares, of all data and of each set, against :math:`\chi^2` with the remaining degrees of
  freedom (for a robust fit the median of the squares, which outliers do not change);
- too few changes of sign along a curve, from a systematic misfit: signs of independent residuals differ
  between neighbours with probability 1/2 [Wald and Wolfowitz, Ann. Math. Stat. 11 (1940) 147, for equally
  probable signs]. Residuals whose mean square is below 1 in units of given errors do not reject the scene;
  the text of the verdict names them;
- outliers: the largest of n normal deviates, or, if errors were estimated from the scatter, of n studentised
  residuals [Grubbs, Ann. Math. Stat. 21 (1950) 27].

If errors were estimated from the scatter, only the last two apply. The estimate is

.. math:: \hat\sigma = \sigma \sqrt{\frac{\sum_i r_i^2}{n} \Big/ \left(1 - \frac{p}{N}\right)}

with the residuals r of a data set of n values in units of the errors it was fitted with, p the effective
number of parameters and N the number of all values. For a robust loss the median of |r| replaces the mean,
and the estimate has fewer degrees of freedom by the factor `MEDIAN`.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from fitting.data.measured import Measured
from fitting.solvers.problem import Problem
from fitting.uncertainty.covariance import Linearised, Uncertainty, data_residuals

# Significance level of each test.
_SIGNIFICANCE = 1e-3
# Largest number of outliers that are named.
_WORST = 3
# Largest part of the values that may be outliers if a robust loss is to help.
_FEW = 0.25
# Part of chi-square above which one value dominates.
_DOMINANT = 0.5
# Variance of the squared median of normal deviates over the variance of their mean square. An estimate by the
# median therefore has fewer degrees of freedom by this factor.
MEDIAN = 2.72
# Median of |r| to standard deviation.
_NORMAL = 1.4826


class Verdict(NamedTuple):
    """Result of the tests of the residuals."""

    explains: bool | None  # None: undecided
    text: str  # on one line
    reasons: tuple[str, ...]  # reasons for rejecting the scene, a line each


class _Set(NamedTuple):
    data: Measured
    rows: np.ndarray  # (model - measured) / error, with the given errors
    freedom: float  # share of the set in the degrees of freedom
    has_errors: bool  # True if errors were given


def verdict(
    data: Sequence[Measured],
    rows: Sequence[np.ndarray],
    parameters: float,
    estimated: Sequence[float | None],
    loss: str,
    plausible: bool = True,
) -> Verdict:
    """Return the verdict on a fit.

    Parameters
    ----------
    rows : residuals of each set, in units of its errors, given or estimated
    parameters : effective number of parameters that the data determine
    estimated : estimated relative error of each set, None if errors were given
    loss : name of the loss
    plausible : False if fitted values are implausible, so that a robust loss is not recommended
    """
    count = sum(residuals.size for residuals in rows)
    if not all(np.isfinite(residuals).all() for residuals in rows):
        return Verdict(None, "cannot be judged: the fitted scene is not finite at all data", ())
    if count - parameters < 0.5:
        return Verdict(None, "cannot be judged: as many parameters as values, which any scene explains", ())
    share = 1 - parameters / count
    triples = zip(data, rows, estimated, strict=True)
    sets = [_Set(own, r, r.size * share, scale is None) for own, r, scale in triples]
    with_errors, robust = [entry for entry in sets if entry.has_errors], loss != "linear"
    orders = [order for entry in sets for order in _order(entry)]
    reasons = _size(with_errors, robust) + [text for text, within in orders if not within]
    far = _far(sets)
    if not robust:
        reasons += [_named(*outlier) for outlier in far[:_WORST]]
        reasons += [f"and {len(far) - _WORST} further outliers"] * (len(far) > _WORST)
        reasons += _advice(far, with_errors, rows) if plausible else []
    if reasons:
        return Verdict(False, "THE SCENE DOES NOT EXPLAIN THE DATA", tuple(reasons))
    if not with_errors:
        text = "nothing contradicts it; but the data have no errors: their scatter was used instead"
        return Verdict(None, text, ())
    total = sum(np.sum(entry.rows**2) for entry in with_errors)
    freedom = sum(entry.freedom for entry in with_errors)
    if robust:
        squares = _squares_by_median(np.concatenate([entry.rows for entry in with_errors]))
        outliers = f" except {len(far)} outlier{'s' * (len(far) > 1)} of {count} values" if far else ""
        text = f"explains the data{outliers}: chi-square by the median {squares:.4g}"
    else:
        text = f"explains the data: chi-square {total:.4g}"
    text += f" for {freedom:.4g} degrees of freedom"
    if orders:
        text += f"; residuals are systematic, but within the errors ({orders[0][0]})"
    if not robust and scipy.special.gammainc(freedom / 2, total / 2) < _SIGNIFICANCE:
        text += ", less than chance gives once in 1000: the given errors are too large"
    return Verdict(True, text, ())


def _advice(far, with_errors, rows):
    """Return a line that recommends a robust loss where a minority of outliers spoils the fit."""
    if not far:
        return []
    few = len(far) <= _FEW * sum(residuals.size for residuals in rows)
    share = far[0][0] ** 2 / sum(np.sum(residuals**2) for residuals in rows)
    if with_errors and few and not _size(_without(with_errors, far), robust=False):
        return ['the other values agree with their errors: check the outliers, or use loss="huber"']
    if share > _DOMINANT:
        return [
            f"the largest residual has {100 * share:.0f} % of chi-square: check this value,"
            ' or use loss="huber"'
        ]
    return []


def _size(sets, robust):
    """Return a line for each sum of squares that is too large to be due to chance."""
    if not sets:
        return []
    everything = (
        "",
        np.concatenate([entry.rows for entry in sets]),
        sum(entry.freedom for entry in sets),
    )
    parts = [(f"data {entry.data.label!r}: ", entry.rows, entry.freedom) for entry in sets] * (len(sets) > 1)
    by, reasons = "by the median " * robust, []
    for where, rows, freedom in [everything, *parts]:
        ratio, squares = 1.0, float(np.sum(rows**2))
        if robust:
            ratio, squares = MEDIAN, _squares_by_median(rows)
        # scipy.special, because scipy.stats takes longer to import than a short fit.
        allowed = ratio * 2 * float(scipy.special.gammainccinv(freedom / ratio / 2, _SIGNIFICANCE))
        if squares > allowed:
            reasons.append(
                f"{where}chi-square {by}{squares:.4g} for {freedom:.4g} degrees of freedom, where chance"
                f" exceeds {allowed:.4g} once in {1 / _SIGNIFICANCE:.0f}"
            )
    return reasons


def _squares_by_median(rows):
    """Estimate the sum of squares from the median, which a few outliers barely change."""
    return rows.size * float(_NORMAL * np.median(np.abs(rows))) ** 2


def _order(entry):
    """Return a line for each curve along which the residuals change sign too rarely.

    The second entry of each result is True if the residuals are within given errors.
    """
    data, parts = entry.data, len(entry.data.values)
    conditions = [getattr(data, name) for name in data.conditions]
    # lexsort takes its last key first: along the first condition, the others fixed.
    order = np.lexsort([values for values in conditions if values is not None])
    reasons = []
    for name, rows in zip(data.values, np.split(entry.rows, parts), strict=True):
        signs = np.sign(rows[order])
        signs = signs[signs != 0]
        changes, neighbours = int(np.sum(signs[1:] != signs[:-1])), max(signs.size - 1, 1)
        chance = float(scipy.special.bdtr(changes, neighbours, 0.5))
        if chance < _SIGNIFICANCE:
            what = f" of {name}" * (parts > 1)
            text = (
                f"data {data.label!r}: residuals{what} change their sign {changes} times in {signs.size}"
                f" values along {data.conditions[0]}, chance gives so few changes once in {1 / chance:.2g}"
            )
            reasons.append((text, entry.has_errors and float(np.mean(rows**2)) < 1.0))
    return reasons


def _far(sets):
    """Return a tuple (|residual|, set, index) for each outlier, sorted by decreasing |residual|."""
    outliers, count = [], sum(entry.rows.size for entry in sets)
    for entry in sets:
        size = np.abs(entry.rows)
        if entry.has_errors:
            chance = 2 * count * scipy.special.ndtr(-size)
        else:
            freedom = max(entry.freedom, 1.5)
            # Studentised: scatter without the value's own contribution, inf if all scatter is its own.
            rest = np.maximum(freedom - size**2, 1e-12 * freedom)
            chance = 2 * count * scipy.special.stdtr(freedom - 1, -size * np.sqrt((freedom - 1) / rest))
        outliers += [(float(size[k]), entry, int(k)) for k in np.flatnonzero(chance < _SIGNIFICANCE)]
    return sorted(outliers, key=lambda far: -far[0])


def _without(sets, far):
    rest = []
    for entry in sets:
        kept = np.delete(entry.rows, [k for _, other, k in far if other is entry])
        share = kept.size / entry.rows.size
        rest.append(entry._replace(rows=kept, freedom=entry.freedom * share))
    return rest


def _named(size, entry, k):
    value, way = entry.data.measured[k], "above" if entry.rows[k] > 0 else "below"
    return (
        f"data {entry.data.label!r}: at {entry.data.place(k)} the fit is {size:.3g} errors {way} the measured"
        f" {value:.4g}"
    )


def rescaled_errors(
    problem: Problem,
    scales: Sequence[float | None],
    known: Uncertainty,
    model: Linearised,
    rescaled: bool,
    error_scale: float,
) -> tuple[Problem, list[float | None], float]:
    """Return the problem with errors from the scatter, the estimates, and the factor of given errors.

    Parameters
    ----------
    problem, known, model : the solved problem, with its uncertainty and linearisation at the solution
    scales : current estimate of the relative error of every data set, None if errors were given
    rescaled : True if given errors are to be scaled as well; the factor is 1 otherwise
    error_scale : current factor of given errors
    """
    rows = data_residuals(problem, model)
    error, new_scales, factor = np.array(problem.targets.error), list(scales), 1.0
    # Noise-free data are fitted to rounding; their error must not become zero.
    if rescaled:
        pairs = zip(problem.order, scales, strict=True)
        without_scale = np.concatenate([where for where, scale in pairs if scale is None])
        factor = max(_scatter(problem, known, rows[without_scale]), 1e-10 / error_scale)
        error[without_scale] *= factor
    for i, (scale, where) in enumerate(zip(scales, problem.order, strict=True)):
        if scale is not None:
            new_scales[i] = max(scale * _scatter(problem, known, rows[where]), 1e-10)
            error[where] = new_scales[i]
    return problem._replace(targets=problem.targets._replace(error=error)), new_scales, factor


def common_ratio(before: Problem, after: Problem) -> float | None:
    """Return the factor by which all errors changed, or None if another fit is necessary.

    If all errors change by one factor, a sum of squares is only scaled, and its minimum stays in place.
    """
    numbers = before.numbers
    if before.structure.loss != "linear" or numbers.prior or numbers.whitening is not None:
        return None
    ratios = np.asarray(after.targets.error) / np.asarray(before.targets.error)
    same = np.ptp(ratios) <= 8 * np.finfo(ratios.dtype).eps * ratios[0]
    return float(ratios[0]) if same else None


def _scatter(problem, known, rows):
    """Return the standard deviation of residuals about the fit, corrected for the degrees of freedom."""
    scatter = np.sqrt(np.mean(rows**2))
    if problem.structure.loss != "linear":
        # Outliers, which a robust fit allows for, must not widen all error bars.
        scatter = _NORMAL * np.median(np.abs(rows))
    return float(scatter / np.sqrt(1 - known.parameters / problem.targets.measured.size))
