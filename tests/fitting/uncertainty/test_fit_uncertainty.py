"""Error bars of the parameters, and reasons for missing ones."""

import dataclasses
import functools

import jax
import numpy as np
import pytest
from scipy import stats
from scipy.optimize import curve_fit
from support.scenes.bars import (
    BOTH,
    DRY_FREE,
    MODULI,
    OMEGA,
    TAU,
    VELOCITY,
    basis,
    every_gap_is_explained,
    modulus,
    modulus_data,
)
from support.scenes.fit_problems import DRY
from support.scenes.fits import E_INF, THREE_TERMS, E, friction_data, linear_data
from support.scenes.fits import FAST as QUADRATURE
from support.scenes.fits import THREE as SCENE

import fitting
import rubberfric as rf
from fitting import Free, Gaussian, ModulusData, Positive, fit
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.objective import CONVERGED, PERFECT
from fitting.solvers.problem import make_problem
from fitting.solvers.runs import run_fits
from fitting.uncertainty.covariance import uncertainty


def test_covariance_of_a_linear_problem_is_its_closed_form():
    data = linear_data(THREE_TERMS, OMEGA)
    result = fit(SCENE, data, {E: Free(), E_INF: Free()})
    weighted = basis() / data.error[:, None]
    covariance = np.linalg.inv(weighted.T @ weighted)
    solution = covariance @ weighted.T @ (data.measured / data.error)
    np.testing.assert_allclose(result.values, solution, rtol=1e-7)
    np.testing.assert_allclose(result.covariance, covariance, rtol=1e-7)
    stderr = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(result.stderr, stderr, rtol=1e-7)
    np.testing.assert_allclose(result.correlation, covariance / np.outer(stderr, stderr), atol=1e-7)
    chisqr = np.sum((weighted @ solution - data.measured / data.error) ** 2)
    assert result.chisqr == pytest.approx(chisqr, rel=1e-9)
    assert result.freedom == pytest.approx(40 - 4, rel=1e-9)
    assert result.redchi == pytest.approx(chisqr / 36, rel=1e-9)
    q = 1.959963984540054
    for end, sign in zip(result.interval(0.95), (-1, 1), strict=True):
        np.testing.assert_allclose(end, solution + sign * q * stderr, rtol=1e-6)
    every_gap_is_explained(result)
    s = np.linalg.svd(weighted * [*MODULI, 3e6], compute_uv=False)  # x is in units of the start values
    assert result.uncertainty.rank == 4
    assert result.uncertainty.condition == pytest.approx(s[0] / s[-1], rel=1e-6)
    np.testing.assert_allclose(np.sort(1 / s), np.sort(result.uncertainty.deviations), rtol=1e-6)


def test_covariance_is_that_of_scipys_curve_fit():
    """Nonlinear: a relaxation time is free too."""
    data = linear_data(THREE_TERMS, OMEGA, 0.02, seed=1)
    free = {E: Positive(), E_INF: Positive(), "upper.material.tau[1]": Positive()}
    result = fit(SCENE, data, free)

    def model(_, *theta):
        material = rf.Prony(theta[3], theta[:3], [TAU[0], theta[4], TAU[2]])
        values = modulus(material=material)
        return np.concatenate([values.real, values.imag])

    best, covariance = curve_fit(
        model,
        np.zeros(40),
        data.measured,
        [*MODULI, 3e6, TAU[1]],
        sigma=data.error,
        absolute_sigma=True,
        x_scale=[*MODULI, 3e6, TAU[1]],
        xtol=1e-12,
        ftol=1e-12,
        method="trf",
    )
    stderr = np.sqrt(np.diag(covariance))
    np.testing.assert_array_less(np.abs(result.values - best), 1e-3 * stderr)
    np.testing.assert_allclose(result.stderr, stderr, rtol=1e-4)
    np.testing.assert_allclose(result.correlation, covariance / np.outer(stderr, stderr), atol=1e-4)


def test_an_unknown_error_is_estimated_from_the_scatter():
    omega = np.logspace(-1, 7, 100)
    known = fit(SCENE, modulus_data(0.05, 0.05, omega=omega), BOTH)
    result = fit(SCENE, modulus_data(noise=0.05, omega=omega, given=False), BOTH)
    # 196 degrees of freedom: 5 % in the estimate.
    assert result.estimated[0] == pytest.approx(0.05, rel=0.15)
    assert known.estimated == (None,)
    assert result.estimated[0] == pytest.approx(0.05 * np.sqrt(known.redchi), rel=1e-4)
    assert result.redchi == pytest.approx(1.0, rel=1e-6)
    np.testing.assert_allclose(result.values, known.values, rtol=1e-5)
    np.testing.assert_allclose(result.stderr, known.stderr * np.sqrt(known.redchi), rtol=1e-4)
    # The scatter is known no better than 196 values tell: Student's quantile.
    low, high = result.interval(0.95)
    deviation = result.uncertainty.deviation
    t = stats.t.ppf(0.975, result.freedom)
    np.testing.assert_allclose(np.log(high / low), 2 * t * deviation, rtol=1e-6)


