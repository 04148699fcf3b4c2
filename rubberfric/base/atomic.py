"""Check files before reading, read text, and write files completely or not at all."""

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
# Largest size in bytes of a file that is read. Typical measured data have a hundredth of it.
LARGEST_FILE = 2**26
# First bytes of a compound document: an old .xls, or any workbook with a password.
COMPOUND_START = b"\xd0\xcf\x11\xe0"

# Errors of a full or failing disk.
_FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO)

# Folders with incomplete files of this process, which the thread that waits for signals removes.
_begun: set[Path] = set()
_lock = threading.Lock()


def as_path(path: StrPath) -> Path:
    """Convert a string or a path object to a `Path`, or raise ValueError for another type."""
    try:
        return Path(path)
    except TypeError:
        raise ValueError(f"path is a {type(path).__name__}: must be the path of a file") from None


def remove_begun(then: Callable[[], None] = lambda: None) -> None:
    """Remove all folders of `temporary_folder` that still exist, and then call `then`.

    No other thread can make such a folder before `then` has returned.
    """
    with _lock:
        try:
            for folder in _begun:
                _remove_folder(folder)
        finally:
            then()


def _remove_folder(path: Path) -> None:
    # Importing shutil, whose rmtree would do this, takes long.
    for file in path.glob("*"):
        file.unlink(missing_ok=True)
    with contextlib.suppress(OSError):  # another thread removed it, or is about to
        path.rmdir()


@contextlib.contextmanager
def temporary_folder(parent: StrPath) -> Iterator[Path]:
    """Make a hidden folder in `parent`, and yield the path of the folder.

    The folder is removed at the end of the `with` block, or by `remove_begun` if a signal ends the process.
    """
    folder = Path(parent) / f".writing-{os.urandom(8).hex()}"
    with _lock:
        _begun.add(folder)  # first, so that a signal between the two lines leaves no folder
    try:
        folder.mkdir(0o700)
        yield folder
    finally:
        _remove_folder(folder)
        with _lock:
            _begun.discard(folder)


@contextlib.contextmanager
def replacing(path: StrPath) -> Iterator[Path]:
    """Yield a temporary path, and rename the file written there to `path` after the `with` block.

    If the block raises an exception, the temporary file is removed. The temporary file lies in a hidden
    folder in the folder of `path`, so that the rename stays on one file system. The temporary file has the
    name of `path`, so that the suffix shows the format. A file that exists keeps its permissions.
    """
    place = Path(path).resolve()  # a link is followed, not replaced
    with temporary_folder(place.parent) as folder:
        temporary = folder / place.name
        try:
            yield temporary
            with contextlib.suppress(FileNotFoundError):
                temporary.chmod(stat.S_IMODE(place.stat().st_mode))
            os.replace(temporary, place)
        except OSError as error:
            if error.errno in _FULL:  # an error of writing does not name the file
                raise OSError(error.errno, error.strerror, str(path)) from None
            raise


def write_durably(path: StrPath, content: bytes | memoryview) -> None:
    """Write bytes to a file completely or not at all, and wait until they are on the disk.

    An OSError is raised if the bytes cannot be written.
    """
    with replacing(path) as temporary, open(temporary, "wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    folder = os.open(Path(path).resolve().parent, os.O_RDONLY)
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
    """Raise ValueError if a file cannot be read, is too large, or is not a regular file.

    `largest` is the largest allowed size in bytes. Pipes and devices are refused because reading them could
    wait forever or fill the memory.
    """
    try:
        status = os.stat(path)
        if stat.S_ISREG(status.st_mode):
            with open(path, "rb"):
                pass
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # a path with a NUL byte
        raise ValueError(f"{path}: cannot be read: {error}") from None
    if stat.S_ISDIR(status.st_mode):
        raise ValueError(f"{path}: cannot be read: Is a directory; must be a file")
    if not stat.S_ISREG(status.st_mode):
        raise ValueError(f"{path}: cannot be read: is a pipe or a device; must be a file")
    if largest is not None and status.st_size > largest:
        raise ValueError(
            f"{path}: cannot be read: has {status.st_size / 2**20:.0f} MiB; must have at most "
            f"{largest / 2**20:.0f}"
        )


def check_writable(path: StrPath, suffixes: tuple[str, ...]) -> None:
    """Raise ValueError if a path has none of the suffixes, is not a regular file, or cannot be written."""
    check_suffix(path, suffixes)
    path = as_path(path)
    try:
        if not path.parent.is_dir():
            raise ValueError(f"{path}: folder {str(path.parent)!r} does not exist; create it first")
        if path.is_dir():
            raise ValueError(f"{path}: is a folder; must be a file")
        if path.exists() and not path.is_file():
            raise ValueError(f"{path}: is a pipe or a device; must be a file")
        place = os.path.realpath(path)  # Path.resolve raises RuntimeError for a link to itself
        if os.path.islink(place):
            raise ValueError(f"{path}: is a link to itself; must be a file")
        with temporary_folder(os.path.dirname(place)):
            pass
    except OSError as error:
        raise ValueError(f"{path}: cannot be written: {error.strerror}") from None


def read_text(path: StrPath) -> str:
    """Return the text of a UTF-8 file.

    Raises
    ------
    ValueError : the file is missing, too large, not a regular file, or has another encoding
        The message has one line.
    """
    check_readable(as_path(path), LARGEST_FILE)
    return decoded(path, read_bytes(path))


def read_bytes(path: StrPath) -> bytes:
    """Return the content of a file, or raise ValueError if it cannot be read."""
    try:
        return as_path(path).read_bytes()
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None


def decoded(path: StrPath, content: bytes, encoding: str = "utf-8-sig") -> str:
    """Return bytes as text, or raise ValueError if they are a workbook or have another encoding."""
    if content.startswith((b"PK\x03\x04", COMPOUND_START)):
        raise ValueError(
            f"{path}: cannot be read as text: is a workbook; its suffix must be .xlsx, or save it as .csv"
        )
    try:
        return content.decode(encoding)
    except ValueError as error:
        raise ValueError(f"{path}: cannot be read as text: {error}") from None


def is_number(cell: object) -> bool:
    """Return True for a number, and for the text of a number with a decimal point or comma."""
    try:
        float(str(cell).replace(",", ".", 1))
    except ValueError:
        return False
    return True


def write_text(path: StrPath, text: str) -> None:
    """Write text to a file completely or not at all, or raise ValueError if its folder does not exist."""
    folder = as_path(path).parent
    if not folder.is_dir():
        raise ValueError(f"{path}: cannot be written: folder {str(folder)!r} must exist")
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
