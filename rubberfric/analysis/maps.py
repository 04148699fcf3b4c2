"""Friction maps: quantities over velocity, pressure and temperature, with any number of points.

A map that collapses is interpolated along one curve (`rubberfric.analysis.collapse`). All others are computed
in batches of one size (`rubberfric.analysis.batches`): one compiled function serves all batches, and memory
holds two batches and the results. With a file, results are written batch by batch, and the file appears when
the last batch is done.
"""

import contextlib
import functools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import h5py
import jax
import numpy as np

from rubberfric.analysis import batches, collapse
from rubberfric.base.atomic import StrPath, check_writable
from rubberfric.base.checks import ArrayLike, as_leaf, closest
from rubberfric.base.quadrature import Quadrature
from rubberfric.io.files import filling_result, mapped_quantities, write_interpolation
from rubberfric.io.results import Conditions, Interpolation, Result, check_conditions, result_shape
from rubberfric.scene.scene import Scene, result_dtype, temperature_by_scale
from rubberfric.scene.settings import ROBUST, default_quadrature
from rubberfric.theory.arguments import check_kinds, check_quantities, checked_arguments
from rubberfric.theory.structure import Solution

# Arrays are [temperature, pressure, velocity], as in result files.
FrictionMap = Result

DEFAULT_QUANTITIES = ("area", "friction")

MOST_IN_MEMORY = 2**28  # bytes of results held in memory

# Points of a batch when a map is interpolated, divided by the number of pressures to give the pairs.
_FEW_POINTS = 2048
# Fewest pairs of such a batch: two panels of the interpolation.
_FEWEST_PAIRS = 48
# Most pairs of such a batch: ten panels. Few panels are halved, and they would not fill a larger batch.
_MOST_PAIRS = 240

_Values = Mapping[str, np.ndarray | h5py.Dataset]
Arrays = dict[str, np.ndarray]


def friction_map(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    quantities: str | Iterable[str] = DEFAULT_QUANTITIES,
    quadrature: Quadrature | None = None,
    progress: Callable[[int, int], object] | None = None,
    block: int | None = None,
    path: StrPath | None = None,
    title: str = "",
    devices: Sequence[jax.Device] | None = None,  # pyright: ignore[reportInvalidTypeForm]: a class
    interpolate: bool = True,
) -> FrictionMap:
    """Compute quantities at every combination of velocity, pressure and temperature.

    The values equal the results of `solve` and are computed on all devices. Work that several pressures share
    is done once. A large map of a scene without heating, in which velocity and temperature enter as v a_T
    alone, is interpolated from some hundred to thousand points (`rubberfric.analysis.collapse`). The error is
    2e-10, less than the error of the default quadrature. If the series converge too slowly, each point is
    computed.

    Memory holds at most 256 MiB of results and at most as much for the compiled functions of all devices of
    the process (`MEMORY` in `rubberfric.analysis.batches`; about 10 MB on a CPU).

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, one-dimensional or a number [m/s], [Pa], [K]
        temperature None: every shift at its reference temperature.
    quantities : names of the fields of `Solution`
    quadrature : Quadrature, static, or None
        None: chosen for the scene with an error < 1e-9, and returned in the result.
        `rf.analysis.quadrature_for` finds a cheaper one for larger errors.
    progress : function of (points done, all points), or None
        called before the first batch and after each batch.
    block : int, >= 1, or None
        largest number of points of a batch, with at least one per device; None: chosen for the devices.
    path : result file (.h5), or None
        written completely or not at all. Disk space is reserved before the work begins.
    title : title of the map in the file and in the figure
    devices : sequence of JAX devices, or None
        None: all devices of every process. Each process must make this call (`jax.distributed`).
    interpolate : bool
        False: the model is evaluated at every point.

    Returns
    -------
    FrictionMap : scene, conditions, solution, quadrature, title, interpolation
        interpolation has the number of evaluations and the error, or is None if every point was computed.
        Fields of the solution are NumPy arrays [temperature, pressure, velocity], with one temperature if
        none is given, and None if they were not requested. Beyond 256 MiB they are read-only memory maps of
        the file at `path`. With a path, only the first process gets the arrays.

    Raises
    ------
    ValueError : as `solve`; results beyond 256 MiB without a path; no space for the file.
    FloatingPointError : a quantity is not finite at a point.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> table = rf.friction_map(scene, np.logspace(-6, 1, 50), [0.1e6, 0.2e6])
    >>> table.solution.friction.shape  # temperatures, pressures, velocities
    (1, 2, 50)
    """
    quantities = _check(scene, quantities, ROBUST if quadrature is None else quadrature, block)
    conditions, dtype = _conditions(scene, velocity, pressure, temperature)
    if quadrature is None:
        separated = "separation" in quantities
        quadrature = default_quadrature(scene, conditions.pressure, separation=separated)
    # The conditions are checked; one value of each is enough for the other checks, without a copy.
    ready, _ = checked_arguments(
        scene, conditions.velocity[0], conditions.pressure[0], conditions.temperature, quadrature
    )
    check_quantities(scene, quantities)
    dtypes = {name: np.dtype(bool) if name == "converged" else dtype for name in quantities}
    empty_map = FrictionMap(scene, conditions, Solution(), quadrature, title)
    shape = result_shape(conditions)
    size = math.prod(shape) * sum(x.itemsize for x in dtypes.values())
    if path is None and size > MOST_IN_MEMORY:
        raise ValueError(
            f"path is None, but the results take {size / 2**30:.3g} GiB and memory holds "
            f"{MOST_IN_MEMORY / 2**30:.3g} GiB; give the path of a file"
        )
    task = batches.Task(ready, conditions, quadrature, quantities)
    work = functools.partial(_fill, task=task, devices=devices, block=block, interpolate=interpolate)
    if path is None:
        values = {name: np.empty(shape, dtypes[name]) for name in quantities}
        interpolation = work(values, progress)
    else:
        with _file(path, empty_map, dtypes) as data:
            interpolation = work(data, progress)
            write_interpolation(data, interpolation)
        if jax.process_index() > 0:
            return empty_map
        values = mapped_quantities(path)
        if size <= MOST_IN_MEMORY:
            values = {name: np.array(x) for name, x in values.items()}
    return empty_map._replace(solution=Solution(**values), interpolation=interpolation)


