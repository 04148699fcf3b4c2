"""Draws from the posterior: against closed forms and quadrature, their diagnostics, their file."""

import dataclasses
import sys

import jax
import numpy as np
import pytest
from scipy import stats
from support.scenes.fits import E_INF, FAST, PLAIN, SCENE, E, linear_data, maxwell_columns

import fitting
import rubberfric as rf
from fitting import Bounded, FitResult, Free, FrictionData, Gaussian, ModulusData, Positive, Samples, Sum

pytest.importorskip("numpyro")
pytest.importorskip("arviz_stats")

OMEGA = np.logspace(0, 6, 10)


@pytest.fixture(scope="module")
def linear():
    """A problem that is linear in its numbers, with a prior of one."""
    data = linear_data(PLAIN, OMEGA, 0.2, seed=1)
    free, prior = {E: Free(), E_INF: Free()}, {E_INF: Gaussian(2.5e6, 3e5)}
    return fitting.fit(SCENE, data, free, prior=prior, quadrature=FAST)


@pytest.fixture(scope="module")
def samples(linear):
    return linear.sample(3000, warmup=200, chains=2)


def test_a_linear_problem_has_the_normal_posterior_of_the_textbook(linear, samples):
    data = linear.data[0]
    rows = np.vstack([maxwell_columns(OMEGA, PLAIN.tau) / data.error[:, None], [0, 0, 1 / 3e5]])
    aim = np.append(data.measured / data.error, 2.5e6 / 3e5)
    covariance = np.linalg.inv(rows.T @ rows)
    mean = covariance @ rows.T @ aim
    deviation = np.sqrt(np.diag(covariance))
    assert samples.x.shape == (2, 1500, 3) and samples.reliable
    few = samples.ess.min()
    assert few > 1000
    assert np.abs((samples.mean - mean) / deviation).max() < 4 / np.sqrt(few)
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    off = root @ samples.covariance @ root.T - np.eye(3)
    assert np.abs(off).max() < 5 / np.sqrt(few)
    np.testing.assert_allclose(samples.stderr, deviation, rtol=4 / np.sqrt(few))
    low, middle, high = samples.quantiles()
    np.testing.assert_allclose((low - mean) / deviation, -1.96, atol=0.25)
    np.testing.assert_allclose((middle - mean) / deviation, 0.0, atol=0.1)
    np.testing.assert_allclose((high - mean) / deviation, 1.96, atol=0.25)
    # (1 - 0.95) / 2 is not 0.025 to the last bit.
    np.testing.assert_allclose(samples.interval(0.95), [low, high], rtol=1e-14)


def test_density_and_band_are_those_of_the_fit(linear, samples):
    for i in (0, 700):
        expected = float(linear.log_density(samples.x[1, i]))
        assert samples.log_density[1, i] == pytest.approx(expected, rel=1e-10)
    found = samples.band(1e-3, np.array([1e5, 2e5]), draws=300)
    expected = linear.band(1e-3, np.array([1e5, 2e5]))
    np.testing.assert_allclose(found.value, expected.value, rtol=0.02)
    np.testing.assert_allclose(found.high - found.low, expected.high - expected.low, rtol=0.25)


