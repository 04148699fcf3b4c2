"""Materials of cards: which one is read, with which modulus, and which cards are refused."""

import numpy as np
import pytest
from support.refusals import refused

import rubberfric as rf

MPA = {"unit_stress": "MPa"}
PA = {"unit_stress": "Pa"}
CELSIUS = MPA | {"unit_temperature": "C"}
TIMES = [1e-4, 1e-2]

ABAQUS = """*MATERIAL, NAME=A
*ELASTIC, MODULI=INSTANTANEOUS
30., 0.5
*VISCOELASTIC, TIME=PRONY
0.5, 0., 1e-4
0.3, 0., 1e-2
"""
TWO = ABAQUS + ABAQUS.replace("NAME=A", "NAME=B").replace("30.", "10.")
WARM = ABAQUS.replace("30., 0.5", "30., 0.5, 20.\n27., 0.5, 60.")
TRS = "*TRS\n20., 8.86, 101.6\n"
NEO = """*MATERIAL, NAME=TREAD
*HYPERELASTIC, NEO HOOKE
0.75, 0.02
*VISCOELASTIC, TIME=PRONY
0.3, 0., 1e-4
0.5, , 1e-2
"""
ANSYS = """MP,EX,1,2.1e11
MP,PRXY,1,0.3
MP,EX,2,3.0e7
MP,PRXY,2,0.5
TB,PRONY,2,1,2,SHEAR
TBDATA,1,0.5,1e-4,0.3,1e-2
"""
HYPER = """TB,HYPER,1,1,,NEO
TBDATA,1,1.5e6,1e-9
TB,PRONY,1,1,2,SHEAR
TBDATA,1,0.3,1e-4,0.5,1e-2
"""
DYNA = """*MAT_GENERAL_VISCOELASTIC_TITLE
tread
         1   1.2E-9    2000.0

       1.0       0.0
       2.0      10.0
"""
DYNA_TWO = DYNA + DYNA.replace("tread", "side").replace("         1 ", "         7 ").replace(
    "2.0  ", "4.0  "
)
MOONEY = "       0.5       0.1"
RUBBER = f"""*MAT_HYPERELASTIC_RUBBER
         1   1.12e-9     0.495         0         2
{MOONEY}
       3.0     100.0
       2.0       1.0
"""
BULK = 2 * 1.2e6 * 1.495 / (3 * 0.01)  # of a shear modulus of 1.2 MPa and Poisson's ratio 0.495


def radioss(number, mu, alpha, G):
    """/MAT/LAW42 with Poisson's ratio 0.495, and /VISC/PRONY with one term of 0.1 s, in fields of 20."""
    law = f"/MAT/LAW42/{number}\nname {number}\n{1e-9:20}\n{0.495:20}\n{mu:20}\n\n{alpha:20}\n\n"
    return law, f"/VISC/PRONY/{number}\n{1:10}\n{G:20}{10.0:20}\n"


SOFT = radioss(1, 1.2, 2.0, 3.0)
HARD = radioss(2, 5.0, 2.0, 7.0)
OGDEN = radioss(1, 0.6, 4.0, 3.0)
BEGIN = "/BEGIN\nrun\n      2020         0\n" + "{0:>20}{1:>20}{2:>20}\n" * 2
PYVISCO = "i,tau_i,alpha_i,E_0,E_i\n-,s,-,MPa,MPa\n1,0.1,0.5,30,15\n"

SERIES = (2e6, [5e6, 3e6], TIMES, None)  # G_inf, G, tau; bulk modulus or None if incompressible
RELAXED = (1.5e6, [2.25e6, 3.75e6], TIMES, 1e8)
GLASSY = (0.3e6, [0.45e6, 0.75e6], TIMES, 2e9)
TWO_TERMS = (1.2e6, [3e6, 2e6], [0.01, 1.0], BULK)
RADIOSS = (1.2e6, [3e6], [0.1], BULK)
# Eight-chain model with the limiting stretch 7: mu_0 / mu.
CHAINS = 1 + 3 / (5 * 7**2) + 99 / (175 * 7**4) + 513 / (875 * 7**6) + 42039 / (67375 * 7**8)


