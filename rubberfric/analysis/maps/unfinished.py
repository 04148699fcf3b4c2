"""A result file in the making: what is done of it outlives an interrupt, a kill and a power cut.

`PATH.partial` is a folder with two files. One is the result file, of its final size from the beginning,
with all but the quantities; they are filled in through memory maps, so that no HDF5 library has it open
when the process dies. The other, `progress`, says what it is of and how much is done; it is replaced
after what it counts is on the disk. At the end the result file moves to PATH, and the folder goes.
"""

import contextlib
import hashlib
import importlib.metadata
import json
import math
import os
import shutil
import time
from pathlib import Path

import jax
import numpy as np

from rubberfric.base.atomic import begin, finish, temporary_folder
from rubberfric.io.hdf5 import reading
from rubberfric.io.results import QUANTITIES, allocate_quantity, result_shape, writing_result
from rubberfric.io.scene_files.hdf5 import FORMAT

try:
    import fcntl
except ImportError:  # on Windows
    fcntl = None

# Seconds between two marks of progress: what a kill costs at most. Before the first, an interrupted
# map leaves nothing behind.
INTERVAL = 2.0


class Unfinished:
    """Arrays of a result file to fill in, and how much is done."""

    def __init__(self, folder, name, job):
        self.file, self.marker, self.job = folder / name, folder / "progress", job
        with reading(self.file, FORMAT) as file:
            # A dataset without chunks lies in its file in one piece, as an array lies in memory.
            self._places = {
                name: (data.dtype, data.id.get_offset(), data.shape)
                for name, data in file.items()
                if name in QUANTITIES
            }
        self.done = read_progress(self.marker)["done"]
        self.marked = self.done > 0
        self._due = time.monotonic() + INTERVAL
        self.values = self.arrays(self.file, "r+")

    def arrays(self, path, mode="r"):
        """The quantities in the file, mapped into memory."""
        places = self._places.items()
        return {name: np.memmap(path, dtype, mode, offset, shape) for name, (dtype, offset, shape) in places}

    def reached(self, done):
        """Say how much is filled in; it is marked from time to time."""
        self.done = done
        if time.monotonic() >= self._due:
            self.mark()

    def mark(self):
        """Put on the disk what is filled in, and then that it is."""
        for values in self.values.values():
            values.flush()
        # Mapped anew, for the part that was touched counts as memory of the process.
        self.values.update(self.arrays(self.file, "r+"))
        write_progress(self.marker, self.job, self.file.stat().st_size, self.done)
        self.marked = True
        finish(self.file.parent)
        self._due = time.monotonic() + INTERVAL


def folder_of(path):
    """Where the unfinished file of a path is."""
    path = Path(path).resolve()
    return path.with_name(path.name + ".partial")


@contextlib.contextmanager
def unfinished(path, result, dtypes, order, resume):
    """`Unfinished` for a result without its quantities; on leaving, the file is whole and at `path`.

    Parameters
    ----------
    path : result file
    result : Result, whose solution is not looked at
    dtypes : dict from the names of quantities to their dtype
    order : what the order depends on in which they are filled, anything of JSON
    resume : bool
        whether to go on with what an earlier call left.

    Raises
    ------
    ValueError : what was left is of another map, cut off, in use, or there without `resume`; the file
        cannot have the space it needs.
    """
    path, folder = Path(path).resolve(), folder_of(path)
    job = digests(result, dtypes) | {"order of the points": order}
    if folder.exists() and not _continues(folder, path.name, job, resume):
        shutil.rmtree(folder)
    if not folder.exists():
        _create(folder, path.name, result, dtypes, job)
    with _alone(folder):
        part = Unfinished(folder, path.name, job)
        if not part.marked:
            begin(folder)
        try:
            yield part
            part.mark()
        except BaseException:
            if part.marked:
                part.mark()
            else:
                shutil.rmtree(folder)
                finish(folder)
            raise
        part.values = None
        os.replace(part.file, path)
        begin(folder)  # it holds nothing now
        shutil.rmtree(folder)
        finish(folder)
        sync_folder(path.parent)


