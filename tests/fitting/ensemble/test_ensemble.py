"""Ensembles: the same numbers on any devices and processes, through kills and full disks."""

import dataclasses
import functools
import json
import os
import random
import re
import resource
import socket
import subprocess
import sys
import time
import warnings
from pathlib import Path

import h5py
import jax
import numpy as np
import pytest
from support.counting.compilations import compilations
from support.ensembles import ensemble_cases as cases
from support.folders import PYTHONPATH, ROOT

import fitting
from fitting.ensemble.run import largest_batch
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.objective import CONVERGED, INTERRUPTED, NOT_FINITE, OUT_OF_STEPS, PERFECT
from fitting.solvers.runs import run_fits

PROGRAM = Path(cases.__file__)


@pytest.fixture(scope="module")
def members():
    return cases.modulus()


@pytest.fixture(scope="module")
def whole(members):
    """The run that nothing disturbs."""
    return fitting.run_ensemble(members, batch=4)


@pytest.fixture(scope="module")
def result():
    return fitting.fit(cases.SCENE, cases.modulus_data(), {cases.E: fitting.Positive()})


def assert_same(one, other, rows=slice(None)):
    """Every number of every member, to the last bit."""
    for name in cases.ROWS:
        a, b = (x[name] if isinstance(x, dict) else getattr(x, name) for x in (one, other))
        np.testing.assert_array_equal(a[rows], b[rows], err_msg=name)


def start(*arguments, devices=1, **options):
    added = {"JAX_NUM_CPU_DEVICES": str(devices), "JAX_PLATFORMS": "cpu", "PYTHONPATH": PYTHONPATH}
    command = [sys.executable, str(PROGRAM), *map(str, arguments)]
    return subprocess.Popen(command, env=os.environ | added, text=True, stdout=subprocess.PIPE, **options)


def finished(process, timeout=120):
    out, _ = process.communicate(timeout=timeout)
    assert process.returncode == 0, out
    return out


def refused(call, *words):
    """The message of the ValueError that `call` raises: one line with these words in it."""
    with pytest.raises(ValueError, match=re.escape(str(words[0]))) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert str(word) in message, message
    return message


# --- what members end at


def test_members_end_where_single_fits_do(members, whole):
    assert len(whole) == 17 and whole.failed.size == 0
    for i in range(0, 17, 4):
        one = run_fits(members.solver, members.problem, members.starts[i][None]).row(0)
        assert one.cost == pytest.approx(whole.cost[i], rel=1e-10)
        assert one.status == whole.status[i] and one.njev == whole.njev[i]
        np.testing.assert_allclose(one.x, whole.x[i], rtol=1e-8)
    assert whole.best == np.argmin(whole.cost)
    assert np.ptp(whole.njev) > 2  # or no fit ever took the place of another


def test_bootstrap_is_that_of_the_result(result):
    members = fitting.bootstrap_members(result, 11, jax.random.key(4))
    ours = fitting.run_ensemble(members)
    theirs = result.bootstrap(11, jax.random.key(4))
    assert ours.names == theirs.names and ours.good.all() and theirs.failed == 0
    assert np.all(np.abs(ours.values - theirs.values) < 1e-3 * result.stderr)
    assert np.std(ours.values, 0) == pytest.approx(result.stderr, rel=0.8)
    refused(lambda: members.profiles(None), "'bootstrap'", "must be 'profile'")


def test_profiles_are_those_of_the_result(result):
    members = fitting.profile_members(result, level=0.9, points=2)
    profiles = members.profiles(fitting.run_ensemble(members))
    assert list(profiles) == list(result.names) and len(members) == 5 * 3
    name = result.names[1]
    theirs = result.profile(name, 0.9, 2)
    np.testing.assert_allclose(profiles[name].rise, theirs.rise, atol=1e-6)
    np.testing.assert_allclose(profiles[name].values, theirs.values, rtol=1e-12)
    assert profiles[name].low == pytest.approx(theirs.low, rel=1e-6)
    assert profiles[name].high == pytest.approx(theirs.high, rel=1e-6)
    assert fitting.profile_members(result, name, points=1).names == result.names


# --- batches, devices, processes


