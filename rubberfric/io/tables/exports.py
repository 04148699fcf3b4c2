"""Tables as instruments and other programs write them, found in a text.

::

    Filename        tread.txt                       "f";"E'";"E''";"T"
    Operator        ...                             "Hz";"MPa";"MPa";"°C"
                                                    "0,1";"8,97";"1,23";"20,0"
    Angular frequency   Storage modulus   ...       ...
    rad/s               MPa               ...
    0.1                 8.97              ...

A preamble, a row of names, a row of units (or the units in brackets behind the names), numbers;
commas, semicolons or tabs between them, decimal points or decimal commas; more such blocks below
the first, with the same columns. Names are those of `rubberfric.io.tables.titles`.
"""

import csv
import json
import re
from typing import NamedTuple

from rubberfric.base.atomic import StrPath
from rubberfric.io.tables.columns import COLUMNS
from rubberfric.io.tables.titles import SET_VALUES, is_foreign, known_name, known_unit

_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")

Rows = list[tuple[int, list[str]]]  # (line, fields)


class Table(NamedTuple):
    """A table with names and units as `COLUMNS` has them."""

    where: str  # file and line of the names
    titles: list[str]  # as they stand in the file
    names: list[str | None]  # in `COLUMNS` or `SET_VALUES`; None: not known
    units: list[str]
    rows: Rows  # numbers with decimal points


def find_table(path: StrPath, text: str, generic: str = "E") -> Table | None:
    """The first table of a text that is an export, or None: then it is the project's own, or none.

    Parameters
    ----------
    path : how the file is called in messages
    generic : "E" or "G", what a "storage modulus" without a letter is
    """
    lines = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    lines = [(number, line) for number, line in lines if not line.lstrip().startswith("#")]
    for place, (_, line) in enumerate(lines):
        for separator in "\t;,":
            titles = split(line, separator)
            known = [known_name(title, generic) for title in titles]
            below = [split(row, separator) for _, row in lines[place + 1 : place + 3]]
            if sum(name is not None for name, _ in known) < 2 or not any(map(_any_number, below)):
                continue
            own = place == 0 and separator == ","
            if own and not any(is_foreign(t, name) for t, (name, _) in zip(titles, known, strict=True)):
                return None
            names, units = ([pair[i] for pair in known] for i in (0, 1))
            return _table(path, lines[place:], separator, titles, names, units)
    return None


def headless(path: StrPath, text: str, titles: list[str]) -> Table:
    """The table of a text whose columns are said by `titles`, "name [unit]" each, "-" for one not read.

    Lines that begin with no number are skipped, so a header may be there; blanks may separate columns.
    """
    if isinstance(titles, str) or not all(isinstance(title, str) for title in titles):
        raise ValueError(
            f'{path}: columns = {titles!r}: must be a list of "name [unit]", one for each column'
        )
    names, units = [], []
    for title in titles:
        name, unit = known_name(title, "E") if title != "-" else (None, None)
        unit = known_unit(unit, name)
        if title != "-" and (name not in COLUMNS or unit not in COLUMNS[name].units):
            example = 'such as "f [Hz]", "E_stor [MPa]", "log10_q [log10(1/m)]", or "-" for a column not read'
            raise ValueError(f"{path}: columns: {title!r}: must be a known name and unit, {example}")
        names.append(name)
        units.append(unit)
    rows = []
    for number, line in enumerate(text.splitlines(), start=1):
        several = [fields for fields in (split(line, s) for s in ("\t", ";", ",", None)) if len(fields) > 1]
        fields = several[0] if several else [line.strip()]
        if _is_number(fields[0]):
            rows.append((number, fields))
    if not rows:
        raise ValueError(f"{path}: has no row that begins with a number: must have data")
    return Table(f"{path}: columns", list(titles), names, units, _checked(path, len(titles), rows))


def above_numbers(text: str) -> tuple[list[list[str]], list[str]] | None:
    """Fields of the rows that name the columns of a text, and of its first row of numbers; None without one.

    The last two rows above the numbers with as many fields: names and units, or fewer.
    """
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    for separator in ("\t", ";", ",", None):
        rows = [split(line, separator) for line in lines]
        first = next((i for i, row in enumerate(rows) if len(row) > 1 and all(map(_is_number, row))), None)
        if first is not None:
            return [row for row in rows[:first] if len(row) == len(rows[first])][-2:], rows[first]
    return None


def suggested_columns(text: str) -> str:
    """`columns=[...]` for a table that says its columns in names that are not known, as far as they are.

    A "?" stands for a column to be named; "" where the text has no rows of numbers.
    """
    found = above_numbers(text)
    if found is None:
        return ""
    above, numbers = found
    titles, *below = above or [numbers]
    units = below[0] if below else [None] * len(titles)
    said = []
    for title, unit in zip(titles, units, strict=True):
        name, own = known_name(title, "E")
        column = COLUMNS.get(name or "")
        unit = known_unit(own if own is not None else unit, name)
        known = column is not None and unit in column.units
        said.append(f"{name} [{unit}]" if known else f"{name} [?]" if column else "?")
    return f"columns={json.dumps(said, ensure_ascii=False)}"


