"""Spectra of profiles have their own unit and slope, and every contour of a map has a label."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import rubberfric as rf
from rubberfric.plot.style import label_contours

# Waves with the mean square slope 1e-4 / 2 each, at these wavevectors [1/m].
WAVES = 2 * np.pi / 2048e-5 * np.arange(1, 400)


def profile():
    x, phases = np.arange(2048) * 1e-5, np.random.default_rng(1).uniform(0, 2 * np.pi, WAVES.size)
    heights = np.sum(1e-2 / WAVES * np.cos(np.outer(x, WAVES) + phases), 1)
    return rf.roughness.spectrum_of_profile(x, heights[None], per_decade=10, window="none", detrend=None)


@pytest.mark.slow  # compiles
def test_slope_of_a_profile():
    measured = profile()
    slope = rf.plot.plot_spectrum(measured).figure.axes[-1].lines[0].get_ydata()
    # The bins are 0.23 wide in ln q, and the waves end within one of them.
    exact = np.sqrt(WAVES.size / 2) * 1e-2
    assert slope[np.searchsorted(measured.q, WAVES[-1])] == pytest.approx(exact, rel=0.1)


def test_labels_of_a_profile():
    one = profile()
    one = one._replace(q=one.q[:1], C=one.C[:1], relative=one.relative[:1])
    axes = rf.plot.plot_spectrum({"scan": one})
    assert axes.get_ylabel() == "power spectrum $C_{1D}$ [m$^3$]"
    assert axes.figure.axes[-1].get_ylabel() == "rms slope of the profile up to $q$ [-]"
    surface = one._replace(dimensions=2)
    assert rf.plot.plot_spectrum(surface).get_ylabel() == "power spectrum $C$ [m$^4$]"
    with pytest.raises(ValueError, match=r"^scan is C_1D of profiles, others are C of surfaces: draw its"):
        rf.plot.plot_spectrum({"scan": one, "map": surface})


@pytest.mark.parametrize("power", [1, 4, 8])
def test_every_contour_has_a_label(power):
    """The contours crowd in a corner, the more the higher the power."""
    x = np.linspace(0.0, 1.0, 81)
    axes = Figure().subplots()
    lines = axes.contour(x, x, (np.add.outer(-x, x) / 2 + 0.5) ** power, np.linspace(0.1, 0.9, 9))
    label_contours(axes, lines)
    shown = [level for level, path in zip(lines.levels, lines.get_paths(), strict=True) if len(path.vertices)]
    assert {f"{level:.6g}" for level in shown} == {text.get_text() for text in lines.labelTexts}
    assert len(shown) >= 4
