"""Reading of text tables in SI units.

::

    f,E_stor,E_loss
    Hz,MPa,MPa
    1e-05,4.35,0.29
    ...

A table of the project is CSV with a row of names and a row of units, see `COLUMNS`. The name determines
the quantity, and the unit determines the conversion to SI: `f` [Hz] becomes `omega` [rad/s], `log10_v`
becomes `v`. An unknown name or unit is an error. Blank lines and lines that begin with # are skipped.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rubberfric.base.atomic import StrPath
from rubberfric.base.checks import check_choice, closest, listed, shown, warn_caller
from rubberfric.io.columns import COLUMNS, SET_VALUES, TRANSIENTS, is_error, quantities_of
from rubberfric.io.exports import TextTable, find_table, headless, pick, suggested_columns
from rubberfric.io.height_files.traces import read_traces
from rubberfric.io.text_tables.derived import RELATIONS, plan_for, with_derived, with_wheel_names
from rubberfric.io.text_tables.frames import DataFrame, Frame, as_source
from rubberfric.io.text_tables.lines import text_above_numbers
from rubberfric.io.text_tables.own_tables import missing_column, project_rows, project_table
from rubberfric.io.text_tables.preamble import stated_shear
from rubberfric.io.text_tables.values import check_units, table_values
from rubberfric.io.text_tables.workbooks import read_export
from rubberfric.roughness.normalisation import density_column, find_normalisation

# Meaning of 1/m in a column "wavenumber".
_WAVENUMBERS = {"ISO_8608": "cycles"} | dict.fromkeys(
    ("W1", "Wr", "C_1D_one_sided", "q_C_iso_over_pi"), "rad"
)
BAD_ROWS = ("error", "drop")
# Parts of titles that only instruments for shear write.
_OF_SHEAR = ("torque", "drehmoment", "viscosity", "viskosität", "viscosité", "shear", "scher", "cisaillement")


def read_table(
    path: StrPath | DataFrame,
    needed: Sequence[str],
    optional: Sequence[str] = (),
    increasing: bool = True,
    columns: list[str] | None = None,
    poisson: float | None = None,
    generic: str | None = None,
    bad_rows: str | None = "error",
    area: float | None = None,
    block: int | None = None,
    wavenumber: str | None = None,
    history: list[str] | None = None,
) -> dict[str, np.ndarray]:
    """Read columns of a table of the project, of another program (`rubberfric.io.exports`), or of a frame.

    Parameters
    ----------
    path : path of the file, or a data frame (`rubberfric.io.as_frame`)
    needed, optional : names in SI ("omega", not "f") of columns that the file must and may hold
        Missing quantities are computed from other columns (`rubberfric.io.text_tables.derived`): E_stor and
        E_loss from `abs(E*)`, a phase angle, tan(delta) or shear moduli, mu from forces, p from a load
        and `area`, and v from a speed and a slip. Unknown columns are errors in a table of the project,
        and are ignored in an export. A warning names an ignored column of standard errors, such as "std mu",
        if an optional column could hold them.
    increasing : require that the first needed column increases strictly; in an export it may also decrease
    columns : "name [unit]" of each column if the file does not name them, or None
    poisson : Poisson's ratio [-] for E = 2 (1 + poisson) G, or None
    generic : "E" or "G", the modulus that "storage modulus" means
        None: "G" if poisson is given, otherwise "E".
    bad_rows : "error", or "drop" to leave out rows with an empty, missing or invalid value
        A warning names the lines that are left out. `rubberfric.io.text_tables.lines` says
        which lines are rows.
        None is "error" with a message that does not recommend "drop", for callers without this option.
    area : nominal contact area [m^2], which gives the pressure if the table has normal forces, or None
    block : number of the block of columns, from 1, if an export has several blocks with equal titles
    wavenumber : "rad" or "cycles", the meaning of 1/m in a column "wavenumber" of an export
        None refuses such a column, because it may be 2 pi over the wavelength or one over it.
    history : list to which one text is appended for each quantity that is computed, and for rows left out

    Returns
    -------
    dict from name in SI to float64 array of shape (number of rows,)

    Raises
    ------
    ValueError : the table is invalid. The message names file, line, column, value and rule.
        Faults are unreadable text, an unknown, missing or repeated column, an unknown unit, a wrong number of
        fields, and a value that is not a number, not finite, of the wrong sign or out of order. Shear moduli
        without Poisson's ratio, and Poisson's ratio without shear moduli, are faults too.

    Examples
    --------
    >>> np.savetxt("speeds.txt", [[5.0, 0.8], [10.0, 0.9]])
    >>> table = rf.io.read_table("speeds.txt", ["v", "mu"], columns=["v [mm/s]", "mu"])
    >>> table["v"], table["mu"]
    (array([0.005, 0.01 ]), array([0.8, 0.9]))
    """
    if bad_rows is not None:
        check_choice("bad_rows", bad_rows, BAD_ROWS)
    if isinstance(needed, str) or isinstance(optional, str):
        raise ValueError(f"needed, optional = {shown((needed, optional))}: must be lists of names")
    path = as_source(path)
    text, wanted = _text(path), (*needed, *optional)
    export = _export(path, text, columns, generic or ("E" if poisson is None else "G"), block)
    if export is None:
        _refuse(
            path, {"area": area, "block": block}, "the table has no load, and no columns with equal titles"
        )
        content, place = project_table(path, text, needed, optional)
        check_units(place, content)
        plan = plan_for(wanted, quantities_of(content.names))
    else:
        _refuse_shear(path, text, export, block, poisson, generic, columns)
        export = export._replace(names=with_wheel_names(export.names, export.titles))
        names = [SET_VALUES.get(name or "", name) for name in export.names]
        plan = plan_for(wanted, quantities_of(names), area is not None)
        content = pick(export, plan.columns)
        if wavenumber is not None and "wavenumber" in content.names:
            pairs = zip(content.names, content.units, strict=True)
            replaced = [
                f"{wavenumber}{u[1:]}" if n == "wavenumber" and u[:2] == "1/" else u for n, u in pairs
            ]
            content = content._replace(units=replaced)
        check_units(export.where, content)
        _warn_of_errors(export, optional)
        if area is not None and "area" not in [relation.constant for relation in plan.relations]:
            own = [name for name in ("p", "A") if name in plan.columns]
            why = f"the file has {own[0]}" if own else "the table has no load F_n, or needs no pressure"
            _refuse(path, {"area": area}, why)
    if (
        poisson is not None
        and generic is None
        and not any(step.constant == "poisson" for step in plan.relations)
    ):
        raise ValueError(
            f"{content.where}: poisson = {shown(poisson)}: must not be given; the table has no shear moduli"
        )
    table = table_values(path, content, bad_rows, wanted, history)
    if plan.relations:
        table = with_derived(path, content.where, table, plan, poisson, area, history)
    table = {name: values for name, values in table.items() if name in wanted}
    for quantity in needed:
        if quantity not in table:
            raise ValueError(missing_column(content.where, quantity) + ("" if columns else column_hint(path)))
    return _ordered(path, content, table, needed[0], export is not None) if increasing else table


def _refuse_shear(path, text, export, block, *stated):
    """Raise ValueError if a "storage modulus" would be read as E' and a column is of shear.

    `stated` are arguments of the caller that state the meaning, all None if none does.
    """
    of_shear = [title for title in export.titles if any(word in title.lower() for word in _OF_SHEAR)]
    of_shear = of_shear or stated_shear(text)
    if not of_shear or any(x is not None for x in stated) or not {"E_stor", "E_loss"} & set(export.names):
        return
    as_shear = _export(path, text, None, "G", block)
    names = export.names if as_shear is None else as_shear.names
    ambiguous = [t for t, *pair in zip(export.titles, export.names, names, strict=True) if len(set(pair)) > 1]
    if ambiguous:
        raise ValueError(
            f"{export.where}: {ambiguous[0]!r} may be G', because {of_shear[0]!r} is of shear: pass"
            " poisson=0.5 for E = 2 (1 + poisson) G; or name E_stor and E_loss in columns, for E' and E''"
        )


def _warn_of_errors(export, optional):
    """Warn of a column of errors that is not read, if the optional columns of errors are missing."""
    sigmas = [name for name in optional if "sigma" in name]
    unread = [t for t, name in zip(export.titles, export.names, strict=True) if name is None and is_error(t)]
    if unread and sigmas and not {*sigmas} & {*export.names}:
        warn_caller(
            f"{export.where}: the column {shown(unread[0])} is not read; if it holds standard errors, name it"
            f" {' or '.join(sigmas)}",
            UserWarning,
        )


def _refuse(path, arguments, why):
    for name, value in arguments.items():
        if value is not None:
            raise ValueError(f"{path}: {name} = {shown(value)}: must not be given; {why}")


def _ordered(path, content, table, quantity, either):
    """Return the table if the column `quantity` increases strictly, otherwise raise ValueError.

    If `either` is True, a table in which the column decreases strictly is reversed.
    """
    first = table[quantity]
    if either and np.all(np.diff(first) < 0):
        return {name: values[::-1] for name, values in table.items()}
    bad = np.flatnonzero(~(np.diff(first) > 0))
    if bad.size:
        own = [COLUMNS[name or ""].name for name in content.names]
        if quantity not in own:  # computed from other columns
            raise ValueError(f"{path}: {quantity} = {first[bad[0] + 1]:g}: must increase strictly")
        i = own.index(quantity)
        (_, before), (line, row) = content.rows[bad[0] : bad[0] + 2]
        raise ValueError(
            f"{path}: line {line}: {content.titles[i]} = {row[i]} after {before[i]}: must increase strictly"
        )
    return table


def read_columns(
    path: StrPath | DataFrame,
    columns: list[str] | None = None,
    poisson: float | None = None,
    bad_rows: str = "error",
    block: int | None = None,
) -> dict[str, np.ndarray]:
    """Read all columns of a table whose names are known.

    Parameters
    ----------
    path, columns, poisson, bad_rows, block : as for `read_table`

    Returns
    -------
    dict from name in SI ("omega", "E_stor", "T", ...) to float64 array of shape (number of rows,)

    Raises
    ------
    ValueError : as for `read_table`, or two columns hold the same quantity

    Examples
    --------
    >>> table = rf.io.read_columns("data/laboratory/dma_isothermen.csv")
    >>> sorted(table), round(table["T"].min() - 273.15), f"{table['E_stor'][0]:.4g}"
    (['E_loss', 'E_stor', 'T', 'omega'], -50, '2.469e+09')
    """
    path = as_source(path)
    names = read_names(path, columns, "E" if poisson is None else "G", block)
    quantities = tuple(dict.fromkeys(COLUMNS[name].name for name in names if name in COLUMNS))
    if not quantities:
        near = f"columns {listed(names)}: none is known; {closest(names[0], tuple(COLUMNS))}" if names else ""
        raise ValueError(f"{path}: {near or 'must have a known column'}{column_hint(path)}")
    auxiliary = {column for relation in RELATIONS for column in relation.columns}
    auxiliary -= {"E_stor", "E_loss", "strain"}
    auxiliary |= {"x"}  # of friction records
    moduli = tuple(m for m in ("E_stor", "E_loss") if plan_for([m], quantities).columns)
    if moduli:
        auxiliary |= {"t", *TRANSIENTS}  # of oscillation, and in time-domain columns of master curves
    if "v" in quantities:
        auxiliary |= {"t"}
    plain = tuple(name for name in quantities if name not in (*auxiliary, *moduli))
    if not plain and not moduli:
        fault = f"columns {listed(names)}: must have a measured quantity, such as E_stor, mu or C"
        raise ValueError(f"{path}: {fault}{column_hint(path)}")
    return read_table(
        path, (*plain, *moduli), (), False, columns=columns, poisson=poisson, bad_rows=bad_rows, block=block
    )


def read_density(
    path: StrPath | DataFrame,
    normalisation: str | None,
    optional: Sequence[str] = (),
    columns: list[str] | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Read q [1/m] and the density of a spectrum in a normalisation, as the column C or C_1D.

    Parameters
    ----------
    path, columns, optional, options : as for `read_table`
    normalisation : given, or None where the file names it, see `read_normalisation`

    Returns
    -------
    dict with the keys "q", "C" (the density, [m^4] or [m^3]), and the optional columns of the table

    Examples
    --------
    >>> rf.io.write_table("profile.csv", {"q": [1e3, 1e4], "C_1D": [1e-12, 1e-15]})
    >>> rf.io.read_density("profile.csv", "C_1D")["C"]
    array([1.e-12, 1.e-15])
    """
    path = as_source(path)
    normalisation = read_normalisation(path, normalisation, columns)
    density, meaning = density_column(normalisation), _WAVENUMBERS.get(normalisation)
    table = read_table(path, ("q", density), optional, columns=columns, wavenumber=meaning, **options)
    return {("C" if name == density else name): values for name, values in table.items()}


