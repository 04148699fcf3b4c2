"""Friction tables in LS-DYNA: DEFINE_TABLE_2D, a curve of mu over the velocity for each pressure.

`*CONTACT_...` takes such a table with FS = 2 and its number as FD. A table has no temperature: each has a
table of its own, and the one to use is chosen in the deck.
[LS-DYNA Keyword User's Manual I, *CONTACT, card 2, and *DEFINE_TABLE_2D]
"""

import re
from collections.abc import Iterator

import numpy as np

from rubberfric.io.friction_tables.table import FrictionTable
from rubberfric.io.friction_tables.units import TableUnits, table_of_rows
from rubberfric.io.prony_cards.series import number, text_of

FIRST = 1001  # number of the first table; those of its curves follow
_TEMPERATURE = re.compile(r"^\$ Table (\d+) is at (\S+) (?:K|C)\b", re.M)


def write(table: FrictionTable, units: TableUnits, _name: str) -> Iterator[str]:
    """Lines of a keyword file; fields have 20 characters, numbers of tables 10."""
    v, p, T = units.of_file(table)
    for k, values in enumerate(table.friction):
        own = FIRST + k * (p.size + 1)
        at = "" if T is None else f" is at {text_of(T[k])} {units.temperature}"
        yield f"$ Table {own}{at}: in *CONTACT FS = 2 and FD = {own}"
        yield "*DEFINE_TABLE_2D"
        yield "$     tbid       sfa      offa"
        yield f"{own:10d}"
        yield "$           pressure             curve"
        for j, pressure in enumerate(p):
            yield f"{text_of(pressure):>20}{own + 1 + j:20d}"
        for j, curve in enumerate(values):
            yield from ("*DEFINE_CURVE", "$     lcid", f"{own + 1 + j:10d}")
            yield "$           velocity                  mu"
            for x, mu in zip(v, curve, strict=True):
                yield f"{text_of(x):>20}{text_of(mu):>20}"


def read(text: str, units: TableUnits) -> FrictionTable:
    """The tables of a keyword file, and the curves that they name."""
    temperatures = {int(number): float(T) for number, T in _TEMPERATURE.findall(text)}
    tables, curves = {}, {}
    for keyword, (first, *cards) in _blocks(text):
        one = int(first[:10])
        pairs = [(number(card[:20]), number(card[20:40])) for card in cards]
        if keyword == "*DEFINE_TABLE_2D":
            tables[one] = pairs
        elif keyword == "*DEFINE_CURVE":
            curves[one] = pairs
    if not tables:
        raise ValueError("has no *DEFINE_TABLE_2D: must be there")
    if len(tables) > 1 and tables.keys() - temperatures.keys():
        raise ValueError(f"has {len(tables)} tables without temperatures: must have one")
    rows = [
        (mu, v, pressure, temperatures.get(one, np.nan))
        for one, table in tables.items()
        for pressure, curve in table
        for v, mu in _curve(curves, int(curve))
    ]
    return table_of_rows(np.array(rows), units)


def _curve(curves, number):
    if number not in curves:
        raise ValueError(f"curve {number}: is named by a table: must be there as *DEFINE_CURVE")
    return curves[number]


def _blocks(text: str) -> Iterator[tuple[str, list[str]]]:
    """(keyword, its cards) without comments."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("$")]
    starts = [i for i, line in enumerate(lines) if line.startswith("*")]
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        if end > start + 1:
            yield lines[start].strip().upper(), lines[start + 1 : end]
