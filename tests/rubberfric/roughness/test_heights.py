"""Tops, filled cavities, outliers and limits of instruments, against sums, bisections and Gaussian fields."""

import re

import numpy as np
import pytest
import scipy.ndimage
import scipy.optimize
from support.cases.heights import SPACING, self_affine

import rubberfric as rf

rng = np.random.default_rng
tools = rf.roughness


def transform_by_sums(z, dx, dy):
    """|q| and C of every mode, by a sum over all points in place of an FFT."""
    nx, ny = z.shape
    x, y = dx * np.arange(nx), dy * np.arange(ny)
    kx, ky = (2 * np.pi * np.fft.fftfreq(n, d) for n, d in ((nx, dx), (ny, dy)))
    amplitude = np.einsum("xy,ax,by->ab", z, np.exp(-1j * np.outer(kx, x)), np.exp(-1j * np.outer(ky, y)))
    return np.hypot(kx[:, None], ky), dx * dy / ((2 * np.pi) ** 2 * z.size) * np.abs(amplitude) ** 2


def test_top_spectrum_by_sums():
    """C_T = C[max(h, 0)] / n_T, mode by mode."""
    heights = rng(1).standard_normal((12, 10)) ** 3
    found = tools.spectrum_of_topography(
        heights, 2e-6, 3e-6, window="none", detrend=0, per_decade=None, tops=True
    )
    above = heights - heights.mean()
    q, C = transform_by_sums(np.where(above > 0, above, 0.0), 2e-6, 3e-6)
    C /= np.mean(above > 0)
    for k, at in enumerate(found.q):
        np.testing.assert_allclose(found.C[k], C[np.isclose(q, at, rtol=1e-9)].mean(), rtol=1e-10)
    assert f"of the {np.mean(above > 0):.1%} of the area above the mean" in found.report()
    line = tools.spectrum_of_profile(
        2e-6, heights[:, 0], window="none", detrend=0, per_decade=None, tops=True
    )
    z = np.maximum(heights[:, 0] - heights[:, 0].mean(), 0)
    sums = np.exp(-2j * np.pi * np.outer(np.arange(1, 7), np.arange(12)) / 12) @ z
    expected = 2e-6 / (2 * np.pi * 12) * np.abs(sums) ** 2 / np.mean(z > 0)
    np.testing.assert_allclose(line.C, expected, rtol=1e-10)


def test_top_spectrum_of_gaussian_surfaces():
    """The covariance of max(h, 0) is (sqrt(1 - r^2) + r (pi - arccos r) - 1) / (2 pi) [Price 1958]."""
    n, draws = 64, 30
    k = np.fft.fftfreq(n, 1 / n)
    q = np.hypot(k[:, None], k)
    C = np.where((q > 1.5) & (q < 28), np.maximum(q / 4, 1.0) ** -3.4, 0.0)
    C /= C.sum()
    r = np.clip(np.fft.fft2(C).real, -1, 1)
    covariance = (np.sqrt(1 - r**2) + r * (np.pi - np.arccos(r)) - 1) / (2 * np.pi)
    exact = 2 * np.fft.ifft2(covariance).real
    low, high = (q > 1.5) & (q < 3), (q > 12) & (q < 25)
    ratio = [exact[part].sum() / C[part].sum() for part in (low, high)]
    assert 0.5 < ratio[0] < 0.6 and 0.95 < ratio[1] < 1.15
    noise = np.fft.fft2(rng(2).standard_normal((draws, n, n))) / n
    surfaces = np.fft.ifft2(noise * np.sqrt(C)).real * n * n
    found = [
        tools.spectrum_of_topography(z, 1 / n, window="none", detrend=0, per_decade=5, tops=True)
        for z in surfaces
    ]
    # All modes, |q| = 2 pi k, with the cell (2 pi)^2.
    mean_C = np.mean([one.C for one in found], 0) * (2 * np.pi) ** 2
    bins = np.floor(np.log10(np.where(q > 0, q, 1.0)) * 5 + 1e-9)
    bins = np.where((q > 0) & (q <= n / 2), bins, -1)
    expected = np.array([exact[bins == b].mean() for b in np.unique(bins[bins >= 0])])
    error = found[0].relative / np.sqrt(draws)
    strong = expected > 1e-3 * expected.max()
    assert np.abs((mean_C / expected - 1) / error)[strong].max() < 6
    mean_square = np.mean([one.h_rms**2 / z.var() for one, z in zip(found, surfaces, strict=True)])
    assert mean_square == pytest.approx(1 - 1 / np.pi, rel=0.05)


