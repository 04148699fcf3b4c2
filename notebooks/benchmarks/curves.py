"""Measure error against run time of friction curves, their memory, and maps of a million points.

    python notebooks/benchmarks/curves.py

Vectorised trapezoidal rules in NumPy (200 q x 64 phi, the textbook method) are timed in the same run, in
turns with rubberfric, so that the ratios survive a noisy machine.
"""

import subprocess
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from scenes import ONE, PRESSURE, TAU, TWO, VELOCITY, E, numpy_friction
from turns import in_turns

import rubberfric as rf

jax.config.update("jax_enable_x64", True)

FOLDER = Path(__file__).resolve().parent
SETTINGS = {
    "automatic": None,  # as calls have it whose scene is known
    "any scene": rf.Quadrature(),  # as traced scenes have it
    "error 1e-8": rf.Quadrature(order=10, panels=6, graded=3, ratio=6.0),
}
REFERENCE = rf.Quadrature(order=20, panels=24, graded=12, ratio=4.0, angular_order=24)


def against_numpy(name):
    """Print times and errors of a friction curve and its gradient, in units of the time of NumPy."""
    settings = [SETTINGS[name] or rf.analysis.default_quadrature(scene, PRESSURE) for scene in (ONE, TWO)]

    def compiled(quadrature):
        def curve(scene):
            return rf.friction(scene, VELOCITY, PRESSURE, quadrature=quadrature)

        return jax.jit(curve), jax.jit(jax.grad(lambda scene: jnp.sum(curve(scene))))

    (one, one_gradient), (two, two_gradient) = map(compiled, settings)
    times = in_turns(
        {
            "numpy": numpy_friction,
            "one": lambda: one(ONE),
            "one, gradient": lambda: one_gradient(ONE),
            "two": lambda: two(TWO),
            "two, gradient": lambda: two_gradient(TWO),
        }
    )
    errors = {
        label: float(
            np.max(np.abs(forward(scene) / rf.friction(scene, VELOCITY, PRESSURE, quadrature=REFERENCE) - 1))
        )
        for label, scene, forward in (("one", ONE, one), ("two", TWO, two))
    }
    numpy_error = np.max(np.abs(numpy_friction() / np.asarray(one(ONE)) - 1))
    print(f"\n{name}: {settings[0]}, two: {settings[1]}")
    print(f"  NumPy 200 x 64         {1e3 * times['numpy']:8.3f} ms, error {numpy_error:.1e}")
    for label in ("one", "one, gradient", "two", "two, gradient"):
        ratio = times["numpy"] / times[label]
        error = f", error {errors[label]:.1e}" if label in errors else ""
        print(f"  {label:22s} {1e3 * times[label]:8.3f} ms, NumPy / {ratio:.0f}{error}")
    print(f"  two / one              {times['two'] / times['one']:8.2f}")
    assert max(errors.values()) < 1e-8


def against_its_bound(name):
    """Print times in units of a root and a division for each node, term and velocity of the closed form."""
    quadrature = SETTINGS[name] or rf.analysis.default_quadrature(ONE, PRESSURE)
    q = jnp.geomspace(100.0, 3.1e4, quadrature.panels * quadrature.angular_order)

    def bound(q, velocity, tau, modulus):
        a = velocity[:, None] * q * tau[:, None, None]
        return jnp.sum(modulus[:, None, None] / jnp.sqrt(1 + a * a), 0)

    def curve(scene):
        return rf.friction(scene, VELOCITY, PRESSURE, quadrature=quadrature)

    bound, forward, gradient = map(jax.jit, (bound, curve, jax.grad(lambda scene: jnp.sum(curve(scene)))))
    arguments = [jnp.asarray(x) for x in (q, VELOCITY, TAU, E)]
    times = in_turns(
        {"bound": lambda: bound(*arguments), "curve": lambda: forward(ONE), "gradient": lambda: gradient(ONE)}
    )
    print(f"\n{name}: {q.size} nodes x {TAU.size} terms x {VELOCITY.size} velocities")
    for label, seconds in times.items():
        print(f"  {label:10s} {1e3 * seconds:8.3f} ms, bound x {seconds / times['bound']:.2f}")
    assert times["bound"] < times["curve"] < times["gradient"] < 10 * times["curve"]


