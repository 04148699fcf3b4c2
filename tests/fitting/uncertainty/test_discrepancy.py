"""Model error in fits: covariance, amplitude, and coverage of error bars."""

import dataclasses
import math

import numpy as np
import pytest
from support.cases.sliding_curves import drawn_scene, waves
from support.oracles.discrepancy_scan import scanned, squares
from support.scenes.fits import AFFINE, FAST, PLAIN, SCENE, SHIFTED, WARM, friction_data, write_job

import fitting
import rubberfric as rf
from fitting.commands.job import read_job
from fitting.parameters.discrepancy import text_of
from fitting.solvers.evaluation import model_rows
from fitting.uncertainty.covariance import linearised
from fitting.uncertainty.discrepancy import averaged, median_amplitude

LAW = SCENE.replace(contact_model="boundary_elements")
V = np.geomspace(1e-4, 1e1, 30)
FREE = {"upper.material.E": fitting.Positive(), "lower.spectrum.h_rms": fitting.Positive()}
ERROR = 0.02
WIDTH = 1.15  # half a decade, which no parameter of the scene can follow


def data_of(seed, amplitude=0.0, width=WIDTH, scene=SCENE):
    """Friction of a scene with smooth errors and noise."""
    random = np.random.default_rng(seed)
    covariance = np.exp(-0.5 * (np.log(V[:, None] / V) / width) ** 2)
    root = np.linalg.cholesky(covariance + 1e-9 * np.eye(V.size))
    return disturbed(scene, amplitude * root @ random.standard_normal(V.size), random)


def disturbed(scene, delta, random):
    """Friction of a scene times e^delta, and noise."""
    data = friction_data(scene, V, error=0.0, relative=ERROR)
    return data.replaced(data.measured * np.exp(delta + ERROR * random.standard_normal(V.size)))


def fitted(data, discrepancy=None, scene=SCENE, free=FREE):
    return fitting.fit(scene, data, free, quadrature=FAST, discrepancy=discrepancy, further_time=0.0)


@pytest.fixture(scope="module")
def off():
    """A fit of the theory to data that differ from the law by 20 %."""
    return fitted(data_of(1, 0.2, scene=LAW), fitting.Discrepancy(None, WIDTH))


@pytest.mark.slow
@pytest.mark.parametrize("shared", [pytest.param(1.0, marks=pytest.mark.slow), 0.3])
def test_cost_against_the_covariance_itself(shared):
    """Two curves, of absolute and of relative errors, and a modulus, which is measured and so not off."""
    T, mu = np.full(V.size, 303.15), np.asarray(rf.friction(WARM, V, 1e5, 303.15, quadrature=FAST))
    warm = fitting.FrictionData(V, mu * 1.1, sigma=0.03 * mu, pressure=1e5, temperature=T)
    cold = fitting.FrictionData(V[::5], 0.9 * mu[::5], relative=0.05, pressure=2e5, temperature=T[::5] - 15)
    omega = np.geomspace(1, 1e5, 4)
    E = np.asarray(rf.complex_modulus(SHIFTED, omega))
    modulus = fitting.ModulusData(omega, E.real, 1.1 * E.imag, relative=0.1)
    found = fitted([warm, modulus, cold], fitting.Discrepancy(0.3, 1.5, shared), WARM)
    rows, curve = [], []
    model = model_rows(found.problem, found.x)
    for number, (one, where) in enumerate(zip(found.data, found.problem.order, strict=True)):
        at = np.log(one.measured) if one.logarithmic else one.measured
        if one is modulus:
            points = [(0.0, number, 0.0)] * one.measured.size
        else:
            # ln(v a_T), whose curve it is, and how much of a relative error is one of the value.
            shifted = np.log(one.velocity) + np.asarray(SHIFTED.shift.log_factor(one.temperature))
            points = [
                (x, number, 1.0 if one.logarithmic else m) for x, m in zip(shifted, one.measured, strict=True)
            ]
        rows += (model[where] - at).tolist()
        curve += [(*point, e) for point, e in zip(points, one.error, strict=True)]
    n = len(rows)
    covariance = np.diag([e**2 for *_, e in curve])
    for i in range(n):
        for j in range(n):
            (x, a, s, _), (y, b, t, _) = curve[i], curve[j]
            if s and t:
                share = 1.0 if a == b else shared
                covariance[i, j] += share * 0.3**2 * s * t / (1 + 0.5 * ((x - y) / 1.5) ** 2)
    exact = 0.5 * np.array(rows) @ np.linalg.solve(covariance, rows)
    np.testing.assert_allclose(found.cost, exact, rtol=1e-8)
    np.testing.assert_allclose(found.chisqr, 2 * exact, rtol=1e-8)


