"""Commands that a signal interrupts: with the best values so far, or before they have a result."""

import os
import re
import signal
import subprocess
import sys

import pytest
from support.processes.signals import stay
from support.scenes.fits import JOB, JOB_FILES

import fitting
import fitting.solvers.runs as runs_module
from fitting.commands import work
from fitting.solvers.evaluation import costs_at

LOST = ": interrupted; incomplete files are not written\n"
DESIGN = "[design]\nvelocity = [0.01, 0.1]\npressure = 2e5\nn = 1\n"


@pytest.fixture(params=[signal.SIGINT, signal.SIGTERM])
def which(request):
    """A signal with a handler that would end the test run."""
    before = signal.signal(request.param, signal.default_int_handler)  # a background job may ignore it
    yield request.param
    signal.signal(request.param, before)


@pytest.mark.parametrize("at", ["start", "advance"])
@pytest.mark.parametrize(
    ("command", "options"),
    [
        ((), ("--out", "fit.h5", "--plot", "fit.png")),
        (("design",), ("--out", "next.csv")),
        (("calibration",), ("--members", 4, "--plot", "ranks.png")),
    ],
    ids=["fit", "design", "calibration"],
)
def test_before_a_step_is_complete_there_is_nothing_to_report(
    call, planned, monkeypatch, which, at, command, options
):
    """The signal arrives in the evaluation of the start, or in the first step."""
    planned.write_text(planned.read_text() + DESIGN)
    original = getattr(runs_module, at)

    def interrupted(*arguments, **options):
        signal.raise_signal(which)
        return original(*arguments, **options)

    monkeypatch.setattr(runs_module, at, interrupted)
    name = " ".join(("rubberfric-fit", *command))
    assert call(*command, planned, *options) == (128 + which, "", name + LOST)
    assert sorted(os.listdir()) == JOB_FILES


def start_cost(result):
    """Cost of a fit's start values."""
    return costs_at(result.problem, result.problem.start[None])[0]


# On a busy machine the fit would be done before this process has read of it.
STEPPING = """
import sys, time
from fitting.commands import main, work
fit = work.fit
def slow(*arguments, callback, **options):
    def waiting(step, cost):
        time.sleep(0.02)
        callback(step, cost)
    return fit(*arguments, callback=waiting, **options)
work.fit = slow
sys.exit(main.main())
"""


def test_interrupt_in_the_middle_of_a_fit(job):
    """In a new process with a terminal, Ctrl-C ends the fit with the best values in the file."""
    pty = pytest.importorskip("pty")
    job.write_text(
        JOB.replace('method = "lm"', 'method = "adam"\ntolerance = 1e-300').replace("starts = 2", "")
    )
    master, slave = pty.openpty()
    seen = b""
    with subprocess.Popen(
        [sys.executable, "-c", STEPPING, "job.toml", "--out", "fit.h5"],
        stdout=subprocess.PIPE,
        stderr=slave,
        text=True,
        # `STEPPING` loads JAX before `main` can silence XLA, which logs two lines for an entry of the cache.
        env=os.environ | {"TF_CPP_MIN_LOG_LEVEL": "3"},
    ) as process:
        os.close(slave)
        sent = False
        while chunk := _read(master):
            seen += chunk
            if b"step 20," in seen and not sent:
                process.send_signal(signal.SIGINT)
                sent = True
        printed = process.stdout.read()
    os.close(master)
    assert process.returncode == 130
    assert sorted(os.listdir()) == sorted([*JOB_FILES, "fit.h5"])
    result = fitting.FitResult.load("fit.h5")
    assert result.message == "interrupted: these are the best values so far"
    assert result.cost < 0.9 * start_cost(result)
    assert result.problem.targets.measured.size == 20
    assert printed == f"Small fit\n{result.report()}"
    assert printed.startswith("Small fit\nTHE FIT DID NOT SUCCEED: interrupted: these are the best values")

    # the progress is rewritten in place and gone at the end
    before, *shown, last = seen.decode().split("\r\033[K")  # begins and clears a line
    assert before == ""
    answer = "rubberfric-fit: interrupted; stopping after this step (a second signal stops at once)\r\n"
    assert shown.count(answer) == 1
    # without the result, clocks and repeated lines
    lines = list(dict.fromkeys(re.sub(r", \d+ s$", "", line) for line in shown if line not in ("", answer)))
    phases = ["loading JAX", "reading job.toml", "compiling a fit of 4 numbers to 20 values"]
    assert lines[:3] == phases
    ends = ["compiling and computing the covariance", "writing fit.h5", "computing the report"]
    assert lines[-3:] == ends
    assert all(re.fullmatch(r"step \d+, cost \S+", line) for line in lines[3:-3])
    steps = [int(line.split()[1][:-1]) for line in lines[3:-3]]
    assert steps == list(range(1, len(steps) + 1))
    assert len(steps) < 3000
    assert last == "rubberfric-fit: interrupted: these are the best values so far\r\n"


