"""The page on names of spectra: its definitions, its formulas, its snippets and its picture."""

import importlib.util
import itertools
import re
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from support.folders import ROOT

import rubberfric as rf
from rubberfric.roughness.normalisation import NORMALISATIONS

PAGE = (ROOT / "notebooks" / "spectra.md").read_text(encoding="utf-8")
ROWS = {
    name: SimpleNamespace(unit=unit, height=height, formula=formula)
    for name, unit, height, formula in re.findall(r"^\| `(\w+)` \| (m.) \| `(.+?)` \| `(.+?)` \|", PAGE, re.M)
}
# A surface between two wavevectors, and its projection int C dq_y = 2 C0 (sqrt(b^2 - q^2) - sqrt(a^2 - q^2)).
A, B, C0 = 1e3, 5e3, 1e-18
Q = np.linspace(1e-3, B, 400_001)[1:-1]
AREAL = np.where(Q >= A, C0, 0.0)
LINE = 2 * C0 * (np.sqrt(B**2 - Q**2) - np.sqrt(np.maximum(A**2 - Q**2, 0.0)))
HEIGHT2 = np.pi * C0 * (B**2 - A**2)


def value(text, **names):
    """Evaluate a formula of the page, in which a blank between factors is a product."""
    text = re.sub(r"(?<=[\w)])\s+(?=[\w(])", "*", text.replace("^", "**"))
    return eval(text, {"pi": np.pi, **names})


def test_every_name_is_on_the_page():
    assert list(ROWS) == list(NORMALISATIONS)
    for name, row in ROWS.items():
        assert row.height == NORMALISATIONS[name].height
        assert row.unit == ("m⁴" if rf.roughness.density_column(name) == "C" else "m³")


@pytest.mark.parametrize("name", ROWS)
def test_definition_and_formula(name):
    """The formula undoes the definition, whose integral is the mean square height of the surface."""
    left, right = ROWS[name].formula.split(" = ")
    known = LINE if left == "C_1D" else AREAL
    # The density is the value from which the formula gives `known`.
    density = known / value(right, q=Q, **{name: 1.0})
    np.testing.assert_allclose(value(right, q=Q, **{name: density}), known, rtol=1e-14)
    before, integrand, axis = re.fullmatch(r"(.*?)\s*int (.+) d([qn])(?:,.*)?", ROWS[name].height).groups()
    integrand = integrand.strip("()").replace("q C_iso/pi", "q_C_iso_over_pi").replace("G_d", "ISO_8608")
    integrand = re.sub(r"\bC_1D\b", name, integrand) if left == "C_1D" else integrand
    x = Q if axis == "q" else Q / (2 * np.pi)
    total = np.trapezoid(value(integrand, q=Q, **{name: density}), x)
    assert value(before or "1") * total == pytest.approx(HEIGHT2, rel=1e-4)
    # and the library has the same formula
    if left == "C":
        inside = np.array([1.5e3, 4e3])
        found = rf.roughness.spectrum_from(name, inside, np.full(2, 1e-15))
        np.testing.assert_allclose(found, value(right, q=inside, **{name: 1e-15}) * np.ones(2), rtol=1e-14)
    else:
        q, C = np.geomspace(1e3, 1e6, 9), np.geomspace(1e-18, 1e-26, 9)
        lines = [rf.roughness.spectrum_as(which, q, C) for which in (name, "C_1D")]
        np.testing.assert_allclose(value(right, q=q, **{name: lines[0]}), lines[1], rtol=1e-14)


def test_snippets(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    snippets = re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S)
    # `tests/fitting/characterise/test_documented_steps.py` runs the other one, on a map of known roughness.
    for snippet in (text for text in snippets if "map.csv" not in text):
        exec(compile(snippet, "spectra.md", "exec"), names)
    printed = capsys.readouterr().out
    assert "5e-05 m^3 per m^2" in printed and "top spectrum" in printed
    assert names["height"] == pytest.approx(1e-5, rel=0.03)


