"""Files of maps in the making: interrupted, killed, resumed, refused; in one process and in several."""

import json
import os
import random
import resource
import socket
import subprocess
import sys

import h5py
import numpy as np
import pytest
from support.folders import PYTHONPATH, ROOT
from support.scenes.maps import BLOCK, FILE, POINTS, QUICK, SCENE

import rubberfric as rf
from rubberfric.analysis.maps import batches, unfinished
from rubberfric.analysis.maps import friction_map as maps
from rubberfric.commands import main as command
from rubberfric.io.results import load_result


class Stop(Exception):
    """What stops a map in these tests."""


def stopped_at(path, points, resume=False, **change):
    """A map that stops once so many of its 90 points are done."""

    def stop(done, _):
        if done >= points:
            raise Stop

    arguments = dict(zip(("velocity", "pressure", "temperature"), POINTS, strict=True)) | {"scene": SCENE}
    arguments |= dict(quadrature=QUICK, block=BLOCK, path=path, progress=stop, resume=resume, title="T")
    return rf.friction_map(**arguments | change)


@pytest.fixture
def every_batch(monkeypatch):
    """Progress is marked after every batch."""
    monkeypatch.setattr(unfinished, "INTERVAL", 0.0)


@pytest.fixture
def left(tmp_path, every_batch):
    """A map of which 48 points are done, the path it was for, and the folder that it left."""
    path = tmp_path / "m.h5"
    with pytest.raises(Stop):
        stopped_at(path, 48)
    assert os.listdir(tmp_path) == ["m.h5.partial"]
    return path, tmp_path / "m.h5.partial"


@pytest.mark.parametrize("streamed", [False, True])
def test_a_resumed_map_computes_only_the_rest(tmp_path, left, monkeypatch, streamed):
    path, _ = left
    monkeypatch.setattr(maps, "LARGEST", 0 if streamed else 2**28)
    told = []
    # Other batches than those it began with.
    found = rf.friction_map(
        SCENE,
        *POINTS,
        quadrature=QUICK,
        block=4 * BLOCK,
        path=path,
        resume=True,
        title="T",
        progress=lambda done, _: told.append(done),
    )
    assert told[0] == 48 and told[-1] == 90 and len(told) == 3
    assert os.listdir(tmp_path) == ["m.h5"]
    monkeypatch.setattr(maps, "LARGEST", 2**28)
    whole = rf.friction_map(SCENE, *POINTS, quadrature=QUICK, block=BLOCK)
    for name in maps.QUANTITIES:
        for values in (getattr(found.solution, name), getattr(load_result(path).solution, name)):
            np.testing.assert_allclose(values, getattr(whole.solution, name), rtol=1e-13)
    # with nothing left, it begins anew
    assert stopped_at(path, 91, resume=True).title == "T"


def test_a_map_stopped_again_and_again(tmp_path, every_batch):
    path = tmp_path / "m.h5"
    for points in (12, 18, 66):
        with pytest.raises(Stop):
            stopped_at(path, points, resume=True)
    found = stopped_at(path, 91, resume=True)
    whole = rf.friction_map(SCENE, *POINTS, quadrature=QUICK, block=BLOCK)
    np.testing.assert_array_equal(found.solution.friction, whole.solution.friction)
    assert os.listdir(tmp_path) == ["m.h5"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"resume": False}, "m.h5.partial: holds an interrupted map: must be resumed or removed"),
        ({"velocity": 2 * POINTS[0]}, "m.h5.partial: is of another map, its velocity differ"),
        ({"scene": rf.Scene(SCENE.lower, SCENE.upper), "title": ""}, "its scene, title differ"),
        ({"quadrature": rf.Quadrature(), "pressure": 1e5}, "its pressure, quadrature, order of the points"),
        ({"quantities": "area"}, "its quantities differ"),
        ("no path", "resume is set, path is None: must name the file of the interrupted map"),
        ("longer", "m.h5: has {} bytes: must have {}; it was cut off, remove it"),
        ("cut off", "m.h5: has 1000 bytes: must have {}; it was cut off, remove it"),
        ("no progress", "progress: is missing; what is beside it must be removed"),
        ("half a progress", "progress: must say how much is done; it does not, remove its folder"),
        ("no result", "m.h5: must be a whole HDF5 file"),
        ("in use", "m.h5.partial: is being written by another process: must be its alone"),
    ],
)
def test_what_cannot_be_resumed(left, monkeypatch, change, message):
    path, folder = left
    monkeypatch.setattr(batches, "launch", None)  # nothing may be computed
    data, size = folder / "m.h5", (folder / "m.h5").stat().st_size
    use = unfinished._alone(folder)
    if change == "longer":
        data.write_bytes(data.read_bytes() + b"0")
        message = message.format(size + 1, size)
    elif change == "cut off":
        os.truncate(data, 1000)
        message = message.format(size)
    elif change == "no progress":
        (folder / "progress").unlink()
    elif change == "half a progress":
        os.truncate(folder / "progress", 20)
    elif change == "no result":
        data.write_bytes(bytes(size))
    elif change == "in use":
        use.__enter__()
    elif change == "no path":
        path = None
    before = sorted(os.listdir(folder))
    with pytest.raises(ValueError) as caught:
        stopped_at(path, 91, **{"resume": True} | (change if isinstance(change, dict) else {}))
    if change == "in use":
        use.__exit__(None, None, None)
    assert message in str(caught.value) and "\n" not in str(caught.value)
    assert sorted(os.listdir(folder)) == before


