"""Normalisations of spectra, and spectra along a line against Abel's integrals in 30 digits."""

import itertools
import re

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
import scipy.integrate

import fitting
import rubberfric as rf
from rubberfric.io.tables import read_table
from rubberfric.roughness.periodograms import bins_before_cliff

TABLE = rf.TabulatedSpectrum([60.0, 150.0, 2e3, 8e5, 8.1e5], [4e-13, 9e-13, 1e-14, 2e-24, 1e-25])
ROAD = rf.SelfAffine(100.0, 1000.0, 3e6, 0.8, 5e-4)
INSIDE = [1e-3, 59.0, 61.0, 100.0, 150.0, 1999.0, 2500.0, 4e5, 7.9e5, 8.0999e5]


def knots(spectrum):
    if isinstance(spectrum, rf.TabulatedSpectrum):
        return np.asarray(spectrum.q).tolist(), np.asarray(spectrum.C).tolist()
    q = [float(x) for x in (spectrum.q0, spectrum.qr, spectrum.q1)]
    C0 = float(rf.power_spectrum(spectrum, q[1] * (1 - 1e-12)))
    return q, [C0, C0, float(C0 * (q[2] / q[1]) ** (-2 * (1 + spectrum.hurst)))]


def exact_line(spectrum, x):
    """2 int C q / sqrt(q^2 - x^2) dq of a log-log linear table, with q = x cosh u."""
    q, C = knots(spectrum)
    with mp.workdps(30):
        x, total = mp.mpf(x), mp.mpf(0)
        for a, b, Ca, Cb in zip(q[:-1], q[1:], C[:-1], C[1:], strict=True):
            a, b, Ca, Cb = (mp.mpf(y) for y in (a, b, Ca, Cb))
            if b <= x:
                continue
            m = mp.log(Cb / Ca) / mp.log(b / a)
            low, high = mp.acosh(max(a, x) / x), mp.acosh(b / x)
            parts = mp.linspace(low, high, int(high - low) + 2)
            total += 2 * mp.quad(lambda u, k=Ca / a**m, m=m: k * (x * mp.cosh(u)) ** (m + 1), parts)
        return total


@pytest.mark.parametrize("spectrum", [TABLE, ROAD], ids=["table", "self-affine"])
def test_line_spectrum(spectrum):
    exact = [float(exact_line(spectrum, x)) for x in INSIDE]
    np.testing.assert_allclose(rf.roughness.line_spectrum(spectrum, np.array(INSIDE)), exact, rtol=2e-13)


@pytest.mark.parametrize("slope", [-20.0, -3.0, -2.0, -1.0, 0.0, 1.0, 3.0, 20.0])
def test_line_spectrum_of_any_slope(slope):
    """Powers whose series has a term 1/q, and scatter of measured tables."""
    steep = rf.TabulatedSpectrum([100.0, 900.0], [1e-12, 1e-12 * 9.0**slope])
    x = np.array([1.0, 90.0, 120.0, 500.0])
    exact = [float(exact_line(steep, y)) for y in x]
    np.testing.assert_allclose(rf.roughness.line_spectrum(steep, x), exact, rtol=1e-12)


def test_line_spectrum_outside():
    assert rf.roughness.line_spectrum(ROAD, 3.1e6) == 0.0
    # C_1D(0) = 2 int C dq
    _, C = knots(ROAD)
    m = 2 * (1 + 0.8)
    limit = 2 * C[0] * (900.0 + 1000.0 / (m - 1) * (1 - 3000.0 ** (1 - m)))
    np.testing.assert_allclose(
        rf.roughness.line_spectrum(ROAD, np.array([1e-250, 1e-30, 1e-6])), limit, rtol=1e-10
    )


def test_both_have_one_mean_square_height():
    """2 int C_1D dq by tanh-sinh rules, which stand the roots at the ends of the pieces."""
    s = np.linspace(-3.2, 3.2, 161)
    place = 0.5 * (1 + np.tanh(np.pi / 2 * np.sinh(s)))
    weight = 0.04 * np.pi / 4 * np.cosh(s) / np.cosh(np.pi / 2 * np.sinh(s)) ** 2
    x, dx = [60 * place], [60 * weight]
    for a, b in itertools.pairwise([60.0, 150.0, 2e3, 8e5, 8.1e5]):
        x.append(a * (b / a) ** place)
        dx.append(x[-1] * np.log(b / a) * weight)
    total = 2 * np.sum(
        np.concatenate(dx) * rf.roughness.line_spectrum(TABLE, np.maximum(np.concatenate(x), 1e-30))
    )
    np.testing.assert_allclose(total, rf.roughness.moment(TABLE, 0), rtol=1e-10)


