"""Files of maps: kills, refusals, several devices and processes; division into batches."""

import json
import os
import re
import resource
import signal
import socket
import subprocess
import sys

import h5py
import numpy as np
import pytest
from support.folders import PYTHONPATH, ROOT
from support.scenes.maps import FILE, QUICK, SCENE

import rubberfric as rf
from rubberfric.analysis import batches, maps
from rubberfric.commands import main as command
from rubberfric.io.files import load_result


def test_a_disk_without_space_is_found_out_before_the_work(tmp_path, monkeypatch):
    """A limit on file sizes acts like a full disk."""
    monkeypatch.setattr(batches, "launch", None)
    monkeypatch.chdir(tmp_path)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2**20, limits[1]))
    try:
        with pytest.raises(ValueError, match="cannot be written") as caught:
            rf.friction_map(SCENE, np.logspace(-6, 1, 500), np.logspace(5, 6, 500), path="m.h5", block=9)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "m.h5: cannot be written, 0.00373 GiB: " in str(caught.value)
    assert "File too large" in str(caught.value)
    assert os.listdir() == []


# --- kills

KILLED = """
import os, signal, sys
import jax; jax.config.update("jax_enable_x64", True)
import numpy as np, rubberfric as rf
from support.scenes.maps import SCENE
from rubberfric.analysis import batches
def launch(tiling, task, batch):  # instead of compiling
    v, p, T = batches.points(task.conditions, batch)
    return {"area": np.sin(p)[:, None] * v * T, "friction": np.cos(p)[:, None] * v / T}
batches.launch = launch
batches.fitted = lambda tiling, task: tiling
axes = np.logspace(-6, 1, 40), np.logspace(4, 7, 70), np.linspace(263.15, 333.15, 20)
def kill(done, points):
    if done > points / 2:
        os.kill(os.getpid(), signal.SIGKILL)
progress = kill if "kill" in sys.argv else None
rf.friction_map(SCENE, *axes, path=sys.argv[1], block=500, progress=progress, interpolate=False)
"""


