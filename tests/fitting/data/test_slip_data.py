"""Slip data: what constructors take, tables of wheel testers, signs, frames and files."""

import re

import numpy as np
import pandas
import pytest

import fitting
from fitting import MomentData, SlipData

ANGLE = np.radians([1.0, 2.0, 4.0])
FORCE = [400.0, 800.0, 1400.0]
CONDITIONS = {"speed": 10.0, "load": 3e3, "temperature": 293.15}
TITLES = "slip angle [deg],speed [km/h],load [kN],side force [kN],aligning moment [Nm],T [°C]"
ROWS = ("1,36,3,-.4,-5,20", "2,36,3,-.8,-9,20", "4,36,3,-1.4,-12,20")


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "drum.csv"
    path.write_text("\n".join([TITLES, *ROWS]), encoding="utf-8")
    return path


def equal(found, expected):
    assert type(found) is type(expected)
    for name in expected.fields():
        if getattr(expected, name) is None:
            assert getattr(found, name) is None
        else:
            np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-14)


def test_a_wheel_tester(table):
    """Side forces that are negative at positive angles are reversed, in kN, degrees and km/h."""
    equal(fitting.read(table), SlipData(angle=ANGLE, force=FORCE, **CONDITIONS))
    equal(fitting.read(table, kind="moment"), MomentData(angle=ANGLE, moment=[5.0, 9.0, 12.0], **CONDITIONS))


def test_mixed_signs_stay(table):
    rows = [ROWS[0], "-2,36,3,-.8,9,20", ROWS[2]]
    table.write_text("\n".join([TITLES, *rows]), encoding="utf-8")
    with pytest.raises(ValueError, match=r"force\[0\] = -400.0: must be > 0 with relative errors or none"):
        fitting.read(table)


@pytest.mark.parametrize("suffix", ["csv", "h5"])
@pytest.mark.parametrize(
    "data",
    [
        SlipData(angle=ANGLE, force=FORCE, **CONDITIONS, relative=0.03),
        SlipData(ratio=[-0.05, -0.1], force=[-700.0, 5.0], sigma=30.0, speed=[5.0, 10.0], load=3e3),
        MomentData(angle=ANGLE, moment=[5.0, 9.0, 12.0], sigma=[0.5, 0.5, 1.0], **CONDITIONS),
    ],
    ids=["angle", "ratio", "moment"],
)
def test_files(data, suffix, tmp_path):
    data.write(tmp_path / f"data.{suffix}")
    equal(fitting.read(tmp_path / f"data.{suffix}"), data)


def test_frames():
    frame = pandas.DataFrame(
        {"Schräglaufwinkel [°]": [1.0, 2.0], "Fz [N]": 3e3, "Fy [N]": FORCE[:2], "v_travel [m/s]": 10.0}
    )
    data = SlipData.from_frame(frame, temperature=293.15)
    equal(data, SlipData(angle=ANGLE[:2], force=FORCE[:2], **CONDITIONS))
    equal(SlipData.from_frame(data.to_dataframe()), data)
    np.testing.assert_array_equal(data.abscissa, data.angle)
    assert data.label == "force, 2 points, 20 °C"
    assert data.place(1) == "angle = 0.0349066 rad, speed = 10 m/s, load = 3000 N, temperature = 293.15 K"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"angle": None}, "SlipData: none is given; must be one of angle [rad] and ratio [-]"),
        ({"ratio": 0.1}, "SlipData: both are given; must be one of angle [rad] and ratio [-]"),
        ({"angle": [5.0, 6.0, 7.0]}, "angle[0] = 5.0: must be between -pi/2 and pi/2; is it in degrees?"),
        ({"angle": None, "ratio": [-5.0, 1.0, 2.0]}, "ratio[0] = -5.0: must be > -1; is it in percent?"),
        ({"angle": None, "ratio": [5.0, 10.0, 20.0]}, "ratio[0] = 5.0: must be < 5; is it in percent?"),
        ({"speed": 500.0}, "speed = 500.0: must be <= 200 m/s; is it in km/h or mm/s?"),
        ({"load": 0.0}, "load = 0.0: must be > 0"),
        ({"load": None}, "SlipData.load is missing: must be given, in N"),
        ({"force": -1.0}, "SlipData.force"),
    ],
)
def test_refused(change, message):
    given = {"angle": ANGLE, "force": FORCE, **CONDITIONS} | change
    with pytest.raises(ValueError, match=re.escape(message)):
        SlipData(**given)
