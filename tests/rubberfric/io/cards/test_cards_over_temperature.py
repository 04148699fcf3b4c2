"""Cards with a vertical shift, at one temperature, and with neo-Hookean energies; *MAT_006 of LS-DYNA."""

import re

import numpy as np
import pytest

import rubberfric as rf
from rubberfric.io import read_prony, write_prony

E, TAU = np.array([4e6, 2e6, 1e6]), np.array([1e-6, 1e-4, 1e-2])
C1, C2, T_REF = 8.86, 101.6, 293.15
TABLE = rf.TabulatedVertical([273.15, 293.15, 333.15], [1.2, 1.0, 0.7])
LAWS = {"entropic": rf.Entropic(6e-4), "table": TABLE}
RANGE = (273.15, 333.15)
FILE = {"unit_stress": "MPa", "unit_temperature": "C"}


def rubber(vertical, poisson=0.499):
    return rf.Prony(1e6, E, TAU, poisson, rf.WLF(C1, C2, T_REF, vertical=vertical))


def modulus(omega, T, b_T):
    """E* = b_T (E_inf + sum E_i s / (1 + s)) with s = i omega a_T tau_i."""
    a_T = 10 ** (-C1 * (T - T_REF) / (C2 + T - T_REF))
    s = 1j * omega * a_T * TAU
    return b_T * (1e6 + np.sum(E * s / (1 + s)))


@pytest.mark.parametrize("hyperelastic", [False, True])
@pytest.mark.parametrize("program", ["abaqus", "ansys"])
@pytest.mark.parametrize("law", LAWS)
def test_rows_over_temperature_are_read_back(law, program, hyperelastic, tmp_path):
    """With the vertical shift of the cards, E* at 10 rad/s is that of the material at every temperature."""
    material, path = rubber(LAWS[law]), tmp_path / "cards.inp"
    write_prony(path, material, program, temperature=RANGE, hyperelastic=hyperelastic, **FILE)
    back = read_prony(path, **FILE)
    assert isinstance(back.shift.vertical, rf.TabulatedVertical)
    temperatures = np.append(T_REF, np.linspace(*RANGE, 13))
    if law == "entropic":
        factors = temperatures / T_REF * np.exp(-6e-4 * (temperatures - T_REF))
    else:
        factors = np.exp(np.asarray(TABLE.log_factor(temperatures, T_REF)))
    found = np.asarray(rf.complex_modulus(back, 10.0, temperatures))
    exact = np.array([modulus(10.0, T, b_T) for T, b_T in zip(temperatures, factors, strict=True)])
    np.testing.assert_allclose(found / exact, 1, atol=3e-4)
    assert found[0] == pytest.approx(exact[0], rel=1e-9)


def test_a_vertical_shift_is_not_left_out_of_cards():
    for program in ("comsol", "lsdyna"):
        with pytest.raises(ValueError, match=f"vertical = Entropic: must be None for {program}; shift=False"):
            write_prony(None, rubber(rf.Entropic()), program, bulk=2e9, density=1100.0)
    with pytest.raises(ValueError, match=r"temperature is missing: must be \(lowest, highest\)"):
        write_prony(None, rubber(rf.Entropic()))
    with pytest.raises(ValueError, match=r"bulk = .*: must be None with the vertical shift"):
        write_prony(None, rubber(TABLE, 0.5), bulk=2e9)
    with pytest.raises(ValueError, match=r"must include T_ref = 293.15 K"):
        write_prony(None, rubber(TABLE), temperature=(300.0, 320.0))
    with pytest.raises(ValueError, match=r"must be \(lowest, highest\) \[K\], in this order"):
        write_prony(None, rubber(TABLE), temperature=(320.0, 280.0))
    with pytest.raises(ValueError, match="must not be given; the material has no vertical shift"):
        write_prony(None, rubber(None), temperature=RANGE)


def test_the_format_of_the_rows():
    """*ELASTIC rows end with the temperature in rising order, MPTEMP and MPDATA have six values a line."""
    lines = write_prony(None, rubber(TABLE), **FILE).splitlines()
    first = lines.index("*ELASTIC, MODULI=INSTANTANEOUS") + 1
    rows = np.array([[float(x) for x in line.split(",")] for line in lines[first:] if line[0] != "*"][:99])
    rows = rows[rows[:, 1] == 0.499]
    np.testing.assert_allclose(rows[[0, -1], 0], [1.2 * 8, 0.7 * 8], rtol=1e-12)
    np.testing.assert_allclose(rows[[0, -1], 2], [0.0, 60.0], atol=1e-9)
    assert (np.diff(rows[:, 2]) > 0).all()
    text = write_prony(None, rubber(TABLE), "ansys", unit_stress="MPa")
    data = [line.split(",") for line in text.splitlines() if line.startswith(("MPTEMP,", "MPDATA,"))]
    assert all(len(fields) <= (8 if fields[0] == "MPTEMP" else 10) for fields in data)
    assert [int(fields[1]) for fields in data if fields[0] == "MPTEMP"][:2] == [1, 7]


