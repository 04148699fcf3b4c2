"""Columns of wheel testers: slip angle, slip ratio, speed, load, forces and aligning moment."""

import math

import numpy as np
import pytest
from support import exports

import fitting
import rubberfric as rf

QUANTITIES = ("v_travel", "F_n", "F_t")
SLIP = ("slip_angle", "slip_ratio", "moment", "T")
# Titles of one LAT100 measurement, with the same quantities in other units.
ENGLISH = "slip angle [deg],speed [km/h],load [N],side force [N],aligning moment [Nm],T [°C]"
GERMAN = (
    "Schräglaufwinkel [°];Fahrgeschwindigkeit [m/s];Radlast [kN];Seitenkraft [N];Rückstellmoment [N mm];"
    "Temp. [°C]"
)
FRENCH = (
    "angle de dérive (rad);vitesse (mph);charge (kgf);force latérale (kN);moment d'auto-alignement (N·m);"
    "température (K)"
)
TABLES = (
    (ENGLISH, (5.0, 3.6, 75.0, -60.0, 0.5, 23.0)),
    (GERMAN, (5.0, 1.0, 0.075, -60.0, 500.0, 23.0)),
    (FRENCH, (math.radians(5.0), 1 / 0.44704, 75 / 9.80665, -0.06, 0.5, 296.15)),
)


def put(folder, titles, row):
    between = ";" if ";" in titles else ","
    return exports.put(folder, f"{titles}\n{between.join(map(repr, row))}\n")


@pytest.mark.parametrize(("titles", "row"), TABLES)
def test_conditions_and_forces_of_a_wheel(tmp_path, titles, row):
    table = rf.io.read_table(put(tmp_path, titles, row), QUANTITIES, SLIP, increasing=False)
    found = [table[name][0] for name in (*QUANTITIES, "slip_angle", "moment", "T")]
    np.testing.assert_allclose(found, [1.0, 75.0, -60.0, math.radians(5.0), 0.5, 296.15], rtol=1e-12)
    assert "slip_ratio" not in table


@pytest.mark.parametrize(
    "titles",
    [
        "slip angle [deg],speed [km/h],load [N],side force coefficient [-]",
        "Schräglaufwinkel [°];Geschwindigkeit [km/h];Last [N];Seitenkraftbeiwert",
    ],
)
@pytest.mark.parametrize("sign", [1, -1])
def test_sliding_velocity_of_a_wheel_at_a_slip_angle(tmp_path, titles, sign):
    """The columns of the LAT100."""
    between = ";" if ";" in titles else ","
    rows = [between.join(map(str, row)) for row in ((sign * 1, 0.2, 75, 0.6), (sign * 6, 2.0, 75, 0.75))]
    path = tmp_path / "wheel.csv"
    path.write_text("\n".join([titles, *rows]) + "\n", encoding="utf-8")
    data = fitting.read(path, area=3e-4)
    np.testing.assert_allclose(data.velocity, [9.696e-4, 5.807e-2], rtol=1e-4)
    np.testing.assert_allclose(data.friction, [0.6, 0.75])
    np.testing.assert_allclose(data.pressure, 2.5e5)


@pytest.mark.parametrize(
    ("slip", "value", "velocity", "force"),
    [
        ("slip angle [deg]", 30.0, 10 * 0.5, 400.0),
        ("slip angle [deg]", -30.0, 10 * 0.5, 400.0),
        ("slip ratio [%]", -5.0, 10 * 0.05, 300.0),
        ("Schlupf [-]", -0.05, 10 * 0.05, 300.0),
    ],
)
def test_the_force_along_the_slip_gives_the_friction(tmp_path, slip, value, velocity, force):
    """The slip velocity is v sin(angle) or v times the ratio."""
    path = put(tmp_path, f"{slip},speed [m/s],Fz [N],Fx [N],Fy [N]", (value, 10.0, 500.0, 300.0, 400.0))
    data = fitting.read(path, area=5e-3)
    np.testing.assert_allclose(data.velocity, velocity, rtol=1e-14)
    np.testing.assert_allclose(data.friction, force / 500, rtol=1e-14)
    np.testing.assert_allclose(data.pressure, 1e5, rtol=1e-14)


def test_combined_slip(tmp_path):
    """The velocity of the tread relative to the road, as vectors: travel (v cos a, v sin a), tread (V, 0)."""
    v, angle, ratio = 10.0, 0.2, 0.1
    tread = (1 + ratio) * v * math.cos(angle)
    slip = math.hypot(tread - v * math.cos(angle), v * math.sin(angle))
    titles = "slip angle [rad],slip ratio [-],travel speed [m/s],mu [-],p [bar]"
    data = fitting.read(put(tmp_path, titles, (angle, ratio, v, 0.8, 2.0)))
    np.testing.assert_allclose(data.velocity, slip, rtol=1e-14)