@pytest.mark.parametrize(
    ("text", "options", "expected"),
    [
        (ABAQUS.lower().replace("\n", "\r\n"), MPA, SERIES),
        (ABAQUS.replace("\n", "\n** comment\n\n"), MPA, SERIES),
        (ABAQUS.replace("*ELASTIC, MODULI=INSTANTANEOUS", "*ELASTIC,\n  MODULI = INST"), MPA, SERIES),
        (ABAQUS.replace("*VISCOELASTIC, TIME=PRONY", "*VISCOELASTIC,\nTIME=PRONY"), MPA, SERIES),
        (ABAQUS.replace("MODULI", "DEPENDENCIES=0, TYPE=ISO, MODULI"), MPA, SERIES),
        ("*MATERIAL, NAME=STEEL\n*ELASTIC\n2e5, 0.3\n" + ABAQUS, MPA, SERIES),
        (ABAQUS + "*STEP\n*INCLUDE, INPUT=loads.inp\n", MPA, SERIES),
        (TWO, MPA | {"name": "a"}, SERIES),
        (TWO, MPA | {"name": "B"}, (2e6 / 3, [5e6 / 3, 1e6], TIMES, None)),
        (NEO, MPA, RELAXED),
        (NEO.replace(", 0.02", ""), MPA, (*RELAXED[:3], None)),
        (NEO.replace("HOOKE", "HOOKE, MODULI=INSTANTANEOUS"), MPA, (0.3e6, [0.45e6, 0.75e6], TIMES, 1e8)),
        (NEO.replace("NEO HOOKE\n0.75", "MOONEY-RIVLIN\n0.5, 0.25"), MPA, RELAXED),
        (NEO.replace("NEO HOOKE\n0.75", "YEOH\n0.75, -0.01, 1e-3"), MPA, RELAXED),
        (NEO.replace("NEO HOOKE\n0.75", "POLYNOMIAL, N=2\n0.5, 0.25, 1., 2., 3."), MPA, RELAXED),
        (
            NEO.replace("NEO HOOKE\n0.75", "POLYNOMIAL, N=3\n0.5, 0.25, 1., 2., 3., 4., 5., 6.\n7."),
            MPA,
            RELAXED,
        ),
        (NEO.replace("NEO HOOKE\n0.75", "REDUCED POLYNOMIAL, N=2\n0.75, 9."), MPA, RELAXED),
        (NEO.replace("NEO HOOKE\n0.75", "OGDEN, N=2\n1., 3., 0.5, -2."), MPA, RELAXED),
        (NEO.replace("NEO HOOKE\n0.75", f"ARRUDA-BOYCE\n{1.5 / CHAINS!r}, 7."), MPA, RELAXED),
        (ANSYS, PA, SERIES),
        ("".join(ANSYS.splitlines(True)[4:] + ANSYS.splitlines(True)[:4]), PA, SERIES),
        (ANSYS.lower().replace("0.5\ntb", "0.5 $ tb").replace("\n", " ! comment\n"), PA, SERIES),
        (ANSYS + "TB,PRONY,1,1,1,SHEAR\nTBDATA,1,0.1,1.\n", PA | {"name": 2}, SERIES),
        (ANSYS + "TB,SHIFT,1,1,3,TN\nTBDATA,1,20,8.86,101.6\n", PA, SERIES),
        (ANSYS.replace("MP,EX,2,3.0e7\nMP,PRXY,2,0.5", "TB,ELASTIC,2\nTBDATA,1,3e7,0.5"), PA, SERIES),
        (HYPER, PA, GLASSY),
        (HYPER.replace(",,NEO\nTBDATA,1,1.5e6", ",2,MOONEY\nTBDATA,1,0.5e6,0.25e6"), PA, GLASSY),
        (HYPER.replace(",,NEO\nTBDATA,1,1.5e6", ",1,OGDEN\nTBDATA,1,0.5e6,6."), PA, GLASSY),
        (HYPER.replace(",,NEO\nTBDATA,1,1.5e6", ",3,YEOH\nTBDATA,1,0.75e6,-3e4,3e3"), PA, GLASSY),
        (HYPER.replace(",,NEO\nTBDATA,1,1.5e6", f",,BOYCE\nTBDATA,1,{1.5e6 / CHAINS!r},7."), PA, GLASSY),
        (DYNA_TWO, MPA | {"name": "side"}, (1e6, [4e6], [0.1], 2e9)),
        (DYNA_TWO, MPA | {"name": 7}, (1e6, [4e6], [0.1], 2e9)),
        (RUBBER, MPA, TWO_TERMS),
        (RUBBER.replace("HYPERELASTIC_RUBBER", "077_H"), MPA, TWO_TERMS),
        (RUBBER.replace("HYPERELASTIC", "OGDEN").replace(MOONEY, "       0.6\n       4.0"), MPA, TWO_TERMS),
        (RUBBER.replace("HYPERELASTIC_RUBBER", "077_O").replace(MOONEY, "1.0,0.3\n3.0,-2.0"), MPA, TWO_TERMS),
        (HARD[0] + "".join(SOFT), MPA, RADIOSS),
        (SOFT[0] + HARD[0] + HARD[1] + SOFT[1], MPA | {"name": "name 1"}, RADIOSS),
        ("".join(OGDEN), MPA, RADIOSS),
        (BEGIN.format("Mg", "mm", "s") + "".join(SOFT), MPA, RADIOSS),
        (BEGIN.replace(">", "<").format("Mg", "mm", "s") + "".join(SOFT), MPA, RADIOSS),
        (BEGIN.format("t", "mm", "s") + "".join(SOFT), MPA, RADIOSS),
        (BEGIN.format("ton", "mm", "s") + "".join(SOFT), MPA, RADIOSS),
    ],
)
def test_the_modulus_of_a_material(text, options, expected, tmp_path):
    """G_i = g_i G_0 with G_0 = E_0 / 3 or E_inf / 3 / (1 - sum g), 2 (C10 + C01), and B = 2 / D1."""
    path = tmp_path / "cards"
    path.write_text(text, newline="")
    material = rf.io.read_prony(path, **options)
    *series, bulk = expected
    if bulk is None:
        assert isinstance(material, rf.Prony) and float(material.poisson) == 0.5
        shear = [material.E_inf / 3, material.E / 3, material.tau]
    else:
        assert isinstance(material, rf.PronyShear) and float(material.bulk) == pytest.approx(bulk, rel=1e-9)
        shear = [material.G_inf, material.G, material.tau]
    for one, other in zip(shear, series, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)


