"""Likelihood, information criteria, and leave-one-out, against textbooks and brute force."""

import dataclasses

import numpy as np
import pytest
from scipy import integrate, stats
from support.scenes.fits import (
    AFFINE,
    E_INF,
    FAST,
    H_RMS,
    HURST,
    PLAIN,
    SCENE,
    E,
    linear_data,
    maxwell_columns,
    noise,
)

import fitting
import rubberfric as rf
from fitting import Bounded, Free, Gaussian, ModulusData, Positive, SpectrumData
from fitting.uncertainty.covariance import uncertainty
from fitting.uncertainty.criteria import criteria

OMEGA = np.logspace(0, 6, 6)


def basis():
    return maxwell_columns(OMEGA, PLAIN.tau)


@pytest.mark.parametrize("prior", [{}, {E_INF: Gaussian(2.5e6, 3e5)}])
def test_of_a_linear_problem_every_value_is_predicted_as_without_it(prior):
    data = linear_data(PLAIN, OMEGA, 0.2, seed=1)
    measured, sigma = data.measured, data.error
    result = fitting.fit(SCENE, data, {E: Free(), E_INF: Free()}, prior=prior, quadrature=FAST)
    found = criteria(result)
    rows, aim = basis() / sigma[:, None], measured / sigma
    if prior:
        rows, aim = np.vstack([rows, [0, 0, 1 / 3e5]]), np.append(aim, 2.5e6 / 3e5)
    for i in range(measured.size):
        others = np.delete(np.arange(aim.size), i)
        C = np.linalg.inv(rows[others].T @ rows[others])
        mean = C @ rows[others].T @ aim[others]
        deviation = np.sqrt(sigma[i] ** 2 + basis()[i] @ C @ basis()[i])
        expected = stats.norm.logpdf(measured[i], basis()[i] @ mean, deviation)
        np.testing.assert_allclose(found.left_out[i], expected, rtol=1e-6)
    likelihood = stats.norm.logpdf(measured, basis() @ result.values, sigma).sum()
    np.testing.assert_allclose(found.deviance, -2 * likelihood, rtol=1e-9)
    if not prior:
        assert found.parameters == pytest.approx(3.0)
        np.testing.assert_allclose(found.aic, -2 * likelihood + 6, rtol=1e-9)
        np.testing.assert_allclose(found.aicc, found.aic + 24 / 8, rtol=1e-9)
        np.testing.assert_allclose(found.bic, -2 * likelihood + 3 * np.log(12), rtol=1e-9)
    else:
        assert found.parameters < 2.9
    np.testing.assert_allclose(found.loo, -2 * found.left_out.sum(), rtol=1e-12)


def spectrum(errors):
    q = np.geomspace(2e2, 2e4, 9)
    return SpectrumData(q, np.asarray(rf.power_spectrum(AFFINE, q)) * noise(q.size, 0.2, 2), **errors)


FREE = {H_RMS: Positive(), HURST: Bounded(0.0, 1.0)}


@pytest.mark.slow
def test_of_a_bent_problem_nearly_so():
    data = spectrum({"relative": 0.2})
    result = fitting.fit(SCENE, data, FREE, quadrature=FAST)
    found = criteria(result)
    for i in range(data.q.size):
        part = np.delete(np.arange(data.q.size), i)
        without = fitting.fit(
            SCENE, SpectrumData(data.q[part], data.C[part], relative=0.2), FREE, quadrature=FAST
        )

        def log_C(x, q=data.q[i], fit=without):
            return float(np.log(rf.power_spectrum(fit.problem.scene(x).lower.spectrum, np.array([q]))[0]))

        steps = 1e-4 * np.eye(2)
        slope = np.array([(log_C(without.x + h) - log_C(without.x - h)) / 2e-4 for h in steps])
        deviation = np.sqrt(0.2**2 + slope @ without.uncertainty.spread @ slope)
        expected = stats.norm.logpdf(np.log(data.C[i]), log_C(without.x), deviation)
        assert found.left_out[i] == pytest.approx(expected, abs=0.02)


