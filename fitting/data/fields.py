"""Fields of measured data: their columns in tables and data frames, their units, and their rules."""

import dataclasses
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import ArrayLike

from rubberfric.base import FINITE, closest, listed, shown
from rubberfric.io import COLUMNS, known_name, known_unit

ValueRule = tuple[str, Callable[[np.ndarray], np.ndarray]]
_T = TypeVar("_T")


def unit_rule(text: str, test: Callable[[np.ndarray], np.ndarray]) -> ValueRule:
    """Return a rule for plausible values, which `check_units=False` switches off.

    A value that violates the rule is noise or is given in another unit.
    """
    return (f"{text} (check_units=False accepts it)", test)


class Field(NamedTuple):
    """Description of a field of measured data."""

    column: str  # name of the column in tables
    unit: str
    rule: ValueRule = FINITE  # always applied
    plausible: tuple[ValueRule, ...] = ()  # applied unless check_units=False


def numbers(name: str, value: ArrayLike) -> np.ndarray:
    """Return a float64 array of real numbers, or raise ValueError for other values or none."""
    try:
        array = np.asarray(value)
        # a mask would be lost without an error
        if array.dtype.kind not in "fiu" or np.ma.is_masked(value):
            raise TypeError
        array = array.astype(float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {shown(value)}: must be real numbers") from None
    if array.size == 0:
        raise ValueError(f"{name} is empty: must have at least one value")
    return array


class GivenArray:
    """Annotation of a field whose array must be given.

    Type checkers learn that the constructor takes an ArrayLike (`__set__`) and that the attribute is an array
    (`__get__`).
    """

    def __get__(self, instance: object, owner: type) -> np.ndarray: ...
    def __set__(self, instance: object, value: ArrayLike) -> None: ...


class OptionalArray:
    """Annotation of a field that holds an array or None."""

    def __get__(self, instance: object, owner: type) -> np.ndarray | None: ...
    def __set__(self, instance: object, value: ArrayLike | None) -> None: ...


def array(about: Field, *, default: Any = dataclasses.MISSING, kw_only: bool = False) -> Any:
    """Return a field of a class that is decorated with `measurement`.

    The field must be annotated as GivenArray or OptionalArray.

    Parameters
    ----------
    about : column, unit and rules of the field
    default, kw_only : as in `dataclasses.field`
    """
    return dataclasses.field(default=default, kw_only=kw_only, metadata={"about": about})


@dataclass_transform(field_specifiers=(array, dataclasses.field), frozen_default=True, eq_default=False)
def measurement(cls: type[_T]) -> type[_T]:
    """Turn a class of measured data into a frozen dataclass."""
    return dataclasses.dataclass(frozen=True, eq=False, repr=False)(cls)


def fields_in(
    frame: Any, fields: Mapping[str, Field], needed: Collection[str], units: Mapping[str, str] | None = None
) -> dict[str, np.ndarray]:
    """Return a dict of field name -> values in SI, read from the columns of a frame.

    Columns that belong to no field are ignored.

    Parameters
    ----------
    frame : pandas.DataFrame, or a mapping of title to numbers
        A title is a name of a column in files (`fitting.data.files`: v, mu, T, ...), a name that instruments
        and other programs use (`rubberfric.io.known_name`: velocity, E', Temperature (°C), ...), or
        "name [unit]".
    fields : fields of the kind of data, by name
    needed : fields that must be present
    units : units of columns whose titles state no unit, such as {"v": "mm/s"}; the default is SI

    Raises
    ------
    ValueError
        A column is missing, occurs twice, or does not hold numbers. A unit is unknown. A key of `units` is
        not the title of a column that is read. The message is one line.
    """
    units = _checked_units(frame, units)
    wanted = {about.column: name for name, about in fields.items()}
    found: dict[str, np.ndarray] = {}
    for title in frame:
        if not isinstance(title, str):
            continue
        name, unit = known_name(title)
        column = None if name is None else COLUMNS.get(name)
        if name is None or column is None or column.name not in wanted:
            continue
        given = units.pop(title, units.pop(name, None))
        if given is not None and unit is not None and known_unit(given, name) != known_unit(unit, name):
            raise ValueError(
                f"column {shown(title)}: unit {shown(given)} contradicts the title; must be equal"
            )
        unit = unit if given is None else given
        unit = next(iter(column.units)) if unit is None else known_unit(unit, name)
        if unit not in column.units:
            raise ValueError(f"column {title!r}: unit {shown(unit)}: {closest(unit, tuple(column.units))}")
        field = wanted[column.name]
        if field in found:
            raise ValueError(f"column {title!r}: {column.name} is given twice")
        found[field] = np.array([column.value(value, unit) for value in _numbers(title, frame[title])])
    if units:
        raise ValueError(f"units: {next(iter(units))!r} is not a column that is read")
    for field in needed:
        if field not in found:
            titles = listed([str(title) for title in frame])
            raise ValueError(
                f"the frame has no column {fields[field].column} [{fields[field].unit}]; it has the columns"
                f" {titles}. Rename a column, or give {field}="
            )
    return found


def _checked_units(frame, units) -> dict[str, str]:
    """Return `units` as a dict, or raise ValueError if the frame or the units are no mappings."""
    if not hasattr(frame, "keys") or not hasattr(frame, "__getitem__"):
        kind = type(frame).__name__
        raise ValueError(f"frame must be a data frame, or a mapping of title -> numbers, got a {kind}")
    units = {} if units is None else units
    if not isinstance(units, Mapping) or not all(isinstance(unit, str) for unit in units.values()):
        raise ValueError(f"units = {shown(units)}: must be a mapping of title -> unit, or None")
    return dict(units)


def _numbers(title, values):
    try:
        return [float(value) for value in np.asarray(values)]
    except (TypeError, ValueError):
        raise ValueError(f"column {title!r}: must be numbers") from None
