"""Physical objects as frozen dataclasses that jit, grad and vmap can rebuild.

`jax.tree_util.register_dataclass` rebuilds objects through their constructor, so
checks made there would reject gradients (a negative "modulus") and vmap's axis
markers. Here the constructor checks and converts; rebuilding goes past it.
"""

import dataclasses

import jax

from rubberfric.base.checks import FINITE, as_leaf, check_values, either, shown

# Every class that `physical` made, by its name.
_CLASSES = {}


class PhysicalObject:
    """What scenes are made of."""

    def _repr_html_(self):
        """A table for notebooks."""
        from rubberfric.base.html import object_html

        return object_html(self)


class Kind(PhysicalObject):
    """An object whose place in a scene others can take: a subclass without fields says what they answer.

    Such a subclass, `Material` or `Spectrum`, is their role; the classes under it are the kinds.
    """


def leaf(rule=FINITE, ndim=0, optional=False, **options):
    """Field that gradients go through: a float scalar, vector or matrix (ndim); None if optional."""
    return dataclasses.field(metadata={"rule": rule, "ndim": ndim, "optional": optional}, **options)


def static(choices=None, **options):
    """Field that is part of the structure: changing it retraces."""
    return dataclasses.field(metadata={"static": True, "choices": choices}, **options)


def child(role, optional=True, hint="", **options):
    """Field that holds another physical object: of the class `role` or one under it."""
    return dataclasses.field(metadata={"child": role, "optional": optional, "hint": hint}, **options)


def kinds(role):
    """The classes of a role that can be made, by name, in the order of their definition."""
    return {name: cls for name, cls in _CLASSES.items() if issubclass(cls, role)}


def check_kind(name, value, role, without=()):
    """ValueError unless a value is of a role, and none of the classes `without`."""
    if not isinstance(value, role) or isinstance(value, tuple(without)):
        allowed = [kind for kind, cls in kinds(role).items() if cls not in without]
        raise ValueError(f"{name} is a {type(value).__name__}: must be {either(allowed)}")


def physical(cls):
    """Class decorator: frozen dataclass, checked when constructed, registered as a pytree.

    A class may define `_check(self)` for rules that tie several fields together; it
    is called after the fields were converted and checked one by one.
    """

    def __post_init__(self):
        for field in dataclasses.fields(self):
            name, value = f"{cls.__name__}.{field.name}", getattr(self, field.name)
            meta = field.metadata
            if "static" in meta:
                choices = meta["choices"]
                # 1 == True, but a static field keeps the type it was declared with.
                if choices is not None and not any(type(value) is type(c) and value == c for c in choices):
                    allowed = ", ".join(repr(c) for c in choices)
                    raise ValueError(f"{name} = {shown(value)}: must be one of {allowed}")
            elif "child" in meta:
                _check_child(name, value, meta)
            elif value is not None or not meta["optional"]:
                value = as_leaf(name, value, meta["ndim"])
                check_values(name, value, meta["rule"])
                object.__setattr__(self, field.name, value)
        if hasattr(self, "_check"):
            self._check()

    cls.__post_init__ = __post_init__
    # eq=False: comparing arrays has no single truth value; identity does for hashing.
    cls = dataclasses.dataclass(frozen=True, eq=False)(cls)
    fields = dataclasses.fields(cls)
    children = tuple(f.name for f in fields if "static" not in f.metadata)
    aux = tuple(f.name for f in fields if "static" in f.metadata)

    def flatten_with_keys(self):
        keyed = tuple((jax.tree_util.GetAttrKey(n), getattr(self, n)) for n in children)
        return keyed, tuple(getattr(self, n) for n in aux)

    def flatten(self):
        return tuple(getattr(self, n) for n in children), tuple(getattr(self, n) for n in aux)

    def unflatten(aux_values, child_values):
        self = object.__new__(cls)
        for name, value in zip(aux + children, tuple(aux_values) + tuple(child_values), strict=True):
            object.__setattr__(self, name, value)
        return self

    jax.tree_util.register_pytree_with_keys(cls, flatten_with_keys, unflatten, flatten)
    _CLASSES[cls.__name__] = cls
    return cls


def _check_child(name, value, meta):
    role, optional = meta["child"], meta["optional"]
    if not isinstance(value, role) and not (value is None and optional):
        allowed = " or ".join([", ".join(kinds(role))] + ["None"] * optional)
        raise ValueError(f"{name} = {shown(value)}: must be {allowed}{meta['hint']}")
