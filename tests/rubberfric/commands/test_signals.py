"""Both signals at twenty moments of every command, from its first lines on: no crash, trace or half file."""

import os
import signal

import pytest
from support.processes.signals import COMMANDS, WAITING, answers

pytestmark = pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="asks Linux for handlers")


@pytest.mark.slow
@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("time", range(3))
def test_signals(name, which, time):
    del time  # each time the moments are others
    found = answers(name, which)
    faults = [one for one in found if one.kind == "fault"]
    assert not faults
    interrupted = [one for one in found if one.kind == "interrupted"]
    late = [
        one for one in interrupted if one.answer > 1 or (one.seconds > 1 and WAITING not in one.complaint)
    ]
    assert not late
    assert len(interrupted) > 10
