"""Two laser profiles of a chip-seal road: mean profile depth, rms height and Hurst exponent.

captif-slp (MIT), where the profiles come from, tests its mean profile depths: 3.0332 mm with a standard
deviation of 0.4497 mm between segments for station 1, 3.2778 and 0.8531 mm for station 0. Its list of three
results begins with station 10 (3.420 mm).

The project stores heights in micrometres. The tests write them as the profilometer does.
"""

import functools
import math
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
import scipy.signal
from support.published import PUBLISHED

import rubberfric as rf

SPACING = 0.037489  # [mm]
SEGMENTS = 16


@functools.cache
def stored(station):
    """Return the heights of a profile [um], NaN at dropouts."""
    return np.loadtxt(PUBLISHED / "captif-slp" / f"aylesbury_station_{station}.txt.gz")


@functools.cache
def read(station):
    """Return distances and heights [m] as read from a file of the profilometer."""
    height = stored(station) / 1e3
    rows = np.column_stack([np.arange(1, height.size + 1), SPACING * np.arange(height.size), height])
    titles = ["Road Name\tCAPTIF\t", "Direction\tincreasing\t", "File No.\t0\t", "*****DATA*****\t\t"]
    titles += ["Data Point No:\tDistance (mm)\tDepth (mm)"]
    share = ("8.6%", "9.4%")[station]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "profile.dat"
        np.savetxt(path, rows, fmt="%.3f", delimiter="\t", header="\n".join(titles), comments="")
        path.write_text(path.read_text().replace("nan", "NaN"))
        with pytest.warns(UserWarning, match=f"{share} of the heights are dropouts and are interpolated"):
            x, (height,) = rf.io.read_traces(path)
    return x, height


def road(station):
    """The middle of a profile without the reference plates at its ends: spacing and heights [m]."""
    x, height = read(station)
    inside = (x > 0.15) & (x < 1.75)
    x, height = x[inside], height[inside]
    return (x[-1] - x[0]) / (x.size - 1), height


def segment_depths(x, height, lost, spacing=0.5e-3):
    """Mean segment depths of valid segments of 100 mm [ISO 13473-1:2019], of a profile with plates.

    The profile is averaged over 0.5 mm, freed of spikes, and smoothed below 2.4 mm. A segment with more than
    10 % of dropouts or 5 % of spikes is invalid. Slopes are subtracted. The depth is the mean of the highest
    points of both halves above the mean.
    """
    plates = np.flatnonzero(np.diff((np.where(lost, 0.0, height) > 0.03).astype(int))) + 1
    middle = (x.size + 1) // 2
    start, end = x[plates[plates < middle][-1]] + 2e-3, x[plates[plates >= middle][0]] - 2e-3
    inside = (x >= start) & (x < end)
    x, height, lost = x[inside] - start, height[inside], lost[inside]
    cell = np.maximum(np.ceil(x / spacing - 1e-6).astype(int), 1)
    z = np.bincount(cell, height)[1:] / np.bincount(cell)[1:]
    at = spacing * np.arange(1, z.size + 1)
    jump = np.abs(np.diff(z)) >= 6 * spacing
    spike = np.append(jump, False) | np.append(False, jump)
    z = np.interp(at, at[~spike], z[~spike])
    z = scipy.signal.sosfiltfilt(scipy.signal.butter(2, 2 * spacing / 2.4e-3, output="sos"), z)
    depths = []
    for left in np.arange(0, x[-1] - 0.09, 0.1):
        part, raw = ((a > left) & (a <= left + 0.1) for a in (at, x))
        if lost[raw].mean() <= 0.1 and spike[part].mean() <= 0.05:
            level = z[part] - np.polyval(np.polyfit(at[part], z[part], 1), at[part])
            half = level.size // 2
            depths.append((level[:half].max() + level[half:].max()) / 2)
    return np.array(depths)


