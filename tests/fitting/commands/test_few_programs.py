"""A command compiles few programs: each takes 10 ms even where the cache has it, and operations are dozens.

Outside of a jitted function each of them is a program, for every shape.
"""

import os
import subprocess
import sys

import pytest
from support.folders import DATA


@pytest.mark.parametrize(
    ("command", "most"),
    # A second for the question whether XLA knows an option; a fit has rows, slopes, four parts of a step and
    # three of the error bars.
    [
        (["rubberfric", "run", "tread_on_asphalt.toml"], 2),
        (["fitting", "tread_on_asphalt_fit.toml"], 10),
    ],
    ids=["run", "fit"],
)
def test_few_programs_are_compiled(command, most):
    done = subprocess.run(
        [sys.executable, "-m", *command],
        # With the compiler options of the commands.
        env={k: v for k, v in os.environ.items() if k != "XLA_FLAGS"} | {"JAX_LOG_COMPILES": "1"},
        capture_output=True,
        text=True,
        check=True,
        cwd=DATA,
    )
    compiled = [line for line in done.stderr.splitlines() if line.startswith("Finished XLA compilation of")]
    names = [line.split("jit(")[1].split(")")[0] for line in compiled if "jit(" in line]
    assert 0 < len(names) <= most, names
