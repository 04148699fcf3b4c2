r"""Model error of the theory in a fit: whitening of the residuals, and estimates of amplitude and width.

Amplitude a and width w are averaged over their posterior on a grid. The logarithm of the posterior is the
restricted log likelihood of the model linearised about x, with its parameters integrated out and the priors
among the rows [Patterson & Thompson, Biometrika 58 (1971) 545],

.. math:: -2 \ln L = \ln|C| + \ln|J^T C^{-1} J| + \min_\theta (r + J\theta)^T C^{-1} (r + J\theta)

plus the logarithm of the prior of the amplitude. It is half lognormal and half log-uniform if the law fitted
to boundary elements is used or compared, otherwise lognormal above half of its median. All widths are equally
likely. C contains the known difference d between theory and law as d d^T, if it was computed.

Errors that are smooth over the whole range of the data resemble a change of parameters. The most likely
amplitude is then too small. The fit is therefore weighted with the posterior mean of C.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import scipy

import rubberfric as rf
from fitting.data.kinds import AreaData, FrictionData
from fitting.data.measured import Measured
from fitting.parameters.discrepancy import (
    WIDTHS,
    Discrepancy,
    between_curves,
    covariances,
    rational_quadratic,
    squared_exponential,
)
from fitting.solvers.problem import Problem
from fitting.solvers.residuals import data_rows
from fitting.uncertainty.covariance import OPEN, Linearised, weighted_rows
from rubberfric.materials import log_factors
from rubberfric.scene import shifts

# Amplitudes of the grid. Above the last the theory is useless, below the first its error has no effect.
_AMPLITUDES = np.geomspace(1e-3, 2.0, 39)
# Median of the prior of an amplitude for each contact model. The paper's friction differs systematically from
# boundary elements, by 0.3 to 0.4. With an amplitude of 0.5 intervals contain the truth. The law differs by
# 0.06, and by 0.1 in the least favourable scenes.
_MEDIANS = {"paper": 0.5, "boundary_elements": 0.1}
# Standard deviation of the logarithm of an amplitude in its prior, a factor of 1.6.
_DEVIATION = 0.5
# Median of the rest of the theory's error if its difference to the law is known. Values from 0.2 to 0.35 give
# intervals of the stated coverage (tests/fitting/uncertainty/test_coverage.py).
_COMPARED = 0.3
# The law is extrapolated beyond this q1/q0. There its median grows by 0.1 in a factor of ten, which at 1e4 is
# half of the difference between law and paper.
_TESTED = 512.0
# Amplitude over the median, and width, of the first fit where they are to be estimated.
_GUESS = 0.6, math.log(10)
# Smallest amplitude over the median if the law cannot be compared.
_SMALLEST = 0.5
# Larger amplitudes, errors of more than a factor of two, are implausible.
_LARGE = math.log(2)
# Difference of log likelihoods above which the given amplitude and width are doubted.
_AGAINST = 5.0


def check_discrepancy(
    discrepancy: Discrepancy, data: Sequence[Measured], loss: str, scale_errors: bool | str
) -> None:
    """Raise ValueError if the fit's options do not allow a discrepancy."""
    if not isinstance(discrepancy, Discrepancy):
        kind = type(discrepancy).__name__
        raise ValueError(f"discrepancy is a {kind}: must be a fitting.Discrepancy, or None")
    curves = [curve for curve in data if isinstance(curve, FrictionData)]
    if not curves:
        raise ValueError("discrepancy: must be None, because there are no friction data")
    for curve in curves:
        if curve.error is None:
            raise ValueError(f"discrepancy: data {curve.label!r} have no errors: must have sigma or relative")
        if not np.all(curve.velocity):
            raise ValueError(
                f"discrepancy: data {curve.label!r} have a velocity 0: must be != 0, because ln v is needed"
            )
    if loss != "linear":
        raise ValueError(f"discrepancy: not possible with loss = {loss!r}; loss must be 'linear'")
    if scale_errors is True:
        raise ValueError("discrepancy: not possible with scale_errors = True; one of them must be left out")


def with_discrepancy(
    problem: Problem, scenes: Sequence[rf.Scene], data: Sequence[Measured], discrepancy: Discrepancy | None
) -> Problem:
    """Return the problem with the whitening matrix of a discrepancy, or without one if None.

    The errors in the targets must be final. `scenes` has the scene of each data set.
    """
    whitening = None
    if discrepancy is not None and discrepancy.amplitude:
        covariance = model_covariance(problem, scenes, data, discrepancy)
        factor = np.linalg.cholesky(np.eye(len(covariance)) + covariance)
        whitening = scipy.linalg.solve_triangular(factor, np.eye(len(factor)), lower=True)
        whitening = whitening.astype(problem.start.dtype)
    return problem._replace(numbers=problem.numbers._replace(whitening=whitening))


def model_covariance(
    problem: Problem, scenes: Sequence[rf.Scene], data: Sequence[Measured], discrepancy: Discrepancy
) -> np.ndarray:
    """Return the covariance of the model error in the data rows, in units of their errors, (rows, rows)."""
    scaled, x, curve = _places(problem, scenes, data)
    covariance = scaled[:, None] * scaled * covariances(x, curve, discrepancy)
    if discrepancy.law:
        known = _per_error(problem, data) * np.array(discrepancy.law)
        covariance += known[:, None] * known
    return covariance


