"""Height maps of profilometers and microscopes, as text.

::

    x [mm];y [mm];z [µm]            -1.20  0.35  0.81 ...
    0,00;0,00;-1,20                 -0.95   NaN  0.77 ...
    0,00;0,01;                      ...

A file has a row x, y, z for each point, or a grid of heights whose spacing the caller gives. A height that is
empty, `NaN` or `n/a` is a hole, and so is a missing row. A separator at the end of every row is no hole.
Programs also write numbers such as -9999, 32767 or 1e38 for holes, see `without_sentinels`.
"""

import re
from typing import NamedTuple

import numpy as np

from rubberfric.base.atomic import StrPath, as_path, is_number
from rubberfric.base.checks import closest, shown
from rubberfric.io.height_files.holes import (
    LEAST_DIFFERENT,
    LENGTHS,
    MOST_HOLES,
    outliers_of,
    without_sentinels,
)
from rubberfric.io.text_tables.lines import has_fields, trimmed, without_trailing_separators
from rubberfric.io.text_tables.preamble import ImageHeader, stated_image
from rubberfric.io.text_tables.units import plain_unit
from rubberfric.io.text_tables.workbooks import read_export
from rubberfric.roughness.heights import fill_holes

_HOLES = frozenset(("", "nan", "n/a", "na", "bad", "no data", "null", "none", "-", "--", "---", "***"))
_IN_BRACKETS = re.compile(r"[\[(]([^\[\]()]+)[\])]")
# Positions of one row of points may differ by this share of the spacing.
_SAME = 0.05
# Largest relative difference between the given spacing and the stated one, which may be rounded.
_SAME_SPACING = 0.02


class HeightMap(NamedTuple):
    """Heights on a grid, with filled holes.

    Attributes
    ----------
    heights : [m], shape (nx, ny)
    dx, dy : spacing along the first and the second axis [m]
    holes : share of the points that were holes or outliers [-]
    """

    heights: np.ndarray
    dx: float
    dy: float
    holes: float


def read_heights(
    path: StrPath,
    spacing: float | tuple[float, float] | None = None,
    unit: str | None = None,
    sentinels: bool = True,
    outliers: float | None = None,
) -> HeightMap:
    """Read a height map, for `rubberfric.roughness.spectrum_of_topography`.

    Holes are filled smoothly: every height in a hole becomes the mean of its four neighbours. `holes` of the
    result states their share.

    Parameters
    ----------
    path : text file (.csv, .txt, .dat, .xyz, .tsv), or an array in a file of `numpy.save` (.npy)
    spacing : dx = dy, or (dx, dy), of a grid of heights, > 0 [m]
        The rows of the file are along y. None means that the file has the columns x, y and z, or that
        lines of Gwyddion above a grid state its size ("# Width: 10 µm", "# Height: 10 µm").
    unit : unit of the numbers in the file, "m", "cm", "mm", "um", "nm", "pm" or "Å"
        None takes the unit from titles such as "x [mm]", or from a line "# Value units: m".
    sentinels : if True, numbers such as -9999 become holes, see `without_sentinels`, and a warning names them
        False keeps them as heights, for example the exactly flat ground of a groove.
    outliers : standard deviations beyond which a height is a spike, often 10, see
        `rubberfric.roughness.find_outliers`; spikes become holes, and a warning states their share; or None

    Returns
    -------
    HeightMap

    Raises
    ------
    ValueError : the file has no numbers, no unit, positions that form no grid, several heights for one point,
        rows that are not numbers or have different lengths, rows of positions, or more than a quarter of
        holes. The message names the file and the fault.

    Examples
    --------
    >>> np.savetxt("map.txt", [[1.0, 2.0, 3.0], [3.0, np.nan, 5.0]])
    >>> surface = rf.io.read_heights("map.txt", spacing=1e-6, unit="um")
    >>> surface.heights.shape, round(1e6 * float(surface.heights[1, 1]), 3), round(surface.holes, 3)
    ((2, 3), 3.333, 0.167)
    """
    titles, values, header = _table(path)
    spacing, unit = _stated(path, values, header, spacing, unit)
    count = values.shape[1]
    if spacing is None and count != 3:
        raise ValueError(f"{path}: has {count} columns: must have x, y and z, or be a grid with `spacing`")
    units = _units(path, titles, unit, count, spacing is None)
    if spacing is None:
        if sentinels:
            values[:, 2] = without_sentinels(path, values[:, 2])
        heights, dx, dy = _on_a_grid(path, *(values * units).T)
    else:
        pair = tuple(spacing) if isinstance(spacing, tuple | list) else (spacing, spacing)
        numbers = [
            d for d in pair if isinstance(d, int | float) and not isinstance(d, bool) and 0 < d < np.inf
        ]
        if len(pair) != 2 or len(numbers) != 2:
            raise ValueError(f"spacing = {shown(spacing)}: must be one or two numbers > 0 [m]")
        dx, dy = numbers
        _check_no_positions(path, values)
        heights = (without_sentinels(path, values) if sentinels else values) * units[0]
    hole = ~np.isfinite(heights)
    heights = fill_holes(heights) if outliers is not None and hole.mean() <= MOST_HOLES else heights
    hole |= outliers_of(path, heights, outliers)
    if hole.mean() > MOST_HOLES:
        raise ValueError(
            f"{path}: {hole.mean():.0%} of the points are holes: must be at most {MOST_HOLES:.0%}"
        )
    return HeightMap(fill_holes(np.where(hole, np.nan, heights)), float(dx), float(dy), float(hole.mean()))


