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
    "C_1D": (Q, LINE, lambda x, y: 2 * np.trapezoid(y, x)),
    "C_1D_surfacetopography": (Q, 2 * np.pi * LINE, lambda x, y: np.trapezoid(y, x) / np.pi),
    "C_1D_one_sided": (Q, 2 * LINE, lambda x, y: np.trapezoid(y, x)),
    "W1": (Q, 2 * LINE, lambda x, y: np.trapezoid(y, x)),
    "ISO_8608": (Q / (2 * np.pi), 4 * np.pi * LINE, lambda x, y: np.trapezoid(y, x)),
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
        ("n [cycles/m],Gd [m^3]", "ISO_8608", False),
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
    on_line = name not in ("C", "C_iso", "Wr")
    # Along a line, some of the height is at q < q0.
    assert np.sqrt(mean_square(x, y)) == pytest.approx(RMS, rel=0.1 if on_line else 0.01)
    options = {"normalisation": name} if given else {}
    data = fitting.read(written(tmp_path / "s.csv", head, name), **options)
    np.testing.assert_allclose(data.q, Q, rtol=1e-8)
    assert rms(data) == pytest.approx(RMS, rel=0.02)
    near = (Q < 2e5) & (np.abs(np.log(Q / QR)) > 0.3)
    np.testing.assert_allclose(data.C[near], C0 * areal(Q[near]), rtol=0.05)


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