def median_amplitude(scenes: Sequence[rf.Scene], by_law: bool = False) -> float:
    """Return the median of the prior of the amplitude [-], the largest one of all scenes.

    If `by_law` is True, the difference between theory and law is known, and only the rest is estimated.
    """

    def of_one(scene):
        median = _MEDIANS[scene.contact_model]
        if scene.contact_model == "paper":
            return _COMPARED if by_law else median
        spectra = [body.spectrum for body in (scene.lower, scene.upper) if body.spectrum is not None]
        ends = [spectrum.power_law().q for spectrum in spectra]
        decades = max((math.log10(q[-1] / q[0] / _TESTED) for q in ends), default=0.0)
        return median + 0.1 * max(0.0, decades)

    return max(of_one(scene) for scene in scenes)


def first_guess(discrepancy: Discrepancy, scenes: Sequence[rf.Scene]) -> Discrepancy:
    """Return the discrepancy of the first fit, with guesses of unknown amplitude and width."""
    amplitude, width = discrepancy.amplitude, discrepancy.width
    return dataclasses.replace(
        discrepancy,
        amplitude=_GUESS[0] * median_amplitude(scenes) if amplitude is None else amplitude,
        width=_GUESS[1] if width is None else width,
    )


def is_open(discrepancy: Discrepancy) -> bool:
    """Return True if the amplitude or the width is to be estimated."""
    return discrepancy.amplitude is None or (discrepancy.width is None and discrepancy.amplitude > 0)


def with_remark(discrepancy: Discrepancy, asked: Discrepancy, judged: tuple | None) -> Discrepancy:
    """Return a discrepancy with a remark if the data contradict it, or if its estimate failed.

    `discrepancy` is the one of the last fit, `asked` is given by the user, and `judged` has the arguments of
    `averaged`, or is None if the fit did not converge.
    """
    if judged is None and is_open(asked):
        remark = "amplitude and width are assumed, not estimated, because the fit did not succeed"
        return dataclasses.replace(discrepancy, remark=remark)
    if judged is None or is_open(asked) or not asked.amplitude:
        return discrepancy
    return dataclasses.replace(discrepancy, remark=averaged(*judged).remark)


def averaged(
    problem: Problem,
    model: Linearised,
    scenes: Sequence[rf.Scene],
    data: Sequence[Measured],
    discrepancy: Discrepancy,
    law: np.ndarray | None = None,
) -> Discrepancy:
    """Return the discrepancy of a fit, with unknown amplitude and width averaged over the posterior.

    `model` is the problem linearised at the solution, and `law` is ln(law / theory) there, or None. `remark`
    of the result states why the given `discrepancy` may not suit the data.
    """
    law = np.zeros(data_rows(problem.structure)) if law is None else law
    likelihood = _Likelihood(problem, model, scenes, data, discrepancy.shared, law)
    amplitude, width = discrepancy.amplitude, discrepancy.width
    everything = np.array([likelihood(squared_exponential, w, _AMPLITUDES) for w in WIDTHS])
    best = np.unravel_index(np.argmax(everything), everything.shape)
    if amplitude is None and width is None:
        likelihoods, amplitudes, widths = everything, _AMPLITUDES, WIDTHS
    else:
        amplitudes = _AMPLITUDES if amplitude is None else np.array([amplitude])
        widths, kernel = (WIDTHS, squared_exponential) if width is None else ((width,), rational_quadratic)
        likelihoods = np.array([likelihood(kernel, w, amplitudes) for w in widths])
    remarks = []
    gain = float(everything[best] - likelihoods.max())
    if gain > _AGAINST:
        decades = WIDTHS[best[0]] / math.log(10)
        remarks.append(
            f"the data are e^{gain:.0f} times as likely with an amplitude of"
            f" {100 * _AMPLITUDES[best[1]]:.2g} % over {decades:.2g} decades: see fitting.Discrepancy"
        )
    posterior = likelihoods
    if amplitude is None:
        by_law = bool(law.any()) or all(scene.contact_model != "paper" for scene in scenes)
        posterior = likelihoods + _log_prior(amplitudes, median_amplitude(scenes, by_law), by_law)
    weight = np.exp(posterior - posterior.max())
    weight /= weight.sum()
    variances, of_width = weight @ amplitudes**2, weight.sum(1)
    law_differences = tuple(law.tolist()) if law.any() else ()
    level = dataclasses.replace(discrepancy, law=law_differences).level
    total = float(np.sqrt(variances.sum() + level**2))
    if width is None:
        remarks += _at_the_ends(of_width)
    rest = math.sqrt(variances.sum())
    if amplitude is None and rest > _LARGE:
        remarks.append(
            f"an amplitude of {100 * rest:.3g} % is implausibly large: check the scene and the units of the"
            " data, or free more parameters"
        )
    parts = tuple(zip(np.sqrt(variances).tolist(), widths, strict=True)) if width is None else ()
    return dataclasses.replace(
        discrepancy,
        amplitude=total,
        width=float(np.exp(of_width @ np.log(widths))),
        estimated=amplitude is None,
        parts=parts,
        law=law_differences,
        remark="; ".join(remarks),
    )


