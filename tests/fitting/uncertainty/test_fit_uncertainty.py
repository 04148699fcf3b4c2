"""Error bars of the parameters, and reasons for missing ones."""

import dataclasses
import functools

import jax
import numpy as np
import pytest
from scipy import stats
from scipy.optimize import curve_fit
from support.scenes.fits import E_INF, ROAD, E
from support.scenes.fits import FAST as QUADRATURE

import fitting
import rubberfric as rf
from fitting import AreaData, Bounded, Free, FrictionData, Gaussian, ModulusData, Positive, Smooth, fit
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.objective import CONVERGED, PERFECT
from fitting.solvers.problem import make_problem
from fitting.solvers.runs import run_fits
from fitting.uncertainty.covariance import OPEN, uncertainty
from fitting.uncertainty.intervals import quantile

TAU = np.array([1e-5, 1e-3, 1e-1])
MODULI = np.array([5e7, 8e6, 2e6])
SCENE = rf.Scene(ROAD, rf.Body(rf.Prony(3e6, MODULI, TAU)))
BOTH = {E_INF: Positive(), E: Positive()}
OMEGA = np.logspace(-1, 7, 20)
# Shear stress times the contact area of an elastic rubber, the same at every velocity: ln mu is
# linear in ln tau_f0 and in c.
DRY = rf.Scene(ROAD, rf.Body(rf.Elastic(1e7, 0.5)), shear=rf.ContactShear(6.5e6, 0.1, 6e-3))
DRY_FREE = {"shear.tau_f0": Positive(), "shear.c": Free(scale=0.1)}
VELOCITY = np.logspace(-6, 1, 12)


def modulus(omega=OMEGA, material=SCENE.upper.material):
    return np.asarray(rf.complex_modulus(material, omega))


def modulus_data(relative=0.03, noise=0.03, seed=0, omega=OMEGA, given=True):
    exact = modulus(omega)
    measured = np.concatenate([exact.real, exact.imag])
    measured *= np.exp(noise * np.random.default_rng(seed).standard_normal(measured.size))
    return ModulusData(omega, *np.split(measured, 2), relative=relative if given else None)


def basis(omega=OMEGA):
    """E' and then E'' of the three terms at unit modulus, and of E_inf: columns."""
    a = omega[:, None] * TAU
    terms = np.concatenate([a**2 / (1 + a**2), a / (1 + a**2)])
    return np.concatenate([terms, np.repeat([1.0, 0.0], omega.size)[:, None]], 1)


def linear_data(seed=0, size=0.1):
    """A modulus with absolute errors; the model is linear in the moduli."""
    exact = modulus()
    values = np.concatenate([exact.real, exact.imag])
    sigma = size * values
    measured = values + sigma * np.random.default_rng(seed).standard_normal(values.size)
    return ModulusData(OMEGA, *np.split(measured, 2), *np.split(sigma, 2), check_units=False)


def every_gap_is_explained(result):
    """NaN exactly where `withheld` gives a reason."""
    for name, error in zip(result.names, result.stderr, strict=True):
        assert np.isnan(error) == (name in result.withheld), name
        assert result.withheld.get(name, "a reason")
    known = [name not in result.withheld for name in result.names]
    for matrix in (result.covariance, result.correlation):
        np.testing.assert_array_equal(np.isfinite(matrix), np.outer(known, known))
    low, high = result.interval()
    np.testing.assert_array_equal(np.isfinite(low) & np.isfinite(high), known)
    assert np.isfinite(result.values).all() and np.isfinite(result.cost)


# --- error bars


def test_covariance_of_a_linear_problem_is_its_closed_form():
    data = linear_data()
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
    data = linear_data(1, size=0.02)
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


@pytest.mark.slow
def test_a_robust_scatter_is_not_that_of_the_outliers():
    data = modulus_data(noise=0.03, omega=np.logspace(-1, 7, 60), given=False)
    measured = data.measured.copy()
    measured[::20] *= 5.0
    struck = data.replaced(measured)
    assert fit(SCENE, struck, BOTH).estimated[0] > 0.2
    assert fit(SCENE, struck, BOTH, loss="cauchy").estimated[0] == pytest.approx(0.03, rel=0.25)


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


