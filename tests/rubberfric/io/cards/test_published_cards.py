"""E_inf and E* at 100 rad/s of one card of every kind, by the formulas of the manuals.

All materials have the weights 0.5 and 0.3 of the glassy shear modulus and the times 1e-4 and 1e-2 s, or the
same shear moduli in LS-DYNA. The strain energies have the shear modulus of the manuals at small strain.
"""

import pytest

import rubberfric as rf

OMEGA = 100.0  # [rad/s]
# (1 - sum g) + sum g_i i omega tau_i / (1 + i omega tau_i)
SHAPE = 0.2 + 0.5 * 0.01j / (1 + 0.01j) + 0.3 * 1j / (1 + 1j)
# Eight-chain model with the limiting stretch 7: mu_0 / mu.
CHAINS = 1 + 3 / (5 * 7**2) + 99 / (175 * 7**4) + 513 / (875 * 7**6) + 42039 / (67375 * 7**8)

ABAQUS = "*MATERIAL, NAME=TREAD\n{}\n*VISCOELASTIC, TIME=PRONY\n0.5, 0., 1e-4\n0.3, 0., 1e-2\n"
OTHER = "*MATERIAL, NAME=BASE\n*ELASTIC\n9., 0.5\n*VISCOELASTIC, TIME=PRONY\n0.9, 0., 1.\n"
ANSYS = "{}\nTB,PRONY,4,1,2,SHEAR\nTBDATA,1,0.5,1e-4,0.3,1e-2\n"
STEEL = "MP,EX,1,2.1e11\nMP,PRXY,1,0.3\n"


def dyna(keyword, cards, G_0, relaxed):
    rows = [(0.2 * G_0, 0.0)] * relaxed + [(0.5 * G_0, 1e4), (0.3 * G_0, 1e2)]
    lines = [*(",".join(map(str, card)) for card in cards), *(f"{G},{rate}" for G, rate in rows)]
    return "\n".join((f"*{keyword}", *lines)) + "\n"


CASES = {
    # name: text, options, glassy shear modulus [Pa], bulk modulus [Pa] or None: incompressible
    "abaqus neo-Hooke, long term": (ABAQUS.format("*HYPERELASTIC, NEO HOOKE\n0.5, 0.02"), {}, 5e6, 1e8),
    "abaqus Mooney-Rivlin, instantaneous": (
        ABAQUS.format("*HYPERELASTIC, MOONEY-RIVLIN, MODULI=INSTANTANEOUS\n2.0, 0.5, 0."),
        {},
        *(5e6, None),
    ),
    "abaqus Yeoh, by name": (
        OTHER + ABAQUS.format("*HYPERELASTIC, YEOH, MODULI=INSTANTANEOUS\n2.5, -0.1, 0.01, 0.001"),
        {"name": "tread"},
        *(5e6, 2e9),
    ),
    "abaqus Arruda-Boyce": (
        ABAQUS.format("*HYPERELASTIC, ARRUDA-BOYCE, MODULI=INSTANTANEOUS\n4.0, 7.0, 0.001"),
        {},
        *(4e6 * CHAINS, 2e9),
    ),
    "ansys neo-Hooke, by number": (
        STEEL + ANSYS.format("TB,HYPER,4,1,,NEO\nTBDATA,1,5.0,0.001"),
        {"name": 4},
        *(5e6, 2e9),
    ),
    "ansys Mooney-Rivlin": (ANSYS.format("TB,HYPER,4,1,2,MOONEY\nTBDATA,1,2.0,0.5,0.001"), {}, 5e6, 2e9),
    "ansys Yeoh": (ANSYS.format("TB,HYPER,4,1,3,YEOH\nTBDATA,1,2.5,-0.1,0.01,0.001"), {}, 5e6, 2e9),
    "ansys Arruda-Boyce": (
        ANSYS.format("TB,HYPER,4,1,,BOYCE\nTBDATA,1,4.0,7.0,0.001"),
        {},
        *(4e6 * CHAINS, 2e9),
    ),
    "lsdyna 076": (
        dyna("MAT_GENERAL_VISCOELASTIC", [(1, 1.1e-9, 2000.0), (0,)], 5.0, relaxed=True),
        {},
        *(5e6, 2e9),
    ),
    # G_inf = 2 (C10 + C01) = 1, B = 2 G (1 + nu) / (3 (1 - 2 nu))
    "lsdyna 077_H": (
        dyna("MAT_077_H", [(1, 1.1e-9, 0.495, 0, 2), (0.4, 0.1)], 5.0, relaxed=False),
        {},
        *(5e6, 2 * 1e6 * 1.495 / (3 * 0.01)),
    ),
    # G_inf = sum(mu alpha) / 2 = (0.8 * 3 + 0.2 * (-2)) / 2 = 1
    "lsdyna 077_O": (
        dyna("MAT_077_O", [(1, 1.1e-9, 0.495, 0, 2), (0.8, 0.2), (3.0, -2.0)], 5.0, relaxed=False),
        {},
        *(5e6, 2 * 1e6 * 1.495 / (3 * 0.01)),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_moduli(case, tmp_path):
    text, options, glassy, bulk = CASES[case]
    path = tmp_path / "cards"
    path.write_text(text)
    material = rf.io.read_prony(path, unit_stress="MPa", **options)
    for omega, shear in ((0.0, 0.2 * glassy), (OMEGA, glassy * SHAPE)):
        exact = 3 * shear if bulk is None else 9 * bulk * shear / (3 * bulk + shear)
        assert complex(rf.complex_modulus(material, omega)) == pytest.approx(exact, rel=1e-9)


def test_rows_over_temperature(tmp_path):
    """At 60 °C, with a_T of the WLF shift, E* is 0.8 times that at the reduced frequency."""
    path = tmp_path / "cards.inp"
    rows = "*HYPERELASTIC, NEO HOOKE\n0.5, 0., 20.\n0.4, 0., 60."
    path.write_text(ABAQUS.format(rows) + "*TRS\n20., 8.86, 101.6\n")
    material = rf.io.read_prony(path, unit_stress="MPa", unit_temperature="C")
    x = 1j * OMEGA * 10 ** (-8.86 * 40 / 141.6)
    shape = 0.2 + 0.5 * x * 1e-4 / (1 + x * 1e-4) + 0.3 * x * 1e-2 / (1 + x * 1e-2)
    found = complex(rf.complex_modulus(material, OMEGA, 333.15))
    assert found == pytest.approx(0.8 * 15e6 * shape, rel=1e-9)
