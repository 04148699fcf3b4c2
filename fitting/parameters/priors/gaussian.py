"""What is known of a free parameter: a value and its error."""

import dataclasses
from typing import NamedTuple

import jax
import numpy as np

from fitting.parameters.constraints import FOLLOWING, is_number
from fitting.parameters.keypaths import find
from fitting.parameters.priors.selection import Place
from fitting.parameters.variables import Array, slopes_of, to_x


@dataclasses.dataclass(frozen=True)
class Gaussian:
    r"""A free parameter is about `mean`, give or take `sigma`: Gaussian in the fit's variable x.

    .. math:: r = (x - x(mean)) \, / \, (sigma \; dx/d value)

    Parameters
    ----------
    mean, sigma : numbers in the parameter's unit
        for all elements of the path. For a Positive parameter sigma / mean is the standard
        deviation of its logarithm.
    """

    mean: float
    sigma: float

    def __post_init__(self) -> None:
        if not is_number(self.mean):
            raise ValueError(f"Gaussian: mean = {self.mean!r}: must be a finite number")
        if not (is_number(self.sigma) and self.sigma > 0):
            raise ValueError(f"Gaussian: sigma = {self.sigma!r}: must be a finite number > 0")

    def read(self, place: Place) -> list[tuple["GaussianRows", tuple[np.ndarray, np.ndarray]]]:
        """Structure and numbers; ValueError unless the key is a free parameter."""
        find(place.scene, place.key)  # or its error, with the close ones
        group, variables, constants = place.group(), place.variables, place.constants
        if group is None or group.kind in FOLLOWING:
            known = ", ".join(g.path for g in variables.own)
            raise ValueError(f"{place.where}: must be a free parameter: {known}")
        part = np.arange(*group.slot)
        at = _x_of_mean(place.where, group, self.mean, constants.low[part], constants.width[part])
        sigma = self.sigma / slopes_of(group.kind, np.asarray(constants.width)[part], at)
        return [(GaussianRows(tuple(part.tolist())), (at, sigma))]


class GaussianRows(NamedTuple):
    """Rows of a `Gaussian`; numbers are its mean and sigma in x."""

    elements: tuple[int, ...]  # in x

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.elements)

    def rows(self, numbers: tuple[Array, Array], leaves: list[Array], x: jax.Array) -> jax.Array:
        """The rows at x, shape (size,)."""
        del leaves
        mean, sigma = numbers
        return (x[np.array(self.elements)] - mean) / sigma

    def moved(self, to: dict[int, int]) -> "GaussianRows":
        """The same: it knows no leaves."""
        del to
        return self


def _x_of_mean(where, group, mean, low, width):
    """x at the mean of a group, one number for each of its elements."""
    if group.kind == "Positive" and not mean > 0:
        raise ValueError(f"{where}: mean = {mean:g}: must be > 0, for the parameter is Positive")
    if group.kind == "Bounded" and not ((low < mean) & (mean < low + width)).all():
        raise ValueError(f"{where}: mean = {mean:g}: must be inside the parameter's bounds")
    return to_x(group.kind, low, width, np.full(low.shape, mean))