@pytest.mark.slow
def test_no_amplitude_is_no_discrepancy():
    data = data_of(0)
    none, zero = fitted(data), fitted(data, fitting.Discrepancy(0.0))
    np.testing.assert_array_equal(none.x, zero.x)
    assert none.discrepancy is None and zero.problem.numbers.whitening is None


def test_bars_and_verdict_follow(off):
    """Left out, the error bars are too small, and the verdict is "does not explain the data"."""
    without = fitted(off.data[0])
    assert without.verdict.explains is False and off.verdict.explains is True
    assert 0.08 < off.discrepancy.remainder < 0.5 and off.discrepancy.estimated
    known = np.isfinite(off.stderr)  # the others have no error bar
    assert known.sum() >= 2 and (off.stderr > 5 * without.stderr)[known].all()
    truth = np.array([*PLAIN.E, AFFINE.h_rms])
    low, high = off.interval(0.99)
    assert ((low < truth) & (truth < high))[known].all()
    amplitude, level = 100 * off.discrepancy.remainder, 100 * off.discrepancy.level
    assert f"an error of mu is allowed for, by {level:.3g} %, the difference to the law" in off.report()
    assert f", and by {amplitude:.3g} % (estimated from the data" in off.report()


def wavy_data(seed):
    """Friction with errors of amplitude 0.2 that bend within a decade, and noise."""
    random = np.random.default_rng(seed)
    return disturbed(SCENE, 0.2 * waves(random, np.log(V), 1.0, 1.6), random)


@pytest.mark.parametrize("known", [True, False])
def test_amplitudes_against_a_scan_of_the_likelihood(off, known):
    law = np.array(off.discrepancy.law) if known else np.zeros(V.size)
    model = linearised(off.problem, off.x)
    distance = np.log(V[:, None] / V) / WIDTH
    found = averaged(off.problem, model, [SCENE], off.data, fitting.Discrepancy(None, WIDTH), law)
    exact = squares(*scanned(off, [1 / (1 + 0.5 * distance**2)], law, ERROR))
    np.testing.assert_allclose(found.remainder, math.sqrt(exact[0]), rtol=0.03)
    np.testing.assert_allclose(found.amplitude, math.hypot(math.sqrt(exact[0]), found.level), rtol=0.03)
    assert found.width == pytest.approx(WIDTH) and found.parts == () and found.remark == ""
    found = averaged(off.problem, model, [SCENE], off.data, fitting.Discrepancy(), law)
    widths = math.log(10) * np.array([0.1, 0.2, 0.4, 0.8, 1.6])
    kernels = [np.exp(-0.5 * (np.log(V[:, None] / V) / w) ** 2) for w in widths]
    exact = squares(*scanned(off, kernels, law, ERROR))
    amplitudes, used = np.array(found.parts).T
    np.testing.assert_allclose(used, widths)
    np.testing.assert_allclose(found.remainder, math.sqrt(exact.sum()), rtol=0.03)
    np.testing.assert_allclose(amplitudes, np.sqrt(exact), rtol=0.03, atol=0.005)


def test_no_design_promises_errors_without_the_discrepancy(off):
    with pytest.raises(ValueError, match="source: the fit has a Discrepancy: must have none"):
        fitting.design(off, candidates=(V, 1e5), n=1)


def test_true_theories_are_not_off():
    found = fitted(data_of(2), fitting.Discrepancy(None, math.log(10)))
    assert found.discrepancy.remainder < 0.03


