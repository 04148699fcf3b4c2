"""Rms height, rms slope and spectra of measured heights against SurfaceTopography; noise and smoothing."""

import json
import re

import numpy as np
import pytest
import scipy.ndimage
import scipy.special
from support.cases.heights import SPACING, self_affine, surfaces
from support.folders import REFERENCE

import rubberfric as rf

CASES = json.loads((REFERENCE / "topography_cases.json").read_text())
SURFACES = surfaces()


def spectrum(heights, spacings, **options):
    if heights.ndim == 1:
        return rf.roughness.spectrum_of_profile(spacings[0], heights, **options)
    return rf.roughness.spectrum_of_topography(heights, *spacings, **options)


def octave_means(found, borders):
    """Mean of C over the modes of every octave."""
    octave = np.searchsorted(borders, found.q) - 1
    inside = (octave >= 0) & (octave < len(borders) - 1)
    weights = found.modes[inside], (found.modes * found.C)[inside]
    modes, total = (np.bincount(octave[inside], w, len(borders) - 1) for w in weights)
    return total / modes


@pytest.mark.parametrize("window", ["none", "hann"])
@pytest.mark.parametrize("name", SURFACES)
def test_surfacetopography(name, window):
    heights, spacings = SURFACES[name]
    found, case = spectrum(heights, spacings, window=window, per_decade=None), CASES[name]
    assert found.rms_height == pytest.approx(case["rms_height"], rel=1e-9)
    # SurfaceTopography leaves out the last row and column of a map in both directions.
    assert found.rms_slope == pytest.approx(case["rms_slope"], rel=1e-12 if heights.ndim == 1 else 1e-3)
    factor = 2 * np.pi if heights.ndim == 1 else 4 * np.pi**2
    ratio = factor * octave_means(found, case["borders"]) / case[window]
    if window == "none" or heights.ndim == 1:
        np.testing.assert_allclose(ratio, 1, rtol=1e-6)
    else:  # Its window is round, so the first octaves of few modes differ.
        np.testing.assert_allclose(ratio[2:], 1, atol=0.05)


def test_rms_slope_of_an_uneven_grid():
    heights = np.random.default_rng(5).standard_normal((20, 30))
    found = rf.roughness.spectrum_of_topography(heights, 1.0, 3.0, detrend=None)
    gradients = (heights[1:] - heights[:-1]) ** 2, (heights[:, 1:] - heights[:, :-1]) ** 2 / 9
    assert found.rms_slope == pytest.approx(np.sqrt(sum(one.mean() for one in gradients)), rel=1e-12)


def test_range_of_five_surfaces():
    """Noise, steps and a tip are found, and C below q1 is the C of the surface."""
    found = {name: spectrum(*surface) for name, surface in SURFACES.items()}
    limits = {name: one.resolved().limit for name, one in found.items()}
    assert limits == {
        "self-affine": "grid", "stepped": "noise", "noisy": "noise", "tip": "smoothing", "line": "grid"
    }  # fmt: skip
    assert found["line"].resolved().q1 == found["line"].q[-1]
    true = found["self-affine"]
    for name in ("stepped", "noisy"):
        q1 = found[name].resolved().q1
        share = (true.C / found[name].C)[np.isclose(true.q, q1)]
        assert share == pytest.approx(0.8, abs=0.15) and q1 > 5e4
    q1 = found["tip"].resolved().q1
    rough = spectrum(self_affine((192, 160), 0.5, 2e-6, 2), (SPACING, SPACING))
    smoothed = (found["tip"].C / rough.C)[np.searchsorted(rough.q, q1)]
    assert 0.6 < smoothed < 1 and found["tip"].C[-1] < 0.3 * rough.C[-1]
    # The rms slope up to q1 is the one of the surface, and the slope of neighbouring points is not.
    q1 = found["noisy"].resolved().q1
    slopes = [float(rf.rms_slope(found[name].table(), q1)) for name in ("noisy", "self-affine")]
    assert slopes[0] == pytest.approx(slopes[1], rel=0.05)
    assert found["noisy"].rms_slope > 1.1 * true.rms_slope


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8, 0.95])
@pytest.mark.parametrize("dimensions", [1, 2])
def test_self_affine_surfaces_are_resolved_up_to_the_grid(hurst, dimensions):
    for seed in range(8):
        heights = self_affine((256,) * dimensions if dimensions == 2 else (4096,), hurst, 1e-6, seed)
        found = spectrum(heights, (SPACING,) * dimensions).resolved()
        assert found.limit == "grid", seed


