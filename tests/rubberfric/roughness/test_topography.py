"""Spectra of measured heights: Parseval, sine waves, and synthetic surfaces of a known spectrum."""

import itertools
import re

import numpy as np
import pytest

import rubberfric as rf

rng = np.random.default_rng


@pytest.mark.parametrize("per_decade", [None, 3, 20])
@pytest.mark.parametrize("window", ["none", "hann"])
def test_parseval(window, per_decade):
    height = rng(1).standard_normal(601).cumsum() * 1e-6
    n = np.arange(601)
    w = 0.5 - 0.5 * np.cos(2 * np.pi * n / 601) if window == "hann" else np.ones(601)
    flat = height - np.polyval(np.polyfit(n, height, 1), n)
    exact = np.mean((w * flat) ** 2) / np.mean(w**2)
    found = rf.roughness.spectrum_of_profile(1e-5, height, window=window, per_decade=per_decade)
    mean = np.mean(w * flat) ** 2 / np.mean(w**2)  # the mode q = 0, in no bin
    assert found.left_out == pytest.approx(mean, rel=1e-9, abs=1e-9 * exact)
    assert found.cell * np.sum(found.modes * found.C) + found.left_out == pytest.approx(exact, rel=1e-12)
    assert found.h_rms**2 == pytest.approx(exact, rel=1e-12)
    surface = rng(2).standard_normal((40, 33)).cumsum(0).cumsum(1)
    found = rf.roughness.spectrum_of_topography(
        surface, 1e-5, 2e-5, window=window, detrend=None, per_decade=per_decade
    )
    w = (1 - np.cos(2 * np.pi * np.arange(40) / 40))[:, None] * (1 - np.cos(2 * np.pi * np.arange(33) / 33))
    w = w if window == "hann" else np.ones((40, 33))
    exact = np.mean((w * surface) ** 2) / np.mean(w**2)
    assert found.cell * np.sum(found.modes * found.C) + found.left_out == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("window", ["none", "hann"])
def test_a_sine_wave(window):
    """All of its a^2/2 is at its wavevector: in one mode, or in the three of the Hann window."""
    length, a, k = 2e-3, 3e-6, 25
    x = np.linspace(0, length, 512, endpoint=False)
    q = 2 * np.pi * k / length
    found = rf.roughness.spectrum_of_profile(
        x, a * np.sin(q * x + 0.3), window=window, detrend=None, per_decade=None
    )
    share = found.cell * found.modes * found.C / (a**2 / 2)
    expected = {"none": [0, 1, 0], "hann": np.array([1, 4, 1]) / 6}[window]
    np.testing.assert_allclose(share[k - 2 : k + 1], expected, atol=1e-12)
    np.testing.assert_allclose(found.q[k - 1], q, rtol=1e-9)
    assert share.sum() == pytest.approx(1, rel=1e-12)
    # in a map along (20, 15): |q| = 25 periods
    grid = 2 * np.pi * np.arange(128) / 128
    wave = a * np.cos(20 * grid[:, None] + 15 * grid)
    found = rf.roughness.spectrum_of_topography(wave, length / 128, window="none", detrend=None)
    at = np.argmax(found.C)
    assert found.cell * found.modes[at] * found.C[at] == pytest.approx(a**2 / 2, rel=1e-12)
    assert found.q[at] == pytest.approx(q, rel=0.06)


def surface(spectrum, n, length, seed):
    """A Gaussian periodic surface: independent modes of mean square C dqx dqy each."""
    k = np.fft.fftfreq(n, length / n) * 2 * np.pi
    q = np.hypot(k[:, None], k)
    C = np.asarray(rf.power_spectrum(spectrum, np.where(q > 0, q, 1e-9)))
    noise = np.fft.fft2(rng(seed).standard_normal((n, n))) / n  # white: mean square 1 in every mode
    return np.fft.ifft2(noise * np.sqrt(C) * 2 * np.pi / length).real * n * n


# Points along a side.
N = 128
# Length of a side [m], the longest wavelength.
LENGTH = 0.04
TRUTH = rf.SelfAffine(2 * np.pi / LENGTH, 1000.0, 1.0e4, 0.8, 3e-4)


@pytest.fixture(scope="module")
def maps():
    return [surface(TRUTH, N, LENGTH, seed) for seed in range(40)]