@pytest.mark.parametrize(
    ("text", "options", "factors"),
    [
        (WARM + TRS, CELSIUS, {293.15: 1.0, 313.15: 0.95, 333.15: 0.9}),
        (WARM.replace("27.", "3.") + TRS, CELSIUS, {313.15: 0.55, 333.15: 0.1}),
        (WARM + TRS.replace("20.", "40."), CELSIUS, {293.15: 30 / 28.5, 333.15: 27 / 28.5}),
        (WARM + TRS.replace("20.", "0."), CELSIUS, {273.15: 1.0, 293.15: 1.0, 333.15: 0.9}),
        (NEO.replace("0.75, 0.02", "0.75, 0., 20.\n0.6, 0., 60.") + TRS, CELSIUS, {333.15: 0.8}),
        (
            ANSYS.replace("MP,EX,2,3.0e7", "MPTEMP,1,20,60\nMPDATA,EX,2,1,3e7,2.7e7")
            + "TB,SHIFT,2,1,3,WLF\nTBDATA,1,20,8.86,101.6\n",
            PA | {"unit_temperature": "C"},
            {313.15: 0.95, 333.15: 0.9},
        ),
    ],
)
def test_rows_over_temperature_are_a_vertical_shift(text, options, factors, tmp_path):
    """E* at 100 rad/s is b_T times E* at the reduced frequency.

    The programs interpolate moduli linearly. b_T is the modulus relative to that at T_ref.
    """
    path = tmp_path / "cards"
    path.write_text(text)
    material = rf.io.read_prony(path, **options)
    unshifted = rf.io.read_prony(path, shift=False, **options)
    assert unshifted.shift is None
    for T, factor in factors.items():
        above = T - float(material.shift.T_ref)
        reduced = complex(rf.complex_modulus(unshifted, 100 * 10 ** (-8.86 * above / (101.6 + above))))
        rel = 1e-9 if T in (293.15, 333.15) else 1e-4  # at and between the rows
        assert complex(rf.complex_modulus(material, 100.0, T)) == pytest.approx(factor * reduced, rel=rel)
    with pytest.raises(ValueError, match="must be inside the table"):
        material.shift.check_temperature(340.0)


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (TWO, MPA, "has 2 materials with a Prony series: name must be one of 'A', 'B'"),
        (TWO, MPA | {"name": "C"}, "name = 'C': must be one of 'A', 'B'"),
        (TWO.replace("=B", "=A"), MPA | {"name": "A"}, "2 materials with a Prony series have this name"),
        (
            ABAQUS.replace("MODULI", "TYPE=LAMINA, MODULI"),
            MPA,
            "TYPE=LAMINA is not supported: must be TYPE=ISO",
        ),
        (ABAQUS.replace("C, M", "C,\n TYPE=ORTHOTROPIC, M"), MPA, "TYPE=ORTHOTROPIC is not supported"),
        (ABAQUS.replace("MODULI", "DEPENDENCIES=1, MODULI"), MPA, "DEPENDENCIES=1 is not supported"),
        (ABAQUS.replace("30., 0.5", "30., 0.5, , 1."), MPA, "*ELASTIC has a row of 4 numbers"),
        (ABAQUS.replace("MODULI", "INPUT=e.dat, MODULI"), MPA, "INPUT=e.dat is not supported"),
        (ABAQUS.replace("=PRONY", "=PRONY, PRELOAD=UNIAXIAL"), MPA, "PRELOAD=UNIAXIAL is not supported"),
        (ABAQUS.replace("30.", "nan"), MPA, "'nan': must be a number"),
        (ABAQUS.replace("30.", "<E>"), MPA, "'<E>': must be a number; parameters are not evaluated"),
        (ABAQUS.replace("0.3, 0.", "-0.3, 0."), MPA, "term 2: weight -3: must be >= 0"),
        (ABAQUS.replace("0., 1e-2", "0."), MPA, "term 2: time 0: must be > 0"),
        (ABAQUS.replace("*V", "*ELASTIC\n9., 0.3\n*V"), MPA, "*ELASTIC is given 2 times"),
        (ABAQUS.replace("*V", "*INCLUDE, INPUT=x\n*V"), MPA, "copy the lines of the other file here"),
        (
            ABAQUS + "*DAMPING, BETA=1e-3\n",
            MPA,
            "*DAMPING, BETA=1e-3 is not read, but may change the modulus",
        ),
        (ABAQUS + "*TRS\n20., 8.86\n", MPA, "*TRS has 2 numbers: must have T_ref, C1 and C2"),
        (WARM, CELSIUS, "has rows at the temperatures 20, 60, but no WLF shift"),
        (WARM.replace(", 20.", ""), CELSIUS, "*ELASTIC has 2 rows, not all with a temperature"),
        (WARM.replace("20.", "90.") + TRS, CELSIUS, "temperatures 90, 60: must rise"),
        (WARM.replace("27., 0.5", "27., 0.45") + TRS, CELSIUS, "Poisson's ratios 0.5, 0.45 at 20, 60"),
        (WARM.replace("0.5, ", "0.49, ") + TRS, CELSIUS, "poisson must be given, for example 0.5"),
        ("** Prony series of 2 terms. Units: MPa, s\n" + ABAQUS, PA, "unit_stress = 'Pa': must be 'MPa'"),
        (
            NEO.replace("HOOKE", "HOOKE, TEST DATA INPUT"),
            MPA,
            "replace *HYPERELASTIC by *ELASTIC with the mod",
        ),
        (NEO.replace("NEO HOOKE", "MARLOW"), MPA, "MARLOW is not supported: must be NEO HOOKE, MOONEY"),
        (NEO.replace("*V", "*ELASTIC\n9., 0.3\n*V"), MPA, "*ELASTIC and *HYPERELASTIC are both given"),
        (NEO.replace("*HYPERELASTIC, NEO HOOKE", "*HYPERFOAM"), MPA, "*HYPERFOAM is not read"),
        (ANSYS + "TB,PRONY,1,1,1,SHEAR\nTBDATA,1,0.1,1.\n", PA, "name must be one of '1', '2'"),
        (ANSYS.replace("3.0e7", "3.0e7,-1e5"), PA, "MP,EX has terms over temperature"),
        (ANSYS + "MP,EX,2,1e7\n", PA, "MP,EX is given twice for the material 2"),
        (ANSYS.replace("2,1,2,SHEAR", "2,1,3,SHEAR"), PA, "has 2 pairs, but states 3"),
        (ANSYS.replace("1,0.5,1e-4,0.3", "1,0.5,1e-4,,0.3"), PA, "must be pairs of weight and time"),
        (ANSYS + "TBTEMP,60\nTBDATA,1,0.4,1e-4,0.3,1e-2\n", PA, "has 2 temperatures: must have one"),
        (ANSYS + "TBMODIF,2,1,3.\n", PA, "is not evaluated; copy the cards of the material alone to a file"),
        (HYPER.replace("NEO", "BLATZ"), PA, "TB,HYPER,...,BLATZ is not supported: must be NEO"),
        (HYPER + "MP,EX,1,3e7\n", PA, "material 1 has moduli in MP, TB,HYPE: must be in one of them"),
        (DYNA_TWO, MPA, "name must be one of '1' 'tread', '7' 'side'"),
        (DYNA.replace("2000.0", "2000.0       0.0         1"), MPA, "has EF = 1: must be 0"),
        (DYNA.replace("_TITLE", "_MOISTURE_TITLE"), MPA, "must have no suffix except _TITLE"),
        (RUBBER.replace("0.495         0", "0.495         1"), MPA, "has N = 1, a fit to test data"),
        (RUBBER.replace("100.0\n", "100.0       0.2\n"), MPA, "term 1 has [0.2"),
        (ABAQUS.replace("30., 0.5", "0., 0.5"), MPA, "Young's modulus 0: must be > 0"),
        ("".join(SOFT).replace(f"{1:10}\n", f"{1:10}{'':10}{2e3:20}\n"), MPA, "has K_v = 2000: must be 0"),
        (HARD[0] + SOFT[1], MPA, "/MAT/LAW42 is missing or incomplete for /VISC/PRONY/1"),
        (BEGIN.format("kg", "mm", "ms") + "".join(SOFT), MPA, "the units kg, mm, ms: must be in s"),
        (BEGIN.format("kg", "m", "s") + "".join(SOFT), MPA, "must agree with unit_stress = 'MPa'"),
        (PYVISCO.replace("-,s,", "-,ms,"), {}, "column tau_i: unit 'ms': must be s"),
        (PYVISCO + "2,0.2\n", {}, "row 2 has 2 fields: must have 5"),
        (PYVISCO + "2,1.0,0.2,60,12\n", {}, "column E_0: 30 to 60: must be equal in all rows"),
    ],
)
def test_a_card_that_would_change_the_modulus_is_refused(text, options, message, tmp_path):
    path = tmp_path / "cards"
    path.write_text(text)
    assert message in refused(path, lambda: rf.io.read_prony(path, **options))


