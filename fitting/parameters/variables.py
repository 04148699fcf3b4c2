"""Free parameters: which numbers of a scene a fit may change, and how far.

A parameter is named by its key path in the scene: "gamma", "lower.spectrum.hurst",
"upper.material.E" (all elements), "upper.material.E[3]", "upper.material.E[4:]". Its rule
says which values it may take. Solvers see one vector x of unconstrained numbers, one for
each free element, in which a step of one changes a value by about its own size:

=============  ========================================  =======================
rule           value                                     x
=============  ========================================  =======================
Positive       e^x                                       ln value
Bounded        low + (high - low) / (1 + e^-x)           logit of its place
Free           scale x                                   value / scale
=============  ========================================  =======================
"""

from collections.abc import Hashable, Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from fitting.parameters.constraints import RULES, Bounded, Free, Positive, Rule, Tied
from fitting.parameters.keypaths import find, leaf_names

# A Positive element that fell by more than this factor was driven towards zero.
VANISHED = 1e6

Array = jax.Array | np.ndarray


class Group(NamedTuple):
    """Elements of one leaf of the scene that one rule frees; hashable."""

    path: str
    kind: str  # "Positive", "Bounded", "Free", "Tied"
    leaf: int  # which leaf of the scene
    elements: tuple[int, ...] | None  # which elements of it; None: a scalar leaf
    slot: tuple[int, int]  # (first, last + 1) in x; for Tied: in x of what it is tied to


class Variables(NamedTuple):
    """Structure of a set of free parameters; hashable, so that functions of it compile once."""

    tree: Hashable  # structure of the scene, as jax.tree flattens it
    groups: tuple[Group, ...]
    size: int  # number of free elements

    @property
    def own(self) -> list[Group]:
        """Groups with elements of their own in x: all but the tied ones."""
        return [group for group in self.groups if group.kind != "Tied"]


class Constants(NamedTuple):
    """Numbers that belong to a `Variables`; a pytree."""

    leaves: tuple[Array, ...]  # of the scene at the start
    low: Array  # shape (size,): lower bound, 0 without
    width: Array  # high - low; scale of a Free one; 1 for a Positive one
    ratios: tuple[Array, ...]  # of every Tied group, shape (elements,)


def free_parameters(scene: rf.Scene, free: Mapping[str, Rule]) -> tuple[Variables, Constants, np.ndarray]:
    """Variables, constants and start vector for the free parameters of a scene.

    Parameters
    ----------
    scene : Scene, cast to one dtype
    free : dict of key path -> Positive, Bounded, Free or Tied

    Returns
    -------
    (Variables, Constants, x), x a NumPy array of shape (size,)

    Raises
    ------
    ValueError
        naming the key path: unknown (with the close ones), a static field, an object instead
        of a number, freed twice, or a start value that its rule does not allow.
    """
    if not isinstance(free, dict) or not free:
        raise ValueError('free: must be a dict of key paths, like {"upper.spectrum.hurst": Bounded(0.3, 1)}')
    leaves, tree = jax.tree_util.tree_flatten(scene)
    leaves = [np.array(leaf, float) for leaf in leaves]
    groups, low, width, x, taken, size = [], [], [], [], {}, 0
    for path, rule in free.items():
        if not isinstance(rule, tuple(RULES.values())):
            made = f"; a class, must be made with {rule.__name__}(...)" if isinstance(rule, type) else ""
            raise ValueError(f"free[{path!r}] = {rule!r}: must be Positive, Bounded, Free or Tied{made}")
        leaf, elements = find(scene, path)
        for element in elements or (None,):
            if (leaf, element) in taken:
                raise ValueError(
                    f"free[{path!r}]: already free as {taken[leaf, element]!r}; must be free once"
                )
            taken[leaf, element] = path
        if isinstance(rule, Tied):
            groups.append(Group(path, "Tied", leaf, elements, (0, 0)))
            continue
        values = _start(path, rule, leaves[leaf][list(elements)] if elements else leaves[leaf][None])
        here_low, here_width = _range(path, rule, values)
        low.append(here_low)
        width.append(here_width)
        x.append(to_x(type(rule).__name__, here_low, here_width, values))
        groups.append(Group(path, type(rule).__name__, leaf, elements, (size, size + values.size)))
        size += values.size
        if elements:
            leaves[leaf][list(elements)] = values
        else:
            leaves[leaf] = values[0]
    if size == 0:
        raise ValueError("free: all parameters are Tied; one at least must be free itself")
    groups, ratios = _tie(free, groups, leaves)
    constants = Constants(tuple(leaves), np.concatenate(low), np.concatenate(width), tuple(ratios))
    return Variables(tree, tuple(groups), size), constants, np.concatenate(x)


