"""Scenes of a fit, key paths of numbers in scenes, and the required order of numbers.

A key path names a number, "upper.material.E[3]". With several scenes a key path begins with the name of a
scene, "R20.shear.tau_f0", or with "*" for a number that all scenes share: "*.shear.tau_f0". Several scenes
form a dict of name -> scene, which is a pytree like a single scene. Some numbers must keep an order, such as
q0 <= qr <= q1. Objects declare this order in `rising`.
"""

import itertools
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from rubberfric.base import (
    Leaf,
    PhysicalObject,
    Static,
    closest,
    fields_of,
    parse_key_path,
    parts_of,
    rising_of,
    shown,
    unit_of,
)

Scenes = rf.Scene | dict[str, rf.Scene]
_S = TypeVar("_S")

ALL = "*."
# Pattern of a step of a key path.
_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)


def as_scenes(scene: rf.Scene | Mapping[str, rf.Scene]) -> Scenes:
    """Return a scene, or a dict of name -> scene. Raise ValueError for another object or an invalid name."""
    if isinstance(scene, rf.Scene):
        return scene
    if not isinstance(scene, Mapping):
        raise ValueError(f"scene is a {type(scene).__name__}: must be a Scene, or a dict of them")
    if not scene:
        raise ValueError("scene is empty: must hold at least one scene")
    for name, part in scene.items():
        if not (isinstance(name, str) and _NAME.fullmatch(name)):
            raise ValueError(f"scene: name {shown(name)}: must be a letter, then letters, digits or _")
        if not isinstance(part, rf.Scene):
            raise ValueError(f"scene[{name!r}] is a {type(part).__name__}: must be a Scene")
    return dict(scene)


def by_name(scenes: _S | dict[str, _S]) -> dict[str, _S]:
    """Return a dict of scene name -> object. The name of a single scene is ""."""
    return scenes if isinstance(scenes, dict) else {"": scenes}


def each_scene(scenes: Scenes, names: Sequence[str]) -> list[rf.Scene]:
    """Return a list with the scene of every name in `names`, such as the names of all data sets."""
    return [by_name(scenes)[name] for name in names]


def chosen_scene(scenes: Scenes, name: str | None) -> rf.Scene:
    """Return the scene with the given name, or the only scene of a fit if `name` is None."""
    if name is None and isinstance(scenes, rf.Scene):
        return scenes
    if isinstance(scenes, rf.Scene):
        raise ValueError(f"scene = {shown(name)}: must be None, because the fit has one scene")
    if name not in scenes:
        raise ValueError(f"scene = {shown(name)}: {closest(name, tuple(scenes))}")
    return scenes[name]


def paths_of(scenes: Scenes, path: Any) -> list[str]:
    """Return the key paths that `path` stands for: one for every scene if it begins with "*", else itself."""
    if isinstance(scenes, dict) and isinstance(path, str) and path.startswith(ALL):
        return [f"{name}.{path.removeprefix(ALL)}" for name in scenes]
    return [path]


def scene_paths(scene: Scenes) -> list[str]:
    """Return the key paths of all leaves of one scene or several, in the order of `jax.tree.flatten`."""
    flat = jax.tree_util.tree_flatten_with_path(scene)[0]
    return [jax.tree_util.keystr(path, simple=True, separator=".") for path, _ in flat]


def find(scene: Scenes, path: str) -> tuple[int, tuple[int, ...] | None]:
    """Return the index of the leaf that a key path names, and its elements, or None for a scalar leaf.

    A shared parameter has the leaf of the first scene. Raise ValueError if the path is unknown (the message
    suggests similar paths), names a static field or an object, or has elements that do not exist.
    """
    parsed = parse_key_path(paths_of(scene, path)[0])
    names = scene_paths(scene)
    if parsed.name not in names:
        raise ValueError(f"{path!r}: {_why_not(scene, parsed.name, names)}")
    leaf = names.index(parsed.name)
    return leaf, parsed.elements(np.shape(jax.tree_util.tree_leaves(scene)[leaf]))


def owner_of(scene: Scenes, path: str) -> tuple[Any, str]:
    """Return the object that contains the number at a key path, None if missing, and the number's name."""
    *steps, name = parse_key_path(paths_of(scene, path)[0]).names
    owner: Any = scene
    for step in steps:
        owner = owner.get(step) if isinstance(owner, dict) else getattr(owner, step, None)
    return owner, name


def unit(scene: Scenes, path: str) -> str:
    """Return the unit of the number at a key path, or "" if the number is dimensionless."""
    owner, name = owner_of(scene, path)
    text = unit_of(type(owner), name)
    return "" if text == "-" else text


