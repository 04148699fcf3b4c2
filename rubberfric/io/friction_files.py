"""Reading and writing of friction tables in the formats of other programs."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rubberfric.base.atomic import StrPath, as_path, read_text, write_text
from rubberfric.base.checks import POSITIVE, ArrayLike, check_choice, check_values, shown
from rubberfric.io.cards.text import (
    STRESS,
    TEMPERATURE,
    comma_line,
    comma_numbers,
    format_number,
    keyword_blocks,
    need,
    wide_numbers,
)
from rubberfric.io.columns import COLUMNS
from rubberfric.io.results import AXES, FrictionTable, as_friction_table
from rubberfric.io.tables import read_names, read_table
from rubberfric.io.text_tables.writing import table_text

_SPEED = COLUMNS["v"].units
_JSON = "rubberfric friction table"  # format
_JSON_UNITS = dict.fromkeys(("friction", "sigma", "area"), "-")
_JSON_UNITS = dict(zip(AXES, ("m/s", "Pa", "K"), strict=True)) | _JSON_UNITS
_FIRST_TABLE = 1001  # number in LS-DYNA; the numbers of the curves follow


class TableUnits(NamedTuple):
    """Units of the axes of a table in a file."""

    velocity: str
    pressure: str
    temperature: str

    def scales(self) -> Iterator[tuple[float, float]]:
        """Yield (factor, offset) for the conversion of velocity, pressure and temperature to SI."""
        yield from ((_SPEED[self.velocity], 0.0), (STRESS[self.pressure], 0.0))
        yield 1.0, TEMPERATURE[self.temperature]


def write_friction(
    path: StrPath,
    table: object,
    program: str | None = None,
    *,
    unit_velocity: str = "m/s",
    unit_pressure: str = "Pa",
    unit_temperature: str = "K",
    name: str = "RUBBER",
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> str:
    """Write a table of mu(v, p, T) for another program.

    Parameters
    ----------
    path : file
    table : FrictionTable, or a result of `rubberfric.friction_map`, `solve` or `friction`
        `rubberfric.analysis.friction_table` and `fitting.friction_table` choose a grid for a stated error.
    program : "abaqus", "lsdyna", "csv", "json" or "log10"
        None selects the program by the suffix .inp, .k, .csv, .json or .txt.
        abaqus: `*FRICTION` with data lines mu, slip rate, pressure, temperature.
        lsdyna: DEFINE_TABLE_2D with a curve for each pressure and a table for each temperature, numbered
        from 1001; `*CONTACT` takes a table with FS = 2 and its number as FD.
        csv: values in SI, with standard errors if the table has them. `fitting.read` reads it.
        json: values in SI, also A/A0 and the interpolation error if the table has them.
        log10: columns log10 v, mu, A/A0 of one curve, as the established program writes them, in m/s.
    unit_velocity : "m/s", "mm/s" or "um/s", for abaqus and lsdyna
    unit_pressure : "Pa", "kPa", "MPa" or "GPa", for abaqus and lsdyna
    unit_temperature : "K" or "C", for abaqus and lsdyna
    name : name of the surface interaction, for abaqus
    velocity, pressure, temperature : arguments of `solve` or `friction` [m/s], [Pa], [K]

    Returns
    -------
    text of the file

    Raises
    ------
    ValueError : unknown program or unit, mu < 0, or a grid that the format cannot represent

    Examples
    --------
    >>> table = rf.io.FrictionTable(np.array([0.01, 0.02]), np.array([2e5]), None, np.array([[[0.5, 0.6]]]))
    >>> print(rf.io.write_friction("road.inp", table, unit_pressure="MPa"), end="")
    ** Friction coefficient: 2 velocities x 1 pressures
    ** Between the points linear in v, p and T; beyond the ends the value of the end
    ** Units: m/s, MPa
    *SURFACE INTERACTION, NAME=RUBBER
    *FRICTION
    0.5, 0.01, 0.2
    0.6, 0.02, 0.2
    """
    path = as_path(path)
    form = PROGRAMS[program := _program(path, program)]
    units = _units("", unit_velocity, unit_pressure, unit_temperature)
    if not form.has_units and units != _SI:
        raise ValueError(f"{path}: units: must be m/s, Pa and K for {program}")
    table = as_friction_table(table, velocity, pressure, temperature)
    lines = [f"{form.comment} {line}" for line in _head(table, units)] if form.comment else []
    text = "\n".join([*lines, *form.write(table, units, name)]) + "\n"
    write_text(path, text)
    return text


def read_friction(
    path: StrPath,
    program: str | None = None,
    *,
    unit_velocity: str | None = None,
    unit_pressure: str | None = None,
    unit_temperature: str | None = None,
    pressure: float | None = None,
) -> FrictionTable:
    """Read a table of mu(v, p, T) from a file.

    Parameters
    ----------
    path, program : as for `write_friction`
    unit_velocity, unit_pressure, unit_temperature : for abaqus and lsdyna
        None selects the units in the comment of a file that `write_friction` wrote.
    pressure : pressure of a curve in log10 columns [Pa], which these files do not contain

    Raises
    ------
    ValueError : the file is invalid. The message names the file and the fault.

    Examples
    --------
    >>> table = rf.io.FrictionTable(np.array([0.01, 0.02]), np.array([2e5]), None, np.array([[[0.5, 0.6]]]))
    >>> text = rf.io.write_friction("road.inp", table, unit_velocity="mm/s", unit_pressure="MPa")
    >>> again = rf.io.read_friction("road.inp")
    >>> again.velocity, again.pressure, again.friction[0, 0]  # in m/s and Pa
    (array([0.01, 0.02]), array([200000.]), array([0.5, 0.6]))
    """
    path = as_path(path)
    form = PROGRAMS[_program(path, program)]
    try:
        if form.read is None:
            return as_friction_table(_read_columns(path, pressure))
        text = read_text(path)
        units = _SI
        if form.has_units:
            units = _units(text, unit_velocity, unit_pressure, unit_temperature)
        return as_friction_table(form.read(text, units))
    except ValueError as error:
        raise ValueError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from None


def _program(path: Path, program: str | None) -> str:
    if program is None:
        suffixes = {suffix: name for name, form in PROGRAMS.items() for suffix in form.suffixes}
        if path.suffix.lower() not in suffixes:
            known = ", ".join(suffixes)
            raise ValueError(f"{path}: suffix {path.suffix!r}: must be {known} unless program is given")
        return suffixes[path.suffix.lower()]
    return check_choice(f"{path}: program", program, PROGRAMS)


# --- units and rows of a file


def _head(table: FrictionTable, units: TableUnits) -> list[str]:
    """Return the lines of a comment that states contents, interpolation error and units of a table."""
    sizes = f"{table.velocity.size} velocities x {table.pressure.size} pressures"
    named = f"Units: {units.velocity}, {units.pressure}"
    if table.temperature is not None:
        sizes += f" x {table.temperature.size} temperatures"
        named += f", {units.temperature}"
    lines = [
        f"Friction coefficient{f' of {table.title}' if table.title else ''}: {sizes}",
        "Between the points linear in v, p and T; beyond the ends the value of the end",
    ]
    if table.error is not None:
        lines.append(f"Relative error of that interpolation: at most {table.error:.2g}")
    return [*lines, named]


def _units(text: str, velocity: str | None, pressure: str | None, temperature: str | None) -> TableUnits:
    """Return the units of velocity, pressure and temperature: as given, or from the comment of a file."""
    line = re.search(r"Units: (\S+), (\S+?)(?:, (K|C))?\s*$", text, re.M)
    v, p, T = line.groups() if line else (None, None, None)
    units = (velocity or v, pressure or p, temperature or T or "K")
    for name, unit, known in zip(AXES, units, (_SPEED, STRESS, TEMPERATURE), strict=True):
        message = f"unit_{name} is missing: must be given because the file does not name it"
        need(unit is not None, message)
        check_choice(f"unit_{name}", unit, known)
    return TableUnits(*map(str, units))


def _file_axes(table: FrictionTable, units: TableUnits) -> list[np.ndarray]:
    """Return velocity, pressure and, if present, temperature of a table in the units of a file."""
    axes = [getattr(table, name) for name in AXES if getattr(table, name) is not None]
    return [(axis - zero) / factor for axis, (factor, zero) in zip(axes, units.scales(), strict=False)]


def _from_rows(rows: Any, units: TableUnits) -> FrictionTable:
    """Return the table from rows (mu, v, p, T) in any order, with T = NaN for no temperatures."""
    mu, *axes = np.array(rows, float).T
    v, p, T = (axis * factor + zero for axis, (factor, zero) in zip(axes, units.scales(), strict=True))
    return as_friction_table(mu, v, p, None if np.isnan(T).all() else T)


# --- Abaqus: data lines mu, slip rate, contact pressure, temperature; the slip rate changes first, all rise
# [Keywords Reference, *FRICTION, "data lines to define the friction coefficient"]


def _write_abaqus(table: FrictionTable, units: TableUnits, name: str) -> Iterator[str]:
    yield from (f"*SURFACE INTERACTION, NAME={name}", "*FRICTION")
    axes = [axis.tolist() for axis in _file_axes(table, units)]
    for index, mu in np.ndenumerate(table.friction):
        yield comma_line(mu, *(axis[i] for axis, i in zip(axes, index[::-1], strict=False)))


def _read_abaqus(text: str, units: TableUnits) -> FrictionTable:
    blocks = keyword_blocks(text, r"\s*(\*\*|$)")
    lines = [data for line, data in blocks if line.partition(",")[0].strip().upper() == "*FRICTION"]
    need(lines and lines[0], "*FRICTION with data is missing: must be given")
    rows = [comma_numbers(line) for line in lines[0]]
    for line, row in zip(lines[0], rows, strict=True):
        message = f"*FRICTION: {line.strip()!r}: must be mu, slip rate, pressure, temperature"
        need(3 <= len(row) <= 4, message)
    return _from_rows([[*row, np.nan][:4] for row in rows], units)


# --- LS-DYNA: DEFINE_TABLE_2D, a curve of mu over the velocity for each pressure, and a table for each
# temperature [Keyword User's Manual I, *CONTACT, card 2, and *DEFINE_TABLE_2D]


def _write_lsdyna(table: FrictionTable, units: TableUnits, _name: str) -> Iterator[str]:
    v, p, *T = _file_axes(table, units)
    for k, values in enumerate(table.friction):
        number = _FIRST_TABLE + k * (p.size + 1)
        at = f" is at {format_number(T[0][k])} {units.temperature}" if T else ""
        yield f"$ Table {number}{at}: in *CONTACT FS = 2 and FD = {number}"
        yield from ("*DEFINE_TABLE_2D", "$     tbid       sfa      offa", f"{number:10d}")
        yield "$           pressure             curve"
        for curve, pressure in enumerate(p, start=number + 1):
            yield f"{format_number(pressure):>20}{curve:20d}"
        for curve, row in enumerate(values, start=number + 1):
            yield from ("*DEFINE_CURVE", "$     lcid", f"{curve:10d}")
            yield "$           velocity                  mu"
            for x, mu in zip(v, row, strict=True):
                yield f"{format_number(x):>20}{format_number(mu):>20}"


def _read_lsdyna(text: str, units: TableUnits) -> FrictionTable:
    numbered = re.findall(r"^\$ Table (\d+) is at (\S+) (?:K|C)\b", text, re.M)
    temperatures = {int(number): float(T) for number, T in numbered}
    tables, curves = {}, {}
    kinds = {"*DEFINE_TABLE_2D": tables, "*DEFINE_CURVE": curves}
    for keyword, cards in keyword_blocks(text, r"\$|\s*$", r"\*"):
        if keyword.upper() in kinds and cards:
            rows = [wide_numbers(card, 2) for card in cards[1:]]
            kinds[keyword.upper()][int(cards[0][:10])] = rows
    need(tables, "*DEFINE_TABLE_2D is missing: must be given")
    message = f"has {len(tables)} tables, but no temperature for some of them; keep one table, or state each"
    known = len(tables) == 1 or not tables.keys() - temperatures.keys()
    need(known, f"{message} temperature in a comment as write_friction does")
    for curve in (int(curve) for table in tables.values() for _, curve in table):
        need(curve in curves, f"curve {curve} of a table is missing: must be given as *DEFINE_CURVE")
    rows = [
        (mu, v, pressure, temperatures.get(number, np.nan))
        for number, table in tables.items()
        for pressure, curve in table
        for v, mu in curves[int(curve)]
    ]
    return _from_rows(rows, units)


# --- CSV with columns v, p, T, mu, sigma in SI; text with the columns log10 v, mu and A/A0 of the established
# program, at one pressure and temperature; JSON with the axes and nested lists


def _write_csv(table: FrictionTable, units: TableUnits, _name: str) -> list[str]:
    axes = np.meshgrid(*_file_axes(table, units)[::-1], indexing="ij")[::-1]
    columns = dict(zip(("v", "p", "T"), (axis.ravel() for axis in axes), strict=False))
    values = {"mu": table.friction, "sigma": table.sigma}
    columns |= {name: x.ravel() for name, x in values.items() if x is not None}
    return table_text(columns).splitlines()


def _write_log10(table: FrictionTable, _units: TableUnits, _name: str) -> Iterator[str]:
    T, p, _ = table.friction.shape
    need(T == p == 1, f"table has {p} pressures and {T} temperatures: must have one of each for log10")
    check_values("velocity", table.velocity, POSITIVE)
    curves = {"log10_v": np.log10(table.velocity), "mu_visc": table.friction, "A_over_A0": table.area}
    curves = {name: values.ravel() for name, values in curves.items() if values is not None}
    yield from (",".join(curves), ",".join(["log10(m/s)", "-", "-"][: len(curves)]))
    for row in zip(*curves.values(), strict=True):
        yield ",".join(f"{x:.10g}" for x in row)


def _read_columns(path: Path, pressure: float | None) -> FrictionTable:
    optional = tuple({"p", "T", "sigma", "A_over_A0"} & set(read_names(path)))
    columns = read_table(path, ("v", "mu"), optional, increasing=False, bad_rows=None)
    message = f"pressure = {shown(pressure)}: must not be given because the file has it"
    need("p" not in columns or pressure is None, message)
    message = "pressure is missing: must be given because the file does not have it [Pa]"
    need("p" in columns or pressure is not None, message)
    at = columns["v"], columns.get("p", pressure), columns.get("T")
    tables = {
        field: as_friction_table(columns[name], *at)
        for field, name in (("friction", "mu"), ("sigma", "sigma"), ("area", "A_over_A0"))
        if name in columns
    }
    return tables["friction"]._replace(**{field: table.friction for field, table in tables.items()})


def _write_json(table: FrictionTable, _units: TableUnits, _name: str) -> list[str]:
    content: dict[str, object] = {"format": _JSON, "title": table.title}
    content["interpolation"] = "linear in velocity, pressure and temperature, constant beyond the ends"
    content["relative_interpolation_error"] = table.error
    content["order"] = "[temperature][pressure][velocity]"
    for name, unit in _JSON_UNITS.items():
        values = getattr(table, name)
        if values is not None:
            content[name] = {"unit": unit, "values": np.asarray(values).tolist()}
    return [json.dumps(content, indent=1, ensure_ascii=False)]


def _read_json(text: str, _units: TableUnits) -> FrictionTable:
    try:
        content = json.loads(text)
        if content["format"] != _JSON:
            raise KeyError
        values = {name: np.array(content[name]["values"], float) for name in _JSON_UNITS if name in content}
        error, title = content.get("relative_interpolation_error"), content.get("title", "")
        T = values.pop("temperature", None)
        table = FrictionTable(**values, temperature=T, error=error, title=title)
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"must be JSON with format = {_JSON!r}, axes and friction") from None
    axes = table.temperature, table.pressure, table.velocity
    shape = tuple(1 if axis is None else axis.size for axis in axes)
    for name in ("friction", "sigma", "area"):
        if name in values:
            own = values[name].shape
            need(own == shape, f"{name} has shape {own}: must be {shape} for these axes")
    return table


class _Format(NamedTuple):
    suffixes: tuple[str, ...]
    comment: str  # beginning of a comment line; "": none
    has_units: bool  # False: SI
    write: Callable[[FrictionTable, TableUnits, str], Iterator[str] | list[str]]
    read: Callable[[str, TableUnits], FrictionTable] | None  # None: columns


_SI = TableUnits("m/s", "Pa", "K")
PROGRAMS = {
    "abaqus": _Format((".inp",), "**", True, _write_abaqus, _read_abaqus),
    "lsdyna": _Format((".k", ".key"), "$", True, _write_lsdyna, _read_lsdyna),
    "csv": _Format((".csv",), "#", False, _write_csv, None),
    "json": _Format((".json",), "", False, _write_json, _read_json),
    "log10": _Format((".txt",), "", False, _write_log10, None),
}
