"""What is known of a sum: that the glassy modulus, for one, lies below a limit."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.constraints import is_number
from fitting.parameters.priors.selection import Place, Selection
from fitting.parameters.variables import Array


@dataclasses.dataclass(frozen=True)
class Sum:
    r"""A sum s of numbers of the scene lies within limits, give or take `sigma`.

    .. math:: r = \frac{\max(\ln s - \ln high,\, 0) - \max(\ln low - \ln s,\, 0)}{sigma}

    It says nothing within the limits, and is half a Gaussian in ln s beyond each. Its key are the paths of
    what is added, separated by "+"; of a vector all elements are: {"upper.material.E_inf +
    upper.material.E": Sum(high=2e9)} keeps the glassy modulus of a Prony series below 2 GPa.

    Parameters
    ----------
    low, high : limits in the unit of the numbers, > 0, low < high; None: there is none on this side
    sigma : relative error of the limits [-]
    """

    low: float | None = None
    high: float | None = None
    sigma: float = 0.05

    def __post_init__(self) -> None:
        given = [limit for limit in (self.low, self.high) if limit is not None]
        if not given or not all(is_number(limit) and limit > 0 for limit in given):
            raise ValueError(
                f"Sum: low = {self.low!r}, high = {self.high!r}: must be numbers > 0, one of them at least"
            )
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError(f"Sum: low = {self.low!r}, high = {self.high!r}: must be low < high")
        if not (is_number(self.sigma) and self.sigma > 0):
            raise ValueError(f"Sum: sigma = {self.sigma!r}: must be a finite number > 0")

    def read(self, place: Place) -> list[tuple["SumRows", tuple[float, float, float]]]:
        """Structure and numbers; ValueError unless the sum is > 0 and a fit changes it."""
        chosen = place.selection("+", " or a sum with some")
        start = float(np.sum(np.asarray(chosen.of(place.start))))
        if not start > 0:
            raise ValueError(f"{place.where}: the sum starts at {start:g}: must be > 0")
        low = -np.inf if self.low is None else float(np.log(self.low))
        high = np.inf if self.high is None else float(np.log(self.high))
        return [(SumRows(chosen), (low, high, float(self.sigma)))]


class SumRows(NamedTuple):
    """The row of a `Sum`; its numbers are ln low, ln high and sigma."""

    chosen: Selection

    @property
    def size(self) -> int:
        """Number of rows."""
        return 1

    def rows(self, numbers: tuple[Array, Array, Array], leaves: list[Array], x: jax.Array) -> jax.Array:
        """The row of a scene, shape (1,)."""
        del x
        low, high, sigma = numbers
        log_sum = jnp.log(jnp.sum(self.chosen.of(leaves)))
        beyond = jnp.maximum(log_sum - high, 0.0) - jnp.maximum(low - log_sum, 0.0)
        return (beyond / sigma)[None]

    def moved(self, to: dict[int, int]) -> "SumRows":
        """The same of a scene whose leaves are elsewhere."""
        return SumRows(self.chosen.moved(to))
