"""Checks of ensembles."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.ensembles import ensemble_cases as cases
from support.folders import PYTHONPATH

PROGRAM = Path(cases.__file__)


def assert_same(one, other, rows=slice(None)):
    """Every number of every member, to the last bit."""
    for name in cases.ROWS:
        a, b = (x[name] if isinstance(x, dict) else getattr(x, name) for x in (one, other))
        np.testing.assert_array_equal(a[rows], b[rows], err_msg=name)


def start(*arguments, devices=1):
    added = {"JAX_NUM_CPU_DEVICES": str(devices), "JAX_PLATFORMS": "cpu", "PYTHONPATH": PYTHONPATH}
    command = [sys.executable, str(PROGRAM), *map(str, arguments)]
    return subprocess.Popen(command, env=os.environ | added, text=True, stdout=subprocess.PIPE)


def finished(process):
    out, _ = process.communicate(timeout=120)
    assert process.returncode == 0, out
    return out


def refused(call, *words):
    """The message of the ValueError that `call` raises: one line with these words in it."""
    with pytest.raises(ValueError, match=re.escape(str(words[0]))) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert str(word) in message, message
    return message
