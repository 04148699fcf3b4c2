"""Tables of instruments and other programs, found in a text.

::

    Filename        tread.txt                       "f";"E'";"E''";"T"
    Operator        ...                             "Hz";"MPa";"MPa";"°C"
                                                    "0,1";"8,97";"1,23";"20,0"
    Angular frequency   Storage modulus   ...       ...
    rad/s               MPa               ...
    0.1                 8.97              ...

A text has a preamble, a row of names, a row of units (or units in brackets behind the names) and numbers.
Commas, semicolons or tabs separate fields; decimals have points or commas. More blocks with the same columns
may follow. Names are spelled as in `rubberfric.io.columns`.
"""

import csv
import json
import re
from typing import NamedTuple

import numpy as np

from rubberfric.base.atomic import StrPath, read_text
from rubberfric.base.checks import closest, warn_caller
from rubberfric.io.columns import COLUMNS, SET_VALUES, is_foreign, known_name, known_unit, plain_unit

_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
# A spectrum of interpolated heights is too low. Above this share of holes it says little about the surface.
MOST_HOLES = 0.25
LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9}
_LENGTH_IN_BRACKETS = re.compile(r".*[\[(]([^\[\]()]+)[\])]\s*")

TextRows = list[tuple[int, list[str]]]  # (line, fields)


class TextTable(NamedTuple):
    """A table with names and units as in `COLUMNS`."""

    where: str  # file and line of the names
    titles: list[str]  # as written in the file
    names: list[str | None]  # in `COLUMNS` or `SET_VALUES`; None: unknown
    units: list[str]
    rows: TextRows  # numbers with decimal points


def find_table(path: StrPath, text: str, generic: str = "E", incomplete: bool = False) -> TextTable | None:
    """Return the first table of another program in a text.

    The result is None if the text has no table, or a table in the format of this project.

    Parameters
    ----------
    path : name of the file in messages
    generic : "E" or "G", the meaning of "storage modulus"
    incomplete : if True, rows in which some cells are not numbers are returned too
    """
    lines = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if has_fields(line)]
    for place, (_, line) in enumerate(lines):
        for separator in "\t;,":
            titles = _split(line, separator)
            known = [known_name(title, generic) for title in titles]
            below = [_split(row, separator) for _, row in lines[place + 1 : place + 3]]
            if sum(name is not None for name, _ in known) < 2 or not any(map(_any_number, below)):
                continue
            own = place == 0 and separator == ","
            if own and not any(is_foreign(t, name) for t, (name, _) in zip(titles, known, strict=True)):
                return None
            names, units = ([pair[i] for pair in known] for i in (0, 1))
            return _export(path, lines[place:], separator, titles, names, units, incomplete)
    return None


def headless(path: StrPath, text: str, titles: list[str]) -> TextTable:
    """Return the table of a text whose columns have the given titles.

    A title is "name [unit]", or "-" for a column that is not read. Lines that do not begin with a number are
    skipped, so a header is allowed. Blanks may separate columns.
    """
    if isinstance(titles, str) or not all(isinstance(title, str) for title in titles):
        raise ValueError(f'{path}: columns = {titles!r}: must be a list of "name [unit]" for all columns')
    names, units = [], []
    for title in titles:
        name, unit = known_name(title) if title != "-" else (None, None)
        unit = known_unit(unit, name)
        if title != "-" and (name not in COLUMNS or unit not in COLUMNS[name].units):
            example = 'such as "f [Hz]", "E_stor [MPa]", "log10_q [log10(1/m)]", or "-" for a column not read'
            raise ValueError(f"{path}: columns: {title!r}: must be a known name and unit, {example}")
        names.append(name)
        units.append(unit)
    rows = []
    for number, line in enumerate(text.splitlines(), start=1):
        several = [fields for fields in (_split(line, s) for s in ("\t", ";", ",", None)) if len(fields) > 1]
        fields = several[0] if several else [line.strip()]
        if is_number(fields[0]):
            rows.append((number, fields))
    if not rows:
        raise ValueError(f"{path}: must have rows that begin with a number")
    return TextTable(f"{path}: columns", list(titles), names, units, _checked(path, len(titles), rows))


