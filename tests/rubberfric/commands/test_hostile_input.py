"""Files that are none, arguments that contradict each other, streams that are closed: one line each, at once.

Nothing is computed here: errors are found before, and mostly before JAX is imported.
"""

import os
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.folders import ROOT
from support.scenes.fits import JOB, JOB_SCENE

from fitting.commands.main import main as fit_main
from rubberfric.commands.main import main

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the files are those of POSIX")


def sparse(path):
    with open(path, "wb") as file:
        file.truncate(2 * 2**30)


def socket_at(path):
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(str(path))


# Objects in place of a file.
KINDS = {
    "a pipe": os.mkfifo,
    "a device without an end": lambda path: path.symlink_to("/dev/urandom"),
    "zeros without an end": lambda path: path.symlink_to("/dev/zero"),
    "a folder": Path.mkdir,
    "a socket": socket_at,
    "two gigabytes": sparse,
    "nothing": lambda _: None,
    "a link to nothing": lambda path: path.symlink_to("nothing"),
    "a link to itself": lambda path: path.symlink_to(path.name),
}
TABLE_SCENE = """
[lower]
material = { kind = "rigid" }
spectrum = { kind = "tabulated", file = "hostile.csv", normalisation = "C" }
[upper]
material = { kind = "elastic", young = 1e7, poisson = 0.5 }
[run]
velocity = 1.0
pressure = 1e5
"""
CARDS_SCENE = TABLE_SCENE.replace(
    'kind = "tabulated", file = "hostile.csv", normalisation = "C"',
    'kind = "self_affine", q0 = 100, qr = 1000, q1 = 1e4, hurst = 0.8, h_rms = 1e-4',
).replace('kind = "elastic", young = 1e7, poisson = 0.5', 'kind = "prony", file = "hostile.inp"')
# Where it stands: the command, its arguments, the file that names it, the name.
PLACES = {
    "the scene of run": (main, ("run", "hostile.toml"), None, "hostile.toml"),
    "the result that run repeats": (main, ("run", "hostile.h5"), None, "hostile.h5"),
    "the scene of map": (main, ("map", "hostile.toml"), None, "hostile.toml"),
    "the scene of accuracy": (main, ("accuracy", "hostile.h5"), None, "hostile.h5"),
    "the job of a fit": (fit_main, ("hostile.toml",), None, "hostile.toml"),
    "the table of a scene": (main, ("run", "scene.toml"), TABLE_SCENE, "hostile.csv"),
    "the cards of a scene": (main, ("run", "scene.toml"), CARDS_SCENE, "hostile.inp"),
    "the scene of a job": (fit_main, ("job.toml",), JOB.replace("scene.toml", "hostile.h5"), "hostile.h5"),
    "the data of a job": (fit_main, ("job.toml",), JOB.replace("modulus.csv", "hostile.csv"), "hostile.csv"),
}


@pytest.fixture
def complaint_about(call_main, tmp_path, monkeypatch):
    """The name of a file at a place, and the message of the command, after a function has put it there."""
    monkeypatch.chdir(tmp_path)

    def run(place, put):
        command, arguments, text, name = PLACES[place]
        Path("scene.toml").write_text(JOB_SCENE)
        if text is not None:
            Path(arguments[-1]).write_text(text)
        put(Path(name))
        before, begin = sorted(os.listdir()), time.monotonic()
        status, printed, complaint = call_main(command, *arguments)
        # Nothing is waited for, nor read to its end. The limit allows for a busy machine.
        assert time.monotonic() - begin < 30
        assert (status, printed, complaint.count("\n")) == (2, "", 1)
        assert sorted(os.listdir()) == before
        return name, complaint

    return run


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("place", PLACES)
def test_what_is_no_file(complaint_about, kind, place):
    name, complaint = complaint_about(place, KINDS[kind])
    assert (name in complaint and "cannot be read" in complaint) or "must be" in complaint


# Contents of a file that is one.
CONTENTS = {
    "nothing": b"",
    "zeros": bytes(10_000),
    "noise": bytes(range(256)) * 40,
    "half of UTF-16": b"\xff\xfe[\x00l",
    "nested beyond reason": b"a = " + b"[" * 100_000,
    "a line without an end": b"a" * 10_000_000,
    "a number beyond all": b"[run]\nvelocity = 1e999\npressure = 1" + b"0" * 400,
    "an HDF5 file cut short": b"\x89HDF\r\n\x1a\n" + bytes(100),
}


@pytest.mark.parametrize("content", CONTENTS)
@pytest.mark.parametrize("place", ["the scene of run", "the result that run repeats", "the data of a job"])
def test_what_is_no_scene(complaint_about, content, place):
    name, complaint = complaint_about(place, lambda path: path.write_bytes(CONTENTS[content]))
    assert name in complaint and len(complaint) < 1000


