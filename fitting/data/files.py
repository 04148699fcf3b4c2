"""Files of measured data: CSV tables and HDF5.

A CSV table has two header rows, names and units (`rubberfric.io.tables`); the column of the
measured values says what kind of data it is:

    friction   v | log10_v, mu, and if known  sigma | relative_sigma, p, T
    area       v | log10_v, A_over_A0,        sigma | relative_sigma, p, T
    modulus    omega | f, E_stor, E_loss,     sigma_stor, sigma_loss | relative_sigma, T
    spectrum   q | log10_q, C | log10_C,      sigma_C | relative_sigma
               q | log10_q, C_1D | log10_C_1D, relative_sigma: along a line, see `read`

Tables of other programs are read as well (`rubberfric.io.tables.exports`): other names, separators, a preamble.

An HDF5 file holds one group /data with the attributes kind, name and body, and a dataset
with units for each field that is not None.
"""

import dataclasses
import difflib
from pathlib import Path

import h5py
import numpy as np

from fitting.data.kinds import AreaData, FrictionData, ModulusData, SpectrumData
from fitting.data.measured import FIELDS, one_line
from rubberfric.base.atomic import as_path, check_writable, replacing
from rubberfric.base.checks import closest
from rubberfric.io.hdf5 import check_names, creating, plain, read_values, reading, write_values
from rubberfric.io.tables import COLUMNS, read_names, read_table, write_table
from rubberfric.roughness.normalisation import LINES, NORMALISATION_RULE, check_normalisation, spectrum_from

FORMAT = "rubberfric data"
SUFFIXES = (".csv", ".h5")
TABLES = (".csv", ".txt", ".tsv", ".dat")  # that are read

_CONDITIONS = {"pressure": "p", "temperature": "T", "relative": "relative_sigma"}

# Column of every numeric field; one row makes a kind of data storable.
COLUMN = {
    FrictionData: {"velocity": "v", "friction": "mu", "sigma": "sigma", **_CONDITIONS},
    AreaData: {"velocity": "v", "area": "A_over_A0", "sigma": "sigma", **_CONDITIONS},
    ModulusData: {
        "omega": "omega",
        "storage": "E_stor",
        "loss": "E_loss",
        "sigma_storage": "sigma_stor",
        "sigma_loss": "sigma_loss",
        "temperature": "T",
        "relative": "relative_sigma",
    },
    SpectrumData: {"q": "q", "C": "C", "sigma": "sigma_C", "relative": "relative_sigma"},
}
KINDS = {cls.quantity: cls for cls in COLUMN}


