"""Topography objects of SurfaceTopography, and stand-ins with the same attributes."""

import re
from types import SimpleNamespace

import jax
import numpy as np
import pytest

import rubberfric as rf

RNG = np.random.default_rng(5)
MAP = RNG.normal(size=(16, 12))
LINE = RNG.normal(size=32)


def surface(heights, sizes, unit="um", **more):
    """Attributes that `spectrum_of_surface` needs."""
    heights = np.ma.asarray(heights) if np.ma.isMA(heights) else np.asarray(heights)
    return SimpleNamespace(
        heights=lambda: heights, physical_sizes=sizes, nb_grid_pts=heights.shape, unit=unit, **more
    )


def equal(found, expected, rtol=1e-12):
    assert jax.tree.structure(found) == jax.tree.structure(expected)
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(a, b, rtol=rtol)


@pytest.mark.parametrize(
    ("unit", "scale"), [("m", 1), ("mm", 1e-3), ("um", 1e-6), ("\u00b5m", 1e-6), ("nm", 1e-9)]
)
def test_units_of_lengths_and_heights(unit, scale):
    expected = rf.roughness.spectrum_of_topography(MAP * scale, 2 * scale / 16, 3 * scale / 12)
    equal(rf.roughness.spectrum_of_surface(surface(MAP, (2.0, 3.0), unit)), expected)
    equal(rf.roughness.spectrum_of_surface(surface(MAP, (2.0, 3.0), None), unit=unit), expected)
    expected = rf.roughness.spectrum_of_profile(5 * scale / 32, LINE * scale, per_decade=None)
    equal(rf.roughness.spectrum_of_surface(surface(LINE, (5.0,), unit), per_decade=None), expected)


def test_a_periodic_surface_needs_no_window():
    expected = rf.roughness.spectrum_of_topography(MAP * 1e-6, 1e-6, window="none", detrend=0)
    periodic = surface(MAP, (16.0, 12.0), is_periodic=True, is_uniform=True)
    equal(rf.roughness.spectrum_of_surface(periodic), expected)
    expected = rf.roughness.spectrum_of_topography(MAP * 1e-6, 1e-6, window="hann", detrend=2)
    equal(rf.roughness.spectrum_of_surface(periodic, window="hann", detrend=2), expected)


HOLES = np.ma.masked_array(MAP, mask=MAP > 1)


of_surface = rf.roughness.spectrum_of_surface


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: of_surface(MAP), "topography is a ndarray without heights; pass a Surf"),
        (lambda: of_surface(surface(MAP, (1.0, 1.0), None)), "unit is missing and the topography has none"),
        (lambda: of_surface(surface(MAP, (1.0, 1.0), "inch")), "unit = 'inch': must be one of m, "),
        (lambda: of_surface(surface(MAP, (1.0, 1.0)), unit="nm"), "unit = 'nm': leave it out; the"),
        (lambda: of_surface(surface(HOLES, (1.0, 1.0))), "has undefined points; fill them in first"),
        (lambda: of_surface(surface(LINE, (1.0,), is_uniform=False)), "has unevenly spaced points"),
        (lambda: of_surface(surface(MAP, (1.0,))), "must have equal numbers of entries, 1 or 2"),
        (lambda: of_surface(surface(MAP, (1.0, 1.0)), window="kaiser"), "must be one of hann"),
        (lambda: rf.roughness.spectrum_from("C", HOLES[0], HOLES[0]), "q has masked entries: must have none"),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        call()
    assert "\n" not in str(error.value)


def test_surface_topography_itself():
    """Objects, and the spectra it makes of them: every mode of a periodic line."""
    library = pytest.importorskip("SurfaceTopography")
    line = library.UniformLineScan(LINE - LINE.mean(), 5.0, unit="nm", periodic=True)
    found = rf.roughness.spectrum_of_surface(line, per_decade=None)
    q, C = line.power_spectrum_from_profile(resampling_method=None, window="None")
    kept = q > 0
    q, C = np.asarray(q[kept]) * 1e9, np.asarray(C[kept]) * 1e-27
    # It leaves out the shortest wave, of two points. C_1D of here is theirs over 2 pi.
    np.testing.assert_allclose(found.q[:-1], q, rtol=1e-12)
    np.testing.assert_allclose(found.C[:-1], C / (2 * np.pi), rtol=1e-9)
    np.testing.assert_allclose(
        rf.roughness.spectrum_from("C_1D_surfacetopography", q, C),
        rf.roughness.spectrum_from("C_1D", found.q[:-1], found.C[:-1]),
        rtol=1e-7,
    )
    area = library.Topography(MAP, (2.0, 3.0), unit="mm")
    expected = rf.roughness.spectrum_of_topography(MAP * 1e-3, 2e-3 / 16, 3e-3 / 12)
    equal(rf.roughness.spectrum_of_surface(area), expected)
