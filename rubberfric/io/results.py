"""Results: what came out of a scene, at what conditions, and how its quantities are named and written."""

from typing import NamedTuple

import numpy as np

from rubberfric.base.checks import is_concrete
from rubberfric.base.objects.html import count, folded, short, table, with_unit
from rubberfric.base.objects.physical import object_html
from rubberfric.base.quadrature import Quadrature
from rubberfric.io.scene_files.conditions import Conditions
from rubberfric.scene.scene import Scene
from rubberfric.theory.quantities import Solution


class Quantity(NamedTuple):
    """How a field of `Solution` is written."""

    unit: str  # SI, in files
    heading: str = ""  # of its column in a printed table; "": not there
    factor: float = 1.0  # from SI to the unit of that column


# In the order of a printed table.
QUANTITIES = {
    "area": Quantity("-", "A/A0 [-]"),
    "friction": Quantity("-", "mu [-]"),
    "separation": Quantity("m", "u_bar [um]", 1e6),
    "viscoelastic_friction": Quantity("-", "mu_visc [-]"),
    "shear_friction": Quantity("-", "mu_shear [-]"),
    "transverse_friction": Quantity("-", "mu_side [-]"),
    "flash_temperature": Quantity("K", "T_flash [K]"),
    "converged": Quantity("-"),
}
CONDITIONS = {"velocity": "m/s", "pressure": "Pa", "temperature": "K"}
# Axes of the arrays of a result.
DIMENSIONS = ("temperature", "pressure", "velocity")

# Elements beyond which the smallest and largest are not searched: the array may lie in a file.
_SEARCHED = 2**24


class Interpolation(NamedTuple):
    """How the quantities of a map were interpolated."""

    evaluations: int  # points at which the model was evaluated
    error: float  # largest relative difference from the model at points of the map where both are known [-]

    def __str__(self) -> str:
        return f"interpolated from {self.evaluations} points, to {self.error:.1e}"


class Result(NamedTuple):
    """Everything a result file holds."""

    scene: Scene
    conditions: Conditions
    solution: Solution  # arrays [temperature, pressure, velocity], None for what was not computed
    quadrature: Quadrature
    title: str = ""
    interpolation: Interpolation | None = None  # None: the model was evaluated at every point

    def _repr_html_(self) -> str:
        """Tables for notebooks: conditions, the range of every quantity, the scene."""
        conditions, quantities = (
            {name: values for name, values in record._asdict().items() if values is not None}
            for record in (self.conditions, self.solution)
        )
        rows = [
            *((name, with_unit(short(values), CONDITIONS[name])) for name, values in conditions.items()),
            f"smallest … largest ({' x '.join(DIMENSIONS)})",
            *(
                (name, with_unit(_range(values, name), QUANTITIES[name].unit))
                for name, values in quantities.items()
            ),
            *([] if self.interpolation is None else [("computed", str(self.interpolation))]),
        ]
        tables = [table(rows, caption=self.title or "Result"), folded("scene", object_html(self.scene))]
        return "\n".join(tables)


def result_shape(conditions: Conditions) -> tuple[int, int, int]:
    """Shape of the results: [temperature, pressure, velocity], one temperature if there is none."""
    temperatures = 1 if conditions.temperature is None else conditions.temperature.size
    return temperatures, conditions.pressure.size, conditions.velocity.size


def _range(values: np.ndarray, name: str) -> str:
    """The smallest and the largest value, and the shape."""
    if not is_concrete(values) or np.size(values) in (0, 1) or np.size(values) > _SEARCHED:
        return short(values)
    array = np.asarray(values)
    if name == "converged":
        return f"{np.count_nonzero(array)} of {array.size}"
    return f"{array.min():.6g} … {array.max():.6g} ({count(array.shape)})"
