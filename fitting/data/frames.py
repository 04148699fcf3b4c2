"""Measured data from and to data frames, of pandas or of whatever else has named columns."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from fitting.data.fields import Field
from rubberfric.base import closest, shown
from rubberfric.io import COLUMNS, known_name, known_unit


def fields_in(
    frame: Any, fields: Mapping[str, Field], needed: Collection[str], units: Mapping[str, str] | None = None
) -> dict[str, np.ndarray]:
    """Columns of a frame in SI, by the fields that they are; columns of other names are left out.

    Parameters
    ----------
    frame : pandas.DataFrame, or a mapping of title to numbers
        titles are names of columns as in files (`fitting.data.files`: v, mu, T, ...), as instruments and
        other programs spell them (`rubberfric.io.known_name`: velocity, E', Temperature (°C), ...), or
        "name [unit]".
    fields : of the kind of data
    needed : those that must be there
    units : of titles that do not say them, such as {"v": "mm/s"}; SI else

    Raises
    ------
    ValueError
        one line: a column is missing, there twice, or holds no numbers; a unit is unknown; `units` names no
        column.
    """
    units = dict(units or {})
    wanted = {about.column: name for name, about in fields.items()}
    found: dict[str, np.ndarray] = {}
    for title in frame:
        if not isinstance(title, str):
            continue
        name, unit = known_name(title)
        column = None if name is None else COLUMNS.get(name)
        if name is None or column is None or column.name not in wanted:
            continue
        unit = units.pop(title, units.pop(name, unit))
        unit = next(iter(column.units)) if unit is None else known_unit(unit, name)
        if unit not in column.units:
            raise ValueError(f"column {title!r}: unit {shown(unit)}: {closest(unit, tuple(column.units))}")
        field = wanted[column.name]
        if field in found:
            raise ValueError(f"column {title!r}: {column.name} is given twice")
        found[field] = np.array([column.value(value, unit) for value in _numbers(title, frame[title])])
    if units:
        raise ValueError(f"units: {next(iter(units))!r} is no column that is read")
    for field in needed:
        if field not in found:
            titles = ", ".join(str(title) for title in frame)
            raise ValueError(
                f"the frame has no column {fields[field].column} [{fields[field].unit}], but {titles}: rename"
                f" one, or give {field}="
            )
    return found


def _numbers(title, values):
    try:
        return [float(value) for value in np.asarray(values)]
    except (TypeError, ValueError):
        raise ValueError(f"column {title!r}: must be numbers") from None
