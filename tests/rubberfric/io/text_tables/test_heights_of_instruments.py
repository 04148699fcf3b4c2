"""Counters, decreasing positions, units and separators at the ends of rows, in files of heights."""

import numpy as np
import pytest
from support.exports import put
from support.refusals import refused

import rubberfric as rf

HEIGHTS = np.round(np.random.default_rng(2).normal(size=(40, 3)), 4)


def table(titles, columns, separator=",", end=""):
    rows = [separator.join(f"{value:.10g}" for value in row) for row in np.column_stack(columns)]
    return "\n".join(row + end for row in [titles.replace(",", separator), *rows]) + "\n"


@pytest.mark.parametrize(
    "titles",
    [
        "x [um],z1 [nm],z2 [nm]",
        "s (µm),z1 (nm),z2 (nm)",
        "Point [um],z1 [nm],z2 [nm]",
        "No.,z1,z2\num,nm,nm",
    ],
)
def test_positions_that_rise_by_one_unit_are_no_counter(tmp_path, titles):
    x, heights = rf.io.read_traces(put(tmp_path, table(titles, [np.arange(1, 41), HEIGHTS[:, :2]])))
    np.testing.assert_allclose(x, 1e-6 * np.arange(1, 41), rtol=1e-14)
    np.testing.assert_allclose(heights, 1e-9 * HEIGHTS[:, :2].T, rtol=1e-14)


@pytest.mark.parametrize("title", ["x", "X", "Position", "Weg", "Abstand"])
def test_positions_without_a_unit_are_refused(tmp_path, title):
    path = put(tmp_path, table(f"{title},z1 [nm],z2 [nm]", [np.arange(1, 41), HEIGHTS[:, :2]]))
    assert f"column 1 '{title}': unit '{title}': must be one of" in refused(
        path, lambda: rf.io.read_traces(path)
    )


@pytest.mark.parametrize("titles", ["No.,x [mm],z [nm]", "Point,x,z\n-,mm,nm"])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_counter_before_the_positions_is_skipped(tmp_path, titles, direction):
    steps = np.arange(40)[::direction]
    x, heights = rf.io.read_traces(
        put(tmp_path, table(titles, [np.arange(1, 41), 0.5 * steps, HEIGHTS[:, 0]]))
    )
    np.testing.assert_allclose(x, 0.5e-3 * np.arange(40), rtol=1e-14)
    np.testing.assert_allclose(heights, 1e-9 * HEIGHTS[None, ::direction, 0], rtol=1e-14)
    path = put(tmp_path, table("No.,x [mm],z [in]", [np.arange(1, 41), 0.5 * steps, HEIGHTS[:, 0]]))
    assert "column 3 'z [in]': unit 'in'" in refused(path, lambda: rf.io.read_traces(path))


def test_decreasing_positions(tmp_path):
    """Dropouts of parabolas become means of their neighbours, which are off by h'' dx^2 / 2."""
    x = np.arange(60.0)
    z = np.stack([0.01 * x**2, 30 - 0.02 * x**2])
    z[0, [7, 30]] = z[1, 41] = np.nan
    read = []
    for order in (slice(None), slice(None, None, -1)):
        path = put(tmp_path, table("x [um],a [um],b [um]", [x[order], z.T[order]]))
        with pytest.warns(UserWarning, match=r"2\.5% of the heights are dropouts"):
            read.append(rf.io.read_traces(path))
    np.testing.assert_allclose(read[1][0], 1e-6 * x, rtol=1e-12)
    np.testing.assert_allclose(read[1][1], read[0][1], rtol=1e-12)
    np.testing.assert_allclose(read[1][1], 1e-6 * np.stack([0.01 * x**2, 30 - 0.02 * x**2]), atol=2.1e-8)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("ends", [1, 2])
def test_separators_at_the_ends_of_rows(tmp_path, separator, ends):
    """Also only of the numbers, and in a grid with a row of holes."""
    columns, end = [0.1 * np.arange(40), HEIGHTS], separator * ends
    text = table("x [mm],a [um],b [um],c [nm]", columns, separator, end)
    head, rows = text.split("\n", 1)
    shorter = rows.replace(f"{end}\n", "\n")
    for titled in (text, f"{head.rstrip(separator)}\n{rows}", f"{head}\n{shorter}"):
        x, heights = rf.io.read_traces(put(tmp_path, titled))
        np.testing.assert_allclose(x, 1e-4 * np.arange(40), rtol=1e-12)
        np.testing.assert_allclose(heights.T, HEIGHTS * [1e-6, 1e-6, 1e-9], rtol=1e-12)
    wide = HEIGHTS.reshape(8, 15)
    rows = [separator.join(map(str, row)) + end for row in wide]
    surface = rf.io.read_heights(put(tmp_path, "\n".join(rows)), 1e-6, "um")
    np.testing.assert_allclose(surface.heights, 1e-6 * wide, rtol=1e-12)
    assert surface.holes == 0
    rows[3] = "n/a" + separator * 14 + end
    surface = rf.io.read_heights(put(tmp_path, "\n".join(rows)), 1e-6, "um")
    assert surface.heights.shape == (8, 15) and surface.holes == pytest.approx(1 / 8)
    points = [[i, k, wide[i, k]] for i in range(8) for k in range(15)]
    text = table("x [um],y [um],z [um]", [np.array(points)], separator, end)
    surface = rf.io.read_heights(put(tmp_path, text))
    np.testing.assert_allclose(surface.heights, 1e-6 * wide, rtol=1e-12)


def test_an_empty_last_height_of_some_rows_is_a_hole(tmp_path):
    rows = [",".join(map(str, row)) for row in HEIGHTS.reshape(8, 15)]
    rows[2] = rows[2][: rows[2].rindex(",") + 1]
    surface = rf.io.read_heights(put(tmp_path, "\n".join(rows)), 1e-6, "um")
    assert surface.heights.shape == (8, 15) and surface.holes == pytest.approx(1 / 120)


@pytest.mark.parametrize(
    ("unit", "length"), [("cm", 1e-2), ("mm", 1e-3), ("µm", 1e-6), ("pm", 1e-12), ("Å", 1e-10)]
)
def test_units_of_lengths(tmp_path, unit, length):
    """They are the ones of topography objects."""
    path = put(tmp_path, table(f"x [{unit}],z [{unit}]", [np.arange(40), HEIGHTS[:, 0]]))
    x, heights = rf.io.read_traces(path)
    np.testing.assert_allclose(x, length * np.arange(40), rtol=1e-12)
    np.testing.assert_allclose(heights[0], length * HEIGHTS[:, 0], rtol=1e-12)
    surface = rf.io.read_heights(put(tmp_path, "1 2\n3 4\n"), 1e-6, unit)
    np.testing.assert_allclose(surface.heights, length * np.array([[1, 2], [3, 4]]), rtol=1e-12)