@pytest.mark.parametrize("width", [1.5, 4.0])
def test_a_filter_is_found(width):
    """Gaussian smoothing by `width` points multiplies C by exp(-(q width dx)^2)."""
    heights = scipy.ndimage.gaussian_filter(self_affine((256, 256), 0.8, 1e-6, 3), width, mode="wrap")
    found = spectrum(heights, (SPACING, SPACING)).resolved()
    assert found.limit == "smoothing"
    assert 0.7 < np.exp(-((found.q1 * width * SPACING) ** 2)) < 0.98
    # With noise beyond the smoothed range, q1 is the lower border.
    noisy = heights + 1e-10 * np.random.default_rng(1).standard_normal(heights.shape)
    assert spectrum(noisy, (SPACING, SPACING)).resolved().q1 == pytest.approx(found.q1, rel=0.2)


def test_no_surface():
    white = np.random.default_rng(2).standard_normal((200, 200))
    for heights in (white, white[0], np.zeros((20, 20)), np.zeros(8)):
        found = spectrum(heights, (1e-6,) * heights.ndim)
        assert found.resolved().limit == "no surface" and np.isnan(found.resolved().q1)
        assert "does not fall like" in found.report() and "q1" not in found.report()


@pytest.mark.slow
def test_report():
    text = spectrum(*SURFACES["noisy"]).report()
    assert text.startswith("Spectrum of a map, 3272 ... 3.029e+05 1/m\n    rms height 2.082e-06 m\n")
    assert "rms slope 0.1469, from neighbouring points" in text
    assert "noise above q1: C falls more slowly than for H = 0 (at q1" in text and "rms slope 1.3" not in text
    heights, spacings = SURFACES["line"]
    text = spectrum(50 * heights, spacings).report()
    assert (
        "rms slope along the profile" in text and "rms slope 1.3, as usual for rubber on roads, up to" in text
    )


def test_reported_slope_of_a_profile_is_that_of_the_surface():
    """C_1D ~ q^-(1 + 2 H) is pi q C a, with a = 1.087 for H = 0.8, whose wave goes on beyond q1."""
    found = spectrum(self_affine((4096,), 0.8, 1e-6, 1), (SPACING,))
    q, C = found.knots()
    x = np.linspace(np.log(q[0]), np.log(found.resolved().q1), 20_000)
    along = np.sqrt(2 * np.trapezoid(np.exp(3 * x + np.interp(x, np.log(q), np.log(C))), x))
    a = 2 / np.sqrt(np.pi) * scipy.special.gamma(1.3) / scipy.special.gamma(1.8)
    reported = float(re.search(r"with rms slope (\S+) of the surface", found.report())[1])
    assert reported == pytest.approx(along * np.sqrt(2 / a), rel=0.02)


def test_a_false_tail_is_reported():
    """A curved surface without a window: its edges do not match and add a slope that it does not have."""
    x, y = np.meshgrid(np.arange(128.0), np.arange(128.0), indexing="ij")
    heights = 1e-6 * (np.sin(x / 30) * np.cos(y / 50) + self_affine((128, 128), 0.8, 1e-2, 1))
    with_window, without = (
        spectrum(heights, (1e-6, 1e-6), window=window, detrend=0) for window in ("hann", "none")
    )
    text = 'larger than the slope of the heights: edges that do not match (window "none")'
    assert text in without.report() and text not in with_window.report()
    assert float(rf.rms_slope(without.table())) > 2 * without.rms_slope
    for surface in SURFACES.values():
        assert text not in spectrum(*surface).report()


def test_several_profiles():
    """The mean of all profiles, with the larger of the theoretical standard error and their scatter."""
    lines = np.stack([self_affine((512,), 0.8, 1e-6, seed) for seed in range(12)])
    lines[0] *= 3
    each = [rf.roughness.spectrum_of_profile(SPACING, line) for line in lines]
    found = rf.roughness.spectrum_of_profile(SPACING, lines)
    C = np.array([one.C for one in each])
    np.testing.assert_allclose(found.C, C.mean(0), rtol=1e-12)
    for name in ("h_rms", "rms_height", "rms_slope"):
        mean = np.sqrt(np.mean([getattr(one, name) ** 2 for one in each]))
        assert getattr(found, name) == pytest.approx(mean, rel=1e-12)
    assert found.left_out == pytest.approx(np.mean([one.left_out for one in each]))
    scatter = C.std(0, ddof=1) / C.mean(0) / np.sqrt(12)
    # Twelve profiles have twelve times as many independent modes.
    ratio = found.relative / np.maximum(scatter, each[0].relative / np.sqrt(12))
    assert (ratio <= 1 + 1e-12).all() and ratio.min() > 0.7
    np.testing.assert_allclose(ratio[found.modes > 100], 1.0, rtol=0.01)
    assert found.cell * np.sum(found.modes * found.C) + found.left_out == pytest.approx(found.h_rms**2)
    with pytest.raises(ValueError, match="at least 8 along each axis"):
        rf.roughness.spectrum_of_profile(SPACING, lines[:, :7])
