"""A command compiles few programs: each takes 10 ms even where the cache has it, and operations are dozens.

Outside of a jitted function each of them is a program, for every shape.
"""

import os
import subprocess
import sys

import pytest
from support.folders import DATA, ROOT

# In a new process, because conftest switches double precision on.
PROGRAM = """
import sys
sys.modules["matplotlib"] = None
import jax
from {}.commands.main import main
assert not jax.config.jax_enable_x64
status = main(sys.argv[1:])
assert jax.config.jax_enable_x64
slow = {{"scipy.interpolate", "scipy.stats"}} & sys.modules.keys()  # each takes half a second to import
assert not slow, slow
sys.exit(status)
"""


@pytest.mark.parametrize(
    ("package", "arguments", "most"),
    # A second for the question whether XLA knows an option, and a third for the range of the roughness. A fit
    # has rows, slopes, four parts of a step and three of the error bars.
    [
        pytest.param("rubberfric", ("run", "tread_on_asphalt.toml"), 3, id="run"),
        pytest.param("fitting", ("tread_on_asphalt_fit.toml",), 10, id="fit", marks=pytest.mark.slow),
    ],
)
def test_commands_compile_few_programs_in_double_precision_without_matplotlib(package, arguments, most):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PROGRAM.format(package), *arguments],
        env=os.environ | {"JAX_LOG_COMPILES": "1", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        cwd=DATA,
    )
    compiled = [line for line in done.stderr.splitlines() if line.startswith("Finished XLA compilation of")]
    names = [line.split("jit(")[1].split(")")[0] for line in compiled if "jit(" in line]
    assert done.returncode == 0, done.stderr
    assert 0 < len(names) <= most, names
