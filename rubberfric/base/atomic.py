"""Files that appear whole or not at all."""

import contextlib
import os
import tempfile
from pathlib import Path


def as_path(path):
    """A `Path`; ValueError in one line for what cannot be one, such as arguments in the wrong order."""
    try:
        return Path(path)
    except TypeError:
        raise ValueError(f"path is a {type(path).__name__}: must be the path of a file") from None


@contextlib.contextmanager
def replacing(path):
    """Give a path to write to; on leaving, rename it to `path`, or remove it if writing failed.

    The temporary file lies in a hidden folder beside `path`, so that the rename stays on
    one file system, and has the name of `path`, so that its suffix still says what it is.
    """
    path = Path(path).resolve()  # a link is followed, not replaced
    with tempfile.TemporaryDirectory(prefix=".writing-", dir=path.parent) as folder:
        temporary = Path(folder) / path.name
        yield temporary
        os.replace(temporary, path)


def check_writable(path, suffixes):
    """Raise ValueError saying why `path` could not be written: its suffix, its folder, or itself."""
    path = as_path(path)
    if path.suffix.lower() not in suffixes:
        raise ValueError(f"{path}: suffix {path.suffix!r}: must be {' or '.join(suffixes)}")
    if not path.parent.is_dir():
        raise ValueError(f"{path}: there is no folder {str(path.parent)!r}; it must exist")
    if path.is_dir():
        raise ValueError(f"{path}: is a folder; must be a file")
    try:
        with tempfile.TemporaryDirectory(prefix=".writing-", dir=path.resolve().parent):
            pass
    except OSError as error:
        raise ValueError(f"{path}: cannot be written: {error.strerror}") from None
