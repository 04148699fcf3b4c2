"""Files: those that may be read, and those that appear whole or not at all."""

import contextlib
import errno
import os
import stat
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

StrPath = str | os.PathLike[str]

# Suffixes of the tables of measured data that are read.
TABLE_SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".xlsx")
# Bytes of a file that is read whole; what people measure has a hundredth of it.
LARGEST = 2**26

# What the system says of a disk that takes no more.
_FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO)

# Files and folders that are nothing without what this process has yet to do; a signal's thread reads them.
_begun: set[Path] = set()
_lock = threading.Lock()


def as_path(path: StrPath) -> Path:
    """A `Path`; ValueError in one line for what cannot be one, such as arguments in the wrong order."""
    try:
        return Path(path)
    except TypeError:
        raise ValueError(f"path is a {type(path).__name__}: must be the path of a file") from None


def begin(path: Path) -> None:
    """Have a file or folder removed if a signal ends the process before `finish`."""
    with _lock:
        _begun.add(path)


def finish(path: Path) -> None:
    """Let a file or folder stay, or know that it is removed already."""
    with _lock:
        _begun.discard(path)


def remove_begun(then: Callable[[], None] = lambda: None) -> None:
    """Remove what is not to outlive the process, and call `then` before another thread can begin a file."""
    with _lock:
        try:
            for path in _begun:
                if path.is_dir():
                    _remove_folder(path)
                else:
                    with contextlib.suppress(OSError):
                        path.unlink(missing_ok=True)
        finally:
            then()


def _remove_folder(path: Path) -> None:
    """Of files only. shutil would do it, but takes long to import for what every command begins with."""
    for file in path.glob("*"):
        file.unlink(missing_ok=True)
    with contextlib.suppress(OSError):  # it is gone, or another thread is about to remove it
        path.rmdir()


@contextlib.contextmanager
def temporary_folder(parent: StrPath) -> Iterator[Path]:
    """A hidden folder in another, removed on leaving, and by `remove_begun`."""
    folder = Path(parent) / f".writing-{os.urandom(8).hex()}"
    begin(folder)  # before there is one, so that none is forgotten
    try:
        folder.mkdir(0o700)
        yield folder
    finally:
        _remove_folder(folder)
        finish(folder)


@contextlib.contextmanager
def replacing(path: StrPath) -> Iterator[Path]:
    """Give a path to write to; on leaving, rename it to `path`, or remove it if writing failed.

    The temporary file lies in a hidden folder beside `path`, so that the rename stays on
    one file system, and has the name of `path`, so that its suffix still says what it is.
    """
    place = Path(path).resolve()  # a link is followed, not replaced
    with temporary_folder(place.parent) as folder:
        temporary = folder / place.name
        try:
            yield temporary
            os.replace(temporary, place)
        except OSError as error:
            if error.errno in _FULL:  # of writing, which does not say to what
                raise OSError(error.errno, error.strerror, str(path)) from None
            raise


def write_durably(path: StrPath, content: bytes | memoryview) -> None:
    """Write bytes whole or not at all, synchronised with the disk; OSError says why it could not be."""
    path = Path(path).resolve()  # a link is followed, not replaced
    # Always the same name: what a killed process leaves behind is overwritten by the next.
    temporary = path.with_name(f".{path.name}.writing")
    begin(temporary)
    try:
        with open(temporary, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise
    finally:
        finish(temporary)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # the new name, too
    finally:
        os.close(folder)


def check_suffix(path: StrPath, suffixes: tuple[str, ...]) -> None:
    """Raise ValueError unless a path ends in one of the suffixes."""
    path = as_path(path)
    if path.suffix.lower() not in suffixes:
        folder = "; it is a folder" if path.is_dir() else ""
        raise ValueError(f"{path}: suffix {path.suffix!r}: must be {' or '.join(suffixes)}{folder}")


def check_readable(path: StrPath, largest: int | None = None) -> None:
    """Raise ValueError saying why `path` could not be read: it is missing, too large, or no file at all.

    What has no end (a pipe, a device) would be waited for, or fill the memory.
    """
    try:
        found = os.stat(path)
        if stat.S_ISREG(found.st_mode):
            with open(path, "rb"):
                pass
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # a path with a NUL byte
        raise ValueError(f"{path}: cannot be read: {error}") from None
    if stat.S_ISDIR(found.st_mode):
        raise ValueError(f"{path}: cannot be read: Is a directory; must be a file")
    if not stat.S_ISREG(found.st_mode):
        raise ValueError(f"{path}: cannot be read: is a pipe or a device; must be a file")
    if largest is not None and found.st_size > largest:
        raise ValueError(
            f"{path}: cannot be read: has {found.st_size / 2**20:.0f} MiB; must have at most "
            f"{largest / 2**20:.0f}"
        )


def check_writable(path: StrPath, suffixes: tuple[str, ...]) -> None:
    """Raise ValueError saying why `path` could not be written: its suffix, its folder, or itself."""
    check_suffix(path, suffixes)
    path = as_path(path)
    try:
        if not path.parent.is_dir():
            raise ValueError(f"{path}: there is no folder {str(path.parent)!r}; it must exist")
        if path.is_dir():
            raise ValueError(f"{path}: is a folder; must be a file")
        if path.exists() and not path.is_file():
            raise ValueError(f"{path}: is a pipe or a device; must be a file")
        with temporary_folder(path.resolve().parent):
            pass
    except OSError as error:
        raise ValueError(f"{path}: cannot be written: {error.strerror}") from None
