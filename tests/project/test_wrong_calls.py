"""Calls, files and commands as a new user gets them wrong, and the one line that answers each.

Cases that belong to one object or file format are with its tests; these are the mistakes between them.
"""

import warnings

import numpy as np
import pytest
from support.scenes.fits import PLAIN, ROAD
from support.scenes.fits import WARM as SCENE

import fitting
import rubberfric as rf
from fitting import FrictionData, Positive

DATA = FrictionData([1e-3, 1.0], [0.3, 0.4], pressure=1e5)


def answer(call, error=ValueError):
    """The one line that a wrong call is answered by."""
    with pytest.raises(error) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message and len(message) < 400, message
    return message


# --- calls


CALLS = {
    "a number as text": (lambda: rf.Elastic("1e7", 0.5), ("Elastic.young = '1e7'", "must be a number")),
    "Poisson's ratio in percent": (
        lambda: rf.Elastic(1e7, 50),
        ("Elastic.poisson = 50", "between 0.0 and 0.5"),
    ),
    "a modulus for each of no times": (
        lambda: rf.Prony(1e6, 1e6, 1.0),
        ("Prony.E has shape ()", "must be one-dimensional"),
    ),
    "a material by its name": (
        lambda: rf.Body("rubber"),
        ("Body.material = 'rubber'", "must be Rigid, Elastic"),
    ),
    "roughness before the material": (
        lambda: rf.Body(ROAD.spectrum, rf.Rigid()),
        ("Body.material = SelfAffine", "must be Rigid, Elastic"),
    ),
    "pressure 0": (lambda: rf.friction(SCENE, 1.0, 0.0), ("pressure = 0.0", "must be > 0")),
    "velocities as text": (
        lambda: rf.friction(SCENE, ["1", "2"], 1e5),
        ("velocity = ['1', '2']", "must be a sequence of real numbers"),
    ),
    "no velocity": (lambda: rf.friction(SCENE, None, 1e5), ("velocity = None", "must be a number")),
    "a complex velocity": (lambda: rf.friction(SCENE, 1 + 1j, 1e5), ("velocity = (1+1j)", "must be a real")),
    "a temperature that nothing depends on": (
        lambda: rf.friction(rf.Scene(ROAD, rf.Body(PLAIN)), 1.0, 1e5, 300.0),
        ("temperature is given, but nothing in the scene has a shift", "must be None"),
    ),
    "a temperature in °C": (
        lambda: rf.friction(SCENE, 1.0, 1e5, 20.0),
        ("temperature = 20.0", "must be > 143.15 K"),
    ),
    "points that do not go together": (
        lambda: rf.friction(SCENE, [1.0, 2.0, 3.0], [1e5, 2e5]),
        ("shapes differ (velocity (3,), pressure (2,))", "must broadcast"),
    ),
    "a file in place of a scene": (
        lambda: rf.friction("scene.toml", 1.0, 1e5),
        ("scene is a str", "must be a Scene"),
    ),
    "a body in place of a scene": (
        lambda: rf.friction(ROAD, 1.0, 1e5),
        ("scene is a Body", "must be a Scene"),
    ),
    "nodes in place of a quadrature": (
        lambda: rf.friction(SCENE, 1.0, 1e5, quadrature=16),
        ("quadrature is a int", "must be a Quadrature"),
    ),
    "a quantity by its symbol": (
        lambda: rf.solve(SCENE, 1.0, 1e5, quantities="mu"),
        ("quantities has 'mu'", "must be one of area, friction"),
    ),
    "the modulus of a scene": (
        lambda: rf.complex_modulus(SCENE, 1.0),
        ("material is a Scene", "must be Elastic, Prony"),
    ),
    "a frequency as text": (
        lambda: rf.complex_modulus(PLAIN, "1 Hz"),
        ("omega = '1 Hz'", "must be a number"),
    ),
    "the slope of a body": (lambda: rf.rms_slope(ROAD), ("spectrum is a Body", "must be SelfAffine, Tab")),
    "a scene before its file": (
        lambda: rf.save_scene(SCENE, "scene.h5"),
        ("path is a Scene", "must be the path of a file"),
    ),
    "a file that is none": (
        lambda: rf.load_scene(None),
        ("path is a NoneType", "must be the path of a file"),
    ),
    "data that are arrays already": (
        lambda: fitting.read(np.ones(3)),
        ("path is a ndarray", "must be the path"),
    ),
    "fit of data to a scene, turned round": (
        lambda: fitting.fit(DATA, SCENE, {"gamma": Positive()}),
        ("scene is a FrictionData", "must be a Scene, or a dict of them"),
    ),
    "a rule without brackets": (
        lambda: fitting.fit(SCENE, DATA, {"upper.material.E": Positive}),
        ("free['upper.material.E']", "this is a class, create it with Positive(...)"),
    ),
    "a file in place of data": (
        lambda: fitting.fit_prony("master_curve.csv"),
        ("data is a str", "must be ModulusData, RelaxationData or CreepData, for example from fitting.read"),
    ),
    "a start value as text": (
        lambda: fitting.fit(SCENE, DATA, {"upper.material.E": Positive("1e6")}),
        ("free['upper.material.E']: start = '1e6'", "must be"),
    ),
}