@pytest.mark.slow
def test_one_unknown_error_takes_no_second_fit():
    """All errors scale equally: equal minimum; cost and error bars equal a fit with the estimate."""
    data = modulus_data(noise=0.05, given=False)
    assumed = fit(SCENE, data, BOTH, scale_errors=False)
    result = fit(SCENE, data, BOTH)
    assert (result.nfev, result.njev) == (assumed.nfev, assumed.njev)
    np.testing.assert_array_equal(result.x, assumed.x)
    values = np.split(data.measured, 2)
    given = fit(SCENE, ModulusData(OMEGA, *values, relative=result.estimated[0]), BOTH)
    assert result.cost == pytest.approx(given.cost, rel=1e-8)
    np.testing.assert_allclose(result.values, given.values, rtol=1e-6)
    np.testing.assert_allclose(result.stderr, given.stderr, rtol=1e-6)
    # A prior does not scale with them. Two data sets with given errors do not scale either.
    known = {E_INF: Gaussian(3e6, 3e4)}
    again = fit(SCENE, data, BOTH, prior=known)
    assert again.njev > fit(SCENE, data, BOTH, prior=known, scale_errors=False).njev
    fine = modulus_data(noise=0.01, seed=1, given=False)
    assert fit(SCENE, [data, fine], BOTH).njev > fit(SCENE, [data, fine], BOTH, scale_errors=False).njev


@pytest.mark.slow
def test_two_sets_of_unknown_errors_are_told_apart():
    fine = modulus_data(noise=0.01, seed=1, omega=np.logspace(-1, 7, 60), given=False)
    coarse = modulus_data(noise=0.08, seed=2, omega=np.logspace(-1, 7, 70), given=False)
    result = fit(SCENE, [coarse, fine], BOTH)
    assert result.estimated == (pytest.approx(0.08, rel=0.2), pytest.approx(0.01, rel=0.2))
    alone = fit(SCENE, fine, BOTH)
    # The coarse set adds next to nothing, and does not blow up the fine one's error bars.
    np.testing.assert_allclose(result.stderr, alone.stderr, rtol=0.15)


def test_priors_narrow_error_bars():
    data = modulus_data()
    plain = fit(SCENE, data, BOTH)
    free = fit(SCENE, data, BOTH, prior={E_INF: Gaussian(3e6, 3e9)})
    held = fit(SCENE, data, BOTH, prior={E_INF: Gaussian(3e6, 3e3)})
    np.testing.assert_allclose(free.stderr, plain.stderr, rtol=1e-3)
    assert held.stderr[0] == pytest.approx(3e3, rel=1e-2)
    assert np.all(held.stderr[1:] <= plain.stderr[1:] * (1 + 1e-6))
    # Parameters that only a prior determines are not counted.
    assert plain.freedom == pytest.approx(36, rel=1e-9)
    assert 36.9 < held.freedom <= 37


@pytest.mark.parametrize(("loss", "points", "longer"), [("huber", 8, 1.3), ("cauchy", 80, 1.12)])
def test_robust_error_bars_are_the_scatter_of_the_estimates(loss, points, longer):
    """Fits of Gaussian points: the scatter of 500 is the standard error of one, which few points lengthen."""
    problem = dry_problem(loss, points)
    runs, measured = many_dry_fits(problem, 500)
    drawn = [problem._replace(targets=problem.targets._replace(measured=one)) for one in measured[:60]]
    stated = [uncertainty(at, x).deviation for at, x in zip(drawn, runs.x, strict=False)]
    ratio = np.mean(stated, 0) / runs.x.std(0)
    assert np.all(ratio > 0.9) and np.all(ratio < longer)
    # The width of the loss costs 5 % of efficiency.
    plain = uncertainty(dry_problem("linear", points), problem.start).deviation
    np.testing.assert_allclose(runs.x.std(0), plain / np.sqrt(0.95), rtol=0.12)


def test_wrong_options_of_a_bootstrap():
    result = fit(SCENE, modulus_data(), BOTH)
    with pytest.raises(ValueError, match="count = 0: must be an integer"):
        result.bootstrap(0)
    with pytest.raises(ValueError, match=r"key = 3: must be a jax\.random\.key"):
        result.bootstrap(4, key=3)
    with pytest.raises(ValueError, match="level = 95: must be"):
        result.bootstrap(4).interval(95)


