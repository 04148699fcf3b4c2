"""Physical objects as frozen dataclasses that jit, grad and vmap can rebuild.

`jax.tree_util.register_dataclass` rebuilds objects through their constructor, whose checks would reject
gradients (a negative "modulus") and vmap's axis markers. In this module the constructor checks and
converts values, and JAX rebuilds objects without the constructor (`rubberfric.base.objects.pytree`).

`==` is True for objects of one class with equal parts, options, dtypes and numbers. The hash agrees with it,
so objects can be keys of a dict and static arguments of `jax.jit`.
"""

import dataclasses
import re
import types
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, Self, TypeVar, dataclass_transform

import numpy as np

from rubberfric.base.checks import closest, either, is_concrete, shown
from rubberfric.base.objects.fields import (
    Child,
    Leaf,
    Meaning,
    Static,
    checked,
    child,
    leaf,
    meaning_of,
    setting,
    static,
)
from rubberfric.base.objects.html import short, table, with_unit
from rubberfric.base.objects.key_paths import parse_key_path, with_elements
from rubberfric.base.objects.pytree import equal, hash_of, register

_NOT_GIVEN: Any = object()


class PhysicalObject:
    """Base class of the parts of scenes.

    The decorator `physical` makes the subclasses frozen dataclasses and JAX pytrees.
    """

    # Keys of a scene file that replace a field; the class method from_KEY accepts them.
    alternatives: ClassVar[Mapping[str, str]] = {}
    # Chains of names whose numbers must not decrease: ("q0", "qr", "q1"). The name of a vector stands for
    # all of its elements, "q[0]" for one. Fields that are None are left out.
    rising: ClassVar[Sequence[Sequence[str]]] = ()

    _meanings: ClassVar[Mapping[str, Meaning]] = {}
    _settings: ClassVar[Sequence[str]] = ()

    def __post_init__(self) -> None:
        _check_class(type(self))
        for name, field in fields_of(type(self)).items():
            where, value = f"{type(self).__name__}.{name}", getattr(self, name)
            if isinstance(field, Child):
                if isinstance(value, str) and value in field.names:
                    value = next(kind() for kind in kinds(field.role).values() if kind.file_kind == value)
                    object.__setattr__(self, name, value)
                _check_child(where, value, field)
            else:
                object.__setattr__(self, name, checked(where, value, field))
        self._check()
        for chain in rising_of(self):
            _check_rising(self, [part for part in chain if is_concrete(getattr(self, part[0]))])

    def _check(self) -> None:
        """Raise ValueError if fields are incompatible.

        Subclasses override this method. The constructor calls it after it has checked each field.
        """

    def doubts(self) -> list[str]:
        """Return warnings about implausible combinations of numbers."""
        return []

    def replace(
        self, paths: str | Mapping[str, Any] | None = None, value: Any = _NOT_GIVEN, /, **fields: Any
    ) -> Self:
        """Return a copy with new values, which are checked as in the constructor.

        The new values may be traced.

        ::

            scene.replace(gamma=0.4)
            scene.replace("lower.spectrum.hurst", 0.7)
            scene.replace({"lower.spectrum.q0": 1e3, "upper.material.E[3]": 2e6}, gamma=0.4)

        Parameters
        ----------
        paths : a key path, or a dict from key paths to values
            A path to elements of an array, such as "E[3]" or "E[1:3]", takes one number, or one number for
            each element. All values are changed before the checks.
        value : value for a single key path
        fields : values of fields of this object

        Raises
        ------
        ValueError : a path is unknown, or a constructor refuses a value. The message names the path.
        """
        if isinstance(paths, str) != (value is not _NOT_GIVEN):
            raise TypeError(
                "replace takes a key path and its value, or key paths with their values as a dict"
            )
        by_path = {paths: value} if isinstance(paths, str) else dict(paths or {})
        changes = [(parse_key_path(path), new) for path, new in (by_path | fields).items()]
        return _replaced(self, "", [(path, path.names, new) for path, new in changes])

    def __eq__(self, other: object) -> bool:
        return self is other or (equal(self, other) if type(self) is type(other) else NotImplemented)

    def __hash__(self) -> int:
        return hash_of(self)

    def _repr_html_(self) -> str:
        return object_html(self)


