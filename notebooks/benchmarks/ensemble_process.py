"""Measure an ensemble of twin fits in a new process, and print a line of JSON:

    python notebooks/benchmarks/ensemble_process.py ensemble|loop|parts MEMBERS [float32]

The members are bootstrap fits of the twin measurements (240 points, 20 parameters), from the
minimum. JAX_NUM_CPU_DEVICES in the environment says how many devices a processor is.
"""

import dataclasses
import json
import resource
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

# Before the imports that make arrays.
SINGLE = "float32" in sys.argv
jax.config.update("jax_enable_x64", not SINGLE)
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from support.ensembles.twin import FREE, TRUTH, twin  # noqa: E402
from support.jacobians import residuals, residuals_and_jacobian  # noqa: E402

import fitting  # noqa: E402
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt  # noqa: E402
from fitting.solvers.runs import run_fits  # noqa: E402


def peak():
    """Return the largest memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def bootstrap(count):
    return fitting.bootstrap_members(fitting.fit(TRUTH, twin(), FREE), count)


def ensemble(count):
    """Measure the whole ensemble without compilation, and its memory in excess of a first run."""
    members = bootstrap(count)
    fitting.run_ensemble(dataclasses.replace(members, max_steps=1))
    before = peak()
    result = fitting.run_ensemble(members)
    return {
        "seconds": result.seconds,
        "failed": int(result.failed.size),
        "steps": int(result.njev.sum()),
        "evaluations": int(result.nfev.sum()),
        "batch": result.batch,
        "stated MB": result.peak * len(jax.devices()) / 1e6,
        "grown MB": peak() - before,
        "cost": float(np.mean(result.cost)),
    }


def loop(count):
    """Measure single fits, one after the other, without compilation."""
    members = bootstrap(count)
    seconds, steps, costs = 0.0, 0, []
    for i in range(-1, count):  # the first compiles
        targets = jax.tree.map(lambda a, i=i: a[min(max(i, 0), len(a) - 1)][None], members.targets)
        begin = time.perf_counter()
        end = run_fits(LevenbergMarquardt(), members.problem, members.starts[:1], targets, batch=1)
        if i >= 0:
            seconds += time.perf_counter() - begin
            steps += int(end.njev[0])
            costs.append(float(end.cost[0]))
    return {"seconds": seconds, "steps": steps, "cost": float(np.mean(costs))}


def parts(count):
    """Return seconds per member of Jacobian, residuals and decomposition, by name.

    All devices are busy, each with `count` members. A CPU computes one member after the other, an accelerator
    one batch, as in `fitting.solvers.devices`.
    """
    members = bootstrap(1)
    problem, devices = members.problem, jax.devices()
    targets = jax.tree.map(jnp.asarray, problem.targets)
    serial = devices[0].platform == "cpu"
    x = members.starts[0] + 0.01 * np.random.default_rng(0).standard_normal((len(devices), count, 20))
    x = x.astype(problem.start.dtype)
    rows = residuals_and_jacobian(problem.structure, problem.numbers, targets, jnp.asarray(x[0, 0]))[1]
    arguments = {
        "jacobian": (lambda x: residuals_and_jacobian(problem.structure, problem.numbers, targets, x), x),
        "residuals": (lambda x: residuals(problem.structure, problem.numbers, targets, x), x),
        "decomposition": (
            lambda a: jnp.linalg.svd(a, full_matrices=False),
            np.broadcast_to(np.asarray(rows), (len(devices), count, *rows.shape)),
        ),
    }
    seconds = {}
    for name, (function, inputs) in arguments.items():
        program = jax.jit(lambda a, f=function: jax.lax.map(f, a) if serial else jax.vmap(f)(a))
        inputs = [jax.device_put(part, device) for part, device in zip(inputs, devices, strict=True)]
        jax.block_until_ready([program(part) for part in inputs])
        times = []
        for _ in range(3):
            begin = time.perf_counter()
            jax.block_until_ready([program(part) for part in inputs])
            times.append(time.perf_counter() - begin)
        seconds[name] = min(times) / count / len(devices)
    return seconds


if __name__ == "__main__":
    what, count = sys.argv[1], int(sys.argv[2])
    known = {"devices": len(jax.devices()), "platform": jax.devices()[0].device_kind, "members": count}
    print(json.dumps(known | {"ensemble": ensemble, "loop": loop, "parts": parts}[what](count)))
