"""Reading and writing of text tables in SI units.

::

    f,E_stor,E_loss
    Hz,MPa,MPa
    1e-05,4.35,0.29
    ...

A table of the project is CSV with a row of names and a row of units, see `COLUMNS`. The name determines
the quantity, and the unit determines the conversion to SI: `f` [Hz] becomes `omega` [rad/s], `log10_v`
becomes `v`. An unknown name or unit is an error. Blank lines and lines that begin with # are skipped.
"""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.atomic import StrPath, read_text, write_text
from rubberfric.base.checks import as_leaf, between, check_choice, check_values, closest, shown, warn_caller
from rubberfric.base.units import young_from_shear
from rubberfric.io.columns import COLUMNS, MODULUS_COLUMNS, SET_VALUES
from rubberfric.io.exports import TextRows, TextTable, find_table, headless, pick, suggested_columns
from rubberfric.io.height_maps import read_traces
from rubberfric.roughness.normalisation import density_column, find_normalisation

# Meaning of 1/m in a column "wavenumber".
_WAVENUMBERS = {"ISO_8608": "cycles", "W1": "rad", "Wr": "rad", "C_1D_one_sided": "rad"}
BAD_ROWS = ("error", "drop")


def read_table(
    path: StrPath,
    needed: Sequence[str],
    optional: Sequence[str] = (),
    increasing: bool = True,
    columns: list[str] | None = None,
    poisson: float | None = None,
    generic: str | None = None,
    bad_rows: str = "error",
    wavenumber: str | None = None,
) -> dict[str, np.ndarray]:
    """Read columns of a table of the project or of another program (`rubberfric.io.exports`).

    Parameters
    ----------
    path : path of the file
    needed, optional : names in SI ("omega", not "f") of columns that the file must and may hold
        E_stor and E_loss are computed from tan(delta), `abs(E*)` or shear moduli if necessary. Other columns
        are errors in a table of the project, and ignored in an export.
    increasing : require that the first needed column increases strictly; in an export it may also decrease
    columns : "name [unit]" of each column if the file does not name them, or None
    poisson : Poisson's ratio [-] for E = 2 (1 + poisson) G, or None
    generic : "E" or "G", the modulus that "storage modulus" means
        None: "G" if poisson is given, otherwise "E".
    bad_rows : "error", or "drop" to leave out rows of an export with an empty, missing or invalid value
        A warning names the lines that are left out.
    wavenumber : "rad" or "cycles", the meaning of 1/m in a column "wavenumber" of an export
        None refuses such a column, because it may be 2 pi over the wavelength or one over it.

    Returns
    -------
    dict from name in SI to float64 array of shape (number of rows,)

    Raises
    ------
    ValueError : the table is invalid. The message names file, line, column, value and rule.
        Faults are unreadable text, an unknown, missing or repeated column, an unknown unit, a wrong number of
        fields, and a value that is not a number, not finite, of the wrong sign or out of order. Shear moduli
        without Poisson's ratio, and Poisson's ratio without shear moduli, are faults too.
    """
    check_choice("bad_rows", bad_rows, BAD_ROWS)
    if isinstance(needed, str) or isinstance(optional, str):
        raise ValueError(f"needed, optional = {shown((needed, optional))}: must be lists of names")
    text, drop = read_text(path, exports=True), bad_rows == "drop"
    export = _export(path, text, columns, generic or ("E" if poisson is None else "G"), drop)
    if export is None:
        found = _project_table(path, text, needed, optional)
    else:
        found = pick(export, (*needed, *optional, *(MODULUS_COLUMNS if "E_stor" in needed else ())))
        found = _without_redundant(found)
        if wavenumber is not None and "wavenumber" in found.names:
            pairs = zip(found.names, found.units, strict=True)
            replaced = [
                f"{wavenumber}{u[1:]}" if n == "wavenumber" and u[:2] == "1/" else u for n, u in pairs
            ]
            found = found._replace(units=replaced)
        _check_units(export.where, found)
        if drop:
            found = _without_bad_rows(path, found)
    table = {}
    kinds = [COLUMNS[name] for name in found.names if name is not None]
    for i, (title, column, unit) in enumerate(zip(found.titles, kinds, found.units, strict=True)):
        texts = [(f"{path}: line {line}: {title} = {row[i]!r}", row[i]) for line, row in found.rows]
        try:
            table[column.name] = np.array([column.read(where, text, unit) for where, text in texts])
        except ValueError as error:
            hint = "" if export is None else '; bad_rows="drop" leaves out such rows'
            raise ValueError(f"{error}{hint}") from None
    if export is not None or (poisson is not None and generic is None):
        table = _with_moduli(found.where, table, poisson, generic is None)
        table = {name: values for name, values in table.items() if name in (*needed, *optional)}
        for quantity in needed:
            if quantity not in table:
                raise ValueError(_missing(found.where, quantity) + ("" if columns else column_hint(path)))
    return _ordered(path, found, table, needed[0], export is not None) if increasing else table


