"""Compiled programs from a folder: the same bits, in silence, whatever is wrong with the folder."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.folders import ROOT

from rubberfric.base import compilation as module

# A curve and its gradient, to the last bit, and how many programs came from the folder.
PROGRAM = """
import sys
import rubberfric as rf
folder = rf.compilation_cache(*sys.argv[1:])
import jax
import numpy as np
jax.config.update("jax_enable_x64", True)
hits = []
jax.monitoring.register_event_listener(lambda event, **_: hits.append(event.endswith("cache_hits")))
road = rf.Body(rf.Rigid(), rf.SelfAffine(1e2, 1e3, 3e4, 0.8, 5e-4))
scene = rf.Scene(road, rf.Body(rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3])))
quadrature = rf.Quadrature(order=4, panels=2, graded=1, ratio=6.0)
def mu(scene):
    return rf.friction(scene, np.array([1e-3, 1.0]), 1e5, quadrature=quadrature).sum()
found = jax.jit(mu)(scene), jax.jit(jax.grad(mu))(scene)
print(folder, sum(hits), *(np.asarray(leaf).tobytes().hex() for leaf in jax.tree.leaves(found)))
"""


def begun(home, *arguments, **environment):
    """A process that computes the curve."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("JAX", "TF_"))}
    # JAX may only warn of an incomplete entry.
    options = ["-W", "error", "-W", "ignore:Error reading persistent"]
    own = {"PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(home), "TF_CPP_MIN_LOG_LEVEL": "3"}
    return subprocess.Popen(
        [sys.executable, *options, "-c", PROGRAM, *map(str, arguments)],
        env=kept | own | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process):
    """Folder, number of programs that came from it, and the bits."""
    printed, complaint = process.communicate()
    assert (process.returncode, complaint) == (0, "")
    folder, hits, *bits = printed.split()
    return folder, int(hits), bits


def test_the_same_bits_in_silence(tmp_path):
    folder, hits, bits = ended(begun(tmp_path))
    assert Path(folder).parent == tmp_path / "rubberfric" and hits == 0
    assert Path(folder).stat().st_mode & 0o777 == 0o700
    entries = list(Path(folder).glob("*-cache"))
    assert len(entries) > 1 and ended(begun(tmp_path)) == (folder, len(entries), bits)


@pytest.mark.slow
def test_the_same_bits_after_a_disaster(tmp_path):
    folder, _, bits = ended(begun(tmp_path))
    entries = list(Path(folder).glob("*-cache"))
    # as a process that was killed, or a full disk, leaves them
    for entry, keep in zip(entries, [0, *[100] * len(entries)], strict=False):
        entry.write_bytes(entry.read_bytes()[:keep])
    assert ended(begun(tmp_path)) == (folder, 0, bits)


@pytest.mark.slow
def test_folders_that_are_given(tmp_path):
    _, _, bits = ended(begun(tmp_path))
    own = tmp_path / "own"
    assert ended(begun(tmp_path, JAX_COMPILATION_CACHE_DIR=str(own))) == (str(own), 0, bits)
    assert ended(begun(tmp_path, JAX_COMPILATION_CACHE_DIR=str(own)))[1] > 1
    assert ended(begun(tmp_path, own))[:2] == (str(own), len(list(own.glob("*-cache"))))
    assert ended(begun(tmp_path, JAX_ENABLE_COMPILATION_CACHE="false")) == ("None", 0, bits)
    (tmp_path / "file").touch()
    assert ended(begun(tmp_path / "file")) == ("None", 0, bits)  # a folder that cannot be


def test_a_folder_that_others_may_write_to_is_not_used(tmp_path):
    tmp_path.chmod(0o777)
    assert not module._is_own(tmp_path)
    tmp_path.chmod(0o700)
    assert module._is_own(tmp_path)


def test_the_oldest_folders_go_first(tmp_path, monkeypatch):
    """Whole folders, because the names of entries are internal to JAX."""
    monkeypatch.setattr(module, "LARGEST_CACHE", 1000)
    folders = [tmp_path / f"jaxlib-{i}" for i in range(3)]
    for i, folder in enumerate(folders):
        folder.mkdir()
        (folder / "any name").write_bytes(bytes(300))
        os.utime(folder, (i, i))
    module._remove_oldest(tmp_path)
    assert all(folder.exists() for folder in folders)
    (folders[2] / "another").write_bytes(bytes(500))
    os.utime(folders[2], (2, 2))
    module._remove_oldest(tmp_path)
    assert [folder.exists() for folder in folders] == [False, False, True]


SETTINGS = """
import os, warnings
import rubberfric as rf
from rubberfric.base import compilation
import jax  # which sets a log level itself
level = os.environ.get("TF_CPP_MIN_LOG_LEVEL")
filters = list(warnings.filters)
rf.compilation_cache()
assert os.environ.get("TF_CPP_MIN_LOG_LEVEL") == level and warnings.filters == filters
"""


def test_the_library_changes_no_log_level_and_no_filter(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", SETTINGS],
        env={"PYTHONPATH": str(ROOT), "XDG_CACHE_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def test_the_folder_is_that_of_the_version_and_of_the_processor(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    here = module.default_folder()
    assert here.name.startswith("jaxlib-")
    monkeypatch.setattr("jaxlib.version.__version__", "another")
    assert here != module.default_folder()
    monkeypatch.undo()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(module, "_processor", lambda: "another")
    assert here != module.default_folder() and here.parent == tmp_path / "rubberfric"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert "relative" not in module.default_folder().parts
