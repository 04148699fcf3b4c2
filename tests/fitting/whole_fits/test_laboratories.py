"""From the files of three laboratories to fitted scenes, by commands and in Python.

`notebooks/benchmarks/laboratories.py` contains the known scenes and both routes. Folder 1 has moduli of
TRIOS, traces of a stylus, and forces. Folder 2 has moduli of an Eplexor, a height map, and records.
Folder 3 has moduli of NETZSCH, a texture spectrum, and forces and moments of a wheel tester.
"""

import importlib
import shlex
import sys
from operator import attrgetter
from typing import NamedTuple

import numpy as np
import pytest
from support.folders import ROOT

import fitting
import rubberfric as rf
from fitting.commands.main import main as fit_main
from rubberfric.commands.main import main as scene_main

sys.path.append(str(ROOT / "notebooks" / "benchmarks"))
laboratories = importlib.import_module("laboratories")

PROGRAMS = {"rubberfric-fit": fit_main, "rubberfric": scene_main}


class Route(NamedTuple):
    """Scene before the fit, the fit, and the output of each command."""

    scene: rf.Scene
    result: fitting.FitResult
    printed: list[str]


@pytest.fixture
def call(call_main):
    """Run a command line in this process: its output. It must succeed without complaints."""

    def run(program, arguments):
        status, printed, complaint = call_main(PROGRAMS[program], *arguments, "--no-cache")
        assert (status, complaint) == (0, ""), complaint
        return printed

    return run


@pytest.fixture
def routes(call, tmp_path, monkeypatch):
    """Write the files of a laboratory and follow the commands and the Python route.

    The last result is the fit of the spectrum.
    """
    monkeypatch.chdir(tmp_path)

    def run(number):
        laboratory = laboratories.LABORATORIES[number]
        laboratory.write(laboratories.SEEDS[number])
        printed = [answer for _, answer in laboratories.follow(laboratory.commands, call)]
        by_commands = Route(rf.load_scene("scene.toml"), fitting.FitResult.load("fit.h5"), printed)
        road, scene, result = laboratory.route()
        return laboratory, (by_commands, Route(scene, result, [])), road

    return run


def assert_moduli(truth, route):
    """Assert |E* / truth - 1| < 5 %, the noise of 2 % or 2.5 % and the grid of two terms per decade."""
    material = route.scene.upper.material
    base = float(material.shift.log_factor(truth.T_ref)) / np.log(10)
    for celsius in (0.0, 20.0, 50.0):
        T = celsius + laboratories.ZERO
        for f in (0.1, 10.0, 1e3):
            E = complex(rf.complex_modulus(material, 2 * np.pi * f, T))
            assert abs(E / truth.modulus(2 * np.pi * f, T) - 1) < 0.05, (celsius, f)
        shift = float(material.shift.log_factor(T)) / np.log(10)
        assert abs(shift - base - truth.log10_shift(T)) < 0.1


def assert_road(truth, route, height, density):
    """Assert the rms height, and C at wavevectors, within relative errors."""
    road = route.scene.lower.spectrum
    assert float(rf.roughness.rms_height(road)) == pytest.approx(truth.h_rms, rel=height)
    for q, error in density.items():
        assert float(rf.power_spectrum(road, q)) == pytest.approx(float(truth.areal(np.array(q))), rel=error)


def assert_bars(truth, road):
    """Assert that the fitted rms height, H and q_r are within 3 standard errors."""
    assert set(road.stderr) == {"h_rms", "hurst", "qr"}
    for name, error in road.stderr.items():
        assert abs(float(getattr(road.spectrum, name)) - getattr(truth, name)) < 3 * error, name


def assert_fit(laboratory, route, rel):
    """Assert the fitted parameters within 3 standard errors, and friction within 5 %."""
    exact, result = laboratory.truth.scene(), route.result
    assert result.verdict.explains
    for name in result.names:
        assert abs(result[name].value - attrgetter(name)(exact)) < 3 * result[name].stderr, name
    for name in ("shear.c", "shear.shift.energy"):
        assert result[name].value == pytest.approx(attrgetter(name)(exact), rel=rel), name
    velocity, T = np.array([[1e-3], [1e-2], [1e-1]]), laboratories.ZERO + np.array([5.0, 20.0, 45.0])
    friction = [np.asarray(rf.friction(s, velocity, laboratory.pressure, T)) for s in (result.scene, exact)]
    np.testing.assert_allclose(*friction, rtol=0.05)