@pytest.mark.parametrize("name", CALLS)
def test_calls(name):
    call, words = CALLS[name]
    message = answer(call)
    for text in words:
        assert text in message, message


def test_a_folder_in_place_of_a_file(tmp_path):
    assert "must be .toml or .h5; it is a folder" in answer(lambda: rf.load_scene(tmp_path))
    assert "or .h5; it is a folder" in answer(lambda: fitting.read(tmp_path))
    (tmp_path / "scene.toml").mkdir()
    assert "cannot be read: Is a directory" in answer(lambda: rf.load_scene(tmp_path / "scene.toml"))
    assert "scene must be a Scene, got Prony" in answer(lambda: rf.save_scene(tmp_path / "x.h5", PLAIN))


@pytest.mark.parametrize("name", ["fit", "FrictionData", "Positive", "sensitivity"])
def test_what_is_in_the_other_package(name):
    assert not hasattr(rf, name) and getattr(rf, name, None) is None
    wanted = f"rubberfric has no {name!r}, fitting has: from fitting import {name}"
    assert wanted in answer(lambda: getattr(rf, name), AttributeError)
    with pytest.raises(ImportError, match=f"cannot import name '{name}' from 'rubberfric'"):
        exec(f"from rubberfric import {name}", {})
    assert "no attribute 'Pronny'" in answer(lambda: rf.Pronny, AttributeError)


def test_single_precision_is_no_surprise():
    """A float32 among the arguments does not make the scene one, and a float32 scene stays one."""
    assert rf.friction(SCENE, np.float32(1.0), 1e5).dtype == np.float64
    assert rf.friction(rf.scene.scene.cast(SCENE, np.float32), 1.0, 1e5).dtype == np.float32


# --- files


ROAD_TOML = """[lower]
material = { kind = "rigid" }
spectrum = { kind = "self_affine", q0 = 1e2, qr = 1e3, q1 = 3e4, hurst = 0.8, h_rms = 5e-4 }
"""
SCENE_TOML = (
    ROAD_TOML
    + """[upper]
material = { kind = "prony", E_inf = 3e6, E = [5e7, 8e6], tau = [1e-5, 1e-3], shift = SHIFT }
[run]
velocity = [1e-3, 1.0]
pressure = 1e5
temperature = 293.15
"""
).replace("SHIFT", '{ kind = "wlf", C1 = 12.0, C2 = 150.0, T_ref = 293.15 }')

SCENES = {
    "a pressure in MPa": ("1e5", "0.1", "run.pressure = 0.1 Pa: must be 1 ... 1e+10 Pa; is it in MPa or"),
    "moduli in MPa": (
        "E_inf = 3e6, E = [5e7, 8e6]",
        "E_inf = 3, E = [50, 8]",
        "upper.material.E_inf + sum(E) = 61 Pa: must be 100 ... 1e+13 Pa; is it in MPa or GPa?",
    ),
    "a reference temperature in °C": ("T_ref = 293.15", "T_ref = 20.0", "T_ref = 20 K: must be 100 ..."),
    "a velocity in um/s": ("[1e-3, 1.0]", "[1e3, 1e6]", "run.velocity[0] = 1000 m/s: must be at most 500"),
    "a height in um": ("h_rms = 5e-4", "h_rms = 500.0", "lower.spectrum.h_rms = 500 m: must be at most 1"),
    "one modulus in MPa": ("E_inf = 3e6", "E_inf = 3", "upper.material: E_inf = 3 Pa with E up to 5e+07"),
    "terms of different lengths": ("[1e-5, 1e-3]", "[1e-5]", "lengths differ (E has 2, tau has 1)"),
    "a number in quotes": ("hurst = 0.8", 'hurst = "0.8"', "lower.spectrum.hurst = '0.8': must be a number"),
    "a decimal comma": ("hurst = 0.8", "hurst = 0,8", "is not TOML"),
    "a key of another name": ("h_rms", "hrms", "lower.spectrum.hrms: unknown key; did you mean 'h_rms'?"),
    "a kind as its class is called": ('"prony"', '"Prony"', "kind = 'Prony': did you mean 'prony'?"),
    "a section at the wrong place": ("[run]", "[upper.run]", "upper.run: unknown key; must be one of"),
    "plausible as text": ("[lower]", 'plausible = "no"\n[lower]', "plausible = 'no': must be true or false"),
}


