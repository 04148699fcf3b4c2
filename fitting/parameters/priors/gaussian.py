"""What is known of a free parameter: a value and its error."""

import dataclasses
from typing import Any, NamedTuple

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
    mean, sigma : in the parameter's unit, numbers for all elements of the path, or one for each element
        For a Positive parameter sigma / mean is the standard deviation of its logarithm. Arrays are kept
        as tuples.
    """

    mean: float | tuple[float, ...] | np.ndarray
    sigma: float | tuple[float, ...] | np.ndarray

    def __post_init__(self) -> None:
        for name, rule in (("mean", ""), ("sigma", " > 0")):
            values = getattr(self, name)
            several = isinstance(values, np.ndarray | list | tuple) and np.ndim(values) == 1
            each: tuple[Any, ...] = tuple(values) if several else (values,)
            if not each or not all(is_number(x) and (x > 0 or not rule) for x in each):
                raise ValueError(f"Gaussian: {name} = {values!r}: must be a finite number{rule}")
            if several:
                object.__setattr__(self, name, tuple(map(float, each)))

    def read(self, place: Place) -> list[tuple["GaussianRows", tuple[np.ndarray, np.ndarray]]]:
        """Structure and numbers; ValueError unless the key is a free parameter."""
        find(place.scene, place.key)  # or its error, with the close ones
        group, variables, constants = place.group(), place.variables, place.constants
        if group is None or group.kind in FOLLOWING:
            known = ", ".join(g.path for g in variables.own)
            raise ValueError(f"{place.where}: must be a free parameter: {known}")
        part = np.arange(*group.slot)
        for name in ("mean", "sigma"):
            size = np.size(getattr(self, name))
            if size not in (1, part.size):
                raise ValueError(f"{place.where}: {name} has {size} numbers: must have {part.size}, or one")
        mean = np.broadcast_to(np.asarray(self.mean, float), part.shape)
        at = _x_of_mean(place.where, group, mean, constants.low[part], constants.width[part])
        sigma = np.asarray(self.sigma, float) / slopes_of(group.kind, np.asarray(constants.width)[part], at)
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
    """x at the mean of every element of a group."""
    if group.kind == "Positive" and not (mean > 0).all():
        raise ValueError(f"{where}: mean = {mean.min():g}: must be > 0, for the parameter is Positive")
    inside = (low < mean) & (mean < low + width)
    if group.kind == "Bounded" and not inside.all():
        bad = mean[np.argmin(inside)]
        raise ValueError(f"{where}: mean = {bad:g}: must be inside the parameter's bounds")
    return to_x(group.kind, low, width, mean)
