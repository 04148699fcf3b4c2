"""Fields of physical objects, with the information that files, tables and errors need.

::

    @physical
    class Prony(Material):
        E_inf: Number = leaf(NONNEGATIVE, unit="Pa")
        E: Vector = leaf(NONNEGATIVE, unit="Pa")
        shift: Shift | None = child(default=None)

The annotation gives the number of dimensions, the values of an option, or the class of an object. `leaf`,
`static` and `child` give the other properties of a field.
"""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias, get_args, get_origin, get_type_hints

import jax
import numpy as np

from rubberfric.base.checks import FINITE, NumberLike, Rule, as_leaf, check_values, shown

if TYPE_CHECKING:
    from rubberfric.base.checks import HasArray


class Number:
    """Annotation of a field that holds one number.

    Type checkers see the type that the constructor accepts (`__set__`) and the type of the attribute
    (`__get__`). A Python number stays weakly typed.
    """

    ndim: ClassVar[int] = 0

    def __get__(self, instance: object, owner: type) -> jax.Array: ...
    def __set__(self, instance: object, value: NumberLike) -> None: ...


class OptionalNumber:
    """Annotation of a field that holds one number or None."""

    ndim: ClassVar[int] = 0

    def __get__(self, instance: object, owner: type) -> jax.Array | None: ...
    def __set__(self, instance: object, value: NumberLike | None) -> None: ...


class Vector:
    """Annotation of a field that holds an array of one dimension.

    The constructor also accepts a list of numbers.
    """

    ndim: ClassVar[int] = 1

    def __get__(self, instance: object, owner: type) -> jax.Array: ...
    def __set__(self, instance: object, value: "HasArray | Sequence[NumberLike]") -> None: ...


class Matrix:
    """Annotation of a field that holds an array of two dimensions.

    The constructor also accepts a list of lists of numbers.
    """

    ndim: ClassVar[int] = 2

    def __get__(self, instance: object, owner: type) -> jax.Array: ...
    def __set__(self, instance: object, value: "HasArray | Sequence[Sequence[NumberLike]]") -> None: ...


@dataclasses.dataclass(frozen=True)
class Leaf:
    """Description of a field that holds numbers, with respect to which JAX can differentiate."""

    rule: Rule
    unit: str  # "-" without one
    plausible: tuple[float, float] | None
    plus: str | None
    column: str | None
    over: str | None
    ndim: int = 0
    optional: bool = False


@dataclasses.dataclass(frozen=True)
class Static:
    """Description of a field that is part of the structure of an object.

    If the value of the field changes, jitted functions are traced again.
    """

    choices: tuple = ()  # if empty, any number is allowed


@dataclasses.dataclass(frozen=True)
class Child:
    """Description of a field that holds another physical object."""

    hint: str
    unnamed: str | None
    role: type = object
    optional: bool = False
    names: tuple[str, ...] = ()  # kinds without fields, whose name the constructor accepts


Meaning: TypeAlias = Leaf | Static | Child


def leaf(
    rule: Rule = FINITE,
    *,
    unit: str,
    plausible: tuple[float, float] | None = None,
    plus: str | None = None,
    column: str | None = None,
    over: str | None = None,
    default: Any = dataclasses.MISSING,
) -> Any:
    """Return a field of numbers, which is annotated as Number, OptionalNumber, Vector or Matrix.

    Parameters
    ----------
    rule : condition on every element
    unit : SI unit, "-" without one
    plausible : lowest and highest plausible magnitude. A number outside is probably in another unit.
    plus : field whose elements are added before the comparison with `plausible`
    column : column of the CSV file from which the field is read
    over : name of the field with the abscissae of a vector, such as "tau" for E over tau
    default : as in a dataclass
    """
    return _field(Leaf(rule, unit, plausible, plus, column, over), default)


def static(*, default: Any = dataclasses.MISSING) -> Any:
    """Return a static field.

    The annotation Literal or bool allows a few values. The annotation float allows any number.
    """
    return _field(Static(), default)


def setting(*, default: Any) -> Any:
    """Return a static field that controls how a scene is computed, and that scene files do not contain."""
    return dataclasses.field(default=default, metadata={"setting": True})


def child(*, hint: str = "", unnamed: str | None = None, default: Any = dataclasses.MISSING) -> Any:
    """Return a field that holds an object of the annotated class or a subclass.

    The annotation "| None" also allows None. The annotation "| Literal[...]" allows the names of kinds that
    have no fields, and the constructor makes these objects.

    Parameters
    ----------
    hint : end of the error message for an object of another class
    unnamed : kind of the object if its table in a scene file has no key `kind`
    default : as in a dataclass
    """
    return _field(Child(hint, unnamed), default)


def _field(meaning, default):
    return dataclasses.field(default=default, metadata={"meaning": meaning})


def meaning_of(cls: type, field: dataclasses.Field) -> Meaning:
    """Return the description of a field, completed with the information in the annotation."""
    meaning, annotation = field.metadata.get("meaning"), field.type
    if isinstance(annotation, str):
        annotation = get_type_hints(cls)[field.name]
    members = [x for x in get_args(annotation) or (annotation,) if x is not type(None)]
    if isinstance(meaning, Leaf) and annotation in (Number, OptionalNumber, Vector, Matrix):
        optional = annotation is OptionalNumber
        return dataclasses.replace(meaning, ndim=annotation.ndim, optional=optional)
    if isinstance(meaning, Static) and (annotation is bool or get_origin(annotation) is Literal):
        return Static((False, True) if annotation is bool else tuple(members))
    if isinstance(meaning, Static) and annotation is float:
        return meaning
    if isinstance(meaning, Child):
        names = tuple(name for x in members if get_origin(x) is Literal for name in get_args(x))
        members = [x for x in members if get_origin(x) is not Literal]
        if len(members) == 1 and isinstance(members[0], type):
            optional = type(None) in get_args(annotation)
            return dataclasses.replace(meaning, role=members[0], optional=optional, names=names)
    raise TypeError(
        f"{cls.__name__}.{field.name}: annotated {annotation}: must be Number, OptionalNumber, Vector or "
        "Matrix with leaf(), a Literal, bool or float with static(), a PhysicalObject with child()"
    )


def checked(where: str, value: Any, field: Meaning) -> Any:
    """Check and convert the value of a field; the message of a ValueError begins with `where`."""
    if isinstance(field, Leaf):
        if value is None and field.optional:
            return None
        value = as_leaf(where, value, field.ndim)
        check_values(where, value, field.rule)
    elif isinstance(field, Static) and not field.choices:
        if isinstance(value, bool) or not isinstance(value, int | float | np.floating):
            raise ValueError(f"{where} = {shown(value)}: must be a number")
        value = float(value)
    elif isinstance(field, Static):
        value = value.item() if isinstance(value, np.generic) else value
        # 1 == True, but a static field keeps the type it was declared with.
        if not any(type(value) is type(c) and value == c for c in field.choices):
            raise ValueError(
                f"{where} = {shown(value)}: must be one of {', '.join(map(repr, field.choices))}"
            )
    return value