def test_what_a_kill_between_the_last_two_steps_leaves(left):
    """The file has moved, its folder is still there: the folder goes."""
    path, folder = left
    os.replace(folder / "m.h5", path)
    with pytest.raises(Stop):
        stopped_at(path, 0)
    assert path.exists() and not folder.exists()


def test_a_disk_without_space_is_found_out_before_the_work(tmp_path, monkeypatch):
    """A limit to the size of files stands in for the disk: the system refuses as a full disk does."""
    monkeypatch.setattr(batches, "launch", None)
    monkeypatch.chdir(tmp_path)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2**20, limits[1]))
    try:
        with pytest.raises(ValueError) as caught:
            rf.friction_map(SCENE, np.logspace(-6, 1, 500), np.logspace(5, 6, 500), path="m.h5", block=9)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "m.h5: cannot be written, 0.00373 GiB: " in str(caught.value)
    assert "File too large" in str(caught.value)
    assert os.listdir() == []


def test_the_command_resumes(call_main, tmp_path, monkeypatch, every_batch):
    scene, out = tmp_path / "scene.toml", tmp_path / "m.h5"
    scene.write_text(FILE)
    monkeypatch.setattr(batches, "BLOCK", {"cpu": 12})
    launch, count = batches.launch, 0

    def interrupted(*arguments):
        nonlocal count
        count += 1
        if count == 4:
            raise KeyboardInterrupt
        return launch(*arguments)

    monkeypatch.setattr(batches, "launch", interrupted)
    status, printed, complaint = call_main(command.main, "map", scene, "--out", out)
    assert (status, printed) == (130, "")
    assert complaint == "rubberfric: interrupted; --resume goes on with m.h5.partial\n"
    status, _, complaint = call_main(command.main, "map", scene, "--out", out)
    assert status == 2 and complaint.endswith("holds an interrupted map: must be resumed or removed\n")
    count = 10
    status, printed, complaint = call_main(command.main, "map", scene, "--out", out, "--resume")
    assert (status, complaint) == (0, "")
    assert count - 10 == 4 - 2
    assert call_main(command.main, "map", scene) == (0, printed, "")
    assert sorted(os.listdir(tmp_path)) == ["m.h5", "scene.toml"]


# --- kills

