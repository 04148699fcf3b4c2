"""Tables of instruments and other programs, found in a text.

::

    Filename        tread.txt                       "f";"E'";"E''";"T"
    Operator        ...                             "Hz";"MPa";"MPa";"°C"
                                                    "0,1";"8,97";"1,23";"20,0"
    Angular frequency   Storage modulus   ...       ...
    rad/s               MPa               ...
    0.1                 8.97              ...

A text has a preamble, a row of names, a row of units (or units behind the names) and numbers. Commas,
semicolons, tabs or several blanks separate fields; decimals have points or commas. More blocks with the same
columns may follow below, or side by side (`rubberfric.io.wide_sheets`). Names are spelled as in
`rubberfric.io.columns`. A line of names may begin with ##.
"""

import csv
import json
import re
from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

from rubberfric.base.atomic import StrPath, is_number
from rubberfric.io.columns import (
    COLUMNS,
    SET_VALUES,
    is_foreign,
    known_name,
    known_unit,
    quantities_of,
    settled_axis,
)
from rubberfric.io.wide_sheets import Label, LabelledTitle, blocks_of, labels_above, read_title

_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")

TextRows = list[tuple[int, list[str]]]  # (line, fields)
TextLines = list[tuple[int, str]]
# Several blanks separate columns of a fixed width.
SEPARATORS = ("\t", ";", ",", "  ")
_SEPARATOR = re.compile(r"[\t;,]")


class TextTable(NamedTuple):
    """A table with names and units as in `COLUMNS`."""

    where: str  # file and line of the names
    titles: list[str]  # as written in the file
    names: list[str | None]  # in `COLUMNS` or `SET_VALUES`; None: unknown
    units: list[str]
    rows: TextRows  # numbers with decimal points

    def with_columns(self, places: Sequence[int]) -> "TextTable":
        """Return the table with only the columns at `places`."""
        titles, units = ([values[i] for i in places] for values in (self.titles, self.units))
        rows = [(line, [row[i] for i in places]) for line, row in self.rows]
        return TextTable(self.where, titles, [self.names[i] for i in places], units, rows)


def find_table(path: StrPath, text: str, generic: str = "E", incomplete: bool = False) -> TextTable | None:
    """Return the first table of another program in a text.

    The result is None if the text has no table, or a table in the format of this project.

    Parameters
    ----------
    path : name of the file in messages
    generic : "E" or "G", the meaning of "storage modulus"
    incomplete : if True, rows in which some cells are not numbers are returned too
    """
    lines = [
        (number, line.removeprefix("##"))
        for number, line in enumerate(text.splitlines(), start=1)
        if has_fields(line) or (line.startswith("##") and len(_SEPARATOR.split(line)) > 1)
    ]
    first = next((number for number, line in enumerate(text.splitlines(), start=1) if has_fields(line)), 0)
    for place, (number, line) in enumerate(lines):
        for separator in SEPARATORS:
            below = [row for _, row in lines[place + 1 : place + 3] if separator in line]
            if not any(_any_number(_split(row, separator)) for row in below):
                continue
            titles, known = _titles(lines, place, separator, generic)
            if (count := sum(title.name is not None for title in known)) < 2:
                continue
            following = _titles(lines, place + 1, separator, generic)[1]
            if sum(title.name is not None for title in following) >= count:
                continue  # this line has titles of groups of columns
            own = number == first and separator == ","
            if own and not any(is_foreign(t, k.name) for t, k in zip(titles, known, strict=True)):
                return None
            return _export(path, lines[place:], separator, titles, known, incomplete)
    return None


def _titles(
    lines: TextLines, place: int, separator: str, generic: str
) -> tuple[list[str], list[LabelledTitle]]:
    """Return the titles in a line as written and as known.

    An empty title is in the line above if cells of a spreadsheet were merged.
    """
    if place >= len(lines):
        return [], []
    titles = _split(lines[place][1], separator)
    above = _split(lines[place - 1][1], separator) if place else []
    if _any_number(above) or _any_number(titles):
        above = []
    for i, (title, text) in enumerate(zip(titles, above, strict=False)):
        if not title and known_name(text)[0] is not None:
            titles[i] = text
    return titles, labels_above([read_title(title, generic) for title in titles], above)


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
        name = settled_axis(name, unit)
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
    unread = [place for place, name in enumerate(names) if name is None] if any(names) else []
    return TextTable(
        f"{path}: columns", list(titles), names, units, _checked(path, len(titles), rows, unread)
    )