@pytest.mark.parametrize("size", [pytest.param(1, marks=pytest.mark.slow), 7])
def test_the_size_of_a_batch_does_not_change_a_bit(members, whole, size):
    assert_same(fitting.run_ensemble(members, batch=size), whole)


def test_one_vectorised_program_changes_rounding_at_most(members, whole):
    batch = fitting.run_ensemble(members, batch=5, vectorised=True)
    np.testing.assert_array_equal(batch.status, whole.status)
    np.testing.assert_allclose(batch.cost, whole.cost, rtol=1e-12)
    np.testing.assert_allclose(batch.x, whole.x, rtol=1e-9)


@pytest.mark.slow
def test_devices_do_not_change_a_bit(tmp_path, whole):
    """Seventeen members on three devices of two each."""
    finished(start("modulus", tmp_path / "out.npz", devices=3))
    found = dict(np.load(tmp_path / "out.npz"))
    assert found["devices"] == 3
    assert_same(found, whole)


@pytest.mark.slow
def test_devices_change_friction_by_rounding_at_most(tmp_path):
    """XLA simplifies functions for one device by other passes than for several."""
    finished(start("friction", tmp_path / "out.npz", devices=3))
    found = dict(np.load(tmp_path / "out.npz"))
    assert_same(found, {name: found[f"two_{name}"] for name in cases.ROWS})
    good = found["status"] == CONVERGED
    assert good.sum() >= 5
    np.testing.assert_array_equal(found["one_status"][good], CONVERGED)
    np.testing.assert_allclose(found["one_cost"][good], found["cost"][good], rtol=1e-12)
    np.testing.assert_allclose(found["one_x"][good], found["x"][good], rtol=1e-7)


@pytest.mark.slow
def test_full_batches_on_two_devices_end():
    """Batches of 32 members with 20 parameters, in which both devices once waited for each other."""
    program = ROOT / "tests" / "support" / "ensembles" / "ensemble_twin.py"
    environment = os.environ | {"JAX_NUM_CPU_DEVICES": "2", "JAX_PLATFORMS": "cpu", "PYTHONPATH": PYTHONPATH}
    command = [sys.executable, str(program), "ensemble", "64", "float64"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=200, check=True)
    found = json.loads(done.stdout.splitlines()[-1])
    assert (found["devices"], found["batch"], found["failed"]) == (2, 32, 0)


