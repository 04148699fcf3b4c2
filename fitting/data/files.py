"""Files of measured data: CSV tables and HDF5.

A CSV table has two header rows, names and units (`rubberfric.io.tables`). Its columns determine the kind of
data:

    friction   v | log10_v, mu, and if known  sigma | relative_sigma, p, T
               F_t, F_n: mu = |F_t| / |F_n| and p = |F_n| / A, with a column A or the argument area
               v_travel, slip_angle, slip_ratio: v of a rolling wheel
               t, x: time and position of records, see `fitting.data.records`
    area       v | log10_v, A_over_A0,        sigma | relative_sigma, p, T
    modulus    omega | f, E_stor, E_loss,     sigma_stor, sigma_loss | relative_sigma, T
               E_comp with delta or tan_del, compliances D_stor ..., and shear moduli with `poisson`
    relaxation t, E_relax | G_relax,          sigma_relax | relative_sigma, T
    creep      t, D_creep | J_creep,          sigma_creep | relative_sigma, T
    spectrum   q | log10_q, C | log10_C,      sigma_C | relative_sigma
               q | log10_q | n, C_1D | log10_C_1D | W1 | Wr | G_d, relative_sigma: see `read`
    force      slip_angle | slip_ratio, v_travel, F_n, F_t, sigma_F_t | relative_sigma, T
    moment     slip_angle, v_travel, F_n, moment, sigma_moment | relative_sigma, T

A wheel tester gives forces, or friction if its pressure is known.

Tables of other programs are read as well (`rubberfric.io.exports`): other names, separators, a
preamble.

An HDF5 file holds one group /data with the attributes kind, name and body, and a dataset
with units for each field that is not None.
"""

import dataclasses
from typing import Any, Literal, TypedDict, Unpack, overload

import h5py
import numpy as np

from fitting.data.averages import average as mean_of_runs
from fitting.data.kinds import KINDS, AreaData, FrictionData, ModulusData, SpectrumData
from fitting.data.measured import DATA_FORMAT, Measured
from fitting.data.recognition import kind_of_table, named_kind
from fitting.data.records import Steps, check_velocity, read_record
from fitting.data.slip import MomentData, SlipData, with_sign_of_slip
from fitting.data.transients import CreepData, RelaxationData
from rubberfric.base import (
    FINITE,
    POSITIVE,
    TABLE_SUFFIXES,
    ArrayLike,
    StrPath,
    as_leaf,
    as_path,
    check_values,
    closest,
    shown,
)
from rubberfric.io import (
    Frame,
    as_source,
    column_hint,
    hdf5,
    read_density,
    read_names,
    read_normalisation,
    read_table,
    stated_frequency,
)
from rubberfric.roughness import LINES, check_normalisation, density_column, spectrum_from


class _Options(TypedDict, total=False):
    """Arguments of `read` apart from `kind`, for type checkers."""

    pressure: ArrayLike | None
    temperature: ArrayLike | None
    body: str | None
    relative: ArrayLike | None
    normalisation: str | None
    hurst: float | None
    poisson: float | None
    columns: list[str] | None
    check_units: bool
    bad_rows: str
    area: float | None
    frequency: float | None
    block: int | None
    zero: bool
    discard: str | None
    fold: bool | str
    average: bool
    stroke: float | None


