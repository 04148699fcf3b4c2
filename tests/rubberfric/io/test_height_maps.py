"""Height maps of instruments: x, y, z, and grids, with holes."""

import re

import numpy as np
import pytest

import rubberfric as rf
from rubberfric.roughness.heights import fill_holes

# Different numbers of points along x and y, so that exchanged axes are found.
SHAPE = (24, 17)
# Spacing along x [m].
DX = 2e-6
# Spacing along y [m], different from the one along x.
DY = 3e-6


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


@pytest.mark.parametrize("dtype", ["float64", "float32", "int16"])
def test_an_array(tmp_path, heights, dtype):
    """Heights in nm, also as x, y and z, are those of the text file."""
    nm = np.round(1e9 * heights).astype(dtype)
    np.save(tmp_path / "map.npy", nm)
    found = rf.io.read_heights(tmp_path / "map.npy", (DX, DY), "nm")
    np.testing.assert_allclose(found.heights, 1e-9 * nm.astype(float), rtol=1e-12)
    assert (found.dx, found.dy, found.holes) == (DX, DY, 0.0)
    x, y = np.meshgrid(1000 * np.arange(4), 2000 * np.arange(3), indexing="ij")
    np.save(tmp_path / "xyz.npy", np.stack([x, y, nm[:4, :3]], -1).reshape(-1, 3))
    points = rf.io.read_heights(tmp_path / "xyz.npy", unit="nm")
    np.testing.assert_allclose(points.heights, found.heights[:4, :3], rtol=1e-12)
    np.testing.assert_allclose([points.dx, points.dy], [1e-6, 2e-6], rtol=1e-12)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros(3), "holds float64 (3,): must be a grid of real numbers"),
        (np.zeros((1, 5)), "holds float64 (1, 5): must be a grid of real numbers"),
        (np.array([["1", "2"], ["3", "4"]]), "must be a grid of real numbers"),
        (np.array([[None, 1]]), "cannot be read as an array; write it with numpy.save"),
    ],
)
def test_other_arrays(tmp_path, array, message):
    np.save(tmp_path / "map.npy", array, allow_pickle=True)
    with pytest.raises(ValueError, match=re.escape(message)):
        rf.io.read_heights(tmp_path / "map.npy", 1e-6, "m")


def test_other_files_with_the_ending_npy(tmp_path):
    np.savez(tmp_path / "maps.npz", np.zeros((4, 4)))
    whole = (tmp_path / "maps.npz").read_bytes()
    np.save(tmp_path / "map.npy", np.zeros((4, 4)))
    truncated = (tmp_path / "map.npy").read_bytes()[:-8]
    for content in (whole, truncated, b"1 2", b""):
        (tmp_path / "map.npy").write_bytes(content)
        with pytest.raises(ValueError, match="cannot be read as an array; write it with"):
            rf.io.read_heights(tmp_path / "map.npy", 1e-6, "m")


def test_a_plane_is_filled_exactly():
    x, y = np.meshgrid(np.arange(9.0), np.arange(8.0), indexing="ij")
    plane = 2 * x - 3 * y + 1
    spoiled = plane.copy()
    spoiled[3:6, 2:5] = np.nan
    np.testing.assert_allclose(fill_holes(spoiled), plane, atol=1e-12)


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


HEIGHTS = np.round(np.random.default_rng(0).normal(size=(64, 48)), 4)  # rms 1 [um]


def written(tmp_path, values, name="map.csv"):
    np.savetxt(tmp_path / name, values, delimiter=",", fmt="%.10g")
    return tmp_path / name


@pytest.mark.parametrize("value", [-9999, 32767, -32768, 65535, 9999, -99999, 1.70141e38, -3.4e38, 12.5, 0])
@pytest.mark.parametrize("level", [0.0, 500.0])
def test_repeated_extreme_numbers_are_holes(tmp_path, value, level):
    """The spectrum's rms height stays 1 um; taken as heights the numbers give 1.9 um to 1e32 m."""
    if value == 0 and level == 0:
        pytest.skip("0 lies among the heights")
    spoiled = HEIGHTS + level
    spoiled[10:14, 20:25] = spoiled[40, 7] = value
    with pytest.warns(UserWarning, match="21 heights .* are taken as holes"):
        found = rf.io.read_heights(written(tmp_path, spoiled), 1e-6, "um")
    assert found.holes == pytest.approx(21 / spoiled.size)
    h = rf.roughness.spectrum_of_topography(found.heights, found.dx).rms_height
    assert h == pytest.approx(1e-6, rel=0.03)
    if abs(value) < 1e30:
        kept = rf.io.read_heights(written(tmp_path, spoiled), 1e-6, "um", sentinels=False)
        assert kept.holes == 0 and np.sum(np.isclose(kept.heights, value * 1e-6)) == 21


