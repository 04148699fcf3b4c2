"""Free parameters: the numbers of a scene that a fit may change, and the variables x of the solvers.

A parameter is named by its key path in the scene: "gamma", "lower.spectrum.hurst", "upper.material.E" (all
elements), "upper.material.E[3]", "upper.material.E[4:]". Its rule determines its allowed values. With several
scenes (`fitting.parameters.scenes`), "*.shear.tau_f0" is one number for all scenes. Solvers use one vector x
of unconstrained numbers, one for each free element. A step of 1 in x changes a value by about its own size:

=============  ========================================  =======================
rule           value                                     x
=============  ========================================  =======================
Positive       e^x                                       ln value
Bounded        low + (high - low) / (1 + e^-x)           logit of its position
Free           scale x                                   value / scale
=============  ========================================  =======================
"""

import functools
from collections.abc import Callable, Hashable, Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy

from fitting.parameters.constraints import (
    CONSTRAINTS,
    FOLLOWING,
    Constraint,
    RmsSlope,
    Tied,
    common_values,
    cutoff_of,
    start_values,
    value_range,
    with_starts,
)
from fitting.parameters.scenes import (
    OrderedPair,
    Scenes,
    as_scenes,
    check_start,
    find,
    leaf_names,
    ordered_pairs,
    paths_of,
)
from rubberfric.base import as_array
from rubberfric.scene import cast, result_dtype

# A Positive element that fell by more than this factor was driven towards zero.
VANISHED = 1e6

Array = jax.Array | np.ndarray


class Group(NamedTuple):
    """Elements of one leaf of the scene to which one rule applies. A group is hashable."""

    path: str
    kind: str  # "Positive", "Bounded", "Free", "Tied", "RmsSlope", "Shared": the value of another scene
    leaf: int  # index of the leaf of the scene
    elements: tuple[int, ...] | None  # elements of the leaf; None: a scalar leaf
    slot: tuple[int, int]  # (first, last + 1) in x; Tied and Shared have the slot of the other group


class Variables(NamedTuple):
    """Hashable structure of a set of free parameters. A function is compiled once for each structure."""

    tree: Hashable  # structure of the scene, as jax.tree flattens it
    groups: tuple[Group, ...]
    size: int  # number of free elements
    order: tuple[OrderedPair, ...] = ()  # pairs of free numbers and neighbours that must be in order

    @property
    def own(self) -> list[Group]:
        """Groups with separate elements in x, which are all except Tied, RmsSlope and Shared."""
        return [group for group in self.groups if group.kind not in FOLLOWING]

    @property
    def kinds(self) -> list[str]:
        """Kind of the rule of every element of x."""
        return [group.kind for group in self.own for _ in range(*group.slot)]


class Constants(NamedTuple):
    """Pytree of the numbers that complete a `Variables` structure: leaves, ranges and ratios."""

    leaves: tuple[Array, ...]  # leaves of the scene at the start
    low: Array  # lower bound, 0 for unbounded elements, shape (size,)
    width: Array  # high - low of Bounded, scale of Free, 1 for Positive elements
    ratios: tuple[Array, ...]  # ratios of every Tied group, (elements,); slope of every RmsSlope, (1,)


