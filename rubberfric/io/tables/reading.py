"""CSV tables with two header rows, names and units; every column is handed out in SI.

::

    f,E_stor,E_loss
    Hz,MPa,MPa
    1e-05,4.35,0.29
    ...

The name says what a column is and the unit how it is converted: `f` [Hz] becomes `omega`
[rad/s], `log10_v` becomes `v`. Nothing is guessed: an unknown name or unit is an error.
Blank lines and lines that begin with # are skipped.
"""

import csv
import io
import math
from collections.abc import Sequence

import numpy as np

from rubberfric.base.atomic import StrPath
from rubberfric.base.checks import closest
from rubberfric.io.tables.columns import COLUMNS, MODULI
from rubberfric.io.tables.exports import Rows, Table, find_table, headless, pick, suggested_columns
from rubberfric.io.tables.moduli import missing, with_moduli
from rubberfric.io.tables.text import read_text
from rubberfric.io.tables.titles import SET_VALUES
from rubberfric.io.tables.traces import read_traces


def read_table(
    path: StrPath,
    needed: Sequence[str],
    optional: Sequence[str] = (),
    increasing: bool = True,
    columns: list[str] | None = None,
    poisson: float | None = None,
    generic: str | None = None,
) -> dict[str, np.ndarray]:
    """Columns of a table in SI: one of the project's own, or an export (`rubberfric.io.tables.exports`).

    Parameters
    ----------
    path : path of the file
    needed, optional : tuples of names in SI ("omega", not "f")
        columns the file must hold and may hold. E_stor and E_loss may follow from others: tan(delta),
        |E*|, or shear moduli. Further columns are errors in an own table, and left out of an export.
    increasing : whether the first needed column must increase strictly; in an export it may also fall
    columns : list of "name [unit]", what the columns are of a file that does not say so, or None
    poisson : Poisson's ratio [-] for E = 2 (1 + poisson) G, or None
    generic : "E" or "G", what a "storage modulus" is; None: "G" if poisson is given, else "E"

    Returns
    -------
    dict of name in SI -> float64 array, shape (number of rows,)

    Raises
    ------
    ValueError
        one line naming file, line, column, value and rule: the file is missing or is not
        text, a column is unknown, missing or given twice, the unit is unknown, a row has
        the wrong number of fields, or a value is empty, no number, not finite, of the
        wrong sign or out of order; shear moduli without Poisson's ratio, or the reverse.
    """
    text = read_text(path, exports=True)
    export = _export(path, text, columns, generic or ("E" if poisson is None else "G"))
    found = _own(path, text, needed, optional) if export is None else _of_export(export, needed, optional)
    table = {}
    kinds = [COLUMNS[name] for name in found.names if name is not None]
    for i, (title, column, unit) in enumerate(zip(found.titles, kinds, found.units, strict=True)):
        texts = [(f"{path}: line {line}: {title} = {row[i]!r}", row[i]) for line, row in found.rows]
        table[column.name] = np.array([column.read(where, text, unit) for where, text in texts])
    if export is not None or (poisson is not None and generic is None):
        table = with_moduli(found.where, table, needed, optional, poisson, generic is None)
        for quantity in needed:
            if quantity not in table:
                raise ValueError(missing(found.where, quantity) + ("" if columns else column_hint(path)))
    if increasing:
        first = table[needed[0]]
        if export is not None and np.all(np.diff(first) < 0):
            return {name: values[::-1] for name, values in table.items()}
        bad = np.flatnonzero(~(np.diff(first) > 0))
        if bad.size:
            i = [column.name for column in kinds].index(needed[0])
            (_, before), (line, row) = found.rows[bad[0] : bad[0] + 2]
            raise ValueError(
                f"{path}: line {line}: {found.titles[i]} = {row[i]} after {before[i]}: must increase strictly"
            )
    return table


def read_columns(
    path: StrPath, columns: list[str] | None = None, poisson: float | None = None
) -> dict[str, np.ndarray]:
    """Everything that a table holds and that has a name here, in SI.

    Parameters
    ----------
    path, columns, poisson : as in `read_table`

    Returns
    -------
    dict of name in SI ("omega", "E_stor", "T", ...) -> float64 array, shape (number of rows,)

    Raises
    ------
    ValueError : as `read_table`, or two columns hold the same quantity.
    """
    names = read_names(path, columns, "E" if poisson is None else "G")
    quantities = tuple(dict.fromkeys(COLUMNS[name].name for name in names if name in COLUMNS))
    if not quantities:
        near = closest("".join(names[:1]), tuple(COLUMNS))
        raise ValueError(f"{path}: columns {', '.join(names)}: none is known; {near}{column_hint(path)}")
    moduli = ("E_stor", "E_loss") if {"E_stor", *MODULI} & set(quantities) else ()
    plain = tuple(name for name in quantities if name not in (*MODULI, *moduli))
    return read_table(path, (*plain, *moduli), (), increasing=False, columns=columns, poisson=poisson)