def test_two_sentinels_and_xyz_and_traces(tmp_path):
    spoiled = HEIGHTS.copy()
    spoiled[3, :9], spoiled[50:53, 4] = -32768, 32767
    with pytest.warns(UserWarning, match="taken as holes"):
        found = rf.io.read_heights(written(tmp_path, spoiled), 1e-6, "um")
    assert found.holes == pytest.approx(12 / spoiled.size)
    x, y = np.indices(spoiled.shape)
    table = np.column_stack([x.ravel(), y.ravel(), spoiled.ravel()])
    with pytest.warns(UserWarning, match="taken as holes"):
        again = rf.io.read_heights(written(tmp_path, table, "map.xyz"), unit="um")
    np.testing.assert_allclose(again.heights, found.heights, atol=1e-12)
    rows = "".join(f"{k},{-9999 if k in (5, 9) else z}\n" for k, z in enumerate(HEIGHTS[:, 0]))
    (tmp_path / "traces.csv").write_text(f"x [um],z [um]\n{rows}")
    with pytest.warns(UserWarning, match=r"taken as holes|dropouts"):
        assert np.abs(rf.io.read_traces(tmp_path / "traces.csv")[1]).max() < 5e-6


@pytest.mark.parametrize(
    "heights",
    [
        np.where(np.indices((16, 16))[0] < 4, 0.0, 1.0),  # a step
        np.round(HEIGHTS * 3),  # quantised
        np.where(HEIGHTS > 3, 3.5, HEIGHTS),  # cut at 3.5
        np.where(HEIGHTS.max() == HEIGHTS, 12.0, HEIGHTS),  # one spike
    ],
    ids=["step", "quantised", "cut", "spike"],
)
def test_heights_that_are_no_holes(tmp_path, heights):
    found = rf.io.read_heights(written(tmp_path, heights), 1e-6, "um")
    assert found.holes == 0
    np.testing.assert_allclose(found.heights, 1e-6 * heights, atol=1e-15)


def test_several_heights_of_one_point(tmp_path):
    text = "x [um],y [um],z [um]\n" + "".join(f"{i % 10},{i // 10 % 10},{i}\n" for i in range(400))
    (tmp_path / "map.csv").write_text(text)
    with pytest.raises(
        ValueError, match=r"100 points have several heights, the first at x = 0 m, y = 0 m: 0,"
    ):
        rf.io.read_heights(tmp_path / "map.csv")
    once = text.splitlines()[1:101]
    (tmp_path / "map.csv").write_text("\n".join([text.splitlines()[0], *once, *once[::-1], "3,4,nan"]))
    found = rf.io.read_heights(tmp_path / "map.csv")
    np.testing.assert_allclose(found.heights, 1e-6 * np.arange(100).reshape(10, 10).T, atol=1e-15)


def test_lines_without_points_are_holes(tmp_path, heights):
    """Two of three lines are missing in a part of the map; a step is then a multiple of the spacing."""
    rows = xyz(heights, ",", comma=False).splitlines()
    kept = [row for row in rows if row[:3] not in ("2.0", "6.0", "10.", "14.")]
    (tmp_path / "map.csv").write_text("\n".join(kept), encoding="utf-8")
    found = rf.io.read_heights(tmp_path / "map.csv")
    assert found.heights.shape == SHAPE and found.dx == pytest.approx(DX)
    assert found.holes == pytest.approx(4 / SHAPE[0])


def test_no_row_of_a_grid_vanishes(tmp_path):
    path = written(tmp_path, HEIGHTS)
    rows = path.read_text().splitlines()
    path.write_text("\n".join([*rows[:9], "n/a" + ",n/a" * 47, *rows[10:]]))
    found = rf.io.read_heights(path, 1e-6, "um")
    assert found.heights.shape == (64, 48) and found.holes == pytest.approx(1 / 64)
    path.write_text("\n".join([*rows[:9], rows[9].replace(",", ",#ERR,", 1), *rows[10:]]))
    with pytest.raises(ValueError, match=r"line 10: .*: must be numbers"):
        rf.io.read_heights(path, 1e-6, "um")
    with_counts = ["," + ",".join(map(str, range(48))), *(f"{k},{row}" for k, row in enumerate(rows))]
    path.write_text("\n".join(with_counts))
    with pytest.raises(ValueError, match="first row of the grid rises in even steps"):
        rf.io.read_heights(path, 1e-6, "um")


