"""Cut-offs q1 that follow an rms slope, and numbers of the scene that a rule gives it first."""

from collections.abc import Mapping

import jax

import rubberfric as rf
from fitting.parameters.constraints import RmsSlope, Rule, Tied
from fitting.parameters.keypaths import owner_of
from rubberfric.base import Leaf, PhysicalObject, fields_of
from rubberfric.roughness import cutoff


def with_starts(scene: rf.Scene, free: Mapping[str, Rule]) -> rf.Scene:
    """The scene with the numbers that it may do without, such as the q1 of a table, where rules give them."""
    given = {}
    for path, rule in free.items():
        owner, name = owner_of(scene, path)
        field = fields_of(type(owner)).get(name) if isinstance(owner, PhysicalObject) else None
        if not (isinstance(field, Leaf) and field.optional and getattr(owner, name) is None):
            continue
        if isinstance(rule, RmsSlope):
            given[path] = cutoff_of(scene, path, rule.slope)
        elif not isinstance(rule, Tied) and isinstance(rule.start, int | float):
            given[path] = rule.start
    return scene.replace(given) if given else scene


def cutoff_of(scene: rf.Scene, path: str, slope: float | jax.Array) -> jax.Array:
    """q1 with which the spectrum that a key path ends in has an rms slope; ValueError if it has none."""
    owner, name = owner_of(scene, path)
    if name != "q1" or not (hasattr(owner, "power_law") and name in fields_of(type(owner))):
        raise ValueError(f"free[{path!r}]: RmsSlope is for the q1 of a spectrum; must end in .q1")
    try:
        return cutoff(owner, slope, keep="h_rms")
    except ValueError as error:
        raise ValueError(f"free[{path!r}]: {error}") from None
