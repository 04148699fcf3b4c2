"""Key paths of a scene: "upper.material.E[3]" and what it names."""

from typing import Any

import jax
import numpy as np

import rubberfric as rf
from rubberfric.base import Leaf, PhysicalObject, Static, closest, fields_of, parse_key_path


def scene_paths(scene: rf.Scene) -> list[str]:
    """Key path of every leaf of a scene, in the order of flattening."""
    flat = jax.tree_util.tree_flatten_with_path(scene)[0]
    return [jax.tree_util.keystr(path, simple=True, separator=".") for path, _ in flat]


def find(scene: rf.Scene, path: str) -> tuple[int, tuple[int, ...] | None]:
    """Which leaf of the scene a key path names, and which elements of it (None for a scalar).

    Raises
    ------
    ValueError
        the path names nothing (the message has the close ones), a static field or an
        object, or elements that are not there.
    """
    parsed = parse_key_path(path)
    names = scene_paths(scene)
    if parsed.name not in names:
        raise ValueError(f"{path!r}: {_why_not(scene, parsed.name, names)}")
    leaf = names.index(parsed.name)
    return leaf, parsed.elements(np.shape(jax.tree_util.tree_leaves(scene)[leaf]))


def owner_of(scene: rf.Scene, path: str) -> tuple[Any, str]:
    """The object whose number a key path names, None if there is no such thing, and the number's name."""
    *steps, name = parse_key_path(path).names
    owner: Any = scene
    for step in steps:
        owner = getattr(owner, step, None)
    return owner, name


def path_over(scene: rf.Scene, path: str) -> str | None:
    """Key path of what says where the elements of a vector are; None if nothing does.

    Of E of a Prony series tau, of the columns of a table their first.
    """
    owner, name = owner_of(scene, path)
    field = fields_of(type(owner)).get(name) if isinstance(owner, PhysicalObject) else None
    if not (isinstance(field, Leaf) and field.over is not None):
        return None
    return f"{path.split('[')[0].rpartition('.')[0]}.{field.over}"


def leaf_names(path: str, elements: tuple[int, ...] | None) -> list[str]:
    """Names of the elements of a key path."""
    name = path.split("[")[0]
    return [name] if elements is None else [f"{name}[{i}]" for i in elements]


def _why_not(scene, name, names):
    """Why a path names no leaf."""
    below = [other for other in names if other.startswith(name + ".")]
    if below:
        return f"is an object; must be one of its numbers: {', '.join(below)}"
    value = scene
    for step in name.split("."):
        fields = fields_of(type(value)) if isinstance(value, PhysicalObject) else {}
        if step not in fields:
            break
        if isinstance(fields[step], Static):
            return "is a static field, an option of the scene; only numbers can be fitted"
        value = getattr(value, step)
        if value is None:
            return f"the scene has no {step}; it must be there at the start of a fit"
    return f"unknown key path; {closest(name, tuple(names))}"
