"""Files of friction tables, in the formats of the programs that use friction."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.atomic import StrPath, as_path, replacing
from rubberfric.base.checks import closest, shown
from rubberfric.io.friction_tables import abaqus, lsdyna, plain
from rubberfric.io.friction_tables.table import FrictionTable, as_friction_table
from rubberfric.io.friction_tables.units import TableUnits, head, named_units, table_of_rows
from rubberfric.io.tables.reading import read_names, read_table
from rubberfric.io.tables.text import read_text
from rubberfric.io.tables.writing import write_table


class Deck(NamedTuple):
    """The cards of one program."""

    comment: str
    write: Callable[[FrictionTable, TableUnits, str], Iterator[str]]
    read: Callable[[str, TableUnits], FrictionTable]


DECKS = {
    "abaqus": Deck("**", abaqus.write, abaqus.read),
    "lsdyna": Deck("$", lsdyna.write, lsdyna.read),
}
PROGRAMS = (*DECKS, "csv", "json", "log10")
_SUFFIXES = {
    ".inp": "abaqus",
    ".k": "lsdyna",
    ".key": "lsdyna",
    ".csv": "csv",
    ".json": "json",
    ".txt": "log10",
}
_SI = TableUnits("m/s", "Pa", "K")


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
    """Write a table of mu(v, p, T) as another program reads it, whole or not at all.

    Parameters
    ----------
    path : file
    table : FrictionTable, or what `rubberfric.friction_map`, `solve` or `friction` return
        `rubberfric.analysis.friction_table` and `fitting.friction_table` choose a grid for a stated error.
    program : "abaqus", "lsdyna", "csv", "json" or "log10"; None: by the suffix .inp, .k, .csv, .json, .txt
        abaqus: *FRICTION with data lines mu, slip rate, pressure, temperature.
        lsdyna: DEFINE_TABLE_2D with a curve for each pressure, a table for each temperature; numbered from
        1001.
        csv, json: in SI, with error bars where the table has them; `fitting.read` reads the first.
        log10: columns log10 v, mu, A/A0 of one curve, as the established program writes them, in m/s.
    unit_velocity : "m/s", "mm/s" or "um/s"; of abaqus and lsdyna, as all units here
    unit_pressure : "Pa", "kPa", "MPa" or "GPa"
    unit_temperature : "K" or "C"
    name : of the surface interaction, for abaqus
    velocity, pressure, temperature : at what `solve` or `friction` computed [m/s], [Pa], [K]

    Returns
    -------
    the text

    Raises
    ------
    ValueError
        one line: no such table, program or unit; mu < 0; a grid that the format cannot hold.
    """
    path = as_path(path)
    program = _program(path, program)
    units = named_units("", unit_velocity, unit_pressure, unit_temperature)
    if program not in DECKS and units != _SI:
        raise ValueError(f"{path}: units: must be m/s, Pa and K, which are what {program} has")
    table = as_friction_table(table, velocity, pressure, temperature)
    if program == "csv":
        write_table(path, plain.columns(table), "\n".join(head(table, _SI)))
        return read_text(path)
    if program in DECKS:
        deck = DECKS[program]
        lines = [f"{deck.comment} {line}" for line in head(table, units)]
        text = "\n".join([*lines, *deck.write(table, units, name)]) + "\n"
    else:
        text = plain.to_json(table) if program == "json" else plain.to_log10(table)
    if not path.parent.is_dir():
        raise ValueError(f"{path}: there is no folder {str(path.parent)!r}; it must exist")
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")
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
    """The table of mu(v, p, T) in a file; the arguments are those of `write_friction`.

    Parameters
    ----------
    unit_velocity, unit_pressure, unit_temperature : of abaqus and lsdyna
        None: those that the comment of a file written here names.
    pressure : [Pa] of a curve in log10 columns, which do not say it

    Raises
    ------
    ValueError : one line naming the file and what is missing or wrong.
    """
    path = as_path(path)
    program = _program(path, program)
    try:
        if program in DECKS:
            text = read_text(path)
            units = named_units(text, unit_velocity, unit_pressure, unit_temperature)
            return as_friction_table(DECKS[program].read(text, units))
        if program == "json":
            return as_friction_table(plain.from_json(read_text(path)))
    except ValueError as error:
        raise ValueError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from None
    needed, optional = ("v", "mu"), ("p", "T", "sigma", "A_over_A0")
    optional = tuple(name for name in optional if name in read_names(path))
    columns = read_table(path, needed, optional, increasing=False)
    if "p" in columns and pressure is not None:
        raise ValueError(f"{path}: pressure = {shown(pressure)}: must not be given; the file has it")
    if "p" not in columns and pressure is None:
        raise ValueError(f"{path}: pressure is missing: must be given, the file does not say it [Pa]")
    full = {"p": np.full(columns["v"].size, pressure), "T": np.full(columns["v"].size, np.nan)} | columns
    tables = {}
    for name in ("mu", "sigma", "A_over_A0"):
        if name in columns:
            rows = np.stack([columns[name], full["v"], full["p"], full["T"]], 1)
            try:
                tables[name] = table_of_rows(rows, _SI)
            except ValueError as error:
                raise ValueError(f"{path}: {error}") from None
    others = {"sigma": "sigma", "area": "A_over_A0"}
    extra = {field: tables[name].friction for field, name in others.items() if name in tables}
    return as_friction_table(tables["mu"]._replace(**extra))


def _program(path: Path, program: str | None) -> str:
    if program is None:
        if path.suffix.lower() not in _SUFFIXES:
            known = ", ".join(_SUFFIXES)
            raise ValueError(f"{path}: suffix {path.suffix!r}: must be {known}, or program be given")
        return _SUFFIXES[path.suffix.lower()]
    if not isinstance(program, str) or program not in PROGRAMS:
        raise ValueError(f"{path}: program = {shown(program)}: {closest(program, PROGRAMS)}")
    return program
