"""Key paths of a scene: "upper.material.E[3]" and what it names."""

from typing import Any

import jax
import numpy as np

from fitting.parameters.scenes import Scenes, next_step, paths_of
from rubberfric.base import Leaf, PhysicalObject, Static, closest, fields_of, parse_key_path


def scene_paths(scene: Scenes) -> list[str]:
    """Key path of every leaf of a scene, or of several, in the order of flattening."""
    flat = jax.tree_util.tree_flatten_with_path(scene)[0]
    return [jax.tree_util.keystr(path, simple=True, separator=".") for path, _ in flat]


def find(scene: Scenes, path: str) -> tuple[int, tuple[int, ...] | None]:
    """Which leaf of the scene a key path names, and which elements of it (None for a scalar).

    Of a number that several scenes share it is that of the first.

    Raises
    ------
    ValueError
        the path names nothing (the message has the close ones), a static field or an
        object, or elements that are not there.
    """
    parsed = parse_key_path(paths_of(scene, path)[0])
    names = scene_paths(scene)
    if parsed.name not in names:
        raise ValueError(f"{path!r}: {_why_not(scene, parsed.name, names)}")
    leaf = names.index(parsed.name)
    return leaf, parsed.elements(np.shape(jax.tree_util.tree_leaves(scene)[leaf]))


def owner_of(scene: Scenes, path: str) -> tuple[Any, str]:
    """The object whose number a key path names, None if there is no such thing, and the number's name."""
    *steps, name = parse_key_path(paths_of(scene, path)[0]).names
    owner: Any = scene
    for step in steps:
        owner = next_step(owner, step)
    return owner, name


def path_over(scene: Scenes, path: str) -> str | None:
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
    value, steps = scene, name.split(".")
    if isinstance(scene, dict):
        if steps[0] not in scene:
            known = ", ".join(scene)
            return f"must begin with the name of a scene, {known}, or with * for a number of all"
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
            return f"the scene has no {step}; it must be there at the start of a fit"
    return f"unknown key path; {closest(name, tuple(names))}"
