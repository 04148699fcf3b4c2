"""Results: what came out of a scene, at what conditions, and how its quantities are named and written."""

from typing import NamedTuple

import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import is_concrete, shown
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


class Curves(NamedTuple):
    """Quantities over their conditions, without the scene: what pictures and tables need of a result."""

    conditions: Conditions
    solution: Solution  # arrays [temperature, pressure, velocity], None for what was not computed
    title: str = ""


def curves_of(
    found: object,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
    quantity: str = "friction",
) -> Curves:
    """What was found, of `friction_map`, a file, `solve` or `friction`, over its conditions.

    Parameters
    ----------
    found : Result or Curves; or a Solution, or the array of one quantity
        a Solution and an array do not know at what they were computed: it must be given.
    velocity, pressure, temperature : as they were given to `solve`, [m/s], [Pa], [K]
    quantity : what an array is

    Raises
    ------
    ValueError : conditions of what has its own, or none of what has none; ones that do not broadcast to
        the shape of what was found, or are not every combination of their values, each once.
    """
    given = {"velocity": velocity, "pressure": pressure, "temperature": temperature}
    if isinstance(found, Result | Curves):
        for name, values in given.items():
            if values is not None:
                raise ValueError(f"{name} = {shown(values)}: must not be given; the result has its own")
        return Curves(found.conditions, found.solution, found.title)
    solution = _solution(found, quantity)
    for name in ("velocity", "pressure"):
        if given[name] is None:
            raise ValueError(
                f"{name} is missing: must be given beside what solve and friction return, as to them"
            )
    return _on_a_grid(solution, given)


def _solution(found: object, quantity: str) -> Solution:
    if isinstance(found, Solution):
        return found
    try:
        return Solution(**{quantity: np.asarray(found, float)})
    except (TypeError, ValueError):
        raise ValueError(
            f"result is a {type(found).__name__}: must be a Result, as friction_map gives it, or what"
            " solve or friction return"
        ) from None


def _on_a_grid(solution: Solution, given: dict[str, ArrayLike | None]) -> Curves:
    """A solution as arrays [temperature, pressure, velocity], its axes sorted."""
    arrays = {name: np.asarray(x) for name, x in solution._asdict().items() if x is not None}
    known = {name: np.asarray(x, float) for name, x in given.items() if x is not None}
    try:
        shape = np.broadcast_shapes(*(x.shape for x in known.values()))
        flat = [np.broadcast_to(x, shape).ravel() for x in known.values()]
        if any(x.shape != shape for x in arrays.values()):
            raise ValueError
    except ValueError:
        shapes = ", ".join(f"{name} has {x.shape}" for name, x in known.items())
        result = " and ".join({str(x.shape) for x in arrays.values()})
        raise ValueError(f"shapes differ ({shapes}, the result {result}): must broadcast to it") from None
    axes, places = zip(*(np.unique(x, return_inverse=True) for x in reversed(flat)), strict=True)
    size, count = tuple(axis.size for axis in axes), flat[0].size
    if np.unique(np.ravel_multi_index(places, size)).size != count or count != np.prod(size):
        raise ValueError(
            f"the result has {count} points, not every combination of its {' x '.join(map(str, size))}"
            f" values of {', '.join(reversed([*known]))}: must have, as friction_map computes them"
        )

    def ordered(values):
        grid = np.empty(size, values.dtype)
        grid[places] = values.ravel()
        return grid if len(size) == 3 else grid[None]

    T, p, v = (None, *axes) if len(axes) == 2 else axes
    return Curves(Conditions(v, p, T), Solution(**{name: ordered(x) for name, x in arrays.items()}))


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