class Kind(PhysicalObject):
    """Base class of objects that can be of several kinds, such as materials and spectra.

    A subclass without fields, such as `Material` or `Spectrum`, is a role and defines the methods. The
    subclasses of a role are its kinds.
    """

    # Name in scene files; by default PronyShear is "prony_shear".
    file_kind: ClassVar[str]

    def __init_subclass__(cls, **options: Any):
        super().__init_subclass__(**options)
        if "file_kind" not in cls.__dict__:
            cls.file_kind = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", cls.__name__).lower()

    def padded(self) -> Self:
        """Return an equivalent object whose table is padded to a standard length.

        The added entries do not change results. Objects whose tables have the same length share compiled
        functions. Derivatives with respect to the entries may be lost, so use this method only for constant
        tables.
        """
        return self


def object_html(value: PhysicalObject) -> str:
    """Return an HTML table with the key path and value of every number of an object."""
    return table(_rows(value, ""), ("key path", "value"), type(value).__name__)


def _rows(value, path):
    rows = []
    for name in fields_of(type(value)):
        content, here = getattr(value, name), path + name
        if isinstance(content, PhysicalObject):
            rows += [(here, type(content).__name__), *_rows(content, f"{here}.")]
        elif content is not None:
            rows.append((here, with_unit(short(content), unit_of(type(value), name))))
    return rows


# All classes made by `physical`, by name.
_CLASSES: dict[str, type[PhysicalObject]] = {}

_T = TypeVar("_T", bound=PhysicalObject)


def kinds(role: type[_T]) -> dict[str, type[_T]]:
    """Return a dict from name to class of all classes of a role, in the order of their definition."""
    return {name: cls for name, cls in _CLASSES.items() if issubclass(cls, role)}


def forget(cls: type[PhysicalObject]) -> None:
    """Remove a class from the classes that `kinds` returns."""
    if _CLASSES.get(cls.__name__) is cls:
        del _CLASSES[cls.__name__]


def check_kind(name: str, value: object, role: type[PhysicalObject], without: Sequence[type] = ()) -> None:
    """Raise ValueError unless a value is an object of a role, and not of one of the classes `without`."""
    if not isinstance(value, role) or isinstance(value, tuple(without)):
        allowed = [kind for kind, cls in kinds(role).items() if cls not in without]
        raise ValueError(f"{name} is a {type(value).__name__}: must be {either(allowed)}")


def fields_of(cls: type[PhysicalObject]) -> Mapping[str, Meaning]:
    """Return a mapping from name to description of the fields of a physical class, in order."""
    return cls._meanings


def leaves_of(cls: type[PhysicalObject]) -> dict[str, Leaf]:
    """Return a dict from name to description of the fields that hold numbers."""
    return {name: field for name, field in fields_of(cls).items() if isinstance(field, Leaf)}


def parts_of(part: PhysicalObject, path: str = "") -> Iterator[tuple[str, PhysicalObject]]:
    """Yield (key path, object) for an object and for all objects inside it.

    `path` is the key path of the outer object.
    """
    yield path, part
    for name in fields_of(type(part)):
        value = getattr(part, name)
        if isinstance(value, PhysicalObject):
            yield from parts_of(value, f"{path}.{name}" if path else name)


def is_known(part: PhysicalObject) -> bool:
    """Return True if no number of an object is traced."""
    return all(
        is_concrete(getattr(inner, name)) for _, inner in parts_of(part) for name in leaves_of(type(inner))
    )


def rising_of(part: PhysicalObject) -> list[list[tuple[str, tuple[int, ...] | None]]]:
    """Return the chains of `rising`, each as a list of (field name, element indices).

    The indices are None if the field is a single number. Fields that are None are left out.
    """
    chains = [[parse_key_path(text) for text in chain] for chain in type(part).rising]
    return [
        [
            (path.name, path.elements(np.shape(getattr(part, path.name))))
            for path in chain
            if getattr(part, path.name) is not None
        ]
        for chain in chains
    ]