@overload
def read(path: StrPath | Any, *, kind: Literal["friction"], **options: Unpack[_Options]) -> FrictionData: ...
@overload
def read(path: StrPath | Any, *, kind: Literal["area"], **options: Unpack[_Options]) -> AreaData: ...
@overload
def read(path: StrPath | Any, *, kind: Literal["modulus"], **options: Unpack[_Options]) -> ModulusData: ...
@overload
def read(
    path: StrPath | Any, *, kind: Literal["relaxation"], **options: Unpack[_Options]
) -> RelaxationData: ...
@overload
def read(path: StrPath | Any, *, kind: Literal["creep"], **options: Unpack[_Options]) -> CreepData: ...
@overload
def read(path: StrPath | Any, *, kind: Literal["spectrum"], **options: Unpack[_Options]) -> SpectrumData: ...
@overload
def read(path: StrPath | Any, *, kind: Literal["force"], **options: Unpack[_Options]) -> SlipData: ...
@overload
def read(path: StrPath | Any, *, kind: Literal["moment"], **options: Unpack[_Options]) -> MomentData: ...
@overload
def read(path: StrPath | Any, *, kind: None = None, **options: Unpack[_Options]) -> Any: ...
def read(
    path: StrPath | Any,
    *,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
    body: str | None = None,
    relative: ArrayLike | None = None,
    normalisation: str | None = None,
    hurst: float | None = None,
    poisson: float | None = None,
    columns: list[str] | None = None,
    kind: str | None = None,
    check_units: bool = True,
    bad_rows: str = "error",
    area: float | None = None,
    frequency: float | None = None,
    block: int | None = None,
    zero: bool = False,
    discard: str | None = None,
    fold: bool | str = False,
    average: bool = False,
    stroke: float | None = None,
) -> Measured:
    """Read measured data from a table, an .h5 file or a data frame.

    Tables are .csv, .txt, .tsv, .dat, and .xlsx with openpyxl.

    Parameters
    ----------
    path : path of the file, or a data frame of pandas, polars, xarray or pyarrow, or a mapping
        A data frame has the same titles as a table. `rubberfric.io.as_frame(frame, units)` adds units.
    pressure, temperature, body, relative : as in the constructors
        Values that the file lacks. Friction and area need a pressure [Pa], in the file or here. A CSV file
        never contains the body.
    normalisation, hurst : normalisation, and H, of a spectrum in a CSV file
        See `rubberfric.roughness.normalisation`. The normalisation is required for a spectrum, unless a title
        names it (W1 and Wr of Gwyddion, Gd of ISO 8608, texts of contact.engineering), or the text above the
        table does (ISO 8608, or "normalisation C" as in a file of `write`). Without H, a spectrum along a
        line is inverted by `areal_spectrum`, with the relative errors of the file if it has them. They are
        kept as errors of C. With H it is converted as for a self-affine surface, which makes h_rms 1.09 to
        1.4 times too large at a roll-off. A column "wavenumber" needs the unit rad/m or cycles/m unless the
        normalisation is "W1", "Wr", "q_C_iso_over_pi", "C_1D_one_sided" (rad/m) or "ISO_8608" (cycles/m).
    poisson : Poisson's ratio [-], needed for a table of shear moduli, E = 2 (1 + poisson) G
        A "storage modulus" is read as E' if `poisson` is None, and as G' otherwise.
    columns : list of "name [unit]", or None
        Columns of a table without names, "-" for a column that is not read.
    kind : "friction", "area", "modulus", "relaxation", "creep", "spectrum", "force" or "moment"
        Type checkers know the class of the result if `kind` is given; otherwise it is Any to them. An .h5
        file must contain this kind. Needed for a table that contains several kinds, and for stress and strain
        over time, which give "relaxation" or "creep". A table of oscillation and of time is a "modulus" by
        default. Of a wheel tester, a table with a slip, speed, load and force is read as "force" if no
        pressure or area is known, and as "friction" otherwise.
    check_units : bool
        If True, raise ValueError for values of a table that look like values in another unit.
    bad_rows : "error", or "drop" to leave out rows with an empty, missing or invalid value
        A warning names their lines. Notes below a table are no rows (`rubberfric.io.text_tables.lines`).
    area : nominal contact area [m^2], which gives the pressure if the table has normal forces
    frequency : frequency [Hz] of all moduli, if the table has no column of frequencies, or of the strokes
        None: the frequency that the lines above the table state, such as "Frequency: 10 Hz".
    block : number of the block of columns, from 1, if the table has several blocks with equal titles
    zero : bool
        True subtracts the drift of load cells from the forces of a record: a line through the readings
        without load before and after the run.
    discard : "10 mm", "2 s" or "settling": the start of each section of a record is left out
        A section has one direction and one velocity. "settling" is the part before mu settles.
    fold : False, True, "middle" or "speeds"
        True combines both directions of reciprocating runs, so that a misalignment cancels. The hysteresis
        is the error. "middle" does so for the middle 20 % of sinusoidal strokes, and "speeds" for bins of the
        speed. Without a column v, they need t and x, or x and `frequency`, or t, `frequency` and `stroke`
        (`fitting.data.strokes`).
    average : bool
        True averages the sections of a record and equal conditions, see `fitting.average`. The errors follow
        from the scatter of repeated conditions.
    stroke : length of sinusoidal strokes [m], from one turning point to the other
        None: the stroke that the lines above the table state, such as "Stroke: 1 mm".

    Returns
    -------
    Data of the class in `fitting.data.kinds.KINDS` that the columns of a table or the kind in an HDF5 file
    determine. Forces and moments that all have the opposite sign of the slip are reversed. Numbers written by
    `write` are read back to the last bit. Only .h5 files keep `name` and `history`, which states how
    quantities were computed from columns, and the effects of `zero`, `discard`, `fold` and `average`
    (`fitting.data.records`).

    Raises
    ------
    ValueError
        The message is one line that names the file, the fault and the rule. An argument that the file already
        contains, or that its kind of data does not have, is an error as well.

    Examples
    --------
    >>> run = {"v [mm/s]": [5, 5, -5, -5], "Fn [N]": [100] * 4, "Ft [N]": [82, 82, -78, -78]}
    >>> data = fitting.read(run, area=4e-4, fold=True)
    >>> data.friction, data.pressure, data.sigma
    (array([0.8]), array([250000.]), array([0.02]))
    """
    source = as_source(path)
    is_file = not isinstance(source, Frame)
    path = as_path(source) if is_file else source
    steps = Steps(zero, discard, fold, average, stroke)
    steps.check(str(path))
    arguments = _present(pressure=pressure, temperature=temperature, body=body, relative=relative)
    scaling = _present(normalisation=normalisation, hurst=hurst)
    layout = _present(columns=columns, poisson=poisson, area=area, block=block)
    if is_file and path.suffix.lower() == ".h5":
        _refuse(path, steps.chosen(), "it is for tables")
        _refuse(path, layout | _present(frequency=frequency), "it is for tables")
        _refuse(path, scaling, "it is for CSV spectra")
        return _read_hdf5(path, arguments, kind)
    if is_file:
        _check_suffix(path)
    if pressure is not None:
        _refuse(path, _present(area=area), "pressure is given, too")
    _check_numbers(path, _present(poisson=poisson, area=area, frequency=frequency, hurst=hurst))
    cls = kind_of_table(path, columns, poisson, kind, block, pressure is not None or area is not None)
    names = {name: about.column for name, about in cls.fields().items()}
    needed = tuple(names[name] for name in cls.needed() if name not in ("pressure", "omega"))
    optional = tuple(column for column in names.values() if column not in needed)
    layout["bad_rows"] = bad_rows
    history: list[str] = []
    if any(steps):
        if cls is not FrictionData:
            _refuse(path, steps.chosen(), f"{cls.quantity} data have none")
        path = read_record(path, steps, frequency, layout, history)
        layout, frequency = _present(area=area, bad_rows=bad_rows), None
    elif cls is FrictionData:
        check_velocity(path, layout)
    if cls is SpectrumData:
        table = _read_spectrum(path, optional, normalisation, hurst, layout)
    else:
        _refuse(path, scaling, "it is for CSV spectra")
        table = read_table(path, needed, optional, increasing=False, history=history, **layout)
    values = {name: table[column] for name, column in names.items() if column in table}
    values = with_sign_of_slip(cls, values, history) if cls in (SlipData, MomentData) else values
    arguments |= _omega_of_all(path, cls, values, frequency)
    _check_conditions(path, cls, {*values, *arguments}, layout)
    try:
        data = _made(cls, values, arguments | {"history": tuple(history)}, check_units)
        return mean_of_runs(data) if isinstance(data, FrictionData) and average else data
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _omega_of_all(path, cls, values, frequency):
    """Return {"omega": one angular frequency} if `frequency` or the lines above a table state it, or {}."""
    known = "omega" in cls.fields() and "omega" not in values
    if frequency is None:
        return _present(omega=stated_frequency(path)) if known and not isinstance(path, Frame) else {}
    if not known:
        why = "the file has it" if "omega" in values else f"{cls.quantity} data have none"
        _refuse(path, {"frequency": frequency}, why)
    return {"omega": 2 * np.pi * frequency}


