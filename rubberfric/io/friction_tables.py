r"""Tables of the friction coefficient over velocity, pressure and temperature.

Programs that read these tables interpolate linearly in v, p and T, and keep the end values outside the table,

.. math:: \mu(v, p, T) = \sum_{ijk} w_i(v)\, w_j(p)\, w_k(T)\, \mu_{ijk}

with the hat functions w of each axis.
"""

from typing import NamedTuple

import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import NONNEGATIVE, check_increasing, check_values
from rubberfric.io.results import Curves, curves_of

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
        given = (velocity, pressure) if self.temperature is None else (velocity, pressure, temperature)
        points = np.broadcast_arrays(*(np.asarray(x, float) for x in given))
        v, p, *T = (x.ravel() for x in points)
        weights = np.ones((v.size, 1)) if self.temperature is None else hats(self.temperature, T[0])
        values = np.einsum("nt,tpv->npv", weights, self.friction)
        values = np.einsum("np,npv->nv", hats(self.pressure, p), values)
        return np.einsum("nv,nv->n", hats(self.velocity, v), values).reshape(points[0].shape)


def hats(axis: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the weights of linear interpolation from the points of an axis to `x`.

    The weights have shape (x.size, axis.size). Beyond the ends of the axis they are constant.
    """
    weights = np.zeros((x.size, axis.size))
    if axis.size == 1:
        return weights + 1.0
    low = np.clip(np.searchsorted(axis, x, side="right") - 1, 0, axis.size - 2)
    part = np.clip((x - axis[low]) / (axis[low + 1] - axis[low]), 0.0, 1.0)
    rows = np.arange(x.size)
    weights[rows, low], weights[rows, low + 1] = 1.0 - part, part
    return weights


def as_friction_table(
    source: object,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
) -> FrictionTable:
    """Convert a FrictionTable or a result to a checked FrictionTable.

    The axes of a result are sorted first. The arguments are as for `rubberfric.io.curves_of`.

    Raises
    ------
    ValueError : another `source`, no friction, an axis that is negative or not increasing, or mu < 0
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
    orders = [np.array([0]) if axis is None else np.argsort(axis) for axis in (T, p, v)]
    grid, area = np.ix_(*orders), result.solution.area
    return FrictionTable(
        np.asarray(v, float)[orders[2]],
        np.asarray(p, float)[orders[1]],
        None if T is None else np.asarray(T, float)[orders[0]],
        np.asarray(result.solution.friction, float)[grid],
        area=None if area is None else np.asarray(area, float)[grid],
        title=result.title,
    )