@pytest.mark.slow
def test_line_spectrum_derivatives():
    """In every leaf and in q, both modes, against 30-digit differences."""
    x = 700.0
    leaves = [float(a) for a in jax.tree.leaves(ROAD)]

    def exact(values):
        with mp.workdps(30):
            q0, qr, q1, H, h = (mp.mpf(a) for a in values[:5])
            area = mp.pi * qr**2 * (1 - (q0 / qr) ** 2 + (1 - (q1 / qr) ** (-2 * H)) / H)
            C0, y = h**2 / area, mp.mpf(values[5])

            def fall(q):
                return C0 * q / mp.sqrt(q * q - y * y) * (q / qr) ** (-2 * (1 + H))

            return 2 * (
                C0 * mp.sqrt(qr**2 - y**2)
                + mp.quad(fall, [qr * (q1 / qr) ** (mp.mpf(i) / 12) for i in range(13)])
            )

    values = [mp.mpf(a) for a in (*leaves, x)]
    np.testing.assert_allclose(rf.roughness.line_spectrum(ROAD, x), float(exact(values)), rtol=1e-13)
    by_spectrum, by_q = jax.jit(jax.grad(rf.roughness.line_spectrum, (0, 1)))(ROAD, x)
    forward_spectrum, forward_q = jax.jit(jax.jacfwd(rf.roughness.line_spectrum, (0, 1)))(ROAD, x)
    ours = [*jax.tree.leaves(by_spectrum), by_q]
    np.testing.assert_allclose([*jax.tree.leaves(forward_spectrum), forward_q], ours, rtol=1e-11)
    for i, slope in enumerate(ours):
        with mp.workdps(30):
            step = values[i] * mp.mpf(10) ** -8
            up, down = (exact([v + s * (k == i) for k, v in enumerate(values)]) for s in (step, -step))
            difference = (up - down) / (2 * step)
        scale = float(exact(values) / values[i])
        np.testing.assert_allclose(slope / scale, float(difference) / scale, rtol=1e-9, atol=1e-13)


@pytest.mark.slow
def test_gradients_are_finite_everywhere():
    x = np.array([1e-30, 99.0, 150.0, 1999.999, 2500.0, 8.05e5, 9e5, 1e30])
    for spectrum in (TABLE, ROAD):
        slopes = jax.jit(jax.grad(lambda s, x: jnp.sum(rf.roughness.line_spectrum(s, x)), (0, 1)))(
            spectrum, x
        )
        for leaf in jax.tree.leaves(slopes):
            assert np.isfinite(leaf).all()
    assert np.isfinite(
        jax.jit(jax.jacrev(lambda C: rf.roughness.areal_spectrum(np.asarray(TABLE.q), C).C))(TABLE.C)
    ).all()


def test_single_precision():
    single = jax.tree.map(jnp.float32, rf.SelfAffine(100.0, 1000.0, 1e9, 0.8, 5e-4))
    double = rf.SelfAffine(100.0, 1000.0, 1e9, 0.8, 5e-4)
    x = np.array([1.0, 500.0, 3e4, 1e8])
    found = rf.roughness.line_spectrum(single, jnp.float32(x))
    assert found.dtype == jnp.float32
    np.testing.assert_allclose(found, rf.roughness.line_spectrum(double, x), rtol=2e-5)


@pytest.mark.parametrize("hurst", [0.1, 0.83, 1.0])
def test_a_power_law_is_a_factor(hurst):
    """C_1D = int C dqy of C = q^-2(1+H) by scipy, and back by the inversion and the factor."""
    q = np.geomspace(1e2, 1e6, 30)
    C = 1e-6 * q ** (-2 * (1 + hurst))
    half = scipy.integrate.quad(lambda s: (1 + s * s) ** (-1 - hurst), 0, np.inf, epsabs=0, epsrel=1e-13)[0]
    line = 2e-6 * half * q ** (-1 - 2 * hurst)
    np.testing.assert_allclose(rf.roughness.spectrum_from("C_1D", q, line, hurst), C, rtol=1e-11)
    np.testing.assert_allclose(
        rf.roughness.spectrum_from("C_1D_surfacetopography", q, 2 * np.pi * line, hurst), C, rtol=1e-11
    )
    np.testing.assert_allclose(rf.roughness.areal_spectrum(q, line).C, C, rtol=1e-11)
    beyond = rf.roughness.areal_spectrum(q, line, at=1.1 * q).C
    np.testing.assert_allclose(beyond, C * 1.1 ** (-2 - 2 * hurst), rtol=1e-11)