def _ordered(path, found, table, quantity, either):
    """Return the table if the column `quantity` increases strictly, otherwise raise ValueError.

    If `either` is True, a table in which the column decreases strictly is reversed.
    """
    first = table[quantity]
    if either and np.all(np.diff(first) < 0):
        return {name: values[::-1] for name, values in table.items()}
    bad = np.flatnonzero(~(np.diff(first) > 0))
    if bad.size:
        i = [COLUMNS[name or ""].name for name in found.names].index(quantity)
        (_, before), (line, row) = found.rows[bad[0] : bad[0] + 2]
        raise ValueError(
            f"{path}: line {line}: {found.titles[i]} = {row[i]} after {before[i]}: must increase strictly"
        )
    return table


def read_columns(
    path: StrPath, columns: list[str] | None = None, poisson: float | None = None
) -> dict[str, np.ndarray]:
    """Read all columns of a table whose names are known.

    Parameters
    ----------
    path, columns, poisson : as for `read_table`

    Returns
    -------
    dict from name in SI ("omega", "E_stor", "T", ...) to float64 array of shape (number of rows,)

    Raises
    ------
    ValueError : as for `read_table`, or two columns hold the same quantity
    """
    names = read_names(path, columns, "E" if poisson is None else "G")
    quantities = tuple(dict.fromkeys(COLUMNS[name].name for name in names if name in COLUMNS))
    if not quantities:
        near = closest("".join(names[:1]), tuple(COLUMNS))
        raise ValueError(f"{path}: columns {', '.join(names)}: none is known; {near}{column_hint(path)}")
    moduli = ("E_stor", "E_loss") if {"E_stor", *MODULUS_COLUMNS} & set(quantities) else ()
    plain = tuple(name for name in quantities if name not in (*MODULUS_COLUMNS, *moduli))
    return read_table(path, (*plain, *moduli), (), increasing=False, columns=columns, poisson=poisson)