def _log_prior(amplitudes, median, is_mixed):
    """Return the log density of ln a: normal, or, if `is_mixed`, half normal and half flat.

    The flat half allows for an exact law. The error of the theory is never small. Without the flat half,
    amplitudes below half of the median are excluded, because free parameters can follow the error.
    """
    lognormal = scipy.stats.norm.logpdf(np.log(amplitudes), np.log(median), _DEVIATION)
    if is_mixed:
        return np.log(0.5 * np.exp(lognormal) + 0.5 / np.log(_AMPLITUDES[-1] / _AMPLITUDES[0]))
    return np.where(amplitudes < _SMALLEST * median, -np.inf, lognormal)


def _at_the_ends(of_width):
    """Return a remark if the most probable width is the first or the last, given all probabilities."""
    first, last = (w / math.log(10) for w in (WIDTHS[0], WIDTHS[-1]))
    if of_width[0] > 0.5:
        return [
            f"the width is most likely the shortest tried, {first:.2g} decades: the theory's error looks"
            " like noise, so check the errors of the data"
        ]
    if of_width[-1] > 0.5:
        return [
            f"the width is most likely the longest tried, {last:.2g} decades: so smooth an error can"
            " hardly be distinguished from a change of parameters, so give priors"
        ]
    return []


class _Likelihood:
    """Restricted log likelihood of data as a function of kernel, width and amplitudes."""

    def __init__(self, problem, model, scenes, data, shared, law):
        bare = with_discrepancy(problem, scenes, data, None)
        rows, *_, jacobian = weighted_rows(bare, model)
        count, size = data_rows(problem.structure), jacobian.shape[1]
        rows, jacobian = np.asarray(rows, float), np.asarray(jacobian, float)
        known = _per_error(problem, data) * law
        factor = np.linalg.cholesky(np.eye(count) + known[:, None] * known)
        self.whiten = scipy.linalg.solve_triangular(factor, np.eye(count), lower=True)
        self.of_data = self.whiten @ np.column_stack([rows, jacobian])[:count]
        # Parameters that neither data nor priors determine are integrated over a long but finite range.
        self.others = np.concatenate(
            [
                np.column_stack([rows, jacobian])[count:],
                np.column_stack([np.zeros(size), np.eye(size) / OPEN]),
            ]
        )
        self.scaled, self.x, self.curve = _places(problem, scenes, data)
        self.shared = shared

    def __call__(self, kernel, width, amplitudes):
        """Return the log likelihood of every amplitude, up to a constant that all amplitudes share."""
        unit = between_curves(kernel(self.x, width), self.curve, self.shared)
        covariance = self.whiten @ (self.scaled[:, None] * self.scaled * unit) @ self.whiten.T
        values, vectors = np.linalg.eigh(covariance)
        values, turned = np.maximum(values, 0.0), vectors.T @ self.of_data
        return np.array([self._of(1 + a**2 * values, turned) for a in amplitudes])

    def _of(self, variances, turned):
        white = np.concatenate([turned / np.sqrt(variances)[:, None], self.others])
        # The last diagonal element of R is the norm of the residual after the fit.
        upper = np.abs(np.diag(np.linalg.qr(np.roll(white, -1, axis=1), mode="r")))
        return -0.5 * np.sum(np.log(variances)) - np.sum(np.log(upper[:-1])) - 0.5 * upper[-1] ** 2


def _per_error(problem, data):
    """Return 1 / relative error of all friction and area values, 0 for other data."""
    scaled, error = np.zeros(data_rows(problem.structure)), np.asarray(problem.targets.error)
    for dataset, rows in zip(data, problem.order, strict=True):
        if isinstance(dataset, FrictionData | AreaData):
            # The error of the logarithm is the error of the value divided by the value.
            scaled[rows] = (1.0 if dataset.logarithmic else np.abs(dataset.measured)) / error[rows]
    return scaled


def _places(problem, scenes, data):
    """Return 1 / relative error, ln(v a_T), and the number of the curve of all rows, 0 except of friction."""
    scaled, x, curve = (np.zeros(data_rows(problem.structure)) for _ in range(3))
    per_error = _per_error(problem, data)
    places: dict[tuple, int] = {}
    for number, (dataset, scene, rows) in enumerate(zip(data, scenes, problem.order, strict=True)):
        if not isinstance(dataset, FrictionData):
            continue
        scaled[rows] = per_error[rows]
        x[rows] = np.log(np.abs(dataset.velocity))
        moved = shifts(scene)
        if dataset.temperature is not None and moved:
            x[rows] += log_factors(moved[0], dataset.temperature)
        warm = np.zeros_like(dataset.velocity) if dataset.temperature is None else dataset.temperature
        keys = [(number, p, T) for p, T in zip(dataset.pressure.tolist(), warm.tolist(), strict=True)]
        curve[rows] = [places.setdefault(key, len(places)) for key in keys]
    return scaled, x, curve
