"""Files of spectra in the normalisations of other programs, from the definition of each density."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad

import fitting
import rubberfric as rf

# A broken power law with h_rms = 10 um, which is written out here.
Q0, QR, Q1, H, RMS = 1e3, 5e3, 1e6, 0.8, 1e-5


def areal(q):
    """C [m^4] up to a factor."""
    return np.where((q < Q0) | (q > Q1), 0.0, np.minimum(1.0, (np.maximum(q, QR) / QR) ** (-2 * (1 + H))))


C0 = RMS**2 / (2 * np.pi * np.trapezoid((q := np.geomspace(Q0, Q1, 200_001)) * areal(q), q))


def along_a_line(q):
    """C_1D [m^3] = int C(sqrt(q^2 + y^2)) dy, two-sided."""
    ends = [0.0, max(QR**2 - q**2, 0.0) ** 0.5, max(Q1**2 - q**2, 0.0) ** 0.5]
    pieces = [
        quad(
            lambda t: areal(np.hypot(q, np.sinh(t) * q)) * np.cosh(t) * q,
            *np.arcsinh([a / q, b / q]),
            limit=200,
        )[0]
        for a, b in itertools.pairwise(ends)
        if b > a
    ]
    return 2 * C0 * sum(pieces)


Q = np.geomspace(Q0, 0.98 * Q1, 80)
LINE = np.array([along_a_line(q) for q in Q])
# name -> axis, density, and the mean square height by trapezoids over the axis, as in its definition
DENSITIES = {
    "C": (Q, C0 * areal(Q), lambda x, y: 2 * np.pi * np.trapezoid(x * y, x)),
    "C_iso": (Q, 4 * np.pi**2 * C0 * areal(Q), lambda x, y: np.trapezoid(x * y, x) / (2 * np.pi)),
    "Wr": (Q, 2 * np.pi * Q * C0 * areal(Q), lambda x, y: np.trapezoid(y, x)),
    "q_C_iso_over_pi": (Q, 4 * np.pi * Q * C0 * areal(Q), lambda x, y: np.trapezoid(y, x) / 2),
    "C_1D": (Q, LINE, lambda x, y: 2 * np.trapezoid(y, x)),
    "C_1D_surfacetopography": (Q, 2 * np.pi * LINE, lambda x, y: np.trapezoid(y, x) / np.pi),
    "C_1D_one_sided": (Q, 2 * LINE, lambda x, y: np.trapezoid(y, x)),
    "W1": (Q, 2 * LINE, lambda x, y: np.trapezoid(y, x)),
    "ISO_8608": (Q / (2 * np.pi), 4 * np.pi * LINE, lambda x, y: np.trapezoid(y, x)),
    # over cycles/m, under the names of the densities over q that have the same numbers
    "C_iso over n": (
        Q / (2 * np.pi),
        4 * np.pi**2 * C0 * areal(Q),
        lambda x, y: 2 * np.pi * np.trapezoid(x * y, x),
    ),
    "C_1D_surfacetopography over n": (Q / (2 * np.pi), 2 * np.pi * LINE, lambda x, y: 2 * np.trapezoid(y, x)),
}


def written(path, head, name):
    x, y, _ = DENSITIES[name]
    path.write_text(head + "\n" + "".join(f"{a:.9g},{b:.9g}\n" for a, b in zip(x, y, strict=True)))
    return path


def rms(data):
    return float(rf.roughness.rms_height(rf.TabulatedSpectrum(data.q, data.C)))


@pytest.mark.parametrize(
    ("head", "name", "given"),
    [
        ("q,C\n1/m,m^4", "C", True),
        ("q,C\n1/m,m^4", "C_iso", True),
        ("q,C_1D\n1/m,m^3", "C_1D", True),
        ("q,C_1D\n1/m,m^3", "C_1D_one_sided", True),
        ("q,C_1D\n1/m,m^3", "C_1D_surfacetopography", True),
        ("k [1/m],W1 [m^3]", "W1", False),
        ("k [rad/m],W1 [m^3]", "C_1D_one_sided", True),
        ("q,C_1D\n1/m,m^3", "Wr", True),
        ("k [1/m],Wr [m^3]", "Wr", False),
        ("q,C_1D\n1/m,m^3", "q_C_iso_over_pi", True),
        ("Wavevector [1/m],q/\u03c0 \u00d7 2D PSD [m³]", "q_C_iso_over_pi", False),
        ("q (1/m),1D PSD along x (m³)", "C_1D_surfacetopography", False),
        ("ISO 8608; class C\n\nn [cycles/m],C_1D [m^3]", "ISO_8608", False),
        ("# after ISO/TS 13473-4\nn,C_1D\ncycles/m,m^3", "ISO_8608", False),
        ("n,C\ncycles/m,m^4", "C_iso over n", True),
        ("n,C_1D\ncycles/m,m^3", "C_1D_surfacetopography over n", True),
        ("n [cycles/m],Gd [m^3]", "ISO_8608", False),
        ("Spatial frequency n [cycles/m],PSD Gd(n) [m^3]", "ISO_8608", False),
        ("n [1/m],G_d(n) [m³]", "ISO_8608", False),
        ("spatial frequency [cycles/m],C_1D [m^3]", "ISO_8608", True),
        ("n,C_1D\ncycles/m,m^3", "ISO_8608", True),
        ("wavenumber [1/m],C_1D [m^3]", "ISO_8608", True),
        ("wavenumber [cycles/m],C_1D [m^3]", "ISO_8608", True),
        ("wavenumber [1/m],C_1D [m^3]", "W1", True),
        ("wavenumber [rad/m],C_1D [m^3]", "C_1D", True),
        ("Wellenzahl [rad/m],C [m^4]", "C", True),
    ],
)
def test_each_density_gives_its_height(tmp_path, head, name, given):
    """The trapezoid of the column is the mean square height of the waves above q0; files follow it."""
    x, y, mean_square = DENSITIES[name]
    on_line = not name.startswith(("C_iso", "Wr", "q_C")) and name != "C"
    # Along a line, some of the height is at q < q0.
    assert np.sqrt(mean_square(x, y)) == pytest.approx(RMS, rel=0.1 if on_line else 0.01)
    options = {"normalisation": name.removesuffix(" over n")} if given else {}
    data = fitting.read(written(tmp_path / "s.csv", head, name), **options)
    np.testing.assert_allclose(data.q, Q, rtol=1e-8)
    assert rms(data) == pytest.approx(RMS, rel=0.02)
    near = (Q < 2e5) & (np.abs(np.log(Q / QR)) > 0.3)
    np.testing.assert_allclose(data.C[near], C0 * areal(Q[near]), rtol=0.05)


# A table with entries at all kinks.
KNOTS = np.unique(np.append(np.geomspace(Q0, Q1, 41), QR))
FACTORS = {"C": 1.0, "C_iso": 4 * np.pi**2, "Wr": 2 * np.pi * KNOTS, "q_C_iso_over_pi": 4 * np.pi * KNOTS}


@pytest.mark.parametrize("name", FACTORS)
def test_round_trip_of_areal_densities(tmp_path, name):
    values = FACTORS[name] * C0 * areal(KNOTS)
    column = ",C_1D\n1/m,m^3\n" if np.ndim(FACTORS[name]) else ",C\n1/m,m^4\n"
    rows = "".join(f"{float(a)!r},{float(b)!r}\n" for a, b in zip(KNOTS, values, strict=True))
    (tmp_path / "s.csv").write_text("q" + column + rows)
    data = fitting.read(tmp_path / "s.csv", normalisation=name)
    np.testing.assert_allclose(rf.roughness.spectrum_as(name, data.q, data.C), values, rtol=1e-12)
    np.testing.assert_allclose(data.C, C0 * areal(KNOTS), rtol=1e-12)


LINES = ["C_1D", "C_1D_one_sided", "C_1D_surfacetopography", "W1", "ISO_8608"]


def test_round_trip_along_a_line():
    """`spectrum_as` writes the projection of a table that goes on, and `spectrum_from` reads it back."""
    surface = C0 * areal(KNOTS[:-1])
    names = {name: rf.roughness.spectrum_as(name, KNOTS[:-1], surface) for name in LINES}
    # C_1D by quadrature, with the last slope beyond the table
    for i in (0, 10, 25):
        q = KNOTS[i]
        parts = sorted({0.0, float(np.arccosh(max(QR / q, 1.0))), 3.0, 6.0, 14.0})

        def integrand(u, q=q):
            x = q * np.cosh(u)
            return 2 * C0 * x * min(1.0, (max(x, QR) / QR) ** (-2 * (1 + H)))

        exact = sum(quad(integrand, a, b, epsabs=0, epsrel=1e-10)[0] for a, b in itertools.pairwise(parts))
        assert float(names["C_1D"][i]) == pytest.approx(exact, rel=1e-8)
    for name, factor in zip(LINES, (1, 2, 2 * np.pi, 2, 4 * np.pi), strict=True):
        np.testing.assert_allclose(names[name], factor * names["C_1D"], rtol=1e-14)
    read = rf.roughness.spectrum_from("W1", KNOTS[:-1], names["W1"], relative=1e-7)
    np.testing.assert_allclose(read, surface, rtol=1e-6)


def test_heights_of_all_normalisations():
    """The trapezoid of each column is the height under its name; others differ by sqrt(2) and more."""
    for name in ("C", "C_iso", "Wr", "q_C_iso_over_pi", "W1", "ISO_8608"):
        x, y, mean_square = DENSITIES[name]
        inside = y > 0
        heights = rf.roughness.heights_by_normalisation(Q[inside], y[inside])
        assert heights[name] == pytest.approx(np.sqrt(mean_square(x, y)), rel=0.02)
        best = min(heights, key=lambda other: abs(np.log(heights[other] / RMS)))
        assert best == name or heights[best] == heights[name]
    assert heights["C_1D_one_sided"] == heights["W1"]
    assert heights["C_1D"] == pytest.approx(np.sqrt(2) * heights["W1"])


@pytest.mark.parametrize("first", ["q_C_iso_over_pi", "C_1D_surfacetopography"])
def test_a_text_of_contact_engineering(tmp_path, first):
    """Several series of one surface in micrometres; the first one is read, and a warning names the others."""
    series = {"q_C_iso_over_pi": "q/\u03c0 \u00d7 2D PSD", "C_1D_surfacetopography": "1D PSD along x"}
    text = "# Power-spectral density (PSD)\n# ====\n\n# Further arguments of analysis function: {}\n\n"
    for name in sorted(series, reverse=first.startswith("q")):
        x, y, _ = DENSITIES[name]
        title = series[name]
        text += f"# {title}\n# {'-' * len(title)}\n# Columns: Wavevector (µm⁻¹), PSD (µm³)\n"
        text += "".join(f"{1e-6 * a:.9e} {1e18 * b:.9e}\n" for a, b in zip(x, y, strict=True)) + "\n"
    (tmp_path / "psd.txt").write_text(text, encoding="utf-8")
    others = [title for name, title in series.items() if name != first]
    with pytest.warns(UserWarning, match=f"the first of 2 series; the others are '{others[0]}'"):
        data = fitting.read(tmp_path / "psd.txt")
    assert data.q.size == Q.size and rms(data) == pytest.approx(RMS, rel=0.02)
    with (
        pytest.warns(UserWarning, match="the first of 2 series"),
        pytest.raises(ValueError, match="leave the"),
    ):
        fitting.read(tmp_path / "psd.txt", normalisation="C_1D")


def test_density_of_a_scene_file(tmp_path):
    written(tmp_path / "s.csv", "n [cycles/m],Gd [m^3]", "ISO_8608")
    text = """[lower]