@pytest.mark.parametrize(
    ("command", "arguments", "words"),
    [
        (main, ("map", "scene.toml", "--devices", "100000000"), "must be 256 or less"),
        (main, ("map", "scene.toml", "--devices", "-1"), "must be > 0"),
        (main, ("map", "scene.toml", "--devices", "1e3"), "invalid int value: '1e3'"),
        (main, ("map", "scene.toml", "--quantity", "mu"), "invalid choice: 'mu'"),
        (main, ("run", "large.toml"), "run has 10000000000 points: must have at most 1000000"),
        (main, ("accuracy", "large.toml"), "run has 10000000000 points: must have at most 1000000"),
        (main, ("run", "scene.toml", "--out", "pipe.h5"), "is a pipe or a device; must be a file"),
        (main, ("run", "scene.toml", "--out", "full.h5"), "is a pipe or a device; must be a file"),
        (main, ("run", "scene.toml", "--out", "folder.h5"), "is a folder; must be a file"),
        (main, ("run", "scene.toml", "--out", "/proc/out.h5"), "cannot be written"),
        (main, ("run", "scene.toml", "--out", "x" * 300 + ".h5"), "cannot be written: File name too long"),
        (main, ("run", "scene.toml", "--plot", "pipe.png"), "is a pipe or a device; must be a file"),
        (main, ("accuracy", "scene.toml", "--out", "no/folder.csv"), "folder 'no' does not exist"),
        (main, ("run", "scene\0.toml"), "cannot be read: "),
        (
            fit_main,
            ("job.toml", "--bootstrap", "3", "--out", "c.h5", "--checkpoint", "c.h5"),
            "file of --out",
        ),
        (
            fit_main,
            ("job.toml", "--bootstrap", "3", "--out", "folder.h5/../c.h5", "--checkpoint", "link.h5"),
            "is the file of --out; must be another file",
        ),
        (fit_main, ("job.toml", "--bootstrap", "3", "--checkpoint", "old.h5"), "the file exists"),
        (
            fit_main,
            ("job.toml", "--bootstrap", "3", "--checkpoint", "pipe.h5", "--resume"),
            "pipe or a device",
        ),
        (fit_main, ("job.toml", "--bootstrap", "9" * 5000), "must be an integer >= 1"),
        (fit_main, ("job.toml", "--bootstrap", "100000000"), "and <= 1000000"),
        (
            fit_main,
            ("job.toml", "--out", "friction.h5"),
            "is a file that this command reads; choose another file",
        ),
        (fit_main, ("job.toml", "--resume"), "must come with --bootstrap"),
    ],
)
def test_contradictions_are_found_before_work_begins(
    call_main, tmp_path, monkeypatch, command, arguments, words
):
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(JOB_SCENE + "[run]\nvelocity = 1.0\npressure = 1e5\n")
    many = "{ from = 1e4, to = 1e6, points = 100000 }"
    Path("large.toml").write_text(
        f"plausible = false\n{JOB_SCENE}[run]\nvelocity = {many}\npressure = {many}\n"
    )
    Path("job.toml").write_text(JOB.replace("modulus.csv", "friction.h5"))
    for name in ("old.h5", "friction.h5"):
        Path(name).write_bytes(b"old")
    Path("folder.h5").mkdir()
    os.mkfifo("pipe.h5")
    os.mkfifo("pipe.png")
    Path("full.h5").symlink_to("/dev/full")
    Path("link.h5").symlink_to("c.h5")
    before = sorted(os.listdir())
    status, printed, complaint = call_main(command, *arguments)
    assert (status, printed, complaint.count("\n")) == (2, "", 1)
    assert words in complaint
    assert sorted(os.listdir()) == before and Path("friction.h5").read_bytes() == b"old"


# --- streams and limits of a process

PROGRAM = "import sys; from {}.commands.main import main; sys.exit(main())"
CLOSED = "rubberfric: standard output is closed: must be open, for example as /dev/null\n"


def shell(redirection, *arguments, package="rubberfric", program=PROGRAM, **environment):
    """Status, stdout and stderr of a command that a shell begins."""
    line = (
        f'{redirection.partition("|")[0]} ; exec "$@"'
        if redirection.startswith("ulimit")
        else f'"$@" {redirection}'
    )
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    done = subprocess.run(
        [shutil.which("sh"), "-c", line, "sh", sys.executable, "-c", program.format(package), *arguments],
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
    """The library's own complaint was of 25 lines, and ended in a segmentation fault."""
    (tmp_path / "scene.toml").write_text(JOB_SCENE + "[run]\nvelocity = 1.0\npressure = 1e5\n")
    out = tmp_path / "r.h5"
    arguments = ("--no-cache", str(tmp_path / "scene.toml"), "--out", str(out))
    status, printed, complaint = shell("", *arguments, program=FULL)
    assert (status, complaint) == (1, f"rubberfric: [Errno 27] File too large: {str(out)!r}\n")
    assert "1.0000e+00" in printed and os.listdir(tmp_path) == ["scene.toml"]
