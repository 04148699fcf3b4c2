"""Pictures of friction maps, and the command that computes them."""

import os
import re
import types

import numpy as np
import pytest
from support.scenes.maps import FILE, QUICK, SCENE

import rubberfric as rf
from rubberfric.analysis import batches, maps
from rubberfric.base.progress import Progress
from rubberfric.commands import main as command
from rubberfric.io.files import load_result, read_computable
from rubberfric.io.results import Conditions
from rubberfric.plot.maps import plot_map


def drawn_map(velocity, pressure, temperature):
    """Return a map of artificial values that depend on all conditions."""
    v, p, T = (np.asarray(x, float) for x in (velocity, pressure, temperature))
    grid = np.log10(np.abs(v) + 1) + (p / 1e6)[:, None] + (T / 100)[:, None, None]
    solution = rf.Solution(friction=grid, area=np.exp(-5 * grid), shear_friction=0 * grid)
    return rf.FrictionMap(SCENE, Conditions(v, p, T), solution, QUICK, "Title")


def test_panels_are_pressures_over_velocity_and_temperature():
    result = drawn_map([1.0, -1.0, 0.01, 0.0], [3e5, 1e5], [293.15, 273.15, 283.15])
    axes = plot_map(result)
    assert [panel.get_title() for panel in axes] == ["0.3 MPa", "0.1 MPa"]
    for j, panel in enumerate(axes):
        mesh = panel.collections[0]
        # sorted, without velocities that have no logarithm
        expected = result.solution.friction[np.ix_([1, 2, 0], [j], [2, 0])][:, 0]
        np.testing.assert_array_equal(mesh.get_array().reshape(3, 2), expected)
        assert len(panel.collections) == 2 and panel.texts  # contours, labelled
    # shaded between the points, as cells so large would be seen as stripes
    np.testing.assert_allclose(mesh.get_coordinates()[0, :, 0], [-2, 0])
    np.testing.assert_allclose(mesh.get_coordinates()[:, 0, 1], [0, 10, 20])
    assert axes[0].get_ylabel() == "temperature [°C]"
    assert axes[0].get_xlabel() == "velocity $v$ [m/s]"
    figure = axes[0].figure
    assert figure.get_suptitle() == "Title"
    assert figure.axes[-1].get_ylabel() == "friction coefficient $\\mu$ [-]"
    assert [panel.get_title() for panel in plot_map(result, pressure=1)] == ["0.1 MPa"]


def test_one_temperature_is_drawn_over_pressure():
    many = drawn_map([0.1, 1.0, 10.0], [1e5, 1e6], [283.15, 293.15])
    one = drawn_map([0.1, 1.0, 10.0], [1e5, 1e6], [293.15])
    for result, index in ((many, 1), (one, None)):
        (panel,) = plot_map(result, "area", temperature=index)
        assert panel.get_title() == "20 °C"
        assert panel.get_ylabel() == "pressure $p$ [MPa]"
        np.testing.assert_array_equal(
            panel.collections[0].get_array().reshape(2, 3), result.solution.area[-1]
        )
        assert "LogNorm" in type(panel.collections[0].norm).__name__


def test_picture_of_many_pressures_points_and_a_constant():
    result = drawn_map(np.logspace(-6, 2, 1000), np.logspace(4, 7, 9), [283.15, 293.15])
    axes = plot_map(result)
    assert len(axes) == 4
    assert axes[0].get_title() == "0.01 MPa" and axes[-1].get_title() == "10 MPa"
    assert axes[0].collections[0].get_array().size == 2 * 800
    (one,) = plot_map(result, "shear_friction")
    assert one.get_title() == "0.01 … 10 MPa, no difference"
    assert one.figure.axes[-1].get_ylabel() == "shear friction [-]"
    assert len(one.collections) == 1  # no contour of a constant
    given = axes[0].figure.__class__().subplots(1, 4)
    assert plot_map(result, ax=given) is given


@pytest.mark.parametrize(
    ("conditions", "options", "message"),
    [
        (([1.0], [1e5, 2e5], [283.0, 293.0]), {}, "velocity has 1 different values > 0; a map needs 2"),
        (([1.0, -1.0], [1e5, 2e5], [283.0]), {}, "velocity has 1 different values > 0"),
        (([1.0, 2.0], [1e5], [283.0]), {}, "pressure has one value; a map needs 2"),
        (([1.0, 2.0], [1e5], [283.0, 293.0]), {"temperature": 0}, "pressure has one value"),
        (([1.0, 2.0], [1e5], [283.0, 293.0]), {"temperature": 2}, "temperature = 2: must be an index of 2"),
        (([1.0, 2.0], [1e5], [283.0, 293.0]), {"pressure": 0.5}, "pressure = 0.5: must be an index of 1"),
        (([1.0, 2.0], [1e5], [283.0, 293.0]), {"quantity": "separation"}, "must be one of area, friction"),
        (([1.0, 2.0], [1e5], [283.0, 293.0]), {"quantity": "mu"}, "quantity = 'mu': must be one of"),
    ],
)
def test_maps_that_cannot_be_drawn(conditions, options, message):
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        plot_map(drawn_map(*conditions), **options)
    assert message in str(caught.value)


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(FILE)
    return path