@pytest.mark.parametrize(("station", "depth", "deviation"), [(0, 3.27775, 0.85309), (1, 3.03320, 0.44967)])
def test_mean_profile_depth(station, depth, deviation):
    """Heights are read right: published within 0.1 % after the standard's filters, within 5 % without."""
    x, height = read(station)
    lost = np.isnan(stored(station))
    depths = 1e3 * segment_depths(x, height, lost)
    assert depths.mean() == pytest.approx(depth, rel=1e-3)
    assert depths.std(ddof=1) == pytest.approx(deviation, rel=1e-3)
    _, height = road(station)
    simple = []
    for level in np.split(height[: height.size // SEGMENTS * SEGMENTS], SEGMENTS):
        at = np.arange(level.size)
        level = level - np.polyval(np.polyfit(at, level, 1), at)
        simple.append((level[: at.size // 2].max() + level[at.size // 2 :].max()) / 2)
    assert 1e3 * np.mean(simple) == pytest.approx(depth, rel=0.05)


def hurst(q, C):
    """H of C_1D ~ q^-(1 + 2 H), from 1e3 to 2e4 1/m."""
    inside = (q > 1e3) & (q < 2e4)
    return (-np.polyfit(np.log(q[inside]), np.log(C[inside]), 1)[0] - 1) / 2


@pytest.mark.parametrize(("station", "h_rms", "H"), [(0, 2.26e-3, 0.85), (1, 2.32e-3, 0.74)])
def test_height_and_hurst_exponent(station, h_rms, H):
    """Against a first analysis with other tools, and against Welch's method of SciPy on segments."""
    spacing, height = road(station)
    whole = rf.roughness.spectrum_of_profile(spacing, height)
    assert whole.h_rms == pytest.approx(h_rms, rel=0.05) and hurst(whole.q, whole.C) == pytest.approx(
        H, rel=0.05
    )
    at = np.arange(height.size)
    assert whole.rms_height == pytest.approx((height - np.polyval(np.polyfit(at, height, 1), at)).std())

    segments = np.stack(np.split(height[: height.size // SEGMENTS * SEGMENTS], SEGMENTS))
    found = rf.roughness.spectrum_of_profile(spacing, segments)
    f, power = scipy.signal.welch(height, 1 / spacing, nperseg=4096, detrend="linear")
    q, C = 2 * np.pi * f[1:], power[1:] / (4 * np.pi)
    borders = np.geomspace(1e3, 2e4, 27)
    cell = np.digitize(q, borders)
    q, C = (np.array([a[cell == k].mean() for k in range(1, 27)]) for a in (q, C))
    assert hurst(found.q, found.C) == pytest.approx(hurst(q, C), rel=0.05)
    # The error bar of H is the standard error of the mean over segments.
    each = [hurst(one.q, one.C) for one in (rf.roughness.spectrum_of_profile(spacing, s) for s in segments)]
    error = np.std(each, ddof=1) / np.sqrt(SEGMENTS)
    print(
        f"\nstation {station}: H = {hurst(found.q, found.C):.3f} +- {error:.3f}, Welch {hurst(q, C):.3f};"
        f" whole profile {hurst(whole.q, whole.C):.3f}, h_rms {1e3 * whole.h_rms:.3f} mm"
    )
    assert 0.02 < error < 0.06 and abs(hurst(whole.q, whole.C) - hurst(found.q, found.C)) < 2 * error
    log_C = np.interp(np.log(q), np.log(found.q), np.log(found.C)) - np.log(C)
    assert np.sqrt(np.mean(log_C**2)) < 0.15


@pytest.mark.slow
def test_report_of_a_road():
    """The profile resolves the range that matters for rubber: the slope 1.3 is reached within it."""
    spacing, height = road(0)
    found = rf.roughness.spectrum_of_profile(spacing, height)
    assert found.resolved().q1 > 2e4
    text = found.report()
    assert "rms slope along the profile 2.82" in text
    reported = re.search(r"rms slope 1.3, as usual for rubber on roads, up to q = (\S+) 1/m", text)
    # The factor of a power law with H = 0.85 adds some slope below the roll-off.
    q, C = found.knots()
    table = rf.TabulatedSpectrum(q, C / (q * np.sqrt(np.pi) * math.gamma(1.35) / math.gamma(1.85)))
    assert reported is not None
    assert float(reported[1]) == pytest.approx(float(rf.roughness.cutoff(table, 1.3)), rel=0.15)