@pytest.mark.slow
def test_a_killed_map_leaves_the_old_file_and_is_written_the_next_time(tmp_path):
    path = tmp_path / "m.h5"
    path.write_bytes(b"old")
    begin = [sys.executable, "-c", KILLED, str(path)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([*begin, "kill"], cwd=ROOT, env=environment, check=False)
    assert done.returncode == -signal.SIGKILL
    assert path.read_bytes() == b"old"
    subprocess.run(begin, cwd=ROOT, env=environment, check=True)
    assert [name for name in os.listdir(tmp_path) if not name.startswith(".writing-")] == ["m.h5"]
    found = load_result(path)
    v, p, T = found.conditions.grid()
    np.testing.assert_array_equal(found.solution.area, np.sin(p) * v * T)
    np.testing.assert_array_equal(found.solution.friction, np.cos(p) * v / T)


# --- several devices, several processes

SHARE = """
import json, sys
import jax; jax.config.update("jax_enable_x64", True); jax.config.update("jax_num_cpu_devices", 2)
rank, port, path = json.loads(sys.argv[1])
if rank is not None:
    jax.distributed.initialize(f"127.0.0.1:{port}", 2, rank)
import numpy as np, rubberfric as rf
from support.scenes.maps import SCENE, QUICK, POINTS
at = POINTS[0], np.append(POINTS[1], 2e5), POINTS[2]
def whole(**options):
    return rf.friction_map(SCENE, *at, quadrature=QUICK, block=33, **options).solution
found = whole()
names = ("area", "friction")
if rank is None:
    one = whole(devices=jax.devices()[:1])
    for name in names:
        np.testing.assert_allclose(getattr(found, name), getattr(one, name), rtol=1e-13)
else:
    assert jax.device_count() == 4
    written = whole(path=path)
    assert (written.area is None) == (rank == 1)
    try:
        whole(path="no/m.h5" if rank == 1 else path + "/m.h5")
    except ValueError as error:
        print(error)
if not rank:
    np.save(path + ".npy", np.stack([getattr(found, name) for name in names]))
"""


def shares(tmp_path, ranks, port=None):
    """Compute maps of 135 points in concurrent processes; returns their output."""
    runs = [
        subprocess.Popen(
            [sys.executable, "-c", SHARE, json.dumps([rank, port, str(tmp_path / f"{rank}.h5")])],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": PYTHONPATH},
        )
        for rank in ranks
    ]
    try:
        ends = [run.communicate(timeout=100) for run in runs]
    finally:
        for run in runs:
            run.kill()
    for run, (_, errors) in zip(runs, ends, strict=True):
        assert run.returncode == 0, errors
    return [output for output, _ in ends]


@pytest.mark.slow
def test_two_processes_of_two_devices_equal_one(tmp_path):
    """Use a number of points that the number of devices does not divide.

    Rounding differs because the devices evaluate different numbers of pairs at once in so small a map.
    """
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    assert shares(tmp_path, [None]) == [""]
    first, second = shares(tmp_path, [0, 1], port)
    assert re.search(r"m\.h5: folder '\S+' does not exist; create it first", first)
    assert second.endswith("no/m.h5: cannot be written by the first process; see its message\n")
    one, several = (np.load(tmp_path / f"{name}.h5.npy") for name in (None, 0))
    np.testing.assert_allclose(several, one, rtol=1e-13)
    written = load_result(tmp_path / "0.h5").solution
    np.testing.assert_array_equal(np.stack([written.area, written.friction]), several)
    assert sorted(os.listdir(tmp_path)) == ["0.h5", "0.h5.npy", "None.h5.npy"]


def test_the_command_makes_devices(tmp_path):
    """The number of devices can be set before the first JAX call only."""
    scene = tmp_path / "scene.toml"
    scene.write_text(FILE)
    code = (
        "import sys, jax\nfrom rubberfric.commands import main as command\n"
        "def say(n):\n"
        "    print(command.main(['map', sys.argv[1], '--devices', n]), jax.device_count())\n"
        "say('3')\nsay('2')\nsay('0')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(scene)], check=True, capture_output=True, text=True, cwd=ROOT
    )
    assert [line for line in done.stdout.splitlines() if line.endswith(" 3")] == ["0 3", "2 3", "2 3"]
    assert done.stderr.splitlines() == [
        "rubberfric: --devices 2: JAX has already started with 3 devices; use this number",
        "rubberfric: --devices 0: must be > 0",
    ]


HEATED = rf.Scene(
    rf.Body(rf.Rigid(), SCENE.lower.spectrum),
    SCENE.upper,
    heating=rf.Heating(density=1200.0, heat_capacity=1600.0, conductivity=0.23, radius=2e-3),
)


@pytest.mark.slow
def test_a_heated_map_says_where_it_did_not_converge(call_main, tmp_path, monkeypatch):
    """`converged` is boolean in memory and in files, and the command counts failures."""
    names, path = ("friction", "converged"), tmp_path / "m.h5"
    at = [1e-3, 1.0], [1e5, 2e5], 293.15
    real = rf.friction_map(HEATED, *at, quantities=names, quadrature=QUICK)
    exact = rf.solve(HEATED, *real.conditions.grid(), quantities=names, quadrature=QUICK)
    np.testing.assert_allclose(real.solution.friction, exact.friction, rtol=1e-12)
    assert real.solution.converged.all() and real.solution.converged.dtype == bool

    def launch(_, task, batch):
        velocity, pressure, _ = batches.points(task.conditions, batch)
        shape = pressure.size, velocity.size
        values = {"converged": np.broadcast_to(velocity < 0.5, shape), "friction": np.ones(shape)}
        return {name: values[name] for name in task.quantities}

    monkeypatch.setattr(batches, "launch", launch)
    monkeypatch.setattr(batches, "fitted", lambda tiling, _: tiling)
    for largest in (0, 2**28):
        monkeypatch.setattr(maps, "MOST_IN_MEMORY", largest)
        found = rf.friction_map(HEATED, *at, quantities=names, path=path)
        for solution in (found.solution, load_result(path).solution):
            assert solution.converged.dtype == bool
            np.testing.assert_array_equal(solution.converged, [[[True, False]] * 2])
    status, printed, _ = call_main(command.main, "map", path, "--quantity", "friction")
    assert status == 0 and "converged [" not in printed
    assert printed.splitlines()[-1].startswith(
        "the temperatures did not converge at 2 of 4 points, first at v = 1 m/s, p = 100000 Pa: their values"
    )
    # as older versions wrote them
    with h5py.File(path, "r+") as file:
        del file["converged"]
        file["converged"] = np.array([[[1.0, 0.0]] * 2])
        file["converged"].attrs["units"] = "-"
    assert load_result(path).solution.converged.tolist() == [[[True, False]] * 2]


# --- tilings


@pytest.mark.parametrize("block", [None, 1, 7, 1000])
@pytest.mark.parametrize("pressures", [1, 3, 65, 5000])
@pytest.mark.parametrize("pairs", [1, 5, 1000, 100_003])
def test_batches_are_every_point_once_and_in_bounds(pairs, pressures, block):
    """Batches respect the block size."""
    for shared in (True, False):
        tiling = batches.plan(pairs, pressures, shared=shared, block=block)
        if pairs * -(-pressures // tiling.columns) > 5000 * tiling.batch:
            continue
        while tiling is not None:
            assert tiling.batch * tiling.columns <= (block or batches.BATCH["cpu"])
            done = points = 0
            for batch in batches.batches(tiling):
                assert 0 < batch.stop - batch.first <= tiling.batch
                assert 0 < batch.high - batch.low <= tiling.columns
                assert divmod(done, pairs) == (batch.low // tiling.columns, batch.first)
                done += batch.stop - batch.first
                points += batch.size
            assert (done, points) == (pairs * -(-pressures // tiling.columns), pairs * pressures)
            tiling = batches.smaller(tiling)


@pytest.mark.parametrize("velocities", [1, 5, 7, 35, 40])
@pytest.mark.parametrize(("first", "stop"), [(0, 35), (0, 3), (3, 4), (6, 9), (5, 30), (4, 33), (34, 35)])
def test_a_batch_lies_in_a_map_as_rectangles(velocities, first, stop):
    found = np.zeros((35, velocities))
    for T, v, pairs in batches.MapBatch(first, stop, 0, 1).pieces(velocities):
        found[T, v] += np.arange(first, stop)[pairs].reshape(T.stop - T.start, -1)
    place = np.arange(found.size).reshape(found.shape)
    np.testing.assert_array_equal(found, np.where((place >= first) & (place < stop), place, 0))


def test_a_program_too_large_for_the_memory_takes_less_at_once(monkeypatch):
    asked = []

    def program_bytes(tiling, _):
        asked.append(tiling.group)
        return tiling.group * 2**25

    monkeypatch.setattr(batches, "program_bytes", program_bytes)
    tiling = batches.plan(1000, 1)
    found = batches.fitted(tiling, None)
    assert asked == [16, 8] and found.group * 2**25 == batches.MEMORY
    assert 0.9 * tiling.batch < found.batch <= tiling.batch
    monkeypatch.setattr(batches, "MEMORY", 1)
    assert batches.fitted(tiling, None).group == 1