def _text(path: StrPath | Frame) -> str:
    return "" if isinstance(path, Frame) else read_export(path)


def read_normalisation(
    path: StrPath | DataFrame, normalisation: str | None, columns: list[str] | None = None
) -> str:
    """Return the normalisation of a spectrum: the given one, or the one that titles or header name.

    Examples
    --------
    >>> road = [[0.5, 2e-6], [1.0, 5e-7]]
    >>> np.savetxt("road.csv", road, header="n [cycles/m],G_d [m^3]", delimiter=",", comments="")
    >>> rf.io.read_normalisation("road.csv", None)
    'ISO_8608'
    """
    path = as_source(path)
    header = text_above_numbers(_text(path))
    return find_normalisation(path, read_names(path, columns), normalisation, header)


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
    table = read_table(path, ("q", "phi", "C"), increasing=False, bad_rows=None)
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


def read_names(
    path: StrPath | DataFrame, columns: list[str] | None = None, generic: str = "E", block: int | None = None
) -> list[str]:
    """Read the names of the columns of a table.

    Only the known names are returned for a table of another program.

    Examples
    --------
    >>> rf.io.read_names("data/laboratory/linear_tester.csv")
    ['v', 'T', 'p', 'mu']
    """
    path = as_source(path)
    text = _text(path)
    export = _export(path, text, columns, generic, block)
    if export is None:
        return project_rows(path, text)[0][0][1]
    return [SET_VALUES.get(name, name) for name in export.names if name is not None]