@pytest.mark.parametrize("name", SCENES)
def test_scene_files(name, tmp_path):
    old, new, words = SCENES[name]
    path = tmp_path / "scene.toml"
    path.write_text(SCENE_TOML.replace(old, new), encoding="utf-8")
    message = answer(lambda: rf.load_scene(path))
    assert message.startswith(f"{path}: ") and words in message, message
    if "; is it in" in message:
        assert message.endswith(" plausible = false at the top of the file accepts it")
        path.write_text("plausible = false\n" + path.read_text(encoding="utf-8"), encoding="utf-8")
        assert isinstance(rf.load_scene(path), rf.Scene)


def test_line_ends_and_marks_of_other_systems(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xef\xbb\xbf" + SCENE_TOML.replace("\n", "\r\n").encode())
    assert rf.load_scene(path).gamma == 0.5


FRICTION = "v,mu,p\nm/s,-,MPa\n0.001,0.3,0.1\n1,0.4,0.1\n"
TABLES = {
    "velocities in knots": ("m/s", "knots", "column v: unit 'knots': must be one of m/s, mm/s, um/s"),
    "values behind their unit": ("0.001,", "0.001 m/s,", "line 3: v = '0.001 m/s': must be a number"),
    "no units": ("m/s,-,MPa\n", "", "unit '0.001': must be one of m/s"),
    "decimal commas between commas": ("0.001,0.3,0.1", "0,001,0,3,0,1", "line 3: has 6 fields: must have 3"),
    "friction in percent": ("0.3,", "30,", ""),
    "a pressure in Pa that is in MPa": (",MPa", ",Pa", "pressure[0] = 0.1: must be >= 1 Pa; is it in MPa"),
    "a modulus in Pa that is in MPa": (
        FRICTION,
        "f,E_stor,E_loss\nHz,Pa,Pa\n1,12,3\n",
        "storage[0] = 12.0: must be >= 1e3 Pa; is it in MPa or GPa? (check_units=False accepts it)",
    ),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables(name, tmp_path):
    old, new, words = TABLES[name]
    path = tmp_path / "friction.csv"
    path.write_text(FRICTION.replace(old, new), encoding="utf-8")
    if not words:  # 30 may be a friction; beyond 50 it is asked
        path.write_text(FRICTION.replace("0.3,", "60,"), encoding="utf-8")
        words = "friction[0] = 60.0: must be -50 ... 50; is it in percent?"
    message = answer(lambda: fitting.read(path))
    assert message.startswith(f"{path}: ") and words in message, message


def test_a_data_set_that_may_have_any_unit(tmp_path):
    """check_units of a job, as of `fitting.read`."""
    from fitting.commands.job import read_job

    (tmp_path / "scene.toml").write_text(SCENE_TOML, encoding="utf-8")
    (tmp_path / "friction.csv").write_text(FRICTION.replace("MPa", "Pa"), encoding="utf-8")
    job = tmp_path / "job.toml"
    job.write_text(
        'scene = "scene.toml"\n[[data]]\nfile = "friction.csv"\ncheck_units = false\n'
        '[free]\n"gamma" = "free"\n',
        encoding="utf-8",
    )
    np.testing.assert_array_equal(read_job(job).data[0].pressure, [0.1, 0.1])


def test_scenes_and_conditions_in_other_units_give_a_warning():
    road, rubber = ROAD.spectrum, PLAIN
    table = rf.TabulatedSpectrum([1e2, 1e4], [1e-3, 1e-9])
    in_mpa = r"upper\.material: E_inf = 3\.6 Pa with E up to 5e\+07 Pa.* is it in MPa\? If a fit gave"
    for spectrum, material, words in (
        (road.replace(h_rms=0.5), rubber, r"lower\.spectrum: rms height 0\.5 m: must be below 1/q0 = .* m"),
        (road, rf.Prony(3.6, [5e7], [1e-5]), in_mpa),
        (table, rubber, r"lower\.spectrum: rms height"),
        (road, rf.Elastic(3.6, 0.5), r"upper\.material\.young = 3\.6 Pa: must be 100 \.\.\. 1e\+13 Pa; is"),
    ):
        with pytest.warns(rf.UnitWarning, match=words):
            rf.Scene(rf.Body(rf.Rigid(), spectrum), rf.Body(material))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rf.Scene(rf.Body(rf.Rigid(), road), rf.Body(rubber))
        rf.friction(SCENE, 1.0, 1e5)
    with pytest.warns(rf.UnitWarning, match=r"velocity = 1000 m/s: must be at most 500 m/s; is it in mm/s"):
        rf.friction(SCENE, 1000.0, 1e5)
    with pytest.warns(rf.UnitWarning, match=r"pressure = 0\.15 Pa: must be 1 \.\.\. 1e\+10 Pa; is it in MPa"):
        rf.friction(SCENE, 1.0, 0.15)
