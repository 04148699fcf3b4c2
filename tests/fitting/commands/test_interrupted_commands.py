"""Commands called from Python that a signal interrupts before they have a result."""

import os
import signal

import pytest
from support.scenes.fits import JOB_FILES

import fitting.solvers.runs as runs_module

LOST = ": interrupted; incomplete files are not written\n"
DESIGN = "[design]\nvelocity = [0.01, 0.1]\npressure = 2e5\nn = 1\n"
PLANNED = '"upper.material.E[0]" = { mean = 1e8, sigma = 1e7 }\n'


@pytest.fixture(params=[signal.SIGINT, signal.SIGTERM])
def which(request):
    """A signal with a handler that would end the test run."""
    before = signal.signal(request.param, signal.default_int_handler)  # a background job may ignore it
    yield request.param
    signal.signal(request.param, before)


def signal_in(monkeypatch, owner, name, which):
    """Send the signal when a function of a module is called."""
    original = getattr(owner, name)

    def interrupted(*arguments, **options):
        signal.raise_signal(which)
        return original(*arguments, **options)

    monkeypatch.setattr(owner, name, interrupted)


@pytest.mark.parametrize("at", ["start", "advance"])
def test_a_fit(call, job, monkeypatch, which, at):
    """Neither the evaluation of the start nor the first step is complete: there is nothing to report."""
    signal_in(monkeypatch, runs_module, at, which)
    found = call(job, "--out", "fit.h5", "--plot", "fit.png")
    assert found == (128 + which, "", f"rubberfric-fit{LOST}")
    assert sorted(os.listdir()) == JOB_FILES


@pytest.mark.parametrize("at", ["start", "advance"])
def test_a_design(call, job, monkeypatch, which, at):
    job.write_text(job.read_text() + DESIGN)
    signal_in(monkeypatch, runs_module, at, which)
    found = call("design", job, "--out", "next.csv")
    assert found == (128 + which, "", f"rubberfric-fit design{LOST}")
    assert sorted(os.listdir()) == JOB_FILES


def test_a_calibration(call, job, monkeypatch, which):
    before, _ = job.read_text().split("[free]")
    job.write_text(f'{before}[free]\n"upper.material.E[0]" = "positive"\n[prior]\n{PLANNED}')
    signal_in(monkeypatch, runs_module, "advance", which)
    found = call("calibration", job, "--members", 4, "--plot", "ranks.png")
    assert found == (128 + which, "", f"rubberfric-fit calibration{LOST}")
    assert sorted(os.listdir()) == JOB_FILES
