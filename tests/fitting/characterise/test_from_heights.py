"""Fits to spectra of measured heights: which wavevectors are used, on surfaces with a known spectrum."""

import numpy as np
import pytest
from scipy.integrate import quad

import fitting
import rubberfric as rf
from fitting.characterise.broken_line import rolloff_for_height
from fitting.data.heights import resolved_ends

# A side of the map [m], and the spectrum of its modes.
LENGTH, POINTS = 1e-3, 256
Q0 = 2 * np.pi / LENGTH
TRUTH = {"q0": 2 * Q0, "qr": 8 * Q0, "q1": 200 * Q0, "hurst": 0.8, "h_rms": 1e-6}


def modes_of_the_map():
    k = np.fft.fftfreq(POINTS, 1 / POINTS) * Q0
    return np.hypot(k[:, None], k)


def surface(seed=0):
    """A periodic Gaussian surface with the spectrum TRUTH, by a sum over its modes."""
    q = modes_of_the_map()
    C = np.where((q >= TRUTH["q0"]) & (q <= TRUTH["q1"]), np.maximum(q / TRUTH["qr"], 1.0) ** -3.6, 0.0)
    noise = np.fft.fft2(np.random.default_rng(seed).standard_normal((POINTS, POINTS))) / POINTS
    return np.fft.ifft2(noise * np.sqrt(C / C.sum())).real * POINTS**2 * TRUTH["h_rms"]


def log_C(q):
    """ln C of the surfaces."""
    modes = modes_of_the_map()
    modes = modes[(modes >= TRUTH["q0"]) & (modes <= TRUTH["q1"])]
    shape = TRUTH["h_rms"] ** 2 / (Q0**2 * np.sum(np.maximum(modes / TRUTH["qr"], 1.0) ** -3.6))
    return np.log(shape * np.maximum(q / TRUTH["qr"], 1.0) ** -3.6)


def of_map(seed=0):
    return rf.roughness.spectrum_of_topography(surface(seed), LENGTH / POINTS, per_decade=10)


def test_a_map_becomes_a_scene():
    measured = of_map()
    fit = fitting.fit_spectrum(measured, q0=TRUTH["q0"])
    assert float(fit.spectrum.q1) == measured.q[-1]
    assert fit.rms_height == measured.rms_height == pytest.approx(surface().std(), rel=1e-3)
    assert float(fit.spectrum.h_rms) == pytest.approx(1e-6, rel=0.15)
    assert float(fit.spectrum.hurst) == pytest.approx(0.8, abs=0.05)
    assert float(fit.spectrum.qr) == pytest.approx(8 * Q0, rel=0.2)
    used, (data,) = measured.q >= TRUTH["q0"], fit.fit.data
    np.testing.assert_array_equal(data.q, measured.q[used])
    every = fitting.spectrum_data(measured)
    np.testing.assert_array_equal((data.C, data.relative), (every.C[used], every.relative[used]))
    scene = rf.Scene(rf.Body(rf.Rigid(), rf.with_cutoff(fit.spectrum, 0.05)), rf.Body(rf.Elastic(1e7, 0.5)))
    assert float(rf.rms_slope(scene.lower.spectrum)) == pytest.approx(0.05, rel=1e-9)


def test_logarithms_of_bins_of_maps_are_right_on_average():
    """Bins of few modes have a small mean of ln C, and means of a falling C are above C."""
    data = [fitting.spectrum_data(of_map(seed)) for seed in range(120)]
    q = data[0].q
    # Away from the ends and the roll-off, about which a window spreads the modes.
    away = (q > 3 * Q0) & (q < 100 * Q0) & (np.abs(np.log(q / TRUTH["qr"])) > 0.4)
    change = np.log([x.C for x in data]) - log_C(q)
    error = np.std(change, 0) / np.sqrt(len(data))
    assert away.sum() >= 10
    assert np.all(np.abs(np.mean(change, 0))[away] < 3 * error[away] + 2e-3)
    plateau = (q > 2.5 * Q0) & (q < 7.5 * Q0)
    assert abs(np.mean(change, 0)[plateau].sum()) < 3 * np.sqrt(np.sum(error[plateau] ** 2))
    # The errors contain the correlation with neighbouring bins, so they are not below the scatter.
    assert np.all(np.std(change, 0)[away] < 1.3 * data[0].relative[away])


@pytest.mark.parametrize("width", [16, 32])
def test_bins_of_narrow_maps_are_right_on_average(width):
    """A window spreads long waves along the map over modes across it. ln C was up to 0.39 too small."""
    strips = [surface(seed)[:, width * k :][:, :width] for seed in range(40) for k in range(0, 8, 2)]
    found = [rf.roughness.spectrum_of_topography(z, LENGTH / POINTS) for z in strips]
    q = found[0].q
    change = np.log([x.unbiased for x in found]) - log_C(q)
    for low, high, limit in ((2.5, 8, 0.1), (8, 30, 0.03), (30, 100, 0.03)):
        within = (q > low * Q0) & (q < high * Q0)
        assert abs(np.mean(change[:, within])) < limit


