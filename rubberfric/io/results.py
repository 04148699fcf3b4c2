"""Conditions of computations, results at these conditions, and tables of friction for other programs.

Programs that read these tables interpolate linearly in v, p and T, and keep the end values outside the table.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import scipy

from rubberfric.base.checks import NONNEGATIVE, ArrayLike, check_increasing, check_values, is_concrete, shown
from rubberfric.base.objects.html import count, folded, short, table, with_unit
from rubberfric.base.objects.labelled import LabelledArrays
from rubberfric.base.objects.physical import object_html
from rubberfric.base.quadrature import Quadrature
from rubberfric.scene.scene import Scene, check_background, shifts, takes_temperature
from rubberfric.theory.structure import CONDITION_UNITS, SOLUTION_UNITS, Solution


class Quantity(NamedTuple):
    """Unit and heading of a field of `Solution`."""

    unit: str  # in files, SI
    heading: str = ""  # of the column in a printed table; "": not printed
    factor: float = 1.0  # from SI to the unit of the column


# In the order of a printed table.
QUANTITY_FORMATS = {
    name: Quantity(SOLUTION_UNITS[name], *heading)
    for name, heading in {
        "area": ("A/A0 [-]",),
        "friction": ("mu [-]",),
        "separation": ("u_bar [um]", 1e6),
        "viscoelastic_friction": ("mu_visc [-]",),
        "shear_friction": ("mu_shear [-]",),
        "transverse_friction": ("mu_side [-]",),
        "flash_temperature": ("T_flash [K]",),
        "converged": (),
    }.items()
}
# Axes of a table of friction.
AXES = ("velocity", "pressure", "temperature")
# Axes of the arrays of a result.
DIMENSIONS = ("temperature", "pressure", "velocity")

# The range of larger arrays is not shown because they may lie in a file.
_SEARCHED = 2**24


class Conditions(NamedTuple):
    """Conditions of a computation, whose results have the shape [temperature, pressure, velocity]."""

    velocity: np.ndarray  # [m/s], shape (n,)
    pressure: np.ndarray  # [Pa], shape (m,)
    temperature: np.ndarray | None  # [K], shape (k,); None where nothing depends on it

    def grid(self) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Return (velocity, pressure, temperature) that broadcast to [temperature, pressure, velocity]."""
        T = self.temperature
        return self.velocity, self.pressure[:, None], None if T is None else T[:, None, None]


class SceneFile(NamedTuple):
    """Contents of a scene file."""

    scene: Scene
    conditions: Conditions | None
    title: str


def default_conditions(scene: Scene) -> Conditions:
    """Return default conditions: 1e-6 ... 10 m/s, 0.2 MPa, and a temperature if the scene needs one.

    The temperature is the reference temperature of the first shift, or 20 °C for heating without a shift.
    """
    first = [float(shift.reference_temperature) for shift in shifts(scene)[:1]]
    temperature = np.array(first or [293.15]) if takes_temperature(scene) else None
    return Conditions(np.geomspace(1e-6, 10.0, 29), np.array([2e5]), temperature)


def conditions_text(conditions: Conditions) -> str:
    """Return the ranges of conditions as one line of text."""
    return ", ".join(
        f"{name} {x.min():.6g}" + (f" ... {x.max():.6g}" if x.size > 1 else "") + f" {CONDITION_UNITS[name]}"
        for name, x in conditions._asdict().items()
        if x is not None
    )


class Interpolation(NamedTuple):
    """Number of evaluations and error of an interpolated map."""

    evaluations: int  # points at which the model was evaluated
    error: float  # largest relative difference from the model at points of the map [-]

    def __str__(self) -> str:
        return f"interpolated from {self.evaluations} points, to {self.error:.1e}"


class Curves(NamedTuple):
    """Quantities with the conditions at which they were computed, for plots and tables.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> v = np.array([1e-3, 1e-2])
    >>> curves = rf.io.curves_of(rf.solve(scene, v, 0.15e6, quantities=("friction",)), v, 0.15e6)
    >>> curves.to_dataframe().round(3)
       velocity [m/s]  pressure [Pa]  friction [-]
    0           0.001       150000.0         0.071
    1           0.010       150000.0         0.083
    >>> dict(curves.to_xarray().sizes)
    {'temperature': 1, 'pressure': 1, 'velocity': 2}
    """

    conditions: Conditions
    solution: Solution  # arrays [temperature, pressure, velocity]; None: not computed
    title: str = ""

    def to_dataframe(self) -> Any:
        """Return a pandas.DataFrame with a row for each point. Raise ImportError without pandas."""
        return _labelled(self).to_dataframe()

    def to_xarray(self) -> Any:
        """Return an xarray.Dataset over temperature, pressure, velocity. Raise ImportError without xarray."""
        return _labelled(self).to_xarray()