@pytest.mark.slow
def test_two_processes_do_not_change_a_bit(tmp_path, members, whole):
    """Two devices each; the first writes the checkpoint, which a single process reads."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    outs = [tmp_path / f"{i}.npz" for i in range(2)]
    path = tmp_path / "run.h5"
    both = [start("modulus", out, path, 2, i, port, devices=2) for i, out in enumerate(outs)]
    try:
        for process in both:
            finished(process)
    finally:
        for process in both:
            process.kill()
            process.communicate()
    for out in outs:
        other = dict(np.load(out))
        assert other["devices"] == 4
        assert_same(other, whole)
    assert_same(fitting.run_ensemble(members, checkpoint=path, resume=True), whole)


@pytest.mark.usefixtures("whole")
def test_a_second_ensemble_compiles_no_fit(members):
    with compilations() as compiled:
        fitting.run_ensemble(members, batch=3)
        assert "accept" in " ".join(map(str, compiled))
        compiled.clear()
        fitting.run_ensemble(members, batch=3)
    assert "accept" not in " ".join(map(str, compiled))


# --- memory


def test_a_batch_is_as_large_as_memory_holds(members):
    sized = functools.partial(largest_batch, members, jax.devices()[:1])
    many, most = sized(vectorised=True)
    assert many.count == 17
    few, peak = sized(vectorised=True, max_memory=most // 3)
    assert 1 <= few.count <= 6 and peak <= most // 3
    # One after the other they share the memory of intermediate results.
    serial, in_turn = sized(vectorised=False)
    assert serial.count == 17 and in_turn < 0.75 * most
    result = fitting.run_ensemble(members, vectorised=True, max_memory=most // 3)
    assert result.peak == peak and result.batch == few.count


def test_too_little_memory_is_refused_before_a_step(members):
    steps = []
    refused(
        lambda: fitting.run_ensemble(members, max_memory=1000, callback=lambda *at: steps.append(at)),
        "max_memory = 1000: a step of a batch of 1 takes",
    )
    refused(lambda: fitting.run_ensemble(members, max_memory=1000, batch=3), "a step of a batch of 3 takes")
    assert steps == [(0, 17)]


# --- failures of members


def test_failed_members(members, whole):
    starts = members.starts.copy()
    starts[5], starts[11] = np.nan, 1e4
    ends = fitting.run_ensemble(dataclasses.replace(members, starts=starts), batch=4)
    assert ends.failed.tolist() == [5, 11]
    assert ends.status[5] == ends.status[11] == NOT_FINITE
    assert "failed: 5, 11" in ends.report()
    others = np.setdiff1d(np.arange(17), [5, 11])
    assert_same(ends, whole, others)
    ends = fitting.run_ensemble(dataclasses.replace(members, starts=members.starts + np.nan))
    assert ends.failed.size == 17 and "failed" in ends.report()
    refused(lambda: ends.best, "no member has a finite cost")
    refused(ends.interval, "no member converged")
    ends = fitting.run_ensemble(dataclasses.replace(members, max_steps=3))
    assert np.all(ends.njev <= 3) and OUT_OF_STEPS in ends.status
    assert np.all(ends.cost < np.inf)


# --- checkpoints


def interrupt(after):
    calls = []

    def callback(done, _):
        calls.append(done)
        if len(calls) > after:
            raise KeyboardInterrupt

    return callback


@pytest.mark.parametrize("after", [0, 7])
def test_an_interrupted_run_goes_on_to_the_same_numbers(tmp_path, members, whole, after):
    path = tmp_path / "run.h5"
    part = fitting.run_ensemble(members, checkpoint=path, batch=3, callback=interrupt(after))
    assert INTERRUPTED in part.status
    done = part.status != INTERRUPTED
    assert_same(part, whole, done)
    # In another batch, and interrupted once more.
    fitting.run_ensemble(members, checkpoint=path, resume=True, batch=5, callback=interrupt(2))
    assert_same(fitting.run_ensemble(members, checkpoint=path, resume=True, batch=4), whole)
    again = fitting.run_ensemble(members, checkpoint=path, resume=True)
    assert_same(again, whole)
    assert again.batch == 0 and again.seconds > 0
    assert os.listdir(tmp_path) == ["run.h5"]


@pytest.mark.parametrize("method", ["lbfgs", "adam"])
@pytest.mark.slow
def test_the_state_of_every_solver_is_kept(tmp_path, method):
    members = cases.modulus(5, method=method, max_steps=40)
    path = tmp_path / "run.h5"
    fitting.run_ensemble(members, checkpoint=path, callback=interrupt(20))
    resumed = fitting.run_ensemble(members, checkpoint=path, resume=True)
    assert_same(resumed, fitting.run_ensemble(members))


@pytest.mark.slow
@pytest.mark.parametrize("kills", [1, 50])
def test_kills_lose_nothing_but_the_steps_since_the_checkpoint(tmp_path, whole, kills):
    """Killed with no chance to clean up, at random moments from the first line it prints on."""
    path, out = tmp_path / "run.h5", tmp_path / "out.npz"
    chance, killed, told, stop = random.Random(kills), 0, 0, 0.8
    while killed < kills:
        process = start("modulus", out, path)
        process.stdout.readline()
        time.sleep(chance.uniform(0.0, stop))
        process.kill()
        lines = process.communicate()[0].split()
        assert process.returncode in (0, -9)
        if process.returncode == 0:  # was done before: once more from the beginning, killed sooner
            assert_same(dict(np.load(out)), whole)
            path.unlink()
            told, stop = 0, 0.7 * stop
            continue
        killed += 1
        told = max([told, *map(int, lines)])
        with h5py.File(path) as file:
            begun, status = file["begun"][()], file["iterate/2"][()]
            assert np.sum(begun & (status != 0)) >= told
    finished(start("modulus", out, path))
    assert_same(dict(np.load(out)), whole)
    # A process that is killed while it writes cannot remove the hidden folder of the new file.
    assert [name for name in sorted(os.listdir(tmp_path)) if name[0] != "."] == ["out.npz", "run.h5"]


@pytest.fixture
def small_files():
    """A function that limits the size of files, as a full disk does, in bytes; None: no more."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    def limit(size):
        resource.setrlimit(resource.RLIMIT_FSIZE, (before[0] if size is None else size, before[1]))

    yield limit
    limit(None)


