"""The snippets that read a creep curve and a height map, with files of known moduli and roughness."""

import re
import textwrap
from pathlib import Path

import numpy as np
import pytest
from support.cases.heights import ROLLOFF, self_affine
from support.folders import ROOT

import fitting
import rubberfric as rf

STEPS = (ROOT / "notebooks" / "formats_introduction.md").read_text(encoding="utf-8")
SPECTRA = (ROOT / "notebooks" / "spectra.md").read_text(encoding="utf-8")
H_RMS = 2e-6  # of the map [m]


def run(page, first_words):
    """Run the snippet of a page that has these words, and return its names."""
    snippets = re.findall(r"^ *```python\n(.*?)^ *```", page, re.M | re.S)
    (snippet,) = (text for text in snippets if first_words in text)
    names = {"rf": rf, "fitting": fitting, "np": np}
    exec(textwrap.dedent(snippet), names)
    return names


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_creep_curve():
    """J(t) = 1e-7 + 4e-7 (1 - exp(-t/s)) [1/Pa], so that G* = 1/(1e-7 + 4e-7/(1 + i omega s))."""
    t = np.geomspace(1e-2, 1e2, 81)
    J = 1e-7 - 4e-7 * np.expm1(-t)
    lines = [f"{x!r},{y!r}" for x, y in zip(t.tolist(), J.tolist(), strict=True)]
    Path("creep.csv").write_text("\n".join(["time [s],J(t) [1/Pa]", *lines]) + "\n")
    names = run(STEPS, "creep.csv")
    omega = np.array([0.3, 1.0, 3.0, 10.0])
    exact = 3 / (1e-7 + 4e-7 / (1 + 1j * omega))  # E* = 3 G* for a Poisson ratio of 0.5
    np.testing.assert_allclose(rf.complex_modulus(names["fit"].material, omega), exact, rtol=2e-3)
    moduli = names["moduli"]
    exact = 3 / (1e-7 + 4e-7 / (1 + 1j * moduli.omega))
    np.testing.assert_array_less(
        abs(moduli.storage - exact.real), 3 * moduli.sigma_storage + 1e-3 * exact.real
    )


def written_map():
    """Write a self-affine map in um; its heights [m], and its C(q) for points 1 um apart."""
    heights = self_affine((256, 256), 0.8, H_RMS, 7)
    np.savetxt("map.csv", 1e6 * heights, delimiter=",")
    each = 2 * np.pi * np.fft.fftfreq(256, 1e-6)
    shape = np.maximum(np.hypot(each, each[:, None]), 10 * ROLLOFF) ** -3.6
    scale = H_RMS**2 / (each[1] ** 2 * (shape.sum() - shape[0, 0]))
    return heights, lambda q: scale * q**-3.6


@pytest.mark.slow
@pytest.mark.parametrize(("page", "words"), [(STEPS, "spacing=1e-6"), (SPECTRA, "outliers=10")])
def test_a_height_map(page, words):
    """Wavevectors are ten times those of the surface, whose points are 10 um apart instead of 1 um."""
    heights, C = written_map()
    names = run(page, words)
    np.testing.assert_allclose(names["surface"].heights, heights, rtol=1e-6, atol=1e-12)
    spectrum = names["spectrum"] if "spectrum" in names else names["road"].spectrum
    # A wavevector beyond the roll-off that a tip of 2 um follows; one map has about 600 waves near it.
    assert float(rf.power_spectrum(spectrum, 3e5)) == pytest.approx(C(3e5), rel=0.1)
    assert float(rf.roughness.rms_height(spectrum)) == pytest.approx(H_RMS, rel=0.15)
    if "road" in names:
        assert float(rf.roughness.rms_slope(spectrum)) == pytest.approx(1.3, rel=1e-3)
    else:
        assert float(spectrum.hurst) == pytest.approx(0.8, abs=0.03)
