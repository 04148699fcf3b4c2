"""Tables of a scene that a fit leaves as they are, in lengths that recur: another one compiles nothing."""

from collections.abc import Collection
from typing import Any

import jax

from fitting.parameters.scenes import Pair, by_name, scene_paths
from fitting.parameters.variables import Constants, Variables
from rubberfric.base import Kind, PhysicalObject, fields_of


def with_longer_tables(
    variables: Variables, constants: Constants
) -> tuple[Variables, Constants, dict[int, int]]:
    """Variables and constants of the same scene with padded tables, and where each leaf is in it.

    Objects with free numbers stay as they are.
    """
    scene = jax.tree.unflatten(variables.tree, constants.leaves)
    paths = scene_paths(scene)
    free = {paths[group.leaf].rpartition(".")[0] for group in variables.groups}
    padded: Any = {name: _padded(one, name, free) for name, one in by_name(scene).items()}
    padded = padded if isinstance(scene, dict) else padded[""]
    leaves, tree = jax.tree.flatten(padded)
    after = {path: i for i, path in enumerate(scene_paths(padded))}
    moved = {i: after[path] for i, path in enumerate(paths)}
    groups = tuple(group._replace(leaf=moved[group.leaf]) for group in variables.groups)
    order = tuple(Pair(*(end._replace(leaf=moved[end.leaf]) for end in pair)) for pair in variables.order)
    longer = variables._replace(tree=tree, groups=groups, order=order)
    return longer, constants._replace(leaves=tuple(leaves)), moved


def _padded(value: PhysicalObject, path: str, free: Collection[str]) -> PhysicalObject:
    """An object with the tables in it padded, but for those of objects at the key paths `free`."""
    changes: dict[str, Any] = {}
    for name in fields_of(type(value)):
        content = getattr(value, name)
        if isinstance(content, PhysicalObject):
            new = _padded(content, f"{path}.{name}" if path else name, free)
            changes |= {name: new} if new is not content else {}
    if changes:
        value = value.replace(**changes)
    return value if path in free or not isinstance(value, Kind) else value.padded()
