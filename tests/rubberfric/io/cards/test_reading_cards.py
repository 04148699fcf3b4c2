"""Cards that other tools write, cards in scene files, and one line for every fault."""

import numpy as np
import pytest
from support.refusals import refused
from support.scenes.series import RUBBER, SHEAR, SOFT, TAU, E, same
from support.scenes.shifts import WLF

import rubberfric as rf

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
        ((rf.PronyShear(1e6, [9e6], [1.0], 5e6),), "bulk = 5e+06 Pa: must be > 2/3 of the glassy shear"),
        ((rf.Prony(0.0, [1.0], [1.0]),), "material has relaxed modulus 0: must be > 0 for abaqus"),
        # Rounding makes the sum of the weights less than 1.
        ((rf.Prony(0.0, [1e9, 1e8, 1e6], [1e-9, 1e-5, 1e-2], 0.49),), "material has relaxed modulus 0"),
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
        ("viscelprop\n1\n1,2,0\n", "for another program, such as Marc, pass the numbers to rubberfric.Prony"),
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
    if "tau_i" not in text and "a Prony series of" not in message and "Marc" not in message:
        assert "unit_stress is missing: must be the stress unit" in refused(
            path, lambda: rf.io.read_prony(path)
        )
