"""Tables of mu(v, p, T) for other programs, checked by separate readers, with their stated accuracy."""

import json

import numpy as np
import pytest
from problems import RIGID, SHIFTED_TREAD, scene
from support.refusals import refused

import fitting
import rubberfric as rf

ROUGH = scene((SHIFTED_TREAD,), (RIGID, rf.SelfAffine(100.0, 1000.0, 1e4, 0.8, 3e-4)))
SPEED = (1e-3, 1.0)  # [m/s]
PRESSURE = (1e5, 4e5)  # [Pa]
TEMPERATURE = (283.15, 313.15)  # [K]
QUICK = rf.Quadrature(order=8, panels=3)


@pytest.fixture(scope="module")
def table():
    found = rf.analysis.friction_table(
        ROUGH, SPEED, PRESSURE, TEMPERATURE, error=0.02, quadrature=QUICK, title="tread"
    )
    return found._replace(sigma=0.05 * found.friction)


def abaqus_mu(text, v, p, T):
    """mu at a point of a *FRICTION, read and interpolated without the project's code."""
    lines = text.splitlines()
    start = lines.index("*FRICTION") + 1
    rows = [tuple(map(float, line.split(","))) for line in lines[start:]]
    assert rows == sorted(rows, key=lambda row: (row[3], row[2], row[1]))  # slip rate first, all rising
    values = {row[1:]: row[0] for row in rows}
    axes = [sorted({row[i] for row in rows}) for i in (1, 2, 3)]
    assert len(values) == len(rows) == np.prod([len(axis) for axis in axes])
    total, corners = 0.0, []
    for axis, x in zip(axes, (v, p, T), strict=True):
        above = next(i for i, a in enumerate(axis) if a >= x and i > 0)
        low, high = axis[above - 1], axis[above]
        corners.append([(low, (high - x) / (high - low)), (high, (x - low) / (high - low))])
    for a, wa in corners[0]:
        for b, wb in corners[1]:
            for c, wc in corners[2]:
                total += wa * wb * wc * values[a, b, c]
    return total


def lsdyna_tables(text):
    """{temperature in the comment: {pressure: [(v, mu)]}} of a keyword file, by columns of 20."""
    lines, curves, tables, at = text.splitlines(), {}, {}, {}
    for i, line in enumerate(lines):
        if line.startswith("$ Table"):
            at[int(line.split()[2])] = float(line.split()[5])
        if line[:1] != "*":
            continue
        cards = []
        for card in lines[i + 1 :]:
            if card.startswith("*"):
                break
            if not card.startswith("$"):
                cards.append(card)
        assert all(len(card) in (10, 40) for card in cards)
        pairs = [(float(card[:20]), float(card[20:])) for card in cards[1:]]
        {"*DEFINE_TABLE_2D": tables, "*DEFINE_CURVE": curves}[line][int(cards[0])] = pairs
    return {at[n]: {p: curves[int(c)] for p, c in rows} for n, rows in tables.items()}


def points(count):
    """Random points inside the ranges."""
    rng = np.random.default_rng(0)
    v = np.exp(rng.uniform(*np.log(SPEED), count))
    return v, rng.uniform(*PRESSURE, count), rng.uniform(*TEMPERATURE, count)


def test_the_error_is_as_stated(table, tmp_path):
    v, p, T = points(64)
    exact = np.asarray(rf.friction(ROUGH, v, p, T, quadrature=QUICK))
    text = rf.io.write_friction(
        tmp_path / "t.inp", table, unit_velocity="mm/s", unit_pressure="MPa", unit_temperature="C"
    )
    found = np.array([abaqus_mu(text, *x) for x in zip(v * 1e3, p * 1e-6, T - 273.15, strict=True)])
    worst = np.max(np.abs(found / exact - 1))
    assert table.error <= 0.02
    assert 0.003 < worst <= table.error  # and not refined for nothing
    np.testing.assert_allclose(table.at(v, p, T), found, rtol=1e-12)
    assert "** Units: mm/s, MPa, C" in text and f"at most {table.error:.2g}" in text
    assert table.friction.size < 3000


