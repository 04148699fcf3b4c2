"""Where free parameters start, and the range that their rule allows."""

import numpy as np

from fitting.parameters.constraints import Bounded, Free, Positive

# Which leaf of the scene, and which elements of it; None: a scalar.
Place = tuple[int, tuple[int, ...] | None]


def common_values(
    path: str,
    rule: Positive | Bounded | Free,
    paths: list[str],
    places: list[Place],
    leaves: list[np.ndarray],
) -> np.ndarray:
    """The scene's values of the elements that a path names.

    Those of a shared one must be the same in all scenes, or the rule gives them.

    Parameters
    ----------
    path, rule : of `free`
    paths : that it stands for, one a scene
    places : leaf and elements of each
    leaves : of the scenes
    """
    values = [leaves[leaf][list(elements)] if elements else leaves[leaf][None] for leaf, elements in places]
    for one, (_, elements), here in zip(paths, places, values, strict=True):
        if elements != places[0][1]:
            raise ValueError(
                f"free[{path!r}]: {paths[0]} has {values[0].size} elements, {one} has {here.size}: what"
                " scenes share must be alike in all; free it by the name of each, or tie"
            )
        if rule.start is None and not np.array_equal(here, values[0]):
            k = int(np.flatnonzero(here != values[0])[0])
            raise ValueError(
                f"free[{path!r}]: starts at {values[0][k]:g} in {paths[0].split('.')[0]}, at {here[k]:g} in"
                f" {one.split('.')[0]}: one number must start at one value; give start="
            )
    return values[0]


def start_values(path: str, rule: Positive | Bounded | Free, values: np.ndarray) -> np.ndarray:
    """Start values of a group: `values` of the scene, or those that the rule gives."""
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


def value_range(
    path: str, rule: Positive | Bounded | Free, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
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