@pytest.mark.slow
def test_robust_error_bars_are_the_scatter_of_the_estimates():
    """Cauchy fits of 80 Gaussian points: the scatter of 500 is the standard error of one."""
    problem = dry_problem("cauchy", 80)
    runs, measured = many_dry_fits(problem, 500)
    deviations = []
    for one, x in zip(measured[:20], runs.x[:20], strict=True):
        drawn = problem._replace(targets=problem.targets._replace(measured=one))
        deviations.append(uncertainty(drawn, x).deviation)
    # 500 draws know a standard deviation to 3.2 %; one fit of 80 points knows it worse.
    np.testing.assert_allclose(np.mean(deviations, 0), runs.x.std(0), rtol=0.12)
    # The width of the loss costs 5 % of efficiency.
    plain = uncertainty(dry_problem("linear", 80), problem.start).deviation
    np.testing.assert_allclose(runs.x.std(0), plain / np.sqrt(0.95), rtol=0.12)


def test_robust_error_bars_of_few_points_are_withheld_with_a_reason():
    """Each direction is known to better than a factor e, their sum in tau_f0 is not."""
    data = FrictionData(
        VELOCITY[[0, 3, 8, 11]],
        np.exp([-2.36698859, 0.77516245, -0.53305407, -2.50681706]),
        pressure=1e5,
        relative=[0.25707941, 0.78190658, 0.49738595, 3.12469569],
        check_units=False,
    )
    problem = make_problem(DRY, [data], DRY_FREE, loss="cauchy", quadrature=QUADRATURE)
    known = uncertainty(problem, problem.start)
    assert known.withheld and set(known.withheld.values()) == {"not identified, see direction 1"}
    assert len(known.unidentified) == 1


# --- unidentified directions


@functools.cache
def light():
    """Friction under 1 kPa: 24 points, 3 %, of a rubber with three terms."""
    velocity = np.logspace(-4, 1, 24)
    exact = np.asarray(rf.friction(SCENE, velocity, 1e3, quadrature=QUADRATURE))
    measured = exact * np.exp(0.03 * np.random.default_rng(0).standard_normal(24))
    return FrictionData(velocity, measured, pressure=1e3, relative=0.03)


def within_four_sigma(result, truth):
    return np.all(np.abs(result.values - truth) < 4 * result.stderr)


@pytest.mark.slow
def test_friction_at_light_load_does_not_know_the_scale_of_the_moduli():
    result = fit(SCENE, light(), BOTH, quadrature=QUADRATURE)
    assert result.success
    (direction,) = result.unidentified
    assert direction.deviation > 10
    np.testing.assert_allclose(direction.loadings, direction.loadings[0], rtol=0.05)
    assert direction.text.startswith(f"{E_INF} * λ, {E} (all 3 elements) * λ: ")
    assert "depends on ratios of moduli only: add a measured modulus (one point is enough)" in direction.text
    assert result.withheld == dict.fromkeys(result.names, "not identified, see direction 1")
    every_gap_is_explained(result)
    # Ratios are known well, whatever the scale: the other directions are short.
    assert np.sort(result.uncertainty.deviations)[-2] < 0.1
    ratios = result.values[1:] / result.values[0]
    np.testing.assert_allclose(ratios, MODULI / 3e6, rtol=0.2)
    # The friction under that load is determined although no modulus is.
    band = result.band(light().velocity, 1e3)
    assert np.all(np.log(band.high / band.low) < 0.3)


@pytest.mark.parametrize("kind", ["modulus", "area"])
@pytest.mark.slow
def test_one_point_of_modulus_or_an_area_curve_identify_it(kind):
    if kind == "modulus":
        exact = modulus(np.array([1e4]))
        more = ModulusData([1e4], exact.real * 1.02, exact.imag * 0.99, relative=0.03)
    else:
        velocity = light().velocity[::4]
        area = np.asarray(rf.contact_area(SCENE, velocity, 1e3, quadrature=QUADRATURE))
        noise = np.exp(0.03 * np.random.default_rng(5).standard_normal(6))
        more = AreaData(velocity, area * noise, pressure=1e3, relative=0.03)
    result = fit(SCENE, [light(), more], BOTH, quadrature=QUADRATURE)
    assert result.success and not result.unidentified and not result.withheld
    every_gap_is_explained(result)
    assert np.all(result.stderr < 0.2 * result.values)
    assert within_four_sigma(result, np.array([3e6, *MODULI]))