def test_a_curve_at_one_condition():
    table = rf.analysis.friction_table(ROUGH, SPEED, 2e5, error=0.05, quadrature=QUICK)
    assert table.temperature is None and table.friction.shape == (1, 1, table.velocity.size)
    fine = rf.analysis.friction_table(ROUGH, SPEED, 2e5, error=0.0005, quadrature=QUICK)
    ratio = fine.velocity.size / table.velocity.size  # of second order: ten times as many for 1/100
    assert 5 < ratio < 20
    v = np.geomspace(*SPEED, 301)
    exact = np.asarray(rf.friction(ROUGH, v, 2e5, quadrature=QUICK))
    assert np.max(np.abs(fine.at(v, 2e5) / exact - 1)) <= fine.error <= 0.0005
    assert fine.at(1e-9, 1.0) == fine.friction[0, 0, 0]  # as the programs keep it beyond the ends


def test_lsdyna(table, tmp_path):
    text = rf.io.write_friction(tmp_path / "t.k", table, unit_pressure="MPa", unit_temperature="C")
    found = lsdyna_tables(text)
    np.testing.assert_allclose(list(found), table.temperature - 273.15, rtol=1e-12)
    for k, rows in enumerate(found.values()):
        np.testing.assert_allclose(list(rows), table.pressure / 1e6, rtol=1e-12)
        for j, curve in enumerate(rows.values()):
            np.testing.assert_allclose([v for v, _ in curve], table.velocity, rtol=1e-12)
            np.testing.assert_allclose([mu for _, mu in curve], table.friction[k, j], rtol=1e-12)


@pytest.mark.parametrize("name", ["t.inp", "t.k", "t.csv", "t.json"])
def test_back_again(name, table, tmp_path):
    units = {"unit_velocity": "mm/s", "unit_pressure": "kPa", "unit_temperature": "C"}
    path = tmp_path / name
    rf.io.write_friction(path, table, **(units if name in ("t.inp", "t.k") else {}))
    found = rf.io.read_friction(path)
    for field in ("velocity", "pressure", "temperature", "friction"):
        np.testing.assert_allclose(getattr(found, field), getattr(table, field), rtol=1e-12)
    if name in ("t.csv", "t.json"):
        np.testing.assert_allclose(found.sigma, table.sigma, rtol=1e-12)
    if name == "t.csv":
        data = fitting.read(path)
        assert len(data) == table.friction.size and data.sigma is not None
    if name == "t.json":
        content = json.loads(path.read_text())
        assert content["friction"]["values"][0][-1][0] == table.friction[0, -1, 0]
        assert content["velocity"]["unit"] == "m/s"


def test_the_text_of_the_established_program(tmp_path):
    velocity = np.logspace(-3, 0, 7)
    result = rf.friction_map(ROUGH, velocity, 2e5, 293.15, quadrature=QUICK)
    path = tmp_path / "curve.txt"
    text = rf.io.write_friction(path, result)
    names, units, *rows = [line.split(",") for line in text.splitlines()]
    assert names == ["log10_v", "mu_visc", "A_over_A0"] and units == ["log10(m/s)", "-", "-"]
    columns = np.array(rows, float).T
    np.testing.assert_allclose(columns[0], np.log10(velocity), atol=1e-9)
    np.testing.assert_allclose(columns[1], result.solution.friction[0, 0], rtol=1e-9)
    found = rf.io.read_friction(path, pressure=2e5)
    np.testing.assert_allclose(found.area, result.solution.area, rtol=1e-9)
    assert len(fitting.read(path, pressure=2e5, relative=0.02, kind="friction")) == 7
    assert "pressure is missing" in refused(path, lambda: rf.io.read_friction(path))


