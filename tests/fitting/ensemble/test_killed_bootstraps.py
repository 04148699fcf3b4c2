"""A bootstrap that is ended at any moment, and goes on from its checkpoint to the same result."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest
from support.folders import ROOT
from support.scenes.fits import JOB_FILES, write_job

MOMENTS = 20
MEMBERS = 300

# The command, with a checkpoint after every batch instead of one a minute.
PROGRAM = """
import functools, sys
from fitting.commands import main, work
work.run_ensemble = functools.partial(work.run_ensemble, every=0, batch=4)
sys.exit(main.main())
"""


def begun(folder):
    command = [sys.executable, "-c", PROGRAM, "job.toml", "--bootstrap", str(MEMBERS)]
    return subprocess.Popen(
        [*command, "--checkpoint", "run.h5", "--resume"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )


def report(folder):
    """Return the lines about the ensemble that a complete run prints, without its time and memory."""
    with begun(folder) as process:
        printed, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    text = re.sub(r" in [\d.]+ s ", " ", printed.split("[[Ensemble]]")[1])
    return re.sub(r".* a step took .*\n", "", text)  # not printed if the checkpoint is of a complete run


def new_folder(path):
    path.mkdir()
    write_job(path)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("which", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_it_goes_on_after_any_moment(which, tmp_path):
    expected = report(new_folder(tmp_path / "whole"))
    begin = time.monotonic()
    assert report(new_folder(tmp_path / "again")) == expected
    duration, half_way = time.monotonic() - begin, 0
    for k in range(MOMENTS):
        folder = new_folder(tmp_path / str(k))
        with begun(folder) as process:
            time.sleep(duration * (k + 1) / (MOMENTS + 1))
            process.send_signal(which)
            process.communicate(timeout=60)
        left = {*os.listdir(folder)} - {*JOB_FILES}
        half_way += "run.h5" in left
        # Only SIGKILL leaves no time to remove a file that is being written.
        assert which == signal.SIGKILL or left <= {"run.h5"}
        assert report(folder) == expected
    assert half_way > MOMENTS // 4  # otherwise only beginnings were tested
