"""Small ensembles, and a script that runs one in a new process:

    python tests/support/ensembles/ensemble_cases.py CASE OUT.npz [CHECKPOINT.h5] [PROCESSES ID PORT]

JAX_NUM_CPU_DEVICES in the environment says how many devices each process has.
"""

import sys
import time
from pathlib import Path

import jax
import numpy as np

import fitting
import rubberfric as rf

if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    if len(sys.argv) > 4:
        # After the imports, which must not begin to use devices, and before anything that does.
        jax.distributed.initialize(f"127.0.0.1:{sys.argv[6]}", int(sys.argv[4]), int(sys.argv[5]))
    sys.path[:0] = [str(Path(__file__).resolve().parents[i]) for i in (3, 2)]

from support.scenes import fits
from support.scenes.fits import E_INF, ROAD, E

QUADRATURE = rf.Quadrature(order=8, panels=4, graded=2, ratio=6.0)
MODULI = [5e8, 2e7, 2e6]  # [Pa]
TAU = [1e-7, 1e-4, 1e-1]  # [s]
SCENE = rf.Scene(ROAD, rf.Body(rf.Prony(3e6, MODULI, TAU)))
ROWS = ("x", "values", "cost", "status", "nfev", "njev")


def modulus_data():
    return fits.modulus_data(SCENE.upper.material, np.logspace(-2, 7, 12))


def modulus(starts=17, **options):
    """A storage and loss modulus: 24 values, 4 free parameters; far starts, which take many steps."""
    free = {E: fitting.Positive(), E_INF: fitting.Positive()}
    return fitting.multi_start(SCENE, modulus_data(), free, starts, jax.random.key(1), decades=2.0, **options)


def friction(starts=10):
    """A friction curve: 20 points, 4 free parameters."""
    data = fits.friction_data(SCENE, np.logspace(-4, 1, 20), quadrature=QUADRATURE)
    free = {E: fitting.Positive(), "lower.spectrum.hurst": fitting.Bounded(0.3, 1.0)}
    return fitting.multi_start(SCENE, data, free, starts, quadrature=QUADRATURE, max_steps=12)


def main(case, out, checkpoint=None, *processes):
    def callback(done, _):
        print(done, flush=True)
        if checkpoint is not None and not processes:
            time.sleep(0.05)  # so that a kill finds it at work

    members = {"modulus": modulus, "friction": friction}[case]()
    options = {"checkpoint": checkpoint, "every": 0, "resume": True, "batch": 2, "callback": callback}
    result = fitting.run_ensemble(members, **options)
    found = {name: getattr(result, name) for name in ROWS}
    if case == "friction":
        for prefix, devices in {"one": jax.devices()[:1], "two": jax.devices()[:2]}.items():
            other = fitting.run_ensemble(members, devices=devices, batch=3)
            found |= {f"{prefix}_{name}": getattr(other, name) for name in ROWS}
    np.savez(out, devices=result.devices, **found)


if __name__ == "__main__":
    main(*sys.argv[1:])
