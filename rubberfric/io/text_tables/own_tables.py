"""Tables in the format of this project: CSV with a row of names, a row of units, and numbers."""

import csv
import io
from collections.abc import Sequence

from rubberfric.base.atomic import StrPath
from rubberfric.base.checks import closest, shown
from rubberfric.io.columns import COLUMNS, known_name, known_unit
from rubberfric.io.exports import TextTable, suggested_columns
from rubberfric.io.text_tables.derived import RELATIONS
from rubberfric.io.text_tables.lines import BadRows, TextRows, above_numbers, has_fields


def project_table(
    path: StrPath, text: str, needed: Sequence[str], optional: Sequence[str]
) -> tuple[TextTable, str]:
    """Return a table with checked names, and the place of its units in messages.

    Rows that are not CSV, or have another number of fields, are bad rows of the table.
    """
    every, bad = project_rows(path, text)
    (name_line, names), (unit_line, units), *below = every
    where = f"{path}: line {name_line}"
    known = {n: c.name for n, c in COLUMNS.items() if c.name in (*needed, *optional) and c.offered}
    for name in names:
        if name not in known:
            raise ValueError(f"{where}: column {shown(name)}: {closest(name, tuple(known))}")
    quantities = [known[name] for name in names]
    for quantity in needed:
        if quantity not in quantities:
            raise ValueError(missing_column(where, quantity))
    for i, quantity in enumerate(quantities):
        if quantity in quantities[:i]:
            raise ValueError(f"{where}: column {names[i]!r}: {quantity} is given twice; must be given once")
    rows = [(line, row) for line, row in below if len(row) == len(names)]
    for line, row in every[1:]:
        if len(row) != len(names):
            bad.append((line, f"{path}: line {line}: has {len(row)} fields: must have {len(names)}"))
    if len(units) != len(names):
        raise ValueError(bad[-1][1])
    spelled = [known_unit(unit, name) for unit, name in zip(units, names, strict=True)]
    # The unit of a logarithm must say so here.
    units = [unit if own.startswith("log10") else own for own, unit in zip(spelled, units, strict=True)]
    table = TextTable(where, names, list(names), units, rows, bad)
    return table, f"{path}: line {unit_line}"


def project_rows(path: StrPath, content: str) -> tuple[TextRows, BadRows]:
    """Return (line number, fields) of all lines except comments, and the lines that are not CSV."""
    rows, bad = [], []
    for line, text in enumerate(io.StringIO(content), start=1):
        if has_fields(text):
            # Each line is parsed alone, so that a stray quote is an error in its line.
            try:
                fields = next(csv.reader([text.rstrip("\r\n")], strict=True, skipinitialspace=True))
            except csv.Error as error:
                bad.append((line, f"{path}: line {line}: is not CSV: {error}"))
                if len(rows) < 2:
                    raise ValueError(f"{bad[-1][1]}; must have a name row, a unit row and data") from None
                continue
            rows.append((line, [field.strip() for field in fields]))
    if rows and all(word.lstrip("+-.")[:1].isdigit() for field in rows[0][1] for word in field.split()):
        first = rows[0][0]
        titles = _has_titles_above(content.splitlines()[:first])
        hint = f" (remove the # of the titles in line {first - 1})" if titles else ""
        raise ValueError(
            f"{path}: line {first}: begins with numbers: must have a row of names and a row of units{hint},"
            ' or name the columns, such as "f [Hz]" or "E_stor [MPa]", and "-" for one not read: '
            f"{suggested_columns(content)}"
        )
    if len(rows) + len(bad) < 3:
        raise ValueError(f"{path}: has {len(rows)} rows: must have a name row, a unit row and data")
    return rows, bad


def _has_titles_above(lines):
    """Return True if the line above the last one has as many fields, and a title that `known_name` knows."""
    *_, comment, row = ["", *lines]
    above, _ = above_numbers(f"{comment.lstrip('# ')}\n{row}") or ([], [])
    return any(known_name(title)[0] for titles in above for title in titles)


def missing_column(where: str, quantity: str) -> str:
    """Return the message about a missing column, with the columns that would determine it."""
    spellings = [name for name, column in COLUMNS.items() if column.name == quantity and column.offered]
    spellings = spellings or [quantity]
    every = [set(relation.columns) for relation in RELATIONS if relation.result == quantity]
    ways = [
        " and ".join(relation.columns)
        for relation in RELATIONS
        if relation.result == quantity and not any(other < set(relation.columns) for other in every)
    ]
    computed = f", or {' or '.join(ways)}" if ways else ""
    return f"{where}: no column {' or '.join(spellings)}: the table must have one{computed}"
