"""Incomplete files when the thread of a signal ends the process."""

import threading

from rubberfric.base import atomic


def test_what_is_begun_is_removed(tmp_path):
    kept = tmp_path / "kept"
    kept.touch()
    with atomic.temporary_folder(tmp_path) as folder:
        (folder / "part").touch()
        atomic.remove_begun()
        assert [path.name for path in tmp_path.iterdir()] == ["kept"]


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