def pick(export: Table, quantities: tuple[str, ...]) -> dict[str, tuple[int, str]]:
    """{quantity: (place, name of the column)} of what is there of the quantities asked for, each once.

    ValueError if two columns hold one of them; a set value gives way to the measured one.
    """
    found: dict[str, list[tuple[int, str]]] = {}
    measured = {COLUMNS[name].name for name in export.names if name in COLUMNS}
    for place, name in enumerate(export.names):
        if name in SET_VALUES and COLUMNS[SET_VALUES[name]].name not in measured:
            name = SET_VALUES[name]
        if name in COLUMNS and COLUMNS[name].name in quantities:
            found.setdefault(COLUMNS[name].name, []).append((place, name))
    for quantity, places in found.items():
        if len(places) > 1 and not _agree(export, places):
            both = " and ".join(repr(export.titles[place]) for place, _ in places)
            raise ValueError(
                f"{export.where}: columns {both}: both are {quantity}; must be one: remove the other"
            )
    return {quantity: places[0] for quantity, places in found.items()}


def split(line: str, separator: str | None) -> list[str]:
    """Stripped fields of a line; `None` separates at blanks."""
    if separator is None:
        return line.split()
    quotes = csv.QUOTE_NONE if separator == "\t" else csv.QUOTE_MINIMAL  # tabs need none, and E" is E''
    reader = csv.reader([line.strip("\r\n")], delimiter=separator, quoting=quotes, skipinitialspace=True)
    try:
        fields = [field.strip() for field in next(reader)]
    except (csv.Error, StopIteration):
        return [line.strip()]
    return [f[1:-1] if len(f) > 2 and f[0] == f[-1] == '"' else f for f in fields]


def _table(path, lines, separator, titles, names, units):
    """The export whose titles are in the first of the lines."""
    (number, _), *below = lines
    where = f"{path}: line {number}"
    first = split(below[0][1], separator)
    if not _any_number(first):
        below = below[1:]
        first += [""] * (len(titles) - len(first))
        units = [own if own is not None else given for own, given in zip(units, first, strict=False)]
    elif all(unit is None for unit in units):
        raise ValueError(
            f"{where}: has names but no units: must have them in the row below, or in brackets behind names"
        )
    rows, count = [], sum(name is not None for name in names)
    for place, text in below:
        fields = split(text, separator)
        cells = [field for field, name in zip(fields, names, strict=False) if name is not None]
        numbers = [_is_number(cell) for cell in cells]
        if _is_number(fields[0]) or (len(cells) == count and all(numbers)):
            rows.append((place, fields))
        elif len(cells) == count and any(numbers):
            raise ValueError(f"{path}: line {place}: {text.strip()[:60]!r}: must be numbers")
        elif fields != titles and sum(known_name(field, "E")[0] is not None for field in fields) > 1:
            raise ValueError(
                f"{path}: line {place}: has other columns than line {number}: must be one table a file"
            )
    if not rows:
        raise ValueError(f"{path}: has no numbers below line {number}: must have data")
    spelled = [known_unit(unit, name) for unit, name in zip(units, names, strict=True)]
    return Table(where, titles, names, spelled, _checked(path, len(titles), rows))


def _checked(path: StrPath, count: int, rows: Rows) -> Rows:
    """Rows with so many fields, and with decimal points."""
    commas = any(_DECIMAL_COMMA.fullmatch(field) for _, fields in rows for field in fields)
    checked = []
    for line, fields in rows:
        while len(fields) > count and not fields[-1]:
            fields = fields[:-1]
        if len(fields) != count:
            raise ValueError(f"{path}: line {line}: has {len(fields)} fields: must have {count}")
        if commas:
            points = [field for field in fields if "." in field and _is_number(field.replace(",", ""))]
            if points:
                raise ValueError(
                    f"{path}: line {line}: {points[0]!r}: has a decimal point, others a comma: must be one"
                )
            fields = [f.replace(",", ".") if _DECIMAL_COMMA.fullmatch(f) else f for f in fields]
        checked.append((line, fields))
    return checked


def _any_number(fields: list[str]) -> bool:
    return any(map(_is_number, fields))


def _is_number(field: str) -> bool:
    try:
        float(field.replace(",", ".", 1))
    except ValueError:
        return False
    return True


def _agree(export: Table, places: list[tuple[int, str]]) -> bool:
    """Whether columns hold the same quantity in two spellings, as omega and f do, to the digits of a file."""
    if len({name for _, name in places}) < len(places):
        return False
    for _, fields in export.rows:
        try:
            values = [COLUMNS[name].value(float(fields[i]), export.units[i]) for i, name in places]
        except (ValueError, KeyError):
            return False
        if max(values) - min(values) > 1e-3 * abs(values[0]):
            return False
    return True