def test_a_full_disk_is_reported_before_the_first_step(tmp_path, members, small_files):
    path, steps = tmp_path / "run.h5", []
    small_files(1000)
    refused(
        lambda: fitting.run_ensemble(members, checkpoint=path, callback=lambda *at: steps.append(at)),
        f"{path}: cannot be written: File too large",
    )
    assert not steps and not os.listdir(tmp_path)


def test_a_disk_that_fills_up_meanwhile_costs_no_results(tmp_path, members, whole, small_files):
    path, calls = tmp_path / "run.h5", []

    def callback(done, _):
        calls.append(done)
        if len(calls) == 4:
            small_files(1000)

    with pytest.warns(RuntimeWarning, match=r"run\.h5: checkpoint not written.*File too large") as warned:
        ends = fitting.run_ensemble(members, checkpoint=path, every=0, batch=4, callback=callback)
    small_files(None)
    assert len(warned) > 1
    assert_same(ends, whole)
    assert os.listdir(tmp_path) == ["run.h5"]
    assert_same(fitting.run_ensemble(members, checkpoint=path, resume=True), whole)


def test_paths_that_cannot_be_written_to(tmp_path, members):
    for path, words in {
        tmp_path / "none" / "run.h5": "does not exist; create it first",
        tmp_path / "run.txt": "suffix '.txt': must be .h5",
        tmp_path / "folder.h5": "is a folder",
    }.items():
        (tmp_path / "folder.h5").mkdir(exist_ok=True)
        refused(lambda path=path: fitting.run_ensemble(members, checkpoint=path), path, words)


@pytest.fixture(scope="module")
def half_way(tmp_path_factory, members):
    path = tmp_path_factory.mktemp("half") / "run.h5"
    fitting.run_ensemble(members, checkpoint=path, batch=3, callback=interrupt(5))
    return path


@pytest.mark.parametrize(
    "change",
    [
        lambda m: dataclasses.replace(m, starts=m.starts + 1e-15),
        lambda m: dataclasses.replace(m, max_steps=7),
        lambda m: dataclasses.replace(m, solver=LevenbergMarquardt(1e-8)),
        lambda m: dataclasses.replace(m, targets=m.targets._replace(error=2 * m.targets.error)),
        lambda _: fitting.multi_start(
            cases.SCENE, cases.modulus_data(), {cases.E: fitting.Positive()}, 17, jax.random.key(1)
        ),
        lambda _: cases.modulus(quadrature=cases.QUADRATURE),
    ],
    ids=["starts", "steps", "solver", "errors", "free", "quadrature"],
)
def test_a_checkpoint_of_another_job_is_refused(members, half_way, change):
    before = half_way.read_bytes()
    other = change(members)
    refused(
        lambda: fitting.run_ensemble(other, checkpoint=half_way, resume=True),
        half_way,
        "belongs to another job",
    )
    assert half_way.read_bytes() == before


def test_checkpoints_of_other_jobs(members, half_way):
    more = dataclasses.replace(members, starts=np.concatenate([members.starts, members.starts[:2]]))
    count = members.starts.shape[0]
    refused(
        lambda: fitting.run_ensemble(more, checkpoint=half_way, resume=True),
        half_way,
        f"has {count} members: must have {count + 2}",
    )
    assert cases.modulus().fingerprint() == members.fingerprint()
    before = half_way.read_bytes()
    refused(lambda: fitting.run_ensemble(members, checkpoint=half_way), half_way, "resume=True")
    assert half_way.read_bytes() == before


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("format_version", 2, "format_version = 2: must be 1"),
        ("format", "rubberfric fit", "must be 'rubberfric ensemble checkpoint'"),
        ("rubberfric_version", "0.0.1", "written by version 0.0.1"),
        ("seconds", None, "seconds"),
        ("more", 1, "'more' is unknown"),
        ("steps", np.zeros(3, int), "steps"),
        ("iterate/0", np.zeros((17, 4), "f4"), "iterate/0"),
        ("begun", None, "begun"),
    ],
)
def test_a_checkpoint_with_other_content_is_refused(tmp_path, members, half_way, name, value, words):
    path = tmp_path / "run.h5"
    path.write_bytes(half_way.read_bytes())
    with h5py.File(path, "r+") as file:
        content = file if name in file else file.attrs
        if name in content:
            del content[name]
        if value is not None:
            content[name] = value
    refused(lambda: fitting.run_ensemble(members, checkpoint=path, resume=True), path, words)