def _read(descriptor):
    try:
        return os.read(descriptor, 4096)
    except OSError:  # how Linux says that the other end is closed
        return b""


def test_a_request_to_terminate_is_an_interrupt(call, job, monkeypatch):
    def interrupted(*arguments, callback, **options):
        def wrapped(step, cost):
            if step == 2:
                os.kill(os.getpid(), signal.SIGTERM)
            callback(step, cost)

        return fitting.fit(*arguments, callback=wrapped, **options)

    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(work, "fit", interrupted)
    status, printed, complaint = call(job, "--out", "fit.h5")
    assert (status, complaint) == (143, "rubberfric-fit: interrupted: these are the best values so far\n")
    assert "THE FIT DID NOT SUCCEED" in printed
    result = fitting.FitResult.load("fit.h5")
    assert 0 < result.cost < start_cost(result)
    assert signal.getsignal(signal.SIGTERM) is before


def test_an_interrupt_after_one_start_had_converged(call, job, monkeypatch):
    """The values are good, although the command was interrupted."""

    def interrupted(*arguments, callback, **options):
        result = fitting.fit(*arguments, **options)
        callback(98, 1.0)
        os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            callback(99, 1.0)
        return result

    monkeypatch.setattr(work, "fit", interrupted)
    status, printed, complaint = call(job)
    assert status == 130
    assert complaint == "rubberfric-fit: interrupted: one start has converged, others have not\n"
    assert printed.startswith("Small fit\n[[Verdict]]")


def test_an_interrupt_while_saving_waits_until_the_file_is_whole(call, job, monkeypatch):
    def slow(*arguments, **options):
        os.kill(os.getpid(), signal.SIGINT)
        return command_save(*arguments, **options)

    command_save = work.save
    monkeypatch.setattr(work, "save", slow)
    status, _, complaint = call(job, "--out", "fit.h5")
    assert (status, complaint) == (130, "rubberfric-fit: interrupted: all results are complete\n")
    assert fitting.FitResult.load("fit.h5").success


def test_a_second_interrupt_does_not_wait_and_leaves_no_half_file(call, job, monkeypatch):
    def impatient(*_):
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
        stay()

    monkeypatch.setattr("fitting.results.hdf5._write_minima", impatient)
    assert call(job, "--out", "fit.h5") == (130, "", f"rubberfric-fit{LOST}")
    assert sorted(os.listdir()) == JOB_FILES


def test_an_interrupt_before_the_fit(call, job, monkeypatch):
    def read(*_):
        os.kill(os.getpid(), signal.SIGINT)
        stay()
        raise AssertionError("must not get here")

    monkeypatch.setattr(work, "read_job", read)
    assert call(job, "--out", "fit.h5") == (130, "", f"rubberfric-fit{LOST}")
    assert sorted(os.listdir()) == JOB_FILES
