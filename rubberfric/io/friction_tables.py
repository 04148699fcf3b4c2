"""Tables of the friction coefficient over velocity, pressure and temperature.

Programs that read these tables interpolate linearly in v, p and T, and keep the end values outside the table.
"""

from typing import NamedTuple

import numpy as np
import scipy
from jax.typing import ArrayLike

from rubberfric.base.checks import NONNEGATIVE, check_increasing, check_values
from rubberfric.io.results import Curves, curves_of
from rubberfric.theory.structure import Solution

AXES = ("velocity", "pressure", "temperature")


class FrictionTable(NamedTuple):
    """Friction coefficient mu at every combination of velocity, pressure and temperature."""

    velocity: np.ndarray  # [m/s], increasing, shape (n,)
    pressure: np.ndarray  # [Pa], increasing, shape (m,)
    temperature: np.ndarray | None  # [K], increasing, shape (k,); None where nothing depends on it
    friction: np.ndarray  # [temperature, pressure, velocity], of length 1 along a missing temperature
    sigma: np.ndarray | None = None  # standard errors, like friction
    area: np.ndarray | None = None  # A/A0, like friction
    error: float | None = None  # largest relative interpolation error found
    title: str = ""

    def at(
        self, velocity: ArrayLike, pressure: ArrayLike, temperature: ArrayLike | None = None
    ) -> np.ndarray:
        """Interpolate mu linearly at velocities [m/s], pressures [Pa] and temperatures [K].

        The arguments broadcast. Beyond the ends of an axis, mu keeps the value at the end.
        """
        given = (self.temperature, temperature), (self.pressure, pressure), (self.velocity, velocity)
        known = [(axis, np.asarray(x, float)) for axis, x in given if axis is not None]
        shape = np.broadcast_shapes(*(x.shape for _, x in known))
        several = [(axis, np.clip(x, axis[0], axis[-1])) for axis, x in known if axis.size > 1]
        if not several:
            return np.full(shape, self.friction.item())
        interpolated = scipy.interpolate.RegularGridInterpolator(
            [axis for axis, _ in several], self.friction.squeeze()
        )
        return interpolated(np.stack([np.broadcast_to(x, shape) for _, x in several], -1)).reshape(shape)


def as_friction_table(
    source: object,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> FrictionTable:
    """Convert a FrictionTable, or a result with arguments as for `curves_of`, to a checked FrictionTable.

    A ValueError is raised for another `source`, no friction, an invalid axis, or mu < 0.
    """
    if isinstance(source, FrictionTable):
        table = source
    else:
        table = _from_curves(curves_of(source, velocity, pressure, temperature))
    for name in AXES:
        axis = getattr(table, name)
        if axis is not None:
            check_values(name, axis, NONNEGATIVE)  # the programs use |v|
            check_increasing(name, axis)
    check_values("friction", table.friction, NONNEGATIVE)
    return table


def _from_curves(result: Curves) -> FrictionTable:
    if result.solution.friction is None:
        raise ValueError("result must have friction; compute it first")
    v, p, T = result.conditions
    at = v, p[None, :, None], None if T is None else T[:, None, None]
    found = curves_of(Solution(area=result.solution.area, friction=result.solution.friction), *at)  # sorted
    area = None if found.solution.area is None else np.asarray(found.solution.area, float)
    friction = np.asarray(found.solution.friction, float)
    return FrictionTable(*found.conditions, friction, area=area, title=result.title)
