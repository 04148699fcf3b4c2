"""Friction maps: quantities over velocity, pressure and temperature, however many points they have.

A map that collapses onto one curve is read off that curve (`rubberfric.analysis.maps.collapse`). Points of
others are computed in batches of one size (`rubberfric.analysis.maps.batches`), so that one compiled
program serves them all and memory holds two batches and the results. Those of a map with a file are
written to it batch by batch; it appears when the last is done.
"""

import contextlib
import functools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import h5py
import jax
import numpy as np
from jax.typing import ArrayLike

from rubberfric.analysis.maps import batches, collapse
from rubberfric.base.atomic import StrPath, check_writable
from rubberfric.base.checks import as_leaf, closest
from rubberfric.base.quadrature import Quadrature
from rubberfric.io.files import filling_result, mapped_quantities, write_interpolation
from rubberfric.io.results import Conditions, Interpolation, Result, check_conditions, result_shape
from rubberfric.scene.numerics.settings import ROBUST, fitting_quadrature
from rubberfric.scene.scene import Scene, result_dtype
from rubberfric.theory.arguments import check_heated, check_kinds, checked
from rubberfric.theory.quantities import Solution

# What a result file holds and `load_result` reads back, of arrays [temperature, pressure, velocity].
FrictionMap = Result

DEFAULT_QUANTITIES = ("area", "friction")

# Bytes of results that are held in memory.
LARGEST = 2**28

# Points of a batch where a map is interpolated, from few: whole panels of pairs, and not many more.
_FEW_POINTS, _FEWEST_PAIRS, _MOST_PAIRS = 2048, 48, 240

Values = Mapping[str, np.ndarray | h5py.Dataset]
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
    """Quantities at every combination of velocity, pressure and temperature.

    The numbers of `solve` at every point, computed on all devices. A large map of a scene without heat, where
    velocity and temperature enter as v a_T alone, is interpolated to 2e-10, below the error of the default
    quadrature, from some hundred to thousand points (`rubberfric.analysis.maps.collapse`); where series do
    not fall fast enough for that, each point is computed. Of memory it takes the results, at
    most 256 MiB of them, and at most as much again for the programs of all devices of the process together
    (`MEMORY` in `rubberfric.analysis.maps.batches`; some 10 MB on a processor); what several pressures have
    in common, most of the work, is done once.

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, one-dimensional or a number [m/s], [Pa], [K]
        temperature None: every shift at its reference temperature.
    quantities : names of the fields of `Solution`
    quadrature : Quadrature, static, or None
        None: that which fits the scene, good to 1e-9, and found in the result; `rf.analysis.quadrature_for`
        finds a quicker one for less.
    progress : function of (points done, points in all), or None
        called before the first batch and after each.
    block : int, >= 1, or None
        points of a batch, at most, but one for each device; None: as suits the devices. The last is padded.
    path : result file (.h5) to write, whole or not at all, or None
        Its space is taken before the work begins.
    title : what the map is called in its file and figure
    devices : sequence of JAX devices, or None
        None: all, of every process. Of several processes (`jax.distributed`) each makes this call.
    interpolate : bool
        False: the model is evaluated at every point.

    Returns
    -------
    FrictionMap : scene, conditions, solution, quadrature, title, interpolation
        interpolation is None if every point was computed, else says from how many points and how well.
        Fields of the solution are NumPy arrays [temperature, pressure, velocity], one temperature
        if there is none; None for what was not asked for. Beyond 256 MiB they are maps of the file
        at `path` into memory, to be read only. With a path, processes but the first get none.

    Raises
    ------
    ValueError : as `solve`; results beyond 256 MiB without a path; no space for the file.
    FloatingPointError : a quantity is not finite at a point.
    """
    quantities = _check(scene, quantities, ROBUST if quadrature is None else quadrature, block)
    conditions, dtype = _conditions(scene, velocity, pressure, temperature)
    if quadrature is None:
        separated = "separation" in quantities
        quadrature = fitting_quadrature(scene, conditions.pressure, separation=separated)
    # All of them are checked; one of each is enough for what is left to check, without a copy.
    ready, _ = checked(
        scene, conditions.velocity[0], conditions.pressure[0], conditions.temperature, quadrature
    )
    check_heated(scene, quantities)
    dtypes = {name: np.dtype(bool) if name == "converged" else dtype for name in quantities}
    found = FrictionMap(scene, conditions, Solution(), quadrature, title)
    shape = result_shape(conditions)
    size = math.prod(shape) * sum(x.itemsize for x in dtypes.values())
    if path is None and size > LARGEST:
        raise ValueError(
            f"path is None: must name a file for the {size / 2**30:.3g} GiB of results, "
            f"of which memory holds {LARGEST / 2**30:.3g} GiB"
        )
    task = batches.Task(ready, conditions, quadrature, quantities)
    work = functools.partial(_fill, task=task, devices=devices, block=block, interpolate=interpolate)
    if path is None:
        values = {name: np.empty(shape, dtypes[name]) for name in quantities}
        interpolation = work(values, progress)
    else:
        with _file(path, found, dtypes) as data:
            interpolation = work(data, progress)
            write_interpolation(data, interpolation)
        if jax.process_index() > 0:
            return found
        values = mapped_quantities(path)
        if size <= LARGEST:
            values = {name: np.array(x) for name, x in values.items()}
    return found._replace(solution=Solution(**values), interpolation=interpolation)


