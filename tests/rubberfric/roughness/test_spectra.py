"""Spectra against their definition in 40 digits."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
import scipy.interpolate
from support.counting.compilations import compilations
from support.oracles.moments import moment_of_plateau, self_affine_moment, table_moment
from support.scenes.examples import EXAMPLES

import rubberfric as rf
from rubberfric.roughness.spectra import Spectrum

SPECTRA = [
    (100.0, 1000.0, 3.1e4, 0.8),
    (100.0, 1000.0, 1e12, 0.8),
    (100.0, 100.0, 3e6, 0.7),
    (100.0, 3e4, 3e4, 0.7),
    (100.0, 100.05, 100.1, 0.6),
    (100.0, 1000.0, 3.1e6, 0.0),
    (100.0, 1000.0, 3.1e6, 1e-12),
    (100.0, 1000.0, 3.1e6, 1e-3),
    (100.0, 1000.0, 3.1e6, 1.0),
    (1e-3, 1e2, 1e10, 0.5),
]
H_RMS = 3e-4


def exact_moment(spectrum, order, C0=None):
    """2 pi int q^(1 + order) C dq; C0 from h_rms unless given."""
    with mp.workdps(40):
        spectrum = [mp.mpf(x) for x in spectrum]
        if C0 is None:
            return self_affine_moment((*spectrum, mp.mpf(H_RMS)), order, spectrum[2])
        return C0 * moment_of_plateau(spectrum, order, spectrum[2])


@pytest.mark.parametrize("spectrum", SPECTRA, ids=str)
@pytest.mark.parametrize("order", [0, 1, 2, 4])
def test_moments(spectrum, order):
    # ln q1 - ln q0 keeps 13 digits of a range of 1.001.
    rel = 2e-13 if spectrum[2] > 2 * spectrum[0] else 2e-12
    exact = float(exact_moment(spectrum, order))
    assert rf.roughness.moment(rf.SelfAffine(*spectrum, H_RMS), order) == pytest.approx(exact, rel=rel)


@pytest.mark.parametrize("spectrum", SPECTRA, ids=str)
def test_values(spectrum):
    q0, qr, q1, hurst = spectrum
    with mp.workdps(40):
        plateau = mp.mpf(H_RMS) ** 2 / exact_moment(spectrum, 0, mp.mpf(1))
        q = [q0 * (1 + 1e-9), 0.7 * q0 + 0.3 * qr, 0.3 * qr + 0.7 * q1, q1 * (1 - 1e-9)]
        q = [x for x in q if q0 < x < q1]
        exact = [float(plateau * min(mp.mpf(1), (mp.mpf(x) / qr) ** (-2 * (1 + mp.mpf(hurst))))) for x in q]
    values = rf.power_spectrum(rf.SelfAffine(*spectrum, H_RMS), np.array(q))
    np.testing.assert_allclose(values, exact, rtol=2e-13)


def test_zero_outside():
    spectrum = rf.SelfAffine(100.0, 1000.0, 3.1e4, 0.8, H_RMS)
    assert (rf.power_spectrum(spectrum, np.array([1e-3, 99.0, 3.2e4, 1e30])) == 0).all()


@pytest.mark.parametrize("spectrum", SPECTRA, ids=str)
def test_from_C0(spectrum):
    C0 = 3e-13
    made = rf.SelfAffine.from_C0(*spectrum, C0)
    assert made.h_rms**2 == pytest.approx(float(exact_moment(spectrum, 0, mp.mpf(C0))), rel=2e-13)
    assert rf.SelfAffine.from_C0(*spectrum, 0.0).h_rms == 0.0


def test_table_is_log_log_linear():
    q, C = np.array([60.0, 150.0, 2e3, 8e5]), np.array([4e-13, 9e-13, 1e-14, 2e-24])
    at = np.array([60.0, 90.0, 150.0, 1e3, 5e4, 7.9e5])
    exact = np.exp(np.interp(np.log(at), np.log(q), np.log(C)))
    table = rf.TabulatedSpectrum(q, C)
    np.testing.assert_allclose(rf.power_spectrum(table, at), exact, rtol=1e-12)
    assert (rf.power_spectrum(table, np.array([59.9, 8.1e5])) == 0).all()


@pytest.mark.parametrize("slope", [-2.0, -4.0, -2.0 + 1e-13, -4.0 + 1e-9])
def test_table_moments_where_the_exponent_vanishes(slope):
    """q C or q^3 C falling like 1/q integrates to a logarithm: 0/0 in the power law's formula."""
    table = rf.TabulatedSpectrum(np.array([1e2, 1e6]), 1e-12 * np.array([1.0, 1e4**slope]))
    for order in (0, 2):
        with mp.workdps(40):
            q, C = ([mp.mpf(float(x)) for x in column] for column in (table.q, table.C))
            exact = table_moment(q, C, order, q[-1])
        assert rf.roughness.moment(table, order) == pytest.approx(float(exact), rel=1e-12)


@pytest.mark.parametrize("spectrum", SPECTRA, ids=str)
def test_gradients_finite(spectrum):
    for order in (0, 2, 4):
        slopes = jax.grad(rf.roughness.moment)(rf.SelfAffine(*spectrum, H_RMS), order)
        assert all(np.isfinite(x) for x in jax.tree.leaves(slopes))


