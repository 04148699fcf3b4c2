"""Ensembles: the same numbers on any devices and processes, through kills and full disks."""

import dataclasses
import functools
import json
import os
import socket
import subprocess
import sys
import warnings

import h5py
import jax
import numpy as np
import pytest
from support.counting.compilations import compilations
from support.ensembles import ensemble_cases as cases
from support.ensembles.checks import assert_same, finished, refused, start
from support.folders import PYTHONPATH, ROOT

import fitting
from fitting.ensemble.run import largest_batch
from fitting.solvers.objective import CONVERGED, NOT_FINITE, OUT_OF_STEPS, PERFECT
from fitting.solvers.runs import run_fits


@pytest.fixture(scope="module")
def result():
    return fitting.fit(cases.SCENE, cases.modulus_data(), {cases.E: fitting.Positive()})


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
    program = ROOT / "notebooks" / "benchmarks" / "ensemble_process.py"
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
