"""Traces of profilometers, as text: a column of positions, and a column of heights for each trace."""

import re

import numpy as np

from rubberfric.base.atomic import StrPath, is_number
from rubberfric.base.checks import closest, warn_caller
from rubberfric.io.columns import known_name
from rubberfric.io.exports import headless
from rubberfric.io.height_files.holes import LENGTHS, MOST_HOLES, outliers_of, without_sentinels
from rubberfric.io.text_tables.lines import above_numbers
from rubberfric.io.text_tables.units import plain_unit
from rubberfric.io.text_tables.workbooks import read_export

_LENGTH_IN_BRACKETS = re.compile(r".*[\[(]([^\[\]()]+)[\])]\s*")


def read_traces(path: StrPath, outliers: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Read the traces of a profilometer, for `rubberfric.roughness.spectrum_of_profile`.

    ::

        x,trace 1,trace 2            Weg [mm];Spur 1 [µm];Spur 2 [µm]
        mm,um,um                     0,00;-60,2;522,5
        0.00,-60.2,522.5             ...

    Parameters
    ----------
    path : text table or .xlsx with positions in the first column, and one trace of heights in each further
        column. Titles are arbitrary. The unit of length, such as mm, is in brackets behind a title, or in the
        row below. A column before the positions that counts the points is skipped, if neither its title nor
        its unit is one of positions. Positions may be in any order. NaN is a dropout, and so are the numbers
        that `without_sentinels` finds. Up to a quarter of the heights of a trace may be dropouts, which are
        interpolated. A warning states their share.
    outliers : standard deviations beyond which a height is a spike, as in `read_heights`, or None

    Returns
    -------
    Tuple of the increasing positions, shape (n,), and the heights, shape (traces, n) [m]

    Raises
    ------
    ValueError : no numbers, fewer than two columns, a unit that is not a length, or an invalid number

    Examples
    --------
    >>> x, heights = rf.io.read_traces("data/laboratory/stylus.csv")
    >>> heights.shape, round(1e3 * float(x[-1]), 6)
    ((6, 2048), 20.47)
    """
    text = read_export(path)
    titles_and_numbers = above_numbers(text)
    if titles_and_numbers is None:
        raise ValueError(f"{path}: must have rows with a position and at least one height")
    if not (titles := titles_and_numbers[0]):
        raise ValueError(f"{path}: begins with numbers: must have titles with length units, such as x [mm]")
    if all(map(_LENGTH_IN_BRACKETS.fullmatch, titles[-1][1:])):
        titles = titles[-1:]  # the line above belongs to a preamble
    lines, table = text.splitlines(), headless(path, text, ["-"] * len(titles[0]))
    if table.bad:
        raise ValueError(table.bad[0][1])
    rows = table.rows
    first = 1
    if len(titles[0]) > 2 and _counts([row[0] for row in titles], [fields for _, fields in rows]):
        first, titles = 2, [row[1:] for row in titles]
        rows = [(line, fields[1:]) for line, fields in rows]
    columns = enumerate(zip(*titles, strict=True), start=first)
    scales = [_length(path, number, *texts) for number, texts in columns]
    values = np.empty((len(rows), len(scales)))
    for row, (line, fields) in zip(values, rows, strict=True):
        try:
            row[:] = [float(field) for field in fields]
        except ValueError:
            raise ValueError(f"{path}: line {line}: {lines[line - 1][:60]!r}: must be numbers") from None
        if not np.isfinite(row[0]) or np.isinf(row).any():
            raise ValueError(f"{path}: line {line}: must be finite")
    values[:, 1:] = without_sentinels(path, values[:, 1:])
    # An instrument that moves backwards writes decreasing positions.
    x, *heights = (values[np.argsort(values[:, 0], kind="stable")] * scales).T
    heights = _bridged(path, x, np.array(heights))
    spikes = outliers_of(path, heights, outliers, profiles=True)
    return x, _bridged(path, x, np.where(spikes, np.nan, heights), warn=False)


def _counts(texts, rows):
    """Return True if the first column, with some texts in its titles, counts the points before positions."""
    names = {known_name(spelled)[0] for text in texts for spelled in (text, text.lower())}
    units = {plain_unit(unit) for text in texts for unit in (text, *_LENGTH_IN_BRACKETS.findall(text))}
    if "x" in names or not units.isdisjoint(LENGTHS) or not all(is_number(fields[0]) for fields in rows[:2]):
        return False
    # Heights do not increase or decrease throughout, so the first column then holds positions without a unit.
    steps = np.diff([float(fields[1]) for fields in rows if is_number(fields[1])])
    return [float(fields[0]) for fields in rows[:2]] == [1, 2] and (np.all(steps > 0) or np.all(steps < 0))


def _length(path, number, title, *below):
    """Return the length unit in a title or in the row below [m]."""
    bracket = _LENGTH_IN_BRACKETS.fullmatch(title)
    written = below[0] if below else bracket[1] if bracket else title
    unit, in_title = plain_unit(written), plain_unit(bracket[1]) if bracket else None
    if unit not in LENGTHS:
        known = closest(unit, tuple(LENGTHS))
        raise ValueError(f"{path}: column {number} {title!r}: unit {written!r}: {known}")
    if in_title in LENGTHS and in_title != unit:
        raise ValueError(
            f"{path}: column {number} {title!r}: unit {written!r} below contradicts the title; must be equal"
        )
    return LENGTHS[unit]


def _bridged(path, x, heights, warn=True):
    """Interpolate dropouts (NaN) along each trace, and return the heights."""
    hole = np.isnan(heights)
    if not hole.any():
        return heights
    if (share := hole.mean(1).max()) > MOST_HOLES:
        raise ValueError(f"{path}: {share:.0%} of a trace are dropouts: must be at most {MOST_HOLES:.0%}")
    if warn:
        warn_caller(
            f"{path}: {hole.mean():.1%} of the heights are dropouts and are interpolated", UserWarning
        )
    for height, missing in zip(heights, hole, strict=True):
        height[missing] = np.interp(x[missing], x[~missing], height[~missing])
    return heights