@pytest.mark.parametrize("shape", [(7, 9), (40,)])
@pytest.mark.parametrize("volume", [0.0, 1e-9, 0.3, 2.5, 1e3])
def test_filled_cavities(shape, volume):
    """The level is that of a bisection, and the heights are the larger of h and the level."""
    h = np.round(rng(3).standard_normal(shape), 1)  # with equal heights
    found = tools.fill_cavities(h, volume=volume)
    level = (
        scipy.optimize.brentq(
            lambda z: np.mean(np.maximum(z - h, 0)) - volume, h.min() - 1, h.max() + volume + 1, xtol=1e-14
        )
        if volume
        else h.min()
    )
    assert found.level == pytest.approx(level, abs=1e-11) and found.volume == pytest.approx(volume, abs=1e-12)
    np.testing.assert_allclose(found.heights, np.where(h > level, h, level), atol=1e-11)
    assert found.covered == np.mean(h < level - 1e-11)
    again = tools.fill_cavities(h, level=found.level)
    np.testing.assert_array_equal(again.heights, found.heights)


def test_spectrum_of_a_sealed_road():
    """Detrended, filled, and its tops taken, in this order."""
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0), indexing="ij")
    heights = 1e-6 * rng(4).standard_normal((40, 30)) + 1e-6 * x - 2e-6 * y
    options = {"window": "none", "detrend": 1, "per_decade": 10}
    found = tools.spectrum_of_topography(heights, 1e-6, fill_volume=2e-7, tops=True, **options)
    columns = np.stack([np.ones(heights.size), x.ravel(), y.ravel()], 1)
    plane = columns @ np.linalg.lstsq(columns, heights.ravel(), rcond=None)[0]
    flat = heights - plane.reshape(heights.shape)
    np.testing.assert_allclose(tools.detrended(heights), flat, atol=1e-18)
    level = scipy.optimize.brentq(lambda z: np.mean(np.maximum(z - flat, 0)) - 2e-7, -5e-6, 5e-6, xtol=1e-20)
    filled = np.maximum(flat, level)
    tops = np.maximum(filled - filled.mean(), 0)
    tops = (tops - tops.mean()) / np.sqrt(np.mean(tops > 0))
    by_hand = tools.spectrum_of_topography(tops, 1e-6, **options)
    np.testing.assert_allclose(found.C, by_hand.C, rtol=1e-9)
    assert f"filled up to {level:.4g} m" in found.report() and "2e-07 m^3 per m^2" in found.report()
    deep = tools.spectrum_of_topography(heights, 1e-6, fill_level=level, **options)
    assert deep.rms_height == pytest.approx(tools.detrended(filled).std(), rel=1e-9)
    lines = tools.spectrum_of_profile(1e-6, heights.T, fill_level=0.0, **options)
    each = np.stack([np.maximum(tools.detrended(line), 0.0) for line in heights.T])
    np.testing.assert_allclose(lines.C, tools.spectrum_of_profile(1e-6, each, **options).C, rtol=1e-9)


