r"""A table of the friction coefficient over velocity, pressure and temperature, as other programs read it.

They interpolate it multilinearly in v, p and T themselves, not in their logarithms,

.. math:: \mu(v, p, T) = \sum_{ijk} w_i(v)\, w_j(p)\, w_k(T)\, \mu_{ijk}

with the hat functions w of each axis, and keep the value of the end beyond an end.
"""

from typing import NamedTuple

import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import check_increasing, check_values
from rubberfric.io.results import Curves, curves_of

AXES = ("velocity", "pressure", "temperature")


class FrictionTable(NamedTuple):
    """mu at every combination of velocity, pressure and temperature."""

    velocity: np.ndarray  # [m/s], increasing, shape (n,)
    pressure: np.ndarray  # [Pa], increasing, shape (m,)
    temperature: np.ndarray | None  # [K], increasing, shape (k,); None where nothing depends on it
    friction: np.ndarray  # [temperature, pressure, velocity]; one temperature if there is none
    sigma: np.ndarray | None = None  # standard error of each, of the same shape
    area: np.ndarray | None = None  # A/A0, of the same shape
    error: float | None = None  # largest relative error of the interpolation that was found
    title: str = ""

    def at(
        self, velocity: ArrayLike, pressure: ArrayLike, temperature: ArrayLike | None = None
    ) -> np.ndarray:
        """mu between the points as the programs have it; arguments broadcast [m/s], [Pa], [K]."""
        given = (velocity, pressure) if self.temperature is None else (velocity, pressure, temperature)
        points = np.broadcast_arrays(*(np.asarray(x, float) for x in given))
        shape, values = points[0].shape, self.friction
        flat = [x.ravel() for x in points]
        if self.temperature is None:
            values = np.broadcast_to(values[0], (flat[0].size, *values.shape[1:]))
        else:
            values = np.einsum("nt,tpv->npv", hats(self.temperature, flat[2]), values)
        values = np.einsum("np,npv->nv", hats(self.pressure, flat[1]), values)
        return np.einsum("nv,nv->n", hats(self.velocity, flat[0]), values).reshape(shape)


def hats(axis: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Weights of the points of an axis at x, shape (x.size, axis.size); constant beyond its ends."""
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
    """The table of a result, its axes sorted; a table as it is. Both checked.

    Arguments are those of `rubberfric.io.curves_of`.

    Raises
    ------
    ValueError : `source` is neither; it has no friction; a velocity or pressure <= 0 or twice there; a
        friction coefficient < 0, which no program takes.
    """
    if isinstance(source, FrictionTable):
        table = source
    else:
        table = _of_curves(curves_of(source, velocity, pressure, temperature))
    for name in AXES:
        axis = getattr(table, name)
        if axis is not None:
            # A table over -v and v would say twice what the programs ask once, for |v|.
            check_values(name, axis, ("must be >= 0", lambda x: x >= 0))
            check_increasing(name, axis)
    check_values("friction", table.friction, ("must be >= 0", lambda x: x >= 0))
    return table


def _of_curves(result: Curves) -> FrictionTable:
    if result.solution.friction is None:
        raise ValueError("result has no friction: must be computed")
    v, p, T = result.conditions
    orders = [np.array([0]) if axis is None else np.argsort(axis) for axis in (T, p, v)]
    rows, area = np.ix_(*orders), result.solution.area
    return FrictionTable(
        np.asarray(v, float)[orders[2]],
        np.asarray(p, float)[orders[1]],
        None if T is None else np.asarray(T, float)[orders[0]],
        np.asarray(result.solution.friction, float)[rows],
        area=None if area is None else np.asarray(area, float)[rows],
        title=result.title,
    )