def test_spikes_become_holes(tmp_path):
    """Three spikes and a missing height of a wave, which is read back to 2 % of its amplitude."""
    x = np.arange(60.0)
    wave = np.sin(x[:, None] / 7) * np.cos(x / 9) + 1e-3 * np.random.default_rng(1).standard_normal((60, 60))
    spoiled = wave.copy()
    spoiled[[10, 30, 30], [20, 40, 41]] += 3.0
    spoiled[50, 50] = np.nan
    np.savetxt(tmp_path / "map.csv", spoiled, delimiter=",")
    kept = rf.io.read_heights(tmp_path / "map.csv", 1e-6, "um")
    assert kept.heights[10, 20] == pytest.approx(1e-6 * spoiled[10, 20]) and kept.holes == 1 / 3600
    with pytest.warns(UserWarning, match=r"map.csv: 0\.\d\d% of the heights are outliers and are"):
        found = rf.io.read_heights(tmp_path / "map.csv", 1e-6, "um", outliers=10)
    assert 4 / 3600 <= found.holes <= 10 / 3600
    np.testing.assert_allclose(found.heights, 1e-6 * wave, atol=2e-8)
    rows = np.column_stack([x, spoiled[:, 20], wave[:, 3]])
    np.savetxt(tmp_path / "lines.csv", rows, delimiter=",", header="x [mm],a [um],b [um]", comments="")
    with pytest.warns(UserWarning, match=r"lines.csv: 0\.83% of the heights are outliers"):
        _, traces = rf.io.read_traces(tmp_path / "lines.csv", outliers=10)
    np.testing.assert_allclose(traces, 1e-6 * wave[:, [20, 3]].T, atol=2e-8)
    assert rf.io.read_traces(tmp_path / "lines.csv")[1][0, 10] > 2e-6
    with pytest.raises(ValueError, match=r"map.csv: outliers = 0\.0: must be > 0"):
        rf.io.read_heights(tmp_path / "map.csv", 1e-6, "um", outliers=0)


def gwyddion(folder, heights, size=("48 µm", "51 µm"), unit="m"):
    """Write an image with the informational header: its width is that of a row of the file."""
    lines = ["# Channel: Height", f"# Width: {size[1]}", f"# Height: {size[0]}", f"# Value units: {unit}"]
    lines += ["\t".join(f"{z:.8e}" for z in row) for row in heights]
    (folder / "image.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / "image.txt"


def test_an_image_of_gwyddion(tmp_path, heights):
    """24 rows of 2 µm are 48 µm high, and 17 columns of 3 µm are 51 µm wide."""
    found = rf.io.read_heights(gwyddion(tmp_path, heights))
    np.testing.assert_allclose(found.heights, heights, atol=1e-15)
    np.testing.assert_allclose([found.dx, found.dy, found.holes], [DX, DY, 0.0], rtol=1e-12)
    given = rf.io.read_heights(gwyddion(tmp_path, heights, unit="nm"), (DX, DY), "nm")
    np.testing.assert_allclose(given.heights, 1e-9 * heights, atol=1e-24)
    three = rf.io.read_heights(gwyddion(tmp_path, heights[:, :3], size=("48.0 µm", "9 µm")))
    np.testing.assert_allclose([three.dx, three.dy], [DX, DY], rtol=1e-12)


@pytest.mark.parametrize(
    ("unit", "options", "message"),
    [
        ("m", {"spacing": 2e-6}, "states 4.8e-05 m x 5.1e-05 m for 24 x 17 points, 2e-06 m and 3e-06"),
        ("m", {"unit": "nm"}, "unit = 'nm': the file states 'm'; leave unit out"),
        ("V", {}, "unit 'V': must be one of m, cm, mm, um, nm"),
    ],
)
def test_an_image_of_gwyddion_and_other_statements(tmp_path, heights, unit, options, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        rf.io.read_heights(gwyddion(tmp_path, heights, unit=unit), **options)