@contextlib.contextmanager
def _file(path: StrPath, result: Result, dtypes: Mapping[str, np.dtype]) -> Iterator[dict[str, h5py.Dataset]]:
    """Open the file of a map, and yield a dict of its datasets in the first process, {} in others."""
    with contextlib.ExitStack() as stack:
        data: dict[str, h5py.Dataset] = {}
        if jax.process_index() == 0:
            try:
                check_writable(path, (".h5",))
                data = stack.enter_context(filling_result(path, result, dtypes))
            except BaseException:
                batches.all_ready(False)  # the others would wait forever
                raise
        if not batches.all_ready(True):
            raise ValueError(f"{path}: cannot be written by the first process; see its message")
        yield data


def _fill(data: _Values, progress, task, devices, block, interpolate) -> Interpolation | None:
    """Write a map into arrays [temperature, pressure, velocity]; return an `Interpolation` or None."""
    shape = result_shape(task.conditions)
    done, points = 0, math.prod(shape)
    tell = progress or (lambda *_: None)
    # Series need double precision, and one process.
    if interpolate and task.conditions.velocity.dtype == np.float64 and jax.process_count() == 1:
        collapsed = collapse.collapse(task.scene, task.conditions, task.quantities, _model(task, devices))
        if collapsed is not None:
            tell(0, points)
            for T, p, piece in collapse.pieces(collapsed, task.conditions):
                for name, array in data.items():
                    array[T, p] = piece[name]
                done += (T.stop - T.start) * (p.stop - p.start) * shape[2]
                tell(done, points)
            return collapsed.interpolation
    shared = not temperature_by_scale(task.scene)
    tiling = batches.plan(shape[0] * shape[2], shape[1], shared=shared, block=block, devices=devices)
    task = task._replace(scene=batches.on_all(tiling.mesh, task.scene))
    tiling = batches.fitted(tiling, task)
    tell(0, points)
    for batch, values in _computed(tiling, task):
        _check_finite(values, task.conditions, batch)
        _place(data, task.conditions, batch, values)
        done += batch.size
        tell(done, points)
    return None