def test_the_amplitude_includes_the_difference_to_the_law(off):
    """d = ln(law / theory) of the fitted scene; whitened rows have the covariance 1 + (kernel + d d^T)."""
    law = dataclasses.replace(off.scene, contact_model="boundary_elements")
    known = np.log(np.asarray(rf.friction(law, V, 1e5) / rf.friction(off.scene, V, 1e5)))
    # The estimate is of the fit before the last one.
    np.testing.assert_allclose(off.discrepancy.law, known, atol=0.05)
    found = off.discrepancy
    np.testing.assert_allclose(found.amplitude**2, found.remainder**2 + np.mean(np.square(found.law)))
    distance = np.log(V[:, None] / V) / WIDTH
    unit = 1 / (1 + 0.5 * distance**2)
    covariance = np.eye(V.size) + (found.remainder**2 * unit + np.outer(found.law, found.law)) / ERROR**2
    whitening = np.asarray(off.problem.numbers.whitening)
    np.testing.assert_allclose(whitening @ covariance @ whitening.T, np.eye(V.size), atol=1e-9)


def test_scenes_without_the_law_have_a_smallest_amplitude(off):
    """Without a comparison the prior is not flat, so that a perfect fit does not remove the error."""
    problem, model = off.problem, linearised(off.problem, off.x)
    exact = dataclasses.replace(off.data[0], friction=np.exp(model_rows(problem, off.x)))
    targets = problem.targets._replace(measured=np.log(exact.friction))
    found = averaged(problem._replace(targets=targets), model, [SCENE], [exact], fitting.Discrepancy())
    assert found.amplitude > 0.2


@pytest.mark.slow
def test_width_is_estimated(tmp_path):
    """A width of a decade needs an amplitude of 0.8 for these data."""
    data = wavy_data(2)
    found, fixed = fitted(data, fitting.Discrepancy()), fitted(data, fitting.Discrepancy(None, math.log(10)))
    assert 0.1 < found.discrepancy.remainder < 0.3 and found.discrepancy.width < 0.6 * math.log(10)
    assert found.discrepancy.remark == "" and len(found.discrepancy.parts) == 5
    assert fixed.discrepancy.remainder > 0.7 and fixed.discrepancy.width == pytest.approx(math.log(10))
    assert "implausibly large" in fixed.discrepancy.remark and fixed.discrepancy.remark in fixed.report()
    found.save(tmp_path / "fit.h5")
    again = fitting.FitResult.load(tmp_path / "fit.h5")
    assert again.discrepancy == found.discrepancy
    np.testing.assert_array_equal(again.residuals[0], found.residuals[0])


def test_given_numbers_are_kept_and_judged():
    data = wavy_data(3)
    found = fitted(data, fitting.Discrepancy(0.1, 3 * math.log(10)))
    assert (found.discrepancy.amplitude, found.discrepancy.width) == (0.1, 3 * math.log(10))
    assert not found.discrepancy.estimated and "times as likely" in found.report()
    found = fitted(data, fitting.Discrepancy(0.2))
    assert found.discrepancy.amplitude == pytest.approx(0.2) and not found.discrepancy.estimated
    assert found.discrepancy.width < 0.6 * math.log(10)


def test_the_prior_depends_on_the_contact_model(off):
    """The law is closer to boundary elements than the paper, and extrapolated beyond q1/q0 = 512."""
    law = SCENE.replace(contact_model="boundary_elements")
    q1 = float(law.lower.spectrum.q1)
    near, far = (law.replace("lower.spectrum.q0", q1 / ratio) for ratio in (512, 51200))
    assert median_amplitude([SCENE]) == pytest.approx(0.5)
    assert median_amplitude([near]) == pytest.approx(0.1)
    assert median_amplitude([far]) == pytest.approx(0.3)
    assert median_amplitude([near, far, near]) == median_amplitude([far])
    model = linearised(off.problem, off.x)
    amplitudes = [
        averaged(off.problem, model, [scene], off.data, fitting.Discrepancy()).amplitude
        for scene in (SCENE, near)
    ]
    assert amplitudes[1] < 0.95 * amplitudes[0]


def test_errors_like_noise_are_reported():
    data = friction_data(SCENE, V, error=0.2, seed=5, relative=ERROR)
    found = fitted(data, fitting.Discrepancy())
    assert "shortest tried, 0.1 decades" in found.report()


