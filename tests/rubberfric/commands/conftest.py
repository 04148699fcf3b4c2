"""Fixtures of the tests of `rubberfric`."""

import functools
import os
import re

import numpy as np
import pytest
from support.scenes.maps import FILE

from rubberfric.commands import main as command


@pytest.fixture
def call(call_main):
    """Run the command in this process: exit status, stdout, stderr."""
    return functools.partial(call_main, command.main)


@pytest.fixture
def scene_file(tmp_path):
    """A scene file in an empty folder."""
    path = tmp_path / "scene.toml"
    path.write_text(FILE)
    return path


@pytest.fixture
def refused(call, tmp_path):
    """Run the command, which must end with status 2 and one line and write no file. Return the line."""

    def run(*arguments):
        before = sorted(os.listdir(tmp_path))
        status, printed, complaint = call(*arguments)
        assert (status, printed, complaint.count("\n")) == (2, "", 1)
        assert sorted(os.listdir(tmp_path)) == before
        return complaint

    return run


@pytest.fixture
def numbers():
    """Return the function that finds the rows of numbers in a printed text."""

    def rows(text):
        return np.array([line.split() for line in text.splitlines() if re.match(r"\s+-?\d", line)], float)

    return rows
