"""The leak against the flow through gaps of boundary elements: notebooks/leak_elements.csv.

The flow solver is compared with closed forms here. One slow test computes a row of the table again.
"""

import csv
import itertools

import numpy as np
import pytest
from support.folders import ROOT
from support.oracles.reynolds_flow import flow_tensor
from support.processes.notebooks import script

from rubberfric.applications import leak_conductivity

# Limits of the intervals of A/A0 in the documentation.
AREAS = (0.04, 0.08, 0.14, 0.2, 0.28, 0.33)
# Columns of this table.
HURSTS = (0.5, 0.7, 0.9)
BREADTHS = (6, 8, 16, 32)


def test_flow_through_stripes():
    """Stripes in parallel add their cubes, and stripes in series the inverse cubes."""
    gap = np.where(np.arange(12)[:, None] % 4 < 2, 1.0, 3.0) * np.ones((12, 12))
    found = flow_tensor(gap)
    np.testing.assert_allclose(found, np.diag([2 / (1 + 1 / 27), (1 + 27) / 2]), atol=1e-12)
    arithmetic = flow_tensor(gap, "arithmetic")
    series = 4 / (1 + 1 / 27 + 2 / 14)  # in a period: two faces within a stripe and two between stripes
    np.testing.assert_allclose(arithmetic, np.diag([series, 14.0]), atol=1e-12)


def test_flow_around_contact():
    """A few square contacts of the share c reduce the flow by 2.19 c (a circle by 2 c); a wall ends it."""
    gap = np.ones((96, 96))
    gap[:8, :8] = 0.0
    share = np.mean(gap == 0)
    found = flow_tensor(gap)
    assert (1 - found[0, 0]) / share == pytest.approx(2.19, rel=0.05)
    assert found[0, 0] == pytest.approx(found[1, 1], rel=1e-12)
    gap[40] = 0.0
    wall = flow_tensor(gap)
    assert abs(wall[0, 0]) < 1e-12
    assert wall[1, 1] > 0.9


def rows():
    with (ROOT / "notebooks" / "leak_elements.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def flow(row, faces):
    """Return K of the flow [m^3], the mean over both directions."""
    return sum(float(row[f"{faces}_{axis}"]) for axis in "xy") / 24


def compared():
    """Return arrays (theory / flow, A/A0, H, q1/q0, half of the difference of both flows) for each part."""
    module, groups = script("leak_elements"), {}
    for row in rows():
        shape = tuple(float(row[name]) for name in ("ratio", "rolloff", "hurst"))
        groups.setdefault((row["part"], *shape), []).append(row)
    found = {"choice": [], "new": []}
    for (part, *shape), group in groups.items():
        K = leak_conductivity(module.scene_of(*shape), [float(row["pressure"]) for row in group])
        for row, one in zip(group, np.asarray(K), strict=True):
            harmonic, arithmetic = (flow(row, faces) for faces in ("harmonic", "arithmetic"))
            ratio = one / np.sqrt(harmonic * arithmetic)
            error = 0.5 * np.log(arithmetic / harmonic)
            found[part].append((ratio, float(row["area"]), shape[2], shape[0], error))
    return {part: np.array(values) for part, values in found.items()}


def lines(values):
    """Return the lines of the table of the documentation."""
    ratio, area, hurst, breadth, error = values.T
    for low, high in itertools.pairwise(AREAS):
        inside = (area >= low) & (area < high)
        cells = [f"| {low:g} to {high:g} | ±{100 * error[inside].mean():.0f} % "]
        for chosen in [hurst == H for H in HURSTS] + [breadth == one for one in BREADTHS]:
            some = ratio[inside & chosen]
            low_high = f"{some.min():.2f} to {some.max():.2f}" if some.size > 1 else f"{some[0]:.2f}"
            cells.append(f"| {low_high} ")
        yield "".join(cells) + "|"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::rubberfric.UnitWarning")
def test_theory_and_flow():
    """notebooks/how_true.md has the ratios of theory and flow."""
    found = compared()
    assert [len(values) for values in found.values()] == [35, 65]
    text = (ROOT / "notebooks" / "how_true.md").read_text(encoding="utf-8")
    assert [line for line in lines(found["new"]) if line not in text] == []
    for values in found.values():
        assert np.sqrt(np.mean(np.log(values[:, 0]) ** 2)) < 0.28
    ratio, area = found["new"].T[:2]
    light = area < 0.14
    assert ratio[light].min() > 0.75
    assert ratio[light].max() < 1.5
    assert ratio.min() > 0.54
    assert ratio.max() < 1.7


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::rubberfric.UnitWarning")
def test_a_row_again():
    module = script("leak_elements")
    row = next(one for one in rows() if one["key"] == "1003")
    again = module.computed(row["part"], 6, 1, 0.5, 512, 1003, 0.12)
    for name in ("area", "separation", *module.FLOWS):
        assert float(again[name]) == pytest.approx(float(row[name]), rel=2e-3), name
