"""`rubberfric grip` and `rubberfric leak`: printed numbers, files, options, and errors."""

import csv
import re

import numpy as np
import pytest
from support.scenes.maps import FILE

import rubberfric as rf
from rubberfric.applications import leak_conductivity, percolation_pressure

PATCH = ("--length", 0.12, "--width", 0.15, "--stiffness", 5e7)
SEAL = ("--fluid-pressure", 5e5, "--length", 2e-3, "--width", 0.157)


@pytest.mark.slow
def test_leak(call, scene_file, tmp_path, numbers):
    out, p = tmp_path / "leak.csv", np.array([1e4, 2e4])
    status, printed, complaint = call("leak", scene_file, "--pressure", *p, *SEAL, "--out", out)
    assert (status, complaint) == (0, "")
    assert printed.startswith("Small scene\n")
    scene = rf.load_scene(scene_file)
    K = np.asarray(leak_conductivity(scene, p))
    area = np.asarray(rf.contact_area(scene.replace(area_correction=True), 0.0, p))
    rows = np.stack([p, area, K, K * 5e5 / 1e-3 * 0.157 / 2e-3], -1)
    np.testing.assert_allclose(numbers(printed), rows, rtol=1e-4)
    with out.open(newline="") as file:
        names, units, *values = csv.reader(file)
    assert names == ["pressure", "area", "conductivity", "leak"]
    assert units == ["Pa", "-", "m3", "m3/s"]
    np.testing.assert_allclose(np.array(values, float), rows, rtol=1e-12)
    last = float(re.search(r"percolation pressure (\S+) Pa", printed)[1])
    assert last == pytest.approx(float(percolation_pressure(scene)), rel=1e-5)


@pytest.mark.slow
def test_options_of_leak(call, scene_file, numbers):
    options = ("--viscosity", 0.1, "--critical-area", 0.5, "--temperature", 300.0)
    status, printed, _ = call("leak", scene_file, "--pressure", 1e4, 2e4, *SEAL, *options)
    K = leak_conductivity(rf.load_scene(scene_file), np.array([1e4, 2e4]), 300.0, 0.5)
    assert status == 0
    np.testing.assert_allclose(numbers(printed)[:, 3], K * 5e5 / 0.1 * 0.157 / 2e-3, rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "shape"), [("angle", "parabolic"), ("ratio", "uniform")])
def test_grip(call, scene_file, kind, shape, numbers):
    options = ("--slip", 0.02, 0.1, "--speed", 1.0, 5.0, "--load", 3e3, "--temperature", 300.0)
    chosen = ("--kind", kind, "--patch-pressure", shape)
    status, printed, complaint = call("grip", scene_file, *PATCH, *options, *chosen)
    assert (status, complaint) == (0, "")
    patch = rf.Patch(0.12, 0.15, 5e7, shape)
    slip, speed = np.array([0.02, 0.1, 0.02, 0.1]), np.array([1.0, 1.0, 5.0, 5.0])
    found = rf.grip(rf.load_scene(scene_file), patch, slip, speed, 3e3, 300.0, kind)
    columns = [speed, np.full(4, 3e3), slip, *(x for x in found if x is not None)]
    np.testing.assert_allclose(numbers(printed), np.stack(columns, -1), rtol=1e-4, atol=1e-12)
    assert "slip stiffness 54000 N per " in printed


@pytest.mark.slow
def test_grip_of_the_patch_of_the_scene(call, scene_file, numbers):
    in_file = "\n[patch]\nlength = 0.12\nwidth = 0.15\nstiffness = 5e7\npressure = {}\n"
    scene_file.write_text(FILE + in_file.format('{ kind = "trapezoid", ramp = 0.2 }'))
    at = ("--slip", 0.02, 0.3, "--speed", 5.0, "--load", 3e3, "--temperature", 300.0)
    scene = rf.load_scene(scene_file)
    for options, patch in (
        ((), scene.patch),
        (("--length", 0.1, "--patch-pressure", "uniform"), rf.Patch(0.1, 0.15, 5e7, "uniform")),
    ):
        status, printed, complaint = call("grip", scene_file, *options, *at)
        assert (status, complaint) == (0, "")
        forces = rf.grip(scene, patch, np.array([0.02, 0.3]), 5.0, 3e3, 300.0).force
        np.testing.assert_allclose(numbers(printed)[:, 3], forces, rtol=1e-4)
        stiffness = 5e7 * float(patch.length) ** 2 * 0.15 / 2  # k L^2 w / 2
        assert f"slip stiffness {stiffness:.6g} N per rad" in printed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("leak", "--pressure", 1e4, *SEAL, "--critical-area", 2.0), "--critical-area 2.0: must be between"),
        (("leak", "--pressure", 1e4, *SEAL, "--viscosity", 0.0), "--viscosity 0.0: must be > 0"),
        (("leak", "--pressure", 1e4, *SEAL, "--out", "x.h5"), "x.h5"),
        (("leak", *SEAL), "--pressure"),
        (("grip", *PATCH, "--slip", 2.0, "--speed", 1.0, "--load", 1.0), "is it in degrees?"),
        (
            ("grip", *PATCH[:2], "--slip", 0.1, "--speed", 1.0, "--load", 1.0),
            "has no [patch]; add it, or pass --width, --stiffness",
        ),
    ],
)
def test_invalid_input(refused, scene_file, arguments, message):
    name, *options = arguments
    assert message in refused(name, scene_file, *options)
