"""Orders that a scene demands of its numbers, such as q0 <= qr <= q1; objects declare them by `rising`."""

import itertools
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from fitting.parameters.keypaths import leaf_names, scene_paths
from fitting.parameters.scenes import Scenes, by_name
from rubberfric.base import parts_of, rising_of

# Relative difference that the way through x, or float32, makes between equal start values.
_ROUNDING = 1e-6


class End(NamedTuple):
    """A number of a scene."""

    leaf: int
    element: int | None  # None: a scalar leaf


class Pair(NamedTuple):
    """Two numbers of a scene: low <= high."""

    low: End
    high: End


def pairs_of(scene: Scenes) -> tuple[Pair, ...]:
    """Pairs of neighbours low <= high in the chains of a scene, or of several."""
    names, pairs = {name: i for i, name in enumerate(scene_paths(scene))}, []
    for prefix, one in by_name(scene).items():
        for path, part in parts_of(one, prefix):
            for chain in rising_of(part):
                ends = [
                    End(names[f"{path}.{field}" if path else field], element)
                    for field, elements in chain
                    for element in elements or (None,)
                ]
                pairs += [Pair(*two) for two in itertools.pairwise(ends)]
    return tuple(pairs)


def in_order(pairs: tuple[Pair, ...], leaves: Any) -> Any:
    """Return a scalar, True if low <= high in all pairs of the leaves of a scene."""
    found = True
    for low, high in dict.fromkeys((pair.low.leaf, pair.high.leaf) for pair in pairs):
        own = [pair for pair in pairs if (pair.low.leaf, pair.high.leaf) == (low, high)]
        below, above = (
            leaves[leaf] if ends[0] is None else leaves[leaf][np.array(ends)]
            for leaf, ends in ((low, [p.low.element for p in own]), (high, [p.high.element for p in own]))
        )
        found = found & jnp.all(below <= above)
    return found


def check_start(scene: Scenes, pairs: tuple[Pair, ...], leaves: list[np.ndarray]) -> None:
    """ValueError where the start values of a fit are out of order."""
    names = scene_paths(scene)
    for low, high in pairs:
        below, above = (
            float(leaves[end.leaf] if end.element is None else leaves[end.leaf][end.element])
            for end in (low, high)
        )
        if below - above > _ROUNDING * abs(above):
            one, other = (
                leaf_names(names[end.leaf], None if end.element is None else (end.element,))[0]
                for end in (high, low)
            )
            raise ValueError(
                f"free: {one} starts at {above:g}, {other} at {below:g}: the first must be >= the second;"
                " give start="
            )
