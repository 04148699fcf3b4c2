"""Directions of roughness: harmonics of a stretched surface, tables from grids, moments."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import ROAD
from support.cases.stored import as_arrays

import rubberfric as rf

# Harmonics of the roughness.


def shape(ratio, angle, hurst, phi):
    """D / <D>, with the mean of 20000 directions."""

    def D(phi):
        return (ratio * np.cos(phi - angle) ** 2 + np.sin(phi - angle) ** 2 / ratio) ** -(1 + hurst)

    return D(phi) / np.mean(D(np.pi * np.arange(20000) / 20000))


of_stretched = jax.jit(lambda spectrum: spectrum.harmonics_at(spectrum.base.q0))


@pytest.mark.parametrize("ratio", [1.0, 1 / 3, 2.0, 4.0, 30.0])
def test_harmonics_of_a_stretched_surface(ratio):
    phi = np.pi * np.arange(20000) / 20000
    exact = np.fft.rfft(shape(ratio, 0.4, 0.8, phi)) * 2 / phi.size
    cosine, sine = of_stretched(as_arrays(rf.Anisotropic(ROAD, ratio, 0.4, 64)))
    np.testing.assert_allclose(cosine, exact.real[1:65], atol=1e-13)
    np.testing.assert_allclose(sine, -exact.imag[1:65], atol=1e-13)


def test_harmonics_left_out():
    """The sum of the other harmonics, and the figures of the docstring for 16 and 32."""
    phi = np.pi * np.arange(20000) / 20000
    left_out = jax.jit(rf.roughness.harmonics_left_out)
    for ratio in (0.5, 2.0, 4.0, 10.0):
        size = np.abs(np.fft.rfft(shape(ratio, 0.0, 0.8, phi)))[1:] * 2 / phi.size
        for count in (4, 16):
            found = left_out(as_arrays(rf.Anisotropic(ROAD, ratio, 0.4, count)))
            np.testing.assert_allclose(found, size[count:512].sum(), rtol=1e-6, atol=1e-12)
    assert left_out(as_arrays(rf.Anisotropic(ROAD, 2.0))) < 3e-7
    assert left_out(as_arrays(rf.Anisotropic(ROAD, 4.0, harmonics=32))) < 4e-6
    assert rf.roughness.harmonics_left_out(ROAD) == 0
    table = rf.TabulatedAnisotropic([1e2, 1e4], np.tile(shape(2.0, 0.3, 0.8, phi[::4000]), (2, 1)) * 1e-9)
    assert 0.1 < left_out(table) < 0.8


# Tables from grids.


def test_grid_between_whose_entries_nothing_is_lost():
    """A bilinear ln C is kept; half a plane is enough, the other half is its mirror image."""
    q, x = np.array([10.0, 30.0, 100.0]), np.linspace(-100.0, 100.0, 21)
    y = np.linspace(0.0, 100.0, 6)
    half = np.exp(-20 + 0.01 * x[:, None] + 0.003 * y + 1e-4 * x[:, None] * y)
    phi = np.pi * np.arange(12) / 12
    u, w = q[:, None] * np.cos(phi), q[:, None] * np.sin(phi)
    exact = np.exp(-20 + 0.01 * u + 0.003 * w + 1e-4 * u * w)
    found = rf.roughness.from_grid(x, y, half, q, 12)
    np.testing.assert_allclose(found.C, exact, rtol=1e-13)
    np.testing.assert_array_equal(found.q, q)
    # x >= 0 only, both signs of y: of x < 0 the mirror image.
    other = np.exp(-20 + 0.01 * y[:, None] + 0.003 * x + 1e-4 * y[:, None] * x)
    mirrored = np.where(u < 0, np.exp(-20 - 0.01 * u - 0.003 * w + 1e-4 * u * w), exact)
    np.testing.assert_allclose(rf.roughness.from_grid(y, x, other, q, 12).C, mirrored, rtol=1e-13)


@pytest.mark.parametrize(("ratio", "angle"), [(1.0, 0.0), (2.0, 0.5)])
def test_grid_of_a_known_spectrum(ratio, angle):
    """Second order in the spacing; without directions if the spectrum has none."""
    q, phi = np.array([200.0, 400.0, 900.0]), np.pi * np.arange(33) / 33
    exact = q[:, None] ** -3.6 * shape(ratio, angle, 0.8, phi)

    def error(points):
        x = np.linspace(-1000.0, 1000.0, points)
        size, direction = np.hypot(x[:, None], x), np.arctan2(x, x[:, None])
        C = np.maximum(size, 1.0) ** -3.6 * shape(ratio, angle, 0.8, direction)
        return np.sqrt(np.mean((rf.roughness.from_grid(x, x, C, q, 33).C / exact - 1) ** 2))

    errors = [error(points) for points in (201, 401, 801)]
    assert errors[2] < 5e-4
    assert 10 < errors[0] / errors[2] < 25


GRID = np.array([-2.0, 0.0, 2.0])


from_grid = rf.roughness.from_grid
Table = rf.TabulatedAnisotropic


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: from_grid(GRID, GRID, np.ones((3, 2)), [1.0, 2.0]), r"C has shape \(3, 2\): must be"),
        (lambda: from_grid(GRID, GRID, np.zeros((3, 3)), [1.0, 2.0]), r"must be \(3, 3\), all > 0"),
        (lambda: from_grid(GRID, GRID, np.ones((3, 3)), [1.0, 2.1]), r"q up to 2\.1 1/m: the grid must"),
        (lambda: from_grid(-GRID, GRID, np.ones((3, 3)), [1.0, 2.0]), r"qx\[1\].*must increase strictly"),
        (lambda: from_grid(GRID, GRID, np.ones((3, 3)), [1.0, 2.0], 3), r"directions >= 4"),
        (lambda: rf.Anisotropic(ROAD, 0.0), r"Anisotropic\.ratio = 0\.0: must be > 0"),
        (lambda: rf.Anisotropic(ROAD, 2.0, np.inf), r"Anisotropic\.angle = inf: must be finite"),
        (lambda: rf.Anisotropic(ROAD, 2.0, 0.0, 12), r"Anisotropic\.harmonics = 12: must be one of 4, 8"),
        (
            lambda: rf.Anisotropic(rf.TabulatedSpectrum([1.0, 2.0], [1.0, 1.0]), 2.0),
            r"Anisotropic\.base = .*must be SelfAffine",
        ),
        (lambda: Table([1.0, 2.0], np.ones((2, 3))), r"directions >= 4"),
        (lambda: Table([1.0], np.ones((1, 5))), r"n >= 2"),
        (lambda: Table([2.0, 1.0], np.ones((2, 5))), r"q\[1\] = 1\.0 after 2\.0"),
        (lambda: Table([1.0, 2.0], np.zeros((2, 5))), r"C\[0\]\[0\] = 0\.0: must be > 0"),
        (lambda: Table([1.0, 2.0], np.ones(2)), r"C has shape \(2,\): must be two-dim"),
        (lambda: Table([1.0, 2.0], np.ones((2, 5)), q1=3.0), r"q1 = 3\.0: must lie within the table, 1\.0"),
    ],
)
def test_refused(make, message):
    with pytest.raises(ValueError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


# Moments.


@jax.jit
def moments(spectrum, q):
    found = [rf.roughness.moment(spectrum, order) for order in (0, 2, 4)]
    return (
        *found,
        rf.rms_slope(spectrum, q),
        rf.roughness.rms_height(spectrum, q),
        rf.roughness.cutoff(spectrum, 0.3),
    )


def test_moments_are_those_of_the_mean_over_all_directions():
    q = jnp.array([50.0, 300.0, 1e4, 1e6])
    table_q, C = np.array([1e2, 1e3, 1e4]), np.outer([1e-9, 1e-10, 1e-14], [1.0, 3.0, 2.0, 1.0, 0.5])
    stretched, mean = rf.TabulatedAnisotropic(table_q, C), rf.TabulatedSpectrum(table_q, C.mean(1))
    for one, other in ((rf.Anisotropic(ROAD, 3.0, 0.4), ROAD), (stretched, mean)):
        for x, y in zip(moments(one, q), moments(other, q), strict=True):
            np.testing.assert_allclose(x, y, rtol=1e-13)


@pytest.mark.slow
def test_cutoff_of_a_stretched_surface():
    """Like its base: also beyond its last wavevector, and with a derivative if smooth."""
    stretched = rf.Anisotropic(ROAD, 3.0, 0.4)
    assert rf.roughness.cutoff(stretched, 2.0) == rf.roughness.cutoff(ROAD, 2.0) > ROAD.q1
    cut = rf.with_cutoff(stretched, 0.7)
    assert isinstance(cut, rf.Anisotropic) and (cut.ratio, cut.angle) == (3.0, 0.4)
    assert float(rf.rms_slope(cut)) == pytest.approx(0.7, rel=1e-12)
    np.testing.assert_allclose(rf.power_spectrum(cut, 500.0), rf.power_spectrum(ROAD, 500.0), rtol=1e-12)
    smooth = rf.Anisotropic(dataclasses.replace(ROAD, h_rms=0.0), 3.0)
    slope = jax.jit(jax.grad(rf.rms_slope))(as_arrays(smooth))
    assert np.isfinite(slope.base.h_rms) and slope.base.h_rms > 0
    with pytest.raises(ValueError, match="must be at most"):
        rf.roughness.cutoff(rf.TabulatedAnisotropic([1.0, 2.0], 1e-9 * np.ones((2, 5))))
