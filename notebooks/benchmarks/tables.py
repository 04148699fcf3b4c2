"""Measure the cost of a tabulated modulus relative to a Prony series.

    python notebooks/benchmarks/tables.py

A friction curve of 50 velocities with a table of 100 entries is compared with the same curve with the 13
Prony terms that the table is made of. Times are the least of many calls in turns. First calls are CPU seconds
of new processes. Errors are against a finer quadrature.
"""

import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from scenes import ONE, PRESSURE, ROAD, TREAD, VELOCITY
from turns import least

import rubberfric as rf

jax.config.update("jax_enable_x64", True)

FOLDER = Path(__file__).resolve().parent
OMEGA = np.geomspace(1e-1, 1e13, 100)


def tabulated(series):
    """Return a body with a table of a series."""
    entries = np.asarray(rf.complex_modulus(series, OMEGA))
    return rf.Body(rf.TabulatedModulus(OMEGA, entries.real, entries.imag, series.poisson))


SCENES = {"series": ONE, "table": rf.Scene(tabulated(TREAD), rf.Body(rf.Rigid(), ROAD))}


def curve(scene, velocity=VELOCITY, quadrature=None):
    return rf.friction(scene, velocity, PRESSURE, quadrature=quadrature)


def calls(scene):
    """Return the timed functions by name."""
    velocity, many = jnp.asarray(VELOCITY), jnp.logspace(-6, 1, 10_000)
    closed = jax.jit(lambda velocity: curve(scene, velocity))
    traced, gradient = jax.jit(curve), jax.jit(jax.grad(lambda scene: jnp.sum(curve(scene))))
    return {
        "closed over in jit": lambda: closed(velocity),
        "an argument of jit": lambda: traced(scene),
        "a plain call": lambda: curve(scene),
        "gradient by all entries": lambda: gradient(scene),
        "10 000 velocities, closed over": lambda: closed(many),
    }


def curve_and_gradient():
    """Print the times of curves and gradients of both scenes, and the error with a table."""
    functions = {(name, call): f for name, scene in SCENES.items() for call, f in calls(scene).items()}
    times = least(functions)
    print()
    for call in dict.fromkeys(call for _, call in times):
        series, table = times["series", call], times["table", call]
        print(f"{call:32s} series {1e3 * series:7.3f} ms, table {1e3 * table:7.3f} ms: {table / series:.2f}")
    for name in SCENES:
        slope, value = times[name, "gradient by all entries"], times[name, "an argument of jit"]
        print(f"{name}: gradient = {slope / value:.2f} x the curve, the scene an argument of jit in both")
    fine = rf.Quadrature(order=16, panels=24, graded=12, ratio=4.0, angular_order=20)
    scene = SCENES["table"]
    error = np.max(np.abs(curve(scene) / curve(scene, quadrature=fine) - 1))
    print(f"error of the table's curve {error:.1e}")
    assert error < 1e-9


FIRST = """
import sys, time
sys.path.insert(0, sys.argv[3])
import jax
jax.config.update("jax_enable_x64", True)
import jax.numpy as jnp
from tables import SCENES, calls
jax.block_until_ready(jnp.zeros(3) + 1)
call = calls(SCENES[sys.argv[1]])[sys.argv[2]]
begin = time.process_time()
jax.block_until_ready(call())
print(time.process_time() - begin)
"""


def first_call(name, call):
    """Return CPU seconds of the first call in a new process, without the import."""
    done = subprocess.run(
        [sys.executable, "-c", FIRST, name, call, str(FOLDER)], check=True, capture_output=True, text=True
    )
    return float(done.stdout)


def first_calls(call):
    """Print CPU seconds of the first call of both scenes, the least of three processes."""
    series, table = (min(first_call(name, call) for _ in range(3)) for name in SCENES)
    print(f"\nfirst call, {call}: series {series:.2f} s, table {table:.2f} s CPU = {table / series:.2f} x")
    assert table < 5 * series


if __name__ == "__main__":
    curve_and_gradient()
    for kind in ("a plain call", "closed over in jit", "gradient by all entries"):
        first_calls(kind)