def _check_suffix(path):
    if (suffix := path.suffix.lower()) not in TABLE_SUFFIXES:
        sheet = "; save a sheet as .csv" if suffix in (".xls", ".ods") else ""
        sheet = "; it is a folder" if path.is_dir() else sheet
        raise ValueError(f"{path}: suffix {path.suffix!r}: must be {', '.join(TABLE_SUFFIXES)} or .h5{sheet}")


def _read_hdf5(path, arguments, kind):
    """Return the data of an HDF5 file, which must be of the class that `kind` names unless it is None."""
    wanted = None if kind is None else named_kind(path, kind)
    with hdf5.reading(path, DATA_FORMAT) as file:
        hdf5.check_names(file, ("data",), ("format", "format_version", "rubberfric_version"))
        if "data" not in file:
            raise ValueError("/data: is missing; must be a group")
        data = read_group(file["data"], **arguments)
    if wanted is not None and type(data) is not wanted:
        raise ValueError(f"{path}: kind = {kind!r}: the file contains {data.quantity} data; leave kind out")
    return data


def _check_conditions(path, cls, known, layout):
    """Raise ValueError if pressure or frequency is neither in the table nor given to `read`."""
    if "pressure" in cls.needed() and "pressure" not in known:
        own = {name: layout[name] for name in ("columns", "block") if name in layout}
        load = "F_n" in read_names(path, **own)
        way = "give area=... [m^2], because p = F_n / area" if load else "give pressure=... [Pa]"
        raise ValueError(f"{path}: no column p: add it to the table, or {way}")
    if "omega" in cls.needed() and "omega" not in known:
        hint = "" if "columns" in layout else column_hint(path)
        raise ValueError(
            f"{path}: no column omega or f: add it to the table, or give frequency=... [Hz]{hint}"
        )


