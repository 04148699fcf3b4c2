"""The command rubberfric-fit in this process."""

import functools

import pytest

from fitting.commands.main import main


@pytest.fixture
def call(call_main):
    """Run the command: exit status, stdout, stderr."""
    return functools.partial(call_main, main)


@pytest.fixture
def run(call, tmp_path, monkeypatch):
    """Run the command without its cache in an empty folder: exit status, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: call(*arguments, "--no-cache")


PLANNED = """[free]
"upper.material.E[0]" = "positive"
[prior]
"upper.material.E[0]" = { mean = 1e8, sigma = 1e7 }
"""


@pytest.fixture
def planned(job):
    """The small job with one free parameter that has a Gaussian prior."""
    job.write_text(job.read_text().split("[free]")[0] + PLANNED)
    return job
