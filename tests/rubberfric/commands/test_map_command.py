"""`rubberfric map`: its files, output and picture, and one line for bad input."""

import os

import numpy as np
import pytest
from support.scenes.maps import FILE, SMALL

import rubberfric as rf
from rubberfric.analysis import batches, maps
from rubberfric.io.files import load_result, read_computable


@pytest.mark.slow
def test_command_writes_draws_and_sums_up(call, scene_file, tmp_path):
    out, picture = tmp_path / "m.h5", tmp_path / "m.png"
    status, printed, complaint = call("map", scene_file, "--out", out, "--plot", picture)
    assert (status, complaint) == (0, "")
    assert sorted(os.listdir(tmp_path)) == ["m.h5", "m.png", "scene.toml"]
    assert picture.read_bytes().startswith(b"\x89PNG\r\n")

    found = load_result(out)
    np.testing.assert_allclose(found.conditions.velocity, 10.0 ** np.arange(-3, 2), rtol=1e-13)
    np.testing.assert_allclose(found.conditions.pressure, [1e5, 2e5, 4e5], rtol=1e-13)
    np.testing.assert_allclose(found.conditions.temperature, [273.15, 283.15, 293.15], rtol=1e-13)
    v, p, T = (np.broadcast_to(x, (3, 3, 5)).ravel() for x in found.conditions.grid())
    expected = rf.solve(rf.load_scene(scene_file), v, p, T, quantities=maps.DEFAULT_QUANTITIES)
    for name in maps.DEFAULT_QUANTITIES:
        np.testing.assert_allclose(getattr(found.solution, name).ravel(), getattr(expected, name), rtol=1e-13)

    lines = printed.splitlines()
    assert max(map(len, lines)) <= 90
    assert lines[:5] == [
        "Small scene",
        "5 velocities: 0.001 ... 10 m/s",
        "3 pressures: 100000 ... 400000 Pa",
        "3 temperatures: 273.15 ... 293.15 K",
        "45 points",
    ]
    assert lines[6].split() == ["smallest", "largest", "at", "v", "[m/s]", "p", "[MPa]", "T", "[K]"]
    mu = np.asarray(expected.friction)
    where = [x[mu.argmax()] for x in (v, p / 1e6, T)]
    name, unit, *numbers = lines[-1].split()
    assert (name, unit) == ("friction", "[-]")
    np.testing.assert_allclose([float(x) for x in numbers], [mu.min(), mu.max(), *where], rtol=1e-4)

    # the file of a map is computed again
    status, again, _ = call("map", out)
    assert (status, again) == (0, printed)


def test_each_command_has_its_table(scene_file):
    """Other commands ignore [map]; without it the map command uses [run]."""
    of_run, of_map = [1e5, 3e5], pytest.approx([1e5, 2e5, 4e5], rel=1e-13)
    assert read_computable(scene_file)[1].pressure.tolist() == of_run
    assert read_computable(scene_file, "map")[1].pressure == of_map
    scene_file.write_text(FILE[: FILE.index("[map]")])
    assert read_computable(scene_file, "map")[1].pressure.tolist() == of_run
    scene_file.write_text(SMALL + FILE[FILE.index("[map]") :])
    with pytest.raises(ValueError, match="run: is missing; must hold velocity and pressure"):
        read_computable(scene_file)


@pytest.mark.parametrize(
    ("old", "new", "options", "message"),
    [
        ("points = 3 }\ntemp", "points = 1 }\ntemp", (), "map.pressure.points = 1: must be an integer, 2 to"),
        ("from = 273.15", "from = 100", (), "map.temperature[0] = 100.0: must be > 193.15 K"),
        ("[map]", "[map]\nspeed = 1", (), "map.speed: unknown key; must be one of velocity"),
        (FILE[FILE.index("[run]") :], "", (), "map: is missing; must hold velocity and pressure"),
        (
            "[map]\nvelocity",
            "[map]\nvelocity = 1.0 #",
            ("--plot", "m.png"),
            "velocity has 1 different values > 0",
        ),
        ("", "", ("--out", "m.csv"), "suffix '.csv': must be .h5"),
        ("", "", ("--plot", "m.txt"), "must be .png or .pdf or .svg"),
    ],
)
def test_bad_input(refused, scene_file, monkeypatch, old, new, options, message):
    monkeypatch.chdir(scene_file.parent)
    monkeypatch.setattr(batches, "launch", None)  # nothing may be computed
    scene_file.write_text(FILE.replace(old, new) if old else FILE)
    complaint = refused("map", "scene.toml", *options)
    assert message in complaint
    if not options:
        assert complaint.startswith("rubberfric: scene.toml: map")


@pytest.mark.parametrize("name", ["shear_friction", "transverse_friction"])
def test_a_map_of_zeros_is_refused(refused, scene_file, name):
    assert f"{name} is 0 in this scene" in refused("map", scene_file, "--quantity", name)
