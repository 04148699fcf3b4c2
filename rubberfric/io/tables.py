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

import numpy as np

from rubberfric.base.atomic import as_path, replacing
from rubberfric.base.checks import closest
from rubberfric.io.columns import COLUMNS, MODULI
from rubberfric.io.instrument_tables import exports
from rubberfric.io.instrument_tables.moduli import missing, with_moduli

# Bytes above ASCII that exports in Latin-1 have: ° µ ² ³ · and German vowels.
_LATIN = b"\xb0\xb5\xb2\xb3\xb7\xe4\xf6\xfc\xc4\xd6\xdc\xdf"


def read_table(path, wanted, optional=(), increasing=True, columns=None, poisson=None, generic=None):
    """Columns of a table in SI: one of the project's own, or an export (`rubberfric.io.instrument_tables.exports`).

    Parameters
    ----------
    path : path of the file
    wanted, optional : tuples of names in SI ("omega", not "f")
        columns the file must hold and may hold. E_stor and E_loss may follow from others: tan(delta),
        |E*|, or shear moduli. Further columns are errors in an own table, and left out of an export.
    increasing : whether the first wanted column must increase strictly; in an export it may also fall
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
    if export is None:
        where, titles, kinds, units, data = _own(path, text, wanted, optional)
    else:
        where, titles, kinds, units, data = _theirs(export, wanted, optional)
    table = {}
    for i, (title, column, unit) in enumerate(zip(titles, kinds, units, strict=True)):
        texts = [(f"{path}: line {line}: {title} = {row[i]!r}", row[i]) for line, row in data]
        table[column.name] = np.array([_value(at, field, unit, column) for at, field in texts])
    if export is not None or (poisson is not None and generic is None):
        table = with_moduli(where, table, wanted, optional, poisson, generic is None)
    if increasing:
        first = table[wanted[0]]
        if export is not None and np.all(np.diff(first) < 0):
            return {name: values[::-1] for name, values in table.items()}
        bad = np.flatnonzero(~(np.diff(first) > 0))
        if bad.size:
            line, row = data[bad[0] + 1]
            i = next(i for i, column in enumerate(kinds) if column.name == wanted[0])
            before = data[bad[0]][1][i]
            raise ValueError(
                f"{path}: line {line}: {titles[i]} = {row[i]} after {before}: must increase strictly"
            )
    return table


def read_columns(path, columns=None, poisson=None):
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
        near = closest("".join(names[:1]), COLUMNS)
        raise ValueError(f"{path}: columns {', '.join(names)}: none is known; {near}")
    moduli = ("E_stor", "E_loss") if {"E_stor", *MODULI} & set(quantities) else ()
    plain = tuple(name for name in quantities if name not in (*MODULI, *moduli))
    return read_table(path, (*plain, *moduli), (), increasing=False, columns=columns, poisson=poisson)


def read_directions(path):
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


def read_names(path, columns=None, generic="E"):
    """Names of the columns of a table, in an export only the known; ValueError if it is none."""
    text = read_text(path, exports=True)
    export = _export(path, text, columns, generic)
    if export is None:
        return _rows(path, text)[0][1]
    return [exports.SET_VALUES.get(name, name) for name in export.known if name is not None]


def write_table(path, table, comment=""):
    """Write columns in SI (a dict of name -> sequence, names as in `COLUMNS`) as a CSV file.

    Numbers have as many digits as it takes to read the same ones back. `comment` goes to
    the top, each line behind a #. ValueError if a name is not known in SI, if lengths differ
    or if a value is one that `read_table` refuses.
    """
    for name in table:
        if name not in COLUMNS or COLUMNS[name].name != name:
            known = sorted({column.name for column in COLUMNS.values()})
            raise ValueError(f"{path}: column {name!r}: must be one of {', '.join(known)}")
    columns = {name: np.asarray(values, float) for name, values in table.items()}
    lengths = {name: values.shape for name, values in columns.items()}
    if len(set(lengths.values())) != 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise ValueError(f"{path}: shapes of columns {lengths}: must be one-dimensional and equal")
    for name, values in columns.items():
        for i, value in enumerate(values.tolist()):
            _check(f"{path}: {name}[{i}] = {value!r}", value, COLUMNS[name])
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        file.writelines(f"# {line}\n" for line in comment.splitlines())
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerow([next(iter(COLUMNS[name].units)) for name in columns])
        writer.writerows(zip(*(map(repr, values.tolist()) for values in columns.values()), strict=True))


def read_text(path, exports=False):
    """Text of a file; ValueError in one line if it is missing, unreadable or not UTF-8.

    `exports` says that UTF-16 and signs like ° and µ in Latin-1 will do as well.
    """
    try:
        content = as_path(path).read_bytes()
        if exports and content[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return content.decode("utf-16")
        if exports and set(content) - set(range(128)) <= set(_LATIN):
            return content.decode("latin-1")
        return content.decode("utf-8-sig")
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # not UTF-8, or a path with a NUL byte
        raise ValueError(f"{path}: cannot be read as text: {error}") from None


def _export(path, text, titles, generic):
    """The table of another program in a text, or None if it is an own one."""
    if titles is not None:
        return exports.headless(path, text, titles, COLUMNS)
    return exports.find_table(path, text, COLUMNS, generic)


def _own(path, text, wanted, optional):
    """(where, titles, kinds, units, rows) of an own table."""
    rows = _rows(path, text)
    (name_line, names), (unit_line, units), *data = rows
    where = f"{path}: line {name_line}"
    kinds = _columns(where, names, wanted, optional)
    for line, row in rows[1:]:
        if len(row) != len(names):
            raise ValueError(f"{path}: line {line}: has {len(row)} fields: must have {len(names)}")
    for name, unit, column in zip(names, units, kinds, strict=True):
        _check_unit(f"{path}: line {unit_line}: column {name}", unit, column)
    return where, names, kinds, units, data


def _theirs(export, wanted, optional):
    """The same of an export: only the columns asked for, and those they may follow from."""
    more = MODULI if "E_stor" in wanted else ()
    picked = exports.pick(export, COLUMNS, wanted, (*optional, *more))
    places = [place for place, _ in picked.values()]
    kinds = [COLUMNS[known] for _, known in picked.values()]
    titles, units = ([values[i] for i in places] for values in (export.names, export.units))
    for title, unit, column in zip(titles, units, kinds, strict=True):
        _check_unit(f"{export.where}: column {title}", unit, column)
    return export.where, titles, kinds, units, [(line, [row[i] for i in places]) for line, row in export.rows]


def _check_unit(where, unit, column):
    if unit not in column.units:
        raise ValueError(f"{where}: unit {unit!r}: must be one of {', '.join(column.units)}")


def _rows(path, content):
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


def _columns(where, names, wanted, optional):
    """The `Column` of every name of a file; ValueError unless they are the ones asked for."""
    known = {n: c for n, c in COLUMNS.items() if c.name in (*wanted, *optional) and c.offered}
    for name in names:
        if name not in known:
            raise ValueError(f"{where}: column {name!r}: {closest(name, tuple(known))}")
    given = [known[name].name for name in names]
    for quantity in wanted:
        if quantity not in given:
            raise ValueError(missing(where, quantity))
    for i, quantity in enumerate(given):
        if quantity in given[:i]:
            raise ValueError(f"{where}: column {names[i]!r}: {quantity} is given twice; must be given once")
    return [known[name] for name in names]


def _value(where, text, unit, column):
    """One field as a float in SI."""
    try:
        if "_" in text:  # Python's digit grouping is no CSV number
            raise ValueError
        value = float(text)
    except ValueError:
        raise ValueError(f"{where}: must be a number") from None
    if not math.isfinite(value):
        raise ValueError(f"{where}: must be finite")
    try:
        value = column.value(value, unit)
    except OverflowError:
        value = math.inf
    _check(where, value, column)
    return value


def _check(where, value, column):
    """ValueError unless a column may hold the value, which is in SI."""
    if not math.isfinite(value):
        raise ValueError(f"{where}: must be finite in SI units")
    if column.positive and not value > 0:
        raise ValueError(f"{where}: must be > 0{' K' if column.name == 'T' else ''}")
