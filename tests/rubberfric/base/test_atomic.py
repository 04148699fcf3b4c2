"""Complete files and their permissions, and incomplete files when the thread of a signal ends the process."""

import os
import stat
import threading

import pytest

from rubberfric.base import atomic


def test_what_is_begun_is_removed(tmp_path):
    kept = tmp_path / "kept"
    kept.touch()
    with atomic.temporary_folder(tmp_path) as folder:
        (folder / "part").touch()
        atomic.remove_begun()
        assert [path.name for path in tmp_path.iterdir()] == ["kept"]


@pytest.mark.skipif(os.name == "nt", reason="Windows has other permissions")
@pytest.mark.parametrize("mode", [0o444, 0o600, 0o664, 0o755])
def test_a_file_keeps_its_permissions(tmp_path, mode):
    path, link = tmp_path / "a.txt", tmp_path / "link.txt"
    path.write_text("old")
    path.chmod(mode)
    link.symlink_to("a.txt")
    for k, each in enumerate((path, link)):
        atomic.write_text(each, f"new {k}")
        assert path.read_text() == f"new {k}" and stat.S_IMODE(path.stat().st_mode) == mode
    assert link.is_symlink()


@pytest.mark.skipif(os.name == "nt", reason="Windows has other permissions")
def test_a_new_file_has_the_permissions_of_other_new_files(tmp_path):
    (tmp_path / "other.txt").write_text("")
    atomic.write_text(tmp_path / "a.txt", "new")
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("a.txt", "other.txt")}
    assert len(modes) == 1


@pytest.mark.parametrize("links", [["a.txt"], ["b.txt", "a.txt"]])
def test_a_link_to_itself_is_refused(tmp_path, monkeypatch, links):
    monkeypatch.chdir(tmp_path)
    for name, target in zip(("a.txt", "b.txt"), links, strict=False):
        os.symlink(target, name)
    with pytest.raises(ValueError, match=r"a\.txt: is a link to itself"):
        atomic.check_writable("a.txt", (".txt",))


def test_nothing_begins_between_the_removal_and_the_end(tmp_path):
    """Another thread waits to make a folder until `then` has run, which ends the process."""
    order, began = [], threading.Event()

    def begin_another():
        began.set()
        with atomic.temporary_folder(tmp_path):
            pass
        order.append("begun")

    other = threading.Thread(target=begin_another)

    def leave():
        other.start()
        began.wait()
        other.join(0.2)
        order.append("ended")

    atomic.remove_begun(leave)
    other.join()
    assert order == ["ended", "begun"]
