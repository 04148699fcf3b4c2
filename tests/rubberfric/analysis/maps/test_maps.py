"""Friction maps equal `solve` in any batches, in memory or in a file; plots and the command."""

import json
import math
import os
import re
import subprocess
import sys

import h5py
import jax
import jax.numpy as jnp
import numpy as np
import problems
import pytest
from support.counting.compilations import compilations
from support.folders import ROOT
from support.scenes.maps import BLOCK, POINTS, PRESSURE, QUICK, ROAD, SCENE, TEMPERATURE, VELOCITY

import rubberfric as rf
from rubberfric.analysis import batches, maps
from rubberfric.io.files import load_result
from rubberfric.io.results import Conditions


@pytest.mark.parametrize("block", [BLOCK, None])
def test_a_map_is_solve_at_every_point(block):
    """Compare for batches that leave a rest of the 90 points, and for one batch."""
    names = rf.quantities_of(SCENE)
    found = rf.friction_map(SCENE, *POINTS, quantities=names, quadrature=QUICK, block=block, title="T")
    T, p, v = (x.ravel() for x in np.meshgrid(TEMPERATURE, PRESSURE, VELOCITY, indexing="ij"))
    expected = rf.solve(SCENE, v, p, T, quadrature=QUICK, quantities=names)
    for name in names:
        values = getattr(found.solution, name)
        assert isinstance(values, np.ndarray) and values.shape == (5, 2, 9)
        np.testing.assert_allclose(values.ravel(), getattr(expected, name), rtol=1e-13, err_msg=name)
    assert (found.scene, found.quadrature, found.title) == (SCENE, QUICK, "T")
    for axis, given in zip(found.conditions, POINTS, strict=True):
        np.testing.assert_array_equal(axis, given)


def test_requested_quantities_and_one_temperature_if_none_is_given():
    found = rf.friction_map(SCENE, VELOCITY, 1e5, quantities="area", quadrature=QUICK)
    expected = rf.contact_area(SCENE, VELOCITY, np.full(9, 1e5), quadrature=QUICK)
    assert found.conditions.temperature is None
    assert found.solution.friction is None
    np.testing.assert_allclose(found.solution.area[0, 0], expected, rtol=1e-13)
    default = rf.friction_map(SCENE, *POINTS, quadrature=QUICK, block=BLOCK).solution
    assert [name for name in default._fields if getattr(default, name) is not None] == ["area", "friction"]


@pytest.mark.parametrize("quantity", ["area", "friction", "separation"])
def test_the_default_setting_suits_the_quantities(monkeypatch, quantity):
    monkeypatch.setattr(maps, "_fill", lambda *_, **__: None)  # computes nothing
    usual = problems.scene((problems.RIGID, problems.ROAD), (problems.TREAD,))
    found = rf.friction_map(usual, [0.1], [3e5], quantities=(quantity,)).quadrature
    assert found == rf.analysis.default_quadrature(usual, 3e5, separation=quantity == "separation")
    assert found != rf.analysis.default_quadrature(usual, 3e5, separation=quantity != "separation")


def test_single_precision_stays_single():
    scene = jax.tree.map(lambda x: jnp.asarray(x, "float32"), SCENE)
    found = rf.friction_map(scene, 0.5, 1e5, 300.0, quadrature=QUICK)
    assert found.solution.friction.dtype == np.float32
    assert found.conditions.velocity.dtype == np.float32
    point = [np.array([x], np.float32) for x in (0.5, 1e5, 300.0)]
    expected = rf.solve(scene, *point, quadrature=QUICK, quantities=maps.DEFAULT_QUANTITIES)
    np.testing.assert_array_equal(found.solution.friction, expected.friction[None, None])


@pytest.mark.slow
def test_one_program_for_all_batches_and_maps():
    with compilations() as compiled:
        rf.friction_map(SCENE, *POINTS, quadrature=QUICK, block=BLOCK)
        rf.friction_map(SCENE, VELOCITY[:7], PRESSURE, TEMPERATURE, quadrature=QUICK, block=BLOCK)
    assert [name for name in compiled if "_evaluate" in name] == ["jit(_evaluate)"]


