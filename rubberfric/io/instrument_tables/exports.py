"""Tables as instruments and other programs write them, found and named as `rubberfric.io.tables` has them.

::

    Filename        tread.txt                       "f";"E'";"E''";"T"
    Operator        ...                             "Hz";"MPa";"MPa";"°C"
                                                    "0,1";"8,97";"1,23";"20,0"
    Angular frequency   Storage modulus   ...       ...
    rad/s               MPa               ...
    0.1                 8.97              ...

A preamble, a row of names, a row of units (or the units in brackets behind the names), numbers;
commas, semicolons or tabs between them, decimal points or decimal commas; more such blocks below
the first, with the same columns. Names are those of `rubberfric.io.instrument_tables.aliases`.
"""

import csv
import re
from typing import NamedTuple

from rubberfric.io.instrument_tables.aliases import SET_VALUES, is_foreign, known_name, known_unit

_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")


class Export(NamedTuple):
    """A table of another program: its columns in the names and units of `columns.COLUMNS`."""

    where: str  # file and line of the names
    names: list  # as they stand in the file
    known: list  # in `columns.COLUMNS`, or None
    units: list
    rows: list  # (line, fields), numbers with decimal points


def find_table(path, text, columns, generic="E"):
    """The first table of a text that is an export, or None: then it is the project's own, or none.

    Parameters
    ----------
    path : how the file is called in messages
    columns : `columns.COLUMNS`
    generic : "E" or "G", what a "storage modulus" without a letter is
    """
    lines = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    lines = [(number, line) for number, line in lines if not line.lstrip().startswith("#")]
    for place, (_, line) in enumerate(lines):
        for separator in "\t;,":
            names = split(line, separator)
            read = [known_name(name, columns, generic) for name in names]
            below = [split(row, separator) for _, row in lines[place + 1 : place + 3]]
            if sum(name is not None for name, _ in read) < 2 or not any(_numbers(row) for row in below):
                continue
            first = place == 0 and separator == ","
            if first and not any(is_foreign(*pair, columns) for pair in zip(names, read, strict=True)):
                return None
            return _table(path, lines[place:], separator, names, read, columns)
    return None


def headless(path, text, titles, columns):
    """The table of a text whose columns are said by `titles`, "name [unit]" each, "-" for one not read.

    Lines that begin with no number are skipped, so a header may be there; blanks may separate columns.
    """
    if isinstance(titles, str) or not all(isinstance(title, str) for title in titles):
        raise ValueError(
            f'{path}: columns = {titles!r}: must be a list of "name [unit]", one for each column'
        )
    known, units = [], []
    for title in titles:
        name, unit = known_name(title, columns, "E") if title != "-" else (None, None)
        if title != "-" and (name is None or known_unit(unit, name, columns) not in columns[name].units):
            example = 'such as "f [Hz]", "E_stor [MPa]", "log10_q [log10(1/m)]", or "-" for a column not read'
            raise ValueError(f"{path}: columns: {title!r}: must be a known name and unit, {example}")
        known.append(name)
        units.append(None if name is None else known_unit(unit, name, columns))
    rows = []
    for number, line in enumerate(text.splitlines(), start=1):
        several = [fields for fields in (split(line, s) for s in ("\t", ";", ",", None)) if len(fields) > 1]
        fields = several[0] if several else [line.strip()]
        if _is_number(fields[0]):
            rows.append((number, fields))
    if not rows:
        raise ValueError(f"{path}: has no row that begins with a number: must have data")
    return Export(f"{path}: columns", list(titles), known, units, _checked(path, list(titles), rows))


def pick(export, columns, wanted, optional=()):
    """{quantity: (place, known name)} of the columns that hold quantities asked for, each once.

    ValueError if two columns hold one of them; a set value gives way to the measured one.
    """
    found = {}
    measured = {columns[name].name for name in export.known if name in columns}
    for place, known in enumerate(export.known):
        if known in SET_VALUES and columns[SET_VALUES[known]].name not in measured:
            known = SET_VALUES[known]
        if known not in columns or columns[known].name not in (*wanted, *optional):
            continue
        found.setdefault(columns[known].name, []).append((place, known))
    for quantity, places in found.items():
        if len(places) > 1 and not _agree(export, columns, places):
            both = " and ".join(repr(export.names[place]) for place, _ in places)
            raise ValueError(
                f"{export.where}: columns {both}: both are {quantity}; must be one: remove the other"
            )
    return {quantity: places[0] for quantity, places in found.items()}


def split(line, separator):
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


def _table(path, lines, separator, names, read, columns):
    """The export whose names are in the first of the lines."""
    (number, _), *below = lines
    where = f"{path}: line {number}"
    known = [name for name, _ in read]
    units = [unit for _, unit in read]
    if not _numbers(split(below[0][1], separator)):
        row, below = split(below[0][1], separator), below[1:]
        row += [""] * (len(names) - len(row))
        units = [own if own is not None else given for own, given in zip(units, row, strict=False)]
    elif all(unit is None for unit in units):
        raise ValueError(
            f"{where}: has names but no units: must have them in the row below, or in brackets behind names"
        )
    units = [known_unit(unit, name, columns) for unit, name in zip(units, known, strict=True)]
    rows, count = [], sum(name is not None for name in known)
    for place, text in below:
        fields = split(text, separator)
        cells = [field for field, name in zip(fields, known, strict=False) if name is not None]
        numbers = [_is_number(cell) for cell in cells]
        if _is_number(fields[0]) or (len(cells) == count and all(numbers)):
            rows.append((place, fields))
        elif len(cells) == count and any(numbers):
            raise ValueError(f"{path}: line {place}: {text.strip()[:60]!r}: must be numbers")
        elif fields != names and sum(known_name(f, columns, "E")[0] is not None for f in fields) > 1:
            raise ValueError(
                f"{path}: line {place}: has other columns than line {number}: must be one table a file"
            )
    if not rows:
        raise ValueError(f"{path}: has no numbers below line {number}: must have data")
    return Export(where, names, known, units, _checked(path, names, rows))


def _checked(path, names, rows):
    """Rows with as many fields as there are names, and with decimal points."""
    commas = any(_DECIMAL_COMMA.fullmatch(field) for _, fields in rows for field in fields)
    checked = []
    for line, fields in rows:
        while len(fields) > len(names) and not fields[-1]:
            fields = fields[:-1]
        if len(fields) != len(names):
            raise ValueError(f"{path}: line {line}: has {len(fields)} fields: must have {len(names)}")
        if commas:
            points = [field for field in fields if "." in field and _is_number(field.replace(",", ""))]
            if points:
                raise ValueError(
                    f"{path}: line {line}: {points[0]!r}: has a decimal point, others a comma: must be one"
                )
            fields = [f.replace(",", ".") if _DECIMAL_COMMA.fullmatch(f) else f for f in fields]
        checked.append((line, fields))
    return checked


def _numbers(fields):
    return any(_is_number(field) for field in fields)


def _is_number(field):
    try:
        float(field.replace(",", ".", 1))
    except ValueError:
        return False
    return True


def _agree(export, columns, places):
    """Whether columns hold the same quantity in two spellings, as omega and f do, to the digits of a file."""
    if len({known for _, known in places}) < len(places):
        return False
    for _, fields in export.rows:
        numbers = [(columns[known], fields[place], export.units[place]) for place, known in places]
        try:
            values = [column.value(float(field), unit) for column, field, unit in numbers]
        except (ValueError, KeyError):
            return False
        if max(values) - min(values) > 1e-3 * abs(values[0]):
            return False
    return True