def test_bootstrap_agrees_with_the_error_bars():
    result = fit(SCENE, modulus_data(), BOTH)
    count = 200
    boot = result.bootstrap(count)
    assert boot.failed == 0 and boot.values.shape == (count, 4) and boot.names == result.names
    # A standard deviation of 200 draws is known to 5 %.
    np.testing.assert_allclose(boot.values.std(0, ddof=1), result.stderr, rtol=4 / np.sqrt(2 * count))
    np.testing.assert_allclose(np.corrcoef(boot.values.T), result.correlation, atol=4 / np.sqrt(count))
    np.testing.assert_array_less(
        np.abs(boot.values.mean(0) - result.values), 4 / np.sqrt(count) * result.stderr
    )
    low, high = boot.interval(0.95)
    inside = np.mean((boot.values >= low) & (boot.values <= high), axis=0)
    np.testing.assert_allclose(inside, 0.95, atol=0.01)
    np.testing.assert_array_equal(result.bootstrap(8).values, result.bootstrap(8, jax.random.key(0)).values)
    assert np.any(result.bootstrap(8, jax.random.key(1)).values != result.bootstrap(8).values)


@functools.cache
def dry_data(points=12):
    velocity = np.logspace(-6, 1, points)
    return friction_data(DRY, velocity, error=0.0, relative=0.1)


def dry_problem(loss="linear", points=12):
    data = dry_data(points)
    return make_problem(DRY, [data], DRY_FREE, loss=loss, quadrature=QUADRATURE)


def many_dry_fits(problem, count):
    """Fits of the problem with noise of its errors: their ends, and the data."""
    exact = np.asarray(problem.targets.measured)
    measured = exact + 0.1 * np.random.default_rng(7).standard_normal((count, exact.size))
    targets = jax.tree.map(lambda a: a[None], problem.targets)._replace(measured=measured)
    starts = np.tile(problem.start, (count, 1))
    runs = run_fits(LevenbergMarquardt(), problem, starts, targets, batch=100)
    assert np.isin(runs.status, (CONVERGED, PERFECT)).all()
    return runs, measured


@pytest.mark.slow
def test_intervals_and_bands_hold_the_truth_at_the_stated_rate():
    """2000 fits of a linear problem; two standard errors of a rate of 95 % are then 1 %."""
    problem, count = dry_problem(), 2000
    ends, _ = many_dry_fits(problem, count)
    exact = fit(DRY, dry_data(), DRY_FREE, quadrature=QUADRATURE)
    for level in (0.68, 0.95):
        tolerance = 3 * np.sqrt(level * (1 - level) / count)
        reach = stats.norm.ppf(0.5 + 0.5 * level) * exact.uncertainty.deviation
        inside = np.mean(np.abs(ends.x - problem.start) < reach, axis=0)
        np.testing.assert_allclose(inside, level, atol=tolerance)
        # ln mu = ln tau_f0 - c log10(v / v0)^2 + constants.
        v = np.array([1e-8, 1e-4, 6e-3, 1.0, 100.0])
        band = exact.band(v, 1e5, level=level)
        slope = np.stack([np.ones(5), -0.1 * np.log10(v / 6e-3) ** 2])
        off = (ends.x - problem.start) @ slope
        inside = np.mean(
            (off > np.log(band.low / band.value)) & (off < np.log(band.high / band.value)), axis=0
        )
        np.testing.assert_allclose(inside, level, atol=tolerance)


def test_band_is_that_of_the_closed_form():
    result = fit(DRY, dry_data(), DRY_FREE, quadrature=QUADRATURE)

    def rows(v):
        return np.stack([np.ones(np.size(v)), -0.1 * np.log10(v / 6e-3) ** 2], 1)

    covariance = np.linalg.inv(rows(VELOCITY).T @ rows(VELOCITY)) * 0.1**2
    v = np.array([[1e-8, 1e-3], [0.1, 50.0]])
    band = result.band(v, 1e5)
    at = rows(v.ravel())
    reach = 1.959963984540054 * np.sqrt(np.einsum("ki,ij,kj->k", at, covariance, at)).reshape(2, 2)
    np.testing.assert_allclose(band.value, result.predict(v, 1e5), rtol=1e-12)
    np.testing.assert_allclose(np.log(band.high / band.value), reach, rtol=1e-6)
    np.testing.assert_allclose(np.log(band.value / band.low), reach, rtol=1e-6)


def test_ten_per_cent_are_a_value_as_any_other(tmp_path):
    """The relative error that is assumed at first may be given, or estimated, too."""
    data = modulus_data(noise=0.05, given=False)
    estimated = dataclasses.replace(fit(SCENE, data, BOTH), estimated=(0.1,))
    assert "no errors given: 10 % estimated from the scatter" in estimated.report()
    given = fit(SCENE, modulus_data(0.1, 0.05), BOTH)
    assert given.estimated == (None,) and not given.assumed
    assert "errors given (relative 10 %)" in given.report()
    assumed = fit(SCENE, data, BOTH, scale_errors=False)
    assert assumed.assumed and assumed.estimated == (0.1,)
    for result, text in (
        (estimated, "10 % estimated"),
        (assumed, "10 % assumed, not estimated, as was asked"),
    ):
        result.save(tmp_path / "fit.h5")
        again = fitting.FitResult.load(tmp_path / "fit.h5")
        assert again.assumed == result.assumed and text in again.report()