@contextlib.contextmanager
def _file(path: StrPath, result: Result, dtypes: Mapping[str, np.dtype]) -> Iterator[dict[str, h5py.Dataset]]:
    """The quantities in the file of a map, which the first process has; all begin when it does."""
    with contextlib.ExitStack() as stack:
        data: dict[str, h5py.Dataset] = {}
        if jax.process_index() == 0:
            try:
                check_writable(path, (".h5",))
                data = stack.enter_context(filling_result(path, result, dtypes))
            except BaseException:
                batches.all_ready(False)  # or the others would wait
                raise
        if not batches.all_ready(True):
            raise ValueError(f"{path}: cannot be written by the first process, which says why")
        yield data


def _fill(data: Values, progress, task, devices, block, interpolate) -> Interpolation | None:
    """Compute a map, arrays [temperature, pressure, velocity]; how it was interpolated, if it was."""
    shape = result_shape(task.conditions)
    done, points = 0, math.prod(shape)
    tell = progress or (lambda *_: None)
    # Series need all digits, and every process all of them.
    if interpolate and task.conditions.velocity.dtype == np.float64 and jax.process_count() == 1:
        curve = collapse.curve(task.scene, task.conditions, task.quantities, _model(task, devices))
        if curve is not None:
            tell(0, points)
            for T, j, piece in collapse.pieces(curve, task.conditions):
                for name, array in data.items():
                    array[T, j] = piece[name]
                done += (T.stop - T.start) * shape[2]
                tell(done, points)
            return curve.interpolation
    shared = task.scene.heating is None
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


def _model(task: batches.Task, devices) -> collapse.Model:
    """The quantities of a scene at conditions, [temperature, pressure, velocity]."""
    tiling = None

    def model(quantities: tuple[str, ...], conditions: Conditions) -> Arrays:
        nonlocal task, tiling
        shape = result_shape(conditions)
        here = task._replace(conditions=conditions, quantities=quantities)
        if tiling is None:
            # One program serves all calls: they have the pressures of the first, or fewer.
            pairs = min(max(_FEWEST_PAIRS, _FEW_POINTS // shape[1]), _MOST_PAIRS)
            tiling = batches.plan(pairs, shape[1], block=pairs * shape[1], devices=devices)
            task = task._replace(scene=batches.on_all(tiling.mesh, task.scene))
            here = here._replace(scene=task.scene)
            tiling = batches.fitted(tiling._replace(pairs=shape[0] * shape[2]), here)
        at = tiling._replace(pairs=shape[0] * shape[2], pressures=shape[1])
        values = {name: np.empty(shape) for name in quantities}
        for batch, found in _computed(at, here):
            _place(values, conditions, batch, found)
        return values

    return model


def _place(data: Values, conditions: Conditions, batch: batches.Batch, values: Arrays) -> None:
    """Values of a batch, (pressures, pairs), where they belong."""
    for T, v, pairs in batch.pieces(conditions.velocity.size):
        for name, array in data.items():
            piece = values[name][:, pairs].reshape(batch.high - batch.low, T.stop - T.start, -1)
            array[T, batch.low : batch.high, v] = piece.swapaxes(0, 1)


def _computed(tiling: batches.Tiling, task: batches.Task) -> Iterator[tuple[batches.Batch, Arrays]]:
    """(batch, its values (pressures, pairs) on the host) for one batch after the other."""
    begun = ((batch, batches.launch(tiling, task, batch)) for batch in batches.batches(tiling))
    one = next(begun, None)
    while one is not None:
        # The next is begun before this one is read, so that devices need not wait for the host.
        (batch, values), one = one, next(begun, None)
        rows, pairs = slice(batch.high - batch.low), slice(batch.stop - batch.first)
        yield batch, {name: np.asarray(x)[rows, pairs] for name, x in values.items()}


def _check_finite(values: Arrays, conditions: Conditions, batch: batches.Batch) -> None:
    """FloatingPointError that names the first point of a batch where a quantity is not finite."""
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
    """Conditions, checked, and the dtype that they and the results have."""
    given = {"velocity": velocity, "pressure": pressure}
    if temperature is not None:
        given["temperature"] = temperature
    leaves = {name: as_leaf(name, values, np.ndim(values)) for name, values in given.items()}
    # Before they become arrays: a plain number's precision yields to that of the scene.
    dtype = np.dtype(result_dtype(scene, *leaves.values()))
    arrays = {name: np.atleast_1d(values).astype(dtype) for name, values in leaves.items()}
    conditions = Conditions(arrays["velocity"], arrays["pressure"], arrays.get("temperature"))
    check_conditions("", conditions, scene)
    return conditions, dtype


def _check(scene, quantities, quadrature, block):
    """The quantities as a tuple; ValueError for an argument that has no meaning."""
    quantities = (quantities,) if isinstance(quantities, str) else tuple(quantities)
    for name in quantities:
        if name not in Solution._fields:
            raise ValueError(f"quantities has {name!r}: {closest(name, Solution._fields)}")
    if not quantities:
        raise ValueError("quantities is empty: must have at least one")
    check_kinds(scene, quadrature)
    if block is not None and (isinstance(block, bool) or not isinstance(block, int) or block < 1):
        raise ValueError(f"block = {block!r}: must be an integer >= 1")
    return tuple(dict.fromkeys(quantities))