def _table(path):
    """Return titles of columns, [] without titles, numbers with NaN for holes, and the header of an image."""
    if as_path(path).suffix.lower() == ".npy":
        return [], _array(path), ImageHeader()
    text = read_export(path)
    titles, rows = _rows(path, text)
    return titles, _numbers(path, rows), stated_image(text)


def _stated(path, values, header, spacing, unit):
    """Return spacing and unit of a grid, which the header states if they are not given.

    Raise ValueError if both exist and differ.
    """
    if header.width is None or header.height is None:
        return spacing, unit
    own = tuple(length / n for length, n in zip((header.height, header.width), values.shape, strict=True))
    if isinstance(spacing, int | float) or (isinstance(spacing, tuple) and len(spacing) == 2):
        both = np.broadcast_to(np.asarray(spacing, float), (2,))
        if np.any(np.abs(both / own - 1) > _SAME_SPACING):
            raise ValueError(
                f"{path}: spacing = {shown(spacing)}: the file states {header.height:g} m x {header.width:g}"
                f" m for {' x '.join(map(str, values.shape))} points, {own[0]:.4g} m and {own[1]:.4g} m: must"
                " agree; leave spacing out"
            )
    if unit is not None and header.unit is not None and plain_unit(unit) != plain_unit(header.unit):
        raise ValueError(f"{path}: unit = {shown(unit)}: the file states {header.unit!r}; leave unit out")
    return own if spacing is None else spacing, header.unit if unit is None else unit


def _array(path):
    """Read a file of `numpy.save`."""
    with as_path(path).open("rb") as file:
        try:
            values = np.lib.format.read_array(file, allow_pickle=False)
        except (ValueError, EOFError):  # truncated, another format, or Python objects
            raise ValueError(f"{path}: cannot be read as an array; write it with numpy.save") from None
    if values.dtype.kind not in "fiu" or values.ndim != 2 or min(values.shape) < 2:
        raise ValueError(f"{path}: holds {values.dtype} {values.shape}: must be a grid of real numbers")
    return values.astype(float)


def _rows(path, text):
    """Return the titles of the columns, and (line number, fields) of all rows of numbers or empty fields.

    The titles are [] if the file has no titles.
    """
    lines = [(k, line) for k, line in enumerate(text.splitlines(), 1) if has_fields(line)]
    best: list = []
    every: list = []
    for separator in ("\t", ";", ",", None):
        fields_of_lines = [[field.strip() for field in line.split(separator)] for _, line in lines]
        fields_of_lines = without_trailing_separators(fields_of_lines, _has_height)
        split = [(k, fields) for (k, _), fields in zip(lines, fields_of_lines, strict=True)]
        rows = [(k, fields) for k, fields in split if len(fields) > 1 and _has_height(fields)]
        if len(rows) > len(best):
            best, every = rows, split
    if not best:
        raise ValueError(f"{path}: must have rows of numbers")
    first, last, width = best[0][0], best[-1][0], len(best[0][1])
    above = [trimmed(fields, width) for k, fields in every if k < first]
    above = [fields for fields in above if len(fields) == width]
    # Rows of holes between the others stay, because they are rows of the grid.
    rows = [(k, fields) for k, fields in every if first <= k <= last]
    for k, fields in [*rows, *((k, fields) for k, fields in every if k > last)]:
        if not all(map(_is_value, fields)):
            shown_row = " ".join(fields)[:60]
            raise ValueError(f"{path}: line {k}: {shown_row!r}: must be numbers; remove or mend this line")
    return above[-1] if above else [], rows