def test_maps_in_any_order_become_tables(tmp_path):
    result = rf.friction_map(ROUGH, [1.0, 0.1, 0.01], [2e5, 1e5], quadrature=QUICK)
    rf.io.write_friction(tmp_path / "t.json", result)
    found = rf.io.read_friction(tmp_path / "t.json")
    assert found.velocity.tolist() == [0.01, 0.1, 1.0] and found.temperature is None
    np.testing.assert_array_equal(found.friction, np.asarray(result.solution.friction)[:, ::-1, ::-1])


OF_OTHERS = """*Surface Interaction, name=road
1.,
*Friction, slip tolerance=0.005
 0.8, 0., 0.1
 0.9, 10., 0.1
 0.6, 0., 1.
 0.7, 10., 1.
*Surface Behavior
"""


def test_cards_of_others(tmp_path):
    path = tmp_path / "deck.inp"
    path.write_text(OF_OTHERS)
    assert "unit_velocity is missing: must be given" in refused(path, lambda: rf.io.read_friction(path))
    found = rf.io.read_friction(path, unit_velocity="mm/s", unit_pressure="MPa")
    np.testing.assert_allclose(found.velocity, [0.0, 0.01], rtol=1e-15)
    np.testing.assert_allclose(found.pressure, [1e5, 1e6], rtol=1e-15)
    assert found.friction.tolist() == [[[0.8, 0.9], [0.6, 0.7]]]
    path.write_text(OF_OTHERS.replace(" 0.7, 10., 1.\n", ""))
    message = refused(path, lambda: rf.io.read_friction(path, unit_velocity="mm/s", unit_pressure="MPa"))
    assert "has 3 points for 2 x 2 values of pressure, velocity: must have every combination" in message


def test_scattered_points_are_refused_without_their_grid(tmp_path):
    """The grid over 50 000 distinct velocities, pressures and temperatures has 1e14 points."""
    path, x = tmp_path / "t.csv", np.arange(1, 50_001)
    rf.io.write_table(path, {"v": x, "p": 1e3 * x, "T": 200 + 1e-3 * x, "mu": np.ones(x.size)})
    message = refused(path, lambda: rf.io.read_friction(path))
    assert "has 50000 points for 50000 x 50000 x 50000 values of temperature, pressure, vel" in message


def test_refused(table, tmp_path):
    def write(name, source=table, **options):
        return refused(tmp_path / name, lambda: rf.io.write_friction(tmp_path / name, source, **options))

    assert "suffix '.dat': must be .inp" in write("t.dat")
    assert "program = 'nastran': must be one of abaqus" in write("t.inp", program="nastran")
    with pytest.raises(ValueError, match=r"unit_pressure = 'psi': must be one of Pa"):
        rf.io.write_friction(tmp_path / "t.inp", table, unit_pressure="psi")
    assert "must be m/s, Pa and K" in write("t.csv", unit_pressure="MPa")
    with pytest.raises(ValueError, match=r"must have one of each for log10"):
        rf.io.write_friction(tmp_path / "t.txt", table)
    with pytest.raises(ValueError, match=r"velocity is missing: must be given as to solve and friction"):
        rf.io.write_friction(tmp_path / "t.inp", 0.5)
    falling = table._replace(velocity=table.velocity[::-1])
    with pytest.raises(ValueError, match=r"velocity\[1\].*: must increase strictly"):
        rf.io.write_friction(tmp_path / "t.inp", falling)
    with pytest.raises(ValueError, match=r"friction.*: must be >= 0"):
        rf.io.write_friction(tmp_path / "t.inp", table._replace(friction=-table.friction))
    with pytest.raises(ValueError, match=r"velocity = \(1, 0.1\): velocity must be \(lowest, highest\)"):
        rf.analysis.friction_table(ROUGH, (1, 0.1), 1e5)
    with pytest.raises(ValueError, match=r"friction is 0 at some points"):
        rf.analysis.friction_table(scene((rf.Elastic(1e6, 0.5),), (RIGID, ROUGH.upper.spectrum)), SPEED, 1e5)
    assert list(tmp_path.iterdir()) == []