def read(
    path,
    *,
    pressure=None,
    temperature=None,
    body=None,
    relative=None,
    normalisation=None,
    hurst=None,
    poisson=None,
    columns=None,
    kind=None,
    check_units=True,
):
    """Measured data of a table (.csv, .txt, .tsv, .dat) or an .h5 file.

    Parameters
    ----------
    path : path of the file
    pressure, temperature, body, relative : as in the constructors
        what the file lacks: pressure [Pa] must be in one of both places for friction and
        area, and body never is in a CSV file.
    normalisation, hurst : of the spectrum in a CSV file, see `rubberfric.roughness.normalisation`
        None: "C". One along a line must be given, with H, and is converted as of a self-affine surface.
    poisson : Poisson's ratio [-], needed for a table of shear moduli, E = 2 (1 + poisson) G; a "storage
        modulus" is one of E without it.
    columns : list of "name [unit]", or None
        what the columns are of a table that does not say so, "-" for one not read.
    kind : "friction", "area", "modulus" or "spectrum"; needed for a table that holds several
    check_units : bool
        whether values of a table that look like ones in another unit are errors.

    Returns
    -------
    FrictionData, AreaData, ModulusData or SpectrumData, as the columns of a CSV file or the
    kind in an HDF5 file say. From a file that `write` made the numbers are equal to the
    last bit; `name` is kept by .h5 only.

    Raises
    ------
    ValueError
        one line naming the file, what in it is wrong, and the rule; also if something is
        given that the file has, or that data of its kind do not have.
    """
    path = as_path(path)
    given = {"pressure": pressure, "temperature": temperature, "body": body, "relative": relative}
    given = {name: value for name, value in given.items() if value is not None}
    scaled = {"normalisation": normalisation, "hurst": hurst}
    scaled = {name: value for name, value in scaled.items() if value is not None}
    suffix = path.suffix.lower()
    if suffix not in (*TABLES, ".h5"):
        sheet = "; save a sheet as .csv" if suffix in (".xlsx", ".xls", ".ods") else ""
        sheet = "; it is a folder" if path.is_dir() else sheet
        raise ValueError(f"{path}: suffix {path.suffix!r}: must be {', '.join(TABLES)} or .h5{sheet}")
    layout = {"columns": columns, "poisson": poisson}
    for name, value in (layout | {"kind": kind}).items():
        if suffix == ".h5" and value is not None:
            raise ValueError(f"{path}: {name} = {one_line(value)}: must not be given; it is for tables")
    for name, value in scaled.items():
        if suffix == ".h5" or _kind(path, columns, poisson, kind) is not SpectrumData:
            raise ValueError(f"{path}: {name} = {one_line(value)}: must not be given; it is for CSV spectra")
    if suffix == ".h5":
        with reading(path, FORMAT) as file:
            check_names(file, ("data",), ("format", "format_version", "rubberfric_version"))
            if "data" not in file:
                raise ValueError("/data: is missing; must be a group")
            return read_group(file["data"], **given)
    cls = _kind(path, columns, poisson, kind)
    fields = COLUMN[cls]
    if cls is SpectrumData:
        fields = _spectrum_columns(path, normalisation, hurst, columns)
    needed = tuple(fields[name] for name in fields if FIELDS[name].needed and name != "pressure")
    optional = tuple(column for column in fields.values() if column not in needed)
    table = read_table(path, needed, optional, increasing=False, **layout)
    values = {name: table[column] for name, column in fields.items() if column in table}
    if scaled:
        for name in values.keys() & {"C", "sigma"}:
            values[name] = np.asarray(spectrum_from(normalisation, values["q"], values[name], hurst))
    try:
        if "pressure" in fields and "pressure" not in {*values, *given}:
            raise ValueError("no column p: the table must have one, or pressure=... be given [Pa]")
        return _made(cls, values, given, check_units)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def write(path, data):
    """Write measured data as a .csv or an .h5 file, whole or not at all; `read` reads it back.

    A CSV file has no place for `name` and `body`: they go to comment lines, and the body
    must be given to `read` again.

    Raises
    ------
    ValueError
        one line: the suffix is neither, the folder is missing, `data` is of no kind, or has
        values <= 0 of noise that a CSV table must not hold.
    """
    if type(data) not in COLUMN:
        kinds = ", ".join(cls.__name__ for cls in COLUMN)
        raise ValueError(f"{path}: data = {one_line(data)}: must be one of {kinds}")
    check_writable(path, SUFFIXES)
    if Path(path).suffix.lower() == ".h5":
        with replacing(path) as temporary, creating(temporary, FORMAT) as file:
            write_group(file.create_group("data"), data)
        return
    body = getattr(data, "body", None)
    comment = [data.name] * bool(data.name) + [f"of the {body} body"] * (body is not None)
    table = {column: getattr(data, name) for name, column in COLUMN[type(data)].items()}
    table = {column: values for column, values in table.items() if values is not None}
    write_table(path, table, "\n".join(comment))


def write_group(group, data):
    """Store measured data in an open, empty HDF5 group."""
    group.attrs["kind"] = data.quantity
    group.attrs["name"] = data.name
    if getattr(data, "body", None) is not None:
        group.attrs["body"] = data.body
    for name in COLUMN[type(data)]:
        if getattr(data, name) is not None:
            write_values(group, name, getattr(data, name), data.unit(name))


