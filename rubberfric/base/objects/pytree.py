"""Physical objects as JAX pytrees, and their comparison by value.

The attribute of a number that was given as a Python float stays a Python float. The leaves of the pytree are
JAX arrays: equinox differentiates and traces only arrays, and treats Python numbers as constants. The arrays
are weakly typed as Python numbers are, so a float32 scene with the default Poisson's ratio stays float32.
"""

from collections.abc import Sequence
from typing import Any, TypeVar

import jax
import numpy as np

from rubberfric.base.checks import is_concrete

_T = TypeVar("_T")

# Attribute with the leaves of an object that has Python floats, because converting a float takes 30 us.
_KEPT = "_kept_leaves"


def register(cls: type, nodes: Sequence[str], static: Sequence[str]) -> None:
    """Register a class as a pytree that JAX rebuilds without the constructor.

    Parameters
    ----------
    cls : the class
    nodes : names of the attributes that are pytrees, in order
    static : names of the attributes that are part of the structure
    """
    nodes, static = tuple(nodes), tuple(static)
    keys = tuple(map(jax.tree_util.GetAttrKey, nodes))

    def structure(self):
        return tuple(getattr(self, name) for name in static)

    def flatten(self):
        return _leaves(self, nodes), structure(self)

    def flatten_with_keys(self):
        return tuple(zip(keys, _leaves(self, nodes), strict=True)), structure(self)

    def unflatten(static_values, values):
        self = object.__new__(cls)
        for name, value in zip(static + nodes, tuple(static_values) + tuple(values), strict=True):
            object.__setattr__(self, name, value)
        return self

    jax.tree_util.register_pytree_with_keys(cls, flatten_with_keys, unflatten, flatten)


def _leaves(self, names):
    """Return the attributes of an object, with JAX arrays in place of Python floats."""
    values = tuple(getattr(self, name) for name in names)
    if not any(type(value) is float for value in values):
        return values
    x64 = jax.config.jax_enable_x64  # pyright: ignore[reportAttributeAccessIssue] (defined at run time)
    kept = self.__dict__.get(_KEPT)
    if kept is None or kept[0] != x64:
        # Within jit the arrays would be tracers otherwise, which must not be kept.
        with jax.ensure_compile_time_eval():
            # `jnp.asarray` would compile.
            arrays = tuple(jax.device_put(x) if type(x) is float else x for x in values)
        kept = x64, arrays
        object.__setattr__(self, _KEPT, kept)
    return kept[1]


def equal(first: object, other: object) -> bool:
    """Return True if two objects have equal structures, and leaves with equal dtypes and numbers.

    Traced leaves are equal only if they are the same tracer.
    """
    (left, tree), (right, other_tree) = jax.tree.flatten(first), jax.tree.flatten(other)
    return tree == other_tree and all(map(_equal_leaves, left, right))


def hash_of(value: object) -> int:
    """Return a hash that is equal for objects that are `equal`."""
    leaves, tree = jax.tree.flatten(value)
    return hash((tree, *map(_hashable, leaves)))


def _equal_leaves(first, other):
    return first is other or (
        _has_numbers(first) and _has_numbers(other) and _hashable(first) == _hashable(other)
    )


def _has_numbers(leaf):
    return is_concrete(leaf) and isinstance(leaf, jax.Array | np.ndarray | np.generic | float | int)


def _hashable(leaf: Any):
    if not _has_numbers(leaf):
        return id(leaf)
    array = np.asarray(leaf)
    weak = isinstance(leaf, float | int) or (isinstance(leaf, jax.Array) and leaf.weak_type)
    # The sum turns -0 into 0, which are equal numbers with different bytes.
    return weak, array.dtype.str, array.shape, (array + array.dtype.type(0)).tobytes()
