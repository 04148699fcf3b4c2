"""Key paths such as "upper.material.E[3]", which name numbers of a physical object.

A key path consists of names of fields joined by dots. Brackets after an array select an element. Elements are
counted from 0, or from the end if the number in the brackets is negative. "[1:3]" selects the elements 1 and
2.
"""

import re
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import as_leaf, shown

_PATH = re.compile(r"([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)(?:\[\s*(-?\d+|)\s*(:?)\s*(-?\d+|)\s*\])?")


class KeyPath(NamedTuple):
    """A parsed key path."""

    text: str  # as given
    names: tuple[str, ...]  # names of the fields
    index: tuple[str, str, str] | None  # text before the colon, the colon, and text after it

    @property
    def name(self) -> str:
        """Return the key path without the brackets."""
        return ".".join(self.names)

    def elements(self, shape: tuple[int, ...]) -> tuple[int, ...] | None:
        """Return the indices that the key path selects along the first axis of an array.

        The indices are counted from 0. If the key path has no brackets, all indices are returned. If the
        array is a single number, the result is None.

        Raises
        ------
        ValueError : the array has no such elements.
        """
        if not shape:
            if self.index is not None:
                raise ValueError(f"{self.text!r}: {self.name} is a single number; leave [ ] out")
            return None
        size = shape[0]
        if self.index is None:
            return tuple(range(size))
        first, colon, last = self.index
        if colon:
            chosen = slice(*(int(end) if end else None for end in (first, last)))
            positions = tuple(range(size)[chosen])
        else:
            positions = (int(first) % size,) if first and not last and -size <= int(first) < size else ()
        if not positions:
            raise ValueError(
                f"{self.text!r}: {self.name} has the elements [0] ... [{size - 1}]; must name one of them"
            )
        return positions


def parse_key_path(path: str) -> KeyPath:
    """Parse a key path, or raise ValueError if the key path is invalid."""
    match = _PATH.fullmatch(path) if isinstance(path, str) else None
    if match is None:
        raise ValueError(f'{path!r}: must be a key path like "upper.material.E" or "upper.material.E[3]"')
    name, first, colon, last = match.groups()
    return KeyPath(path, tuple(name.split(".")), None if first is None else (first, colon, last))


def with_elements(path: KeyPath, array: Any, new: Any) -> jax.Array:
    """Return a copy of an array with new numbers in the elements that a key path selects."""
    if not isinstance(array, jax.Array | float):
        raise ValueError(f"{path.text!r}: {path.name} = {shown(array)} is not an array; leave [ ] out")
    array = jnp.asarray(array)
    elements = path.elements(array.shape) or ()
    new = jnp.asarray(as_leaf(path.text, new, np.ndim(new)))
    shape = (len(elements), *array.shape[1:])
    if new.shape not in ((), shape, array.shape[1:]):
        raise ValueError(f"{path.text} = {shown(new)}: has shape {new.shape}: must be {shape}, or one number")
    both = jnp.result_type(array, new)
    return array.astype(both).at[np.array(elements)].set(new.astype(both))
