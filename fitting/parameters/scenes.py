"""Several scenes that are fitted together: their names, and key paths in them.

A key path in several scenes begins with the name of one, "R20.shear.tau_f0", or with "*" for a number
that all of them share: "*.shear.tau_f0". Scenes are a dict, which is a pytree as one scene is.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import rubberfric as rf
from rubberfric.base import closest, shown

Scenes = rf.Scene | dict[str, rf.Scene]
S = TypeVar("S")

ALL = "*."
# What a step of a key path may be.
_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)


def as_scenes(scene: rf.Scene | Mapping[str, rf.Scene]) -> Scenes:
    """One scene, or several by their names; ValueError if it is neither."""
    if isinstance(scene, rf.Scene):
        return scene
    if not isinstance(scene, Mapping):
        raise ValueError(f"scene is a {type(scene).__name__}: must be a Scene, or a dict of them")
    if not scene:
        raise ValueError("scene is empty: must hold at least one scene")
    for name, one in scene.items():
        if not (isinstance(name, str) and _NAME.fullmatch(name)):
            raise ValueError(
                f"scene: name {shown(name)}: must be a letter, then letters, digits or _, since key paths"
                " begin with it"
            )
        if not isinstance(one, rf.Scene):
            raise ValueError(f"scene[{name!r}] is a {type(one).__name__}: must be a Scene")
    return dict(scene)


def by_name(scenes: S | dict[str, S]) -> dict[str, S]:
    """Scenes, or what belongs to each, by their names; that of a single one is ""."""
    return scenes if isinstance(scenes, dict) else {"": scenes}


def each_scene(scenes: Scenes, names: Sequence[str]) -> list[rf.Scene]:
    """The scene of every name: of every data set."""
    return [by_name(scenes)[name] for name in names]


def chosen_scene(scenes: Scenes, name: str | None) -> rf.Scene:
    """The one scene of a fit, or that of a name; ValueError unless it says which."""
    if name is None and isinstance(scenes, rf.Scene):
        return scenes
    if isinstance(scenes, rf.Scene):
        raise ValueError(f"scene = {shown(name)}: must be left out in a fit of one scene")
    if name not in scenes:
        raise ValueError(f"scene = {shown(name)}: {closest(name, tuple(scenes))}")
    return scenes[name]


def paths_of(scenes: Scenes, path: Any) -> list[str]:
    """The key paths that one stands for: with "*" one in every scene."""
    if isinstance(scenes, dict) and isinstance(path, str) and path.startswith(ALL):
        return [f"{name}.{path.removeprefix(ALL)}" for name in scenes]
    return [path]


def next_step(owner: Any, step: str) -> Any:
    """What a step of a key path leads to, None if nothing."""
    return owner.get(step) if isinstance(owner, dict) else getattr(owner, step, None)