def test_round_trip_and_what_the_factor_does_at_the_ends():
    surface = rf.SelfAffine(100.0, 1000.0, 1e12, 0.8, 5e-4)
    q = np.geomspace(10.0, 1e10, 91)
    line = rf.roughness.line_spectrum(surface, q)
    at = np.array([150.0, 400.0, 1500.0, 1e4, 1e7])
    error = np.abs(rf.roughness.areal_spectrum(q, line, at=at).C / rf.power_spectrum(surface, at) - 1)
    # The roll-off is an entry, and C below the end q0 = 100 of the surface, another entry, decreases to 0.
    assert error.max() < 1e-6 and (error[2:] < 1e-9).all()
    with pytest.warns(UserWarning, match="roll-off"):
        factor = rf.roughness.spectrum_from("C_1D", q, line, 0.8)
    ratio = np.asarray(factor / rf.power_spectrum(surface, q))
    assert ratio[np.searchsorted(q, 199.0)] > 3
    np.testing.assert_allclose(ratio[(q > 1e3) & (q < 1e8)], 1, rtol=1e-10)
    cut = rf.SelfAffine(100.0, 1000.0, 1e6, 0.8, 5e-4)
    near_end = rf.roughness.spectrum_from(
        "C_1D", 9e5, rf.roughness.line_spectrum(cut, 9e5), 0.8
    ) / rf.power_spectrum(cut, 9e5)
    assert near_end == pytest.approx(0.500, abs=0.001)


@pytest.mark.parametrize("name", ["C", "C_iso", "C_1D", "C_1D_surfacetopography"])
def test_there_and_back(name):
    q, C = np.asarray(TABLE.q), np.asarray(TABLE.C)
    hurst = 0.7 if "1D" in name else None
    values = rf.roughness.spectrum_as(name, q, C, hurst)
    np.testing.assert_allclose(rf.roughness.spectrum_from(name, q, values, hurst), C, rtol=1e-14)
    gamma = float(mp.sqrt(mp.pi) * mp.gamma(1.2) / mp.gamma(1.7))
    ratio = {
        "C": 1.0,
        "C_iso": 4 * np.pi**2,
        "C_1D": gamma * q,
        "C_1D_surfacetopography": 2 * np.pi * gamma * q,
    }
    np.testing.assert_allclose(values / C, ratio[name] * np.ones(5), rtol=1e-13)


def test_conversion_is_traced():
    slope = jax.jit(jax.grad(lambda H: rf.roughness.spectrum_from("C_1D", 1e3, 1e-13, H)))(0.8)
    with mp.workdps(30):
        exact = mp.diff(
            lambda H: mp.mpf("1e-16") * mp.gamma(1 + H) / mp.gamma(H + mp.mpf("0.5")), 0.8
        ) / mp.sqrt(mp.pi)
    np.testing.assert_allclose(slope, float(exact), rtol=1e-12)


from_name = rf.roughness.spectrum_from


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: from_name("c", 1.0, 1.0), "normalisation = 'c': must be \"C\""),
        (lambda: from_name("C_1D", 1.0, 1.0), "hurst is missing: must be given, 0 ... 1"),
        (lambda: from_name("C_1D", 1.0, 1.0, 1.2), "hurst = 1.2: must be between 0.0 and 1.0"),
        (lambda: rf.roughness.spectrum_as("C_iso", 1.0, 1.0, 0.8), "hurst = 0.8: must be absent"),
        (lambda: rf.roughness.line_spectrum(ROAD, 0.0), "q = 0.0: must be > 0"),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        call()
    assert "\n" not in str(error.value)


SCENE = """
lower.material = {{ kind = "elastic", young = 1e6, poisson = 0.5 }}
[upper]
material = {{ kind = "rigid" }}
spectrum = {{ kind = "tabulated", file = "s.csv", normalisation = "{}"{} }}
"""


def scene_of(folder, table, normalisation, more=""):
    (folder / "s.csv").write_text(table)
    (folder / "s.toml").write_text(SCENE.format(normalisation, more))
    return rf.load_scene(folder / "s.toml").upper.spectrum


def test_scene_files(tmp_path):
    logs = "log10_q,log10_C\nlog10(1/um),log10(um^4)\n-4,8\n-3,8\n0,-2.8\n"
    found = scene_of(tmp_path, logs, "C_iso")
    np.testing.assert_allclose(found.q, [1e2, 1e3, 1e6], rtol=1e-13)
    np.testing.assert_allclose(found.C, 10.0 ** np.array([-16, -16, -26.8]) / (4 * np.pi**2), rtol=1e-13)
    line = "q,C_1D\n1/mm,um^3\n1,1000\n1000,0.01\n"
    found = scene_of(tmp_path, line, "C_1D_surfacetopography", ", hurst = 0.8")
    C = rf.roughness.spectrum_from("C_1D", np.array([1e3, 1e6]), np.array([1e-15, 1e-20]) / (2 * np.pi), 0.8)
    np.testing.assert_allclose(found.C, C, rtol=1e-13)
    np.testing.assert_allclose(
        read_table(tmp_path / "s.csv", ("q", "C_1D"))["C_1D"], [1e-15, 1e-20], rtol=1e-15
    )


