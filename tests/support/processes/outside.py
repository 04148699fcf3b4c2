"""A hook that refuses to open files in the folder above the project.

A test that needs such a file would fail in a clone in another folder.
"""

import os
import sys
import tempfile

from support.folders import ROOT

EVENTS = ("open", "os.listdir", "os.scandir")
_ABOVE = os.path.join(ROOT.parent, "")


class OutsideError(Exception):
    """A test opened a file in the folder above the project."""


def _allowed():
    """Return the folders whose files may be opened wherever they lie, with a separator at the end."""
    chosen = (value for name, value in os.environ.items() if name.startswith("RUBBERFRIC_"))
    folders = filter(None, (ROOT, tempfile.gettempdir(), sys.prefix, sys.base_prefix, *sys.path, *chosen))
    paths = {os.path.join(os.path.abspath(folder), "") for folder in folders}
    # A clone may lie in a folder of temporary files. What is around it may not be opened there either.
    return tuple(path for path in paths if path == _ABOVE or not _ABOVE.startswith(path))


_ALLOWED = _allowed()
# Tests use the folder above the project if it is the root folder or the folder of temporary files.
GUARDS = ROOT.parent != ROOT.parent.parent and _ABOVE not in _ALLOWED


def refuse(event, arguments):
    """Raise OutsideError if a file above the project is opened. This is a hook for `sys.addaudithook`."""
    if event not in EVENTS or not GUARDS:
        return
    path = os.fsdecode(arguments[0]) if isinstance(arguments[0], bytes) else arguments[0]
    if not isinstance(path, str):
        return
    path = os.path.join(os.path.abspath(path), "")
    below = path.removeprefix(_ABOVE)
    # The folder above may be the home folder. Its hidden folders have settings and caches of programs.
    if below not in ("", path) and not below.startswith(".") and not path.startswith(_ALLOWED):
        raise OutsideError(f"{path[:-1]} lies outside the project. Copy the numbers to tests/reference")
