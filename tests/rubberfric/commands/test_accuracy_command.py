"""`rubberfric accuracy`: its output, files and messages; the sweep itself is in test_accuracy.py."""

import os
from pathlib import Path

import numpy as np
import pytest
from problems import ROAD, TREAD
from support.folders import SCENE_FILES
from support.scenes.maps import SMALL

import rubberfric as rf
from rubberfric.analysis import sweep
from rubberfric.analysis.reference import Errors
from rubberfric.analysis.sweep import Accuracy, Row
from rubberfric.commands import run as run_commands
from rubberfric.io.results import Conditions

ROWS = (
    Row("panels", rf.Quadrature(panels=6), "float64", 100, Errors(*[1e-8] * 6), 1e-3, 2e-3, 1.0, 2.0),
    Row("textbook", (200, 64), "float64", 12800, Errors(1e-3, 2e-3, 3e-3), 0.09),
)
VELOCITIES = "{ from = 1e-3, to = 1e1, points = 90 }"
RESULT = Accuracy(1e-4, ROWS, Errors(*[1e-12] * 6), 41, 30)


def test_command(call, scene_file, monkeypatch):
    monkeypatch.chdir(scene_file.parent)
    scene_file.write_text(f"{SMALL}[run]\nvelocity = {VELOCITIES}\npressure = 1e5\n")
    seen = {}

    def sweep_of(_, *at, error, progress, report):
        seen.update(at=at, error=error)
        progress("working")  # not a terminal: nothing is shown
        report(RESULT.rows[0], 1, 2)
        return RESULT

    monkeypatch.setattr(sweep, "accuracy", sweep_of)
    arguments = ("accuracy", "scene.toml", "--error", "1e-4", "--out", "t.csv", "--plot", "t.png")
    status, printed, complaint = call(*arguments)
    assert (status, complaint) == (0, "")
    assert printed == f"Small scene\n60 of 90 velocities, equally spread\n{RESULT.report()}\n"
    assert seen["error"] == 1e-4 and seen["at"][2] is None
    velocity, pressure = seen["at"][:2]
    assert velocity.shape == (60,) and (velocity[0], velocity[-1]) == pytest.approx((1e-3, 10))
    assert pressure.shape == (1, 1)
    assert sorted(os.listdir()) == ["scene.toml", "t.csv", "t.png"]
    assert Path("t.png").read_bytes().startswith(b"\x89PNG")


def test_velocities_are_thinned_to_a_number_of_points():
    conditions = Conditions(np.logspace(-8, 2, 41), np.array([1e5, 2e5]), np.array([283.15, 293.15, 303.15]))
    velocity = run_commands.thinned(conditions)
    assert velocity.size == 10 and set(velocity) < set(conditions.velocity)
    few = conditions._replace(velocity=np.array([1.0, -2.0]))
    np.testing.assert_array_equal(run_commands.thinned(few), [1.0, -2.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("no.toml",), "no.toml: cannot be read: No such file"),
        (("scene.toml", "--error", "-1"), "--error -1.0: must be a number, >= 1e-15 and < 1"),
        (("scene.toml", "--error", "small"), "argument --error: invalid float value: 'small'"),
        (("scene.toml", "--out", "t.h5"), "t.h5: suffix '.h5': must be .csv"),
        (("scene.toml", "--out", "no/t.csv"), "folder 'no' does not exist; create it first"),
        (("scene.toml", "--plot", "t.csv"), "t.csv: suffix '.csv': must be .png or .pdf or .svg"),
        (("bare.h5",), "bare.h5: run: is missing; must hold velocity and pressure"),
        ((), "SCENE"),
    ],
)
def test_command_with_bad_input(refused, scene_file, monkeypatch, arguments, message):
    monkeypatch.chdir(scene_file.parent)
    rf.save_scene("bare.h5", rf.Scene(rf.Body(TREAD), rf.Body(rf.Rigid(), ROAD)))
    monkeypatch.setattr("rubberfric.analysis.reference.case_of", None)  # nothing may be computed
    complaint = refused("accuracy", *arguments)
    assert message in complaint and complaint.startswith("rubberfric")


@pytest.mark.slow
@pytest.mark.parametrize("path", SCENE_FILES, ids=str)
def test_scenes_of_the_data_folder(call, path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    error = "1e-2" if "tabulated" in path.stem else "1e-6"
    status, printed, complaint = call("accuracy", path, "--error", error, "--plot", "t.png", "--out", "t.csv")
    assert (status, complaint) == (0, "")
    assert "Quadrature(" in printed and "no setting" not in printed and "times as long" in printed