def test_a_scene_file_names_the_material_and_leaves_out_its_shift(tmp_path):
    (tmp_path / "cards.inp").write_text(TWO + TRS)
    path = tmp_path / "scene.toml"
    keys = 'kind = "prony", file = "cards.inp", unit_stress = "MPa", name = "B", shift = false'
    path.write_text(f'lower.material = {{{keys}}}\nupper.material = {{kind = "rigid"}}\n')
    material = rf.load_scene(path).lower.material
    assert float(material.E_inf) == pytest.approx(2e6) and material.shift is None
    path.write_text(path.read_text().replace("= false", '= {kind = "wlf", C1 = 10, C2 = 90, T_ref = 290}'))
    assert float(rf.load_scene(path).lower.material.shift.C1) == 10.0
    path.write_text(path.read_text().replace(', name = "B"', ""))
    assert "name must be one of 'A', 'B'" in refused(tmp_path / "cards.inp", lambda: rf.load_scene(path))


def test_blank_lines_do_not_slow_the_reader(tmp_path):
    """Recognising the program takes linear time; blank lines used to take quadratic time."""
    path = tmp_path / "cards"
    path.write_text("\n" * 200_000 + ABAQUS)
    assert float(rf.io.read_prony(path, **MPA).E_inf) == pytest.approx(6e6)


@pytest.mark.parametrize("name", ["", "a,b", "a\nb", 'a"b', "x" * 81, 3])
def test_names_that_break_a_card_are_refused(name, tmp_path):
    with pytest.raises(ValueError, match="on one line, without commas and quotes"):
        rf.io.write_prony(tmp_path / "x", rf.Prony(1e6, [1e6], [1.0]), name=name)
    assert list(tmp_path.iterdir()) == []
