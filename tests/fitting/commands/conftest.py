"""The command rubberfric-fit in this process."""

import functools

import pytest

from fitting.commands.main import main


@pytest.fixture
def call(call_main):
    """Run the command: exit status, stdout, stderr."""
    return functools.partial(call_main, main)
