"""The table that the limits of `rubberfric.scene.settings.RULES` are read from.

python -m pytest -m benchmark -s tests/benchmarks/test_settings_table.py

For every setting the largest error of random scenes over L (down) and Lambda (across), see there. A limit is
where errors stay well below 1e-9; the scenes of `tests/rubberfric/scene/test_settings.py` are others.
"""

import itertools

import numpy as np
import pytest
from support.cases import sane

from rubberfric.scene.settings import WITH_SEPARATION, loads_of, span_of

pytestmark = pytest.mark.benchmark

SPANS = (0, 3, 6, 9, 12, 15, 18, 22, 26, 33, np.inf)
LOADS = (-np.inf, 0, 4, 6, 8, 10, 12, 16, 20, np.inf)


@pytest.mark.parametrize(("kind", "rough"), [("road", 1), ("elastic", 1), ("pair", 2)])
def test_errors_over_span_and_load(kind, rough):
    scenes, velocity, pressure = sane.draw(kind, 1200, seed=11)
    exact = sane.values(scenes, velocity, pressure, sane.TIGHT)
    span = np.array([span_of(one) for one in scenes])[:, None] + np.zeros(sane.POINTS)
    load = np.array([[loads_of(one, p)[0] for p in row] for one, row in zip(scenes, pressure, strict=True)])
    for setting, longest, least, largest in WITH_SEPARATION[rough]:
        error = sane.errors(scenes, velocity, pressure, setting, exact)
        within = (span <= longest) & (load >= least) & (load <= largest)
        print(f"\n{kind}: {setting}, {error[within].max():.1e}")
        print(f"to L = {longest:g}, Lambda = {least:g} ... {largest:g}")
        print(" " * 8, *(f"{low:8g}" for low in LOADS[:-1]))
        for low, high in itertools.pairwise(SPANS):
            row = [
                error[(span >= low) & (span < high) & (load >= first) & (load < last)]
                for first, last in itertools.pairwise(LOADS)
            ]
            print(f"{low:8g}", *(f"{cell.max():8.0e}" if cell.size else " " * 8 for cell in row))
        assert error[within].max() < 1e-9
