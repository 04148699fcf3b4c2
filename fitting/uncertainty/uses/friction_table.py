"""A table of the fitted friction for other programs, with the error bars that the fit leaves it."""

from collections.abc import Sequence

import numpy as np

from fitting.uncertainty.intervals import SolvedProblem
from rubberfric.analysis import friction_table as table_of_scene
from rubberfric.io import FrictionTable

_LEVEL = 0.95


def friction_table(
    result: SolvedProblem,
    velocity: float | Sequence[float],
    pressure: float | Sequence[float],
    temperature: float | Sequence[float] | None = None,
    *,
    error: float = 0.01,
    title: str = "",
) -> FrictionTable:
    """mu(v, p, T) of a fit on a grid for multilinear interpolation, with a standard error at each point.

    Parameters
    ----------
    result : FitResult
    velocity, pressure, temperature, error, title : as for `rubberfric.analysis.friction_table`

    Returns
    -------
    FrictionTable with `sigma`, one standard error of mu, as half the width of `FitResult.band` says it

    Raises
    ------
    ValueError : as `rubberfric.analysis.friction_table`.
    """
    quadrature = result.problem.structure.quadrature
    table = table_of_scene(
        result.problem.scene(result.x),
        *(velocity, pressure, temperature),
        error=error,
        quadrature=quadrature,
        title=title,
    )
    T = None if table.temperature is None else table.temperature[:, None, None]
    band = result.band(table.velocity, table.pressure[:, None], T, level=_LEVEL)
    sigma = band.value * np.log(band.high / band.value) / result.quantile(_LEVEL)
    return table._replace(sigma=sigma.reshape(table.friction.shape))