def test_neo_hookean_cards():
    """C10 = G_0 / 2 and D1 = 2 / B_0 with G_0 = E_0 / (2 (1 + nu)) and B_0 = E_0 / (3 (1 - 2 nu))."""
    material = rf.Prony(1e6, E, TAU, 0.49)
    text = write_prony(None, material, hyperelastic=True, unit_stress="MPa")
    row = text.splitlines()[text.splitlines().index("*HYPERELASTIC, NEO HOOKE, MODULI=INSTANTANEOUS") + 1]
    shear, bulk = 8 / 2.98, 8 / 0.06
    np.testing.assert_allclose([float(x) for x in row.split(",")], [shear / 2, 2 / bulk], rtol=1e-12)
    text = write_prony(None, material, "ansys", hyperelastic=True, unit_stress="MPa")
    ((mu, d),) = re.findall(r"TB,HYPER,1,1,,NEO\nTBDATA,1,(\S+),(\S+)", text)
    np.testing.assert_allclose([float(mu), float(d)], [shear, 2 / bulk], rtol=1e-12)
    row = write_prony(None, rf.Prony(1e6, E, TAU, 0.5), hyperelastic=True).splitlines()[3]
    np.testing.assert_allclose([float(x) for x in row.split(",")], [8e6 / 6, 0.0], rtol=1e-12)
    with pytest.raises(ValueError, match="hyperelastic = True: must be False for comsol"):
        write_prony(None, material, "comsol", hyperelastic=True, bulk=2e9)


@pytest.mark.parametrize("program", ["abaqus", "openradioss"])
@pytest.mark.parametrize("vertical", [rf.Entropic(), None], ids=["entropic", "none"])
def test_cards_at_one_temperature(program, vertical, tmp_path):
    material, path, T = rubber(vertical), tmp_path / "cards", 313.15
    options = {"density": 1100.0} if program == "openradioss" else {}
    write_prony(path, material, program, shift=False, temperature=T, unit_stress="MPa", **options)
    back = read_prony(path, unit_stress="MPa")
    assert back.shift is None
    for omega in (1.0, 1e4):
        exact = modulus(omega, T, 1.0 if vertical is None else T / T_REF)
        assert complex(rf.complex_modulus(back, omega)) == pytest.approx(exact, rel=1e-9)
    with pytest.raises(ValueError, match=r"temperature = .*: must not be given; the material has no shift"):
        write_prony(None, rf.Prony(1e6, E, TAU), shift=False, temperature=T)


# --- *MAT_006

MAT_006 = """*KEYWORD
*MAT_VISCOELASTIC
$#     mid        ro      bulk        g0        gi      beta
         3   1.10E-9    2000.0       5.0       2.0     100.0
*MAT_006_TITLE
soft
         4   1.10E-9    1000.0       3.0       1.0      50.0
*MAT_ELASTIC
         5   7.80E-9     2.1E5       0.3
*END
"""


@pytest.mark.parametrize(
    ("name", "bulk", "glassy", "relaxed", "rate"), [(3, 2e9, 5e6, 2e6, 100.0), ("soft", 1e9, 3e6, 1e6, 50.0)]
)
def test_a_material_with_one_term(name, bulk, glassy, relaxed, rate, tmp_path):
    """G(t) = G_I + (G_0 - G_I) exp(-beta t) and E = 9 B G / (3 B + G), at omega = 2 beta."""
    path = tmp_path / "one.k"
    path.write_text(MAT_006)
    material = read_prony(path, unit_stress="MPa", name=name)
    assert isinstance(material, rf.PronyShear)
    shear = relaxed + (glassy - relaxed) * 2j / (1 + 2j)
    exact = 9 * bulk * shear / (3 * bulk + shear)
    assert complex(rf.complex_modulus(material, 2 * rate)) == pytest.approx(exact, rel=1e-12)
    assert float(material.G_inf) == pytest.approx(relaxed, rel=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("   5.0       2.0", "   2.0       5.0", "must be G0 > GI >= 0"),
        ("    100.0", "      0.0", "BETA = 0: must be > 0"),
        ("    2000.0", "       0.0", "BULK = 0: must be > 0"),
    ],
)
def test_bad_values(old, new, message, tmp_path):
    path = tmp_path / "one.k"
    path.write_text(MAT_006.replace(old, new, 1))
    with pytest.raises(ValueError, match=message):
        read_prony(path, unit_stress="MPa", name=3)
