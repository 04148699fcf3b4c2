"""Measure the errors of numbers of panels, over the range of the roughness and the load.

    python notebooks/benchmarks/settings.py

The constants of `rubberfric.scene.settings` are read from this table. For every number of panels it has the
largest error of random scenes over L (down) and Lambda (across). The scenes of
`tests/rubberfric/scene/test_settings.py` are others.
"""

import itertools
import sys
import warnings
from pathlib import Path

import jax
import numpy as np

import rubberfric as rf
from rubberfric.scene.settings import extent_of

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from support.cases import sane

jax.config.update("jax_enable_x64", True)
# Some random surfaces are steeper than real ones.
warnings.simplefilter("ignore", rf.UnitWarning)

SPANS = (0, 3, 6, 9, 12, 15, 18, 22, 26, 33, np.inf)
LOADS = (-np.inf, 0, 4, 6, 8, 10, 12, 16, 20, np.inf)


def errors_over_range_and_load(kind):
    """Print the largest error of random scenes, a table for each number of panels."""
    scenes, velocity, pressure = sane.draw(kind, 1200, seed=11)
    exact = sane.values(scenes, velocity, pressure, sane.TIGHT)
    extents = [extent_of(scene, p) for scene, p in zip(scenes, pressure, strict=True)]
    length = np.array([extent.length for extent in extents])
    load = np.array([extent.heaviest for extent in extents])
    worst = []
    for panels in (4, 6, 8, 12, 17, 24):
        setting = rf.Quadrature(order=13, panels=panels, graded=12, angular_order=12)
        error = sane.errors(scenes, velocity, pressure, setting, exact).max(1)
        print(f"\n{kind}: {setting}")
        print(" " * 8, *(f"{low:8g}" for low in LOADS[:-1]))
        for low, high in itertools.pairwise(SPANS):
            row = [
                error[(length >= low) & (length < high) & (load >= first) & (load < last)]
                for first, last in itertools.pairwise(LOADS)
            ]
            print(f"{low:8g}", *(f"{cell.max():8.0e}" if cell.size else " " * 8 for cell in row))
        worst.append(np.mean(error > 1e-9))
    assert worst == sorted(worst, reverse=True) and worst[-1] < 0.01


if __name__ == "__main__":
    for solids in ("road", "elastic", "pair"):
        errors_over_range_and_load(solids)