def _has_height(fields):
    """Return True for numbers and holes with at least one number."""
    return all(map(_is_value, fields)) and any(field.lower() not in _HOLES for field in fields)


def _is_value(field):
    return field.lower() in _HOLES or is_number(field)


def _numbers(path, rows):
    width = len(rows[0][1])
    for line, fields in rows:
        if len(fields) != width:
            raise ValueError(f"{path}: line {line}: has {len(fields)} fields: must have {width}")
    return np.array(
        [
            [np.nan if f.lower() in _HOLES else float(f.replace(",", ".", 1)) for f in fields]
            for _, fields in rows
        ]
    )


def _check_no_positions(path, values):
    """Raise ValueError if the first row or column of a grid of heights contains positions or counts."""
    for what, line in (("row", values[0]), ("column", values[:, 0])):
        steps = np.diff(line[1:])
        even = steps.size >= LEAST_DIFFERENT and np.ptp(steps) <= 1e-6 * abs(steps[0]) and steps[0] != 0
        # A plane has even heights in every row and column.
        other = np.diff(values[1, 1:] if what == "row" else values[1:, 1])
        if even and not np.ptp(other) <= 1e-6 * np.abs(other).max():
            raise ValueError(
                f"{path}: the first {what} of the grid rises in even steps, {line[1]:g}, {line[2]:g}, ...:"
                " must be heights; remove positions and counts"
            )


def _units(path, titles, unit, count, named):
    """Return the length unit of every column in metres."""
    units = [unit] * count
    if unit is None:
        matches = [_IN_BRACKETS.search(title) for title in titles] if named else []
        units = [match[1] for match in matches if match is not None]
        if len(units) != count:
            raise ValueError(f"{path}: unit is missing: must be one of {', '.join(LENGTHS)}")
    plain = [plain_unit(text) for text in units]
    for text in plain:
        if text not in LENGTHS:
            raise ValueError(f"{path}: unit {text!r}: {closest(text, tuple(LENGTHS))}")
    return np.array([LENGTHS[text] for text in plain])


def _on_a_grid(path, x, y, z):
    """Return heights of shape (nx, ny), the spacing along x and the spacing along y.

    A point without a row has the height NaN.
    """
    places, spacings = [], []
    for name, values in (("x", x), ("y", y)):
        if not np.isfinite(values).all():
            raise ValueError(f"{path}: {name} must be a number in every row")
        steps = np.diff(np.unique(values))
        large = steps[steps > _SAME * steps.max(initial=0.0)]
        if large.size < 1:
            raise ValueError(f"{path}: {name} has only one value; the points must form a grid")
        # Where all points of a line are missing, a step is a multiple of the spacing.
        multiples = np.maximum(np.round(large / np.percentile(np.asarray(large, float), 10)), 1)
        spacing = float(large.sum() / multiples.sum())
        place = (values - values.min()) / spacing
        if np.abs(place - np.round(place)).max() > 4 * _SAME:
            raise ValueError(f"{path}: {name} must be evenly spaced")
        places.append(np.round(place).astype(int))
        spacings.append(spacing)
    size = [int(place.max()) + 1 for place in places]
    if size[0] * size[1] > 4 * x.size + 64:
        raise ValueError(
            f"{path}: {x.size} points do not fill a grid of {size[0]} x {size[1]}; too many rows are missing"
        )
    _check_once(path, np.ravel_multi_index(places, size), x, y, z)
    heights = np.full(size, np.nan)
    known = np.isfinite(z)
    heights[places[0][known], places[1][known]] = z[known]
    return heights, *spacings


def _check_once(path, place, x, y, z):
    """Raise ValueError if the rows of one point have different heights; NaN is no height."""
    order = np.lexsort((z, place))  # NaN last
    same = (np.diff(place[order]) == 0) & (np.diff(z[order]) != 0) & np.isfinite(z[order][1:])
    if same.any():
        points = np.unique(place[order][1:][same])
        rows = np.flatnonzero(place == place[order][1:][same][0])
        heights = ", ".join(f"{height:.6g}" for height in z[rows[:3]])
        raise ValueError(
            f"{path}: {points.size} points have several heights, the first at x = {x[rows[0]]:.6g} m,"
            f" y = {y[rows[0]]:.6g} m: {heights}{', ...' * (rows.size > 3)} m; must have one height each,"
            " leave out all scans but one"
        )