def free_parameters(scene: Scenes, free: Mapping[str, Constraint]) -> tuple[Variables, Constants, np.ndarray]:
    """Return the variables, the constants and the start vector x for the free parameters of scenes.

    The scenes have one dtype, and x has the shape (size,). A ValueError names the key path if it is unknown,
    names a static field or an object, is free twice, or has a start value that violates the rule.
    """
    if not isinstance(free, dict) or not free:
        raise ValueError('free: must be a dict of key paths, like {"upper.spectrum.hurst": Bounded(0.3, 1)}')
    leaves, tree = jax.tree_util.tree_flatten(scene)
    leaves = [np.array(leaf, float) for leaf in leaves]
    groups, rules, low, width, x, taken, size = [], {}, [], [], [], {}, 0
    for path, rule in free.items():
        if not isinstance(rule, tuple(CONSTRAINTS.values())):
            made = f"; this is a class, create it with {rule.__name__}(...)" if isinstance(rule, type) else ""
            raise ValueError(
                f"free[{path!r}] = {rule!r}: must be Positive, Bounded, Free, Tied or RmsSlope{made}"
            )
        paths = paths_of(scene, path)
        places = [find(scene, scene_path) for scene_path in paths]
        _take(path, places, taken)
        if isinstance(rule, Tied | RmsSlope):
            rules |= dict.fromkeys(paths, rule)
            groups += [
                Group(scene_path, type(rule).__name__, *place, (0, 0))
                for scene_path, place in zip(paths, places, strict=True)
            ]
            continue
        values = start_values(path, rule, common_values(path, rule, paths, places, leaves))
        here_low, here_width = value_range(path, rule, values)
        low.append(here_low)
        width.append(here_width)
        x.append(to_x(type(rule).__name__, here_low, here_width, values))
        slot = size, size + values.size
        groups.append(Group(path, type(rule).__name__, *places[0], slot))
        others = zip(paths[1:], places[1:], strict=True)
        groups += [Group(scene_path, "Shared", *place, slot) for scene_path, place in others]
        size += values.size
        for leaf, elements in places:
            leaves[leaf][list(elements) if elements else ()] = values if elements else values[0]
    if size == 0:
        raise ValueError("free: all parameters are Tied or RmsSlope; at least one must be free itself")
    groups, ratios = _follow(rules, groups, leaves, tree)
    constants = Constants(tuple(leaves), np.concatenate(low), np.concatenate(width), tuple(ratios))
    changing = {(group.leaf, element) for group in groups for element in group.elements or (None,)}
    order = tuple(pair for pair in ordered_pairs(scene) if not changing.isdisjoint(pair))
    variables, x = Variables(tree, tuple(groups), size, order), np.concatenate(x)
    check_start(scene, order, jax.tree.leaves(to_scene(variables, constants, x)))
    return variables, constants, x


def _take(path, places, taken):
    """Record in `taken` that `path` frees the elements at `places`, which must not be free already."""
    for leaf, elements in places:
        for element in elements or (None,):
            if (leaf, element) in taken:
                raise ValueError(f"free[{path!r}]: already free as {taken[leaf, element]!r}; give it once")
            taken[leaf, element] = path


def to_x(kind: str, low: Array, width: Array, values: Any) -> Any:
    """Return the variables x of elements with the rule `kind` from their values."""
    xp = jnp if isinstance(values, jax.Array) else np
    if kind == "Positive":
        return xp.log(values)
    place = (values - low) / width
    return xp.log(place / (1 - place)) if kind == "Bounded" else place


def from_x(kind: str, low: Array, width: Array, x: Any) -> Any:
    """Return the values of elements with the rule `kind` from their variables x."""
    xp, sigmoid = (jnp, jax.nn.sigmoid) if isinstance(x, jax.Array) else (np, scipy.special.expit)
    if kind == "Positive":
        with np.errstate(over="ignore"):  # inf, as XLA has it: the model is not finite there
            return xp.exp(x)
    return low + width * sigmoid(x) if kind == "Bounded" else width * x