def test_known_surfaces(maps):
    """The mean over realisations is the truth's bin mean within 5 standard errors; the scatter as said."""
    found = [rf.roughness.spectrum_of_topography(h, LENGTH / N, window="none", detrend=None) for h in maps]
    C = np.stack([one.C for one in found])
    k = np.fft.fftfreq(N, LENGTH / N) * 2 * np.pi
    q = np.hypot(k[:, None], k)
    exact = np.asarray(rf.power_spectrum(TRUTH, np.where(q > 0, q, 1.0)))
    lowest = q[q > 0].min()
    bins = np.floor(np.log10(np.where(q > 0, q, lowest) / lowest) * 20 + 1e-9)
    bins = np.where((q > 0) & (q <= k.max() * N / (N - 2) * (1 + 1e-9)), bins, -1)
    expected = np.array([exact[bins == b].mean() for b in np.unique(bins[bins >= 0])])
    # modes within a bin differ in C, too: their own scatter adds to the error of the mean
    spread = np.array([(exact[bins == b] ** 2).mean() for b in np.unique(bins[bins >= 0])]) / expected**2
    error = found[0].relative * np.sqrt(spread)
    pull = (C.mean(0) / expected - 1) / (error / np.sqrt(len(maps)))
    assert np.abs(pull).max() < 5 and 0.5 < np.sqrt(np.mean(pull**2)) < 1.5
    scatter = C.std(0) / expected / error
    assert 0.7 < scatter.mean() < 1.3
    h2 = np.mean([one.h_rms**2 for one in found])
    sum_C = np.sum(exact[q > 0]) * found[0].cell
    # var(h^2) = 2 sum over modes of (C cell)^2
    sigma = np.sqrt(2 * np.sum((exact[q > 0] * found[0].cell) ** 2) / len(maps))
    assert abs(h2 - sum_C) < 5 * sigma


