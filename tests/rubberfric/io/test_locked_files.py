"""HDF5 files that another program, or this one, has open."""

import os
import subprocess
import sys

import h5py
import pytest
from support.scenes.examples import same
from support.scenes.fits import SCENE

import rubberfric as rf

HOLD = "import h5py, sys; file = h5py.File(sys.argv[1], 'r+'); print(flush=True); sys.stdin.read()"


@pytest.fixture
def hold():
    """Return a function that opens a file for writing in another process, and returns the process."""
    processes = []

    def held(path):
        process = subprocess.Popen(
            [sys.executable, "-c", HOLD, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        processes.append(process)
        assert process.stdout.readline() == b"\n"
        return process

    yield held
    for process in processes:
        process.kill()
        process.communicate()


@pytest.fixture
def path(tmp_path):
    rf.save_scene(tmp_path / "scene.h5", SCENE)
    return tmp_path / "scene.h5"


def test_a_file_of_an_older_format_is_read_without_its_lock(tmp_path, path, hold):
    """This format of HDF5 has no mark for an open file; a copy has the whole content."""
    older = tmp_path / "old.h5"
    with h5py.File(path) as ours, h5py.File(older, "w", libver="earliest") as old:
        for name, value in ours.attrs.items():
            old.attrs[name] = value
        ours.copy("scene", old)
    hold(older)
    with pytest.raises(OSError, match="lock"):
        h5py.File(older)
    same(rf.load_scene(older), SCENE)


@pytest.mark.skipif(not os.path.exists("/proc/locks"), reason="only Linux lists locks")
def test_the_message_names_the_program_that_writes(path, hold):
    process = hold(path)
    with pytest.raises(ValueError, match=r"scene\.h5: is open for writing in process (\d+)") as found:
        rf.load_scene(path)
    assert f"process {process.pid} (" in str(found.value) and str(found.value).endswith(": close it there")
    process.communicate(b"")
    same(rf.load_scene(path), SCENE)


def test_a_file_that_was_never_closed(path, hold):
    process = hold(path)
    process.kill()
    process.wait()
    with pytest.raises(ValueError, match=r"ended without closing it: .* run h5clear -s scene\.h5"):
        rf.load_scene(path)
    rf.save_scene(path, SCENE)
    same(rf.load_scene(path), SCENE)


@pytest.mark.parametrize("mode", ["r", "r+"])
@pytest.mark.parametrize("options", [{}, {"locking": False}])
def test_a_file_that_this_process_has_open(path, mode, options):
    with h5py.File(path, mode, **options):
        same(rf.load_scene(path), SCENE)