@pytest.mark.parametrize("smooth", [0, 1, 4, 8])
@pytest.mark.parametrize("profiles", [False, True])
def test_outliers(profiles, smooth):
    """Spikes are found, and no height of a rough, smooth, quantised or filtered surface is."""
    shape = (8, 2000) if profiles else (160, 150)
    h = (
        np.stack([self_affine((2000,), 0.8, 1e-6, k) for k in range(8)])
        if profiles
        else self_affine(shape, 0.8, 1e-6, 1)
    )
    h = scipy.ndimage.gaussian_filter(h, (0, smooth) if profiles else smooth, mode="wrap")
    h = np.round(h / 1e-9) * 1e-9 if smooth < 4 else h
    assert not tools.find_outliers(h, profiles=profiles).any()
    spoiled, places = h.copy(), [(3, 2), (3, 77), (5, 30), (5, 31), (7, shape[1] - 3)]
    for place in places:
        spoiled[place] += 40e-6
    found = tools.find_outliers(spoiled, profiles=profiles)
    # Points beside a spike of two points may be masked, too.
    near = scipy.ndimage.binary_dilation(spoiled != h, np.ones((1, 5) if profiles else (5, 5)))
    assert all(found[place] for place in places) and not found[~near].any() and found.sum() < 15
    if not profiles:
        mended = tools.fill_holes(np.where(found, np.nan, spoiled))
        assert np.abs(mended - h).max() < 3e-6 and (mended == h)[~found].all()


@pytest.mark.parametrize("step", [2.0, 1.0, 0.5, 0.2, 0.05])  # of the rms height
@pytest.mark.parametrize("smooth", [0, 3, 10])
@pytest.mark.parametrize("decimals", [None, 5])
def test_outliers_of_quantised_and_levelled_heights(step, smooth, decimals):
    """The instrument rounds tilted heights to steps, subtracts a plane, and writes decimals."""
    h = scipy.ndimage.gaussian_filter(self_affine((192, 160), 0.8, 1.0, 3), smooth, mode="wrap")
    h, tilt = h / h.std(), np.add.outer(0.01 * np.arange(192), 0.023 * np.arange(160))
    spikes = np.zeros(h.shape, bool)
    spikes[tuple(rng(5).integers(3, 157, (2, 60)))] = True
    for heights in (h, h + 25.0 * spikes):
        levelled = tools.detrended(step * np.round((heights + tilt) / step))
        levelled = levelled if decimals is None else np.round(levelled, decimals)
        found = tools.find_outliers(1e-6 * levelled)
        if heights is h:
            assert not found.any()
    assert found[spikes].all() and not found[~scipy.ndimage.binary_dilation(spikes, np.ones((5, 5)))].any()
    lines = tools.detrended(step * np.round((h + tilt) / step), profiles=True)
    assert np.mean(tools.find_outliers(1e-6 * np.round(lines, 5), profiles=True)) < 1e-3


def test_the_rule_of_outliers():
    """By loops over the points, with a threshold that a tenth of them exceeds."""
    h = np.round(rng(6).standard_normal((9, 11)), 2)

    def distance(line, k):
        return abs(line[k] - np.median([line[k - 2], line[k - 1], line[k + 1], line[k + 2]]))

    across = {(i, k): distance(h[:, k], i) for i in range(2, 7) for k in range(11)}
    along = {(i, k): distance(h[i], k) for i in range(9) for k in range(2, 9)}
    limit = 1.5 / 1.2816 * np.quantile([*across.values(), *along.values()], 0.8)
    expected = {
        place
        for place in {**across, **along}
        if min(across.get(place, np.inf), along.get(place, np.inf)) > limit
    }
    assert {tuple(place) for place in np.argwhere(tools.find_outliers(h, 1.5))} == expected and expected
    limit = 1.5 / 1.2816 * np.quantile(list(along.values()), 0.8)
    found = np.argwhere(tools.find_outliers(h, 1.5, profiles=True))
    assert {tuple(place) for place in found} == {place for place, d in along.items() if d > limit}


def test_a_plane_has_no_outliers():
    plane = 3.0 * np.arange(20.0)[:, None] - np.arange(30.0)
    assert not tools.find_outliers(plane).any() and not tools.find_outliers(np.zeros((9, 9))).any()