def assert_equal_routes(by_commands, in_python):
    """Assert that both routes give equal numbers, except for the tolerance of the minimum."""
    pairs = [(route.scene.upper.material, route.scene.lower.spectrum) for route in (by_commands, in_python)]
    for ours, theirs in zip(*pairs, strict=True):
        for name in ("E_inf", "E", "tau", "h_rms", "hurst", "qr", "q1"):
            if hasattr(ours, name):
                np.testing.assert_allclose(getattr(ours, name), getattr(theirs, name), rtol=1e-6)
    ours, theirs = by_commands.result, in_python.result
    assert list(ours.names) == list(theirs.names)
    np.testing.assert_array_less(np.abs(ours.values - theirs.values), 0.01 * ours.stderr)


@pytest.mark.slow
def test_forces_of_a_linear_tester(routes):
    """Eight traces have 80 waves up to the roll-off. C in the plateau is known within a factor of 2."""
    laboratory, both, road = routes(1)
    assert_bars(laboratory.truth, road)
    assert "WLF" in both[0].printed[0] and "8 traces of 4000 heights" in both[0].printed[1]
    for route in both:
        assert_moduli(laboratory.truth, route)
        assert_road(laboratory.truth, route, height=0.2, density={1e3: 0.9, 1e4: 0.2, 6e4: 0.1})
        assert_fit(laboratory, route, rel=0.2)
        assert "mu = |F_t| / |F_n|" in route.result.report()
        (data,) = route.result.data
        np.testing.assert_allclose(np.unique(data.pressure), [2e5, 5e5])
    assert_equal_routes(*both)


@pytest.mark.slow
def test_reciprocating_runs_on_a_height_map(routes):
    """The map has 60 waves up to the roll-off."""
    laboratory, both, road = routes(2)
    assert_bars(laboratory.truth, road)
    assert "WLF" in both[0].printed[0] and "400 x 400 heights, 0.5% of them filled" in both[0].printed[1]
    for route in both:
        assert_moduli(laboratory.truth, route)
        assert_road(laboratory.truth, route, height=0.1, density={1e3: 0.3, 1e4: 0.1, 6e4: 0.05})
        assert_fit(laboratory, route, rel=0.1)
        (data,) = route.result.data
        assert len(data) == 42
        np.testing.assert_allclose(data.pressure, np.where(data.pressure < 4e5, 2e5, 6e5), rtol=2e-3)
        exact = rf.friction(laboratory.truth.scene(), data.velocity, data.pressure, data.temperature)
        # The mean of six strokes with 3 % of noise each.
        deviation = (data.friction / np.asarray(exact) - 1) / (0.03 / np.sqrt(6))
        assert 0.6 < np.sqrt(np.mean(deviation**2)) < 1.4
    assert_equal_routes(*both)


@pytest.mark.slow
def test_from_a_wheel_tester_to_a_patch(routes, call):
    laboratory, both, road = routes(3)
    assert_bars(laboratory.truth, road)
    assert "WLF" in both[0].printed[0]
    for route in both:
        assert_moduli(laboratory.truth, route)
        assert_road(laboratory.truth, route, height=0.05, density={1e3: 0.2, 1e4: 0.2, 6e4: 0.2})
        assert_fit(laboratory, route, rel=0.2)
        assert {"patch.length", "patch.stiffness"} < set(route.result.names)
    assert_equal_routes(*both)
    # The patch of the scene that was fitted.
    rf.save_scene("fitted.toml", both[0].result.scene)
    line = "grip fitted.toml --slip 0.05 --speed 0.5 --load 75 --temperature 298.15"
    row = call("rubberfric", shlex.split(line)).splitlines()[1].split()
    scene = laboratory.truth.scene()
    exact = rf.grip(scene, scene.patch, 0.05, 0.5, 75.0, 298.15)
    assert float(row[3]) == pytest.approx(float(exact.force), rel=0.03)