def slopes_of(kind: str, width: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return d value / d x of elements with the rule `kind`, as a NumPy array."""
    if kind == "Positive":
        return np.exp(x)
    far = np.exp(-np.abs(x))
    return width * far / (1 + far) ** 2 if kind == "Bounded" else width * np.ones_like(x)


def _follow(rules, groups, leaves, tree):
    """Return all groups, with the slots of Tied groups set, and the list `ratios` of `Constants`."""
    by_path = {group.path: group for group in groups}
    done, ratios = [], []
    for group in groups:
        rule = rules.get(group.path)
        if not isinstance(rule, Tied):
            done.append(group)
            if rule is not None:
                cutoff_of(jax.tree.unflatten(tree, leaves), group.path, rule.slope)  # or its error
                ratios.append(np.array([rule.slope], float))
            continue
        source = by_path.get(rule.to)
        if source is None or source.kind in FOLLOWING:
            raise ValueError(
                f"free[{group.path!r}]: tied to {rule.to!r}: must be another key of free, one that is not"
                " tied itself"
            )
        count, sources = (len(g.elements or (0,)) for g in (group, source))
        if sources not in (1, count):
            raise ValueError(
                f"free[{group.path!r}]: has {count} elements, but {rule.to!r} has {sources};"
                " tie it to a parameter with as many elements, or with one"
            )
        own, other = (
            leaves[g.leaf][list(g.elements)] if g.elements else leaves[g.leaf] for g in (group, source)
        )
        if rule.ratio is None and np.any(other == 0):
            raise ValueError(f"free[{group.path!r}]: {rule.to!r} starts at 0, so the ratio must be given")
        ratio = own / other if rule.ratio is None else rule.ratio
        ratios.append(np.broadcast_to(ratio, (count,)).astype(float))
        done.append(group._replace(slot=source.slot))
    return done, ratios


def to_values(variables: Variables, constants: Constants, x: Array) -> Array:
    """Return the values of the free elements at x, shape (..., size), in NumPy if x is a NumPy array."""
    xp = np if isinstance(x, np.ndarray) else jnp
    return xp.concatenate(list(_by_slot(variables, constants, x).values()), -1)


def _by_slot(variables, constants, x) -> dict[tuple[int, int], Array]:
    """Return a dict of slot -> values, which depend only on this slot of x, so derivatives are sparse."""
    xp = np if isinstance(x, np.ndarray) else jnp
    low, width, parts = xp.asarray(constants.low), xp.asarray(constants.width), {}
    for group in variables.own:
        part = slice(*group.slot)
        parts[group.slot] = from_x(group.kind, low[part], width[part], x[..., part])
    return parts


def to_scene(variables: Variables, constants: Constants, x: Array) -> Any:
    """Return the scene, or a dict of scenes, with the free parameters at the values for x."""
    values = _by_slot(variables, constants, x)
    leaves, ratios, cut = list(constants.leaves), iter(constants.ratios), []
    for group in variables.groups:
        if group.kind == "RmsSlope":
            cut.append((group, next(ratios)[0]))
            continue
        here = values[group.slot]
        if group.kind == "Tied":
            ratio = next(ratios)
            here = (np.asarray(ratio) if isinstance(here, np.ndarray) else ratio) * here
        before, elements = leaves[group.leaf], np.array(group.elements)
        if group.elements is None:
            here = here[0]
        elif group.elements != tuple(range(before.shape[0])):
            if isinstance(here, np.ndarray):
                here, some = np.array(before, here.dtype), here
                here[elements] = some
            else:
                here = jnp.asarray(before, here.dtype).at[elements].set(here)
        leaves[group.leaf] = as_array(here)
    for group, slope in cut:  # after all other leaves, on which it depends
        leaves[group.leaf] = cutoff_of(jax.tree.unflatten(variables.tree, leaves), group.path, slope)
    return jax.tree.unflatten(variables.tree, leaves)


def unconstrained(
    scene: Scenes, free: Mapping[str, Constraint]
) -> tuple[jax.Array, Callable[[jax.Array], Any]]:
    """Return a scene's free parameters as unconstrained numbers, for optimisers other than `fitting.fit`.

    ::

        x, to_scene = fitting.unconstrained(scene, {"lower.spectrum.h_rms": fitting.Positive()})
        gradient = jax.grad(lambda x: loss(to_scene(x)))(x)

    Parameters
    ----------
    scene : Scene, or dict of name -> Scene; its numbers are the initial guess and the fixed parameters
    free : dict of key path -> Positive, Bounded, Free, Tied or RmsSlope, as for `fitting.fit`

    Returns
    -------
    x : shape (n,) [-]
        x is the logarithm of a Positive parameter, the logit of a Bounded parameter, and value / scale of a
        Free parameter. A step of 1 in x changes a parameter by about its own size.
    to_scene : pure function of x, which `jit`, `vmap` and `grad` support; returns the scene or scenes
        The order of numbers in a scene, such as q0 <= qr <= q1, is not enforced.

    Raises
    ------
    ValueError : as in `fitting.fit` for `free`

    Examples
    --------
    The logit of gamma changes by 1:

    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> x, to_scene = fitting.unconstrained(scene, {"gamma": fitting.Bounded(0.0, 1.0)})
    >>> [round(float(to_scene(x + step).gamma), 3) for step in (-1.0, 0.0, 1.0)]
    [0.269, 0.5, 0.731]
    """
    scene = as_scenes(scene)
    dtype = result_dtype(scene, 1.0)
    variables, constants, start = free_parameters(with_starts(cast(scene, dtype), free), free)
    return jnp.asarray(start, dtype), functools.partial(to_scene, variables, cast(constants, dtype))


def slopes(variables: Variables, constants: Constants, x: np.ndarray) -> np.ndarray:
    """Return d value / d x of every free element, as a NumPy array of shape (size,)."""
    width = np.asarray(constants.width)
    parts = [slice(*group.slot) for group in variables.own]
    return np.concatenate(
        [slopes_of(group.kind, width[p], x[p]) for group, p in zip(variables.own, parts, strict=True)]
    )


def element_names(variables: Variables) -> list[str]:
    """Return the key paths of all free elements, in the order of x."""
    return [name for group in variables.own for name in leaf_names(group.path, group.elements)]