def test_single_precision_with_underflowing_C():
    """C = 1e-39 m^4 at q = 1e9 does not exist in float32; q^2 C does."""
    spectrum = (100.0, 1000.0, 1e9, 0.8)
    single = rf.SelfAffine(*(jnp.float32(x) for x in (*spectrum, H_RMS)))
    law = single.power_law()
    assert {x.dtype for x in law} == {jnp.dtype(jnp.float32)}
    for order in (0, 2):
        assert rf.roughness.moment(single, order) == pytest.approx(
            float(exact_moment(spectrum, order)), rel=1e-5
        )


def test_what_spectra_answer():
    """Isotropic ones have no harmonics, tables have entries, and only what can be cut is cut."""
    affine, table, stretched, directions = (
        EXAMPLES[name] for name in ("SelfAffine", "TabulatedSpectrum", "Anisotropic", "TabulatedAnisotropic")
    )
    assert [one.harmonic_count() for one in (affine, table, stretched, directions)] == [0, 0, 8, 1]
    assert [one.harmonics_vary for one in (stretched, directions)] == [False, True]
    assert [one.endless for one in (affine, table, stretched, directions)] == [True, False, True, False]
    assert affine.entries() is None
    assert directions.entries() is directions.C
    for one in (affine, table, stretched, directions):
        scale, height2 = jax.jit(lambda one: (one.height_scale(), one.power_law().height2))(one)
        assert float(scale) ** 2 == pytest.approx(float(height2))
    assert [float(rf.roughness.harmonics_left_out(one)) for one in (affine, table)] == [0, 0]
    assert rf.rms_slope(rf.with_cutoff(directions, 0.01)) == pytest.approx(0.01, rel=1e-12)
    kinds = "SelfAffine, TabulatedSpectrum, Anisotropic or TabulatedAnisotropic"
    with pytest.raises(ValueError, match=rf"^spectrum is a TabulatedSpectrum: must be {kinds}$"):
        Spectrum.cut(table, 1e-6)  # as of a kind that says nothing of it
    for function in (rf.rms_slope, rf.roughness.harmonics_left_out, rf.with_cutoff):
        with pytest.raises(ValueError, match=r"^spectrum is a Slab: must be SelfAffine, .* or Tabulated"):
            function(rf.Slab(1.0))


@pytest.mark.parametrize(
    "call",
    [
        rf.power_spectrum,
        rf.rms_slope,
        rf.roughness.line_spectrum,
        lambda road, _: rf.with_cutoff(road, 1.3),
        lambda road, _: rf.roughness.cutoff(road, 1.3, keep="h_rms"),
        lambda road, q: rf.roughness.resample(road, q[5:15]),
        lambda _, q: rf.roughness.areal_spectrum(q, 1e-6 * q**-2.5),
        lambda _, q: rf.complex_modulus(rf.Prony(1e6, [1e8, 1e7], [1e-6, 1e-4]), q),
    ],
)
def test_a_call_by_itself_compiles_few_programs(call):
    """One for every operation would be dozens, and seconds before a first picture."""
    road, q = rf.SelfAffine(100.0, 1000.0, 1e5, 0.8, 3e-4), np.geomspace(50.0, 2e5, 20)
    with compilations() as compiled:
        jax.block_until_ready(jax.tree.leaves(call(road, q)))
    assert 0 < len(compiled) <= 3, compiled


@pytest.mark.slow
def test_lists_and_single_precision_are_taken():
    road = rf.SelfAffine(100.0, 1000.0, 1e5, 0.8, 3e-4)
    rubber = rf.Prony(1e6, [1e8], [1e-5], 0.5, rf.WLF(8.0, 99.0, 293.0))
    q, slopes, T = [200, 3000], [1.2, 1.3], [290.0, 300.0]
    for call, given in (
        (lambda x: rf.power_spectrum(road, x), q),
        (lambda x: rf.rms_slope(road, x), q),
        (lambda x: rf.roughness.line_spectrum(road, x), q),
        (lambda x: rf.roughness.cutoff(road, x), slopes),
        (lambda x: rf.roughness.cutoff(road, x, keep="h_rms"), slopes),
        (lambda x: rf.complex_modulus(rubber, [1.0, 10.0], x), T),
    ):
        np.testing.assert_array_equal(call(given), call(np.array(given)))
        np.testing.assert_allclose(call(given)[-1], np.ravel(call(given[-1]))[-1], rtol=1e-14)
    single = jax.tree.map(np.float32, road)
    of_single = (
        rf.rms_slope(single),
        rf.roughness.cutoff(single, 1.3),
        rf.power_spectrum(single, np.float32(200)),
    )
    assert all(found.dtype == np.float32 for found in of_single)


def test_a_grid_is_interpolated_in_all_its_cells():
    """Random ln C on an uneven grid, against SciPy; the last q reaches the last cells."""
    rng = np.random.default_rng(2)
    x, y = (np.sort(np.append(rng.uniform(-12, 12, count), [-12.0, 12.0])) for count in (5, 7))
    log_C = rng.standard_normal((x.size, y.size))
    q, phi = np.array([2.0, 5.0, 12.0]), np.pi * np.arange(8) / 8
    at = np.stack([q[:, None] * np.cos(phi), q[:, None] * np.sin(phi)], -1)
    expected = np.exp(scipy.interpolate.RegularGridInterpolator((x, y), log_C)(at))
    found = rf.roughness.from_grid(x, y, np.exp(log_C), q, phi.size)
    np.testing.assert_allclose(found.C, expected, rtol=1e-12)
