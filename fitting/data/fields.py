"""Fields of measured data: their columns in tables, their units, and their rules."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, dataclass_transform

import numpy as np

from rubberfric.base import FINITE, ArrayLike, check_unmasked, shown

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
    check_unmasked(name, value)
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "fiu":
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