def test_bootstrap_draws_it(off):
    """Drawn data scatter as the covariance says: far more than the noise, and smoothly."""
    _, targets = off.bootstrap_fits(400, None)
    drawn = np.asarray(targets.measured) - model_rows(off.problem, off.x)
    whole = np.sqrt(ERROR**2 + off.discrepancy.remainder**2 + np.square(off.discrepancy.law))
    np.testing.assert_allclose(drawn.std(0), whole, rtol=0.2)
    assert np.corrcoef(drawn[:, 10], drawn[:, 11])[0, 1] > 0.8


def test_job_file(tmp_path):
    path = write_job(tmp_path)
    path.write_text(path.read_text() + "[discrepancy]\namplitude = 0.25\nshared = 0.5\n")
    assert read_job(path).options["discrepancy"] == fitting.Discrepancy(0.25, shared=0.5)
    path.write_text(path.read_text().replace("amplitude = 0.25", 'amplitude = "estimated"'))
    assert read_job(path).options["discrepancy"] == fitting.Discrepancy(None, shared=0.5)
    path.write_text(path.read_text().replace('amplitude = "estimated"', "amplitude = -1"))
    with pytest.raises(ValueError, match=r"job.toml: discrepancy: Discrepancy: amplitude = -1.* must be"):
        read_job(path)


def test_refusals():
    data = data_of(0)
    bare = fitting.FrictionData(V, data.friction, pressure=1e5)
    modulus = fitting.ModulusData([1.0, 10.0], [1e6, 2e6], [1e5, 2e5], relative=0.1)
    still = fitting.FrictionData([0.0, 1.0], [0.1, 0.2], sigma=0.1, pressure=1e5)
    own = fitting.Discrepancy(0.2)
    for wrong, words, options in (
        (bare, "have no errors: must have", {}),
        (modulus, "there are no friction data", {}),
        (still, "have a velocity 0", {}),
        (data, "not possible with loss = 'huber'", {"loss": "huber"}),
        (data, "not possible with scale_errors = True", {"scale_errors": True}),
        (data, "discrepancy is a float: must be", {"discrepancy": 0.2}),
    ):
        with pytest.raises(ValueError, match=words):
            fitting.fit(
                SCENE, wrong, {"upper.material.E_inf": fitting.Positive()}, **{"discrepancy": own} | options
            )
    for wrong in (
        {"amplitude": -1.0},
        {"width": 0.0},
        {"shared": 1.5},
        {"estimated": 1},
        {"parts": ((1.0,),)},
    ):
        with pytest.raises(ValueError, match="Discrepancy: "):
            fitting.Discrepancy(**wrong)


def test_text():
    """Curves share 60 % of the model error unless stated otherwise."""
    text = text_of(fitting.Discrepancy(0.25, 2 * math.log(10)))
    assert "by 25 % (as given), smooth over 2 decades" in text and text.endswith("share 60 % of it")
    for unknown in (fitting.Discrepancy(None, 1.0), fitting.Discrepancy(0.1, None)):
        assert "its size was not estimated" in text_of(unknown)


@pytest.mark.slow
def test_minima_of_the_first_guess_withhold_no_error_bars():
    """With the estimated discrepancy the minimum moves. The old one is not a second minimum of the new cost.

    The friction is that of boundary elements (`support.cases.sliding_curves`, scene 20) with contact shear.
    """
    scene, _, pressures = drawn_scene(20)
    v = [1.6203e-05, 5.3447e-05, 1.7630e-04, 5.8155e-04, 1.9183e-03, 6.3277e-03, 2.0872e-02]
    mu = [
        [0.1595, 0.2493, 0.3485, 0.3804, 0.3559, 0.3432, 0.2731],
        [0.1445, 0.2267, 0.3149, 0.3849, 0.3901, 0.3472, 0.3356],
    ]
    sheared = scene.replace(area_correction=False, shear=rf.ContactShear(1.728e5, 0.1, 5.8e-4))
    data = [fitting.FrictionData(v, mu[k], pressure=pressures[k], relative=0.03) for k in (0, 1)]
    free = {"lower.spectrum.h_rms": fitting.Positive(), "shear.tau_f0": fitting.Positive()}
    fit = fitting.fit(sheared, data, free, quadrature=FAST, discrepancy=fitting.Discrepancy())
    assert fit.success and fit.withheld == {}
    low, high = fit.interval()
    assert np.all(low < [1.735e-5, 1.728e5]) and np.all(high > [1.735e-5, 1.728e5])
