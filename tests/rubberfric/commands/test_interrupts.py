"""Commands as processes that a signal ends: exit status, one line, no incomplete file."""

import os
import signal
import subprocess
import sys
import threading
import weakref

import pytest
from support.folders import ROOT
from support.processes.signals import PROGRAM, stay
from support.scenes.fits import JOB_FILES

from rubberfric.commands import ended

SCENE = ROOT / "data" / "tread_on_asphalt.toml"
LOST = "interrupted; incomplete files are not written\n"
LATER = "interrupted; stopping after this step (a second signal stops at once)\n"

# The main thread is in C for minutes, where no handler of Python's is called.
BUSY = "hashlib.pbkdf2_hmac('sha256', b'', b'', 2**30)"

COMPILING = """
import sys
from rubberfric.analysis import batches
from rubberfric.commands import main as command
def told(*arguments, fitted=batches.fitted):
    print("now", flush=True)
    return fitted(*arguments)
batches.fitted = told
sys.exit(command.main())
"""
FILLING = f"""
import hashlib, sys
from rubberfric.analysis import batches, collapse
collapse.collapse = lambda *_: None
from rubberfric.commands import main as command
count = 0
def launch(tiling, task, batch):
    global count
    count += 1
    if count == 4:
        print("now", flush=True)
        {BUSY}
    v, p, T = batches.points(task.conditions, batch)
    return {{"area": p[:, None] * v * T, "friction": p[:, None] * v / T}}
batches.fitted, batches.launch, batches.BATCH["cpu"] = lambda tiling, task: tiling, launch, 1024
sys.exit(command.main())
"""
COMPUTING = FILLING.replace("count == 4", "count == 1")
FITTING = f"""
import hashlib, sys
from fitting.commands import main as command
from fitting.commands import work as work_module
def work(*arguments, **options):
    print("now", flush=True)
    {BUSY}
work_module.NAME = work
sys.exit(command.main())
"""


def interrupted(program, *arguments, sending=(signal.SIGINT,), after=0.0, path=""):
    """Status, stdout after "now" and stderr of a command that gets signals some seconds after it."""
    environment = {name: value for name, value in os.environ.items() if name != "XLA_FLAGS"}
    environment |= {"PYTHONPATH": f"{path}{os.pathsep}{ROOT}", "JAX_ENABLE_COMPILATION_CACHE": "false"}
    with subprocess.Popen(
        [sys.executable, "-c", program, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    ) as process:
        try:
            assert process.stdout.readline() == "now\n"
            for which in sending:
                with pytest.raises(subprocess.TimeoutExpired):
                    process.wait(after)  # a signal beside one that is not yet taken is lost
                process.send_signal(which)
            return process.wait(60), *process.communicate()
        finally:
            process.kill()


@pytest.mark.parametrize(
    ("which", "package"),
    [
        (signal.SIGINT, "rubberfric"),
        (signal.SIGTERM, "fitting"),
        pytest.param(signal.SIGTERM, "rubberfric", marks=pytest.mark.slow),
        pytest.param(signal.SIGINT, "fitting", marks=pytest.mark.slow),
    ],
)
def test_a_signal_while_jax_is_imported(tmp_path, which, package):
    """A module with the name of JAX sleeps for a minute when it is imported."""
    (tmp_path / "jax.py").write_text("import time\nprint('now', flush=True)\ntime.sleep(60)\n")
    job = ROOT / "data" / "tread_on_asphalt_fit.toml"
    arguments = ("run", SCENE) if package == "rubberfric" else (job,)
    name = "rubberfric" if package == "rubberfric" else "rubberfric-fit"
    found = interrupted(PROGRAM.format(package, ""), *arguments, sending=(which,), path=tmp_path)
    assert found == (128 + which, "", f"{name}: {LOST}")


SLOW = (signal.SIGINT, 0.7), (signal.SIGTERM, 0.5), (signal.SIGHUP, 0.5)


@pytest.mark.parametrize(
    ("which", "after"), [(signal.SIGINT, 0.2), *(pytest.param(*x, marks=pytest.mark.slow) for x in SLOW)]
)
def test_a_signal_while_a_map_compiles(tmp_path, which, after):
    """JAX's compiler, left by an exception, goes on in threads, with which the interpreter crashed."""
    found = interrupted(COMPILING, "map", SCENE, "--out", tmp_path / "m.h5", sending=(which,), after=after)
    assert found == (128 + which, "", f"rubberfric: {LOST}")
    assert os.listdir(tmp_path) == []


@pytest.fixture
def answer(capfd):
    """Run work as a command called from Python; its exit status and stderr after a signal."""

    def run(work, which=signal.SIGINT):
        before = signal.signal(which, signal.default_int_handler)  # a background job may ignore it
        try:
            status = ended("rubberfric", work, process=False)
            assert signal.getsignal(which) is signal.default_int_handler
        finally:
            signal.signal(which, before)
        return status, capfd.readouterr().err

    return run


@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM])
def test_a_command_called_from_python_is_interrupted(answer, which):
    def work(_):
        signal.raise_signal(which)
        stay()
        return 0

    assert answer(work, which) == (128 + which, f"rubberfric: {LOST}")


