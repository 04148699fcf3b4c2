"""A curve of a scene is smooth: relaxation spectra, tables, knots of the softening."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.constraints import is_number
from fitting.parameters.keypaths import find, owner_of, path_over
from fitting.parameters.priors.selection import Place
from fitting.parameters.variables import Array
from rubberfric.base import unit_of

# A table of temperatures spans a small part of a decade: of these the slope is per so much [K].
_STEP = 10.0


@dataclasses.dataclass(frozen=True)
class Smooth:
    r"""A vector y of the scene is smooth over what it stands over: its slope changes little.

    .. math:: r_i = \frac{1}{sigma} \left( \frac{\ln y_{i+1} - \ln y_i}{u_{i+1} - u_i}
              - \frac{\ln y_i - \ln y_{i-1}}{u_i - u_{i-1}} \right),\qquad u = \log_{10} x

    E of a Prony series over tau, E' and E'' of a table over omega, C over q, the factors of a softening
    over the strain; a_T and b_T over the temperature, u = T / 10 K. Its key is the path of a whole vector,
    or of several separated by commas, each of which is smooth for itself.

    Parameters
    ----------
    sigma : change of d ln y / du from one element to the next that is usual [-]
    """

    sigma: float = 1.0

    def __post_init__(self) -> None:
        if not (is_number(self.sigma) and self.sigma > 0):
            raise ValueError(f"Smooth: sigma = {self.sigma!r}: must be a finite number > 0")

    def read(self, place: Place) -> list[tuple["SmoothRows", float]]:
        """Structure and numbers of every vector; ValueError unless it is one, free, over three places."""
        found = []
        for path in (path.strip() for path in place.key.split(",")):
            leaf, elements = find(place.scene, path)
            over = None if "[" in path or elements is None else path_over(place.scene, path)
            if over is None:
                raise ValueError(
                    f"{place.where}: Smooth is for a whole vector over something; must be the path of one,"
                    " such as E of a Prony series or storage of a table"
                )
            if not any(group.leaf == leaf for group in place.variables.groups):
                raise ValueError(f"{place.where}: must be a key of free, wholly or in elements")
            at, _ = find(place.scene, over)
            values, where = np.asarray(place.start[leaf]), np.asarray(place.start[at])
            if where.size < 3 or np.unique(where).size < where.size:
                raise ValueError(f"{place.where}: {over} must hold three or more different numbers")
            if not (values > 0).all():
                raise ValueError(
                    f"{place.where}: {path} starts at {values.min():g}: Smooth is of logarithms, must be > 0"
                )
            owner, name = owner_of(place.scene, over)
            warm = unit_of(type(owner), name) == "K"
            found.append((SmoothRows(leaf, at, values.size, warm), float(self.sigma)))
        return found


class SmoothRows(NamedTuple):
    """Rows of a `Smooth` vector; its number is sigma."""

    leaf: int
    over: int
    count: int  # elements of the vector
    warm: bool  # it stands over temperatures

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.count - 2

    def rows(self, sigma: Array, leaves: list[Array], x: jax.Array) -> jax.Array:
        """The rows of a scene, shape (size,)."""
        del x
        at = jnp.asarray(leaves[self.over])
        order = jnp.argsort(at)
        u = at[order] / _STEP if self.warm else jnp.log10(at[order])
        return jnp.diff(jnp.diff(jnp.log(jnp.asarray(leaves[self.leaf])[order])) / jnp.diff(u)) / sigma

    def moved(self, to: dict[int, int]) -> "SmoothRows":
        """The same of a scene whose leaves are elsewhere."""
        return self._replace(leaf=to[self.leaf], over=to[self.over])
