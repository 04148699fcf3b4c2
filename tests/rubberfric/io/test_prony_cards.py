"""Prony series as cards of other programs, checked by separate readers, and round trips."""

import re

import numpy as np
import pytest
from support.refusals import refused
from support.scenes.shifts import WLF

import fitting
import rubberfric as rf
from rubberfric.io.cards.shear_series import shear_series

TAU = 10.0 ** np.arange(-7, 2)
E = 1e9 * np.array([0.7, 0.31, 0.2, 0.11, 0.05, 0.02, 0.01, 0.004, 0.0013])
RUBBER = rf.Prony(4.2e6, E, TAU, 0.45, WLF)
SOFT = rf.Prony(4.2e6, E, TAU, 0.5)
SHEAR = rf.PronyShear(1.4e6, E / 3, TAU, 2.1e9, WLF)
OMEGA = 10.0 ** np.linspace(-3, 9, 25)


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


def same(found, expected, rtol):
    assert type(found) is type(expected)
    for name in expected.__dataclass_fields__:
        a, b = getattr(found, name), getattr(expected, name)
        if name != "shift":
            np.testing.assert_allclose(a, b, rtol=rtol)
        elif b is None:
            assert a is None
        else:
            np.testing.assert_allclose([a.C1, a.C2, a.T_ref], [b.C1, b.C2, b.T_ref], rtol=1e-12)


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
    text = rf.io.write_prony(None, SOFT)
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
        ],
    ),
    "lsdyna": (
        1e-6,
        [
            (SHEAR.replace("shift", None), MPA, DENSE, {}),
            (SOFT, PASCAL, DENSE | {"bulk": 2e9}, {}),
        ],
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


# --- cards of other tools


ABAQUS = """*Heading
** another tool
*Material, name="tread 1"
*Density
 1.2e-09,
*Elastic, moduli=LONG TERM
 3., 0.5
*Viscoelastic, time=PRONY
 0.5, 0., 0.1
 0.25, , 1.
*Trs
 20., 8.86, 101.6
*Material, name=steel
*Elastic
 1., 0.3
"""
ANSYS = """! another tool
MP,EX,2,12.0D0
mp,prxy,2,0.25
TB,PRONY,2,1,2,SHEAR
TBTEMP,0
TBDATA,,0.5,0.1,0.25
TBDATA,,1.0
"""
LSDYNA = """*KEYWORD
*MAT_GENERAL_VISCOELASTIC_TITLE
tread
         1   1.2E-9    2000.0

$ the terms
       1.0       0.0
      2.0,
*END
"""


def test_cards_of_others(tmp_path):
    path = tmp_path / "cards"
    path.write_text(ABAQUS)
    found = rf.io.read_prony(path, unit_stress="MPa", unit_temperature="C")
    same(found, rf.Prony(3e6, [6e6, 3e6], [0.1, 1.0], 0.5, WLF), 1e-13)
    path.write_text(ANSYS)
    G = 12e6 / 2.5
    expected = rf.PronyShear(G / 4, [G / 2, G / 4], [0.1, 1.0], 12e6 / 1.5)
    same(rf.io.read_prony(path, unit_stress="MPa"), expected, 1e-13)
    path.write_text(LSDYNA.replace("      2.0,", "2.0,10.0").replace("1   1.2E-9", "1 1.200E-9"))
    same(rf.io.read_prony(path, unit_stress="MPa"), rf.PronyShear(1e6, [2e6], [0.1], 2e9), 1e-13)
    touching = path.read_text().replace("       1.0       0.0", "1.00000000-0.0000000")
    assert touching != path.read_text()
    path.write_text(touching)
    same(rf.io.read_prony(path, unit_stress="MPa"), rf.PronyShear(1e6, [2e6], [0.1], 2e9), 1e-13)


def test_openradioss_incompressible(tmp_path):
    path = tmp_path / "cards"
    text = rf.io.write_prony(None, SHEAR, "openradioss", density=1200.0, shift=False)
    card = next(line for line in text.splitlines() if line.startswith("  0.49"))
    path.write_text(text.replace(card[:20], f"{0.5:20}"))
    same(rf.io.read_prony(path, unit_stress="Pa"), rf.Prony(4.2e6, E, TAU, 0.5), 1e-11)


def test_cards_in_a_scene_file(tmp_path):
    (tmp_path / "cards.inp").write_text(ABAQUS)
    (tmp_path / "cards.mac").write_text(ANSYS)
    path = tmp_path / "scene.toml"
    shift = 'shift = {kind = "arrhenius", energy = 1.0, T_ref = 300.0}'
    scene = """lower.material = {kind = "prony", file = "cards.inp", UNITS, unit_temperature = "C"}
    upper.material = {kind = "prony_shear", file = "cards.mac", UNITS, SHIFT}
    """.replace("SHIFT", shift).replace("UNITS", 'unit_stress = "MPa"')
    path.write_text(scene)
    found = rf.load_scene(path)
    same(found.lower.material, rf.Prony(3e6, [6e6, 3e6], [0.1, 1.0], 0.5, WLF), 1e-13)
    assert found.upper.material.shift.energy == 1.0
    np.testing.assert_allclose(found.upper.material.bulk, 8e6, rtol=1e-13)
    for old, new, message in (
        ('"prony_shear"', '"prony"', "upper.material.file = 'cards.mac': must hold Prony, not PronyShear;"),
        ('"cards.inp"', "3", "lower.material.file = 3: must be the name of a file of cards"),
        ('"cards.inp"', '"cards.inp", E_inf = 1.0', "lower.material.E_inf: unknown key; must be one of file"),
    ):
        path.write_text(scene.replace(old, new))
        assert message in refused(path, lambda: rf.load_scene(path))
    path.write_text(scene.replace('unit_stress = "MPa", unit_t', "unit_t"))
    assert "unit_stress is missing" in refused(tmp_path / "cards.inp", lambda: rf.load_scene(path))


# --- faults


LONG = rf.Prony(1e6, np.ones(18), 10.0 ** np.arange(18), 0.5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((rf.Elastic(1e6, 0.5),), "material must be Prony or PronyShear, got Elastic; see fit_prony"),
        ((RUBBER, "nastran"), "program = 'nastran': must be one of abaqus, ansys, comsol, lsdyna"),
        ((RUBBER, "abaqus", {"unit_stress": "psi"}), "unit_stress = 'psi': must be one of Pa, kPa, MPa, GPa"),
        ((RUBBER, "openradioss", {"density": 1e3}), "has the shift WLF: openradioss cards must have none;"),
        ((SHEAR, "openradioss", {"shift": False}), "density is missing: must be given for openradioss"),
        ((SOFT, "comsol"), "bulk is missing: must be given for comsol, such as 2e9 [Pa], because"),
        ((SOFT, "ansys"), "for ansys, such as 2e9 [Pa], because the program needs Poisson's ratio < 0.5"),
        ((SOFT, "lsdyna", {"density": 1e3}), "bulk is missing: must be given for lsdyna"),
        ((SOFT, "lsdyna", {"bulk": 2e9}), "density is missing: must be given for lsdyna"),
        ((LONG, "lsdyna", {"bulk": 2e9, "density": 1e3}), "has 18 terms: must be at most 18, including"),
        ((SHEAR, "abaqus", {"bulk": 1e9}), "bulk = 1000000000.0: must not be given; the PronyShear has"),
        ((SOFT, "abaqus", {"bulk": 1e6}), "bulk = 1e+06 Pa: must be > 1/3 of the glassy Young's modulus"),
        ((rf.Prony(0.0, [1.0], [1.0]),), "material has relaxed modulus 0: must be > 0 for abaqus"),
        ((SOFT, "abaqus", {"density": 1e3, "unit_stress": "GPa"}), "must be Pa or MPa if a density is given"),
        ((SHEAR, "pyvisco", {"shift": False}), "shear and bulk weights must be equal for pyvisco"),
        ((rf.Prony(1e6, [1e6], [1.0], 0.5, rf.Arrhenius(1.0, 300.0)),), "abaqus cards must have WLF;"),
    ],
)
def test_refused_to_write(arguments, message, tmp_path):
    material, *rest = arguments
    options = rest[1] if len(rest) > 1 else {}
    with pytest.raises(ValueError, match="must") as error:
        rf.io.write_prony(tmp_path / "x", material, *rest[:1], **options)
    assert message in str(error.value) and "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


