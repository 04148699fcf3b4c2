"""Conditions to compute a scene at: the tables [run] and [map] of a scene file.

::

    [run]
    velocity = { from = 1e-6, to = 1e2, points = 50 }   # [m/s]
    pressure = 0.15e6                                   # [Pa]
    temperature = [283.15, 293.15]                      # [K], optional

    [map]                                               # optional, for friction maps: the same keys
    ...

Each is a number, a list of numbers, or a range with both ends: points equally far apart, in the
logarithm for velocity and pressure, in the temperature itself.
"""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rubberfric.base.checks import shown
from rubberfric.io.toml import check_keys, number
from rubberfric.scene.scene import Scene, check_background, shifts, takes_temperature

# Tables of a scene file that hold conditions.
TABLES = ("run", "map")


class Conditions(NamedTuple):
    """Conditions to compute at; the results have shape [temperature, pressure, velocity]."""

    velocity: np.ndarray  # [m/s], shape (n,)
    pressure: np.ndarray  # [Pa], shape (m,)
    temperature: np.ndarray | None  # [K], shape (k,); None where nothing depends on it

    def grid(self) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Velocity, pressure and temperature that broadcast to [temperature, pressure, velocity]."""
        T = self.temperature
        return self.velocity, self.pressure[:, None], None if T is None else T[:, None, None]


class SceneFile(NamedTuple):
    """What a scene file says: the scene, and conditions and title if it has them."""

    scene: Scene
    conditions: Conditions | None
    title: str


def check_conditions(where: str, conditions: Conditions, scene: Scene) -> None:
    """Raise ValueError for conditions that the scene cannot be computed at; `where` begins its line."""
    rules = {
        "velocity": (np.isfinite, "must be finite"),
        "pressure": (lambda p: np.isfinite(p) & (p > 0), "must be > 0 and finite"),
        "temperature": (lambda T: np.isfinite(T) & (T > 0), "must be > 0 and finite"),
    }
    for name, (test, rule) in rules.items():
        values = getattr(conditions, name)
        if values is None:
            continue
        if values.ndim != 1 or values.size == 0:
            raise ValueError(f"{where}{name} has shape {values.shape}: must be one number or a list of them")
        bad = np.flatnonzero(~test(values))
        if bad.size:
            raise ValueError(f"{where}{name}[{bad[0]}] = {values[bad[0]]}: {rule}")
    if conditions.temperature is None:
        check_background(scene, where)
        return
    if not takes_temperature(scene):
        raise ValueError(
            f"{where}temperature = {conditions.temperature[0]}: "
            "must be absent, for nothing in the scene has a shift"
        )
    for shift in shifts(scene):
        try:
            shift.check_temperature(conditions.temperature)
        except ValueError as error:
            raise ValueError(f"{where}{error}") from None


def read_conditions(path: Path, table: str, content: Any, scene: Scene) -> Conditions:
    """The conditions of the TOML table named `table` of the file `path`, checked against the scene."""
    check_keys(path, table, content, Conditions._fields, needed=("velocity", "pressure"))
    values: dict[str, Any] = dict.fromkeys(Conditions._fields)
    for name, value in content.items():
        key = f"{table}.{name}"
        if isinstance(value, dict):
            values[name] = _range(path, key, value, np.linspace if name == "temperature" else np.geomspace)
        else:
            values[name] = np.atleast_1d(np.array(number(path, key, value), float))
    conditions = Conditions(**values)
    check_conditions(f"{path}: {table}.", conditions, scene)
    return conditions


def _range(path, key, content, spaced):
    """{ from, to, points }: as many points, ends included, spread by `spaced`."""
    check_keys(path, key, content, ("from", "to", "points"), needed=("from", "to", "points"))
    low, high = (number(path, f"{key}.{name}", content[name]) for name in ("from", "to"))
    points = content["points"]
    if isinstance(low, list) or not 0 < low < math.inf:
        raise ValueError(f"{path}: {key}.from = {shown(low)}: must be > 0 and finite")
    if isinstance(high, list) or not low < high < math.inf:
        raise ValueError(f"{path}: {key}.to = {shown(high)}: must be > from = {low:g} and finite")
    if not isinstance(points, int) or isinstance(points, bool) or not 2 <= points <= 100_000:
        raise ValueError(f"{path}: {key}.points = {shown(points)}: must be an integer, 2 to 100000")
    return spaced(low, high, points)