@pytest.mark.slow
def test_friction_at_light_load_cannot_tell_gamma_from_the_height_of_the_roughness():
    """Data without noise, so that the fit keeps its start along unidentified directions."""
    data = light().replaced(np.asarray(rf.friction(SCENE, light().velocity, 1e3, quadrature=QUADRATURE)))
    free = {"gamma": Bounded(0.1, 1.0), "lower.spectrum.h_rms": Positive()}
    result = fit(SCENE, data, free, quadrature=QUADRATURE)
    (direction,) = result.unidentified
    up, height = direction.loadings
    assert up * height < 0 and abs(up) > 0.1 and abs(height) > 0.1
    assert "gamma" in direction.text and "lower.spectrum.h_rms * λ" in direction.text
    assert "add a measured spectrum or an area curve, or fix gamma or the cut-off" in direction.text
    assert set(result.withheld) == set(free)
    every_gap_is_explained(result)


@pytest.mark.slow
def test_a_term_outside_the_measured_frequencies_is_named_alone():
    scene = rf.Scene(ROAD, rf.Body(rf.Prony(3e6, [1e8, 5e7, 8e6, 2e6], [1e-14, *TAU])))
    result = fit(scene, modulus_data(noise=0.0), BOTH)
    (direction,) = result.unidentified
    assert direction.text.startswith(f"{E}[0] * λ: ")
    assert direction.text.endswith("; the data do not determine it: fix it, or give it a prior")
    assert set(result.withheld) == {f"{E}[0]"}
    every_gap_is_explained(result)
    # A prior is as good as data that reach it.
    smooth = fit(scene, modulus_data(noise=0.0), BOTH, prior={E: Smooth(0.05)})
    assert not smooth.withheld and not smooth.unidentified


def test_two_parameters_that_enter_as_a_product():
    exact = np.asarray(rf.friction(DRY, VELOCITY, 1e3, quadrature=QUADRATURE))
    data = FrictionData(VELOCITY, exact, pressure=1e3, relative=0.03)
    free = {"shear.tau_f0": Positive(), "upper.material.young": Positive(), "shear.c": Positive()}
    result = fit(DRY, data, free, quadrature=QUADRATURE, further_time=0.0)
    (direction,) = result.unidentified
    assert direction.text.startswith("shear.tau_f0 * λ, upper.material.young * λ: ")
    assert "contact shear depends only on tau_f0 times the contact area" in direction.text
    assert set(result.withheld) == {"shear.tau_f0", "upper.material.young"}
    assert 0 < result.stderr[2] < 0.01
    # A rubber that is a thousand times softer is in full contact, where another c fits.
    followed = fit(DRY, data, free, quadrature=QUADRATURE)
    assert set(followed.withheld) == {*result.withheld, "shear.c"} and len(followed.bounds) == 2
    every_gap_is_explained(result)


def test_a_number_that_no_data_see_at_all():
    """gamma does not change a modulus: its column is exactly zero."""
    result = fit(SCENE, modulus_data(), BOTH | {"gamma": Bounded(0.1, 1.0)})
    (direction,) = result.unidentified
    assert np.isinf(direction.deviation) and np.isinf(result.uncertainty.condition)
    assert result.uncertainty.rank == 4
    assert direction.text.startswith("gamma up: without any effect")
    assert result.withheld == {"gamma": "not identified, see direction 1"}
    assert result.values[-1] == pytest.approx(0.5, abs=1e-12)  # left where it was
    every_gap_is_explained(result)
    # Unidentified directions are equally wide for every loss.
    robust = fit(SCENE, modulus_data(), BOTH | {"gamma": Bounded(0.1, 1.0)}, loss="soft_l1")
    for one in (result, robust):
        assert one.uncertainty.spread[-1, -1] == pytest.approx(OPEN**2, rel=1e-12)


@pytest.mark.slow
def test_a_bound_does_not_hide_what_trades_with_it():
    """With noise, gamma runs along its trade with h_rms to a bound, where its x hardly counts."""
    free = {"gamma": Bounded(0.1, 1.0), "lower.spectrum.h_rms": Positive()}
    result = fit(SCENE, light(), free, quadrature=QUADRATURE)
    assert "bound" in result.withheld["gamma"]
    assert result.withheld["lower.spectrum.h_rms"] == "not identified, see direction 1"
    (direction,) = result.unidentified
    assert "gamma" in direction.text and "lower.spectrum.h_rms * λ" in direction.text
    every_gap_is_explained(result)
    # The friction itself is known.
    band = result.band(light().velocity, 1e3)
    assert np.all(np.log(band.high / band.low) < 0.3)


@pytest.mark.parametrize(("low", "high", "side"), [(1e6, 2e6, "upper"), (4e6, 9e6, "lower")])
def test_at_a_bound(low, high, side):
    free = {E: Positive(), E_INF: Bounded(low, high, start=0.5 * (low + high))}
    result = fit(SCENE, modulus_data(), free)
    bound = low if side == "lower" else high
    assert result.values[-1] == pytest.approx(bound, rel=1e-3)
    assert result.withheld == {E_INF: f"at its {side} bound {bound:g}"}
    every_gap_is_explained(result)