def _create(folder, name, result, dtypes, job):
    """The folder of a map of which nothing is done, whole or not at all."""
    with temporary_folder(folder.parent) as temporary:
        new = temporary / folder.name
        new.mkdir()
        file = new / name
        try:
            with writing_result(file, result) as head:
                for quantity, dtype in dtypes.items():
                    allocate_quantity(head, quantity, result_shape(result.conditions), dtype)
            with open(file, "r+b") as data:
                if hasattr(os, "posix_fallocate"):  # a file may be of a size that the disk has not
                    os.posix_fallocate(data.fileno(), 0, file.stat().st_size)
                os.fsync(data.fileno())
        except (OSError, RuntimeError) as error:  # RuntimeError: the HDF5 library's, on closing
            size = math.prod(result_shape(result.conditions)) * sum(x.itemsize for x in dtypes.values())
            raise ValueError(
                f"{folder.with_suffix('')}: cannot be written, {size / 2**30:.3g} GiB: "
                f"{getattr(error, 'strerror', None) or error}"
            ) from None
        write_progress(new / "progress", job, file.stat().st_size, 0)
        os.rename(new, folder)
    sync_folder(folder.parent)


def _continues(folder, name, job, resume):
    """Whether what an earlier call left is to be gone on with, or ValueError; else it may be removed."""
    with _alone(folder):
        pass
    found = read_progress(folder / "progress")
    if not (folder / name).exists():
        return False  # it was killed between moving the finished file and removing the folder
    if not resume:
        if found["done"] == 0:
            return False
        raise ValueError(f"{folder}: holds an interrupted map: must be resumed or removed")
    other = [key for key, value in job.items() if found["job"].get(key) != value]
    if other:
        raise ValueError(
            f"{folder}: is of another map, its {', '.join(other)} differ: must be of the same, or removed"
        )
    size = (folder / name).stat().st_size
    if size != found["size"]:
        raise ValueError(
            f"{folder / name}: has {size} bytes: must have {found['size']}; it was cut off, remove it"
        )
    return True


@contextlib.contextmanager
def _alone(folder):
    """ValueError if another process is in this block with the same folder; a process that dies is out."""
    if fcntl is None:
        yield
        return
    lock = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ValueError(f"{folder}: is being written by another process: must be its alone") from None
        yield
    finally:
        os.close(lock)


def digests(result, dtypes):
    """What a map is of: a digest for each of its parts, equal in every process."""

    def digest(tree):
        leaves, structure = jax.tree.flatten(tree)
        found = hashlib.sha256(str(structure).encode())
        for leaf in leaves:
            array = np.asarray(leaf)
            found.update(f"{array.dtype} {array.shape}".encode())
            found.update(np.ascontiguousarray(array).reshape(-1))
        return found.hexdigest()

    return {
        "scene": digest(result.scene),
        **{name: digest(values) for name, values in result.conditions._asdict().items()},
        "quadrature": repr(result.quadrature),
        "quantities": {name: str(dtype) for name, dtype in dtypes.items()},
        "title": result.title,
        "version of rubberfric": importlib.metadata.version("rubberfric"),
    }


def read_progress(path):
    """What `write_progress` wrote, or ValueError."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if not (found["done"] >= 0 and found["size"] > 0 and isinstance(found["job"], dict)):
            raise ValueError
    except FileNotFoundError:
        raise ValueError(f"{path}: is missing; what is beside it must be removed") from None
    except (OSError, ValueError, TypeError, KeyError):
        raise ValueError(f"{path}: must say how much is done; it does not, remove its folder") from None
    return found


def write_progress(path, job, size, done):
    """Replace what says how much is done of a file of so many bytes."""
    new = path.with_name("progress.new")
    with open(new, "w", encoding="utf-8") as text:
        json.dump({"done": done, "size": size, "job": job}, text)
        text.flush()
        os.fsync(text.fileno())
    os.replace(new, path)
    sync_folder(path.parent)


def sync_folder(path):
    """Put names in a folder on the disk."""
    if os.name != "posix":
        return
    folder = os.open(path, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