# Another law, and no terms after their count.
RADIOSS = "/MAT/LAW1/1\nrubber\n1.2e-9\n0.5\n/VISC/PRONY/1\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nothing", "must have a Prony series of abaqus, ansys, comsol, lsdyna, openradioss"),
        (ABAQUS.replace("LONG TERM\n 3.", "LONG TERM\n x"), "'x': must be a number"),
        (ABAQUS.replace(" 0.5, 0., 0.1\n 0.25", " 0.8, 0., 0.1\n 0.25"), "add up to 1.05: must be at most 1"),
        (ABAQUS.replace("0.5, 0., 0.1", "0.5, 0.2, 0.1").replace("3., 0.5", "3., 0.4"), "term 1: weight 0.2"),
        (ABAQUS.replace("*Trs", "*Trs, definition=USER"), "must be DEFINITION=WLF; shift=False leaves the"),
        (ABAQUS.replace("time=PRONY", "time=CREEP TEST DATA"), "must be TIME=PRONY"),
        (ABAQUS.replace("*Elastic", "*Density"), "*ELASTIC with data is missing: must be given"),
        (ANSYS.replace("0.25\nTBDATA,,1.0", "0.25"), "must be pairs of weight and time"),
        (ANSYS.replace("MP,EX", "MP,DENS"), "MP,EX is missing: must be given"),
        (ANSYS.replace("MP,EX", "MP,EY"), "material 2: EY is not read: must be isotropic"),
        (LSDYNA.replace("      2.0,", "2.0,1.0,5.0"), "term 2: KI = 5: must be 0"),
        (LSDYNA.replace("      2.0,", ""), "must have at least one term with a rate"),
        (RADIOSS, "/MAT/LAW42 is missing or incomplete for /VISC/PRONY/1: must be given"),
        (RADIOSS.replace("/LAW1/", "/LAW42/").replace("0.5", "0.5\n10.\n\n2.\n"), "/VISC/PRONY has 0 terms"),
        ("i,tau_i,alpha_i,E_0\n-,s,-,psi\n1,1,0.5,1\n", "column E_0: unit 'psi': must be"),
    ],
)
def test_refused_to_read(text, message, tmp_path):
    path = tmp_path / "cards"
    path.write_text(text)
    stress = None if "tau_i" in text else "MPa"
    assert message in refused(path, lambda: rf.io.read_prony(path, unit_stress=stress))
    if "tau_i" not in text and text != "nothing":
        assert "unit_stress is missing: must be the stress unit" in refused(
            path, lambda: rf.io.read_prony(path)
        )
