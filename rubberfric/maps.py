"""Friction maps: quantities over velocity, pressure and temperature, however many points they have.

Points are computed in batches of one size, so that one compiled program serves them all and memory
holds one batch and the results; results beyond `LARGEST` are written to their file batch by batch,
and stay there.
"""

import math

import numpy as np

from rubberfric._atomic import check_writable
from rubberfric._pytree import as_leaf
from rubberfric.conditions import Conditions, check_conditions
from rubberfric.model import Solution, check_kinds, solve
from rubberfric.quadrature import Quadrature
from rubberfric.results import Result, create_quantity, creating_result, result_shape, save_result
from rubberfric.scene import result_dtype
from rubberfric.tables import closest

# What a result file holds and `load_result` reads back, of arrays [temperature, pressure, velocity].
FrictionMap = Result

QUANTITIES = ("area", "friction")

# Points of a batch: enough that what a call costs beside its points does not count.
BLOCK = 4096

# Bytes of results that are held in memory.
LARGEST = 2**28

_DEFAULT = Quadrature()


def friction_map(
    scene,
    velocity,
    pressure,
    temperature=None,
    *,
    quantities=QUANTITIES,
    quadrature=_DEFAULT,
    progress=None,
    block=BLOCK,
    path=None,
    title="",
):
    """Quantities at every combination of velocity, pressure and temperature.

    The same numbers as `solve` at every point, in the memory of one batch (some 10 MB with the
    default block and quadrature) and of the results, at most 256 MiB of which are held.

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, one-dimensional or a number [m/s], [Pa], [K]
        temperature None: every shift at its reference temperature.
    quantities : names of the fields of `Solution`
    quadrature : Quadrature, static
        The default is good to 1e-9; `Quadrature.for_error` finds a quicker one for less.
    progress : function of (points done, points in all), or None
        called before the first batch and after each.
    block : int, >= 1
        points of a batch; the last is padded to it.
    path : result file (.h5) to write, whole or not at all, or None
    title : what the map is called in its file and figure

    Returns
    -------
    FrictionMap : scene, conditions, solution, quadrature, title
        Fields of the solution are NumPy arrays [temperature, pressure, velocity], one temperature
        if there is none; None for what was not asked for. Beyond 256 MiB they are maps of the file
        at `path` into memory, to be read only.

    Raises
    ------
    ValueError : as `solve`; results beyond 256 MiB without a path.
    FloatingPointError : a quantity is not finite at a point.
    """
    quantities = _check(scene, quantities, quadrature, block)
    conditions, dtype = _conditions(scene, velocity, pressure, temperature)
    if path is not None:
        check_writable(path, (".h5",))
    shape = result_shape(conditions)
    found = FrictionMap(scene, conditions, Solution(), quadrature, title)
    batches = _batches(found, quantities, block, progress or (lambda done, points: None))

    size = len(quantities) * math.prod(shape) * dtype.itemsize
    if size > LARGEST:
        if path is None:
            raise ValueError(
                f"path is None: must name a file for the {size / 2**30:.3g} GiB of results, "
                f"of which memory holds {LARGEST / 2**30:.3g} GiB"
            )
        return found._replace(solution=_streamed(path, found, quantities, dtype, batches))
    values = {name: np.empty(shape, dtype) for name in quantities}
    for start, batch in batches:
        for name, part in batch.items():
            values[name].reshape(-1)[start : start + part.size] = part
    found = found._replace(solution=Solution(**values))
    if path is not None:
        save_result(path, found)
    return found


def _batches(result, quantities, block, progress):
    """(index of its first point, values of every quantity) for one batch of a map after the other."""
    shape = result_shape(result.conditions)
    points = math.prod(shape)
    block = min(block, points)
    progress(0, points)
    for start in range(0, points, block):
        stop = min(start + block, points)
        # The last point pads the last batch, so that every batch has one shape.
        at = _points(result.conditions, shape, np.minimum(np.arange(start, start + block), points - 1))
        solution = solve(result.scene, *at, quadrature=result.quadrature, quantities=quantities)
        batch = {name: np.asarray(getattr(solution, name))[: stop - start] for name in quantities}
        for name, values in batch.items():
            bad = np.flatnonzero(~np.isfinite(values))
            if bad.size:
                named = zip(Conditions._fields, at, strict=True)
                where = ", ".join(f"{axis} = {x[bad[0]]:g}" for axis, x in named if x is not None)
                raise FloatingPointError(f"{name} = {values[bad[0]]} at {where}: not finite")
        yield start, batch
        progress(stop, points)


def _points(conditions, shape, index):
    """Velocity, pressure and temperature of the points of an index into the flat map."""
    T, p, v = np.unravel_index(index, shape)
    temperature = None if conditions.temperature is None else conditions.temperature[T]
    return conditions.velocity[v], conditions.pressure[p], temperature


def _streamed(path, result, quantities, dtype, batches):
    """Write a map batch by batch; its Solution, arrays that stay in the file."""
    shape = result_shape(result.conditions)
    with creating_result(path, result) as file:
        data = {name: create_quantity(file, name, shape, dtype) for name in quantities}
        for start, batch in batches:
            for name, part in batch.items():
                for box, first, stop in _boxes(shape, start, start + part.size):
                    piece = part[first - start : stop - start]
                    data[name][box] = piece.reshape(-1, *shape[len(box) :])
        offsets = {name: dataset.id.get_offset() for name, dataset in data.items()}
    # A dataset without chunks lies in its file in one piece, as an array lies in memory.
    return Solution(**{name: np.memmap(path, dtype, "r", offset, shape) for name, offset in offsets.items()})


def _boxes(shape, start, stop):
    """(box, first, end): the few slices that hold the points start ... stop of an array in C order."""
    row = math.prod(shape[1:])
    while start < stop:
        i, within = divmod(start, row)
        if within == 0 and stop - start >= row:
            end = stop - stop % row
            yield (slice(i, end // row),), start, end
        else:
            end = min(stop, (i + 1) * row)
            for box, first, last in _boxes(shape[1:], within, within + end - start):
                yield (i, *box), i * row + first, i * row + last
        start = end


def _conditions(scene, velocity, pressure, temperature):
    """Conditions, checked, and the dtype that they and the results have."""
    given = Conditions(velocity, pressure, temperature)
    leaves = Conditions(
        *(
            None if name == "temperature" and values is None else as_leaf(name, values, np.ndim(values))
            for name, values in given._asdict().items()
        )
    )
    # Before they become arrays: a plain number's precision yields to that of the scene.
    dtype = np.dtype(result_dtype(scene, *leaves))
    conditions = Conditions(*(None if x is None else np.atleast_1d(x).astype(dtype) for x in leaves))
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
    if isinstance(block, bool) or not isinstance(block, int) or block < 1:
        raise ValueError(f"block = {block!r}: must be an integer >= 1")
    return tuple(dict.fromkeys(quantities))
