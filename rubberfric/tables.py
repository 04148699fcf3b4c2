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
import difflib
import io
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rubberfric._atomic import replacing


class Column(NamedTuple):
    """What a column of that name is."""

    name: str  # of the quantity it gives in SI
    units: dict  # unit: (factor, offset), SI value = factor * value + offset
    positive: bool = True
    log10: bool = False  # the file holds the logarithm of the value in the unit


def _scaled(**factors):
    return {unit: (factor, 0.0) for unit, factor in factors.items()}


_ONE = {"-": (1.0, 0.0)}
_PRESSURE = _scaled(Pa=1.0, kPa=1e3, MPa=1e6, GPa=1e9)
_SPEED = {"m/s": (1.0, 0.0), "mm/s": (1e-3, 0.0), "um/s": (1e-6, 0.0)}
_RADIAN, _DEGREE = {"rad": (1.0, 0.0)}, {"deg": (math.pi / 180, 0.0)}
_WAVEVECTOR = {"1/m": (1.0, 0.0), "1/mm": (1e3, 0.0), "1/um": (1e6, 0.0), "1/nm": (1e9, 0.0)}
_SPECTRUM = {"m^4": (1.0, 0.0), "mm^4": (1e-12, 0.0), "um^4": (1e-24, 0.0), "nm^4": (1e-36, 0.0)}
_LINE = {"m^3": (1.0, 0.0), "mm^3": (1e-9, 0.0), "um^3": (1e-18, 0.0), "nm^3": (1e-27, 0.0)}


def _logarithms(units):
    return {f"log10({unit})": how for unit, how in units.items()}


# Names a file may use. The first unit of each is SI, in which tables are written.
COLUMNS = {
    "omega": Column("omega", {"rad/s": (1.0, 0.0)}),
    "f": Column("omega", _scaled(Hz=2 * math.pi, kHz=2e3 * math.pi, MHz=2e6 * math.pi)),
    "E_stor": Column("E_stor", _PRESSURE),
    "E_loss": Column("E_loss", _PRESSURE),
    "q": Column("q", _WAVEVECTOR),
    "log10_q": Column("q", _logarithms(_WAVEVECTOR), log10=True),
    "C": Column("C", _SPECTRUM),
    "log10_C": Column("C", _logarithms(_SPECTRUM), log10=True),
    "C_1D": Column("C_1D", _LINE),
    "log10_C_1D": Column("C_1D", _logarithms(_LINE), log10=True),
    "phi": Column("phi", _RADIAN, positive=False),
    "phi_deg": Column("phi", _DEGREE, positive=False),
    "T": Column("T", {"K": (1.0, 0.0), "C": (1.0, 273.15)}),
    "aT": Column("aT", _ONE),
    "strain": Column("strain", {"-": (1.0, 0.0), "%": (1e-2, 0.0)}),
    "storage_factor": Column("storage_factor", _ONE),
    "loss_factor": Column("loss_factor", _ONE),
    "v": Column("v", _SPEED, positive=False),
    "log10_v": Column("v", _logarithms(_SPEED), log10=True),
    "p": Column("p", _PRESSURE),
    "mu": Column("mu", _ONE, positive=False),
    "A_over_A0": Column("A_over_A0", _ONE),
    "sigma": Column("sigma", _ONE),
    "sigma_stor": Column("sigma_stor", _PRESSURE),
    "sigma_loss": Column("sigma_loss", _PRESSURE),
    "sigma_C": Column("sigma_C", _SPECTRUM),
    "relative_sigma": Column("relative_sigma", {"-": (1.0, 0.0), "%": (1e-2, 0.0)}),
}


def read_table(path, wanted, optional=(), increasing=True):
    """Columns of a CSV file in SI.

    Parameters
    ----------
    path : path of the file
    wanted, optional : tuples of names in SI ("omega", not "f")
        columns the file must hold and may hold.
    increasing : bool
        whether the first wanted column must increase strictly from row to row.

    Returns
    -------
    dict of name in SI -> float64 array, shape (number of rows,)

    Raises
    ------
    ValueError
        one line naming file, line, column, value and rule: the file is missing or is not
        text, a column is unknown, missing or given twice, the unit is unknown, a row has
        the wrong number of fields, or a value is empty, no number, not finite, of the
        wrong sign or out of order.
    """
    rows = _rows(path)
    (name_line, names), (unit_line, units), *data = rows
    columns = _columns(f"{path}: line {name_line}", names, wanted, optional)
    for line, row in rows[1:]:
        if len(row) != len(names):
            raise ValueError(f"{path}: line {line}: has {len(row)} fields: must have {len(names)}")
    table = {}
    for i, (name, column) in enumerate(zip(names, columns, strict=True)):
        unit = units[i]
        if unit not in column.units:
            allowed = ", ".join(column.units)
            raise ValueError(
                f"{path}: line {unit_line}: column {name}: unit {unit!r}: must be one of {allowed}"
            )
        texts = [(f"{path}: line {line}: {name} = {row[i]!r}", row[i]) for line, row in data]
        table[column.name] = np.array([_value(where, text, unit, column) for where, text in texts])
    if increasing:
        bad = np.flatnonzero(~(np.diff(table[wanted[0]]) > 0))
        if bad.size:
            line, row = data[bad[0] + 1]
            i = next(i for i, column in enumerate(columns) if column.name == wanted[0])
            before = data[bad[0]][1][i]
            raise ValueError(
                f"{path}: line {line}: {names[i]} = {row[i]} after {before}: must increase strictly"
            )
    return table


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


def read_names(path):
    """Names of the columns of a CSV file as they stand there, known or not; ValueError if it is no table."""
    return _rows(path)[0][1]


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


def read_text(path):
    """Text of a file; ValueError in one line if it is missing, unreadable or not UTF-8."""
    try:
        return Path(path).read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:  # not UTF-8, or a path with a NUL byte
        raise ValueError(f"{path}: cannot be read as text: {error}") from None


def closest(name, allowed):
    """End of an error message on an unknown name: the nearest allowed one, and all of them."""
    near = difflib.get_close_matches(str(name), list(allowed), n=1)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"{hint}must be one of {', '.join(allowed)}" if allowed else "there must be none"


def _rows(path):
    """(line number, stripped fields) of every line that is neither blank nor a comment."""
    rows = []
    for line, text in enumerate(io.StringIO(read_text(path)), start=1):
        if text.strip() and not text.lstrip().startswith("#"):
            # line by line: a stray quote stays an error of its own line
            try:
                fields = next(csv.reader([text.rstrip("\r\n")], strict=True, skipinitialspace=True))
            except csv.Error as error:
                raise ValueError(f"{path}: line {line}: is not CSV: {error}") from None
            rows.append((line, [field.strip() for field in fields]))
    if len(rows) < 3:
        raise ValueError(f"{path}: has {len(rows)} rows: must have a name row, a unit row and data")
    return rows


def _columns(where, names, wanted, optional):
    """The `Column` of every name of a file; ValueError unless they are the ones asked for."""
    known = {name: column for name, column in COLUMNS.items() if column.name in (*wanted, *optional)}
    for name in names:
        if name not in known:
            raise ValueError(f"{where}: column {name!r}: {closest(name, tuple(known))}")
    given = [known[name].name for name in names]
    for quantity in wanted:
        spellings = [name for name, column in known.items() if column.name == quantity]
        if quantity not in given:
            raise ValueError(f"{where}: no column {' or '.join(spellings)}: the table must have one")
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
    factor, offset = column.units[unit]
    try:
        value = factor * (10.0**value if column.log10 else value) + offset
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