TRACED = """
import signal, sys, time
from rubberfric.commands.interrupts import Interrupts
try:
    with Interrupts("rubberfric", process=False):
        signal.raise_signal(signal.SIGINT)
        for _ in range(1200):
            time.sleep(0.05)
except KeyboardInterrupt:
    print("now", flush=True)
sys.settrace(lambda *_: None)
def traced():
    print("traced")
traced()
"""


def test_a_debugger_goes_on_after_an_interrupted_command():
    """In Python 3.11, an exception that was dropped made every traced call wait forever."""
    program = [sys.executable, "-c", TRACED]
    done = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (0, "now\ntraced\n")


def test_a_command_called_from_python_does_not_lose_a_signal_in_a_weak_reference(answer, monkeypatch):
    """Python prints and ignores an exception in the callback of a weak reference."""

    def work(_):
        value = threading.Lock()
        reference = weakref.ref(value, lambda _: signal.raise_signal(signal.SIGINT))
        del value
        stay()
        return reference

    monkeypatch.setattr(sys, "unraisablehook", lambda _: None)
    assert answer(work) == (130, f"rubberfric: {LOST}")


@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_waits_until_the_end_is_reported(answer, which):
    """The caller sees an interrupt; nothing is lost."""

    def work(interrupts):
        interrupts.hold()
        signal.raise_signal(which)
        return 0

    assert answer(work, which) == (128 + which, "rubberfric: interrupted; all files are complete\n")


def test_a_signal_before_hold_is_not_held_back(answer):
    """A command called from Python would otherwise write files, and be stopped between two of them."""

    def work(interrupts):
        signal.raise_signal(signal.SIGINT)
        interrupts.hold()
        raise AssertionError("must not get here")

    assert answer(work) == (130, f"rubberfric: {LOST}")


def test_a_signal_while_modules_are_loaded_waits_for_them(answer):
    """An exception within the import of a compiled module can crash Python."""
    steps = []

    def work(interrupts):
        with interrupts.loading():
            signal.raise_signal(signal.SIGINT)
            steps.append("loaded")
        steps.append("worked")
        return 0

    assert answer(work) == (130, f"rubberfric: {LATER}rubberfric: {LOST}")
    assert steps == ["loaded"]


EMBEDDED = """
import os, signal, sys, threading
from rubberfric.analysis import batches
from rubberfric.commands.main import main
def told(*arguments, fitted=batches.fitted):
    threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
    return fitted(*arguments)
batches.fitted = told
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
def test_a_map_called_from_python_is_interrupted_while_it_compiles():
    """XLA runs handlers while its threads compile: if one raised, the threads would crash the interpreter."""
    environment = {name: value for name, value in os.environ.items() if name != "XLA_FLAGS"}
    command = [sys.executable, "-c", EMBEDDED, "map", str(SCENE)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert (done.returncode, done.stdout) == (130, "")
    assert (
        done.stderr.removeprefix(f"rubberfric: {LATER}") == f"rubberfric: {LOST}"
    )  # if the compilation takes long


@pytest.mark.parametrize("which", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGTERM])
def test_a_signal_while_a_program_runs(tmp_path, which):
    found = interrupted(COMPUTING, "map", SCENE, "--out", tmp_path / "m.h5", sending=(which,))
    assert found == (128 + which, "", f"rubberfric: {LOST}")
    assert os.listdir(tmp_path) == []


def test_a_signal_while_a_map_is_written_leaves_the_old_file(tmp_path):
    path = tmp_path / "m.h5"
    path.write_bytes(b"old")
    found = interrupted(FILLING, "map", SCENE, "--out", path)
    assert found == (130, "", f"rubberfric: {LOST}")
    assert os.listdir(tmp_path) == ["m.h5"] and path.read_bytes() == b"old"


@pytest.mark.usefixtures("job")
def test_a_signal_before_the_first_step_of_a_fit():
    """There is nothing yet to report."""
    found = interrupted(FITTING.replace("NAME", "fit"), "job.toml", "--out", "fit.h5")
    assert found == (130, "", f"rubberfric-fit: {LOST}")
    assert sorted(os.listdir()) == JOB_FILES


@pytest.mark.slow
@pytest.mark.usefixtures("job")
def test_a_second_signal_does_not_wait_for_a_fit():
    program, signals = FITTING.replace("NAME", "save"), (signal.SIGINT, signal.SIGTERM)
    found = interrupted(program, "job.toml", "--out", "fit.h5", sending=signals, after=0.5)
    assert found == (143, "", f"rubberfric-fit: {LATER}rubberfric-fit: {LOST}")
    assert sorted(os.listdir()) == JOB_FILES