def suggested_columns(text: str) -> str:
    """Return a text `columns=[...]` that suggests names for the columns of a table.

    An unknown name or unit is shown as "?". The result is "" for a text without rows of numbers.
    """
    found = above_numbers(text) or above_numbers(text, lambda cells: sum(map(is_number, cells)) > 1)
    if found is None:
        return ""
    above, numbers = found
    titles, *below = above or [numbers]
    suggestions = []
    titles = titles + [""] * (len(numbers) - len(titles))
    units: list[str | None] = [*below[0], *[""] * len(titles)] if below else [None] * len(titles)
    for title, unit in zip(titles, units, strict=False):
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
                f"{table.where}: columns {both}: both hold {quantity}: must be only one; remove the other,"
                " or write what differs, such as 20 °C or run 1, above the columns of each block"
            )
    places, names = zip(*(columns[0] for columns in found.values()), strict=True) if found else ((), ())
    return table.with_columns(places)._replace(names=list(names))


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


def _export(path, lines, separator, titles, known, incomplete):
    """Read the table whose titles are in the first line of `lines`."""
    (number, _), *below = lines
    where = f"{path}: line {number}"
    blocks = blocks_of(known)
    names = [title.name if blocks or title.label is None else None for title in known]
    units = [title.unit for title in known]
    first = _split(below[0][1], separator)
    if not _any_number(first):
        below = below[1:]
        missing = [""] * (len(titles) - len(first))
        first = missing + first if separator == "  " else first + missing
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
        enough = any(numbers) if incomplete or blocks else all(numbers)
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
    names = [settled_axis(name, unit) for name, unit in zip(names, units, strict=True)]
    spelled = [known_unit(unit, name) for unit, name in zip(units, names, strict=True)]
    table = TextTable(where, titles, names, spelled, _checked(path, len(titles), rows))
    return _long(table, blocks) if blocks else table


def _long(table: TextTable, blocks: dict[Label, list[int]]) -> TextTable:
    """Return a table with blocks of columns below each other, and the label as a column.

    Rows of a block without any cell are left out.
    """
    inside = {place for places in blocks.values() for place in places}
    shared = [i for i, name in enumerate(table.names) if name is not None and i not in inside]
    if len({tuple(table.units[i] for i in places) for places in blocks.values()}) > 1:
        raise ValueError(f"{table.where}: all blocks of columns must have the same units")
    name, places = next((label.name, places) for label, places in blocks.items())
    long = table.with_columns([*shared, *places])
    labelled = name is not None and name not in quantities_of(long.names)
    rows = [
        (line, [row[i] for i in (*shared, *places)] + [label.value] * labelled)
        for label, places in blocks.items()
        for line, row in table.rows
        if any(row[i] for i in places)
    ]
    if name is None or not labelled:
        return long._replace(rows=rows)
    unit = next(iter(COLUMNS[name].units))  # SI
    titles, names, units = [*long.titles, f"label [{unit}]"], [*long.names, name], [*long.units, unit]
    return TextTable(table.where, titles, names, units, rows)


def _checked(path: StrPath, count: int, rows: TextRows, unread: Collection[int] = ()) -> TextRows:
    """Convert decimal commas to points, and raise ValueError for a row without `count` fields.

    The columns `unread` may lack fields at the end of a row.
    """
    commas = any(_DECIMAL_COMMA.fullmatch(field) for _, fields in rows for field in fields)
    checked = []
    for line, fields in rows:
        while len(fields) > count and not fields[-1]:
            fields = fields[:-1]
        if all(place in unread for place in range(len(fields), count)):
            fields = [*fields, *[""] * (count - len(fields))]
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


def above_numbers(
    text: str, are_numbers: Callable[[list[str]], bool] = lambda cells: all(map(is_number, cells))
) -> tuple[list[list[str]], list[str]] | None:
    """Return the rows of titles and the widest row of numbers of a text, or None without numbers.

    The rows of titles are the last two rows, or fewer, that precede the numbers and have as many fields as
    the first row of numbers.
    """
    lines = [line.removeprefix("##") for line in text.splitlines() if has_fields(line) or line[:2] == "##"]
    for separator in ("\t", ";", ",", None):
        rows = [_split(line, separator) for line in lines]
        numbers = [i for i, row in enumerate(rows) if len(row) > 1 and are_numbers(row)]
        if numbers:
            first = numbers[0]
            titles = [row for row in rows[:first] if len(row) == len(rows[first])][-2:]
            return titles, max((rows[i] for i in numbers), key=len)
    return None


def has_fields(line: str) -> bool:
    """Return True unless a line is blank or a comment."""
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _split(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    if separator == "  ":
        fields = line.split()
        return fields if all(map(is_number, fields)) else re.split(r"\s{2,}", line.strip())
    quotes = csv.QUOTE_NONE if separator == "\t" else csv.QUOTE_MINIMAL  # with tabs E" means E''
    reader = csv.reader([line.strip("\r\n")], delimiter=separator, quoting=quotes, skipinitialspace=True)
    try:
        fields = [field.strip() for field in next(reader)]
    except (csv.Error, StopIteration):
        return [line.strip()]
    return [f[1:-1] if len(f) > 2 and f[0] == f[-1] == '"' else f for f in fields]


def _any_number(fields: list[str]) -> bool:
    return any(map(is_number, fields))
