"""Error against run time; off by default: python -m pytest -m benchmark -s

The same curve by vectorised NumPy trapezoids (200 q x 64 phi, the textbook method) is timed
in the same run, in turns with ours, so that the ratios survive a noisy machine.
"""

import subprocess
import sys
import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.special

import rubberfric as rf

pytestmark = pytest.mark.benchmark

TAU = 10.0 ** np.arange(-12, 1)
E = np.array([1.18e9, 8.2e8, 1.82e9, 7.6e8, 1.43e8, 4.5e7, 1.55e7, 6.5e6, 3.6e6, 2.2e6, 1.6e6, 1.1e6, 9.0e5])
TREAD = rf.Prony(3.6e6, E, TAU, 0.5)
TRACK = rf.Prony(2.0e6, 0.5 * E, 2.3 * TAU, 0.49)
ROAD = rf.SelfAffine(100.0, 1000.0, 3.1e4, 0.8, 5e-4)
WORN = rf.SelfAffine(150.0, 2000.0, 5.0e4, 0.8, 5e-5)
ONE = rf.Scene(rf.Body(TREAD), rf.Body(rf.Rigid(), ROAD))
TWO = rf.Scene(rf.Body(TREAD, WORN), rf.Body(TRACK, ROAD))
VELOCITY = np.logspace(-6, 1, 50)
PRESSURE = 0.15e6

SETTINGS = {
    "default": rf.Quadrature(),
    "error 1e-8": rf.Quadrature(order=10, panels=6, graded=3, ratio=6.0),
}
REFERENCE = rf.Quadrature(order=20, panels=24, graded=12, ratio=4.0, angular_order=24)


def numpy_friction(nodes_q=200, nodes_phi=64):
    """Uniform trapezoids in ln q and phi, all velocities at once."""
    q = np.geomspace(100.0, 3.1e4, nodes_q)
    phi = np.linspace(0, 2 * np.pi, nodes_phi, endpoint=False)
    omega = q[None, :, None] * VELOCITY[:, None, None] * np.cos(phi)
    modulus = np.full(omega.shape, 3.6e6, complex)
    for weight, tau in zip(E, TAU, strict=True):
        s = 1j * omega * tau
        modulus += weight * s / (1 + s)
    modulus /= 1 - 0.5**2
    roughness = q**4 * np.asarray(rf.power_spectrum(ROAD, q))
    step = 2 * np.pi / nodes_phi
    density = roughness / (8 * PRESSURE**2) * np.sum(abs(modulus) ** 2, -1) * step
    G = scipy.integrate.cumulative_trapezoid(density, np.log(q), axis=-1, initial=0.0)
    with np.errstate(divide="ignore"):
        P = scipy.special.erf(0.5 / np.sqrt(G))
    S = 0.5 + 0.5 * P**2
    integrand = roughness * S * P * np.sum(np.cos(phi) * modulus.imag, -1) * step / (2 * PRESSURE)
    return np.trapezoid(integrand, np.log(q), axis=-1)


def in_turns(functions, rounds=40):
    """Median times of several functions [s], called one after the other in every round."""
    times = {name: [] for name in functions}
    for function in functions.values():
        jax.block_until_ready(function())
    for _ in range(rounds):
        for name, function in functions.items():
            # The textbook method leaves cold caches behind: its successor is not the one to pay.
            for _ in range(1 if name == "numpy" else 4):
                begin = time.perf_counter()
                jax.block_until_ready(function())
                elapsed = time.perf_counter() - begin
            times[name].append(elapsed)
    return {name: float(np.median(values)) for name, values in times.items()}


@pytest.mark.parametrize("name", SETTINGS)
def test_friction_curve_and_gradient_against_numpy(name):
    quadrature = SETTINGS[name]

    def curve(scene):
        return rf.friction(scene, VELOCITY, PRESSURE, quadrature=quadrature)

    forward, gradient = jax.jit(curve), jax.jit(jax.grad(lambda scene: jnp.sum(curve(scene))))
    times = in_turns(
        {
            "numpy": numpy_friction,
            "one": lambda: forward(ONE),
            "one, gradient": lambda: gradient(ONE),
            "two": lambda: forward(TWO),
            "two, gradient": lambda: gradient(TWO),
        }
    )
    errors = {
        label: float(
            np.max(np.abs(forward(scene) / rf.friction(scene, VELOCITY, PRESSURE, quadrature=REFERENCE) - 1))
        )
        for label, scene in (("one", ONE), ("two", TWO))
    }
    numpy_error = np.max(np.abs(numpy_friction() / np.asarray(forward(ONE)) - 1))
    print(f"\n{name}: {quadrature}")
    print(f"  NumPy 200 x 64         {1e3 * times['numpy']:8.3f} ms, error {numpy_error:.1e}")
    for label in ("one", "one, gradient", "two", "two, gradient"):
        ratio = times["numpy"] / times[label]
        error = f", error {errors[label]:.1e}" if label in errors else ""
        print(f"  {label:22s} {1e3 * times[label]:8.3f} ms, NumPy / {ratio:.0f}{error}")
    print(f"  two / one              {times['two'] / times['one']:8.2f}")
    assert max(errors.values()) < 1e-8


@pytest.mark.parametrize("name", SETTINGS)
def test_friction_curve_against_its_bound(name):
    """The closed form cannot do with less than a root and a division for each node, term and velocity."""
    quadrature = SETTINGS[name]
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


def test_import_and_first_compiled_call():
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
    print(
        "\n"
        + subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True).stdout
    )


@pytest.mark.parametrize("scene", ["ONE", "TWO"])
def test_memory_of_a_hundred_thousand_points(scene):
    # In a process of its own: the largest resident set never falls again.
    script = (
        "import resource, jax; jax.config.update('jax_enable_x64', True)\n"
        "import jax.numpy as jnp, numpy as np, rubberfric as rf\n"
        f"from test_benchmarks import {scene} as scene\n"
        "rng = np.random.default_rng(0)\n"
        "v, p = 10.0 ** rng.uniform(-6, 1, 100_000), 10.0 ** rng.uniform(4, 6, 100_000)\n"
        "total = lambda s, v, p: sum(jnp.sum(x) for x in jax.tree.leaves(rf.solve(s, v, p)))\n"
        "f = jax.jit(jax.value_and_grad(total, (0, 1, 2)))\n"
        "jax.block_until_ready(f(scene, v, p))\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", script],
        check=True,
        capture_output=True,
        text=True,
        cwd=__file__.rpartition("/")[0],
    )
    used = float(result.stdout)
    print(f"\n{scene}: 1e5 points, all quantities and their gradient: {used:.2f} GiB at most")
    assert used < 2.0