@pytest.mark.parametrize("part", [0.0, 0.01, 0.3, 0.7, 0.999])
def test_a_truncated_checkpoint_is_refused(tmp_path, members, half_way, part):
    path, whole = tmp_path / "run.h5", half_way.read_bytes()
    path.write_bytes(whole[: int(part * len(whole))])
    words = path, "must be a whole HDF5 file"
    refused(lambda: fitting.run_ensemble(members, checkpoint=path, resume=True), *words)


# --- results and arguments


def test_a_result_is_saved_and_read(tmp_path, whole):
    path = tmp_path / "ensemble.h5"
    whole.save(path)
    back = fitting.EnsembleResult.load(path)
    assert_same(back, whole)
    for field in dataclasses.fields(whole):
        if field.name not in cases.ROWS:
            assert getattr(back, field.name) == getattr(whole, field.name)
    assert back.report() == whole.report() and "17 converged" in back.report()
    low, high = back.interval(0.5)
    assert np.all(low <= high) and repr(back) == repr(whole)
    with h5py.File(path, "r+") as file:
        file["status"][0] = 99
    refused(lambda: fitting.EnsembleResult.load(path), path, "/status: must be one of")


def test_intervals_are_quantiles_of_the_converged_members():
    values = np.random.default_rng(0).permutation(np.arange(1.0, 102.0))[:, None]
    lost = np.full((20, 1), 1e9)
    status = np.repeat([CONVERGED, OUT_OF_STEPS], [101, 20])
    found = fitting.EnsembleResult(
        *("starts", ("a",), np.zeros((121, 1)), np.concatenate([values, lost]), np.zeros(121), status),
        *(status, status, 0.0, 1, 1, 0),
    )
    np.testing.assert_allclose(np.ravel(found.interval(0.9)), [6.0, 96.0], rtol=1e-12)
    np.testing.assert_allclose(np.ravel(found.interval(0.5)), [26.0, 76.0], rtol=1e-12)


def test_given_starts_are_kept():
    free, data = {cases.E: fitting.Positive()}, cases.modulus_data()
    drawn = fitting.multi_start(cases.SCENE, data, free, 4).starts
    np.testing.assert_array_equal(fitting.multi_start(cases.SCENE, data, free, drawn[1:]).starts, drawn[1:])
    for wrong in (drawn[:, 1:], drawn[0], drawn[:0]):
        with pytest.raises(ValueError, match=rf"^starts has shape .*: must be \(members, {drawn.shape[1]}\)"):
            fitting.multi_start(cases.SCENE, data, free, wrong)


def test_single_precision_stays_single():
    scene = jax.tree.map(lambda a: np.asarray(a, np.float32), cases.SCENE)
    members = fitting.multi_start(scene, cases.modulus_data(), {cases.E: fitting.Positive()}, 3)
    ends = fitting.run_ensemble(members)
    assert members.starts.dtype == ends.x.dtype == ends.cost.dtype == np.float32
    assert np.isin(ends.status, (CONVERGED, PERFECT)).all()


def test_bad_arguments(members, result):
    run = fitting.run_ensemble
    refused(lambda: run(result), "members is a FitResult")
    for name, value in {"every": -1.0, "max_memory": 0, "batch": 0, "callback": 3}.items():
        refused(lambda name=name, value=value: run(members, **{name: value}), f"{name} = {value}")
    refused(lambda: fitting.bootstrap_members(result, 0), "count = 0")
    refused(lambda: fitting.profile_members(result, "gamma"), "name = 'gamma'")
    refused(lambda: fitting.profile_members(result, points=0), "points = 0")
    refused(lambda: fitting.profile_members(result, level=1), "level = 1")
    refused(lambda: cases.modulus(0), "starts = 0")
    refused(lambda: cases.modulus(np.zeros((2, 3))), "starts has shape (2, 3): must be (members, 4)")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert "17 of kind 'starts'" in repr(members)