class Result(NamedTuple):
    """Contents of a result file.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> table = rf.friction_map(scene, [1e-3, 1e-2, 1e-1], [0.15e6, 0.3e6])
    >>> table.solution.friction.shape  # temperature, pressure, velocity
    (1, 2, 3)
    >>> table.to_dataframe().shape, list(table.to_dataframe())
    ((6, 4), ['velocity [m/s]', 'pressure [Pa]', 'area [-]', 'friction [-]'])
    >>> dict(table.to_xarray().sizes)
    {'temperature': 1, 'pressure': 2, 'velocity': 3}
    """

    scene: Scene
    conditions: Conditions
    solution: Solution  # arrays [temperature, pressure, velocity]; None: not computed
    quadrature: Quadrature
    title: str = ""
    interpolation: Interpolation | None = None  # None: the model was evaluated at every point

    def to_dataframe(self) -> Any:
        """Return a pandas.DataFrame with a row for each point. Raise ImportError without pandas."""
        return _labelled(self).to_dataframe()

    def to_xarray(self) -> Any:
        """Return an xarray.Dataset over temperature, pressure, velocity. Raise ImportError without xarray."""
        return _labelled(self).to_xarray()

    def _repr_html_(self) -> str:
        conditions, quantities = (
            {name: values for name, values in record._asdict().items() if values is not None}
            for record in (self.conditions, self.solution)
        )
        rows = [
            *((name, with_unit(short(values), CONDITION_UNITS[name])) for name, values in conditions.items()),
            f"smallest … largest ({' x '.join(DIMENSIONS)})",
            *(
                (name, with_unit(_range(x, name), QUANTITY_FORMATS[name].unit))
                for name, x in quantities.items()
            ),
            *([] if self.interpolation is None else [("computed", str(self.interpolation))]),
        ]
        tables = [table(rows, caption=self.title or "Result"), folded("scene", object_html(self.scene))]
        return "\n".join(tables)


def _labelled(result: Curves | Result) -> LabelledArrays:
    arrays = result.solution.labelled(*result.conditions.grid(), axes=DIMENSIONS)
    return arrays._replace(attributes={"title": result.title} if result.title else {})


def check_conditions(where: str, conditions: Conditions, scene: Scene) -> None:
    """Raise ValueError, beginning with `where`, if conditions are invalid for the scene."""
    for name, values in conditions._asdict().items():
        if values is None:
            continue
        if values.ndim != 1 or values.size == 0:
            raise ValueError(f"{where}{name} has shape {values.shape}: must be one number or a list of them")
        signed = name == "velocity"
        bad = np.flatnonzero(~(np.isfinite(values) & (signed | (values > 0))))
        if bad.size:
            rule = "must be finite" if signed else "must be > 0 and finite"
            raise ValueError(f"{where}{name}[{bad[0]}] = {values[bad[0]]}: {rule}")
    if conditions.temperature is None:
        check_background(scene, where)
        return
    if not takes_temperature(scene):
        T = conditions.temperature[0]
        raise ValueError(f"{where}temperature = {T}: must be absent because nothing in the scene has a shift")
    for shift in shifts(scene):
        try:
            shift.check_temperature(conditions.temperature)
        except ValueError as error:
            raise ValueError(f"{where}{error}") from None


def check_plausible(where: str, doubts: Iterable[str]) -> None:
    """Raise ValueError with the first text about a value that is probably not in SI units."""
    for text in doubts:
        raise ValueError(f"{where}{text} plausible = false at the top of the file accepts it")