def _model(task: batches.Task, devices) -> collapse.MapModel:
    tiling = None

    def model(quantities: tuple[str, ...], conditions: Conditions) -> Arrays:
        nonlocal task, tiling
        shape = result_shape(conditions)
        here = task._replace(conditions=conditions, quantities=quantities)
        if tiling is None:
            # One compiled function serves all calls: none has more pressures than the first.
            pairs = min(max(_FEWEST_PAIRS, _FEW_POINTS // shape[1]), _MOST_PAIRS)
            tiling = batches.plan(pairs, shape[1], block=pairs * shape[1], devices=devices)
            task = task._replace(scene=batches.on_all(tiling.mesh, task.scene))
            here = here._replace(scene=task.scene)
            tiling = batches.fitted(tiling._replace(pairs=shape[0] * shape[2]), here)
        at = tiling._replace(pairs=shape[0] * shape[2], pressures=shape[1])
        values = {name: np.empty(shape) for name in quantities}
        for batch, results in _computed(at, here):
            _place(values, conditions, batch, results)
        return values

    return model


def _place(data: _Values, conditions: Conditions, batch: batches.MapBatch, values: Arrays) -> None:
    """Write the values of a batch, which have the shape (pressures, pairs), into the map."""
    for T, v, pairs in batch.pieces(conditions.velocity.size):
        for name, array in data.items():
            piece = values[name][:, pairs].reshape(batch.high - batch.low, T.stop - T.start, -1)
            array[T, batch.low : batch.high, v] = piece.swapaxes(0, 1)


def _computed(tiling: batches.Tiling, task: batches.Task) -> Iterator[tuple[batches.MapBatch, Arrays]]:
    """Yield each batch and a dict of its values as NumPy arrays of shape (pressures, pairs)."""
    begun = ((batch, batches.launch(tiling, task, batch)) for batch in batches.batches(tiling))
    launched = next(begun, None)
    while launched is not None:
        # Launch the next batch before reading this one, so that devices do not wait for the host.
        (batch, values), launched = launched, next(begun, None)
        rows, pairs = slice(batch.high - batch.low), slice(batch.stop - batch.first)
        yield batch, {name: np.asarray(x)[rows, pairs] for name, x in values.items()}


def _check_finite(values: Arrays, conditions: Conditions, batch: batches.MapBatch) -> None:
    """Raise FloatingPointError at the first point of a batch where a quantity is not finite."""
    for name, array in values.items():
        bad = np.argwhere(~np.isfinite(array))
        if bad.size:
            row, pair = bad[0]
            velocity, pressure, temperature = batches.points(conditions, batch)
            at = (velocity[pair], pressure[row], None if temperature is None else temperature[pair])
            named = zip(Conditions._fields, at, strict=True)
            where = ", ".join(f"{axis} = {x:g}" for axis, x in named if x is not None)
            raise FloatingPointError(f"{name} = {array[row, pair]} at {where}: not finite")


def _conditions(scene, velocity, pressure, temperature):
    arguments = {"velocity": velocity, "pressure": pressure}
    if temperature is not None:
        arguments["temperature"] = temperature
    leaves = {name: as_leaf(name, values, np.ndim(values)) for name, values in arguments.items()}
    # From the arguments as given: a plain number takes the precision of the scene.
    dtype = np.dtype(result_dtype(scene, *leaves.values()))
    arrays = {name: np.atleast_1d(values).astype(dtype) for name, values in leaves.items()}
    conditions = Conditions(arrays["velocity"], arrays["pressure"], arrays.get("temperature"))
    check_conditions("", conditions, scene)
    return conditions, dtype


def _check(scene, quantities, quadrature, block):
    quantities = (quantities,) if isinstance(quantities, str) else tuple(quantities)
    for name in quantities:
        if name not in Solution._fields:
            raise ValueError(f"quantities has {name!r}: {closest(name, Solution._fields)}")
    if not quantities:
        raise ValueError("quantities is empty; name at least one")
    check_kinds(scene, quadrature)
    if block is not None and (isinstance(block, bool) or not isinstance(block, int) or block < 1):
        raise ValueError(f"block = {block!r}: must be an integer >= 1")
    return tuple(dict.fromkeys(quantities))