def write(path: StrPath, data: Measured) -> None:
    """Write measured data to a .csv or .h5 file with `Measured.write`, completely or not at all.

    Raises
    ------
    ValueError
        `data` is not measured data, or `Measured.write` raises ValueError. The message is one line.

    Examples
    --------
    >>> data = fitting.FrictionData([1e-3, 1e-2], [0.8, 1.0], pressure=2e5, relative=0.03)
    >>> fitting.write("friction.csv", data)
    >>> fitting.read("friction.csv").friction
    array([0.8, 1. ])
    """
    if type(data) not in KINDS.values():
        kinds = ", ".join(cls.__name__ for cls in KINDS.values())
        raise ValueError(f"{path}: data = {shown(data)}: must be one of {kinds}")
    data.write(path)


def read_group(group: h5py.Group | h5py.Dataset | h5py.Datatype, **arguments: Any) -> Measured:
    """Return the measured data that `Measured.write_group` stored in an HDF5 group.

    `arguments` are values that the group lacks, as in `read`. Raise ValueError, with a message of one line,
    if the group does not contain measured data.
    """
    if not isinstance(group, h5py.Group):
        raise ValueError(f"{group.name}: must be a group, not a dataset")
    kind = hdf5.plain(group.attrs.get("kind"))
    if not isinstance(kind, str) or kind not in KINDS:
        raise ValueError(f"{group.name}: kind = {kind!r}: {closest(kind, tuple(KINDS))}")
    cls = KINDS[kind]
    texts = _arguments(cls) & {"name", "body"}
    hdf5.check_names(group, (*cls.fields(), "history"), ("kind", *sorted(texts)))
    values = {name: hdf5.plain(group.attrs[name]) for name in texts if name in group.attrs}
    if "history" in group:
        values["history"] = hdf5.read_texts(group, "history")
    for name, about in cls.fields().items():
        if name in group or name in cls.needed():
            values[name] = hdf5.read_values(group, name, about.unit)
    try:
        return _made(cls, values, arguments, check_units=False)
    except ValueError as error:
        raise ValueError(f"{group.name}: {error}") from None


def _present(**arguments):
    return {name: value for name, value in arguments.items() if value is not None}


def _refuse(path, arguments, why):
    for name, value in arguments.items():
        raise ValueError(f"{path}: {name} = {shown(value)}: must not be given; {why}")


def _check_numbers(path, arguments):
    """Raise ValueError unless all arguments are finite numbers."""
    for name, value in arguments.items():
        own = f"{path}: {name}"
        check_values(own, as_leaf(own, value, 0), POSITIVE if name == "frequency" else FINITE)


def _read_spectrum(path, optional, normalisation, hurst, layout):
    """Return the columns of a spectrum, with C in the normalisation of this project.

    A spectrum in m^3 has no sigma, which would have another unit.
    """
    normalisation = read_normalisation(path, normalisation, layout.get("columns"))
    try:
        check_normalisation(normalisation, hurst, table=True)
        if density_column(normalisation) != "C":
            optional = tuple(name for name in optional if name != "sigma_C")
        # Without H, a spectrum along a line must be in order.
        ordered = normalisation in LINES and hurst is None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    table = read_density(path, normalisation, optional, increasing=ordered, **layout)
    for name in table.keys() & {"C", "sigma_C"}:
        try:
            own = table.get("relative_sigma") if ordered else None
            table[name] = np.asarray(
                spectrum_from(normalisation, table["q"], table[name], hurst, relative=own)
            )
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
    return table


def _arguments(cls):
    return {field.name for field in dataclasses.fields(cls)}


def _made(cls, values, arguments, check_units):
    for name, value in arguments.items():
        if name not in _arguments(cls):
            raise ValueError(f"{name} = {shown(value)}: must not be given; {cls.quantity} data have none")
        if name in values:
            raise ValueError(f"{name} = {shown(value)}: must not be given; the file has it")
    return cls(**values, **arguments, check_units=check_units)