def read_group(group, **given):
    """Measured data that `write_group` stored, with what they lack `given` as to `read`.

    ValueError in one line if the group holds no such data.
    """
    if not isinstance(group, h5py.Group):
        raise ValueError(f"{group.name}: is a dataset: must be a group")
    kind = plain(group.attrs.get("kind"))
    if not isinstance(kind, str) or kind not in KINDS:
        raise ValueError(f"{group.name}: kind = {kind!r}: {closest(kind, tuple(KINDS))}")
    cls = KINDS[kind]
    texts = _fields(cls) & {"name", "body"}
    check_names(group, COLUMN[cls], ("kind", *sorted(texts)))
    values = {name: plain(group.attrs[name]) for name in texts if name in group.attrs}
    for name in COLUMN[cls]:
        if name in group or FIELDS[name].needed:
            values[name] = read_values(group, name, cls.unit(name))
    try:
        return _made(cls, values, given, check_units=False)
    except ValueError as error:
        raise ValueError(f"{group.name}: {error}") from None


def _spectrum_columns(path, normalisation, hurst, columns):
    """Column of every field of a spectrum in a normalisation, None being C."""
    names = read_names(path, columns)
    if normalisation is None and {"C_1D", "log10_C_1D"} & set(names):
        raise ValueError(f"{path}: normalisation is missing: {NORMALISATION_RULE}")
    try:
        check_normalisation("C" if normalisation is None else normalisation, hurst)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    columns = COLUMN[SpectrumData]
    if normalisation in LINES:
        # A sigma along a line would have another unit.
        columns = {name: column for name, column in columns.items() if name != "sigma"} | {"C": "C_1D"}
    return columns


def _fields(cls):
    return {field.name for field in dataclasses.fields(cls)}


def _made(cls, values, given, check_units):
    """Data from the fields of a file and what is given beside it."""
    for name, value in given.items():
        if name not in _fields(cls):
            raise ValueError(f"{name} = {one_line(value)}: must not be given; {cls.quantity} data have none")
        if name in values:
            raise ValueError(f"{name} = {one_line(value)}: must not be given; the file has it")
    return cls(**values, **given, check_units=check_units)


def _kind(path, columns, poisson, kind):
    """The class of data in a table, by its column of measured values, or by its name."""
    if kind is not None:
        if not isinstance(kind, str) or kind not in KINDS:
            raise ValueError(f"{path}: kind = {one_line(kind)}: {closest(kind, tuple(KINDS))}")
        return KINDS[kind]
    names = read_names(path, columns, "E" if poisson is None else "G")
    marks = {values[cls.values[0]]: cls for cls, values in COLUMN.items()} | {"C_1D": SpectrumData}
    marks |= dict.fromkeys(("G_stor", "E_comp", "G_comp"), ModulusData)
    given = {COLUMNS[name].name for name in names if name in COLUMNS}
    found = {marks[mark] for mark in marks if mark in given}
    if len(found) == 1:
        return found.pop()
    needs = []
    for cls, values in COLUMN.items():
        needed = [values[name] for name in values if FIELDS[name].needed]
        offered = [(name, column.name) for name, column in COLUMNS.items() if column.offered]
        spelled = (" or ".join(name for name, held in offered if held == column) for column in needed)
        needs.append(f"{cls.quantity} has {', '.join(spelled)}")
    near = [(name, mark) for name in names for mark in difflib.get_close_matches(name, marks, n=1)]
    hint = f"{near[0][0]!r}: did you mean {near[0][1]!r}? " if near and not found else ""
    several = "; or kind must say which" if len(found) > 1 else ""
    shown, kinds = ", ".join(names), "; ".join(needs)
    raise ValueError(f"{path}: columns {shown}: {hint}must be those of one kind of data: {kinds}{several}")