def test_errors_from_the_scatter_are_those_of_the_greatest_likelihood_and_count_as_one_number():
    result = fitting.fit(SCENE, spectrum({}), FREE, quadrature=FAST)
    found, n = criteria(result), 9
    r = result.residuals[0] * result.estimated[0]
    expected = n * np.log(2 * np.pi * np.mean(r**2)) + n  # textbook: n ln(RSS / n) + const
    np.testing.assert_allclose(found.deviance, expected, rtol=1e-9)
    assert found.parameters == pytest.approx(3.0, abs=1e-6)
    # Scaled errors are estimated errors.
    scaled = fitting.fit(SCENE, spectrum({"relative": 0.01}), FREE, quadrature=FAST, scale_errors=True)
    np.testing.assert_allclose(criteria(scaled).deviance, expected, rtol=1e-3)
    assert criteria(scaled).parameters == pytest.approx(3.0, abs=1e-6)


def test_a_robust_loss_leaves_out_by_its_own_density():
    """One number, an outlier: against the integral over the posterior without each value."""
    omega = np.array([1e-2, 2e-2, 5e-2, 1e-1, 2e-1, 5e-1, 1.0])
    measured = 3e6 * np.array([1.1, 0.9, 1.05, 0.97, 2.5, 1.0, 0.93])
    data = ModulusData(omega, measured, 8e3 * omega, relative=0.1, check_units=False)
    free = {E_INF: Positive()}
    result = fitting.fit(SCENE, data, free, loss="soft_l1", quadrature=FAST)
    found = criteria(result)
    parts = maxwell_columns(omega, PLAIN.tau)[:7] @ [5e7, 8e6, 0]

    def density(x):
        z = (np.log((np.exp(x) + parts) / measured) / 0.1 / 1.287) ** 2
        return np.exp(-(1.287**2) * (np.sqrt(1 + z) - 1)) / np.sqrt(2 * np.pi) / 0.1

    low, high = np.log(2e6), np.log(6e6)
    for i in range(7):

        def others(x, i=i):
            return np.prod(np.delete(density(x), i))

        over = integrate.quad(lambda x, i=i, others=others: others(x) * density(x)[i], low, high, limit=200)[
            0
        ]
        expected = np.log(over / integrate.quad(others, low, high, limit=200)[0])
        assert found.left_out[i] == pytest.approx(expected, abs=0.05), i


def test_a_value_that_alone_determines_a_number_has_leverage_one():
    data = ModulusData([1e-2, 1e5], [3e6, 4e7], [50.0, 2e7], relative=0.05, check_units=False)
    result = fitting.fit(SCENE, data, {E_INF: Positive()}, quadrature=FAST)
    np.testing.assert_allclose(criteria(result).leverage[0], 1.0, atol=0.01)
    assert np.isfinite(criteria(result).loo)
    one = dataclasses.replace(result, error_scale=1.0)
    assert criteria(one).aicc > criteria(one).aic


def test_correlated_errors_of_the_theory_are_those_of_one_normal_distribution():
    """A discrepancy as whitened rows: every value from the conditional of all others, in closed form."""
    data = linear_data(PLAIN, OMEGA, 0.2, seed=4)
    measured, sigma = data.measured, data.error
    i = np.arange(measured.size)
    shared = np.eye(i.size) + 0.8 * np.exp(-0.5 * ((i[:, None] - i) / 2.0) ** 2)
    W = np.linalg.inv(np.linalg.cholesky(shared))
    C = shared * np.outer(sigma, sigma)
    rows = W @ (basis() / sigma[:, None])
    values = np.linalg.solve(rows.T @ rows, rows.T @ W @ (measured / sigma))
    start = fitting.fit(SCENE, data, {E: Free(), E_INF: Free()}, quadrature=FAST)
    problem = start.problem._replace(numbers=start.problem.numbers._replace(whitening=W))
    x = values / np.array([5e7, 8e6, 3e6])
    found = criteria(
        dataclasses.replace(start, problem=problem, x=x, uncertainty=uncertainty(problem, x)), estimated=1
    )
    assert found.parameters == pytest.approx(4.0)
    likelihood = stats.multivariate_normal(basis() @ values, C).logpdf(measured)
    np.testing.assert_allclose(found.deviance, -2 * likelihood, rtol=1e-6)
    # Nearly flat priors of the numbers make the values jointly normal.
    joint = C + basis() @ np.diag([1e20, 1e18, 1e18]) @ basis().T
    for k in i:
        others = np.delete(i, k)
        gain = np.linalg.solve(joint[np.ix_(others, others)], joint[others, k])
        expected = stats.norm.logpdf(
            measured[k], gain @ measured[others], np.sqrt(joint[k, k] - gain @ joint[others, k])
        )
        assert found.left_out[k] == pytest.approx(expected, abs=2e-3)
