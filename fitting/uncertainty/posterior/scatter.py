r"""Errors of data from their scatter about a fit.

.. math:: \hat\sigma = \sigma \sqrt{\frac{\sum_i r_i^2}{n} \Big/ \left(1 - \frac{p}{N}\right)}

with the residuals r of a data set of n values in units of the errors it was fitted with, p the effective
number of parameters and N that of all values. Of a robust loss the median of |r| stands in place of the mean.
"""

from collections.abc import Sequence

import numpy as np

from fitting.solvers.problem import Problem
from fitting.uncertainty.covariance import Linearised, Uncertainty, data_residuals


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
