"""Physical objects as frozen dataclasses that jit, grad and vmap can rebuild.

`jax.tree_util.register_dataclass` rebuilds objects through their constructor, so
checks made there would reject gradients (a negative "modulus") and vmap's axis
markers. Here the constructor checks and converts; rebuilding goes past it.
"""

import dataclasses

import jax

from rubberfric.base.checks import FINITE, as_leaf, check_values, shown


def leaf(rule=FINITE, ndim=0, optional=False, **options):
    """Field that gradients go through: a float scalar, vector or matrix (ndim); None if optional."""
    return dataclasses.field(metadata={"rule": rule, "ndim": ndim, "optional": optional}, **options)


def static(choices=None, **options):
    """Field that is part of the structure: changing it retraces."""
    return dataclasses.field(metadata={"static": True, "choices": choices}, **options)


def child(kinds, optional=True, hint="", **options):
    """Field that holds another physical object: one of `kinds` (names, resolved late)."""
    return dataclasses.field(metadata={"child": kinds, "optional": optional, "hint": hint}, **options)


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

    def _repr_html_(self):
        """A table for notebooks."""
        from rubberfric.base.html import object_html

        return object_html(self)

    cls.__post_init__, cls._repr_html_ = __post_init__, _repr_html_
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
    return cls


def _check_child(name, value, meta):
    if value is None and meta["optional"]:
        return
    kinds = meta["child"]
    if type(value).__name__ not in kinds:
        allowed = " or ".join([", ".join(kinds)] * bool(kinds) + ["None"] * meta["optional"])
        raise ValueError(f"{name} = {shown(value)}: must be {allowed}{meta['hint']}")
