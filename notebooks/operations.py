"""Count the operations and time the first calls of every kind of scene, and write operations.md.

    python notebooks/operations.py

It takes about five minutes.
"""

import os
import platform
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

import jax
import numpy as np

import rubberfric as rf

jax.config.update("jax_enable_x64", True)

FOLDER = Path(__file__).resolve().parent
PAGE = FOLDER / "operations.md"
TESTS = FOLDER.parent / "tests"
sys.path.insert(0, str(TESTS))

from support.counting.operations import costly, per_point  # noqa: E402
from support.scenes.kinds import PRESSURE, VELOCITY, scenes  # noqa: E402

HEADER = """# Cost of a scene

JAX does not trace the optional parts that a scene does not have. The table gives the number of operations in
the jaxpr for `rf.Quadrature()`. Operations that are done once for a scene and operations that are done for
each velocity are counted separately. The body of a loop is counted once.

- *Roots* are all elementwise operations that cost more than an addition: square roots, divisions, exp, log
  and erf. The closed form takes one square root and one division for each angular node (168) and Prony term.
- *Products* are the multiply-adds of matrix products.
- *First call* is the time to trace, compile and evaluate a curve of 50 velocities in a new process. It does
  not include the time to import the package ({imported}).
- *Gradient* is the corresponding time for the gradient of the curve with respect to every number of the
  scene. Later calls for scenes of the same structure compile nothing.
- *Again* is the time in a second process, which loads the functions that the first process compiled. Both
  processes have `JAX_COMPILATION_CACHE_DIR=<folder>` and `JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS=0` in
  the environment.

| {columns} |
|{rule}
"""
COLUMNS = (
    "scene",
    "quantity",
    "once: roots",
    "once: products",
    "each velocity: roots",
    "each velocity: products",
    "first call",
    "again",
    "gradient",
    "again",
)

FOOTER = """
`python notebooks/operations.py` generated this page on {machine}.
"""


FIRST = """
import sys, time
begin = time.perf_counter()
import jax
jax.config.update("jax_enable_x64", True)
import numpy as np, rubberfric as rf
imported = time.perf_counter() - begin
sys.path.insert(0, {tests!r})
from support.scenes.kinds import PRESSURE, VELOCITY, scenes  # noqa: E402
scene, T = scenes()[{name!r}]
jax.block_until_ready(jax.numpy.zeros(3) + 1)
begin = time.perf_counter()
jax.block_until_ready(rf.solve(scene, VELOCITY, PRESSURE, T, quantities=({quantity!r},)))
first = time.perf_counter() - begin
total = lambda s: getattr(rf.solve(s, VELOCITY, PRESSURE, T, quantities=({quantity!r},)), {quantity!r}).sum()
begin = time.perf_counter()
jax.block_until_ready(jax.jit(jax.grad(total))(scene))
print(imported, first, time.perf_counter() - begin)
"""


def first_calls(name, quantity, cache):
    """Return seconds of import, first curve and first gradient in a new process with `cache`."""
    script = FIRST.format(tests=str(TESTS), name=name, quantity=quantity)
    environment = os.environ | {
        "JAX_COMPILATION_CACHE_DIR": str(cache),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    }
    done = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True, env=environment
    )
    return tuple(map(float, done.stdout.split()))


def counts(scene, T, quantity):
    """Costly operations and multiply-adds, once and for each velocity."""

    def function(scene, velocity):
        return getattr(rf.solve(scene, velocity, PRESSURE, T, quantities=(quantity,)), quantity)

    each, once = per_point(function, VELOCITY, scene)
    return costly(once), once["multiply-add"], costly(each), each["multiply-add"]


def main():
    """Print the rows as they are measured, and write the page."""
    lines, imports = [], []
    for name, (scene, T) in scenes().items():
        for quantity in ("area", "friction", "separation"):
            once, products, each, each_products = counts(scene, T, quantity)
            with tempfile.TemporaryDirectory() as cache:
                imported, first, gradient = first_calls(name, quantity, cache)
                _, again, gradient_again = first_calls(name, quantity, cache)
            imports.append(imported)
            lines.append(
                f"| {name} | {quantity} | {once:.0f} | {products:.0f} | {each:.0f} | {each_products:.0f} "
                f"| {first:.2f} s | {again:.2f} s | {gradient:.2f} s | {gradient_again:.2f} s |"
            )
            print(lines[-1], flush=True)
    machine = f"{os.cpu_count()} cores, Python {platform.python_version()}, jax {version('jax')}, float64"
    head = HEADER.format(
        imported=f"{np.median(imports):.2f} s", columns=" | ".join(COLUMNS), rule="---|" * len(COLUMNS)
    )
    PAGE.write_text(head + "\n".join(lines) + "\n" + FOOTER.format(machine=machine), encoding="utf-8")


if __name__ == "__main__":
    main()
