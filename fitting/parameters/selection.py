"""Numbers of a scene that a prior constrains, and the interface of all kinds of priors."""

from typing import Any, NamedTuple, Protocol, Self

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.scenes import Scenes, find, leaf_names
from fitting.parameters.variables import Array, Constants, Group, Variables


class Rows(Protocol):
    """Hashable structure of one prior, which computes the rows that the prior adds to the residuals.

    The numbers of the prior are a separate pytree, so a change of the numbers needs no compilation.
    """

    @property
    def size(self) -> int:
        """Number of residuals that the prior adds."""
        ...

    def rows(self, numbers: Any, leaves: list[Array], x: jax.Array) -> jax.Array:
        """Return the residuals of the prior from the leaves of a scene and from x, shape (size,)."""
        ...

    def moved(self, to: dict[int, int]) -> Self:
        """Return the rows for a scene whose leaves have other indices.

        `to` maps the index of a leaf to the new index.
        """
        ...


class Selection(NamedTuple):
    """Numbers of a scene that the key of a prior names.

    The three fields have one entry for every key path. A selection is hashable.
    """

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
        """Return the selection for a scene whose leaves have other indices.

        `to` maps the index of a leaf to the new index.
        """
        return self._replace(leaves=tuple(to[leaf] for leaf in self.leaves))

    def changing(self, variables: Variables) -> np.ndarray:
        """Return a boolean array of shape (size,) that is True for the elements that a fit changes.

        A fit changes free elements, and elements that depend on free elements, such as tied elements.
        """
        free = {(group.leaf, chosen) for group in variables.groups for chosen in group.elements or (None,)}
        pairs = zip(self.leaves, self.elements, strict=True)
        return np.array([(leaf, one) in free for leaf, chosen in pairs for one in chosen or (None,)])


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
        """Return the elements that the key names. Raise ValueError if the fit changes none of them.

        `separator` separates key paths in the key. `separated` is a part of the error message.
        """
        paths = tuple(path.strip() for path in self.key.split(separator))
        found = [find(self.scene, path) for path in paths]
        chosen = Selection(paths, tuple(leaf for leaf, _ in found), tuple(one for _, one in found))
        if not chosen.changing(self.variables).any():
            free = ", ".join(group.path for group in self.variables.groups)
            raise ValueError(
                f"{self.where}: the key must name a free parameter{separated}, or elements of one: {free}"
            )
        return chosen