@pytest.mark.slow
def test_a_bent_posterior_is_that_of_quadrature():
    """Few data with large errors, limits of a sum, a robust loss: quantiles from a grid of the density."""
    data = ModulusData([1e-1, 3e3], [2.5e6, 1.4e7], [2e3, 6e6], relative=0.8)
    free = {E + "[1]": Positive(), E_INF: Bounded(1e6, 2e7)}
    prior = {f"{E_INF} + {E}[1]": Sum(high=1.2e7, sigma=0.1)}
    result = fitting.fit(SCENE, data, free, prior=prior, loss="soft_l1", quadrature=FAST)
    draws = result.sample(6000, warmup=300, chains=2, flat="values")
    assert draws.reliable and not np.allclose(draws.mean, result.values, rtol=0.05)
    E1, E_inf = np.linspace(1e3, 4e7, 500), np.linspace(1e6, 2e7, 502)[1:-1]
    one, other = np.meshgrid(E1, E_inf, indexing="ij")
    storage, loss = np.split(maxwell_columns(data.omega, PLAIN.tau), 2)
    log_p = np.zeros(one.shape)
    width = 1.287
    for i in range(2):
        for column, relaxed, measured in ((storage, other, data.storage), (loss, 0.0, data.loss)):
            model = relaxed + column[i, 0] * 5e7 + column[i, 1] * one
            z = (np.log(model / measured[i]) / 0.8 / width) ** 2
            log_p -= 0.5 * width**2 * 2 * (np.sqrt(1 + z) - 1)
    log_p -= 0.5 * (np.maximum(np.log((one + other) / 1.2e7), 0) / 0.1) ** 2
    p = np.exp(log_p - log_p.max())
    for i, (grid, marginal) in enumerate(((E1, p.sum(1)), (E_inf, p.sum(0)))):
        cumulative = np.cumsum(marginal) / marginal.sum()
        for level, found in zip((0.05, 0.5, 0.95), draws.quantiles((0.05, 0.5, 0.95))[:, i], strict=True):
            tolerance = 4 * np.sqrt(level * (1 - level) / draws.ess[i])
            assert np.interp(found, grid, cumulative) == pytest.approx(level, abs=tolerance + 0.005)


def test_keys_decide_the_draws(linear, samples):
    again = linear.sample(3000, warmup=200, chains=2, key=jax.random.key(0))
    np.testing.assert_array_equal(again.x, samples.x)
    seen = []
    other = linear.sample(
        40, warmup=200, chains=2, key=jax.random.key(1), callback=lambda *at: seen.append(at)
    )
    assert other.x.shape == (2, 20, 3)
    assert seen == [(chain, draw) for chain in range(2) for draw in range(1, 221)]
    assert not np.any(other.x == samples.x[:, :20])
    assert not other.reliable and ", not reliable" in repr(other) and "not" not in repr(samples)
    assert (
        "NOT RELIABLE: " in other.report() and "effective draws, but needs 200: draw more" in other.report()
    )


def test_file_and_frame(linear, samples, tmp_path):
    samples.save(tmp_path / "draws.h5")
    again = Samples.load(tmp_path / "draws.h5")
    for name in ("x", "values", "log_density", "diverging", "accepted", "steps", "rhat", "ess"):
        np.testing.assert_array_equal(getattr(again, name), getattr(samples, name))
    assert again.report() == samples.report() and repr(again) == repr(samples)
    assert (again.flat, again.warmup) == ("x", 200)
    np.testing.assert_array_equal(FitResult.load(tmp_path / "draws.h5").values, linear.values)
    again.save(tmp_path / "again.h5")
    frame = samples.to_dataframe()
    assert list(frame) == ["chain", "draw", *linear.names, "log_density"]
    np.testing.assert_allclose(frame[E_INF].mean(), samples.mean[2], rtol=1e-12)
    linear.save(tmp_path / "fit.h5")
    with pytest.raises(ValueError, match=r"fit\.h5: /samples"):
        Samples.load(tmp_path / "fit.h5")
    assert "R-hat" in samples._repr_html_() and E_INF in samples.report()


def test_diagnostics_see_chains_that_disagree(samples):
    from fitting.uncertainty.posterior import diagnosed

    rng = np.random.default_rng(0)
    same = rng.standard_normal((4, 500, 1))
    rhat, ess = diagnosed(same)
    assert abs(rhat[0] - 1) < 0.01 and 1500 < ess[0] < 2600
    rhat, ess = diagnosed(same + np.array([0, 0, 0, 2.0])[:, None, None])
    assert rhat[0] > 1.1 and ess[0] < 100
    # Equal means and different spread: detected only by folded draws.
    rhat, ess = diagnosed(same * np.array([2.0, 1.0, 1.0, 1.0])[:, None, None])
    assert rhat[0] > 1.03
    rhat, ess = diagnosed(np.cumsum(same[:1], 1))
    assert rhat[0] > 1.1 and ess[0] < 100
    apart = dataclasses.replace(samples, rhat=np.array([1.0, 1.2, 1.0]))
    assert not apart.reliable and f"chains disagree on {E}[1], R-hat 1.200" in apart.report()
    lost = dataclasses.replace(samples, diverging=samples.log_density < np.median(samples.log_density))
    assert "trajectories diverged" in lost.report()