@pytest.mark.parametrize("radius", [1e-4, 4e-4, 1e-3])
def test_the_tip_limits_the_range(radius):
    """A surface traced by a round tip: up to q1 most of C is left, and an octave above it is lost."""
    rough = self_affine((192, 160), 0.5, 2e-6, 2)
    reach = SPACING * np.arange(-8, 9)
    traced = scipy.ndimage.grey_dilation(
        rough, structure=-(reach[:, None] ** 2 + reach**2) / (2 * radius), mode="wrap"
    )
    found = tools.spectrum_of_topography(traced, SPACING, tip_radius=radius)
    q1, scatter = found.limits.tip
    share = found.C / tools.spectrum_of_topography(rough, SPACING).C
    at = int(np.searchsorted(found.q, q1)) - 1
    assert share[at - 3 : at + 1].mean() > 0.75 and share[found.q > 2 * q1].mean() < share[at]
    # the distance of the sharpest peak, by a loop over points
    flat, sharpest = tools.detrended(traced), {}
    for k in range(1, 40):
        along = [2 * flat[k:-k] - flat[2 * k :] - flat[: -2 * k]]
        along += [2 * flat[:, k:-k] - flat[:, 2 * k :] - flat[:, : -2 * k]]
        sharpest[k] = max(bend.max() for bend in along) / (k * SPACING) ** 2
    last = max(k for k in sharpest if sharpest[k] > 0.5 / radius)
    assert np.pi / (SPACING * (last + 1)) * 0.9 < q1 < np.pi / (SPACING * last) * 1.1
    assert 0 < scatter < 0.3
    end = found.resolved()
    assert end.q1 <= q1 and (end.limit != "tip" or (end.error == scatter and "+/-" in found.report()))


def test_a_sharp_tip_and_a_silent_instrument_are_no_limit():
    rough = self_affine((192, 160), 0.5, 2e-6, 2)
    found = tools.spectrum_of_topography(rough, SPACING, tip_radius=1e-7, noise=1e-12)
    assert found.limits.tip is None and found.resolved().limit == "grid" and found.resolved().error == 0


def test_the_noise_floor_limits_the_range():
    """C of the surface is a known power law; at q1 the noise is a fifth of the measured C."""
    bars, misses = [], []
    for seed in range(6):
        k = [2 * np.pi * np.fft.fftfreq(200, SPACING)] * 2
        q = np.maximum(np.hypot(k[0][:, None], k[1]), 2e4)
        surface = np.fft.ifft2(np.fft.fft2(rng(seed).standard_normal((200, 200))) * q**-1.8).real
        noise = 0.1 * surface.std()
        measured = surface + noise * rng(100 + seed).standard_normal(surface.shape)
        found = tools.spectrum_of_topography(measured, SPACING, noise=noise, per_decade=10)
        floor = noise**2 * SPACING**2 / (4 * np.pi**2)
        assert found.limits.noise == pytest.approx(floor)
        # C of the surface is (SPACING / 2 pi)^2 q^-3.6, which is four times the floor at q1.
        exact = (4 * floor * (2 * np.pi / SPACING) ** 2) ** (-1 / 3.6)
        stated = next(end for end in found._stated_ranges() if end.limit == "noise floor")
        misses.append(np.log(stated.q1 / exact))
        bars.append(stated.error)
        assert found.resolved().q1 <= stated.q1
    assert np.abs(misses).max() < 0.06 and np.abs(misses).max() < 2 * np.mean(bars)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: tools.fill_cavities(np.ones(9)), "pass either volume or level"),
        (lambda: tools.fill_cavities(np.ones(9), volume=1.0, level=1.0), "pass either volume or level"),
        (lambda: tools.fill_cavities(np.ones(9), volume=-1.0), "volume = -1.0: must be >= 0"),
        (lambda: tools.fill_cavities(np.ones(9), level=np.nan), "level = nan: must be finite"),
        (lambda: tools.fill_cavities([1.0, np.nan], level=0.0), "must be finite; fill in missing points"),
        (lambda: tools.top_heights(-np.ones(9)), "none is above 0; subtract the mean"),
        (lambda: tools.find_outliers(np.ones(9), 0.0), "threshold = 0.0: must be > 0"),
        (lambda: tools.find_outliers(np.ones((2, 2, 2))), "must be real, a profile or a map"),
        (lambda: tools.spectrum_of_profile(1.0, np.arange(20.0), noise=0.0), "noise = 0.0: must be > 0"),
        (lambda: tools.spectrum_of_profile(1.0, np.arange(20.0), tip_radius=-1), "tip_radius = -1.0: must"),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        call()
    assert "\n" not in str(error.value)
