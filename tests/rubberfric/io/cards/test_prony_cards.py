"""Prony series as cards of other programs, checked by separate readers, and round trips."""

import re

import numpy as np
import pytest
from support.refusals import refused
from support.scenes.series import OMEGA, RUBBER, SHEAR, SOFT, TAU, E, same
from support.scenes.shifts import WLF

import fitting
import rubberfric as rf
from rubberfric.io.cards.shear_series import shear_series


def numbers(text, pattern):
    """Numbers of the lines that follow a line with the pattern, up to the next keyword."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if re.search(pattern, line))
    rows = []
    for line in lines[start + 1 :]:
        if line.startswith("*"):
            break
        rows.append([float(x) for x in line.strip(", ").split(",")])
    return rows


def modulus(shear, g, bulk, k, tau):
    """E(omega) of relative weights, from E = 9 B G / (3 B + G) with what G and B are at omega."""
    s = 1j * OMEGA[:, None] * np.asarray(tau)
    G, B = (m * (1 - np.sum(w) + (np.asarray(w) * s / (1 + s)).sum(1)) for m, w in ((shear, g), (bulk, k)))
    return 9 * B * G / (3 * B + G)


# --- abaqus


@pytest.mark.parametrize("material", [RUBBER, SHEAR])
def test_abaqus_cards_have_the_modulus(material):
    text = rf.io.write_prony(None, material, unit_stress="MPa", density=1200.0)
    ((young, nu),) = numbers(text, r"^\*ELASTIC, MODULI=INSTANTANEOUS$")
    g, k, tau = np.array(numbers(text, r"^\*VISCOELASTIC, TIME=PRONY$")).T
    shear, bulk = young * 1e6 / (2 * (1 + nu)), young * 1e6 / (3 * (1 - 2 * nu))
    exact = np.asarray(rf.complex_modulus(material, OMEGA))
    np.testing.assert_allclose(modulus(shear, g, bulk, k, tau), exact, rtol=1e-11)
    assert numbers(text, r"^\*DENSITY") == [[1.2e-9]]
    assert numbers(text, r"^\*TRS, DEFINITION=WLF") == [[293.15, 8.86, 101.6]]
    assert all(len(field) <= 20 for line in text.splitlines() if line[0] != "*" for field in line.split(", "))


def test_abaqus_incompressible():
    text = rf.io.write_prony(None, SOFT.replace("E", np.append(0.0, E[1:])))
    ((_, nu),) = numbers(text, r"^\*ELASTIC")
    assert nu == 0.5 and all(k == 0 for _, k, _ in numbers(text, r"^\*VISCO")) and "TRS" not in text


@pytest.mark.parametrize("bulk", [0.6e9, 2e9, 1e12])
def test_a_bulk_modulus_keeps_the_measured_modulus(bulk):
    """E* of the cards, from their G* and B, is E* of the material at every frequency."""
    text = rf.io.write_prony(None, SOFT, bulk=bulk)
    ((young, nu),) = numbers(text, r"^\*ELASTIC")
    g, k, tau = np.array(numbers(text, r"^\*VISCO")).T
    assert young == pytest.approx(4.2e6 + E.sum(), rel=1e-12) and not k.any() and g.size == TAU.size
    assert young / (3 * (1 - 2 * nu)) == pytest.approx(bulk, rel=1e-10)
    s = 1j * OMEGA[:, None] * TAU
    exact = 4.2e6 + (E * s / (1 + s)).sum(1)
    card = modulus(young / (2 * (1 + nu)), g, bulk, k, tau)
    np.testing.assert_allclose(card.real, exact.real, rtol=1e-9)
    np.testing.assert_allclose(card.imag, exact.imag, rtol=1e-9)


def test_a_bulk_modulus_of_any_series():
    """Equal and very close times, terms of very different size, no relaxed modulus."""
    rng = np.random.default_rng(0)
    for case in range(50):
        n = int(rng.integers(1, 30))
        tau, weights = 10 ** rng.uniform(-12, 6, n), 10 ** rng.uniform(2, 9, n)
        tau[n // 2] = tau[0]
        tau = tau[0] * (1 + 1e-9 * rng.random(n)) if case % 7 == 0 else tau
        rest = 0.0 if case % 5 == 0 else 10 ** rng.uniform(5, 7)
        bulk = (rest + weights.sum()) / 3 * (1 + 10 ** rng.uniform(-3, 3))
        G_inf, G, times = shear_series(rest, weights, tau, bulk)
        s = 1j * 10 ** np.linspace(-7, 13, 101)[:, None]
        exact, shear = (
            rest + (weights * s * tau / (1 + s * tau)).sum(1),
            (G * s * times / (1 + s * times)).sum(1),
        )
        young = 9 * bulk * (G_inf + shear) / (3 * bulk + G_inf + shear)
        np.testing.assert_allclose(young.real, exact.real, rtol=1e-11)
        np.testing.assert_allclose(young.imag, exact.imag, rtol=1e-11)


# --- ansys


@pytest.mark.parametrize("material", [RUBBER, SHEAR])
def test_ansys_cards_have_the_modulus(material):
    text = rf.io.write_prony(None, material, "ansys", unit_stress="MPa", unit_temperature="C")
    constant = {m[1]: float(m[2]) for m in re.finditer(r"^MP,(\w+),1,(\S+)$", text, re.M)}
    table, at = {}, None
    for line in text.splitlines():
        if line.startswith("TB,"):
            at = line.split(",")[-1]
            assert line.startswith(f"TB,PRONY,1,1,{TAU.size},") or at == "WLF"
        elif line.startswith("TBDATA,"):
            first, *values = line.split(",")[1:]
            assert len(values) <= 6 and int(first) == len(table.setdefault(at, [])) + 1
            table[at] += map(float, values)
    assert table["WLF"] == pytest.approx([20.0, 8.86, 101.6], rel=1e-13)
    assert ("BULK" in table) == (material is RUBBER)
    (g, tau), k = np.reshape(table["SHEAR"], (-1, 2)).T, np.zeros(TAU.size)
    if material is RUBBER:
        assert table["BULK"] == table["SHEAR"]
        k = g
    young, nu = constant["EX"] * 1e6, constant["PRXY"]
    found = modulus(young / (2 * (1 + nu)), g, young / (3 * (1 - 2 * nu)), k, tau)
    np.testing.assert_allclose(found, np.asarray(rf.complex_modulus(material, OMEGA)), rtol=1e-12)


# --- lsdyna


def test_lsdyna_cards_have_the_modulus():
    text = rf.io.write_prony(None, SHEAR, "lsdyna", unit_stress="MPa", density=1200.0, shift=False)
    cards = [line for line in text.splitlines() if line[0] != "$"]
    assert cards[0] == "*MAT_GENERAL_VISCOELASTIC"
    fields = [[line[i : i + 10] for i in range(0, len(line), 10)] for line in cards[1:]]
    assert all(len(field) == 10 for row in fields for field in row)
    mid, ro, bulk = map(float, fields[0])
    assert (mid, ro, bulk) == (1, 1.2e-9, 2100.0) and [float(x) for x in fields[1]] == [0.0]
    G, beta = np.array([[float(x) for x in row] for row in fields[2:]]).T
    assert beta[0] == 0  # the relaxed modulus
    tau = 1 / beta[1:]
    found = modulus(G.sum() * 1e6, G[1:] / G.sum(), bulk * 1e6, 0 * tau, tau)
    np.testing.assert_allclose(found, np.asarray(rf.complex_modulus(SHEAR, OMEGA)), rtol=3e-6)


def test_lsdyna_cards_of_a_liquid_have_no_relaxed_modulus():
    liquid = rf.PronyShear(0.0, SHEAR.G, SHEAR.tau, SHEAR.bulk)
    text = rf.io.write_prony(None, liquid, "lsdyna", unit_stress="MPa", density=1200.0)
    # Keyword, two cards, and a card for each term.
    assert sum(line[0] != "$" for line in text.splitlines()) == 3 + liquid.tau.size


def test_lsdyna_shift(tmp_path):
    path = tmp_path / "rubber.k"
    text = rf.io.write_prony(path, SHEAR, "lsdyna", density=1200.0)
    card = next(line for line in text.splitlines() if line[:1] not in "$*")
    T_ref, A, B = (float(card[i : i + 10]) for i in (50, 60, 70))
    log_aT = -A * (330.0 - T_ref) / (B + 330.0 - T_ref)
    np.testing.assert_allclose(log_aT, WLF.log_factor(330.0), rtol=2e-5)  # 6 digits
    same_shift = rf.io.read_prony(path, unit_stress="Pa").shift
    np.testing.assert_allclose([same_shift.C1, same_shift.C2, same_shift.T_ref], [8.86, 101.6, 293.15], 2e-5)
    with pytest.raises(ValueError, match=r"must be K for a shift of lsdyna"):
        rf.io.write_prony(path, SHEAR, "lsdyna", density=1200.0, unit_temperature="C")


# --- comsol and openradioss


def test_comsol_table_has_the_modulus():
    text = rf.io.write_prony(None, SHEAR, "comsol", unit_stress="MPa", unit_temperature="C")
    comments = dict(re.findall(r"^% (\w+) = (\S+)", text, re.M))
    rows = [line.split() for line in text.splitlines() if line[0] != "%"]
    assert [int(row[0]) for row in rows] == list(range(1, TAU.size + 1))
    _, G, tau = np.array(rows, float).T
    glassy = float(comments["G"]) + G.sum()
    found = modulus(glassy * 1e6, G / glassy, float(comments["K"]) * 1e6, 0 * tau, tau)
    np.testing.assert_allclose(found, np.asarray(rf.complex_modulus(SHEAR, OMEGA)), rtol=1e-12)
    assert float(comments["Tref"]) == pytest.approx(20.0, rel=1e-12)
    assert (comments["C1"], comments["C2"]) == ("8.86", "101.6")


@pytest.mark.parametrize("material", [RUBBER, SHEAR])
def test_openradioss_cards_have_the_modulus(material):
    text = rf.io.write_prony(None, material, "openradioss", unit_stress="MPa", density=1200.0, shift=False)
    cards = [line for line in text.splitlines() if not line.startswith("#")]
    assert cards[:2] == ["/MAT/LAW42/1", "RUBBER"] and float(cards[2]) == 1.2e-9
    nu, mu, alpha = float(cards[3][:20]), float(cards[4][:20]), float(cards[6][:20])
    assert alpha == 2 and cards[5] == cards[7] == "" and cards[8] == "/VISC/PRONY/1"
    assert int(cards[9][:10]) == TAU.size and len(cards[3]) == 100 and len(cards[9]) == 60
    G, beta, K, beta_k = np.array([[float(c[i : i + 20]) for i in (0, 20, 40, 60)] for c in cards[10:]]).T
    relaxed_bulk = 2 * mu * (1 + nu) / (3 * (1 - 2 * nu))
    glassy, glassy_bulk = mu + G.sum(), relaxed_bulk + K.sum()
    found = modulus(glassy * 1e6, G / glassy, glassy_bulk * 1e6, K / glassy_bulk, 1 / beta)
    np.testing.assert_allclose(found, np.asarray(rf.complex_modulus(material, OMEGA)), rtol=1e-10)
    assert np.array_equal(beta_k, beta if material is RUBBER else 0 * beta)


# --- round trips


MPA = {"unit_stress": "MPa"}
CELSIUS = {"unit_stress": "MPa", "unit_temperature": "C"}
PASCAL = {"unit_stress": "Pa"}
DENSE = {"density": 1200.0}
# Program: relative tolerance, and (material, options of both, of writing, of reading).
ROUND_TRIPS = {
    "abaqus": (1e-11, [(m, units, {}, {}) for m in (RUBBER, SHEAR, SOFT) for units in (PASCAL, CELSIUS)]),
    "ansys": (
        1e-11,
        [(m, units, {}, {}) for m in (RUBBER, SHEAR) for units in (PASCAL, CELSIUS)]
        + [(SOFT, units, {"bulk": 2e9}, {}) for units in (PASCAL, CELSIUS)],
    ),
    "comsol": (1e-11, [(SHEAR, MPA, DENSE, {}), (SOFT, PASCAL, DENSE | {"bulk": 2e9}, {})]),
    "openradioss": (
        1e-11,
        [
            (SHEAR.replace("shift", None), MPA, DENSE, {}),
            (SOFT, PASCAL, DENSE | {"bulk": 2e9}, {}),
            (RUBBER.replace("shift", None), PASCAL, DENSE, {}),
            (rf.Prony(1e6, [1e9, 0.0, 1e6], [1e-9, 1e-5, 0.1], 0.3), PASCAL, DENSE, {}),
        ],
    ),
    "lsdyna": (
        1e-6,
        [(SHEAR.replace("shift", None), MPA, DENSE, {}), (SOFT, PASCAL, DENSE | {"bulk": 2e9}, {})],
    ),
    "pyvisco": (1e-12, [(SOFT, MPA, {}, {})]),
}


@pytest.mark.parametrize("program", ROUND_TRIPS)
def test_round_trip(program, tmp_path):
    path, (rtol, cases) = tmp_path / "cards", ROUND_TRIPS[program]
    for material, units, writing, reading in cases:
        rf.io.write_prony(path, material, program, **units, **writing)
        again = rf.io.read_prony(path, **units, **reading)
        if "bulk" in writing:  # another series, and the same modulus
            exact = np.asarray(rf.complex_modulus(material, OMEGA))
            np.testing.assert_allclose(rf.complex_modulus(again, OMEGA), exact, rtol=max(rtol, 1e-9))
            assert isinstance(again, rf.PronyShear) and float(again.bulk) == pytest.approx(2e9, rel=1e-6)
        else:
            same(again, material, rtol)
        assert rf.io.read_prony(path, program, shift=False, **units, **reading).shift is None


def test_round_trip_pyvisco(tmp_path):
    path = tmp_path / "prony.csv"
    text = rf.io.write_prony(path, SOFT, "pyvisco", unit_stress="MPa")
    assert text.startswith("i,tau_i,alpha_i,E_0,E_i\n-,s,-,MPa,MPa\n1,1e-07,")
    path.write_text(text.replace("E_", "G_"))
    assert "G_0 is a shear modulus: poisson must be given" in refused(path, lambda: rf.io.read_prony(path))
    np.testing.assert_allclose(rf.io.read_prony(path, poisson=0.25).E, 2.5 * E, rtol=1e-12)


def test_a_fit_becomes_cards(tmp_path):
    exact = np.asarray(rf.complex_modulus(SOFT, OMEGA))
    fit = fitting.fit_prony(fitting.ModulusData(OMEGA, exact.real, exact.imag), tau=TAU)
    path = tmp_path / "fit.inp"
    assert rf.io.write_prony(path, fit) == rf.io.write_prony(None, fit.material) == path.read_text()
    same(rf.io.read_prony(path, unit_stress="Pa"), fit.material, 1e-11)
