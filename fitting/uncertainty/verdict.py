r"""Whether a scene explains its data: what chance allows the residuals, and what they are.

Against it speak, each at the level of one in a thousand,

- the sum of squares, of all data and of each set, against :math:`\chi^2` with as many degrees of freedom
  as values are left after the parameters (of a robust fit the median of the squares, which outliers leave
  where it is);
- too few changes of sign along a curve, as a curve that bends otherwise than the data has: of independent
  residuals a neighbour's sign differs with probability 1/2 [Wald and Wolfowitz, Ann. Math. Stat. 11 (1940)
  147, for signs as probable as not];
- single values far off: the largest of n normal deviates, or, where errors are those of the scatter
  itself, of n studentised residuals [Grubbs, Ann. Math. Stat. 21 (1950) 27].

Where errors were estimated from the scatter, only the last two can speak.

Errors of data from their scatter about a fit.

.. math:: \hat\sigma = \sigma \sqrt{\frac{\sum_i r_i^2}{n} \Big/ \left(1 - \frac{p}{N}\right)}

with the residuals r of a data set of n values in units of the errors it was fitted with, p the effective
number of parameters and N that of all values. Of a robust loss the median of |r| stands in place of the mean.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from fitting.data.measured import Measured
from fitting.solvers.problem import Problem
from fitting.uncertainty.covariance import Linearised, Uncertainty, data_residuals

# Of an explained set, one in so many is called unexplained by each of the checks.
LEVEL = 1e-3
# Values that are named.
WORST = 3
# Variance of the squared median of normal deviates over that of their mean square.
_MEDIAN = 2.72
# Median of |r| to standard deviation.
_NORMAL = 1.4826


class Verdict(NamedTuple):
    """What the residuals say of the scene."""

    explains: bool | None  # None: they cannot tell
    text: str  # on one line
    reasons: tuple[str, ...]  # what speaks against the scene, a line each


class _Set(NamedTuple):
    """The residuals of one data set."""

    data: Measured
    rows: np.ndarray  # (model - measured) / error, the errors as they were given
    freedom: float  # its share
    given: bool  # whether errors were


def verdict(
    data: Sequence[Measured],
    rows: Sequence[np.ndarray],
    parameters: float,
    estimated: Sequence[float | None],
    loss: str,
) -> Verdict:
    """The verdict on a fit.

    Parameters
    ----------
    data : data sets
    rows : residuals of each, in units of the errors given, or estimated
    parameters : effective number that they determine
    estimated : of each the estimated relative error, None where errors were given
    loss : of the fit
    """
    count = sum(one.size for one in rows)
    if not all(np.isfinite(one).all() for one in rows):
        return Verdict(None, "cannot be judged: the fitted scene is not finite at all data", ())
    if count - parameters < 0.5:
        return Verdict(None, "cannot be judged: as many parameters as values, which any scene explains", ())
    share = 1 - parameters / count
    triples = zip(data, rows, estimated, strict=True)
    sets = [_Set(one, r, r.size * share, scale is None) for one, r, scale in triples]
    given, robust = [one for one in sets if one.given], loss != "linear"
    reasons = _size(given, robust) + [text for one in sets for text in _order(one)]
    if not robust:
        reasons += _far(sets)
    if reasons:
        return Verdict(False, "THE SCENE DOES NOT EXPLAIN THE DATA", tuple(reasons))
    if not given:
        text = "nothing speaks against it; but without errors of the data their scatter was taken for them"
        return Verdict(None, text, ())
    total, freedom = sum(np.sum(one.rows**2) for one in given), sum(one.freedom for one in given)
    text = f"explains the data: chi-square {total:.4g} for {freedom:.4g} degrees of freedom"
    if not robust and scipy.special.gammainc(freedom / 2, total / 2) < LEVEL:
        text += ", so few by chance in less than one of 1000: the errors given are too large"
    return Verdict(True, text, ())


def _size(sets, robust):
    """Sums of squares that chance does not make."""
    if not sets:
        return []
    everything = ("", np.concatenate([one.rows for one in sets]), sum(one.freedom for one in sets))
    parts = [(f"data {one.data.label!r}: ", one.rows, one.freedom) for one in sets] * (len(sets) > 1)
    by, found = "by the median " * robust, []
    for where, rows, freedom in [everything, *parts]:
        worth, squares = 1.0, float(np.sum(rows**2))
        if robust:
            worth, squares = _MEDIAN, rows.size * float(_NORMAL * np.median(np.abs(rows))) ** 2
        allowed = worth * _bound(freedom / worth)
        if squares > allowed:
            found.append(
                f"{where}chi-square {by}{squares:.4g} for {freedom:.4g} degrees of freedom, where chance"
                f" exceeds {allowed:.4g} once in {1 / LEVEL:.0f}"
            )
    return found


def _bound(freedom):
    """Chi-square that is exceeded with probability LEVEL."""
    return 2 * float(scipy.special.gammainccinv(freedom / 2, LEVEL))


def _order(one):
    """Curves along which the residuals keep their sign for too long."""
    data, parts = one.data, len(one.data.values)
    conditions = [getattr(data, name) for name in data.conditions]
    # lexsort takes its last key first: along the first condition, the others fixed.
    order = np.lexsort([values for values in conditions if values is not None])
    found = []
    for name, rows in zip(data.values, np.split(one.rows, parts), strict=True):
        signs = np.sign(rows[order])
        signs = signs[signs != 0]
        changes, neighbours = int(np.sum(signs[1:] != signs[:-1])), max(signs.size - 1, 1)
        chance = float(scipy.special.bdtr(changes, neighbours, 0.5))
        if chance < LEVEL:
            what = f" of {name}" * (parts > 1)
            found.append(
                f"data {data.label!r}: residuals{what} change their sign {changes} times in {signs.size}"
                f" values along {data.conditions[0]}, so seldom by chance once in {1 / chance:.2g}"
            )
    return found


def _far(sets):
    """The farthest single values, worst first."""
    found, count = [], sum(one.rows.size for one in sets)
    for one in sets:
        size = np.abs(one.rows)
        if one.given:
            chance = 2 * count * scipy.special.ndtr(-size)
        else:
            freedom = max(one.freedom, 1.5)
            # Their own part of the scatter taken out of it; all of it is infinitely far.
            rest = np.maximum(freedom - size**2, 1e-12 * freedom)
            chance = 2 * count * scipy.special.stdtr(freedom - 1, -size * np.sqrt((freedom - 1) / rest))
        found += [(float(size[k]), one, int(k)) for k in np.flatnonzero(chance < LEVEL)]
    found.sort(key=lambda far: -far[0])
    lines = [_named(*far) for far in found[:WORST]]
    return lines + [f"and {len(found) - WORST} values more that are too far off"] * (len(found) > WORST)


def _named(size, one, k):
    value, way = one.data.measured[k], "above" if one.rows[k] > 0 else "below"
    return (
        f"data {one.data.label!r}: at {one.data.place(k)} the fit is {size:.3g} errors {way} the measured"
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
    """The problem with errors from the scatter about its fit.

    Parameters
    ----------
    problem, known, model : as it was solved, and what is known at its solution
    scales : for every data set its relative error as estimated so far, None where errors were given
    rescaled : whether errors that were given are to be scaled as well
    error_scale : their factor so far

    Returns
    -------
    (problem, scales, factor), that of all errors that were given, 1 unless `rescaled`
    """
    rows = data_residuals(problem, model)
    error, found, factor = np.array(problem.targets.error), list(scales), 1.0
    # Data without noise are met to rounding; they must not get an error of zero.
    if rescaled:
        pairs = zip(problem.order, scales, strict=True)
        given = np.concatenate([where for where, scale in pairs if scale is None])
        factor = max(_scatter(problem, known, rows[given]), 1e-10 / error_scale)
        error[given] *= factor
    for i, (scale, where) in enumerate(zip(scales, problem.order, strict=True)):
        if scale is not None:
            found[i] = max(scale * _scatter(problem, known, rows[where]), 1e-10)
            error[where] = found[i]
    return problem._replace(targets=problem.targets._replace(error=error)), found, factor


def common_ratio(before: Problem, after: Problem) -> float | None:
    """What all errors were multiplied by, where the minimum stays; None where it may move.

    Squares of residuals alone scale as a whole, and a second estimate would be the first.
    """
    if before.structure.loss != "linear" or before.structure.prior.terms:
        return None
    if before.numbers.whitening is not None:
        return None
    ratios = np.asarray(after.targets.error) / np.asarray(before.targets.error)
    same = np.ptp(ratios) <= 8 * np.finfo(ratios.dtype).eps * ratios[0]
    return float(ratios[0]) if same else None


def _scatter(problem, known, rows):
    """Standard deviation of residuals about the fit, in units of their errors."""
    if problem.structure.loss == "linear":
        scatter = np.sqrt(np.mean(rows**2))
    else:
        # Outliers, which a robust fit is asked to expect, must not widen all error bars.
        scatter = 1.4826 * np.median(np.abs(rows))
    return float(scatter / np.sqrt(1 - known.parameters / problem.targets.measured.size))
