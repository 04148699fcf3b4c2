"""The table of theory over boundary elements equals its script; look-up and command."""

import numpy as np
import pytest
from problems import RIGID, ROAD, TREAD, scene
from support.folders import DATA
from support.processes.notebooks import script

import rubberfric as rf
from rubberfric.analysis import theory_error
from rubberfric.analysis.validity import AREAS, RATIOS
from rubberfric.commands.main import main


@pytest.fixture(scope="module")
def table():
    return script("boundary_elements")


@pytest.fixture(scope="module")
def rows(table):
    return table.read()


def test_every_case_is_there_once(table, rows):
    assert len({table.key_of(row) for row in rows}) == len(rows) == sum(1 for _ in table.cases())


@pytest.mark.parametrize("inside", [False, True])
def test_ranges_contain_the_cases_of_this_table(table, rows, inside):
    """The ranges are from other cases (test_law_and_boundary_elements.py). Nine of ten cases are in them."""
    assert AREAS == table.AREAS
    shares = []
    for row in table.numbers(rows):
        area, friction = (
            row[f"{name}_{'inside' if inside else 'plain'}_0.5"] for name in ("area", "friction")
        )
        k = int(np.searchsorted(AREAS, area, side="right")) - 1
        if row["relaxation"] == "elastic" or not 0 <= k < 5:
            continue
        low, high, least, most = RATIOS[inside, row["relaxation"]][k]
        shares.append((low <= area / row["area"] <= high, least <= friction / row["friction"] <= most))
    assert len(shares) > 200 and np.all(np.mean(shares, axis=0) >= 0.9), np.mean(shares, axis=0)


@pytest.mark.slow
def test_the_table_can_be_made_again(table, rows):
    """The theory of three cases, and the boundary elements of one."""
    known = table.numbers(rows)
    for row in known[:: len(known) // 3]:
        case = table.scene_of(*(row[name] for name in ("ratio", "rolloff", "hurst", "relaxation")))
        case = case.replace(area_correction=True)
        found = rf.solve(case, row["velocity"], row["pressure"], quantities=("area", "friction"))
        np.testing.assert_allclose(found.area, row["area_inside_0.5"], rtol=1e-4)
        np.testing.assert_allclose(found.friction, row["friction_inside_0.5"], rtol=1e-4)
    row = next(row for row in known if row["load"] == 0.12 and row["grid"] == 256)
    case = table.scene_of(row["ratio"], row["rolloff"], row["hurst"], row["relaxation"])
    found, _, _ = table.measured(case, row["velocity"], row["pressure"], 256, 4)
    np.testing.assert_allclose(found["friction"].mean(), row["friction"], rtol=1e-3)
    np.testing.assert_allclose(found["area"].mean(), row["area"], rtol=1e-3)


def test_what_is_covered():
    own = scene((RIGID, ROAD), (TREAD,))
    found = theory_error(own, [1e-4, 0.02, 0.05])
    assert found.contact == (0.02, 0.05) and found.relaxation == "broad"
    rows = np.array(RATIOS[False, "broad"][1:3])
    assert found.area == (rows[:, 0].min(), rows[:, 1].max())
    assert found.friction == (rows[:, 2].min(), rows[:, 3].max())
    one = theory_error(scene((TREAD.replace(tau=[1e-4] * 3),), (RIGID, ROAD), area_correction=True), 0.05)
    assert one.relaxation == "narrow" and one.friction == RATIOS[True, "narrow"][2][2:]
    by_law = own.replace(contact_model="boundary_elements")
    low, high = RATIOS["boundary_elements", "broad"][2][2:]
    for decades in (0.0, 2.0):
        law = theory_error(
            by_law.replace("lower.spectrum.q1", 5.12e4 * 10**decades).replace("lower.spectrum.qr", 800.0),
            0.05,
        )
        growth = 0.1 * np.log10(8) + 0.05 * decades
        np.testing.assert_allclose(law.friction, (low * np.exp(-growth), high * np.exp(growth)))
        assert law.extrapolated == pytest.approx(decades)
    assert theory_error(own, 1e-4) is None
    for other in (
        own.replace(gamma=0.8),
        own.replace("lower.spectrum.q1", 1e6),
        own.replace("lower.spectrum.hurst", 0.45),
        own.replace("lower.spectrum.q1", 1.5e3),
        scene((RIGID, ROAD), (TREAD, ROAD)),
        scene((RIGID, ROAD), (rf.Elastic(1e6, 0.5),)),
        scene((RIGID, ROAD), (TREAD, None, rf.Slab(1e-3))),
        scene((RIGID, ROAD), (TREAD,), heating=rf.Heating(1e3, 1e3, 0.2, 1e-3)),
    ):
        assert theory_error(other, 0.05) is None


@pytest.mark.slow
def test_the_command_says_it(call_main):
    status, printed, _ = call_main(main, "run", DATA / "tread_on_asphalt.toml")
    assert status == 0 and "contact model: theory as in the paper\n" in printed
    assert "its error against boundary elements of such scenes\n(A/A0 0.0" in printed
    assert "A/A0 is off by -" in printed and " %, mu by -" in printed
    status, printed, _ = call_main(main, "run", DATA / "two_rubbers.toml")
    assert status == 0 and "boundary elements" not in printed