def read_directions(path: StrPath) -> tuple[np.ndarray, np.ndarray]:
    """A spectrum over wavevector and direction from a CSV file with the columns q, phi or phi_deg, and C.

    Returns
    -------
    q (n,), C (n, directions): C of every q at phi = k pi / directions, k = 0, 1, ...

    Raises
    ------
    ValueError
        as `read_table`, or the rows are no such grid, q by q and every q with all directions in order;
        phi may be off by 1/1000 of the distance to the next direction, as rounding leaves it.
    """
    table = read_table(path, ("q", "phi", "C"), increasing=False)
    q, phi, C = table["q"], table["phi"], table["C"]
    count = int(np.argmax(q != q[0])) or q.size
    for i, (q_i, phi_i) in enumerate(zip(q, phi, strict=True)):
        k, first = i % count, q[i - i % count]
        where = f"{path}: row {i + 1} of the data: q = {q_i:g} 1/m, phi = {math.degrees(phi_i):g} deg"
        if q_i != first or (k == 0 and i > 0 and not q_i > q[i - 1]):
            raise ValueError(f"{where}: q must increase, each with {count} directions as the first has")
        if abs(phi_i - k * math.pi / count) > 1e-3 * math.pi / count:
            raise ValueError(
                f"{where}: phi must be {180 * k / count:g} deg, for the {count} directions of a q are "
                f"0, {180 / count:g}, ... deg"
            )
    if q.size % count:
        raise ValueError(
            f"{path}: q = {q[-1]:g} 1/m has {q.size % count} directions: must have {count} as the first has"
        )
    return q[::count], C.reshape(-1, count)


def read_names(path: StrPath, columns: list[str] | None = None, generic: str = "E") -> list[str]:
    """Names of the columns of a table, in an export only the known; ValueError if it is none."""
    text = read_text(path, exports=True)
    export = _export(path, text, columns, generic)
    if export is None:
        return _rows(path, text)[0][1]
    return [SET_VALUES.get(name, name) for name in export.names if name is not None]


def column_hint(path: StrPath) -> str:
    """End of a message on unknown titles: what reads the file, or what to say instead, filled in for it."""
    try:
        read_traces(path)
    except ValueError:
        pass
    else:
        return "; heights along lines: rubberfric.io.read_traces reads them"
    said = suggested_columns(read_text(path, exports=True))
    advice = 'or say what they are, "name [unit]" for each ?, "-" for one not read'
    if '"strain [' in said:
        return '; a strain sweep: rubberfric.io.read_table(path, ["strain", "E_stor", "E_loss"]) reads it'
    return f"; {advice}: {said}" if said else ""


def _export(path: StrPath, text: str, titles: list[str] | None, generic: str) -> Table | None:
    """The table of another program in a text, or None if it is an own one."""
    return find_table(path, text, generic) if titles is None else headless(path, text, titles)


def _own(path: StrPath, text: str, needed: Sequence[str], optional: Sequence[str]) -> Table:
    """What is read of an own table: all that it has."""
    (name_line, names), (unit_line, units), *rows = every = _rows(path, text)
    where = f"{path}: line {name_line}"
    _check_names(where, names, needed, optional)
    for line, row in every[1:]:
        if len(row) != len(names):
            raise ValueError(f"{path}: line {line}: has {len(row)} fields: must have {len(names)}")
    _check_units(f"{path}: line {unit_line}", names, names, units)
    return Table(where, names, list(names), units, rows)


def _of_export(export: Table, needed: Sequence[str], optional: Sequence[str]) -> Table:
    """What is read of an export: only the columns asked for, and those they may follow from."""
    more = MODULI if "E_stor" in needed else ()
    picked = pick(export, (*needed, *optional, *more))
    places = [place for place, _ in picked.values()]
    names = [name for _, name in picked.values()]
    titles, units = ([values[i] for i in places] for values in (export.titles, export.units))
    _check_units(export.where, titles, names, units)
    rows = [(line, [row[i] for i in places]) for line, row in export.rows]
    return Table(export.where, titles, list(names), units, rows)


def _check_units(where: str, titles: list[str], names: list[str], units: list[str]) -> None:
    for title, name, unit in zip(titles, names, units, strict=True):
        known = COLUMNS[name].units
        if unit not in known:
            raise ValueError(f"{where}: column {title}: unit {unit!r}: must be one of {', '.join(known)}")


def _rows(path: StrPath, content: str) -> Rows:
    """(line number, stripped fields) of every line that is neither blank nor a comment."""
    rows = []
    for line, text in enumerate(io.StringIO(content), start=1):
        if text.strip() and not text.lstrip().startswith("#"):
            # line by line: a stray quote stays an error of its own line
            try:
                fields = next(csv.reader([text.rstrip("\r\n")], strict=True, skipinitialspace=True))
            except csv.Error as error:
                raise ValueError(f"{path}: line {line}: is not CSV: {error}") from None
            rows.append((line, [field.strip() for field in fields]))
    if rows and all(word.lstrip("+-.")[:1].isdigit() for field in rows[0][1] for word in field.split()):
        raise ValueError(
            f"{path}: line {rows[0][0]}: begins with numbers: must have a row of names and one of units, or"
            ' columns be given, such as ["f [Hz]", "E_stor [MPa]", "E_loss [MPa]"]'
        )
    if len(rows) < 3:
        raise ValueError(f"{path}: has {len(rows)} rows: must have a name row, a unit row and data")
    return rows


def _check_names(where: str, names: list[str], needed: Sequence[str], optional: Sequence[str]) -> None:
    """ValueError unless the names of a file are those of the quantities asked for, each once."""
    known = {n: c.name for n, c in COLUMNS.items() if c.name in (*needed, *optional) and c.offered}
    for name in names:
        if name not in known:
            raise ValueError(f"{where}: column {name!r}: {closest(name, tuple(known))}")
    given = [known[name] for name in names]
    for quantity in needed:
        if quantity not in given:
            raise ValueError(missing(where, quantity))
    for i, quantity in enumerate(given):
        if quantity in given[:i]:
            raise ValueError(f"{where}: column {names[i]!r}: {quantity} is given twice; must be given once")
