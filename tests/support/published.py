"""Published measurements: sets in tests/reference/published, and sets that licences keep out of the project.

The environment variable RUBBERFRIC_PUBLISHED names a folder with the sets outside. README.md in
tests/reference/published lists sources, licences and columns.
"""

import os
from pathlib import Path

import pytest
from support.folders import REFERENCE

VARIABLE = "RUBBERFRIC_PUBLISHED"
PUBLISHED = REFERENCE / "published"
OUTSIDE = Path(os.environ[VARIABLE]).resolve() if os.environ.get(VARIABLE) else None
if OUTSIDE is not None and not OUTSIDE.is_dir():
    raise NotADirectoryError(f"{VARIABLE} = {OUTSIDE}: must be a folder")


def outside(name):
    """Return the path of a set of measurements outside the project; it need not exist."""
    return (OUTSIDE or Path(f"{VARIABLE} is not set")) / name


def is_missing(name):
    """Return True if a set of measurements outside the project is not there."""
    return OUTSIDE is None or not outside(name).is_dir()


def needs(name):
    """Return a mark that skips tests without a set of measurements outside the project."""
    return pytest.mark.skipif(is_missing(name), reason=reason(name))


def reason(name):
    """Return why tests are skipped without a set of measurements."""
    return f"set {VARIABLE} to a folder with {name}/ (see CONTRIBUTING.md, Published measurements)"