@pytest.mark.parametrize(
    ("table", "normalisation", "more", "message"),
    [
        ("q,C\n1/m,m^4\n1,1\n2,1\n", "C_1D", "", "column 'C': must be one of q, log10_q, C_1D"),
        ("q,C_1D\n1/m,m^3\n1,1\n2,1\n", "C_1D", "", "C_1D[-1] = 1: must be below the largest entry"),
        ("q,C_1D\n1/m,m^4\n1,1\n2,1\n", "C_1D", ", hurst = 0.8", "column C_1D: unit 'm^4': must be one of"),
        ("q,C_1D\n1/m,m^3\n1,1\n2,1\n", "C_1D", ", hurst = 2", "upper.spectrum.hurst = 2.0: must be between"),
        ("q,log10_C\n1/m,m^4\n1,1\n2,1\n", "C", "", "unit 'm^4': must be one of log10(m^4)"),
        ("log10_q,C\nlog10(1/m),m^4\n2,1\n1,1\n", "C", "", "log10_q = 1 after 2: must increase strictly"),
    ],
)
def test_scene_files_refused(tmp_path, table, normalisation, more, message):
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        scene_of(tmp_path, table, normalisation, more)
    assert "\n" not in str(error.value)


def test_measured_data_in_another_normalisation(tmp_path):
    path = tmp_path / "measured.csv"
    path.write_text("q,C,sigma_C\n1/m,m^4,m^4\n1e2,1e-12,1e-13\n1e4,1e-18,1e-19\n")
    data = fitting.read(path, normalisation="C_iso")
    np.testing.assert_allclose(data.C, np.array([1e-12, 1e-18]) / (4 * np.pi**2), rtol=1e-14)
    np.testing.assert_allclose(data.sigma, data.C / 10, rtol=1e-14)
    path.write_text("# normalisation C_iso\n" + path.read_text())
    np.testing.assert_array_equal(fitting.read(path).C, data.C)
    np.testing.assert_array_equal(fitting.read(path, normalisation="C").C, [1e-12, 1e-18])
    path.write_text("log10_q,log10_C\nlog10(1/m),log10(m^4)\n2,-12\n4,-18\n")
    np.testing.assert_allclose(fitting.read(path, normalisation="C").C, [1e-12, 1e-18], rtol=1e-13)
    path.write_text("log10_q,C_1D,relative_sigma\nlog10(1/m),m^3,%\n2,1e-10,3\n4,1e-16,3\n")
    data = fitting.read(path, normalisation="C_1D", hurst=0.8, body="lower")
    np.testing.assert_allclose(
        data.C, rf.roughness.spectrum_from("C_1D", data.q, np.array([1e-10, 1e-16]), 0.8), rtol=1e-13
    )
    np.testing.assert_allclose(data.relative, 0.03)
    # A power law without ends has one H, here (3 - 1)/2, and Abel's transform is the factor.
    expected = rf.roughness.spectrum_from("C_1D", data.q, np.array([1e-10, 1e-16]), 1.0)
    np.testing.assert_allclose(fitting.read(path, normalisation="C_1D").C, expected, rtol=1e-10)
    for given, message in (
        ({}, "measured.csv: normalisation is missing: must be"),
        ({"normalisation": "C"}, "column 'C_1D': must be one of q, log10_q, C, log10_C"),
        ({"hurst": 0.8, "normalisation": "C_iso"}, "hurst = 0.8: must be absent"),
    ):
        with pytest.raises(ValueError, match=re.escape(message)) as error:
            fitting.read(path, **given)
        assert "\n" not in str(error.value)
    path.write_text("v,mu,p\nm/s,-,Pa\n1,1,1e5\n")
    with pytest.raises(ValueError, match="normalisation = 'C': must not be given; it is for CSV spectra"):
        fitting.read(path, normalisation="C")


def test_rounding_errors_behind_the_end_of_a_spectrum_are_left_out():
    """As in a window of a surface whose spectrum ends within the bins."""
    q = np.geomspace(1e3, 2e5, 24)
    C = 1e-14 * (q / 1e3) ** -3.6
    C[20:] = C[19] * np.array([5e-3, 1e-11, 5e-12, 4e-12])
    assert bins_before_cliff(q, C) == 20
    # Noise of a few modes, which C exceeds again, is no end.
    C = 1e-14 * (q / 1e3) ** -3.6
    C[3] *= 1e-4
    assert bins_before_cliff(q, C) == q.size
