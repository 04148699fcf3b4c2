"""The theory's own error in a fit: the whitening of its residuals, and the amplitude the data make likely."""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
import scipy

import rubberfric as rf
from fitting.data.kinds import FrictionData
from fitting.data.measured import Measured
from fitting.parameters.discrepancy import Discrepancy, correlations
from fitting.solvers.problem import Problem
from fitting.solvers.residuals import data_rows, padded, residuals_and_jacobian
from fitting.uncertainty.covariance import OPEN
from rubberfric.scene import shifts

# Amplitudes that are tried: beyond the last the theory says nothing, below the first nothing sees it.
_TRIED = np.concatenate([[0.0], np.geomspace(1e-3, 2.0, 67)])


def check_discrepancy(
    discrepancy: Discrepancy, data: Sequence[Measured], loss: str, scale_errors: bool | str
) -> None:
    """ValueError naming what a discrepancy does not go together with."""
    if not isinstance(discrepancy, Discrepancy):
        kind = type(discrepancy).__name__
        raise ValueError(f"discrepancy is a {kind}: must be a fitting.Discrepancy, or None")
    curves = [one for one in data if isinstance(one, FrictionData)]
    if not curves:
        raise ValueError("discrepancy: there are no friction data; must be None")
    for one in curves:
        if one.error is None:
            raise ValueError(
                f"discrepancy: data {one.label!r} have no errors: must have, given as sigma or relative"
            )
        if not np.all(one.velocity):
            raise ValueError(
                f"discrepancy: data {one.label!r} have a velocity 0: must have none, as ln v is needed"
            )
    if loss != "linear":
        raise ValueError(f"discrepancy: not with loss = {loss!r}; must be 'linear'")
    if scale_errors is True:
        raise ValueError("discrepancy: not with scale_errors = True; one of them must go")


def with_discrepancy(
    problem: Problem,
    scenes: Sequence[rf.Scene],
    data: Sequence[Measured],
    discrepancy: Discrepancy | None,
) -> Problem:
    """The problem with residuals that are whitened, or without; the errors of its targets are final.

    scenes, data : data sets, and the scene of each
    """
    whitening = None
    if discrepancy is not None and discrepancy.amplitude:
        covariance = discrepancy.amplitude**2 * _unit_covariance(problem, scenes, data, discrepancy)
        factor = np.linalg.cholesky(np.eye(len(covariance)) + covariance)
        whitening = scipy.linalg.solve_triangular(factor, np.eye(len(factor)), lower=True)
        whitening = whitening.astype(problem.start.dtype)
    return problem._replace(numbers=problem.numbers._replace(whitening=whitening))


def likely(
    problem: Problem,
    x: np.ndarray,
    scenes: Sequence[rf.Scene],
    data: Sequence[Measured],
    discrepancy: Discrepancy,
) -> Discrepancy:
    r"""The amplitude of largest marginal likelihood, the model linear about x, its parameters integrated out.

    .. math:: -2 \ln L = \ln|C| + \ln|J^T C^{-1} J| + \min_\theta (r + J\theta)^T C^{-1} (r + J\theta)

    [restricted likelihood; Patterson & Thompson, Biometrika 58 (1971) 545], priors among the rows.
    """
    of = padded(with_discrepancy(problem, scenes, data, None))
    rows, jacobian = map(of.kept, _linearised(of.structure, of.numbers, of.targets, jnp.asarray(x)))
    count, size = data_rows(problem.structure), len(x)
    # What nothing determines, neither data nor priors, is integrated over a long but finite range.
    known = np.append(rows[count:], np.zeros(size))
    slopes = np.concatenate([jacobian[count:], np.eye(size) / OPEN])
    unit = _unit_covariance(problem, scenes, data, discrepancy)

    def worth(amplitude):
        factor = np.linalg.cholesky(np.eye(count) + amplitude**2 * unit)
        white = scipy.linalg.solve_triangular(
            factor, np.column_stack([rows[:count], jacobian[:count]]), lower=True
        )
        q, upper = np.linalg.qr(np.concatenate([white[:, 1:], slopes]))
        all_rows = np.append(white[:, 0], known)
        left = all_rows @ all_rows - np.sum((q.T @ all_rows) ** 2)
        return np.sum(np.log(np.diag(factor))) + np.sum(np.log(np.abs(np.diag(upper)))) + 0.5 * left

    best = int(np.argmin([worth(amplitude) for amplitude in _TRIED]))
    return dataclasses.replace(discrepancy, amplitude=float(_TRIED[best]), estimated=True)


def _unit_covariance(problem, scenes, data, discrepancy):
    """Covariance of all rows of the data in units of their errors, of amplitude 1."""
    scaled, x, curve = (np.zeros(data_rows(problem.structure)) for _ in range(3))
    error = np.asarray(problem.targets.error)
    found: dict[tuple, int] = {}
    for number, (one, scene, rows) in enumerate(zip(data, scenes, problem.order, strict=True)):
        if not isinstance(one, FrictionData):
            continue
        # The error of the logarithm is that of the value over it.
        scaled[rows] = (1.0 if one.logarithmic else np.abs(one.measured)) / error[rows]
        x[rows] = np.log(np.abs(one.velocity))
        moved = shifts(scene)
        if one.temperature is not None and moved:
            x[rows] += np.asarray(moved[0].log_factor(one.temperature))
        warm = np.zeros_like(one.velocity) if one.temperature is None else one.temperature
        keys = [(number, p, T) for p, T in zip(one.pressure.tolist(), warm.tolist(), strict=True)]
        curve[rows] = [found.setdefault(key, len(found)) for key in keys]
    return scaled[:, None] * scaled * correlations(x, curve, discrepancy)


_linearised = jax.jit(residuals_and_jacobian, static_argnums=0)