def curves_of(
    result: object,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
    quantity: str = "friction",
) -> Curves:
    """Convert a result of `friction_map`, `solve` or `friction` to quantities with their conditions.

    Parameters
    ----------
    result : Result, Curves, Solution, or the array of one quantity
    velocity, pressure, temperature : arguments of `solve` or `friction` [m/s], [Pa], [K]
        They must be given for a Solution or an array, and omitted for a Result or Curves.
    quantity : name of the quantity in an array

    Raises
    ------
    ValueError : conditions are missing or superfluous, do not broadcast to the shape of the quantities, or do
        not contain every combination of their values once

    Examples
    --------
    >>> v, T = np.array([1e-3, 1e-2, 1e-1]), np.array([[273.15], [293.15]])
    >>> mu = np.array([[0.9, 1.1, 1.0], [0.7, 0.9, 1.1]])
    >>> curves = rf.io.curves_of(mu, v, 2e5, T)
    >>> curves.solution.friction.shape, curves.conditions.temperature  # temperature, pressure, velocity
    ((2, 1, 3), array([273.15, 293.15]))
    """
    conditions = {"velocity": velocity, "pressure": pressure, "temperature": temperature}
    if isinstance(result, Result | Curves):
        for name, values in conditions.items():
            if values is not None:
                raise ValueError(f"{name} = {shown(values)}: must not be given because the result has it")
        return Curves(result.conditions, result.solution, result.title)
    if not isinstance(result, Solution):
        try:
            result = Solution(**{quantity: np.asarray(result, float)})
        except (TypeError, ValueError):
            kind = type(result).__name__
            raise ValueError(f"result must come from friction_map, solve or friction, got {kind}") from None
    for name in ("velocity", "pressure"):
        if conditions[name] is None:
            raise ValueError(f"{name} is missing: must be given as to solve and friction")
    return _on_a_grid(result, conditions)


def _on_a_grid(solution: Solution, conditions: dict[str, ArrayLike | None]) -> Curves:
    """Convert a solution to arrays of shape [temperature, pressure, velocity] with sorted axes."""
    arrays = {name: np.asarray(x) for name, x in solution._asdict().items() if x is not None}
    known = {name: np.asarray(x, float) for name, x in conditions.items() if x is not None}
    try:
        shape = np.broadcast_shapes(*(x.shape for x in known.values()))
        flat = [np.broadcast_to(x, shape).ravel() for x in known.values()]
        if any(x.shape != shape for x in arrays.values()):
            raise ValueError
    except ValueError:
        shapes = ", ".join(f"{name} has {x.shape}" for name, x in known.items())
        result = " and ".join({str(x.shape) for x in arrays.values()})
        raise ValueError(
            f"{shapes}, but the result has {result}: the conditions must broadcast to its shape"
        ) from None
    axes, places = zip(*(np.unique(x, return_inverse=True) for x in reversed(flat)), strict=True)
    size, points = tuple(axis.size for axis in axes), flat[0].size
    if np.unique(np.ravel_multi_index(places, size)).size != points or points != np.prod(size):
        raise ValueError(
            f"result has {points} points for {' x '.join(map(str, size))} values of"
            f" {', '.join(reversed([*known]))}: must have every combination once, as from friction_map"
        )

    def ordered(values):
        grid = np.empty(size, values.dtype)
        grid[places] = values.ravel()
        return grid if len(size) == 3 else grid[None]

    T, p, v = (None, *axes) if len(axes) == 2 else axes
    return Curves(Conditions(v, p, T), Solution(**{name: ordered(x) for name, x in arrays.items()}))


def result_shape(conditions: Conditions) -> tuple[int, int, int]:
    """Return the shape [temperature, pressure, velocity] of results, with 1 for no temperatures."""
    temperatures = 1 if conditions.temperature is None else conditions.temperature.size
    return temperatures, conditions.pressure.size, conditions.velocity.size


def _range(values: np.ndarray, name: str) -> str:
    if not is_concrete(values) or np.size(values) in (0, 1) or np.size(values) > _SEARCHED:
        return short(values)
    array = np.asarray(values)
    if name == "converged":
        return f"{np.count_nonzero(array)} of {array.size}"
    return f"{array.min():.6g} … {array.max():.6g} ({count(array.shape)})"


# --- tables of friction


class FrictionTable(NamedTuple):
    """Friction coefficient mu at every combination of velocity, pressure and temperature.

    Examples
    --------
    >>> table = rf.io.FrictionTable(np.array([0.01, 0.02]), np.array([2e5]), None, np.array([[[0.5, 0.6]]]))
    >>> table.at([0.015, 0.1], 2e5).round(6)
    array([0.55, 0.6 ])
    """

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
        axes = (self.temperature, temperature), (self.pressure, pressure), (self.velocity, velocity)
        known = [(axis, np.asarray(x, float)) for axis, x in axes if axis is not None]
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
    curves = curves_of(Solution(area=result.solution.area, friction=result.solution.friction), *at)  # sorted
    area = None if curves.solution.area is None else np.asarray(curves.solution.area, float)
    friction = np.asarray(curves.solution.friction, float)
    return FrictionTable(*curves.conditions, friction, area=area, title=result.title)