def read_density(
    path: StrPath,
    normalisation: str | None,
    optional: Sequence[str] = (),
    columns: list[str] | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Read q [1/m] and the density of a spectrum in a normalisation, as the column C or C_1D.

    Parameters
    ----------
    path, columns, optional, options : as for `read_table`
    normalisation : given, or None where a title names it, see `rubberfric.roughness.find_normalisation`

    Returns
    -------
    dict with the keys "q", "C" (the density, [m^4] or [m^3]), and the optional columns of the table
    """
    normalisation = find_normalisation(path, read_names(path, columns), normalisation)
    density, meaning = density_column(normalisation), _WAVENUMBERS.get(normalisation)
    table = read_table(path, ("q", density), optional, columns=columns, wavenumber=meaning, **options)
    return {("C" if name == density else name): values for name, values in table.items()}


def read_directions(path: StrPath) -> tuple[np.ndarray, np.ndarray]:
    """Read a spectrum over wavevector and direction from a CSV file with columns q, phi or phi_deg, and C.

    Returns
    -------
    Tuple of q of shape (n,) and C of shape (n, directions). Column k of C is at phi = k pi / directions.

    Raises
    ------
    ValueError : as for `read_table`, or the rows are not a grid ordered by q and then by direction
        phi may deviate by 1/1000 of the distance between directions because of rounding.
    """
    table = read_table(path, ("q", "phi", "C"), increasing=False)
    q, phi, C = table["q"], table["phi"], table["C"]
    count = int(np.argmax(q != q[0])) or q.size
    for i, (q_i, phi_i) in enumerate(zip(q, phi, strict=True)):
        k, first = i % count, q[i - i % count]
        where = f"{path}: row {i + 1} of the data: q = {q_i:g} 1/m, phi = {math.degrees(phi_i):g} deg"
        if q_i != first or (k == 0 and i > 0 and not q_i > q[i - 1]):
            raise ValueError(f"{where}: q must increase, with {count} directions for each q like the first")
        if abs(phi_i - k * math.pi / count) > 1e-3 * math.pi / count:
            raise ValueError(
                f"{where}: phi must be {180 * k / count:g} deg because the {count} directions of a q are "
                f"0, {180 / count:g}, ... deg"
            )
    if q.size % count:
        last = q.size % count
        raise ValueError(f"{path}: q = {q[-1]:g} 1/m has {last} directions: must have {count} like the first")
    return q[::count], C.reshape(-1, count)


def read_names(path: StrPath, columns: list[str] | None = None, generic: str = "E") -> list[str]:
    """Read the names of the columns of a table.

    Only the known names are returned for a table of another program.
    """
    text = read_text(path, exports=True)
    export = _export(path, text, columns, generic, incomplete=True)
    if export is None:
        return _rows(path, text)[0][1]
    return [SET_VALUES.get(name, name) for name in export.names if name is not None]


def column_hint(path: StrPath) -> str:
    """Return the end of an error message about unknown column titles.

    The text names a function that can read the file, or suggests the argument `columns`.
    """
    try:
        read_traces(path)
    except ValueError:
        pass
    else:
        return "; heights along lines: rubberfric.io.read_traces reads them"
    columns = suggested_columns(read_text(path, exports=True))
    if '"strain [' in columns:
        return '; a strain sweep: rubberfric.io.read_table(path, ["strain", "E_stor", "E_loss"]) reads it'
    advice = 'or name the columns, with "name [unit]" for each ? and "-" for one not read'
    return f"; {advice}: {columns}" if columns else ""


def write_table(path: StrPath, table: Mapping[str, ArrayLike], comment: str = "") -> None:
    """Write columns in SI as a CSV file.

    Parameters
    ----------
    path : file
    table : mapping from name in SI (see `COLUMNS`) to a sequence. All sequences must have equal length.
        Numbers are written with all digits, so that they are read back unchanged.
    comment : lines at the top of the file, written behind #

    Raises
    ------
    ValueError : an unknown name, unequal lengths, or a value that `read_table` refuses
    """
    try:
        text = table_text(table)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    write_text(path, "".join(f"# {line}\n" for line in comment.splitlines()) + text)


def table_text(table: Mapping[str, ArrayLike]) -> str:
    """Return columns in SI as the CSV text that `write_table` writes."""
    for name in table:
        if name not in COLUMNS or COLUMNS[name].name != name:
            known = sorted({column.name for column in COLUMNS.values()})
            raise ValueError(f"column {name!r}: must be one of {', '.join(known)}")
    columns = {}
    for name, values in table.items():
        try:
            columns[name] = np.asarray(values, float)
        except (TypeError, ValueError):
            raise ValueError(f"column {name!r} = {shown(values)}: must be numbers") from None
    lengths = {name: values.shape for name, values in columns.items()}
    if len(set(lengths.values())) != 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise ValueError(f"shapes of columns {lengths}: must be one-dimensional and equal")
    for name, values in columns.items():
        for i, value in enumerate(values.tolist()):
            COLUMNS[name].check(f"{name}[{i}] = {value!r}", value)
    units = [next(iter(COLUMNS[name].units)) for name in columns]
    rows = zip(*(map(repr, values.tolist()) for values in columns.values()), strict=True)
    return "".join(f"{','.join(row)}\n" for row in (columns, units, *rows))


def _export(
    path: StrPath, text: str, titles: list[str] | None, generic: str, incomplete: bool = False
) -> TextTable | None:
    return find_table(path, text, generic, incomplete) if titles is None else headless(path, text, titles)


def _without_redundant(table: TextTable) -> TextTable:
    """Remove tan(delta) and absolute moduli from a table with storage and loss modulus.

    Instruments write a useless tan(delta) if the loss is within the noise.
    """
    if not any({f"{m}_stor", f"{m}_loss"} <= set(table.names) for m in "EG"):
        return table
    names = enumerate(table.names)
    return table.with_columns([i for i, name in names if name not in ("tan_del", "E_comp", "G_comp")])


def _without_bad_rows(path: StrPath, table: TextTable) -> TextTable:
    """Remove rows with an invalid value from a table, and warn about the removed rows."""
    good, bad, first = [], [], ""
    for line, row in table.rows:
        try:
            for title, name, unit, text in zip(table.titles, table.names, table.units, row, strict=True):
                COLUMNS[name or ""].read(f"line {line}: {title} = {text!r}", text, unit)
        except ValueError as error:
            first = first or str(error)
            bad.append(line)
        else:
            good.append((line, row))
    if not good:
        raise ValueError(f"{path}: must have a row of valid numbers; {first}")
    if bad:
        lines = ", ".join(map(str, bad[:5])) + ", ..." * (len(bad) > 5)
        of = len(bad) + len(good)
        warn_caller(
            f"{path}: {len(bad)} of {of} rows have bad values and are left out: lines {lines}", UserWarning
        )
    return table._replace(rows=good)


def _project_table(path: StrPath, text: str, needed: Sequence[str], optional: Sequence[str]) -> TextTable:
    """Parse a table of the project, and check names, units and numbers of fields."""
    (name_line, names), (unit_line, units), *rows = every = _rows(path, text)
    where = f"{path}: line {name_line}"
    known = {n: c.name for n, c in COLUMNS.items() if c.name in (*needed, *optional) and c.offered}
    for name in names:
        if name not in known:
            raise ValueError(f"{where}: column {name!r}: {closest(name, tuple(known))}")
    given = [known[name] for name in names]
    for quantity in needed:
        if quantity not in given:
            raise ValueError(_missing(where, quantity))
    for i, quantity in enumerate(given):
        if quantity in given[:i]:
            raise ValueError(f"{where}: column {names[i]!r}: {quantity} is given twice; must be given once")
    for line, row in every[1:]:
        if len(row) != len(names):
            raise ValueError(f"{path}: line {line}: has {len(row)} fields: must have {len(names)}")
    table = TextTable(where, names, list(names), units, rows)
    _check_units(f"{path}: line {unit_line}", table)
    return table


def _check_units(where: str, table: TextTable) -> None:
    for title, name, unit in zip(table.titles, table.names, table.units, strict=True):
        known = COLUMNS[name or ""].units
        if name == "wavenumber" and unit not in known:
            raise ValueError(
                f"{where}: column {title}: is 2 pi / wavelength or 1 / wavelength: must have the unit rad/m"
                f" or cycles/m, or rad/mm ..., got {unit!r}"
            )
        if unit not in known:
            raise ValueError(f"{where}: column {title}: unit {unit!r}: must be one of {', '.join(known)}")


def _rows(path: StrPath, content: str) -> TextRows:
    """Return (line number, fields) of all lines except blank lines and comments."""
    rows = []
    for line, text in enumerate(io.StringIO(content), start=1):
        if text.strip() and not text.lstrip().startswith("#"):
            # Each line is parsed alone, so that a stray quote is an error in its line.
            try:
                fields = next(csv.reader([text.rstrip("\r\n")], strict=True, skipinitialspace=True))
            except csv.Error as error:
                raise ValueError(f"{path}: line {line}: is not CSV: {error}") from None
            rows.append((line, [field.strip() for field in fields]))
    if rows and all(word.lstrip("+-.")[:1].isdigit() for field in rows[0][1] for word in field.split()):
        raise ValueError(
            f"{path}: line {rows[0][0]}: begins with numbers: must have a row of names and a row of units,"
            ' or name the columns, such as "f [Hz]" or "E_stor [MPa]", and "-" for one not read: '
            f"{suggested_columns(content)}"
        )
    if len(rows) < 3:
        raise ValueError(f"{path}: has {len(rows)} rows: must have a name row, a unit row and data")
    return rows


def _with_moduli(
    where: str, table: dict[str, np.ndarray], poisson: float | None, strict: bool
) -> dict[str, np.ndarray]:
    """Add E_stor and E_loss if |E*|, shear moduli or tan(delta) = E''/E' determine them.

    If `strict` is True, a Poisson's ratio for a table without shear moduli is an error.
    """
    shear = [name for name in ("G_stor", "G_loss", "G_comp") if name in table]
    if shear and not {"E_stor", "E_loss", "E_comp"} & set(table):
        if poisson is None:
            raise ValueError(
                f"{where}: {', '.join(shear)} are shear moduli: poisson must be given, E = 2 (1 + poisson) G"
            )
        name = f"{where}: poisson"
        check_values(name, as_leaf(name, poisson, 0), between(0.0, 0.5))
        table = table | {"E" + name[1:]: young_from_shear(table[name], poisson) for name in shear}
    elif poisson is not None and strict:
        raise ValueError(f"{where}: poisson = {poisson!r}: must not be given; the table has no shear moduli")
    if "tan_del" in table:
        if "E_stor" not in table and "E_comp" in table:
            table["E_stor"] = table["E_comp"] / np.hypot(1, table["tan_del"])
        if "E_loss" not in table and "E_stor" in table:
            table["E_loss"] = table["E_stor"] * table["tan_del"]
    return table


def _missing(where: str, quantity: str) -> str:
    spellings = [name for name, column in COLUMNS.items() if column.name == quantity and column.offered]
    return f"{where}: no column {' or '.join(spellings)}: the table must have one"