def test_profiles_of_known_surfaces(maps):
    """C_1D of all lines of the maps is int C dqy, sums in place of integrals."""
    options = {"window": "none", "detrend": None, "per_decade": None}
    lines = [h[:, j] for h in maps for j in range(0, N, 16)]
    found = [rf.roughness.spectrum_of_profile(LENGTH / N, line, **options) for line in lines]
    k = np.fft.fftfreq(N, LENGTH / N) * 2 * np.pi
    q = np.hypot(k[:, None], k)
    exact = np.asarray(rf.power_spectrum(TRUTH, np.where(q > 0, q, 1e-9))).sum(1) * 2 * np.pi / LENGTH
    ratio = np.mean([one.C for one in found], 0)[:-1] / exact[1 : N // 2]
    # 320 lines, 8 of a map and not independent: at least 40 with two modes each
    assert np.abs(ratio - 1).max() < 5 / np.sqrt(40) and abs(ratio.mean() - 1) < 0.05


def test_window_keeps_the_level_and_no_window_adds_a_tail(maps):
    """Cut out of a larger surface, the edges do not match."""
    cut = [h[:64, :64] for h in maps]
    with_window = [rf.roughness.spectrum_of_topography(h, LENGTH / N, per_decade=8) for h in cut]
    without = [rf.roughness.spectrum_of_topography(h, LENGTH / N, window="none", per_decade=8) for h in cut]
    q = with_window[0].q
    exact = np.asarray(rf.power_spectrum(TRUTH, np.minimum(q, 9999.0)))
    kept = (q > 1500.0) & (q < 7000.0)
    ratio = (np.mean([one.C for one in with_window], 0) / exact)[kept]
    assert np.abs(ratio - 1).max() < 0.15
    assert (np.mean([one.C for one in without], 0) / exact)[kept][-1] > 1.3


def mean_square(q, C, dimensions):
    """2 pi int q C dq or 2 int C dq of a log-log linear table, by the trapezoidal rule on a fine grid."""
    x = np.concatenate([np.linspace(a, b, 2000) for a, b in itertools.pairwise(np.log(q))])
    weight = np.exp(dimensions * x) * (2 * np.pi if dimensions == 2 else 2)
    return np.trapezoid(weight * np.exp(np.interp(x, np.log(q), np.log(C))), x)


@pytest.mark.parametrize("per_decade", [None, 5, 20])
@pytest.mark.parametrize("window", ["none", "hann"])
@pytest.mark.parametrize("rolloff", [2 * np.pi / LENGTH, 1000.0])
@pytest.mark.parametrize("shape", [pytest.param((N, N), marks=pytest.mark.slow), (N, N // 3), (N + 1, N - 1)])
def test_table_of_a_map_has_its_mean_square_height(shape, rolloff, window, per_decade):
    truth = rf.SelfAffine(2 * np.pi / LENGTH, rolloff, 1.0e4, 0.8, 3e-4)
    heights = surface(truth, 2 * N, LENGTH, 11)[: shape[0], : shape[1]]
    found = rf.roughness.spectrum_of_topography(heights, LENGTH / N, window=window, per_decade=per_decade)
    flat = heights - heights.mean()
    exact = found.h_rms**2 - found.left_out
    if window == "none" and per_decade == 20:  # Parseval's sum, without `left_out`
        k = [np.fft.fftfreq(n, LENGTH / N) * 2 * np.pi for n in shape]
        power = np.abs(np.fft.fft2(flat)) ** 2 / flat.size**2
        power = power[np.hypot(k[0][:, None], k[1]) <= np.pi * N / LENGTH * (1 + 1e-9)].sum()
        again = rf.roughness.spectrum_of_topography(heights, LENGTH / N, window="none", detrend=0)
        assert rf.roughness.moment(again.table(), 0) == pytest.approx(power, rel=1e-9)
    table = found.table()
    assert mean_square(table.q, table.C, 2) == pytest.approx(exact, rel=1e-5)
    assert rf.roughness.moment(table, 0) == pytest.approx(exact, rel=1e-9)
    # Bins stay: by their standard error at most, and where C is small not at all.
    at = np.searchsorted(table.q, found.q * (1 - 1e-9))
    np.testing.assert_allclose(table.q[at], found.q, rtol=1e-12)
    change = np.abs(np.log(table.C[at] / found.C))
    assert (change < np.maximum(found.relative, 1e-3) * (1 if shape[0] < 1.5 * shape[1] else 2)).all()
    small = found.C / found.C.max() < 1e-3
    assert change[small].max() < 1e-2
    # Ends are the borders of the cells of all modes.
    assert table.q[0] < found.q[0] and table.q[-1] == pytest.approx(np.pi * N / LENGTH, rel=0.01)


@pytest.mark.parametrize("per_decade", [None, 5, 20])
@pytest.mark.parametrize("window", ["none", "hann"])
@pytest.mark.parametrize("n", [600, 601])
def test_knots_of_a_profile_have_its_mean_square_height(n, window, per_decade):
    height = rng(4).standard_normal(n).cumsum() * 1e-6
    found = rf.roughness.spectrum_of_profile(1e-5, height, window=window, per_decade=per_decade)
    exact = found.h_rms**2 - found.left_out
    q, C = found.knots()
    assert mean_square(q, C, 1) == pytest.approx(exact, rel=1e-5)
    assert q[0] == pytest.approx(np.pi / (n * 1e-5)) and q[-1] == pytest.approx(np.pi / 1e-5)


def test_table_of_a_profile_is_its_areal_spectrum():
    height = rng(4).standard_normal((16, 16))
    profile = rf.roughness.spectrum_of_profile(1.0, height[0].cumsum(), per_decade=5)
    np.testing.assert_array_equal(profile.table().C, profile.areal().C)
    with pytest.raises(ValueError, match=r"C\[0\] = 0 at q = .*: must be > 0; use fewer bins"):
        rf.roughness.spectrum_of_topography(np.zeros((9, 9)), 1.0).table()


def test_detrending():
    x, y = np.meshgrid(np.arange(20.0), np.arange(30.0), indexing="ij")
    trend = 3 + 2 * x - y + 0.1 * x * y - 0.3 * y**2
    assert rf.roughness.spectrum_of_topography(trend, 1.0, detrend=2).h_rms < 1e-10
    assert rf.roughness.spectrum_of_topography(trend, 1.0, detrend=1).h_rms > 1
    assert rf.roughness.spectrum_of_profile(1.0, 2 + 3 * np.arange(20)).h_rms < 1e-12


FLAT = np.zeros(20)


of_profile = rf.roughness.spectrum_of_profile
of_topography = rf.roughness.spectrum_of_topography


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: of_profile(0.0, FLAT), "x = 0.0: must be > 0"),
        (lambda: of_profile(np.arange(19), FLAT), "x of shape (19,): must be a finite spacing, or 20"),
        (lambda: of_profile(np.arange(20) ** 2, FLAT), "positions must increase evenly"),
        (lambda: of_profile(np.arange(20) ** 2, FLAT), "interpolate the heights to even positions"),
        (
            lambda: of_profile(-np.arange(20.0), FLAT),
            "x decreases from -0 to -19: positions must increase; reverse positions and heights: x[::-1],",
        ),
        (lambda: of_profile(1.0, FLAT[:5]), "heights of shape (5,), type float64: must be real, 1-dim"),
        (lambda: of_profile(1.0, FLAT + np.nan), "heights[0] is not finite; fill in"),
        (lambda: of_profile(1.0, FLAT, window="kaiser"), "window = 'kaiser': must be one of hann, none"),
        (lambda: of_profile(1.0, FLAT, detrend=3), "detrend = 3: must be 0, 1, 2 or None"),
        (lambda: of_profile(1.0, FLAT, per_decade=0), "per_decade = 0: must be a number > 0 or None"),
        (lambda: of_topography(FLAT, 1.0), "must be real, 2-dimensional"),
        (lambda: of_topography(np.zeros((9, 9)), 1.0, -1.0), "dy = -1.0: must be > 0"),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        call()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("shape", [(24, 24), pytest.param((24, 10), marks=pytest.mark.slow), (64,)])
@pytest.mark.parametrize("window", ["none", "hann"])
def test_relative_is_the_scatter_of_the_logarithm(shape, window):
    """1500 surfaces of white noise: in every bin, also in the first ones of two to four modes."""
    options = {"window": window, "detrend": None, "per_decade": 10}
    noise = rng(8).standard_normal((1500, *shape))
    spectrum = rf.roughness.spectrum_of_topography if len(shape) == 2 else rf.roughness.spectrum_of_profile
    found = [spectrum(z, 1e-6, **options) if len(shape) == 2 else spectrum(1e-6, z, **options) for z in noise]
    scatter = np.std(np.log([each.C for each in found]), 0)
    stated = np.array([each.relative for each in found])  # a map estimates how its directions differ
    np.testing.assert_allclose(scatter, np.sqrt(np.mean(stated**2, 0)), rtol=0.2)
    assert stated.max() <= 2.5  # which fitting.SpectrumData accepts
