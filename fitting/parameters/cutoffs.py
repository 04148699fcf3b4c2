"""Cut-offs q1 that follow an rms slope, and numbers of the scene that a rule gives it first."""

from collections.abc import Mapping

import jax

from fitting.parameters.constraints import RmsSlope, Rule, Tied
from fitting.parameters.keypaths import owner_of
from fitting.parameters.scenes import Scenes, by_name, paths_of
from rubberfric.base import Leaf, PhysicalObject, fields_of
from rubberfric.roughness import cutoff


def with_starts(scene: Scenes, free: Mapping[str, Rule]) -> Scenes:
    """The scene with the numbers that it may do without, such as the q1 of a table, where rules give them."""
    given = {}
    for path, rule in ((path, rule) for key, rule in free.items() for path in paths_of(scene, key)):
        owner, name = owner_of(scene, path)
        field = fields_of(type(owner)).get(name) if isinstance(owner, PhysicalObject) else None
        if not (isinstance(field, Leaf) and field.optional and getattr(owner, name) is None):
            continue
        if isinstance(rule, RmsSlope):
            given[path] = cutoff_of(scene, path, rule.slope)
        elif isinstance(rule, Tied):
            continue
        elif isinstance(rule.start, int | float):
            given[path] = rule.start
        elif name == "q1" and (power_law := getattr(owner, "power_law", None)):
            given[path] = power_law().q[-1]  # a table without a cut-off ends with its last entry
    if isinstance(scene, dict):
        for path, value in given.items():
            name, _, below = path.partition(".")
            scene = scene | {name: scene[name].replace({below: value})}
        return scene
    return scene.replace(given) if given else scene


def cutoff_of(scene: Scenes, path: str, slope: float | jax.Array) -> jax.Array:
    """q1 with which the spectrum that a key path ends in has an rms slope; ValueError if it has none."""
    owner, name = owner_of(scene, path)
    if name != "q1" or not (hasattr(owner, "power_law") and name in fields_of(type(owner))):
        raise ValueError(f"free[{path!r}]: RmsSlope is for the q1 of a spectrum; must end in .q1")
    try:
        return cutoff(owner, slope, keep="h_rms")
    except ValueError as error:
        raise ValueError(f"free[{path!r}]: {error}") from None


def cutoff_path(scene: Scenes, path: str | None) -> str:
    """Key path of the q1 of a spectrum; ValueError unless it is one, or there is one only."""
    known = [
        f"{name}.{side}.spectrum.q1".lstrip(".")
        for name, one in by_name(scene).items()
        for side in ("lower", "upper")
        if hasattr(getattr(one, side).spectrum, "q1")
    ]
    if path is None and len(known) == 1:
        return known[0]
    if path is None or any(one not in known for one in paths_of(scene, path)):
        raise ValueError(
            f"path = {path!r}: must end in .q1 of a spectrum: {', '.join(known) or 'there is none'}"
        )
    return path


def last_wavevector(scene: Scenes, path: str) -> float:
    """How far the q1 at a key path may go [1/m]: to the end of a table."""
    ends = [getattr(owner_of(scene, one)[0], "q", None) for one in paths_of(scene, path)]
    return min((float(q[-1]) for q in ends if q is not None), default=float("inf"))
