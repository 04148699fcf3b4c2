"""A tree of arrays linearised once: what of it moves with a few parameters, and with which."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

# Numbers of an array of which it costs nothing to derive them by parameters that do not move them.
_SMALL = 100


class Linearised(NamedTuple):
    """A tree of arrays, and of what is none, that depends on x, and its derivatives."""

    moving: list[jax.Array]  # leaves that depend on x
    parameters: list[frozenset[int]]  # on which elements of x each of them may depend
    tree: Callable[[list[jax.Array]], Any]  # the tree with others in their place
    push: Callable[[jax.Array], list[jax.Array]]  # their derivatives along a direction in x
    size: int  # of x

    def tangents(self, columns: Sequence[int] | None = None) -> list[jax.Array]:
        """Derivatives of the leaves by elements of x, these first; by all of them where none are given."""
        seeds = np.eye(self.size, dtype=self.moving[0].dtype if self.moving else None)
        return jax.vmap(self.push)(jnp.asarray(seeds if columns is None else seeds[np.asarray(columns)]))

    def groups(self) -> list[tuple[list[int], list[int]]]:
        """Leaves that are best derived together, and the elements of x that move any of them.

        The meshes of a scene are nearly all of its numbers, and few parameters move them.
        """
        groups = []
        for i, (leaf, own) in enumerate(zip(self.moving, self.parameters, strict=True)):
            small = leaf.size < _SMALL
            together = [g for g in groups if g[0] == small and (small or g[2] & own)]
            which = sorted(sum((g[1] for g in together), [i]))
            groups = [g for g in groups if g not in together]
            groups.append((small, which, own.union(*(g[2] for g in together))))
        return [(which, sorted(columns)) for _, which, columns in groups]


def linearised(function: Callable[[jax.Array], Any], x: jax.Array) -> Linearised:
    """`Linearised` of a function of x."""
    shape = {}  # of the tree, and its leaves that are no arrays

    def leaves(x):
        """Arrays, reals and integers; what is no array stays behind in `shape`."""
        leaves, shape["tree"] = jax.tree_util.tree_flatten(function(x))
        shape["kind"] = [_kind(leaf) for leaf in leaves]
        shape["objects"] = [leaf for leaf in leaves if _kind(leaf) == "object"]
        return (
            [leaf for leaf in leaves if _kind(leaf) == "real"],
            [leaf for leaf in leaves if _kind(leaf) == "integer"],
        )

    arrays, push, integers = jax.linearize(leaves, x, has_aux=True)
    parameters = _parameters(lambda x: leaves(x)[0], x)

    def tree(moving):
        moving = iter(moving)
        parts = {
            "real": iter([next(moving) if own else a for a, own in zip(arrays, parameters, strict=True)]),
            "integer": iter(integers),
            "object": iter(shape["objects"]),
        }
        return jax.tree_util.tree_unflatten(shape["tree"], [next(parts[kind]) for kind in shape["kind"]])

    def chosen(values):
        return [a for a, own in zip(values, parameters, strict=True) if own]

    return Linearised(
        chosen(arrays), chosen(parameters), tree, lambda direction: chosen(push(direction)), x.size
    )


def _kind(leaf):
    if not isinstance(leaf, jax.Array):
        return "object"
    return "real" if _is_real(leaf) else "integer"


def _is_real(array):
    return jnp.issubdtype(array.dtype, jnp.floating)


def _parameters(function, x):
    """On which elements of x each of the arrays that a function returns may depend, frozensets.

    An operation on several arrays is taken to mix all that they depend on. A piece of x is the elements that
    it was sliced from.
    """
    jaxpr = jax.make_jaxpr(function)(x).jaxpr
    (whole,) = jaxpr.invars
    found = {whole: frozenset(range(x.size))}

    def of(variables):
        known = [found.get(v, frozenset()) for v in variables if not hasattr(v, "val")]
        return frozenset().union(*known)

    for equation in jaxpr.eqns:
        own = of(equation.invars)
        if equation.primitive.name == "slice" and equation.invars[0] is whole:
            first, last, steps = (
                equation.params[name] for name in ("start_indices", "limit_indices", "strides")
            )
            own = frozenset(range(first[0], last[0], steps[0] if steps else 1))
        elif equation.primitive.name == "stop_gradient":
            own = frozenset()
        for variable in equation.outvars:
            found[variable] = own if _is_real(variable.aval) else frozenset()
    return [of([variable]) for variable in jaxpr.outvars]