CHILD = """
import jax; jax.config.update("jax_enable_x64", True)
import os, signal, sys, time, traceback
import numpy as np, rubberfric as rf
from rubberfric.analysis.maps import batches
from rubberfric.analysis.maps import unfinished
unfinished.INTERVAL = 0.0
def launch(layout, scene, conditions, batch, options):  # instead of compiling
    v, p, T = batches.points(conditions, batch)
    time.sleep(0.002)
    return {"area": np.sin(p)[:, None] * v * T, "friction": np.cos(p)[:, None] * v / T}
batches.launch = launch
batches.fitted = lambda layout, *_: layout
axes = np.logspace(-6, 1, 40), np.logspace(4, 7, 70), np.linspace(263.15, 333.15, 20)
def work(tell):
    material = rf.Prony(1e6, [1e8], [1e-5], shift=rf.WLF(8.0, 100.0, 293.15))
    scene = rf.Scene(rf.Body(rf.Rigid(), rf.SelfAffine(100.0, 1000.0, 1e4, 0.8, 1e-4)), rf.Body(material))
    told = []
    def progress(done, points):
        if not told:
            os.write(tell, b"s")
        told.append(done)
    found = rf.friction_map(scene, *axes, path=sys.argv[1], resume=True, block=500, progress=progress)
    v, p, T = found.conditions.grid()
    exact = np.sin(p) * v * T, np.cos(p) * v / T
    assert np.array_equal(found.solution.area, exact[0])
    assert np.array_equal(found.solution.friction, exact[1])
    os.write(tell, str(told[0]).encode())
for line in sys.stdin:  # seconds after which it is killed, or -1; every map in a fork from before JAX begins
    hear, tell = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            work(tell)
            os._exit(0)
        finally:
            traceback.print_exc()
            os._exit(1)
    os.close(tell)
    os.read(hear, 1)
    if float(line) >= 0:
        time.sleep(float(line))
        os.kill(child, signal.SIGKILL)
    status = os.waitpid(child, 0)[1]
    ends = {0: "whole " + os.read(hear, 100).decode(), signal.SIGKILL: "killed"}
    print(ends.get(status, "failed"), flush=True)
    os.close(hear)
"""


def kills(path, count, seed):
    """Kill a map so often at random moments; where the run that finished it began, of 56000 points."""
    dice, longest, done = random.Random(seed), 0.2, 0
    with subprocess.Popen(
        [sys.executable, "-W", "ignore", "-c", CHILD, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    ) as parent:

        def run(seconds):
            parent.stdin.write(f"{seconds}\n")
            parent.stdin.flush()
            return parent.stdout.readline().split()

        while done < count:
            ending = run(dice.uniform(0.0, longest))
            if ending[0] == "whole":  # too late: begin anew
                path.unlink()
                longest /= 2
            else:
                assert ending == ["killed"]
                done += 1
        word, began = run(-1)
        assert word == "whole"
    return int(began)


def test_a_map_killed_five_times_is_right(tmp_path):
    path = tmp_path / "m.h5"
    began = kills(path, 5, seed=1)
    assert began > 0
    assert [name for name in os.listdir(tmp_path) if not name.startswith(".writing-")] == ["m.h5"]
    assert load_result(path).solution.friction.shape == (20, 70, 40)


@pytest.mark.slow
def test_maps_killed_fifty_times_are_right(tmp_path):
    for seed in range(10):
        kills(tmp_path / f"{seed}.h5", 5, seed)


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
    """Maps of 135 points over the devices of some processes at once; what they print."""
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


def test_two_processes_of_two_devices_equal_one(tmp_path):
    """Of a number of points that the devices do not divide.

    To the last bits: in so small a map they take different numbers of pairs at once, and sum in other ways.
    """
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    assert shares(tmp_path, [None]) == [""]
    first, second = shares(tmp_path, [0, 1], port)
    assert "m.h5: there is no folder" in first
    assert second.endswith("no/m.h5: cannot be written by the first process, which says why\n")
    one, several = (np.load(tmp_path / f"{name}.h5.npy") for name in (None, 0))
    np.testing.assert_allclose(several, one, rtol=1e-13)
    written = load_result(tmp_path / "0.h5").solution
    np.testing.assert_array_equal(np.stack([written.area, written.friction]), several)
    assert sorted(os.listdir(tmp_path)) == ["0.h5", "0.h5.npy", "None.h5.npy"]


def test_the_command_makes_devices(tmp_path):
    """As many as asked for, before JAX begins; any other number is refused after."""
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
        "rubberfric: --devices 2: JAX has begun with 3: must be that",
        "rubberfric: --devices 0: must be > 0",
    ]