def field_of(owner: Any, name: str) -> Leaf | None:
    """Return the declaration of a number of an object, or None if the object has no such number."""
    field = fields_of(type(owner)).get(name) if isinstance(owner, PhysicalObject) else None
    return field if isinstance(field, Leaf) else None


def path_over(scene: Scenes, path: str) -> str | None:
    """Return the key path of the abscissa of a vector, such as tau for E of a Prony series, or None."""
    field = field_of(*owner_of(scene, path))
    over = None if field is None else field.over
    return None if over is None else f"{path.split('[')[0].rpartition('.')[0]}.{over}"


def leaf_names(path: str, elements: tuple[int, ...] | None) -> list[str]:
    """Return the key path of every element, such as "upper.material.E[3]", or of a scalar leaf."""
    name = path.split("[")[0]
    return [name] if elements is None else [f"{name}[{i}]" for i in elements]


def _why_not(scene, name, names):
    below = [other for other in names if other.startswith(name + ".")]
    if below:
        return f"is an object; must be one of its numbers: {', '.join(below)}"
    value, steps = scene, name.split(".")
    if isinstance(scene, dict):
        if steps[0] not in scene:
            known = ", ".join(scene)
            return f"must begin with the name of a scene, {known}, or with * for a number of all scenes"
        names = [other for other in names if other.startswith(f"{steps[0]}.")]
        value = scene[steps.pop(0)]
    for step in steps:
        fields = fields_of(type(value)) if isinstance(value, PhysicalObject) else {}
        if step not in fields:
            break
        if isinstance(fields[step], Static):
            return "is a static field, an option of the scene; only numbers can be fitted"
        value = getattr(value, step)
        if value is None:
            return f"the scene has no {step}; add one before the fit"
    return f"unknown key path; {closest(name, tuple(names))}"


# Relative rounding of start values by the conversion to x and back, or by float32.
_ROUNDING = 1e-6


class End(NamedTuple):
    """Position of a number in a scene."""

    leaf: int
    element: int | None  # None: a scalar leaf

    def value(self, leaves: Any) -> Any:
        """Return the number, given all leaves of the scene."""
        return leaves[self.leaf] if self.element is None else leaves[self.leaf][self.element]

    def name(self, paths: list[str]) -> str:
        """Return the key path of the number, given the paths of all leaves of the scene."""
        return leaf_names(paths[self.leaf], None if self.element is None else (self.element,))[0]


class OrderedPair(NamedTuple):
    """Positions of two numbers of a scene that must satisfy low <= high."""

    low: End
    high: End


def ordered_pairs(scene: Scenes) -> tuple[OrderedPair, ...]:
    """Return the pairs of numbers that must satisfy low <= high, in one scene or in several."""
    names, pairs = {name: i for i, name in enumerate(scene_paths(scene))}, []
    for prefix, part_scene in by_name(scene).items():
        for path, part in parts_of(part_scene, prefix):
            for chain in rising_of(part):
                ends = [
                    End(names[f"{path}.{field}" if path else field], element)
                    for field, elements in chain
                    for element in elements or (None,)
                ]
                pairs += [OrderedPair(*two) for two in itertools.pairwise(ends)]
    return tuple(pairs)


def in_order(pairs: tuple[OrderedPair, ...], leaves: Any) -> Any:
    """Return True, or a boolean scalar array, if low <= high for all pairs of numbers in `leaves`."""
    holds = True
    for low, high in dict.fromkeys((pair.low.leaf, pair.high.leaf) for pair in pairs):
        own = [pair for pair in pairs if (pair.low.leaf, pair.high.leaf) == (low, high)]
        below, above = (
            leaves[leaf] if ends[0] is None else leaves[leaf][np.array(ends)]
            for leaf, ends in ((low, [p.low.element for p in own]), (high, [p.high.element for p in own]))
        )
        holds = holds & jnp.all(below <= above)
    return holds


def check_start(scene: Scenes, pairs: tuple[OrderedPair, ...], leaves: list[np.ndarray]) -> None:
    """Raise ValueError if start values break the order of a scene, such as q0 <= qr, beyond rounding."""
    names = scene_paths(scene)
    for low, high in pairs:
        below, above = (float(end.value(leaves)) for end in (low, high))
        if below - above > _ROUNDING * abs(above):
            first, other = (end.name(names) for end in (high, low))
            raise ValueError(
                f"free: {first} starts at {above:g}, below {other} at {below:g}: the first must be >= the"
                " second; give start="
            )
