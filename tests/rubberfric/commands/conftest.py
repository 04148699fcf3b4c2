"""Fixtures of the tests of `rubberfric`."""

import functools
import re

import numpy as np
import pytest

from rubberfric.commands import main as command


@pytest.fixture
def call(call_main):
    """Run the command in this process: exit status, stdout, stderr."""
    return functools.partial(call_main, command.main)


@pytest.fixture
def numbers():
    """Return the function that finds the rows of numbers in a printed text."""

    def rows(text):
        return np.array([line.split() for line in text.splitlines() if re.match(r"\s+-?\d", line)], float)

    return rows