def unit_of(cls: type[PhysicalObject], name: str) -> str:
    """Return the unit of the numbers in a field.

    The unit is "-" for numbers without a unit, and "" if the field holds no numbers.
    """
    field = fields_of(cls)[name]
    return field.unit if isinstance(field, Leaf) else ""


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(leaf, static, setting, child))
def physical(cls: type[_T]) -> type[_T]:
    """Make a class a frozen dataclass and a JAX pytree, as a class decorator.

    The constructor of the class checks the fields.

    Raises
    ------
    TypeError : another class has the same name, or the annotation of a field is invalid.
    """
    known = _CLASSES.get(cls.__name__)
    if known is not None and (known.__module__, known.__qualname__) != (cls.__module__, cls.__qualname__):
        raise TypeError(f"{cls.__name__}: {known.__module__} has a class of that name; choose another name")
    # eq=False, because comparing arrays gives no single truth value; `PhysicalObject` compares by value.
    cls = dataclasses.dataclass(frozen=True, eq=False)(cls)
    fields = dataclasses.fields(cls)  # pyright: ignore[reportArgumentType] (it is a dataclass now)
    cls._settings = tuple(field.name for field in fields if "setting" in field.metadata)
    meanings = {field.name: meaning_of(cls, field) for field in fields if field.name not in cls._settings}
    cls._meanings = types.MappingProxyType(meanings)
    static_names = tuple(name for name, field in meanings.items() if isinstance(field, Static))
    register(cls, tuple(name for name in meanings if name not in static_names), static_names + cls._settings)
    _CLASSES[cls.__name__] = cls
    return cls


def _check_class(cls):
    """Raise ValueError unless a class itself has the decorator, without which it is no pytree."""
    if "_meanings" not in cls.__dict__:
        base = next(known.__name__ for known in cls.__mro__ if "_meanings" in known.__dict__)
        raise ValueError(
            f"{cls.__name__} is a subclass of {base} without a decorator: write @rubberfric.base.physical "
            "above the class"
        )


def _check_child(where, value, field):
    if not isinstance(value, field.role) and not (value is None and field.optional):
        names = [repr(name) for name in field.names]
        allowed = " or ".join([", ".join([*names, *kinds(field.role)])] + ["None"] * field.optional)
        raise ValueError(f"{where} = {shown(value)}: must be {allowed}{field.hint}")


def _check_rising(owner, chain):
    if not chain:
        return
    fields = [np.atleast_1d(np.asarray(getattr(owner, name))) for name, _ in chain]
    # In the lowest of their precisions, because the end of a float32 table is rounded.
    kind = min((field.dtype for field in fields), key=lambda kind: kind.itemsize)
    values = np.concatenate(
        [field[list(chosen or (0,))].astype(kind) for field, (_, chosen) in zip(fields, chain, strict=True)]
    )
    falls = np.flatnonzero(np.diff(values) < 0)
    if falls.size:
        names = [name if i is None else f"{name}[{i}]" for name, chosen in chain for i in chosen or (None,)]
        k = int(falls[0])
        high, low = (f"{names[i]} = {shown(values[i])}" for i in (k + 1, k))
        raise ValueError(f"{type(owner).__name__}.{high}: must be >= {low}")


def _replaced(owner, where, changes):
    """Return a copy of `owner` with new values.

    `where` is the key path of `owner`. `changes` is a list of tuples (key path, field names below `owner`,
    new value).
    """
    values = {name: getattr(owner, name) for name in (*fields_of(type(owner)), *owner._settings)}
    by_field: dict[str, list] = {}
    for path, steps, new in changes:
        if steps[0] not in values:
            advice = closest(steps[0], tuple(values))
            raise ValueError(f"{path.text!r}: {type(owner).__name__} has no {steps[0]!r}; {advice}")
        by_field.setdefault(steps[0], []).append((path, steps[1:], new))
    for name, group in by_field.items():
        whole = [path for path, steps, _ in group if not steps and path.index is None]
        if whole and len(group) > 1:
            raise ValueError(f"{whole[0].text!r}: must not be given together with a path inside it")
        deeper = []
        for path, steps, new in group:
            if not steps:
                values[name] = new if path.index is None else with_elements(path, values[name], new)
            elif isinstance(values[name], PhysicalObject):
                deeper.append((path, steps, new))
            else:
                here = ".".join(path.names[: len(path.names) - len(steps)])
                raise ValueError(f"{path.text!r}: {here} = {shown(values[name])}: must be an object")
        if deeper:
            values[name] = _replaced(values[name], f"{where}.{name}" if where else name, deeper)
    try:
        return type(owner)(**values)
    except ValueError as error:
        raise ValueError(f"{where}: {error}" if where else str(error)) from None
