"""Run commands in separate processes: streams, limits, locales, platforms and missing packages."""

import os
import shutil
import subprocess
import sys

import pytest
from support.folders import ROOT
from support.processes.signals import PROGRAM
from support.scenes.fits import JOB_SCENE

COMMAND = PROGRAM.format("rubberfric", "")
CLOSED = "rubberfric: standard output is closed: must be open, for example as /dev/null\n"


def shell(redirection, *arguments, program=COMMAND, **environment):
    """Status, stdout and stderr of a command that a shell begins."""
    line = (
        f'{redirection.partition("|")[0]} ; exec "$@"'
        if redirection.startswith("ulimit")
        else f'"$@" {redirection}'
    )
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    done = subprocess.run(
        [shutil.which("sh"), "-c", line, "sh", sys.executable, "-c", program, *arguments],
        env=kept | {"PYTHONPATH": str(ROOT)} | environment,
        capture_output=True,
        text=True,
        encoding="latin-1",
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize(
    ("redirection", "arguments", "expected"),
    [
        (">&-", ("--help",), (1, "", CLOSED)),
        (">&-", ("run", "no.toml"), (1, "", CLOSED)),
        (">&- 2>&-", ("run", "no.toml"), (1, "", "")),
        ("<&- 2>&-", ("run", "no.toml"), (2, "", "")),
        ("2>/dev/full", ("run", "no.toml"), (2, "", "")),
        (">/dev/full", ("--help",), (1, "", "rubberfric: [Errno 28] No space left on device\n")),
    ],
)
def test_streams_that_take_nothing(redirection, arguments, expected):
    assert shell(redirection, *arguments) == expected


def test_too_little_address_space():
    status, printed, complaint = shell(
        "ulimit -v 1000000", "run", str(ROOT / "data" / "tread_on_asphalt.toml")
    )
    assert (status, printed) == (1, "")
    text = "there is not enough memory: ulimit -v allows 977 MiB of addresses: must be 2048 or more"
    assert complaint == f"rubberfric: {text}\n"


PRINTING = """
import sys
from rubberfric.commands import main as command
from rubberfric.commands import ending
command._work = lambda _: lambda *_: ("30 \\xb0C in L\\xe4ufer \\udc80" * 5, None)
ending.begin_jax = lambda **_: None
sys.argv[1:] = ["doctor"]
sys.exit(command.main())
"""


@pytest.mark.parametrize(
    "environment",
    [
        {"PYTHONIOENCODING": "ascii"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"PYTHONIOENCODING": "latin-1"},
        {"PYTHONIOENCODING": "utf-8:strict"},
    ],
)
def test_letters_that_the_terminal_has_not(environment):
    """They must not lose computed results."""
    status, printed, complaint = shell("", program=PRINTING, **environment)
    assert (status, complaint) == (0, "") and printed.startswith("30 ") and printed.count(" in L") == 5


@pytest.mark.parametrize("name", ["cuda", "nonsense"])
def test_a_platform_that_jax_cannot_start(name):
    status, printed, complaint = shell("doctor", JAX_PLATFORMS=name)
    assert (status, printed) == (2, "")
    text = f"JAX_PLATFORMS = {name!r}: JAX cannot start this platform; use cpu, or unset it"
    assert complaint == f"rubberfric: {text}\n"


@pytest.mark.parametrize("redirection", [">/dev/full", "| head -c 0"])
def test_a_table_that_nobody_takes(redirection):
    status, printed, complaint = shell(redirection, program=PRINTING)
    full = (1, "", "rubberfric: [Errno 28] No space left on device\n")
    assert (status, printed, complaint) == (full if "full" in redirection else (0, "", ""))


def test_a_package_that_is_not_installed(tmp_path):
    """Only on the path, as in a copy of the project."""
    shutil.copytree(
        ROOT / "rubberfric", tmp_path / "rubberfric", ignore=shutil.ignore_patterns("__pycache__")
    )
    program = (
        "import sys; sys.path.insert(0, sys.argv.pop(1)); from rubberfric.commands.main import main; main()"
    )
    command = [sys.executable, "-S", "-c", program, str(tmp_path), "--version"]
    done = subprocess.run(command, capture_output=True, text=True, env={}, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.startswith("rubberfric ")


FULL = """
import resource, sys
import numpy as np
import rubberfric as rf
from rubberfric.commands import run
from rubberfric.commands.main import main
ones = np.ones((1, 1, 1))
run.compute = lambda *_: rf.Solution(ones, ones, ones)
resource.setrlimit(resource.RLIMIT_FSIZE, (2048, 2048))
sys.exit(main(["run", *sys.argv[1:]]))
"""


def test_a_disk_that_is_full(tmp_path):
    """The table is printed. The library's own complaint was of 25 lines, and a segmentation fault."""
    (tmp_path / "scene.toml").write_text(JOB_SCENE + "[run]\nvelocity = 1.0\npressure = 1e5\n")
    out = tmp_path / "r.h5"
    arguments = ("--no-cache", str(tmp_path / "scene.toml"), "--out", str(out))
    status, printed, complaint = shell("", *arguments, program=FULL)
    assert (status, complaint) == (1, f"rubberfric: [Errno 27] File too large: {str(out)!r}\n")
    assert "1.0000e+00" in printed and os.listdir(tmp_path) == ["scene.toml"]


@pytest.mark.parametrize(("package", "command"), [("rubberfric",) * 2, ("fitting", "rubberfric-fit")])
def test_commands_run_without_their_scripts(package, command):
    done = subprocess.run([sys.executable, "-m", package, "no.toml"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.startswith(command)


def test_command_needs_no_matplotlib_and_the_library_leaves_the_precision_alone(scene_file, numbers):
    """In a new process, because conftest switches double precision on."""
    program = f"""
import sys
sys.modules["matplotlib"] = None
import jax, rubberfric
from rubberfric.commands.main import main
assert not jax.config.jax_enable_x64
scene = rubberfric.load_scene({str(scene_file)!r})
assert not jax.config.jax_enable_x64 and scene.upper.material.E.dtype == "float32"
status = main(["run", {str(scene_file)!r}])
assert jax.config.jax_enable_x64
sys.exit(status)
"""
    done = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert numbers(done.stdout).shape == (30, 4)


def test_reader_that_goes_away(scene_file):
    """`rubberfric run ... | head` ends without a traceback."""
    command = [sys.executable, "-c", COMMAND, "run", str(scene_file)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stdout.close()
        complaint = process.stderr.read()
    assert (process.returncode, complaint) == (1, "")


def test_a_warning_of_a_command_is_one_line():
    """Without the line of the source, and without the name of its category."""
    code = (
        "import warnings\nfrom rubberfric.commands import ended\n"
        "def work(_):\n    warnings.warn('first\\nsecond', UserWarning)\n    return 0\n"
        "ended('rubberfric run', work, process=False)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "rubberfric run: warning: first second\n"
