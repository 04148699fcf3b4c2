"""Heights along lines as profilometers export them: a column of positions, one of heights for every trace.

::

    x,trace 1,trace 2            Weg [mm];Spur 1 [µm];Spur 2 [µm]
    mm,um,um                     0,00;-60,2;522,5
    0.00,-60.2,522.5             ...
    ...

Titles may be any; units of length stand in brackets behind them, or in the row below. Separators, decimal
commas and encodings are those of `rubberfric.io.tables.exports`.
"""

import re

import numpy as np

from rubberfric.base.atomic import StrPath
from rubberfric.base.checks import closest
from rubberfric.io.tables.exports import above_numbers, headless
from rubberfric.io.tables.text import read_text
from rubberfric.io.tables.titles import plain_unit

LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9}
_UNIT = re.compile(r".*[\[(]([^\[\]()]+)[\])]\s*")


def read_traces(path: StrPath) -> tuple[np.ndarray, np.ndarray]:
    """Positions and heights of the traces of a profilometer, for `rubberfric.roughness.spectrum_of_profile`.

    Parameters
    ----------
    path : a table, .xlsx too; its first column has the positions, every other the heights of one trace

    Returns
    -------
    (x, heights) [m], shapes (n,) and (traces, n)

    Raises
    ------
    ValueError : one line: no numbers, fewer than two columns, a column without a unit of length, a field that
        is no finite number.
    """
    text = read_text(path, exports=True)
    lines = text.splitlines()
    titles = _titles(path, text)
    units = [_unit(path, i, fields) for i, fields in enumerate(zip(*titles, strict=True), start=1)]
    table = headless(path, text, ["-"] * len(units))
    values = np.empty((len(table.rows), len(units)))
    for row, (line, fields) in zip(values, table.rows, strict=True):
        try:
            row[:] = [float(field) for field in fields]
        except ValueError:
            raise ValueError(f"{path}: line {line}: {lines[line - 1][:60]!r}: must be numbers") from None
        if not np.isfinite(row).all():
            raise ValueError(f"{path}: line {line}: must be finite")
    x, *heights = (values * [LENGTHS[unit] for unit in units]).T
    return x, np.array(heights)


def _titles(path, text):
    """The row of titles above the first row of numbers, and the one of units below it if there is one."""
    found = above_numbers(text)
    if found is None:
        raise ValueError(f"{path}: has no rows of two numbers or more: must have positions and heights")
    above, _ = found
    if not above:
        raise ValueError(f"{path}: begins with numbers: must have titles with units of length, as x [mm]")
    # Units in brackets need no row of their own, and what stands above them is a preamble.
    return above[-1:] if all(map(_UNIT.fullmatch, above[-1])) else above


def _unit(path, number, fields):
    """Unit of a column, of its title and what stands below."""
    bracket = _UNIT.fullmatch(fields[0])
    said = bracket[1] if bracket and len(fields) == 1 else fields[-1]
    unit = plain_unit(said)
    if unit not in LENGTHS:
        raise ValueError(
            f"{path}: column {number} {fields[0]!r}: unit {said!r}: {closest(unit, tuple(LENGTHS))}"
        )
    return unit