@pytest.mark.slow
def test_command_writes_draws_and_sums_up(call_main, scene_file, tmp_path):
    out, picture = tmp_path / "m.h5", tmp_path / "m.png"
    status, printed, complaint = call_main(command.main, "map", scene_file, "--out", out, "--plot", picture)
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
    mu = np.asarray(expected.friction)
    where = [x[mu.argmax()] for x in (v, p / 1e6, T)]
    name, unit, *numbers = lines[-1].split()
    assert (name, unit) == ("friction", "[-]")
    np.testing.assert_allclose([float(x) for x in numbers], [mu.min(), mu.max(), *where], rtol=1e-4)

    # the file of a map is computed again
    status, again, _ = call_main(command.main, "map", out)
    assert (status, again) == (0, printed)


def test_each_command_has_its_table(scene_file):
    """Other commands ignore [map]; without it the map command uses [run]."""
    assert read_computable(scene_file)[1].velocity == [1.0]
    assert read_computable(scene_file, "map")[1].velocity.size == 5
    scene_file.write_text(FILE[: FILE.index("[map]")])
    assert read_computable(scene_file, "map")[1].velocity == [1.0]
    scene_file.write_text(FILE.replace("[run]\nvelocity = 1.0\npressure = 1e5", ""))
    with pytest.raises(ValueError, match="run: is missing; must hold velocity and pressure"):
        read_computable(scene_file)


@pytest.mark.parametrize(
    ("old", "new", "options", "message"),
    [
        ("points = 3 }\ntemp", "points = 1 }\ntemp", (), "map.pressure.points = 1: must be an integer, 2 to"),
        ("from = 1e5", "from = 0", (), "map.pressure.from = 0.0: must be > 0"),
        ("from = 273.15", "from = 100", (), "map.temperature[0] = 100.0: must be > 193.15 K"),
        ("[map]", "[map]\nspeed = 1", (), "map.speed: unknown key; must be one of velocity"),
        ("[map]\nvelocity", "[map]\nvelocities", (), "map.velocities: unknown key; did you mean 'velocity'?"),
        (FILE[FILE.index("[run]") :], "", (), "map: is missing; must hold velocity and pressure"),
        (FILE[FILE.index("[map]") :], "", ("--plot", "m.png"), "velocity has 1 different values > 0"),
        ("", "", ("--quantity", "mu"), "invalid choice: 'mu'"),
        ("", "", ("--out", "m.csv"), "suffix '.csv': must be .h5"),
        ("", "", ("--plot", "m.txt"), "must be .png or .pdf or .svg"),
    ],
)
def test_bad_input_of_the_command(call_main, scene_file, monkeypatch, old, new, options, message):
    monkeypatch.chdir(scene_file.parent)
    monkeypatch.setattr(batches, "launch", None)  # nothing may be computed
    scene_file.write_text(FILE.replace(old, new) if old else FILE)
    status, printed, complaint = call_main(command.main, "map", "scene.toml", *options)
    assert (status, printed, complaint.count("\n")) == (2, "", 1)
    assert message in complaint
    if not options:
        assert complaint.startswith("rubberfric: scene.toml: map")
    assert os.listdir() == ["scene.toml"]


def test_an_interrupted_command_says_so_and_writes_nothing(call_main, scene_file, monkeypatch):
    def launch(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(batches, "launch", launch)
    status, printed, complaint = call_main(
        command.main, "map", scene_file, "--out", scene_file.parent / "m.h5"
    )
    assert (status, printed) == (130, "")
    assert complaint == "rubberfric: interrupted; incomplete files are not written\n"
    assert os.listdir(scene_file.parent) == ["scene.toml"]


def test_line_of_progress():
    shown = []
    place = types.SimpleNamespace(show=lambda text, _: shown.append(text), end=lambda: None)
    tell = Progress("", place, iter([0.0, 1.0, 3.0, 12.0]).__next__)
    for done in (0, 30, 120):
        tell(done, 120)
    assert shown == ["120 points,   0 %", "120 points,  25 %, 9 s left", "120 points, 100 %, 12 s"]
