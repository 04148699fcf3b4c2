"""Friction tables in Abaqus: *FRICTION with data lines mu, slip rate, contact pressure, temperature.

The slip rate changes first, then the pressure, then the temperature, each rising.
[Abaqus Keywords Reference, *FRICTION, "data lines to define the friction coefficient"]
"""

from collections.abc import Iterator

import numpy as np

from rubberfric.io.friction_tables.table import FrictionTable
from rubberfric.io.friction_tables.units import TableUnits, table_of_rows
from rubberfric.io.prony_cards.series import number, text_of


def write(table: FrictionTable, units: TableUnits, name: str) -> Iterator[str]:
    """Lines of an input file."""
    v, p, T = units.of_file(table)
    yield f"*SURFACE INTERACTION, NAME={name}"
    yield "*FRICTION"
    for k, j, i in np.ndindex(table.friction.shape):
        fields = table.friction[k, j, i], v[i], p[j], *(() if T is None else (T[k],))
        yield ", ".join(text_of(float(x)) for x in fields)


def read(text: str, units: TableUnits) -> FrictionTable:
    """The first *FRICTION of an input file."""
    rows, inside = [], False
    for line in text.splitlines():
        if line.startswith("**") or not line.strip():
            continue
        if line.lstrip().startswith("*"):
            if inside:
                break
            inside = line.strip().partition(",")[0].strip().upper() == "*FRICTION"
        elif inside:
            fields = line.rstrip().rstrip(",").split(",")
            if not 3 <= len(fields) <= 4:
                raise ValueError(f"*FRICTION: {line.strip()!r}: must be mu, slip rate, pressure, temperature")
            rows.append([*map(number, fields), np.nan][:4])
    if not rows:
        raise ValueError("has no *FRICTION with data: must be there")
    return table_of_rows(np.array(rows), units)
