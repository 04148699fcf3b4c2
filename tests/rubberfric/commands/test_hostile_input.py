"""Files that are none, and arguments that contradict each other: one line each, at once.

Nothing is computed here: errors are found before, and mostly before JAX is imported.
"""

import os
import socket
import time
from pathlib import Path

import pytest
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


@pytest.mark.parametrize(
    ("place", "kind"),
    [
        *(("the scene of run", kind) for kind in KINDS),
        *(
            (place, kind)
            for place in PLACES
            for kind in ("a pipe", "zeros without an end")
            if place != "the scene of run"
        ),
    ],
)
def test_what_is_no_file(complaint_about, place, kind):
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
