"""Friction maps: quantities over velocity, pressure and temperature, however many points they have.

Points are computed in batches of one size (`rubberfric.analysis.maps.batches`), so that one compiled program serves them
all and memory holds two batches and the results. Those of a map with a file are written to it batch by
batch; an interrupted map goes on where it stopped (`rubberfric.analysis.maps.unfinished`).
"""

import contextlib
from typing import NamedTuple

import jax
import numpy as np

from rubberfric.analysis.maps import batches
from rubberfric.analysis.maps.unfinished import unfinished
from rubberfric.base.atomic import check_writable
from rubberfric.base.checks import as_leaf, closest
from rubberfric.base.quadrature import Quadrature
from rubberfric.io.results import Result, result_shape
from rubberfric.io.scene_files.conditions import Conditions, check_conditions
from rubberfric.scene.scene import result_dtype
from rubberfric.theory.model import check_heated, check_kinds, checked
from rubberfric.theory.quantities import Solution

# What a result file holds and `load_result` reads back, of arrays [temperature, pressure, velocity].
FrictionMap = Result

QUANTITIES = ("area", "friction")

# Bytes of results that are held in memory.
LARGEST = 2**28

_DEFAULT = Quadrature()


class Memory(NamedTuple):
    """Arrays that a process fills in: of a map with a file that the first process writes, none."""

    values: dict
    done: int = 0

    def reached(self, done):
        """Nothing to mark."""


def friction_map(
    scene,
    velocity,
    pressure,
    temperature=None,
    *,
    quantities=QUANTITIES,
    quadrature=_DEFAULT,
    progress=None,
    block=None,
    path=None,
    resume=False,
    title="",
    devices=None,
):
    """Quantities at every combination of velocity, pressure and temperature.

    The same numbers as `solve` at every point, computed on all devices. Of memory it takes the results, at
    most 256 MiB of them, and at most as much again for the programs of all devices of the process together
    (`rubberfric.analysis.maps.batches.MEMORY`; some 10 MB on a processor); what several pressures have in common, most of
    the work, is done once.

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, one-dimensional or a number [m/s], [Pa], [K]
        temperature None: every shift at its reference temperature.
    quantities : names of the fields of `Solution`
    quadrature : Quadrature, static
        The default is good to 1e-9; `rf.analysis.quadrature_for` finds a quicker one for less.
    progress : function of (points done, points in all), or None
        called before the first batch and after each.
    block : int, >= 1, or None
        points of a batch, at most, but one for each device; None: as suits the devices. The last is padded.
    path : result file (.h5) to write, whole or not at all, or None
        Its space is taken before the work begins. A map that is interrupted or killed after some seconds
        leaves what is done in the folder `path`.partial.
    resume : bool
        whether to go on with what such a map left there, if there is anything.
    title : what the map is called in its file and figure
    devices : sequence of JAX devices, or None
        None: all, of every process. Of several processes (`jax.distributed`) each makes this call.

    Returns
    -------
    FrictionMap : scene, conditions, solution, quadrature, title
        Fields of the solution are NumPy arrays [temperature, pressure, velocity], one temperature
        if there is none; None for what was not asked for. Beyond 256 MiB they are maps of the file
        at `path` into memory, to be read only. With a path, processes but the first get none.

    Raises
    ------
    ValueError : as `solve`; results beyond 256 MiB without a path; no space for the file; what an earlier
        map left is there without `resume`, or is of another map, cut off or in use.
    FloatingPointError : a quantity is not finite at a point.
    """
    quantities = _check(scene, quantities, quadrature, block)
    conditions, dtype = _conditions(scene, velocity, pressure, temperature)
    # All of them are checked; one of each is enough for what is left to check, without a copy.
    ready, _ = checked(
        scene, conditions.velocity[0], conditions.pressure[0], conditions.temperature, quadrature
    )
    check_heated(scene, quantities)
    dtypes = {name: np.dtype(bool) if name == "converged" else dtype for name in quantities}
    found = FrictionMap(scene, conditions, Solution(), quadrature, title)
    temperatures, pressures, velocities = shape = result_shape(conditions)
    size = batches.bytes_of(shape, dtypes.values())
    if path is None and size > LARGEST:
        raise ValueError(
            f"path is None: must name a file for the {size / 2**30:.3g} GiB of results, "
            f"of which memory holds {LARGEST / 2**30:.3g} GiB"
        )
    if path is None and resume:
        raise ValueError("resume is set, path is None: must name the file of the interrupted map")
    layout = batches.plan(
        temperatures * velocities, pressures, shared=scene.heating is None, block=block, devices=devices
    )
    work = (ready, conditions, {"quadrature": quadrature, "quantities": quantities})
    progress = progress or (lambda done, points: None)
    if path is None:
        values = {name: np.empty(shape, dtypes[name]) for name in quantities}
        _fill(Memory(values), layout, work, progress)
        return found._replace(solution=Solution(**values))
    with _writing(path, found, dtypes, layout.columns, resume) as part:
        _fill(part, layout, work, progress)
    if jax.process_index() > 0:
        return found
    values = part.arrays(path)
    if size <= LARGEST:
        values = {name: np.array(x) for name, x in values.items()}
    return found._replace(solution=Solution(**values))


@contextlib.contextmanager
def _writing(path, result, dtypes, columns, resume):
    """The `Unfinished` file of a map, which the first process has; all begin where it does."""
    if jax.process_index() > 0:
        done = batches.from_first(0)
        if done < 0:
            raise ValueError(f"{path}: cannot be written by the first process, which says why")
        yield Memory({}, done)
        return
    with contextlib.ExitStack() as stack:
        try:
            check_writable(path, (".h5",))
            part = stack.enter_context(unfinished(path, result, dtypes, columns, resume))
        except BaseException:
            batches.from_first(-1)  # or the others would wait
            raise
        batches.from_first(part.done)
        yield part


def _fill(part, layout, work, progress):
    """Compute what is not yet done of a map."""
    scene, conditions, options = work
    scene = batches.on_all(layout.mesh, scene)
    velocities = conditions.velocity.size
    layout = batches.fitted(layout, scene, conditions, options)
    points = layout.pairs * layout.pressures
    progress(layout.points(part.done), points)
    for batch, values in _computed(layout, scene, conditions, options, part.done):
        _check_finite(values, conditions, batch)
        T, v = np.divmod(np.arange(batch.first, batch.stop), velocities)
        for name, array in part.values.items():
            array[T, batch.low : batch.high, v] = values[name].T
        part.reached(batch.done)
        progress(layout.points(batch.done), points)


def _computed(layout, scene, conditions, options, done):
    """(batch, its values (pressures, pairs)) for one batch after the other."""
    waiting = None
    for batch in batches.batches(layout, done):
        # The next is begun before this one is read, so that devices need not wait for the host.
        begun = batch, batches.launch(layout, scene, conditions, batch, options)
        if waiting is not None:
            yield _read(*waiting)
        waiting = begun
    if waiting is not None:
        yield _read(*waiting)


def _read(batch, values):
    """A batch on the host, without its padding."""
    rows, pairs = slice(batch.high - batch.low), slice(batch.stop - batch.first)
    return batch, {name: np.asarray(x)[rows, pairs] for name, x in values.items()}


def _check_finite(values, conditions, batch):
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
    if block is not None and (isinstance(block, bool) or not isinstance(block, int) or block < 1):
        raise ValueError(f"block = {block!r}: must be an integer >= 1")
    return tuple(dict.fromkeys(quantities))
