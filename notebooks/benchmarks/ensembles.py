"""Measure rates of ensembles of twin fits.

    python notebooks/benchmarks/ensembles.py

Each core of a CPU is a device, which runs one fit after the other. An accelerator runs all fits in one batch.
MEMBERS in the environment sets the size of the ensemble, and LARGEST the size of the largest ensemble.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

from rubberfric.base import cores

PROGRAM = Path(__file__).resolve().with_name("ensemble_process.py")
CORES = cores()
MEMBERS = int(os.environ.get("MEMBERS", 256))
LARGEST = int(os.environ.get("LARGEST", 1000))
LOOP = 16  # single fits that are enough to know their rate
POINTS = 240  # points of the friction curves of a member
PARAMETERS = 20  # free parameters of a member


def measured(what, members, *options, devices=CORES):
    """Return the output of `ensemble_process.py`."""
    environment = os.environ | {"JAX_NUM_CPU_DEVICES": str(devices)}
    command = [sys.executable, str(PROGRAM), what, str(members), *options]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def rate_against_a_loop_and_the_limit(precision):
    """Print the rates of an ensemble and of a loop of single fits, and the parts of a step."""
    parts = measured("parts", 16, precision)
    loop = measured("loop", LOOP, precision, devices=1)
    ensemble = measured("ensemble", MEMBERS, precision)
    jacobian, residuals = parts["jacobian"], parts["residuals"]
    step, single = ensemble["seconds"] / ensemble["steps"], loop["seconds"] / loop["steps"]
    rates = [run["members"] / run["seconds"] for run in (ensemble, loop)]
    limit = loop["seconds"] / loop["members"] / (jacobian * ensemble["steps"] / ensemble["members"])
    print(f"\n{precision}, {ensemble['devices']} x {ensemble['platform']}")
    print(f"  forward     {POINTS / residuals:12.4g} points/s")
    print(f"  derivatives {POINTS * PARAMETERS / jacobian:12.4g} points x parameters/s")
    print(f"  decomposition of a Jacobian {1e3 * parts['decomposition']:.3g} ms")
    print(f"  ensemble of {MEMBERS}: {rates[0]:.3g} fits/s, {1e3 * step:.3g} ms a step, ", end="")
    print(f"{ensemble['steps'] / MEMBERS:.1f} steps a fit, {ensemble['failed']} failed")
    print(f"  loop of single fits: {rates[1]:.3g} fits/s, {1e3 * single:.3g} ms a step, ", end="")
    print(f"{loop['steps'] / LOOP:.1f} steps a fit")
    print(f"  ratio {rates[0] / rates[1]:.2f}; with Jacobians alone, the limit, it were {limit:.2f}")
    print(f"  of a step the Jacobian is {100 * jacobian / step:.0f} %, four residuals are ", end="")
    print(f"{400 * residuals / step:.0f} %, decomposition {100 * parts['decomposition'] / step:.1f} %")
    assert ensemble["failed"] <= 0.02 * MEMBERS
    assert rates[0] / rates[1] >= min(20.0, 0.4 * limit)


def growth_over_members():
    """Print time and memory over the number of members."""
    print(
        f"\n{'members':>8s} {'seconds':>9s} {'fits/s':>8s} {'batch':>6s} {'stated MB':>10s} {'grown MB':>9s}"
    )
    size = 1
    while size <= LARGEST:
        run = measured("ensemble", size)
        print(
            f"{size:8d} {run['seconds']:9.2f} {size / run['seconds']:8.3g} {run['batch']:6d}"
            f" {run['stated MB']:10.1f} {run['grown MB']:9.1f}"
        )
        # Members themselves, on the host: starts, data and their copies of a step.
        assert run["grown MB"] <= run["stated MB"] + 50 + 0.02 * size
        size *= 10


if __name__ == "__main__":
    for dtype in ("float64", "float32"):
        rate_against_a_loop_and_the_limit(dtype)
    growth_over_members()
