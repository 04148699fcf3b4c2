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
columns may follow below, or side by side (`rubberfric.io.text_tables.wide_sheets`). Names are spelled as in
`rubberfric.io.columns`. A line of names may begin with ##.
"""

import json
import re
from collections.abc import Sequence
from typing import NamedTuple

from rubberfric.base.atomic import StrPath, is_number
from rubberfric.base.checks import shown
from rubberfric.io.columns import (
    COLUMNS,
    PREFERRED,
    SET_VALUES,
    is_foreign,
    is_unit,
    known_name,
    known_unit,
    quantities_of,
    settled_axis,
)
from rubberfric.io.text_tables.lines import (
    SEPARATORS,
    BadRows,
    TextLines,
    TextRows,
    above_numbers,
    any_number,
    checked_rows,
    has_fields,
    holds_data,
    is_error_cell,
    is_hole,
    is_misshapen,
    split_fields,
)
from rubberfric.io.text_tables.wide_sheets import (
    Label,
    LabelledTitle,
    blocks_of,
    labels_above,
    labels_in_units,
    read_title,
    selected_block,
    unlabelled_blocks,
)

_SEPARATOR = re.compile(r"[\t;,]")
# Largest number of columns for which a message suggests `columns=[...]`.
_MOST_SUGGESTED = 40


class TextTable(NamedTuple):
    """A table with names and units as in `COLUMNS`."""

    where: str  # file and line of the names
    titles: list[str]  # as written in the file
    names: list[str | None]  # in `COLUMNS` or `SET_VALUES`; None: unknown
    units: list[str]
    rows: TextRows  # numbers with decimal points
    bad: Sequence[tuple[int, str]] = ()  # line and fault of rows that cannot be read
    place: str = "line"  # what the number of a row counts

    def with_columns(self, places: Sequence[int]) -> "TextTable":
        """Return the table with only the columns at `places`."""
        titles, units = ([values[i] for i in places] for values in (self.titles, self.units))
        rows = [(line, [row[i] for i in places]) for line, row in self.rows]
        names = [self.names[i] for i in places]
        return self._replace(titles=titles, names=names, units=units, rows=rows)


def find_table(path: StrPath, text: str, generic: str = "E", block: int | None = None) -> TextTable | None:
    """Return the first table of another program in a text.

    The result is None if the text has no table, or a table in the format of this project.

    Parameters
    ----------
    path : name of the file in messages
    generic : "E" or "G", the meaning of "storage modulus"
    block : number of the block of columns, from 1, if columns have the same titles
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
            if not any(any_number(split_fields(row, separator)) for row in below):
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
            return _export(path, lines[place:], separator, titles, known, block)
    return None


def _titles(
    lines: TextLines, place: int, separator: str, generic: str
) -> tuple[list[str], list[LabelledTitle]]:
    """Return the titles in a line as written and as known.

    An empty title is in the line above if cells of a spreadsheet were merged.
    """
    if place >= len(lines):
        return [], []
    titles = split_fields(lines[place][1], separator)
    above = split_fields(lines[place - 1][1], separator) if place else []
    if any_number(above) or any_number(titles):
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
    if not (isinstance(titles, list | tuple) and titles and all(isinstance(title, str) for title in titles)):
        raise ValueError(
            f'{path}: columns = {shown(titles)}: must be a list of "name [unit]" for all columns'
        )
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
    read = [place for place, name in enumerate(names) if name is not None]
    rows, bad = _headless_rows(path, text, len(titles), read)
    if not rows:
        raise ValueError(f"{path}: must have rows that begin with a number")
    unread = [place for place, name in enumerate(names) if name is None] if read else []
    rows, misshapen = checked_rows(path, len(titles), rows, unread)
    return TextTable(f"{path}: columns", list(titles), names, units, rows, sorted(bad + misshapen))


