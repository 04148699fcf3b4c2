"""Files that appear whole or not at all."""

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path

StrPath = str | os.PathLike[str]

_begun: set[Path] = set()  # files and folders that are nothing without what this process has yet to do


def as_path(path: StrPath) -> Path:
    """A `Path`; ValueError in one line for what cannot be one, such as arguments in the wrong order."""
    try:
        return Path(path)
    except TypeError:
        raise ValueError(f"path is a {type(path).__name__}: must be the path of a file") from None


def begin(path: Path) -> None:
    """Have a file or folder removed if a signal ends the process before `finish`."""
    _begun.add(path)


def finish(path: Path) -> None:
    """It may remain, or is removed already."""
    _begun.discard(path)


def remove_begun() -> None:
    """Remove what is not to outlive the process; another thread may be about to do so."""
    for path in list(_begun):
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)


@contextlib.contextmanager
def temporary_folder(parent: StrPath) -> Iterator[Path]:
    """A hidden folder in another, removed on leaving, and by `remove_begun`."""
    folder = Path(parent) / f".writing-{secrets.token_hex(8)}"
    begin(folder)  # before there is one, so that none is forgotten
    try:
        folder.mkdir(0o700)
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        finish(folder)


@contextlib.contextmanager
def replacing(path: StrPath) -> Iterator[Path]:
    """Give a path to write to; on leaving, rename it to `path`, or remove it if writing failed.

    The temporary file lies in a hidden folder beside `path`, so that the rename stays on
    one file system, and has the name of `path`, so that its suffix still says what it is.
    """
    path = Path(path).resolve()  # a link is followed, not replaced
    with temporary_folder(path.parent) as folder:
        temporary = folder / path.name
        yield temporary
        os.replace(temporary, path)


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


def check_writable(path: StrPath, suffixes: tuple[str, ...]) -> None:
    """Raise ValueError saying why `path` could not be written: its suffix, its folder, or itself."""
    path = as_path(path)
    if path.suffix.lower() not in suffixes:
        raise ValueError(f"{path}: suffix {path.suffix!r}: must be {' or '.join(suffixes)}")
    if not path.parent.is_dir():
        raise ValueError(f"{path}: there is no folder {str(path.parent)!r}; it must exist")
    if path.is_dir():
        raise ValueError(f"{path}: is a folder; must be a file")
    try:
        with temporary_folder(path.resolve().parent):
            pass
    except OSError as error:
        raise ValueError(f"{path}: cannot be written: {error.strerror}") from None