material = { kind = "rigid" }
spectrum = { kind = "tabulated", file = "s.csv", normalisation = "ISO_8608" }
[upper]
material = { kind = "elastic", young = 1e7, poisson = 0.5 }
"""
    (tmp_path / "scene.toml").write_text(text)
    scene = rf.load_scene(tmp_path / "scene.toml")
    assert float(rf.roughness.rms_height(scene.lower.spectrum)) == pytest.approx(RMS, rel=0.02)


@pytest.mark.parametrize(
    ("head", "normalisation", "messages"),
    [
        ("wavenumber [1/m],C_1D [m^3]", "C_1D", ("2 pi / wavelength or 1 / wavelength", "rad/m or cycles/m")),
        ("Wellenzahl [1/mm],C [m^4]", "C", ("2 pi / wavelength or 1 / wavelength",)),
        ("n [cycles/m],C_1D [m^3]", "C_1D", ("C_1D_surfacetopography", "ISO_8608", "over cycles/m")),
        ("n [cycles/m],C_1D [m^3]", "W1", ("ISO_8608", "over cycles/m")),
        ("n [cycles/m],C [m^4]", "C", ("C_iso",)),
        ("q [rad/m],Gd [m^3]", None, ("C_1D_one_sided", "n [cycles/m]")),
        ("k [1/m],W1 [m^3]", "C_1D", ('"W1"', "leave the argument out")),
        ("n [cycles/m],Gd [m^3]", "C_1D", ('"ISO_8608"',)),
        ("q [1/m],C_1D [m^3]", None, ("normalisation is missing",)),
        ("ISO 8608\n\nq [1/m],C_1D [m^3]", None, ("C_1D_one_sided", "n [cycles/m]")),
        ("q [1/m],C_1D [m^3]", "W2", ("ISO_8608", "Wr")),
        ("wavenumber [1/m],C_1D [m^4]", "ISO_8608", ("C_1D", "unit 'm^4'")),
    ],
)
def test_contradictions_are_refused(tmp_path, head, normalisation, messages):
    path = written(tmp_path / "s.csv", head, "W1")
    with pytest.raises(ValueError, match=r"must|leave") as error:
        fitting.read(path, normalisation=normalisation, kind="spectrum")
    assert all(text in str(error.value) for text in messages) and "\n" not in str(error.value)


def test_noise_along_a_line_gives_no_negative_entry(tmp_path):
    """Noise of 50 % per entry; most of the height is in few of them."""
    noisy = LINE * np.exp(0.5 * np.random.default_rng(1).standard_normal(Q.size))
    rows = "".join(f"{a:.9g},{b:.9g}\n" for a, b in zip(Q, noisy, strict=True))
    (tmp_path / "s.csv").write_text("q,C_1D\n1/m,m^3\n" + rows)
    data = fitting.read(tmp_path / "s.csv", normalisation="C_1D")
    assert np.all(data.C > 0) and rms(data) == pytest.approx(RMS, rel=0.25)