HEATED = rf.Scene(
    rf.Body(rf.Rigid(), SCENE.lower.spectrum),
    SCENE.upper,
    heating=rf.Heating(density=1200.0, heat_capacity=1600.0, conductivity=0.23, radius=2e-3),
)


def test_a_heated_map_says_where_it_did_not_converge(call_main, tmp_path, monkeypatch):
    """As bools in memory, on the way to the file and from the file; the command counts them."""
    names, path = ("friction", "converged"), tmp_path / "m.h5"
    at = [1e-3, 1.0], [1e5, 2e5], 293.15
    real = rf.friction_map(HEATED, *at, quantities=names, quadrature=QUICK)
    exact = rf.solve(HEATED, *real.conditions.grid(), quantities=names, quadrature=QUICK)
    np.testing.assert_allclose(real.solution.friction, exact.friction, rtol=1e-12)
    assert real.solution.converged.all() and real.solution.converged.dtype == bool

    def launch(layout, scene, conditions, batch, options):
        velocity, pressure, _ = batches.points(conditions, batch)
        shape = pressure.size, velocity.size
        values = {"converged": np.broadcast_to(velocity < 0.5, shape), "friction": np.ones(shape)}
        return {name: values[name] for name in options["quantities"]}

    monkeypatch.setattr(batches, "launch", launch)
    monkeypatch.setattr(batches, "fitted", lambda layout, *_: layout)
    for largest in (0, 2**28):
        monkeypatch.setattr(maps, "LARGEST", largest)
        found = rf.friction_map(HEATED, *at, quantities=names, path=path)
        for solution in (found.solution, load_result(path).solution):
            assert solution.converged.dtype == bool
            np.testing.assert_array_equal(solution.converged, [[[True, False]] * 2])
    status, printed, _ = call_main(command.main, "map", path, "--quantity", "friction")
    assert status == 0 and "converged [" not in printed
    assert printed.splitlines()[-1].startswith(
        "the temperatures did not converge at 2 of 4 points, first at v = 1 m/s, p = 100000 Pa: the values"
    )
    # as older versions wrote them
    with h5py.File(path, "r+") as file:
        del file["converged"]
        file["converged"] = np.array([[[1.0, 0.0]] * 2])
        file["converged"].attrs["units"] = "-"
    assert load_result(path).solution.converged.tolist() == [[[True, False]] * 2]


# --- layouts


@pytest.mark.parametrize("block", [None, 1, 7, 1000])
@pytest.mark.parametrize("pressures", [1, 3, 65, 5000])
@pytest.mark.parametrize("pairs", [1, 5, 1000, 100_003])
def test_batches_are_every_point_once_and_in_bounds(pairs, pressures, block):
    """From any progress on; no more than was asked for; padding is little."""
    for shared in (True, False):
        layout = batches.plan(pairs, pressures, shared=shared, block=block)
        if layout.work > 5000 * layout.batch:
            continue
        while layout is not None:
            assert layout.batch * layout.columns <= (block or batches.BLOCK["cpu"])
            for begin in {0, layout.pairs - 1, layout.work - 1}:
                done, points = begin, layout.points(begin)
                for batch in batches.batches(layout, begin):
                    assert 0 < batch.stop - batch.first <= layout.batch
                    assert 0 < batch.high - batch.low <= layout.columns
                    assert divmod(done, pairs) == (batch.low // layout.columns, batch.first)
                    done = batch.done
                    points += (batch.stop - batch.first) * (batch.high - batch.low)
                    assert points == layout.points(done)
                assert (done, points) == (layout.work, pairs * pressures)
            layout = batches.smaller(layout)


def test_a_program_too_large_for_the_memory_takes_less_at_once(monkeypatch):
    asked = []

    def program_bytes(layout, *_):
        asked.append(layout.group)
        return layout.group * 2**25

    monkeypatch.setattr(batches, "program_bytes", program_bytes)
    layout = batches.plan(1000, 1)
    found = batches.fitted(layout, None, None, None)
    assert asked == [16, 8] and found.group * 2**25 == batches.MEMORY
    assert 0.9 * layout.batch < found.batch <= layout.batch
    monkeypatch.setattr(batches, "MEMORY", 1)
    assert batches.fitted(layout, None, None, None).group == 1