def read_traces(path: StrPath) -> tuple[np.ndarray, np.ndarray]:
    """Read the traces of a profilometer, for `rubberfric.roughness.spectrum_of_profile`.

    ::

        x,trace 1,trace 2            Weg [mm];Spur 1 [µm];Spur 2 [µm]
        mm,um,um                     0,00;-60,2;522,5
        0.00,-60.2,522.5             ...

    Parameters
    ----------
    path : text table or .xlsx with positions in the first column, and one trace of heights in each further
        column. Titles are arbitrary. The unit of length is in brackets behind a title, or in the row below. A
        column before the positions that counts the points is skipped. NaN is a dropout. Up to a quarter of
        the heights of a trace may be dropouts, which are interpolated. A warning states their share.

    Returns
    -------
    Tuple of the positions, shape (n,), and the heights, shape (traces, n) [m]

    Raises
    ------
    ValueError : no numbers, fewer than two columns, a unit that is not a length, or an invalid number
    """
    text = read_text(path, exports=True)
    found = _above_numbers(text)
    if found is None:
        raise ValueError(f"{path}: must have rows with a position and at least one height")
    if not (titles := found[0]):
        raise ValueError(f"{path}: begins with numbers: must have titles with length units, such as x [mm]")
    if all(map(_LENGTH_IN_BRACKETS.fullmatch, titles[-1][1:])):
        titles = titles[-1:]  # the line above belongs to a preamble
    lines, rows = text.splitlines(), headless(path, text, ["-"] * len(titles[0])).rows
    if len(titles[0]) > 2 and [fields[0].rstrip("0").rstrip(".") for _, fields in rows[:2]] == ["1", "2"]:
        # The first column counts the points.
        titles, rows = [row[1:] for row in titles], [(line, fields[1:]) for line, fields in rows]
    scales = []
    for number, (title, *below) in enumerate(zip(*titles, strict=True), start=1):
        bracket = _LENGTH_IN_BRACKETS.fullmatch(title)
        given = below[0] if below else bracket[1] if bracket else title
        unit = plain_unit(given)
        if unit not in LENGTHS:
            known = closest(unit, tuple(LENGTHS))
            raise ValueError(f"{path}: column {number} {title!r}: unit {given!r}: {known}")
        scales.append(LENGTHS[unit])
    values = np.empty((len(rows), len(scales)))
    for row, (line, fields) in zip(values, rows, strict=True):
        try:
            row[:] = [float(field) for field in fields]
        except ValueError:
            raise ValueError(f"{path}: line {line}: {lines[line - 1][:60]!r}: must be numbers") from None
        if not np.isfinite(row[0]) or np.isinf(row).any():
            raise ValueError(f"{path}: line {line}: must be finite")
    x, *heights = (values * scales).T
    return x, _bridged(path, x, np.array(heights))


def _bridged(path, x, heights):
    """Interpolate dropouts (NaN) along each trace, and return the heights."""
    hole = np.isnan(heights)
    if not hole.any():
        return heights
    if (share := hole.mean(1).max()) > MOST_HOLES:
        raise ValueError(f"{path}: {share:.0%} of a trace are dropouts: must be at most {MOST_HOLES:.0%}")
    warn_caller(f"{path}: {hole.mean():.1%} of the heights are dropouts and are interpolated", UserWarning)
    for height, missing in zip(heights, hole, strict=True):
        height[missing] = np.interp(x[missing], x[~missing], height[~missing])
    return heights


def suggested_columns(text: str) -> str:
    """Return a text `columns=[...]` that suggests names for the columns of a table.

    An unknown name or unit is shown as "?". The result is "" for a text without rows of numbers.
    """
    found = _above_numbers(text)
    if found is None:
        return ""
    above, numbers = found
    titles, *below = above or [numbers]
    suggestions = []
    for title, unit in zip(titles, below[0] if below else [None] * len(titles), strict=True):
        name, own = known_name(title)
        column = COLUMNS.get(name or "")
        unit = known_unit(own if own is not None else unit, name)
        known = column is not None and unit in column.units
        suggestions.append(f"{name} [{unit}]" if known else f"{name} [?]" if column else "?")
    return f"columns={json.dumps(suggestions, ensure_ascii=False)}"


def pick(table: TextTable, quantities: tuple[str, ...]) -> TextTable:
    """Return the table with only the columns of the given quantities.

    If a quantity has measured values, its set values are left out. A ValueError is raised if two columns
    disagree about a quantity.
    """
    found: dict[str, list[tuple[int, str]]] = {}
    measured = {COLUMNS[name].name for name in table.names if name in COLUMNS}
    for place, name in enumerate(table.names):
        if name in SET_VALUES and COLUMNS[SET_VALUES[name]].name not in measured:
            name = SET_VALUES[name]
        if name in COLUMNS and COLUMNS[name].name in quantities:
            found.setdefault(COLUMNS[name].name, []).append((place, name))
    for quantity, places in found.items():
        if len(places) > 1 and not _agree(table, places):
            both = " and ".join(repr(table.titles[place]) for place, _ in places)
            raise ValueError(
                f"{table.where}: columns {both}: both hold {quantity}: must be only one; remove the other"
            )
    places, names = zip(*(columns[0] for columns in found.values()), strict=True) if found else ((), ())
    titles, units = ([values[i] for i in places] for values in (table.titles, table.units))
    rows = [(line, [row[i] for i in places]) for line, row in table.rows]
    return TextTable(table.where, titles, list(names), units, rows)