def test_driven_towards_zero():
    """A slow term that the data have no room for."""
    scene = rf.Scene(ROAD, rf.Body(rf.Prony(3e6, [*MODULI, 1e5], [*TAU, 3e-1])))
    exact = modulus()
    data = ModulusData(OMEGA, exact.real, exact.imag * np.where(OMEGA < 50, 0.97, 1.0), relative=0.02)
    result = fit(scene, data, {E: Positive()})
    assert result.success
    assert result.withheld == {f"{E}[3]": "driven towards zero: the data want it absent"}
    assert result.values[-1] < 0.1
    every_gap_is_explained(result)


# --- profiles


def test_profile_of_a_linear_problem_is_its_linear_interval():
    result = fit(SCENE, linear_data(), {E: Free(), E_INF: Free()})
    low, high = result.interval(0.9)
    profile = result.profile(f"{E}[1]", level=0.9)
    assert (profile.low, profile.high) == (pytest.approx(low[1], rel=1e-3), pytest.approx(high[1], rel=1e-3))
    assert profile.threshold == pytest.approx(stats.norm.ppf(0.95) ** 2, rel=1e-9)
    # A parabola: the rise is the square of the distance in standard errors.
    distance = (profile.values - result.values[1]) / result.stderr[1]
    np.testing.assert_allclose(profile.rise, distance**2, rtol=1e-3, atol=1e-6)
    assert np.all(np.diff(profile.values) > 0)


def test_profile_of_a_nonlinear_problem_differs_as_it_must():
    """E_inf in its logarithm, of a model linear in E_inf: the profile knows that it is symmetric."""
    scene = rf.Scene(ROAD, rf.Body(rf.Prony(3e6, [5e7], [1e-9])))
    data = ModulusData([1e-2, 2e-2], [3e6, 3e6], [1.0, 1.0], [9e5, 9e5], [1e9, 1e9])
    result = fit(scene, data, {E_INF: Positive()})
    sigma = 9e5 / np.sqrt(2)
    assert result.stderr[0] == pytest.approx(sigma, rel=1e-4)
    q = stats.norm.ppf(0.975)
    linear, profile = result.interval(), result.profile(E_INF, points=20)
    assert linear[0][0] == pytest.approx(3e6 * np.exp(-q * sigma / 3e6), rel=1e-4)
    assert profile.low == pytest.approx(3e6 - q * sigma, rel=2e-3)
    assert profile.high == pytest.approx(3e6 + q * sigma, rel=2e-3)
    assert profile.low < linear[0][0] and profile.high < linear[1][0]


def test_profile_of_what_is_not_identified_has_no_end():
    scene = rf.Scene(ROAD, rf.Body(rf.Prony(3e6, [1e8, *MODULI], [1e-14, *TAU])))
    result = fit(scene, modulus_data(noise=0.0), BOTH)
    profile = result.profile(f"{E}[0]", points=4)
    assert profile.low == 0.0
    with pytest.raises(ValueError, match=r"name = 'E': must be one of upper\.material\.E_inf, "):
        result.profile("E")


# --- simulated data


def test_wrong_options_of_a_bootstrap():
    result = fit(SCENE, modulus_data(), BOTH)
    with pytest.raises(ValueError, match="count = 0: must be an integer"):
        result.bootstrap(0)
    with pytest.raises(ValueError, match=r"key = 3: must be a jax\.random\.key"):
        result.bootstrap(4, key=3)


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
    exact = np.asarray(rf.friction(DRY, velocity, 1e5, quadrature=QUADRATURE))
    return FrictionData(velocity, exact, pressure=1e5, relative=0.1)


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


@pytest.mark.parametrize("level", [0.01, 0.5, 0.6827, 0.95, 0.999])
def test_quantiles_are_scipys(level):
    two_sided = 0.5 + 0.5 * level
    assert quantile(level) == pytest.approx(stats.norm.ppf(two_sided), rel=1e-10)
    for freedom in (0.5, 1, 2.5, 10, 37.3, 200, 1e5):
        assert quantile(level, freedom) == pytest.approx(stats.t.ppf(two_sided, freedom), rel=1e-8)


@pytest.mark.parametrize("level", [0.0, 1.0, -0.5, 95, np.nan])
def test_wrong_levels(level):
    with pytest.raises(ValueError, match=r"level = .*: must be between 0 and 1"):
        quantile(level)


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
