"""Numbers of a scene that a prior constrains, and the interface of all kinds of priors."""

from typing import NamedTuple, Protocol, Self

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.scenes import Scenes, find, leaf_names
from fitting.parameters.variables import Array, Constants, Group, Variables

# Metadata of a field that determines compiled functions. The other fields of `Rows` are numbers.
STATIC = {"static": True}


class Rows(Protocol):
    """Rows that a prior adds to the residuals, a pytree whose numbers can change without compilation."""

    @property
    def size(self) -> int:
        """Number of residuals that the prior adds."""
        ...

    def rows(self, leaves: list[Array], x: jax.Array) -> jax.Array:
        """Return the residuals of the prior from the leaves of a scene and from x, shape (size,)."""
        ...

    def moved(self, to: dict[int, int]) -> Self:
        """Return the rows for a scene whose leaf i has the index to[i]."""
        ...


class Selection(NamedTuple):
    """Numbers of a scene that the key of a prior names, with one entry for every key path; hashable."""

    paths: tuple[str, ...]
    leaves: tuple[int, ...]  # index of the leaf
    elements: tuple[tuple[int, ...] | None, ...]  # None: a scalar leaf

    @property
    def size(self) -> int:
        """Number of selected elements."""
        return sum(len(chosen or (0,)) for chosen in self.elements)

    @property
    def names(self) -> list[str]:
        """Key path of every selected element."""
        pairs = zip(self.paths, self.elements, strict=True)
        return [name for path, chosen in pairs for name in leaf_names(path, chosen)]

    def of(self, leaves: list[Array]) -> jax.Array:
        """Return the values of the selected elements from the leaves of a scene, shape (size,)."""
        parts = []
        for leaf, chosen in zip(self.leaves, self.elements, strict=True):
            values = jnp.asarray(leaves[leaf])
            parts.append(values[None] if chosen is None else values[np.array(chosen)])
        return jnp.concatenate(parts)

    def moved(self, to: dict[int, int]) -> "Selection":
        """Return the selection for a scene whose leaf i has the index to[i]."""
        return self._replace(leaves=tuple(to[leaf] for leaf in self.leaves))

    def changing(self, variables: Variables) -> np.ndarray:
        """Return booleans of shape (size,), True for elements that are free or depend on free ones."""
        free = {(group.leaf, chosen) for group in variables.groups for chosen in group.elements or (None,)}
        pairs = zip(self.leaves, self.elements, strict=True)
        return np.array([(leaf, element) in free for leaf, chosen in pairs for element in chosen or (None,)])


class PriorContext(NamedTuple):
    """Key, scene and free parameters that the method `read` of a prior needs."""

    where: str  # for errors: "prior['gamma']"
    key: str  # key of the prior: one or several key paths
    scene: Scenes
    variables: Variables
    constants: Constants

    @property
    def start(self) -> list[Array]:
        """Leaves of the scene at the start of the fit."""
        return list(self.constants.leaves)

    def group(self) -> Group | None:
        """Return the free parameter with the key path of the prior, or None if this path is not free."""
        return next((group for group in self.variables.groups if group.path == self.key), None)

    def selection(self, separator: str, separated: str) -> Selection:
        """Return the elements that the key, several paths with a `separator`, names.

        Raise ValueError, with the words `separated`, if the fit changes none of them.
        """
        paths = tuple(path.strip() for path in self.key.split(separator))
        places = [find(self.scene, path) for path in paths]
        chosen = Selection(
            paths, tuple(leaf for leaf, _ in places), tuple(elements for _, elements in places)
        )
        if not chosen.changing(self.variables).any():
            free = ", ".join(group.path for group in self.variables.groups)
            raise ValueError(
                f"{self.where}: the key must name a free parameter{separated}, or elements of one: {free}"
            )
        return chosen
