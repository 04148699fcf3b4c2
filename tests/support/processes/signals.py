"""Commands that get a signal at moments from their beginning to their end: how, and how soon, they answer.

``PYTHONPATH=.:tests python tests/support/processes/signals.py [run map accuracy explore fit]`` prints
a table.
"""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import NamedTuple

from support.folders import ROOT
from support.scenes.fits import JOB_FILES, write_job

# Bit of a signal in the line of /proc about the handlers of a process.
TERMINATE = 1 << (signal.SIGTERM - 1)
SCENE = ROOT / "data" / "tread_on_asphalt.toml"
PROGRAM = "import sys; from {}.commands.main import main; sys.exit(main({}))"
COMMANDS = {
    "run": ("rubberfric", "run", SCENE, "--out", "out.h5"),
    "map": ("rubberfric", "map", SCENE, "--out", "out.h5"),
    "accuracy": ("rubberfric", "accuracy", SCENE, "--out", "out.csv"),
    "explore": ("rubberfric", "explore", SCENE, "--no-browser"),
    "fit": ("fitting", "job.toml", "--out", "out.h5"),
}
EMBEDDED = " called from Python"
COMMANDS |= {f"{name}{EMBEDDED}": COMMANDS[name] for name in ("run", "fit")}
LONGEST = 25.0  # longest observed duration of a command [s]
# Lines of commands that wait for the end of a step, or of a compilation.
WAITING = "interrupted; stopping after this"


class Answer(NamedTuple):
    """Result of one process."""

    after: float  # from its beginning to the signal [s]
    status: int
    seconds: float  # from the signal to its end [s]
    answer: float  # from the signal to its line [s]
    complaint: str
    left: list[str]  # files
    begun: bool  # whether signals had handlers already: Python begins with its own, whose trace is its own

    @property
    def kind(self) -> str:
        """Interrupted, done before, not yet begun, or a fault."""
        if self.status == 0 and not self.complaint:
            return "done before"
        if not self.begun:
            return "not yet begun"
        if self.status in (128 + signal.SIGINT, 128 + signal.SIGTERM):
            lines = self.complaint.count("\n")
            whole = lines == 1 or (WAITING in self.complaint and lines == 2)
            return "interrupted" if whole and not [x for x in self.left if x.startswith(".")] else "fault"
        return "fault"


def begun(name, folder):
    """The process of a command, which compiles all that it needs."""
    package, *arguments = COMMANDS[name]
    if package == "fitting":
        write_job(folder)
    embedded = name.endswith(EMBEDDED)
    program = PROGRAM.format(package, list(map(str, arguments)) if embedded else "")
    environment = {key: value for key, value in os.environ.items() if key != "XLA_FLAGS"}
    environment |= {"PYTHONPATH": str(ROOT), "JAX_ENABLE_COMPILATION_CACHE": "false"}
    return subprocess.Popen(
        [sys.executable, "-c", program, *([] if embedded else map(str, arguments))],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        cwd=folder,
    )


def answer(name, which, after):
    """Return the reaction of a command to a signal some seconds after its start."""
    folder = Path(tempfile.mkdtemp())
    lines, ready = [], True
    with begun(name, folder) as process:

        def read():
            lines.extend((time.monotonic(), line) for line in process.stderr)

        reader = threading.Thread(target=read)
        reader.start()
        try:
            process.wait(after)
            sent = time.monotonic()
        except subprocess.TimeoutExpired:
            ready = has_handlers(process.pid)
            sent = time.monotonic()
            process.send_signal(which)
        try:
            status = process.wait(120)
        finally:
            process.kill()
        ended = time.monotonic()
        reader.join()
    left = sorted({*os.listdir(folder)} - {*JOB_FILES})
    shutil.rmtree(folder)
    first = lines[0][0] if lines else ended
    text = "".join(line for _, line in lines)
    return Answer(after, status, ended - sent, first - sent, text, left, ready)


def has_handlers(process):
    """Return True if a process has a handler for SIGTERM; Python has none before the command begins."""
    status = Path(f"/proc/{process}/status").read_text()
    return bool(int(status.split("SigCgt:")[1].split()[0], 16) & TERMINATE)


def duration(name):
    """Return the duration of an undisturbed command, or the limit."""
    begin = time.monotonic()
    with tempfile.TemporaryDirectory() as folder, begun(name, Path(folder)) as process:
        try:
            process.wait(LONGEST)
        except subprocess.TimeoutExpired:
            process.kill()
    return time.monotonic() - begin


def answers(name, which, count=20):
    """`Answer` at moments that are denser at the beginning, where Python is imported."""
    last = duration(name)
    first = 0.03
    return [answer(name, which, first * (last / first) ** (i / (count - 1))) for i in range(count)]


def stay(seconds=10.0):
    """Work in Python, where an exception of another thread arrives, until it does."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(0.001)


if __name__ == "__main__":
    for name in sys.argv[1:] or COMMANDS:
        for which in (signal.SIGINT, signal.SIGTERM):
            print(f"\n{name}, {which.name}")
            for found in answers(name, which):
                line = f"{found.after:7.2f} s: {found.status:4d} {found.kind:14s} "
                line += f"answered in {found.answer:5.2f} s, ended in {found.seconds:5.2f} s {found.left}"
                print(line, repr(found.complaint[-300:]) * (found.kind == "fault"), flush=True)
