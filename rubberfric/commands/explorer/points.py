"""Measured friction coefficients that are drawn with the curves.

The files have the same format as the tables of a fit.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from rubberfric.base.atomic import StrPath, as_path
from rubberfric.base.checks import shown
from rubberfric.io.results import Conditions, check_conditions, check_plausible_conditions
from rubberfric.io.tables import read_table
from rubberfric.scene.scene import Scene, takes_temperature

# Largest numbers of points and curves on a page.
MOST_POINTS, MOST_CURVES = 2000, 12


class MeasuredPoints(NamedTuple):
    """Measured friction coefficients, as arrays of shape (n,).

    A condition is None if a slider sets the condition.
    """

    path: Path
    velocity: np.ndarray  # [m/s]
    friction: np.ndarray  # [-]
    error: np.ndarray | None  # standard deviations [-]
    pressure: np.ndarray | None  # [Pa]
    temperature: np.ndarray | None  # [K]; None also if nothing depends on it
    content: bytes  # of the file


class Curve(NamedTuple):
    """Measured points at about the same pressure and temperature, which share one drawn curve."""

    pressure: float | None  # None: value of the slider
    temperature: float | None
    points: tuple[int, ...]  # indices


def read_points(path: StrPath, scene: Scene, conditions: Conditions) -> MeasuredPoints:
    """Read points from a table with v, mu and optionally p, T, and sigma or relative_sigma.

    Raises
    ------
    ValueError : an invalid table, or points at which the scene cannot be computed.
    """
    optional = ("p", "T", "sigma", "relative_sigma")
    table = read_table(path, ("v", "mu"), optional, increasing=False)
    if table["v"].size > MOST_POINTS:
        raise ValueError(f"{path}: has {table['v'].size} points: must have at most {MOST_POINTS}")
    if np.any(table["v"] <= 0):
        raise ValueError(f"{path}: v = {shown(table['v'].min())}: must be > 0 on a logarithmic axis")
    p, T = table.get("p"), table.get("T")
    if not takes_temperature(scene):
        T = None
    elif T is not None and conditions.temperature is None:
        raise ValueError(f"{path}: has temperatures, but [run] of the scene has none; add one")
    at = Conditions(
        table["v"],
        conditions.pressure if p is None else p,
        conditions.temperature if T is None else T,
    )
    check_conditions(f"{path}: ", at, scene)
    check_plausible_conditions(f"{path}: ", at)
    error = table.get("sigma")
    if error is None and "relative_sigma" in table:
        error = table["relative_sigma"] * np.abs(table["mu"])
    return MeasuredPoints(as_path(path), table["v"], table["mu"], error, p, T, as_path(path).read_bytes())


def group_points(measured: MeasuredPoints) -> list[Curve]:
    """Group measured points by pressure (within 1 %) and temperature (within 1 K).

    At most `MOST_CURVES` groups are returned, which are the largest groups.
    """
    size = measured.velocity.size
    p = np.zeros(size) if measured.pressure is None else np.round(np.log(measured.pressure) / 0.01)
    T = np.zeros(size) if measured.temperature is None else np.round(measured.temperature)
    sets, which = np.unique(np.stack([p, T], 1), axis=0, return_inverse=True)
    chosen = [np.flatnonzero(which.ravel() == i) for i in range(len(sets))]
    if len(chosen) > MOST_CURVES:
        largest = sorted(range(len(chosen)), key=lambda i: -chosen[i].size)[:MOST_CURVES]
        chosen = [chosen[i] for i in sorted(largest)]
    return [
        Curve(
            None if measured.pressure is None else float(np.median(measured.pressure[points])),
            None if measured.temperature is None else float(np.median(measured.temperature[points])),
            tuple(points.tolist()),
        )
        for points in chosen
    ]