def _agree(table: TextTable, places: list[tuple[int, str]]) -> bool:
    """Return True if the columns at `places` have different names and agree within 0.1 %.

    For example, the columns omega and f may hold equal frequencies.
    """
    if len({name for _, name in places}) < len(places):
        return False
    for _, fields in table.rows:
        try:
            values = [COLUMNS[name].value(float(fields[i]), table.units[i]) for i, name in places]
        except (ValueError, KeyError):
            return False
        if max(values) - min(values) > 1e-3 * abs(values[0]):
            return False
    return True


def _export(path, lines, separator, titles, names, units, incomplete):
    """Read the table whose titles are in the first line of `lines`."""
    (number, _), *below = lines
    where = f"{path}: line {number}"
    first = _split(below[0][1], separator)
    if not _any_number(first):
        below = below[1:]
        first += [""] * (len(titles) - len(first))
        units = [own if own is not None else given for own, given in zip(units, first, strict=False)]
    elif all(unit is None for unit in units):
        columns = suggested_columns("\n".join(text for _, text in lines))
        raise ValueError(
            f"{where}: has names but no units: must have units in the row below or in brackets; or pass them:"
            f" {columns}"
        )
    rows, count = [], sum(name is not None for name in names)
    for place, text in below:
        fields = _split(text, separator)
        cells = [field for field, name in zip(fields, names, strict=False) if name is not None]
        numbers = [is_number(cell) for cell in cells]
        enough = any(numbers) if incomplete else all(numbers)
        if is_number(fields[0]) or (len(cells) == count and enough):
            rows.append((place, fields))
        elif len(cells) == count and any(numbers):
            raise ValueError(f"{path}: line {place}: {text.strip()[:60]!r}: must be numbers")
        elif fields != titles and sum(known_name(field)[0] is not None for field in fields) > 1:
            raise ValueError(
                f"{path}: line {place}: has other columns than line {number}: a file must have one table"
            )
    if not rows:
        raise ValueError(f"{path}: must have numbers below line {number}")
    spelled = [known_unit(unit, name) for unit, name in zip(units, names, strict=True)]
    return TextTable(where, titles, names, spelled, _checked(path, len(titles), rows))


def _checked(path: StrPath, count: int, rows: TextRows) -> TextRows:
    """Convert decimal commas to points, and raise ValueError for a row without `count` fields."""
    commas = any(_DECIMAL_COMMA.fullmatch(field) for _, fields in rows for field in fields)
    checked = []
    for line, fields in rows:
        while len(fields) > count and not fields[-1]:
            fields = fields[:-1]
        if len(fields) != count:
            raise ValueError(f"{path}: line {line}: has {len(fields)} fields: must have {count}")
        if commas:
            points = [field for field in fields if "." in field and is_number(field.replace(",", ""))]
            if points:
                raise ValueError(
                    f"{path}: line {line}: {points[0]!r}: has a decimal point, others a comma: must all have"
                    " the same decimal sign"
                )
            fields = [f.replace(",", ".") if _DECIMAL_COMMA.fullmatch(f) else f for f in fields]
        checked.append((line, fields))
    return checked


def _above_numbers(text: str) -> tuple[list[list[str]], list[str]] | None:
    """Return the rows of titles and the first row of numbers of a text, or None without numbers.

    The rows of titles are the last two rows, or fewer, that precede the numbers and have as many fields as
    the row of numbers.
    """
    lines = list(filter(has_fields, text.splitlines()))
    for separator in ("\t", ";", ",", None):
        rows = [_split(line, separator) for line in lines]
        first = next((i for i, row in enumerate(rows) if len(row) > 1 and all(map(is_number, row))), None)
        if first is not None:
            return [row for row in rows[:first] if len(row) == len(rows[first])][-2:], rows[first]
    return None


def has_fields(line: str) -> bool:
    """Return True unless a line is blank or a comment."""
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _split(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    quotes = csv.QUOTE_NONE if separator == "\t" else csv.QUOTE_MINIMAL  # with tabs E" means E''
    reader = csv.reader([line.strip("\r\n")], delimiter=separator, quoting=quotes, skipinitialspace=True)
    try:
        fields = [field.strip() for field in next(reader)]
    except (csv.Error, StopIteration):
        return [line.strip()]
    return [f[1:-1] if len(f) > 2 and f[0] == f[-1] == '"' else f for f in fields]


def _any_number(fields: list[str]) -> bool:
    return any(map(is_number, fields))


def is_number(field: str) -> bool:
    """Return True if a text is a number with a decimal point or comma."""
    try:
        float(field.replace(",", ".", 1))
    except ValueError:
        return False
    return True
