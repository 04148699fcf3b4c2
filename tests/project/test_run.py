"""The run of tests: it opens no file above the project, and its processes hold little memory."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.folders import PYTHONPATH, ROOT
from support.processes import memory, outside

FOLDERS = (".ci", "data", "fitting", "notebooks", "rubberfric", "tests")
SUFFIXES = ("", ".py", ".md", ".toml", ".ipynb")
# Paths that leave the project, in source text: through the folder above it, or from the root of one machine.
LEAVES = re.compile(
    r"\bROOT\.parents?\b.* / [\"']|[\"'(` ]\.\./\.\./(?!etc/)|[\"'(` ]/(?:work|home|root|mnt|srv)/"
)


def faults(folder):
    """Return the lines of the source files in a folder that name a path outside it."""
    paths = [*folder.glob("*"), *(path for name in FOLDERS for path in (folder / name).rglob("*"))]
    return [
        f"{path.relative_to(folder)}:{number}: {line.strip()}"
        for path in sorted(paths)
        if path.is_file() and path.suffix in SUFFIXES and path.name != ".git"
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if LEAVES.search(line)
    ]


@pytest.mark.parametrize(
    "line", ['DATA = ROOT.parent / "shared"', 'open("../../shared/a.csv")', "Run `/home/me/rubberfric/run`."]
)
def test_a_path_that_leaves_the_project_is_found(line, tmp_path):
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_one.py").write_text(f"import numpy\n{line}\n")
    assert faults(tmp_path) == [f"tests/test_one.py:2: {line}"]


def test_no_path_leaves_the_project():
    found = [fault for fault in faults(ROOT) if not fault.startswith("tests/project/test_run.py")]
    assert not found, "\n".join(found)


@pytest.mark.skipif(not outside.GUARDS, reason="the folder above the project is that of temporary files")
@pytest.mark.parametrize(
    "call", [open, os.listdir, lambda path: os.open(path, os.O_RDONLY), lambda path: Path(path).read_text()]
)
def test_opening_a_file_beside_the_project_fails(call):
    with pytest.raises(outside.OutsideError, match="shared lies outside the project"):
        call(str(ROOT.parent / "shared"))


def test_other_files_may_be_opened(tmp_path):
    (tmp_path / "a").write_text("a")
    with open(ROOT / "README.md"), open(os.__file__), open(os.devnull):
        assert os.listdir(tmp_path) == ["a"]


BOUND = "from support.processes import memory\n\nmemory.MOST = 0.3e9\n"
HUNGRY = "import numpy as np\n\ndef test_memory():\n    assert np.ones({size}).all()\n"


@pytest.mark.skipif(memory.peak() == 0, reason="needs Linux, which reports the memory of a process")
@pytest.mark.parametrize(
    ("size", "workers", "expected"),
    [
        pytest.param(1, ("-n", "1"), (0, False), marks=pytest.mark.slow),
        pytest.param(40_000_000, ("-n", "1"), (1, True), marks=pytest.mark.slow),
        pytest.param(40_000_000, (), (1, True), marks=pytest.mark.slow),
    ],
)
def test_too_much_memory_fails_the_run(size, workers, expected, tmp_path):
    pytest.importorskip("xdist")
    (tmp_path / "bound.py").write_text(BOUND)
    (tmp_path / "test_hungry.py").write_text(HUNGRY.format(size=size))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "conftest", "-p", "bound", "-m", "not slow"]
    path = os.pathsep.join([PYTHONPATH, str(tmp_path)])
    environment = os.environ | {"PYTHONPATH": path, "XLA_FLAGS": ""}
    done = subprocess.run(
        [*command, *workers], env=environment, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    *_, line, last = done.stdout.splitlines()
    assert re.match(r"peak memory: \d\.\d\d GB", line) and last.startswith("1 passed"), done.stdout
    assert (done.returncode, "must be at most" in line) == expected


@pytest.mark.skipif(memory.peak() == 0, reason="needs Linux, which reports the memory of a process")
def test_compiled_functions_are_dropped_once(monkeypatch):
    """The second call drops nothing, because memory has not grown."""
    calls = []
    monkeypatch.setattr(memory.jax, "clear_caches", lambda: calls.append(None))
    monkeypatch.setattr(memory, "_dropped", [0.0])
    monkeypatch.setattr(memory, "MUCH", memory.resident() - 1e6)
    memory.drop_if_much()
    memory.drop_if_much()
    assert len(calls) == 1