def column_hint(path: StrPath | Frame) -> str:
    """Return the end of an error message about unknown column titles.

    The text names a function that can read the file, or suggests the argument `columns`.

    Examples
    --------
    >>> rf.io.column_hint("data/laboratory/strain_sweep.txt")
    '; a strain sweep: rubberfric.io.read_table(path, ["strain", "E_stor", "E_loss"]) reads it'
    """
    if isinstance(path, Frame):
        return f"; it has the columns {listed(path.titles)}. Rename a column, or give its values"
    try:
        read_traces(path)
    except ValueError:
        pass
    else:
        return "; heights along lines: rubberfric.io.read_traces reads them"
    columns = suggested_columns(read_export(path))
    if '"strain [' in columns and '"E_stor [' in columns:
        return '; a strain sweep: rubberfric.io.read_table(path, ["strain", "E_stor", "E_loss"]) reads it'
    advice = 'or name the columns, with "name [unit]" for each ? and "-" for one not read'
    return f"; {advice}: {columns}" if columns else ""


def _export(
    path: StrPath | Frame, text: str, titles: list[str] | None, generic: str, block: int | None
) -> TextTable | None:
    """Return a table of another program or a data frame, or None for a table of this project."""
    if isinstance(path, Frame):
        _refuse(path, {"block": block}, "a data frame has no blocks")
        return path.table(titles, generic)
    if titles is None:
        return find_table(path, text, generic, block)
    _refuse(path, {"block": block}, 'columns= selects columns, with "-" for one not read')
    return headless(path, text, titles)
