"""Prony series from moduli: recovery of known series, SciPy's minimum, absent terms, refusals."""

import dataclasses

import numpy as np
import pytest
import scipy.optimize
from support.html_tables import cells
from support.scenes import fits

import rubberfric as rf
from fitting import FrictionData, ModulusData, PronyFit, fit_prony

TAU = np.geomspace(1e-6, 1.0, 7)
TRUTH = rf.Prony(2e6, np.array([9e8, 2e8, 5e7, 8e6, 3e6, 2e6, 1e6]), TAU, 0.49)
OMEGA = np.geomspace(1.0, 1e6, 40)


def modulus_data(material, omega=OMEGA, noise=0.0, seed=0, **options):
    """Data of a material, whose noise the data do not state."""
    return fits.modulus_data(material, omega, noise, seed, relative=None, **options)


def assert_same(material, expected, rtol=1e-6):
    order = np.argsort(material.tau)
    np.testing.assert_allclose(material.tau[order], expected.tau, rtol=1e-12)
    np.testing.assert_allclose(material.E[order], expected.E, rtol=rtol)
    np.testing.assert_allclose(material.E_inf, expected.E_inf, rtol=rtol)


@pytest.fixture(scope="module")
def noisy():
    return fit_prony(modulus_data(TRUTH, noise=0.04, name="sample A"), poisson=0.49)


def test_known_series_is_found_on_its_own_times():
    found = fit_prony(modulus_data(TRUTH), poisson=0.49)
    assert isinstance(found, PronyFit) and found.success
    assert_same(found.material, TRUTH)
    assert float(found.material.poisson) == 0.49
    assert found.dropped.size == 0
    assert found.rms_storage < 1e-8 and found.rms_loss < 1e-8


def test_any_order_of_times_and_frequencies():
    shuffled = np.random.default_rng(1).permutation(40)
    found = fit_prony(modulus_data(TRUTH, OMEGA[shuffled], body="upper"), tau=TAU[::-1])
    assert_same(found.material, TRUTH)
    np.testing.assert_allclose(found.material.tau, TAU[::-1])
    assert found.names[0] == "upper.material.E[0]"


@pytest.mark.parametrize("term", [3, 4])  # exactly zero, and 1e-15 of the others by rounding
def test_absent_term_is_dropped(term):
    gone = dataclasses.replace(TRUTH, E=TRUTH.E.at[term].set(0.0))
    found = fit_prony(modulus_data(gone))
    np.testing.assert_allclose(found.dropped, TAU[[term]])
    left = np.arange(7) != term
    assert_same(found.material, rf.Prony(2e6, gone.E[left], TAU[left]))
    assert f"absent, because E = 0 in the best fit: tau = {TAU[term]:.3g} s" in found.report()


def test_liquid_is_found_and_said():
    liquid = dataclasses.replace(TRUTH, E_inf=0.0)
    found = fit_prony(modulus_data(liquid))
    assert_same(found.material, liquid)
    assert found.dropped.tolist() == [np.inf]
    assert "without E_inf the material is a liquid" in found.report()


@pytest.mark.parametrize("E_inf", [0.0, 2e6])
def test_relaxed_modulus_held(E_inf):
    truth = dataclasses.replace(TRUTH, E_inf=E_inf)
    found = fit_prony(modulus_data(truth), E_inf=E_inf)
    assert_same(found.material, truth)
    assert found.dropped.size == 0 and len(found.names) == 7
    assert "(fixed)" in found.report()


def test_raw_curves_are_superposed_by_their_shift():
    shift = rf.WLF(8.0, 110.0, 293.15)
    shifted = dataclasses.replace(TRUTH, shift=shift)
    omega, T = (x.ravel() for x in np.meshgrid(np.geomspace(1.0, 1e3, 8), [263.15, 283.15, 293.15, 318.15]))
    reduced = omega * np.exp(np.asarray(shift.log_factor(T)))
    data = modulus_data(shifted, omega, temperature=T)
    found = fit_prony(data, tau=TAU, shift=shift)
    assert_same(found.material, TRUTH)
    assert float(found.material.shift.C2) == 110.0
    default = fit_prony(data, shift=shift)
    times = np.sort(np.append(default.material.tau, default.dropped))
    np.testing.assert_allclose(times[[0, -1]], [1 / reduced.max(), 1 / reduced.min()])
    spacing = np.diff(np.log10(times))
    assert spacing.min() > 0.5 and spacing.max() <= 1.0