def of_profiles(seed):
    lines = np.array([surface(1000 + 12 * seed + k)[:200, 0] for k in range(12)])
    return rf.roughness.spectrum_of_profile(LENGTH / POINTS, lines, per_decade=10)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("measure", "largest"),
    # The bars of few short profiles are somewhat too small, as the docstring of `fit_spectrum` states.
    [(of_map, (1.3, 1.2, 1.2)), (of_profiles, (1.5, 1.5, 2.0))],
    ids=["maps", "profiles"],
)
def test_bars_hold_the_truth(measure, largest):
    """Deviations from the truth of 60 surfaces in standard errors."""
    names, ratios = ("h_rms", "hurst", "qr"), []
    for seed in range(60):
        fit = fitting.fit_spectrum(measure(seed), q0=TRUTH["q0"])
        away = [float(getattr(fit.spectrum, name)) - TRUTH[name] for name in names]
        ratios += [np.array(away) / [fit.stderr.get(name, np.nan) for name in names]]
    assert np.isnan(ratios).sum(0).max() < 15
    rms = np.sqrt(np.nanmean(np.square(ratios), 0))
    assert np.all((rms > 0.8) & (rms < largest)), rms


def profiles():
    lines = surface(1)[:, ::8].T[:, :200]
    return rf.roughness.spectrum_of_profile(LENGTH / POINTS, lines, per_decade=10)


def test_profiles_become_an_isotropic_surface():
    """The first bin and bins without information are left out, and q0 is the first wavevector."""
    measured = profiles()
    data = fitting.spectrum_data(measured)
    areal = measured.areal()
    assert set(data.q) <= set(measured.q[1:]) and data.relative.max() < 2
    own = np.interp(np.log(data.q), np.log(areal.q), areal.relative)
    assert own.max() < 1 and np.all(data.relative >= own) and np.any(data.relative > 1.2 * own)
    np.testing.assert_allclose(data.C, np.exp(np.interp(np.log(data.q), np.log(areal.q), np.log(areal.C))))

    class Precise(rf.roughness.MeasuredSpectrum):
        """The same profiles, as if all errors were 10 %."""

        def areal(self):
            return areal._replace(covariance=0.01 * np.eye(areal.q.size))

    np.testing.assert_array_equal(fitting.spectrum_data(Precise(*measured)).q, measured.q[1:])
    whole = fitting.spectrum_data(rf.roughness.ArealSpectrum(areal.q, areal.C, areal.covariance))
    assert set(whole.q) >= set(data.q)
    assert resolved_ends(measured) == (measured.q[0], measured.q[-1])
    assert resolved_ends(areal) == (areal.q[0], None)


@pytest.mark.slow
def test_fits_to_profiles():
    measured = profiles()
    areal, fit = measured.areal(), fitting.fit_spectrum(measured)
    assert float(fit.spectrum.q0) == measured.q[0]
    assert float(fit.spectrum.hurst) == pytest.approx(0.8, abs=0.12)
    assert float(fit.spectrum.h_rms) == pytest.approx(1e-6, rel=0.15)
    again = fitting.fit_spectrum(areal, q0=float(measured.q[0]), q1=float(fit.spectrum.q1))
    assert float(again.spectrum.hurst) == pytest.approx(float(fit.spectrum.hurst), abs=0.05)


@pytest.mark.parametrize("qr", [150.0, 1e3, 2e4])
def test_rolloff_of_a_known_height(qr):
    """The height is integrated by adaptive quadrature."""
    q0, q1, slope = 100.0, 1e5, 3.6
    flat = quad(lambda q: 2e-9 * qr**-slope * q, q0, qr, epsabs=0)[0]
    fall = quad(lambda t: 2e-9 * np.exp((2 - slope) * t), np.log(qr), np.log(q1), epsabs=0)[0]
    height = np.sqrt(2 * np.pi * (flat + fall))
    level = np.log(2e-9) - slope * np.log(q0)
    found = rolloff_for_height(level, slope, q0, q1, height)
    if qr < 200:  # h_rms without a roll-off is less than twice the height
        assert found is None
    else:
        assert found == pytest.approx(qr, rel=1e-4)


def test_long_waves_of_a_single_profile_are_unknown():
    """The fit uses the rms height, if C is known only above the roll-off."""
    road = rf.SelfAffine(q0=50.0, qr=1500.0, q1=5e5, hurst=0.8, h_rms=0.35e-3)
    q = np.geomspace(50.0, 5e5, 41)
    C = np.asarray(rf.power_spectrum(road, q))

    class Profile(rf.roughness.MeasuredSpectrum):
        def areal(self):
            return rf.roughness.ArealSpectrum(q, C, np.diag(np.where(q < 1900.0, 2.0, 0.1) ** 2))

    line = np.asarray(rf.roughness.line_spectrum(road, q))
    modes, error = np.full(q.size, 2), np.full(q.size, 0.1)
    measured = Profile(q, line, modes, error, 50.0, 0.0, 0.35e-3, 1, 0.35e-3, 2.0, None, line, error)
    fit = fitting.fit_spectrum(measured)
    assert fit.remarks[-1].endswith("so that h_rms agrees with the rms height of the profiles, 0.00035 m")
    assert float(fit.spectrum.h_rms) == pytest.approx(0.35e-3, rel=1e-3)
    assert float(fit.spectrum.qr) == pytest.approx(1500.0, rel=1e-3)


def test_what_is_refused():
    with pytest.raises(ValueError, match="measured is a tuple: pass a MeasuredSpectrum or an Areal"):
        fitting.spectrum_data((1.0, 2.0))
    unknown = rf.roughness.ArealSpectrum(np.ones(3), np.ones(3), np.eye(3))
    with pytest.raises(ValueError, match="all standard errors of ln C are 1 or more; measure"):
        fitting.spectrum_data(unknown)
