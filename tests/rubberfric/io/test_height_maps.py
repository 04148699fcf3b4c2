"""Height maps of instruments: x, y, z, and grids, with holes."""

import numpy as np
import pytest

import rubberfric as rf
from rubberfric.io.height_maps import filled

SHAPE, DX, DY = (24, 17), 2e-6, 3e-6


@pytest.fixture
def heights():
    x, y = np.meshgrid(DX * np.arange(SHAPE[0]), DY * np.arange(SHAPE[1]), indexing="ij")
    return 1e-6 * np.sin(2 * np.pi * x / 20e-6) * np.cos(2 * np.pi * y / 30e-6)


def xyz(heights, separator=";", comma=True):
    rows = ["x [µm];y [µm];z [nm]"]
    for (i, k), z in np.ndenumerate(heights):
        rows.append(f"{1e6 * i * DX:.4f};{1e6 * k * DY:.4f};{'' if np.isnan(z) else f'{1e9 * z:.6f}'}")
    text = "\n".join(rows) + "\n"
    return (text.replace(".", ",") if comma else text).replace(";", separator)


def test_three_columns_in_any_order(tmp_path, heights):
    head, *rows = xyz(heights).splitlines()
    np.random.default_rng(1).shuffle(rows)
    (tmp_path / "map.xyz").write_text("\n".join(["Instrument;A;1", head, *rows]), encoding="utf-8")
    found = rf.io.read_heights(tmp_path / "map.xyz")
    np.testing.assert_allclose(found.heights, heights, atol=1e-15)
    np.testing.assert_allclose([found.dx, found.dy, found.holes], [DX, DY, 0.0], rtol=1e-9)


def test_a_grid_with_holes(tmp_path, heights):
    spoiled = heights.copy()
    spoiled[3, 4] = spoiled[10:12, 7] = spoiled[0, 0] = np.nan
    text = "\n".join("\t".join("n/a" if np.isnan(z) else f"{1e6 * z:.9f}" for z in row) for row in spoiled)
    (tmp_path / "map.txt").write_text("# preamble\n" + text)
    found = rf.io.read_heights(tmp_path / "map.txt", (DX, DY), "um")
    assert found.holes == pytest.approx(4 / heights.size)
    known = np.isfinite(spoiled)
    np.testing.assert_allclose(found.heights[known], heights[known], atol=1e-14)
    # Every filled height is the mean of its neighbours.
    padded = np.pad(found.heights, 1, mode="constant", constant_values=np.nan)
    for i, k in np.argwhere(~known):
        beside = [padded[i, k + 1], padded[i + 2, k + 1], padded[i + 1, k], padded[i + 1, k + 2]]
        np.testing.assert_allclose(found.heights[i, k], np.nanmean(beside), rtol=1e-12)


def test_a_plane_is_filled_exactly():
    x, y = np.meshgrid(np.arange(9.0), np.arange(8.0), indexing="ij")
    plane = 2 * x - 3 * y + 1
    spoiled = plane.copy()
    spoiled[3:6, 2:5] = np.nan
    np.testing.assert_allclose(filled(spoiled), plane, atol=1e-12)


def test_missing_rows_are_holes(tmp_path, heights):
    rows = xyz(heights, ",", comma=False).splitlines()
    (tmp_path / "map.csv").write_text("\n".join(rows[:40] + rows[43:]), encoding="utf-8")
    assert rf.io.read_heights(tmp_path / "map.csv").holes == pytest.approx(3 / heights.size)


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        ("nothing here", {}, "must have rows of numbers"),
        ("1 2 3\n4 5 6\n", {}, "unit is missing"),
        ("1 2 3\n4 5 6\n", {"unit": "inch"}, "unit 'inch'"),
        ("1 2 3 4\n4 5 6 7\n", {"unit": "m"}, "must have x, y and z"),
        ("1 2 3\n4 5\n", {"unit": "m", "spacing": 1e-6}, "line 2: has 2 fields"),
        ("1 2 3\n4 5 6\n", {"unit": "m", "spacing": -1e-6}, "must be one or two numbers > 0"),
        ("1 nan 3\n4 nan 6\n", {"unit": "m", "spacing": 1e-6}, "33% of the points are holes"),
        ("0 0 1\n0 1 1\n1 0 1\n1.4 1 1\n4 1 1\n", {"unit": "m"}, "x must be evenly spaced"),
        ("0 0 1\nn/a 1 1\n1 0 1\n", {"unit": "m"}, "x must be a number in every row"),
    ],
)
def test_refused(tmp_path, text, arguments, message):
    path = tmp_path / "map.txt"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"must|is missing|holes|unit") as error:
        rf.io.read_heights(path, **arguments)
    assert message in str(error.value) and str(error.value).count("\n") == 0
