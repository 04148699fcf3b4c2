"""Amplitudes of a model error by a scan of the likelihood."""

import math

import numpy as np

from fitting.solvers.evaluation import model_rows, residual_rows


def scanned(off, kernels, law, error):
    """log N(rows; 0, C + J (100^2) J^T) and the prior, (widths, amplitudes): all parameters integrated out.

    The fit `off` with kernels of amplitude 1 and ln(law / theory), and the scanned amplitudes.
    """
    problem, x = off.problem, off.x
    rows = residual_rows(problem._replace(numbers=problem.numbers._replace(whitening=None)), x)[: law.size]
    step = 1e-5
    J = np.stack(
        [
            (model_rows(problem, x + step * e) - model_rows(problem, x - step * e)) / (2 * step * error)
            for e in np.eye(x.size)
        ],
        1,
    )
    amplitudes = np.geomspace(1e-3, 2.0, 400)
    found = np.empty((len(kernels), amplitudes.size))
    for i, unit in enumerate(kernels):
        for k, a in enumerate(amplitudes):
            covariance = np.eye(law.size) + (a / error) ** 2 * unit + 1e4 * J @ J.T
            covariance += np.outer(law, law) / error**2
            found[i, k] = -0.5 * np.linalg.slogdet(covariance)[1]
            found[i, k] -= 0.5 * rows @ np.linalg.solve(covariance, rows)
    median = 0.3 if np.any(law) else 0.5
    lognormal = np.exp(-0.5 * (np.log(amplitudes / median) / 0.5) ** 2) / (0.5 * math.sqrt(2 * math.pi))
    if np.any(law):
        return found + np.log(lognormal + 1 / math.log(2000)), amplitudes
    keep = amplitudes > 0.25
    return found[:, keep] + np.log(lognormal[keep]), amplitudes[keep]


def squares(found, amplitudes):
    """Posterior means of the squared amplitude, of every width."""
    weight = np.exp(found - found.max())
    return weight @ amplitudes**2 / weight.sum()