def test_error_bars_of_noisy_data(noisy):
    assert noisy.success and not noisy.withheld
    truth = np.append(TRUTH.E, TRUTH.E_inf)
    pull = (noisy.values - truth) / noisy.stderr
    assert np.abs(pull).max() < 4 and 0.3 < np.sqrt(np.mean(pull**2)) < 2
    assert noisy.estimated == pytest.approx(0.04, rel=0.25)
    assert noisy.rms_storage == pytest.approx(0.04, rel=0.3)
    assert noisy.rms_loss == pytest.approx(0.04, rel=0.3)


def test_residuals_are_those_of_the_material(noisy):
    data, modulus = noisy.data, np.asarray(rf.complex_modulus(noisy.material, OMEGA))
    np.testing.assert_allclose(noisy.residuals[0], np.log(modulus.real / data.storage), rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(noisy.residuals[1], np.log(modulus.imag / data.loss), rtol=1e-9, atol=1e-13)


def test_report(noisy):
    lines = noisy.report().splitlines()
    assert lines[0] == "Prony series of sample A: 7 terms, tau = 1e-06 ... 1 s"
    assert f"E' {noisy.rms_storage:.2%}, E'' {noisy.rms_loss:.2%}" in lines[2]
    assert len(lines) == 4 + 8
    value, error = noisy.values[2], noisy.stderr[2]
    assert lines[7].split() == ["0.0001", f"{value:.4g}", "+/-", f"{error:.2g}", f"({error / value:.1%})"]
    assert repr(noisy).startswith("<PronyFit: 7 terms")
    headings, relaxed, *terms, rms = cells(noisy)
    assert headings == ["tau [s]", "E [Pa]", "error [Pa]"] and relaxed[0] == "inf" and len(terms) == 7
    assert terms[2] == ["0.0001", f"{value:.4g}", f"+/- {error:.2g} ({error / value:.1%})"]
    assert rms == [lines[2].strip()]


def test_absolute_errors_weight_the_points():
    data = modulus_data(TRUTH, noise=0.03)
    spoiled = data.measured.copy()
    spoiled[[5, 60]] *= 3.0
    error = 0.03 * data.measured
    error[[5, 60]] *= 1e4
    sigma = {"sigma_storage": error[:40], "sigma_loss": error[40:]}
    found = fit_prony(ModulusData(OMEGA, spoiled[:40], spoiled[40:], **sigma))
    assert found.success
    pull = (found.values - np.append(TRUTH.E, TRUTH.E_inf)) / found.stderr
    assert np.abs(pull).max() < 4
    # The start has the same weights: it says which terms are absent.
    gone = dataclasses.replace(TRUTH, E=TRUTH.E.at[3].set(0.0))
    clean = np.where(error > data.measured, 3.0, 1.0) * modulus_data(gone).measured
    start = fit_prony(ModulusData(OMEGA, clean[:40], clean[40:], **sigma))
    assert start.dropped.size == 0 or start.dropped == pytest.approx([TAU[3]])
    E = np.interp(np.log(TAU), np.log(start.material.tau), start.material.E) * ~np.isin(TAU, start.dropped)
    assert E[3] < 1e-6 * E[4] and float(start.material.E_inf) == pytest.approx(2e6, rel=1e-4)
    # Noise may take a loss below zero, where it has no logarithm.
    spoiled[60] = -1.0
    low = fit_prony(ModulusData(OMEGA, spoiled[:40], spoiled[40:], **sigma, check_units=False))
    assert np.isnan(low.residuals[1, 20]) and np.isfinite(low.rms_loss)


def test_equal_to_scipys_bounded_solver():
    """Absolute errors make it a linear problem, here with terms that end at 0."""
    data = modulus_data(TRUTH, noise=0.1, seed=3)
    sigma = {"sigma_storage": 0.1 * data.storage, "sigma_loss": 0.1 * data.loss}
    found = fit_prony(ModulusData(OMEGA, data.storage, data.loss, **sigma), 2.5)
    tau = np.geomspace(1e-6, 1.0, 16)
    A, b = fits.maxwell_columns(OMEGA, tau) / (0.1 * data.measured)[:, None], np.full(80, 10.0)
    size = np.linalg.norm(A, axis=0)
    theirs = scipy.optimize.lsq_linear(A / size, b, (0, np.inf), method="bvls", tol=1e-15).x / size
    theirs[theirs < 1e-12 * theirs.max()] = 0.0
    assert found.dropped.size > 2
    np.testing.assert_allclose(np.sort(found.dropped), tau[theirs[:-1] == 0])
    np.testing.assert_allclose(found.values, theirs[theirs > 0], rtol=1e-8)


def test_errors_are_those_of_the_general_fit(noisy):
    general = noisy.fit
    assert general.success and general.names == noisy.names and noisy.fit is general
    np.testing.assert_allclose(noisy.values, general.values, rtol=1e-6)
    np.testing.assert_allclose(noisy.stderr, general.stderr, rtol=1e-6)
    np.testing.assert_allclose(noisy.covariance, general.covariance, rtol=1e-5, atol=1e-6 * 1e12)
    np.testing.assert_allclose(noisy.correlation, general.correlation, atol=1e-6)
    assert noisy.estimated == pytest.approx(general.estimated[0], rel=1e-6)
    assert noisy.freedom == pytest.approx(general.freedom, rel=1e-9)


@pytest.mark.slow
def test_smooth_minimum_is_that_of_the_general_fit():
    gap = (OMEGA < 1e2) | (OMEGA > 2e4)
    found = fit_prony(modulus_data(TRUTH, OMEGA[gap], noise=0.05), 2.0, smooth=1.0)
    np.testing.assert_allclose(found.values, found.fit.values, rtol=1e-5)
    np.testing.assert_allclose(found.stderr, found.fit.stderr, rtol=1e-5)


def test_undetermined_term_has_no_error_bar():
    """The loss alone knows nothing of E_inf; of E' alone it is known."""
    data = modulus_data(TRUTH, noise=0.02)
    both, loss = fit_prony(data), fit_prony(data, weights=(1e-6, 1.0))
    assert not both.withheld and list(loss.withheld) == ["lower.material.E_inf"]
    assert "not identified" in loss.report() and "E_inf" in loss.unidentified[0].text
    assert np.isnan(loss.stderr[-1]) and np.isfinite(loss.stderr[:-1]).all()


def test_weights_of_storage_and_loss():
    data = modulus_data(TRUTH, noise=0.01)
    spoiled = ModulusData(OMEGA, data.storage, 1.5 * data.loss)
    both, alone = fit_prony(spoiled), fit_prony(spoiled, weights=(1, 0))
    clean = fit_prony(data, weights=(1, 0))
    np.testing.assert_allclose(alone.values, clean.values, rtol=1e-12)
    assert both.rms_storage > 3 * alone.rms_storage and alone.rms_loss == pytest.approx(np.log(1.5), rel=0.2)
    assert "weights: E' 1, E'' 0" in alone.report()
    twice = fit_prony(spoiled, weights=(2, 2))
    # The two iterations end 1e-9 apart.
    np.testing.assert_allclose(twice.stderr, both.stderr, rtol=1e-7)
    nearly = fit_prony(spoiled, weights=(1, 1e-9))
    np.testing.assert_allclose(nearly.values, alone.values, rtol=0.05)
    with pytest.raises(ValueError, match=r"must be equal for `\.fit`"):
        _ = alone.fit


def test_strength_of_smoothing_is_found():
    """The one chosen comes nearer to a smooth spectrum than much weaker and much stronger ones."""
    times = np.geomspace(1e-9, 1e3, 61)  # five a decade
    smooth_one = rf.Prony(2e6, 1e8 * np.exp(-0.5 * (np.log10(times) + 4.0) ** 2) + 1e5, times)
    away = dict.fromkeys((0.03, "auto", 30.0), 0.0)
    for seed in range(3):
        data = modulus_data(smooth_one, np.geomspace(1e-1, 1e7, 50), noise=0.1, seed=seed)
        for smooth in away:
            found = fit_prony(data, 3.0, smooth=smooth)
            tau, E = (np.asarray(x)[2:-2] for x in (found.material.tau, found.material.E))
            true = np.interp(np.log(tau), np.log(times), smooth_one.E) * 5 / 3
            away[smooth] += np.sqrt(np.mean(np.log(E / true) ** 2)) / 3
            if smooth == "auto":
                assert found.success and 0.1 < found.smooth < 10 and "smooth: slopes" in found.report()
    assert away["auto"] < 0.7 * min(away[0.03], away[30.0])


def test_picture(noisy):
    upper, lower = noisy.plot()
    assert upper.get_xscale() == upper.get_yscale() == "log"
    lines = {line.get_label(): line for line in upper.lines}
    np.testing.assert_allclose(lines["storage $E'$, measured"].get_ydata(), noisy.data.storage)
    np.testing.assert_allclose(lines["terms $E_i$ at $1/\\tau_i$"].get_ydata(), noisy.values[:-1], rtol=1e-12)
    np.testing.assert_allclose(lower.lines[1].get_ydata(), noisy.residuals[1])
    upper.figure.canvas.draw()
    with pytest.raises(ValueError, match=r"must have 2 .moduli, residuals"):
        noisy.plot(upper)


def test_smooth_series_has_no_gaps():
    gap = (OMEGA < 1e2) | (OMEGA > 2e4)
    found = fit_prony(modulus_data(TRUTH, OMEGA[gap], noise=0.05), 2.0, smooth=1.0)
    E = np.asarray(found.material.E)
    assert found.success and E.size == 13 and found.dropped.size == 0
    slopes = np.diff(np.log(E)) * 2
    assert np.abs(np.diff(slopes)).max() < 3.0
    modulus, true = (np.asarray(rf.complex_modulus(m, OMEGA)) for m in (found.material, TRUTH))
    assert np.abs(np.log(modulus.real / true.real)).max() < 0.3


GOOD = modulus_data(TRUTH)
FEW = modulus_data(TRUTH, OMEGA[::13])
WARM = modulus_data(
    dataclasses.replace(TRUTH, shift=rf.WLF(8.0, 110.0, 293.15)), temperature=np.full(40, 300.0)
)
APART = ModulusData(
    np.geomspace(1.0, 10.0, 8).repeat(2), np.full(16, 2e6), np.full(16, 2e5), temperature=[250.0, 330.0] * 8
)


@pytest.mark.parametrize(
    ("data", "options", "said"),
    [
        (FrictionData(1.0, 0.5, pressure=1e5), {}, "data is a FrictionData: must be ModulusData"),
        (WARM, {}, "no shift is given; give shift = WLF"),
        (WARM, {"shift": 3.0}, "Prony.shift = 3.0"),
        (WARM, {"shift": rf.WLF(8.0, 10.0, 330.0)}, "pole of the WLF law"),
        (APART, {"shift": rf.WLF(8.0, 110.0, 293.15)}, "no values between the reduced frequencies"),
        (modulus_data(TRUTH, OMEGA[[*range(9), *range(32, 40)]]), {}, "curves must overlap or .* smooth"),
        (FEW, {"per_decade": 3.0}, "8 values for 20 unknowns: must have at least as many"),
        (GOOD, {"per_decade": 0.0}, "per_decade = 0.0: must be a number > 0"),
        (GOOD, {"tau": [1e-3, 1e-3]}, "all must be different"),
        (GOOD, {"tau": [1e-3, 0.0]}, r"tau\[1\] = 0.0: must be > 0"),
        (GOOD, {"tau": []}, "tau is empty"),
        (GOOD, {"tau": "short"}, "tau = 'short': must be a sequence of numbers"),
        (GOOD, {"tau": [1e-3, 1e-9]}, r"tau\[1\] = 1e-09 s: .* 1e-06 \.\.\. 1 s"),
        (GOOD, {"E_inf": -1.0}, "E_inf = -1.0: must be 'fit' or a number >= 0"),
        (GOOD, {"poisson": 0.6}, "poisson = 0.6"),
        (GOOD, {"weights": (1, -1)}, r"weights = \(1, -1\): must be two numbers >= 0"),
        (GOOD, {"weights": (0, 0)}, "not both 0"),
        (GOOD, {"smooth": "much"}, "smooth = 'much': must be None"),
        (GOOD, {"smooth": 1.0, "tau": [1e-3, 1e-2]}, "at least three different relaxation times"),
        (
            ModulusData([1.0, 2.0], [2e6, 2e6], [-1.0, -1.0], [1.0, 1.0], [1.0, 1.0], check_units=False),
            {},
            "the fit has no relaxing term",
        ),
    ],
)
def test_bad_input(data, options, said):
    with pytest.raises(ValueError, match=said) as caught:
        fit_prony(data, **options)
    assert "\n" not in str(caught.value)
