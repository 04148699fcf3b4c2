"""The bootstrap of the command rubberfric-fit: its report, its checkpoint, and going on with it."""

import functools

import numpy as np
import pytest

import fitting
from fitting.commands import main as command
from fitting.commands import work
from fitting.commands.job import read_job


@pytest.fixture
def call(call_main):
    return functools.partial(call_main, command.main)


def test_bootstrap_is_interrupted_and_goes_on(call, job, monkeypatch):
    arguments = (job, "--bootstrap", 9, "--checkpoint", "run.h5")
    run, calls = work.run_ensemble, []

    def interrupted(*members, callback, **options):
        def stopping(*at):
            calls.append(at)
            if len(calls) == 3:
                raise KeyboardInterrupt
            callback(*at)

        return run(*members, batch=2, callback=stopping, **options)

    monkeypatch.setattr(work, "run_ensemble", interrupted)
    _, printed, _ = call(*arguments)
    assert "interrupted: these are the best values so far" in printed
    monkeypatch.setattr(work, "run_ensemble", run)
    status, _, complaint = call(*arguments)
    assert status == 2 and "run.h5: the file exists" in complaint
    status, printed, complaint = call(*arguments, "--resume")
    assert (status, complaint) == (0, "")
    read = read_job(job)
    result = fitting.fit(read.scene, read.data, read.free, prior=read.prior, **read.options)
    ends = fitting.run_ensemble(fitting.bootstrap_members(result, 9))
    assert "[[Correlations]]" in printed.split("[[Ensemble]]")[0] and "9 converged" in printed
    low, high = ends.interval()
    for i, name in enumerate(result.names):
        row = next(line for line in printed.split("[[Values")[1].splitlines() if name in line)
        found = [float(row.split()[k]) for k in (1, 2, 4)]
        expected = [np.median(ends.values[:, i]), low[i], high[i]]
        np.testing.assert_allclose(found, expected, rtol=1e-5)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--bootstrap", "0"], "'0': must be an integer >= 1"),
        (["--bootstrap", "many"], "'many': must be an integer >= 1"),
        (["--checkpoint", "run.h5"], "must come with --bootstrap N"),
        (["--resume", "--bootstrap", "3"], "must come with --checkpoint FILE.h5"),
        (["--bootstrap", "3", "--checkpoint", "run.txt"], "suffix '.txt': must be .h5"),
        (["--bootstrap", "3", "--checkpoint", "none/run.h5"], "does not exist; create it first"),
    ],
)
def test_bad_arguments(call, job, arguments, words):
    status, printed, complaint = call(job, *arguments)
    assert status == 2 and not printed
    assert words in complaint and complaint.count("\n") == 1
