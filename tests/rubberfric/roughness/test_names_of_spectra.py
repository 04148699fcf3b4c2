"""The page on names of spectra: its definitions, its formulas, its snippets and its picture."""

import importlib.util
import re
from types import SimpleNamespace

import numpy as np
import pytest
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
    for snippet in re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S):
        exec(compile(snippet, "spectra.md", "exec"), names)
    printed = capsys.readouterr().out
    assert "5e-05 m^3 per m^2" in printed and "top spectrum" in printed
    assert names["found"].h_rms == pytest.approx(1e-5, rel=0.03)


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