def test_what_data_leave_open_is_refused(linear):
    result = fitting.fit(SCENE, linear.data, {E: Free(), "gamma": Positive()}, quadrature=FAST)
    assert result.unidentified
    with pytest.raises(
        ValueError, match=r"^sample: direction 1 is not determined: .* Give its parameters a Gaussian"
    ):
        result.sample(10)
    for options, text in (
        ({"n": 0}, "n = 0: must be an integer, 1 to 1000000"),
        ({"chains": 0.5}, "chains = 0.5: must be an integer, 1 to 1000"),
        ({"warmup": -1}, "warmup = -1: must be an integer, 1 to 1000000"),
        ({"key": 3}, "key = 3: must be a jax.random.key"),
        ({"flat": "E"}, "flat = 'E': must be one of x, values"),
    ):
        with pytest.raises(ValueError, match="must") as caught:
            linear.sample(**options)
        assert text in str(caught.value)
    with pytest.raises(ValueError, match=r"levels = \[2\.0\]: must be within 0 \.\.\. 1"):
        Samples.quantiles(None, [2.0])


@pytest.mark.slow
def test_what_has_bounds_is_drawn_between_them(linear):
    """A parameter without data has its prior as posterior, flat between its bounds."""
    free = {E: Free(), "gamma": Bounded(0.2, 0.6)}
    result = fitting.fit(SCENE, linear.data, free, quadrature=FAST)
    with pytest.raises(ValueError, match="or bounds and flat='values'"):
        result.sample(10)
    draws = result.sample(2000, chains=2, flat="values")
    assert draws.rhat.max() < 1.02
    levels = np.linspace(0.1, 0.9, 5)
    found = draws.quantiles(levels)[:, -1]
    np.testing.assert_allclose(found, 0.2 + 0.4 * levels, atol=0.4 * 2.5 / np.sqrt(draws.ess[-1]))


@pytest.mark.parametrize("package", ["numpyro", "arviz-stats"])
def test_without_the_extra_the_message_says_what_to_install(linear, monkeypatch, package):
    modules = {"numpyro": "numpyro.infer", "arviz-stats": "arviz_stats.base"}
    monkeypatch.setitem(sys.modules, modules[package], None)
    with pytest.raises(ModuleNotFoundError, match=rf"needs {package}.*pip install 'rubberfric\[sampling\]'"):
        linear.sample(10)


@pytest.mark.slow
def test_draws_of_a_friction_fit_cover_the_truth():
    """Simulation-based calibration of a small nonlinear twin: ranks of the truth are uniform."""
    v, rng = np.logspace(-5, 0, 8), np.random.default_rng(3)
    free = {"lower.spectrum.hurst": Bounded(0.3, 1.0), "gamma": Bounded(0.0, 1.0)}
    ranks = []
    for seed in range(40):
        z = rng.logistic(size=2)
        hurst, gamma = 0.3 + 0.7 / (1 + np.exp(-z[0])), 1 / (1 + np.exp(-z[1]))
        truth = SCENE.replace({"lower.spectrum.hurst": hurst, "gamma": gamma})
        mu = np.asarray(rf.friction(truth, v, 3e5, quadrature=FAST)) * np.exp(0.1 * rng.standard_normal(8))
        data = FrictionData(v, mu, pressure=3e5, relative=0.1)
        result = fitting.fit(SCENE.replace(gamma=0.4), data, free, quadrature=FAST)
        draws = result.sample(400, warmup=200, chains=1, flat="values", key=jax.random.key(seed))
        ranks.append((draws.values[0] < [hurst, gamma]).mean(0))
    for column in np.array(ranks).T:
        assert stats.kstest(column, "uniform").pvalue > 1e-3