def test_curves_of_the_picture():
    spec = importlib.util.spec_from_file_location("spectra", ROOT / "notebooks" / "spectra.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    curves = module.curves()
    assert list(curves) == list(ROWS)
    q, W1 = curves["W1"]
    assert np.trapezoid(W1, q) == pytest.approx(1e-10, rel=0.2)  # some height is at q < q0
    q, Wr = curves["Wr"]
    assert np.trapezoid(Wr, q) == pytest.approx(1e-10, rel=0.01)
    assert (ROOT / "notebooks" / "figures" / "spectra.png").stat().st_size > 10_000


def density(n):
    """A one-sided road density over n [cycles/m], with a roll-off at 20 cycles/m."""
    return 1e-7 / (1 + (n / 20) ** 2) ** 1.3


def levels(waves, width, G=density):
    """Texture levels by quadrature of the density over bands about 10^(k width)."""
    exact = 10 ** (width * np.round(np.log10(waves) / width))
    ends = [(10 ** (-width / 2) / wave, 10 ** (width / 2) / wave) for wave in exact]
    return 10 * np.log10([quad(G, *end, epsabs=0, epsrel=1e-11)[0] / 1e-12 for end in ends])


THIRDS = np.array([500, 400, 315, 250, 200, 160, 125, 100, 80, 63, 50, 40, 31.5, 25, 20, 16, 12.5]) / 1e3
THIRDS = np.append(THIRDS, np.array([10, 8, 6.3, 5, 4, 3.15, 2.5, 2]) / 1e3)


OCTAVES = np.array([500, 250, 125, 63, 31.5, 16, 8, 4, 2]) / 1e3


@pytest.mark.parametrize(("waves", "per_octave", "error"), [(THIRDS, 3, 3e-3), (OCTAVES, 1, 0.03)])
def test_texture_levels(waves, per_octave, error):
    """Levels of a density with a roll-off give it back within `error`, and a power law exactly."""
    width = {3: 0.1, 1: 0.3}[per_octave]
    q, G_d = rf.roughness.density_of_levels(waves[::-1], levels(waves[::-1], width), per_octave=per_octave)
    exact = 2 * np.pi * 10 ** (-width * np.round(np.log10(waves) / width))
    np.testing.assert_allclose(q, exact, rtol=1e-12)
    np.testing.assert_allclose(G_d, density(q / (2 * np.pi)), rtol=error)
    for power in (-2.6, -1.0):
        L = levels(waves, width, lambda n, power=power: 1e-6 * n**power)
        q, G_d = rf.roughness.density_of_levels(waves, L, per_octave=per_octave)
        np.testing.assert_allclose(G_d, 1e-6 * (q / (2 * np.pi)) ** power, rtol=1e-9)


@pytest.mark.parametrize(("waves", "per_octave", "error"), [(THIRDS, 3, 0.034), (OCTAVES, 1, 0.13)])
def test_texture_levels_at_a_sharp_roll_off(waves, per_octave, error):
    """The largest error of the page, for H = 1. The density along a line is integrated over C of all q_y."""

    def along(n):
        q, qr = 2 * np.pi * n, 400.0

        def areal(k):
            return max(np.hypot(q, k) / qr, 1.0) ** -4

        border = [np.sqrt(qr**2 - q**2)] if q < qr else []
        ends = [0.0, *border, 3 * qr + 3 * q, np.inf]
        return sum(quad(areal, a, b, epsabs=0, epsrel=1e-9)[0] for a, b in itertools.pairwise(ends))

    width = {3: 0.1, 1: 0.3}[per_octave]
    near = waves[(waves > 5e-3) & (waves < 50e-3)]
    q, G_d = rf.roughness.density_of_levels(near, levels(near, width, along), per_octave=per_octave)
    relative = G_d / [along(n) for n in q / (2 * np.pi)] - 1
    assert relative.min() == pytest.approx(-error, rel=0.1)


@pytest.mark.slow
def test_texture_levels_of_a_road():
    """Levels of a surface along lines give its rms height, of waves from 500 to 2 mm."""
    surface = rf.SelfAffine(2 * np.pi / 0.55, 2 * np.pi / 0.1, 1e5, 0.8, 1e-3)

    def along(n):
        return float(4 * np.pi * rf.roughness.line_spectrum(surface, 2 * np.pi * n))

    n = np.geomspace(1.0, 1500.0, 800)
    dense = np.asarray(4 * np.pi * rf.roughness.line_spectrum(surface, 2 * np.pi * n))
    bands = [10 ** (-0.1 * np.round(np.log10(THIRDS) / 0.1) + shift) for shift in (-0.05, 0.05)]
    squares = [
        np.trapezoid(np.interp(x := np.linspace(a, b, 300), n, dense), x) for a, b in zip(*bands, strict=True)
    ]
    q, G_d = rf.roughness.density_of_levels(THIRDS, 10 * np.log10(np.array(squares) / 1e-12))
    assert G_d[10] == pytest.approx(along(q[10] / (2 * np.pi)), rel=0.01)
    table = rf.TabulatedSpectrum(q, rf.roughness.spectrum_from("ISO_8608", q, G_d))
    exact = float(rf.roughness.rms_height(surface, q[-1]))
    assert float(rf.roughness.rms_height(table)) == pytest.approx(exact, rel=0.05)


@pytest.mark.parametrize(
    ("waves", "L", "more", "message"),
    [
        ([0.1, 0.05], [50.0, 49.0], {}, "must be centres of neighbouring bands, 10^(k 0.1) m"),
        ([0.1, 0.09], [50.0, 49.0], {}, "must be centres of neighbouring bands"),
        ([0.1, 0.08], [50.0], {}, "must have equal lengths"),
        ([0.1, -0.08], [50.0, 49.0], {}, "wavelength[1] = -0.08: must be > 0"),
        ([0.1, 0.08], [50.0, np.nan], {}, "level[1] = nan: must be finite"),
        ([0.1, 0.08], [50.0, 49.0], {"per_octave": 2}, "per_octave = 2: must be 3 or 1"),
    ],
)
def test_levels_that_are_refused(waves, L, more, message):
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        rf.roughness.density_of_levels(waves, L, **more)
    assert "\n" not in str(error.value)
