"""Key paths of a scene: "upper.material.E[3]" and what it names."""

import dataclasses
import re

import jax
import numpy as np

from rubberfric.base.checks import closest

_PATH = re.compile(r"([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)(?:\[\s*(-?\d+|)\s*(:?)\s*(-?\d+|)\s*\])?")


def scene_paths(scene):
    """Key path of every leaf of a scene, in the order of flattening."""
    flat = jax.tree_util.tree_flatten_with_path(scene)[0]
    return [".".join(key.name for key in path) for path, _ in flat]


def find(scene, path):
    """Which leaf of the scene a key path names, and which elements of it (None for a scalar).

    Raises
    ------
    ValueError
        the path names nothing (the message has the close ones), a static field or an
        object, or elements that are not there.
    """
    match = _PATH.fullmatch(path) if isinstance(path, str) else None
    if match is None:
        raise ValueError(f'{path!r}: must be a key path like "upper.material.E" or "upper.material.E[3]"')
    name, first, colon, last = match.groups()
    names = scene_paths(scene)
    if name not in names:
        raise ValueError(f"{path!r}: {_why_not(scene, name, names)}")
    leaf = names.index(name)
    shape = np.shape(jax.tree_util.tree_leaves(scene)[leaf])
    if first is None:
        return leaf, tuple(range(shape[0])) if shape else None
    if not shape:
        raise ValueError(f"{path!r}: {name} is a single number; must be without [ ]")
    if colon:
        elements = tuple(range(shape[0])[slice(int(first) if first else None, int(last) if last else None)])
    else:
        index = int(first) if first and not last else shape[0]
        elements = (index % shape[0],) if -shape[0] <= index < shape[0] else ()
    if not elements:
        raise ValueError(f"{path!r}: {name} has the elements [0] ... [{shape[0] - 1}]; must name one of them")
    return leaf, elements


def leaf_names(path, elements):
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
        fields = {f.name: f for f in dataclasses.fields(value)} if dataclasses.is_dataclass(value) else {}
        if step not in fields:
            break
        if "static" in fields[step].metadata:
            return "is a static field, an option of the scene; only numbers can be fitted"
        value = getattr(value, step)
        if value is None:
            return f"the scene has no {step}; it must be there at the start of a fit"
    return f"unknown key path; {closest(name, tuple(names))}"