def _headless_rows(path: StrPath, text: str, width: int, read: Sequence[int]) -> tuple[TextRows, BadRows]:
    """Return the rows of a table without titles. The columns at the places `read` are read."""
    rows, bad = [], []
    for number, line in enumerate(text.splitlines(), start=1):
        several = [
            fields for fields in (split_fields(line, s) for s in ("\t", ";", ",", None)) if len(fields) > 1
        ]
        fields = several[0] if several else [line.strip()]
        cells = [fields[place] for place in read if place < len(fields)]
        complete = len(cells) == len(read) > 0 and all(map(is_number, cells))
        if is_number(fields[0]) or complete:
            rows.append((number, fields))
        elif has_fields(line) and (rows or is_hole(fields[0])) and _has_data(line, fields, read, width):
            bad.append((number, _unreadable(path, number, line)))
    return rows, bad


def _has_data(line: str, fields: list[str], read: Sequence[int], width: int) -> bool:
    return holds_data(fields, read or range(width)) or is_misshapen(line, None, width)


def _unreadable(path: StrPath, line: int, text: str) -> str:
    return f"{path}: line {line}: {shown(text.strip())}: must be a row of numbers"


def suggested_columns(text: str) -> str:
    """Return a text `columns=[...]` that suggests names for the columns of a table.

    An unknown name or unit is shown as "?". The result is "" for a text without rows of numbers.
    """
    table = above_numbers(text) or above_numbers(text, lambda cells: sum(map(is_number, cells)) > 1)
    if table is None:
        return ""
    above, numbers = table
    titles, *below = above or [numbers]
    suggestions = []
    titles = titles + [""] * (len(numbers) - len(titles))
    units: list[str | None] = [*below[0], *[""] * len(titles)] if below else [None] * len(titles)
    for title, unit in zip(titles, units, strict=False):
        name, own = known_name(title)
        unit = own if own is not None else unit
        name = settled_axis(name, unit)
        column = COLUMNS.get(name or "")
        unit = known_unit(unit, name)
        known = column is not None and unit in column.units
        suggestions.append(f"{name} [{unit}]" if known else f"{name} [?]" if column else "?")
    if len(suggestions) > _MOST_SUGGESTED:
        return f"columns=[...] with {len(suggestions)} entries"
    return f"columns={json.dumps(suggestions, ensure_ascii=False)}"


def pick(table: TextTable, quantities: tuple[str, ...]) -> TextTable:
    """Return the table with only the columns of the given quantities.

    If a quantity has measured values, its set values are left out, and `PREFERRED` columns replace others. A
    ValueError is raised if two columns disagree about a quantity.
    """
    by_quantity: dict[str, list[tuple[int, str]]] = {}
    measured = {COLUMNS[name].name for name in table.names if name in COLUMNS}
    for place, name in enumerate(table.names):
        if name in SET_VALUES and COLUMNS[SET_VALUES[name]].name not in measured:
            name = SET_VALUES[name]
        if name in COLUMNS and COLUMNS[name].name in quantities:
            by_quantity.setdefault(COLUMNS[name].name, []).append((place, name))
    for quantity, places in by_quantity.items():
        places[:] = [(place, name) for place, name in places if name in PREFERRED] or places
        if len(places) > 1 and not _agree(table, places):
            both = " and ".join(shown(table.titles[place]) for place, _ in places[:5])
            count = unlabelled_blocks([LabelledTitle(name, None) for name in table.names])
            choice = f"; or choose one with block=1 to {count}" if count > 1 else ""
            raise ValueError(
                f"{table.where}: columns {both}: both hold {quantity}: must be only one; remove the other,"
                f" or write what differs, such as 20 °C or run 1, above the columns of each block{choice}"
            )
    places, names = (
        zip(*(columns[0] for columns in by_quantity.values()), strict=True) if by_quantity else ((), ())
    )
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


