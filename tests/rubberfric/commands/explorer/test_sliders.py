"""Sliders of a scene, their ranges, and valid posts of the page."""

import math

import jax
import numpy as np
import pytest
from support.folders import DATA, SCENE_FILES
from support.scenes.examples import examples

import rubberfric as rf
from rubberfric.commands.explorer.sliders import Slider, moved, slider_values, sliders_of, with_cutoffs
from rubberfric.io.files import read_computable


def sliders(name):
    scene, conditions, _ = read_computable(DATA / f"{name}.toml")
    scene = with_cutoffs(scene)
    return scene, {one.name: one for one in sliders_of(scene, conditions)}


def test_sliders_of_a_scene():
    _, found = sliders("twin_truth")
    expected = {
        *("pressure", "temperature", "gamma"),
        *(f"lower.spectrum.{name}" for name in ("q0", "qr", "q1", "hurst", "h_rms")),
        *(f"upper.material.{name}" for name in ("E_inf", "poisson", "moduli", "frequencies")),
        *("upper.material.shift.C1", "upper.material.shift.C2"),
        *("shear.tau_f0", "shear.c", "shear.v0", "shear.shift.energy"),
    }
    # In as many decades as there are:
    tau = [1e-9, 1.78e-8, 3.16e-7, 5.62e-6, 1e-4, 1.78e-3, 3.16e-2, 0.562, 10.0, 178.0, 3160.0]
    assert {name for name in found if "[" in name} == {f"upper.material.E[{i}]" for i in range(len(tau))}
    assert {name for name in found if "[" not in name} == expected
    assert found["shear.tau_f0"][2:] == (
        *("tau_f0", "Pa", 6.5e6, 6.5e5, 6.5e7, True),
        *(found["shear.tau_f0"].targets, ("shear.tau_f0",)),
    )
    assert found["lower.spectrum.hurst"][5:8] == (0.0, 1.0, False)
    assert found["upper.material.poisson"][5:8] == (0.0, 0.5, False)
    # At its left end q1 equals qr, its smallest value.
    assert 1000 <= found["lower.spectrum.q1"].low < 1000.01 and found["lower.spectrum.q1"].high == 3.1e6
    np.testing.assert_allclose([found["temperature"].low, found["temperature"].high], [183.15, 413.15])
    assert (found["pressure"].start, found["temperature"].start) == (1e5, 293.15)


def test_temperatures_are_those_of_the_shift():
    _, found = sliders("tabulated_tread")
    table = np.loadtxt(DATA / "tread_shift.csv", delimiter=",", skiprows=2, comments=("#", "T", "K"))
    np.testing.assert_allclose(found["temperature"].low, table[:, 0].min(), rtol=1e-8)


def test_decades_have_their_terms():
    series = rf.Prony(1e6, [1.0, 2.0, 3.0, 4.0], [1e-3, 0.5, 2e-3, 1e3])
    scene = rf.Scene(rf.Body(rf.Rigid()), rf.Body(series))
    _, conditions, _ = read_computable(DATA / "rubber_seal.toml")
    found = {one.name: one for one in sliders_of(scene, conditions)}
    assert [name for name in found if "[" in name] == [f"upper.material.E[{i}]" for i in ("0,2", "1", "3")]
    assert found["upper.material.E[0,2]"].free == ("upper.material.E[0]", "upper.material.E[2]")
    values = slider_values(list(found.values()), {"upper.material.E[0,2]": 2.0, "upper.material.moduli": 3.0})
    rubber = moved(scene, list(found.values()), values).upper.material
    np.testing.assert_allclose(rubber.E, [6.0, 6.0, 18.0, 12.0], rtol=1e-15)
    assert rubber.E_inf == 3e6


@pytest.mark.parametrize("name", [path.stem for path in SCENE_FILES])
def test_ends_of_every_slider_can_be_had(name):
    scene, found = sliders(name)
    assert len(found) >= 7
    everything = list(found.values())
    for one in everything:
        assert one.low <= one.start <= one.high and one.low < one.high
        for end in (one.low, one.high):
            values = slider_values(everything, {one.name: end})
            assert isinstance(moved(scene, everything, values), rf.Scene)
    start = moved(scene, everything, slider_values(everything, {}))
    assert start is scene


def test_every_number_has_one():
    """But temperatures of reference."""
    _, conditions, _ = read_computable(DATA / "rubber_seal.toml")
    scene = with_cutoffs(examples()["Scene"])
    numbers = {
        jax.tree_util.keystr(path).removeprefix(".")
        for path, value in jax.tree_util.tree_leaves_with_path(scene)
        if np.ndim(value) == 0
    }
    names = {one.name for one in sliders_of(scene, conditions)}
    assert {name for name in numbers if not name.endswith("T_ref")} <= names
    assert not any(name.endswith("T_ref") for name in names)
    assert {"lower.material.moduli", "upper.material.frequencies", "upper.spectrum.heights"} <= names


GOOD = Slider("E", "upper", "E", "Pa", 2.0, 1.0, 4.0, True)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"F": 2.0}, "'F': unknown slider; did you mean|'F': unknown slider; must be one of E"),
        ({"file": "/etc/passwd"}, "'file': unknown slider"),
        ({"__class__": 1.0}, "unknown slider"),
        ({"E": math.nan}, "E = nan: must be between 1.0 and 4.0"),
        ({"E": 4.001}, "must be between"),
        ({"E": -math.inf}, "must be between"),
        ({"E": "2"}, "E = '2': must be a number"),
        ({"E": None}, "must be a number"),
        ([], "must be an object with numbers by slider name"),
    ],
)
def test_what_is_no_value(given, message):
    with pytest.raises(ValueError, match=message):
        slider_values([GOOD], given)


def test_values():
    assert slider_values([GOOD], {}) == {"E": 2.0}
    assert slider_values([GOOD], {"E": 4}) == {"E": 4.0}
