"""Checkpoints of ensembles: runs go on after interrupts, kills and full disks; refused checkpoints."""

import dataclasses
import os
import random
import resource
import time

import h5py
import jax
import numpy as np
import pytest
from support.ensembles import ensemble_cases as cases
from support.ensembles.checks import assert_same, finished, refused, start

import fitting
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.objective import INTERRUPTED


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