def _export(path, lines, separator, titles, known, block):
    """Read the table whose titles are in the first line of `lines`."""
    (number, _), *below = lines
    where = f"{path}: line {number}"
    first = split_fields(below[0][1], separator)
    missing = [""] * (len(titles) - len(first))
    first = missing + first if separator == "  " else first + missing
    has_units = _is_unit_row(first, below[0][1], separator, len(titles))
    if has_units:
        known, first = labels_in_units(known, first)
    known = selected_block(where, known, block)
    blocks = blocks_of(known)
    names = [title.name if blocks or title.label is None else None for title in known]
    units = [title.unit for title in known]
    if has_units:
        (line, _), *below = below
        _check_agreement(f"{path}: line {line}", titles, names, units, first)
        units = [own if own is not None else in_header for own, in_header in zip(units, first, strict=False)]
    elif all(unit is None for unit in units):
        columns = suggested_columns("\n".join(text for _, text in lines))
        raise ValueError(
            f"{where}: has names but no units: must have units in the row below or in brackets; or pass them:"
            f" {columns}"
        )
    names = [settled_axis(name, unit) for name, unit in zip(names, units, strict=True)]
    spelled = [known_unit(unit, name) for unit, name in zip(units, names, strict=True)]
    rows, bad = _rows_below(path, number, below, separator, titles, names, spelled)
    if not rows and not bad:
        raise ValueError(f"{path}: must have numbers below line {number}")
    rows, misshapen = checked_rows(path, len(titles), rows)
    table = TextTable(where, titles, names, spelled, rows, sorted(bad + misshapen))
    return _long(table, blocks) if blocks else table


def _rows_below(path, number, below, separator, titles, names, units) -> tuple[TextRows, BadRows]:
    """Return the rows below the titles in line `number`, and the lines with data that are no rows."""
    rows, bad = [], []
    places = [place for place, name in enumerate(names) if name is not None]
    notes: BadRows = []  # lines that belong to the preamble of a step if the titles follow again
    repeated = False
    for line, text in below:
        fields = split_fields(text, separator)
        if fields == titles:
            notes, repeated = [], True
        elif _repeats_units(fields, repeated):
            fields += [""] * (len(titles) - len(fields))
            _check_agreement(f"{path}: line {line}", titles, names, units, fields)
            repeated = False
        elif holds_data(fields, places):
            cells = [fields[place] for place in places if place < len(fields)]
            has_text = not (is_number(fields[0]) or is_hole(fields[0]))
            is_note = has_text and (len(fields) < len(titles) or len(cells) < len(places) or "" in cells)
            if is_note:
                notes.append((line, _unreadable(path, line, text)))
                continue
            bad, notes = bad + notes, []
            rows.append((line, fields))
        elif is_misshapen(text, separator, len(titles)):
            bad.append((line, _unreadable(path, line, text)))
        elif sum(known_name(field)[0] is not None for field in fields) > 1:
            raise ValueError(
                f"{path}: line {line}: has other columns than line {number}: a file must have one table"
            )
    return rows, bad + notes


def _is_unit_row(fields: list[str], text: str, separator: str, width: int) -> bool:
    """Return True if a line below the titles states units, and False for a row of numbers or a bad row.

    A unit may be 1, for numbers without unit.
    """
    if any(is_unit(field) for field in fields):
        return not any_number([field for field in fields if field != "1"])
    return (
        not any_number(fields)
        and not any(map(is_error_cell, fields))
        and not is_misshapen(text, separator, width)
    )


def _repeats_units(fields: list[str], repeated: bool) -> bool:
    """Return True if a line states units again. `repeated` is True below titles that are repeated."""
    if is_number(fields[0]) and fields[0] != "1":
        return False
    units = [is_unit(field) for field in fields]
    others = [field for field, unit in zip(fields, units, strict=True) if not unit]
    return any(units) and (repeated or all(field in ("", "-", "1") for field in others))


def _check_agreement(where, titles, names, units, below):
    """Raise ValueError if a row of units contradicts units that are known for the columns."""
    if not any(is_unit(text) for text in below):
        return
    for title, name, own, text in zip(titles, names, units, below, strict=False):
        if name not in COLUMNS or own is None or (in_text := known_unit(text, name)) == "-":
            continue
        column, known = COLUMNS[name], known_unit(own, name)
        if known not in column.units:
            continue  # no unit, such as "Oscillation strain (cmd)"
        if known != in_text and not (
            {known, in_text} <= column.units.keys() and column.value(1.0, known) == column.value(1.0, in_text)
        ):
            raise ValueError(
                f"{where}: unit {shown(text)} contradicts {known!r} of column {shown(title)}; must be equal"
            )


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
    return TextTable(table.where, titles, names, units, rows, table.bad)
