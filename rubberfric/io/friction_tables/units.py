"""Units of a table of friction in the file of another program, and the lines that name them."""

import re
from typing import NamedTuple

import numpy as np

from rubberfric.base.checks import closest, shown
from rubberfric.io.friction_tables.table import FrictionTable
from rubberfric.io.prony_cards.series import STRESS, TEMPERATURE
from rubberfric.io.tables.columns import COLUMNS

SPEED = COLUMNS["v"].units
_NAMED = re.compile(r"Units: (\S+), (\S+?)(?:, (K|C))?\s*$", re.M)


class TableUnits(NamedTuple):
    """Units of the axes of a table in a file."""

    velocity: str
    pressure: str
    temperature: str

    def of_file(self, table: FrictionTable) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Velocity, pressure and temperature of a table in these units."""
        T = None if table.temperature is None else table.temperature - TEMPERATURE[self.temperature]
        return table.velocity / SPEED[self.velocity], table.pressure / STRESS[self.pressure], T

    def in_si(
        self, velocity: np.ndarray, pressure: np.ndarray, temperature: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """The same of a file in SI."""
        T = None if temperature is None else temperature + TEMPERATURE[self.temperature]
        return velocity * SPEED[self.velocity], pressure * STRESS[self.pressure], T


def head(table: FrictionTable, units: TableUnits) -> list[str]:
    """What a comment at the top of a file says: what it holds, its units and its error."""
    temperatures = 0 if table.temperature is None else table.temperature.size
    sizes = f"{table.velocity.size} velocities x {table.pressure.size} pressures"
    lines = [f"Friction coefficient{f' of {table.title}' if table.title else ''}: {sizes}"]
    if temperatures:
        lines[0] += f" x {temperatures} temperatures"
    # The last line of the three, for `named_units` reads to the end of a line.
    named = f"Units: {units.velocity}, {units.pressure}" + (f", {units.temperature}" if temperatures else "")
    lines.append("Between the points linear in v, p and T; beyond the ends the value of the end")
    if table.error is not None:
        lines.append(f"Relative error of that interpolation: at most {table.error:.2g}")
    return [*lines, named]


def named_units(text: str, velocity: str | None, pressure: str | None, temperature: str | None) -> TableUnits:
    """Units of a file: those given, else those that its comment names.

    ValueError if neither says them, or if one is unknown.
    """
    found = _NAMED.search(text)
    own = found.groups() if found else (None, None, None)
    given = (velocity or own[0], pressure or own[1], temperature or own[2] or "K")
    for name, unit, known in zip(TableUnits._fields, given, (SPEED, STRESS, TEMPERATURE), strict=True):
        if unit is None:
            raise ValueError(f"unit_{name} is missing: must be given, the file does not say it")
        if not isinstance(unit, str) or unit not in known:
            raise ValueError(f"unit_{name} = {shown(unit)}: {closest(unit, tuple(known))}")
    return TableUnits(*map(str, given))


def table_of_rows(rows: np.ndarray, units: TableUnits) -> FrictionTable:
    """The table of rows (mu, v, p, T) in the units of a file, T NaN where there is none; in any order.

    ValueError unless they are a full grid, each point once.
    """
    mu, v, p, T = rows.T
    axes, places = zip(*(np.unique(x, return_inverse=True) for x in (T, p, v)), strict=True)
    shape = tuple(axis.size for axis in axes)
    friction = np.full(shape, np.nan)
    friction[places] = mu
    if mu.size != friction.size or np.isnan(friction).any():
        raise ValueError(
            f"has {mu.size} points over {shape[2]} velocities, {shape[1]} pressures and {shape[0]}"
            " temperatures: must have every combination once"
        )
    axes = units.in_si(axes[2], axes[1], None if np.isnan(T).any() else axes[0])
    return FrictionTable(*axes, friction)
