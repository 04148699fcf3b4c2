"""Quantities that a table states through others: phase angles, forces, loads, speeds and slip angles."""

import math

import numpy as np
import pytest
from support.exports import put
from support.refusals import refused

import fitting

# Rows |E*| [MPa], delta [deg], E' [MPa], E'' [MPa] of a master curve, computed by another program.
PHASES = (
    (3.25415, 4.4986, 3.24412, 0.255238),
    (5.36887, 14.94, 5.18738, 1.38413),
    (8.25034, 16.926, 7.89295, 2.40197),
)
ANGLES = ("delta [°]", "δ/°", "Phase angle [deg]", "Phase Angle (°)", "phase_deg", "loss angle [degrees]")
ANGLES += ("Phasenwinkel [°]", "Phasenverschiebung in °", "Verlustwinkel [Grad]", "angle de phase (°)")


@pytest.mark.parametrize("title", ANGLES)
def test_moduli_from_a_phase_angle(tmp_path, title):
    rows = "".join(f"{f},{E},{delta}\n" for f, (E, delta, *_) in zip((1, 2, 3), PHASES, strict=True))
    data = fitting.read(put(tmp_path, f"f [Hz],|E*| [MPa],{title}\n{rows}"))
    storage, loss = np.transpose(PHASES)[2:] * 1e6
    np.testing.assert_allclose(data.storage, storage, rtol=2e-5)
    np.testing.assert_allclose(data.loss, loss, rtol=2e-5)
    np.testing.assert_allclose(data.omega, 2 * np.pi * np.array([1, 2, 3]))


@pytest.mark.parametrize(
    ("row", "unit", "message"),
    [
        ("1,5,14.9", "rad", "line 2: delta [rad] = '14.9': must be < 90 deg; is it in deg or rad?"),
        ("1,5,95", "deg", "line 2: delta [deg] = '95': must be < 90 deg"),
        ("1,5,-1", "deg", "line 2: delta [deg] = '-1': must be > 0"),
        ("1,5,15", "K", "unit 'K': must be one of rad, deg, mrad"),
    ],
)
def test_wrong_phase_angles(tmp_path, row, unit, message):
    path = put(tmp_path, f"f [Hz],|E*| [MPa],delta [{unit}]\n{row}\n")
    assert message in refused(path, lambda: fitting.read(path))


def test_the_names_of_the_advice_are_accepted(tmp_path):
    path = put(tmp_path, "a,|E*| [MPa],Phase angle [°]\n1,5,30\n")
    message = refused(path, lambda: fitting.read(path, kind="modulus"))
    assert 'columns=["?", "E_comp [MPa]", "delta [deg]"]' in message
    data = fitting.read(path, columns=["f [Hz]", "E_comp [MPa]", "delta [deg]"])
    np.testing.assert_allclose(data.loss, 5e6 * math.sin(math.pi / 6))


# --- friction

FORCES = (
    "Fn [N],Ft [N]",
    "normal force [N],friction force [N]",
    "Normalkraft [N],Reibkraft [N]",
    "F_n [N],F_t [N]",
)
FORCES += ("Fz [N],Fx [N]", "Load [N],Tangential force (N)", "FN/N,FT/N")


@pytest.mark.parametrize("titles", FORCES)
@pytest.mark.parametrize("sign", [1, -1])
def test_friction_from_forces_in_both_directions(tmp_path, titles, sign):
    rows = f"5,{sign * 100.2},82.1\n-5,{sign * 100.2},-81.7\n"
    path = put(tmp_path, f"v [mm/s],{titles}\n{rows}")
    with pytest.warns(UserWarning, match=r"both signs; mu = \|F_t\| / \|F_n\| and \|v\| are used$"):
        data = fitting.read(path, area=4e-4)
    np.testing.assert_allclose(data.friction, [82.1 / 100.2, 81.7 / 100.2])
    np.testing.assert_allclose(data.velocity, [5e-3, 5e-3])
    np.testing.assert_allclose(data.pressure, [250.5e3, 250.5e3])


@pytest.mark.parametrize(
    ("load", "unit", "newton"), [("0.1", "kN", 100.0), ("100", "lbf", 444.82216), ("10", "kgf", 98.0665)]
)
def test_a_load_and_an_area_give_the_pressure(tmp_path, load, unit, newton):
    path = put(tmp_path, f"v [mm/s],mu [%],load [{unit}]\n5,82,{load}\n")
    assert "or give area=... [m^2], because p = F_n / area" in refused(path, lambda: fitting.read(path))
    data = fitting.read(path, area=1e-3)
    np.testing.assert_allclose([*data.pressure, *data.friction], [newton / 1e-3, 0.82])
    np.testing.assert_allclose(fitting.read(path, pressure=2e5).pressure, [2e5])


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("mu,load [N]\n5,0.8,75", {"area": 400}, "area = 400.0: must be > 0 and <= 1 m^2; is it in mm^2?"),
        ("mu,load [N]\n5,0.8,75", {"area": -1e-4}, "area = -0.0001: must be > 0"),
        (
            "mu,load [N]\n5,0.8,75",
            {"area": 4e-4, "pressure": 1e5},
            "area = 0.0004: must not be given; pressure",
        ),
        (
            "mu,load [N],p [Pa]\n5,0.8,75,1e5",
            {"area": 4e-4},
            "area = 0.0004: must not be given; the file has p",
        ),
        ("mu,p [Pa]\n5,0.8,1e5", {"area": 4e-4}, "area = 0.0004: must not be given; the file has p"),
        ("mu\n5,0.8", {"area": 4e-4}, "area = 0.0004: must not be given; the table has no load F_n"),
        ("Ft [N],Fn [N]\n5,60,75\n5,60,0", {"area": 4e-4}, "line 3: Fn [N] = '0': must not be 0"),
        ("Ft [N],Fn [N]\n5,60,75\n5,60,-75", {"area": 4e-4}, "the normal force F_n changes its sign"),
    ],
)
def test_wrong_loads_and_areas(tmp_path, text, options, message):
    path = put(tmp_path, f"v [mm/s],{text}\n")
    assert message in refused(path, lambda: fitting.read(path, **options))


def test_a_stated_sliding_velocity_is_not_multiplied(tmp_path):
    path = put(
        tmp_path, "slip angle [deg],sliding speed [mm/s],travel speed [km/h],mu,p [bar]\n1,5,3,0.6,2\n"
    )
    np.testing.assert_allclose(fitting.read(path).velocity, [5e-3])


def test_a_surface_temperature_counts_if_there_is_no_other(tmp_path):
    path = put(tmp_path, "v [mm/s],mu,p [bar],surface temperature [°C]\n5,0.6,2,23\n")
    np.testing.assert_allclose(fitting.read(path).temperature, [296.15])
    path = put(tmp_path, "v [mm/s],mu,p [bar],surface temperature [°C],T [°C]\n5,0.6,2,23,20\n")
    np.testing.assert_allclose(fitting.read(path).temperature, [293.15])
