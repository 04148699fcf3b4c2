"""The scenes of data in JAX's own setting, without double precision: finite, near float64, all of it float32.

    python tests/rubberfric/scene/test_without_x64.py [SCENE ...]

The ordinary run tests one scene in a new process; `.ci/versions single` tests all.
"""

import os
import subprocess
import sys
import warnings
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from rubberfric.io.files import read_computable

DATA = Path(__file__).resolve().parents[3] / "data"
# Largest relative error in single precision.
CLOSE = 2e-3
# Largest relative error with heat or adhesion, which iterate on differences of few digits.
FEW_DIGITS = 3e-2


def compare(name: str) -> str:
    """Compare values in both precisions, compute a gradient in single, and return a line."""
    scene, (v, p, T), _ = read_computable(DATA / f"{name}.toml")
    points = slice(None, None, max(1, v.size // 5))
    v, p, T = v[points], float(p[0]), None if T is None else float(T[0])
    assert not jax.config.jax_enable_x64
    quantities = rf.quantities_of(scene)
    found = rf.solve(scene, v, p, T, quantities=quantities)
    slopes: object = ()
    if scene.adhesion is None:  # whose gradient takes minutes to compile
        slopes = jax.grad(lambda scene: jnp.sum(rf.contact_area(scene, v, p, T)))(scene)
    with jax.enable_x64(True):
        expected = rf.solve(read_computable(DATA / f"{name}.toml")[0], v, p, T, quantities=quantities)
    worst = 0.0
    for quantity in quantities:
        single, double = getattr(found, quantity), np.asarray(getattr(expected, quantity))
        if single.dtype == bool:
            assert single.all(), quantity
            continue
        assert single.dtype == np.float32, quantity
        assert np.isfinite(single).all(), quantity
        worst = max(worst, float(np.max(np.abs(single - double)) / max(np.max(np.abs(double)), 1e-30)))
    for slope in jax.tree.leaves(slopes):
        assert slope.dtype == np.float32 and np.isfinite(slope).all()
    limit = FEW_DIGITS if scene.heating is not None or scene.adhesion is not None else CLOSE
    assert worst < limit, worst
    return f"{name}: at most {worst:.1e} off" + (", gradient finite" if slopes else "")


def test_one_scene_without_double_precision():
    """The setting of JAX here does not matter, because it is a new process."""
    environment = os.environ | {"JAX_ENABLE_X64": "0", "PYTHONPATH": str(DATA.parent)}
    done = subprocess.run(
        [sys.executable, __file__, "tread_on_asphalt"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "gradient finite" in done.stdout


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    scenes = sorted(path.stem for path in DATA.glob("*.toml") if not path.stem.endswith("_fit"))
    for scene_name in sys.argv[1:] or scenes:
        print(compare(scene_name), flush=True)