def test_streaming_to_a_file_equals_memory(tmp_path, monkeypatch):
    path = tmp_path / "m.h5"
    whole = rf.friction_map(SCENE, *POINTS, quadrature=QUICK, path=path, title="Map", block=BLOCK)
    written = load_result(path)
    path.unlink()
    monkeypatch.setattr(maps, "MOST_IN_MEMORY", 0)
    streamed = rf.friction_map(SCENE, *POINTS, quadrature=QUICK, path=path, title="Map", block=BLOCK)
    again = load_result(path)
    for name in maps.DEFAULT_QUANTITIES:
        assert isinstance(getattr(streamed.solution, name), np.memmap)
        assert not getattr(streamed.solution, name).flags.writeable
        for found in (streamed, written, again):
            values = getattr(found.solution, name)
            np.testing.assert_allclose(values, getattr(whole.solution, name), rtol=1e-13)
    assert streamed.solution.separation is again.solution.separation is None
    assert (again.title, again.quadrature) == (written.title, written.quadrature) == ("Map", QUICK)
    with h5py.File(path) as file:
        assert [dim.label for dim in file["friction"].dims] == ["temperature", "pressure", "velocity"]
        assert file["friction"].attrs["units"] == "-"
    assert os.listdir(tmp_path) == ["m.h5"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"velocity": [1.0, math.nan]}, "velocity[1] = nan: must be finite"),
        ({"velocity": [[1.0]]}, "velocity has shape (1, 1): must be one number or a list"),
        ({"velocity": "fast"}, "velocity = 'fast': must be a number"),
        ({"pressure": [1e5, 0.0]}, "pressure[1] = 0.0: must be > 0"),
        ({"pressure": []}, "pressure has shape (0,): must be one number or a list"),
        ({"temperature": [293.15, 150.0]}, "must be > 193.15 K, the pole of the WLF law"),
        ({"quantities": ("frictoin",)}, "did you mean 'friction'?"),
        ({"quantities": ()}, "quantities is empty; name at least one"),
        ({"quantities": ("converged",)}, "quantities has 'flash_temperature' or 'converged': the scene must"),
        ({"block": 0}, "block = 0: must be an integer >= 1"),
        ({"scene": "scene"}, "scene is a str: must be a Scene"),
        ({"quadrature": 1e-9}, "quadrature is a float: must be a Quadrature"),
        ({"path": "m.csv"}, "m.csv: suffix '.csv': must be .h5"),
        ({"path": "no/m.h5"}, "folder 'no' does not exist; create it first"),
        (
            {"velocity": np.logspace(0, 1, 1000), "pressure": np.logspace(5, 6, 1000)},
            "path is None, but the results take 0.0745 GiB and memory holds 0.00",
        ),
    ],
)
def test_bad_arguments_are_one_line(tmp_path, monkeypatch, change, message):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(maps, "MOST_IN_MEMORY", 2**23)
    monkeypatch.setattr(batches, "launch", None)  # nothing may be computed
    good = dict(scene=SCENE, velocity=VELOCITY, pressure=PRESSURE, temperature=TEMPERATURE)
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        rf.friction_map(**good | change)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert os.listdir() == []


def test_a_temperature_that_nothing_depends_on():
    scene = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(rf.Elastic(1e7, 0.5)))
    with pytest.raises(ValueError, match="must be absent because nothing in the scene has a shift"):
        rf.friction_map(scene, 1.0, 1e5, 293.15)


def test_progress_is_reported_before_the_first_and_after_every_batch():
    told = []
    rf.friction_map(SCENE, *POINTS, quadrature=QUICK, block=BLOCK, progress=lambda *at: told.append(at))
    assert told == [(done, 90) for done in range(0, 91, 6)]