def _start(path: str, rule: Positive | Bounded | Free, values: np.ndarray) -> np.ndarray:
    """Start values of a group: the scene's, or those that the rule gives."""
    if rule.start is None:
        return values
    try:
        start = np.asarray(rule.start)
        if start.dtype.kind not in "fiu":  # NumPy takes text for a number
            raise TypeError
        start = start.astype(float)
        values = np.broadcast_to(start, values.shape).copy()
    except (TypeError, ValueError):
        raise ValueError(
            f"free[{path!r}]: start = {rule.start!r}: must be one number or {values.size} of them"
        ) from None
    if not np.isfinite(values).all():
        raise ValueError(f"free[{path!r}]: start = {rule.start!r}: must be finite")
    return values


def _range(path, rule, values):
    """(low, width) of a group, its start values checked."""
    zero, one = np.zeros(values.shape), np.ones(values.shape)
    if isinstance(rule, Positive):
        if not (values > 0).all():
            raise ValueError(
                f"free[{path!r}]: starts at {values.min():g}: a Positive one must start > 0; give start="
            )
        return zero, one
    if isinstance(rule, Bounded):
        inside = np.minimum(values - rule.low, rule.high - values)
        if not (inside > 0).all():
            worst = values[np.argmin(inside)]
            raise ValueError(
                f"free[{path!r}]: starts at {worst:g}: must start inside the bounds"
                f" {rule.low:g} ... {rule.high:g}, not on them; give start="
            )
        return rule.low * one, (rule.high - rule.low) * one
    return zero, one * (rule.scale or np.where(values != 0, np.abs(values), 1.0))


def to_x(kind: str, low: np.ndarray, width: np.ndarray, values: np.ndarray) -> np.ndarray:
    """x of elements of one kind at their values: `to_values` undone, on the host."""
    if kind == "Positive":
        return np.log(values)
    place = (values - low) / width
    return np.log(place / (1 - place)) if kind == "Bounded" else place


def _tie(free, groups, leaves):
    """Groups with the slots of the tied ones filled in, and their ratios."""
    by_path = {group.path: group for group in groups}
    done, ratios = [], []
    for group in groups:
        if group.kind != "Tied":
            done.append(group)
            continue
        rule = free[group.path]
        source = by_path.get(rule.to)
        if source is None or source.kind == "Tied":
            raise ValueError(
                f"free[{group.path!r}]: tied to {rule.to!r}: must be a key of free that is not tied itself"
            )
        count, sources = (len(g.elements or (0,)) for g in (group, source))
        if sources not in (1, count):
            raise ValueError(
                f"free[{group.path!r}]: has {count} elements, {rule.to!r} has {sources}:"
                " must have as many, or one"
            )
        own, other = (
            leaves[g.leaf][list(g.elements)] if g.elements else leaves[g.leaf] for g in (group, source)
        )
        if rule.ratio is None and np.any(other == 0):
            raise ValueError(f"free[{group.path!r}]: {rule.to!r} starts at 0: give the ratio")
        ratio = own / other if rule.ratio is None else rule.ratio
        ratios.append(np.broadcast_to(ratio, (count,)).astype(float))
        done.append(group._replace(slot=source.slot))
    return done, ratios


def to_values(variables: Variables, constants: Constants, x: Array) -> jax.Array:
    """Values of the free elements at x, shape (size,)."""
    parts = []
    for group in variables.own:
        part = slice(*group.slot)
        low, width, here = constants.low[part], constants.width[part], x[part]
        if group.kind == "Positive":
            parts.append(jnp.exp(here))
        elif group.kind == "Bounded":
            parts.append(low + width * jax.nn.sigmoid(here))
        else:
            parts.append(width * here)
    return jnp.concatenate(parts)


def to_scene(variables: Variables, constants: Constants, x: Array) -> rf.Scene:
    """The scene with the free elements at x; every other leaf as it was."""
    values = to_values(variables, constants, x)
    leaves, ratios = list(constants.leaves), iter(constants.ratios)
    for group in variables.groups:
        here = values[slice(*group.slot)]
        if group.kind == "Tied":
            here = next(ratios) * here
        leaf = jnp.asarray(leaves[group.leaf], values.dtype)
        if group.elements is None:
            leaves[group.leaf] = here[0]
        elif group.elements == tuple(range(leaf.shape[0])):
            leaves[group.leaf] = here
        else:
            leaves[group.leaf] = leaf.at[np.array(group.elements)].set(here)
    return jax.tree.unflatten(variables.tree, leaves)


def slopes(variables: Variables, constants: Constants, x: jax.Array) -> jax.Array:
    """d value / d x of every free element."""
    return jax.jvp(lambda x: to_values(variables, constants, x), (x,), (jnp.ones_like(x),))[1]


def element_names(variables: Variables) -> list[str]:
    """Key path of every free element, in the order of x."""
    return [name for group in variables.own for name in leaf_names(group.path, group.elements)]
