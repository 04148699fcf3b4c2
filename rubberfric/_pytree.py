"""Physical objects as frozen dataclasses that jit, grad and vmap can rebuild.

`jax.tree_util.register_dataclass` rebuilds objects through their constructor, so
checks made there would reject gradients (a negative "modulus") and vmap's axis
markers. Here the constructor checks and converts; rebuilding goes past it.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

# Rules for leaf values: (text for the error message, test on a NumPy array).
POSITIVE = ("must be > 0", lambda x: x > 0)
NONNEGATIVE = ("must be >= 0", lambda x: x >= 0)
FINITE = ("must be finite", lambda x: np.isfinite(x))


def between(low, high):
    """Rule: low <= value <= high."""
    return (f"must be between {low} and {high}", lambda x: (x >= low) & (x <= high))


def leaf(rule=FINITE, ndim=0, optional=False, **options):
    """Field that gradients go through: a float scalar, vector or matrix (ndim); None if optional."""
    return dataclasses.field(metadata={"rule": rule, "ndim": ndim, "optional": optional}, **options)


def static(choices=None, **options):
    """Field that is part of the structure: changing it retraces."""
    return dataclasses.field(metadata={"static": True, "choices": choices}, **options)


def child(kinds, optional=True, hint="", **options):
    """Field that holds another physical object: one of `kinds` (names, resolved late)."""
    return dataclasses.field(metadata={"child": kinds, "optional": optional, "hint": hint}, **options)


def is_concrete(value):
    """False for tracers: their values are not known while tracing."""
    return not isinstance(value, jax.core.Tracer)


def _shown(value):
    """How a wrong value is shown: a number as a number, anything else cut to a line."""
    value = value.item() if isinstance(value, np.generic) else value
    text = " ".join(repr(value).split())  # a matrix has lines
    return text if len(text) <= 60 else text[:57] + "..."


def check_values(name, value, rule):
    """Raise ValueError naming the first element of a concrete value that breaks the rule."""
    if not is_concrete(value):
        return
    array = np.asarray(value)
    text, test = rule
    with np.errstate(invalid="ignore"):
        good = np.isfinite(array) & test(array)
    if not good.all():
        where = np.unravel_index(np.argmin(good), good.shape)
        index = "".join(f"[{i}]" for i in where)
        if not np.isfinite(array[where]) and text != FINITE[0]:
            text = f"must be finite, and {text}"
        raise ValueError(f"{name}{index} = {_shown(array[where])}: {text}")


def as_leaf(name, value, ndim):
    """A float array of the wanted rank; Python scalars stay weakly typed floats.

    Weak typing lets a float32 scene keep float32 although its Poisson ratio was
    left at the Python default 0.5 and x64 is on.
    """
    if isinstance(value, bool | str | bytes) or value is None:
        kind = "a number" if ndim == 0 else "a sequence of numbers"
        raise ValueError(f"{name} = {_shown(value)}: must be {kind}")
    if isinstance(value, int | float) and ndim == 0:
        try:
            return float(value)
        except OverflowError:
            raise ValueError(f"{name} = {_shown(value)}: must be within floating-point range") from None
    try:
        array = value if isinstance(value, jax.Array) else np.asarray(value)
        if not jnp.issubdtype(array.dtype, jnp.floating):
            if not jnp.issubdtype(array.dtype, jnp.integer):
                raise TypeError
            array = array.astype(float)
    except (TypeError, ValueError):
        kind = "a real number" if ndim == 0 else "a sequence of real numbers"
        raise ValueError(f"{name} = {_shown(value)}: must be {kind}") from None
    if array.ndim != ndim:
        kind = ("a scalar", "one-dimensional", "two-dimensional")[ndim]
        raise ValueError(f"{name} has shape {array.shape}: must be {kind}")
    return jnp.asarray(array)


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
                    raise ValueError(f"{name} = {_shown(value)}: must be one of {allowed}")
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
        from rubberfric._html import object_html

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
        raise ValueError(f"{name} = {_shown(value)}: must be {allowed}{meta['hint']}")


def check_lengths(owner, **vectors):
    """Raise ValueError unless all vectors of one object have the same length."""
    lengths = {name: vector.shape[0] for name, vector in vectors.items()}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{name} has {n}" for name, n in lengths.items())
        raise ValueError(f"{owner}: lengths differ ({shown}); they must be equal")


def check_increasing(name, vector):
    """Raise ValueError unless a concrete vector increases strictly."""
    if is_concrete(vector):
        array = np.asarray(vector)
        bad = np.flatnonzero(~(np.diff(array) > 0))
        if bad.size:
            i = int(bad[0]) + 1
            raise ValueError(
                f"{name}[{i}] = {_shown(array[i])} after {_shown(array[i - 1])}: must increase strictly"
            )