def import_and_first_call():
    """Print the time of the import and of a first compiled call in a new process."""
    script = (
        "import time; t = time.perf_counter()\n"
        "import jax; jax.config.update('jax_enable_x64', True)\n"
        "import numpy as np, rubberfric as rf\n"
        "t1 = time.perf_counter()\n"
        "tread = rf.Prony(3.6e6, 10.0 ** np.linspace(9, 5, 13), 10.0 ** np.arange(-12, 1))\n"
        "road = rf.SelfAffine(100.0, 1000.0, 3.1e4, 0.8, 5e-4)\n"
        "scene = rf.Scene(rf.Body(tread), rf.Body(rf.Rigid(), road))\n"
        "rf.friction(scene, np.logspace(-6, 1, 50), 0.15e6).block_until_ready()\n"
        "print(f'import {t1 - t:.2f} s, import + first call {time.perf_counter() - t:.2f} s')\n"
    )
    done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    print(f"\n{done.stdout.rstrip()}")
    assert float(done.stdout.split()[-2]) < 10


def memory_of_a_hundred_thousand_points(name):
    """Print the largest memory of all quantities and their gradient, in a new process."""
    script = (
        f"import sys; sys.path.insert(0, {str(FOLDER)!r})\n"
        "import resource, jax; jax.config.update('jax_enable_x64', True)\n"
        "import jax.numpy as jnp, numpy as np, rubberfric as rf\n"
        f"from scenes import {name} as scene\n"
        "rng = np.random.default_rng(0)\n"
        "v, p = 10.0 ** rng.uniform(-6, 1, 100_000), 10.0 ** rng.uniform(4, 6, 100_000)\n"
        "total = lambda s, v, p: sum(jnp.sum(x) for x in jax.tree.leaves(rf.solve(s, v, p)))\n"
        "f = jax.jit(jax.value_and_grad(total, (0, 1, 2)))\n"
        "jax.block_until_ready(f(scene, v, p))\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    used = float(done.stdout)
    print(f"\n{name}: 1e5 points, all quantities and their gradient: {used:.2f} GiB at most")
    assert used < 2.0


def map_of_a_million_points(velocities, pressures, temperatures):
    """Print the time of a map read off one curve, against every point computed, after one call of each."""
    at = (
        np.logspace(-8, 2, velocities),
        np.geomspace(1e4, 1e7, pressures),
        np.linspace(263.15, 353.15, temperatures),
    )
    scene = ONE.replace("lower.material.shift", rf.WLF(8.0, 100.0, 293.15))
    seconds, maps = [], []
    for interpolate in (True, False):
        for _ in range(2):
            begin = time.process_time()
            maps.append(rf.friction_map(scene, *at, interpolate=interpolate))
            seconds.append(time.process_time() - begin)
    error = np.max(np.abs(maps[1].solution.friction / maps[3].solution.friction - 1))
    ratio = seconds[3] / seconds[1]
    print(f"\n{maps[1].interpolation}: {seconds[1]:.3f} s, / {ratio:.0f}, error {error:.1e}")
    assert error < 1e-9 and seconds[1] < 0.25 and ratio > 10


if __name__ == "__main__":
    for setting in SETTINGS:
        against_numpy(setting)
        against_its_bound(setting)
    import_and_first_call()
    for scene in ("ONE", "TWO"):
        memory_of_a_hundred_thousand_points(scene)
    map_of_a_million_points(1000, 20, 50)
    map_of_a_million_points(1000, 1, 1000)