@pytest.mark.parametrize("streamed", [False, True])
def test_a_stopped_map_leaves_no_file_and_an_old_one_alone(tmp_path, monkeypatch, streamed):
    monkeypatch.setattr(maps, "MOST_IN_MEMORY", 0 if streamed else 2**28)
    path = tmp_path / "m.h5"

    def interrupt(done, _):
        if done:
            raise KeyboardInterrupt

    def stopped():
        with pytest.raises(KeyboardInterrupt):
            rf.friction_map(SCENE, *POINTS, quadrature=QUICK, block=BLOCK, path=path, progress=interrupt)

    stopped()
    assert os.listdir(tmp_path) == []
    path.write_bytes(b"old")
    stopped()
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["m.h5"]


@pytest.mark.parametrize("streamed", [False, True])
def test_a_point_that_is_not_finite_is_named(tmp_path, monkeypatch, streamed):
    def launch(_, task, batch):
        velocity, pressure, _ = batches.points(task.conditions, batch)
        return {"area": np.ones((pressure.size, 1)) / (velocity - VELOCITY[3]), "friction": np.ones((2, 45))}

    monkeypatch.setattr(maps, "MOST_IN_MEMORY", 0 if streamed else 2**28)
    monkeypatch.setattr(batches, "launch", launch)
    where = f"area = inf at velocity = {VELOCITY[3]:g}, pressure = 300000, temperature = 263.15: not finite"
    with (
        np.errstate(divide="ignore"),
        pytest.raises(FloatingPointError, match=where.replace(".", r"\.").replace("+", r"\+")),
    ):
        rf.friction_map(SCENE, *POINTS, path=tmp_path / "m.h5")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(("nv", "nT", "nP"), [(1000, 500, 1), (300, 20, 40), (7, 1, 3)])
def test_a_batch_takes_little_memory_however_large_the_map(nv, nT, nP):
    """Check the memory of the compiled function; results are bounded by MOST_IN_MEMORY or in the file."""
    conditions = Conditions(np.ones(nv), np.full(nP, 1e5), np.full(nT, 300.0))
    tiling = batches.plan(nv * nT, nP)
    scene = batches.on_all(tiling.mesh, jax.tree.map(jnp.asarray, SCENE))
    task = batches.Task(scene, conditions, rf.Quadrature(), rf.quantities_of(SCENE))
    assert batches.fitted(tiling, task) == tiling
    batch = batches.program_bytes(tiling, task)
    assert 0 < batch < 2**23
    # Functions take at most batches.MEMORY, two batches hold results, and JAX takes half a GiB.
    assert 2 * batches.MEMORY + maps.MOST_IN_MEMORY + 2**29 < 2**31


# In a separate process, because the peak of the resident set never falls.
LARGE = """
import json, resource, sys
import jax; jax.config.update("jax_enable_x64", True)
import numpy as np, rubberfric as rf
from rubberfric.analysis import maps
from rubberfric.io.files import read_scene_file
scene, conditions, _ = read_scene_file("data/tread_on_asphalt.toml", "map")
v, T = np.logspace(-6, 2, 1000), np.linspace(243.15, 373.15, 501)
maps.MOST_IN_MEMORY = 2**20
found = rf.friction_map(scene, v, conditions.pressure[:2], T, quadrature=rf.Quadrature(), path=sys.argv[1])
assert isinstance(found.solution.friction, np.memmap)
finest = rf.Quadrature(order=20, panels=24, graded=12, ratio=4.0, angular_order=24)
i, k = slice(None, None, 71), slice(None, None, 20)
at = conditions._replace(velocity=v[k], pressure=conditions.pressure[:2], temperature=T[i])
exact = rf.solve(scene, *at.grid(), quadrature=finest)
error = max(
    float(np.max(np.abs(getattr(found.solution, name)[i, :, k] / getattr(exact, name) - 1)))
    for name in maps.DEFAULT_QUANTITIES
)
used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
print(json.dumps([found.solution.friction.size, used, error]))
"""


@pytest.mark.slow
def test_a_million_points_stay_below_two_gibibytes(tmp_path):
    command = [sys.executable, "-c", LARGE, str(tmp_path / "m.h5")]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT)
    points, used, error = json.loads(done.stdout)
    assert points >= 1e6 and used < 2.0 and error < 1e-9
