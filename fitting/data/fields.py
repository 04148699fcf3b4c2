"""Fields of measured data: their column in tables, their unit, and which values they may hold."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import ArrayLike

from rubberfric.base import FINITE, shown

Rule = tuple[str, Callable[[np.ndarray], np.ndarray]]
T = TypeVar("T")


def likely(text: str, test: Callable[[np.ndarray], np.ndarray]) -> Rule:
    """Rule that only a wrong unit, or noise, would break."""
    return (f"{text} (check_units=False accepts it)", test)


class Field(NamedTuple):
    """What a field of measured data is."""

    column: str  # its name in tables
    unit: str
    rule: Rule = FINITE  # always
    plausible: tuple[Rule, ...] = ()  # unless check_units=False


def numbers(value: ArrayLike) -> np.ndarray:
    """A float64 array of real numbers.

    ValueError if it is anything else, or empty; a text that follows the name of the value.
    """
    try:
        array = np.asarray(value)
        # a mask would be lost without a word
        if array.dtype.kind not in "fiu" or np.ma.is_masked(value):
            raise TypeError
        array = array.astype(float)
    except (TypeError, ValueError):
        raise ValueError(f" = {shown(value)}: must be real numbers") from None
    if array.size == 0:
        raise ValueError(" is empty: must have at least one value")
    return array


class Numbers:
    """Annotation of a field: an array that must be given.

    To a type checker it is what the constructor takes (`__set__`) and what the data have (`__get__`).
    """

    def __get__(self, instance: object, owner: type) -> np.ndarray: ...
    def __set__(self, instance: object, value: ArrayLike) -> None: ...


class OptionalNumbers:
    """Annotation of a field: an array, or None."""

    def __get__(self, instance: object, owner: type) -> np.ndarray | None: ...
    def __set__(self, instance: object, value: ArrayLike | None) -> None: ...


def array(about: Field, *, default: Any = dataclasses.MISSING, kw_only: bool = False) -> Any:
    """Field of a `measurement` that is annotated as Numbers or OptionalNumbers.

    Parameters
    ----------
    about : its column, unit and rules
    default, kw_only : as of `dataclasses.field`
    """
    return dataclasses.field(default=default, kw_only=kw_only, metadata={"about": about})


@dataclass_transform(field_specifiers=(array, dataclasses.field), frozen_default=True, eq_default=False)
def measurement(cls: type[T]) -> type[T]:
    """Class decorator of the kinds of measured data: a frozen dataclass."""
    return dataclasses.dataclass(frozen=True, eq=False, repr=False)(cls)
