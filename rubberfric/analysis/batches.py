"""Batches of a friction map: points that one compiled function computes together, on all devices.

A map is a grid of pressures and of pairs (temperature, velocity). Most of the work, the angular means of the
stiffness and g(q), depends on the pair alone. A batch combines all its pairs with all its pressures and does
this work once per pair. The pairs are distributed over the devices, and each device evaluates a group of
pairs at a time, as many as fit its fast memory.
"""

import functools
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental.multihost_utils import process_allgather
from jax.sharding import AxisType, NamedSharding, PartitionSpec

from rubberfric.base.quadrature import Quadrature
from rubberfric.io.results import Conditions
from rubberfric.scene.scene import Scene
from rubberfric.theory.integrals import evaluate, prepare

# Points of a batch on one device of a platform, enough to make the overhead of a call negligible.
BATCH = {"cpu": 2**13}
# Points of a batch on one device of another platform, which evaluates many more points at once.
_BATCH_ELSEWHERE = 2**18
# Points evaluated at once on a CPU core, so few that the 300 nodes in q of their pairs stay in its cache.
_AT_ONCE = 256
# Points evaluated at once on another device, enough to occupy it.
_AT_ONCE_ELSEWHERE = 2**14
# Fewest pairs evaluated at once on a CPU core, also with more pressures than `_PRESSURES`.
_FEWEST_PAIRS = 4
# Most pairs evaluated at once on a CPU core, also with a single pressure. More nodes would leave its cache.
_MOST_PAIRS = 16

# Pressures of a batch, enough to make the cost per pair small. The number does not depend on the devices, and
# neither does the order of the results.
_PRESSURES = 64
# Points that a batch of few pairs reaches by taking more pressures.
_FEWEST_POINTS = 1024

# Up to this many batches are made equally large. Longer maps share one compiled function.
_FEW = 8

MEMORY = 2**28  # bytes that the compiled functions of all devices of a process may hold

_POINTS = "points"
_EVERYWHERE = PartitionSpec()  # one copy on every device


class Task(NamedTuple):
    """Quantities to compute at every combination of the conditions."""

    scene: Scene
    conditions: Conditions
    quadrature: Quadrature
    quantities: tuple[str, ...]


class Tiling(NamedTuple):
    """Division of a map into batches."""

    pairs: int  # of the map
    pressures: int
    columns: int  # pressures of a batch
    group: int  # pairs that a device evaluates at once
    groups: int  # groups per device and batch
    mesh: jax.sharding.Mesh

    @property
    def batch(self) -> int:
        """Number of pairs in a batch, over all devices."""
        return self.group * self.groups * self.mesh.size


class MapBatch(NamedTuple):
    """A batch of a map: pairs from `first` to `stop` - 1, and pressures from `low` to `high` - 1."""

    first: int
    stop: int
    low: int
    high: int

    @property
    def size(self) -> int:
        """Number of points."""
        return (self.stop - self.first) * (self.high - self.low)

    def pieces(self, velocities: int) -> Iterator[tuple[slice, slice, slice]]:
        """Yield each rectangle as slices of temperatures and velocities of the map and pairs of the batch."""
        first = self.first
        while first < self.stop:
            T, v = divmod(first, velocities)
            rows = 1 if v else max((self.stop - first) // velocities, 1)
            count = min(rows * velocities - v, self.stop - first)
            begin = first - self.first
            yield slice(T, T + rows), slice(v, v + count // rows), slice(begin, begin + count)
            first += count


def plan(
    pairs: int,
    pressures: int,
    *,
    shared: bool = True,
    block: int | None = None,
    devices: Sequence[jax.Device] | None = None,  # pyright: ignore[reportInvalidTypeForm]: a class
) -> Tiling:
    """Divide a map of `pairs` and `pressures` into batches.

    Parameters
    ----------
    shared : True if the pressures share work
    block : largest number of points of a batch, at least one per device; None: chosen for the devices
    devices : sequence of JAX devices; None: all devices of all processes
    """
    devices = jax.devices() if devices is None else list(devices)
    mesh = jax.make_mesh((len(devices),), (_POINTS,), axis_types=(AxisType.Auto,), devices=devices)
    platform = devices[0].platform
    most = block or BATCH.get(platform, _BATCH_ELSEWHERE) * len(devices)
    columns = max(_PRESSURES, _FEWEST_POINTS // pairs) if shared else 1
    columns = columns if block is None else min(block, columns)
    columns = -(-pressures // -(-pressures // columns))  # nearly equal numbers
    local = max(1, min(most // columns, pairs) // len(devices))
    at_once = max(_FEWEST_PAIRS, min(_MOST_PAIRS, _AT_ONCE // columns)), max(1, _AT_ONCE_ELSEWHERE // columns)
    group = min(at_once[platform != "cpu"], local)
    groups = local // group
    count = -(-pairs // (group * groups * len(devices)))
    if count <= _FEW:
        # Nearly equal batches: padding the last one would cost time.
        groups = -(-pairs // (group * len(devices) * count))
    return Tiling(pairs, pressures, columns, group, groups, mesh)


def smaller(tiling: Tiling) -> Tiling | None:
    """Return a tiling with half as many pairs evaluated at once, or None if only one pair is left."""
    if tiling.group == 1:
        return None
    group = tiling.group // 2
    return tiling._replace(group=group, groups=tiling.groups * tiling.group // group)


def batches(tiling: Tiling) -> Iterator[MapBatch]:
    """Yield the batches: all pairs (T, v) at the first pressures, then all pairs at the next pressures."""
    for low in range(0, tiling.pressures, tiling.columns):
        high = min(low + tiling.columns, tiling.pressures)
        for first in range(0, tiling.pairs, tiling.batch):
            yield MapBatch(first, min(first + tiling.batch, tiling.pairs), low, high)


def fitted(tiling: Tiling, task: Task) -> Tiling:
    """Reduce the tiling until the compiled function stays within `MEMORY`."""
    local = sum(device.process_index == jax.process_index() for device in tiling.mesh.devices.flat)
    while program_bytes(tiling, task) > MEMORY / local and (less := smaller(tiling)):
        tiling = less
    return tiling


def program_bytes(tiling: Tiling, task: Task) -> int:
    """Return the bytes that the compiled function holds on one device, with arguments and results."""
    arguments, static = _arguments(tiling, task, next(batches(tiling)))
    # JAX keeps the compiled function for the calls that follow.
    memory = _evaluate.lower(*arguments, **static).compile().memory_analysis()
    if memory is None:
        return 0  # the device does not say
    return memory.temp_size_in_bytes + memory.argument_size_in_bytes + memory.output_size_in_bytes


def launch(tiling: Tiling, task: Task, batch: MapBatch) -> dict[str, jax.Array]:
    """Start a batch, and return a dict of arrays (pressures, pairs), padded to a full batch."""
    arguments, static = _arguments(tiling, task, batch)
    return _evaluate(*arguments, **static)


def points(conditions: Conditions, batch: MapBatch) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Return velocities of the pairs of a batch, its pressures, and temperatures of the pairs or None."""
    T, v = np.divmod(np.arange(batch.first, batch.stop), conditions.velocity.size)
    temperature = None if conditions.temperature is None else conditions.temperature[T]
    return conditions.velocity[v], conditions.pressure[batch.low : batch.high], temperature


def on_all(mesh: jax.sharding.Mesh, tree: Any, spec: PartitionSpec = _EVERYWHERE) -> Any:
    """Put arrays, which every process must hold, on all devices."""
    sharding = NamedSharding(mesh, spec)

    def put(x):
        x = np.asarray(x)
        return jax.make_array_from_callback(x.shape, sharding, lambda index: x[index])

    return jax.tree.map(put, tree)


def all_ready(ready: bool) -> bool:
    """Return True if every process, each of which must call this function, is ready."""
    return bool(np.all(process_allgather(np.array(ready))))


def _arguments(tiling, task, batch):
    # The last pair and pressure are repeated, so that all batches have one shape.
    sizes = tiling.batch, tiling.columns, tiling.batch
    velocity, pressure, temperature = (
        None if x is None else np.pad(x, (0, size - x.size), mode="edge")
        for x, size in zip(points(task.conditions, batch), sizes, strict=True)
    )
    velocity, temperature = on_all(tiling.mesh, (velocity, temperature), PartitionSpec(_POINTS))
    static = {"quadrature": task.quadrature, "quantities": task.quantities, "group": tiling.group}
    arguments = (task.scene, velocity, on_all(tiling.mesh, pressure), temperature)
    return arguments, static | {"mesh": tiling.mesh}


@functools.partial(jax.jit, static_argnames=("mesh", "group", "quadrature", "quantities"))
def _evaluate(scene, velocity, pressure, temperature, *, mesh, group, quadrature, quantities):
    """Compute a dict of quantities, as arrays of shape (pressures, pairs)."""
    several = jax.process_count() > 1

    def share(scene, velocity, pressure, temperature):
        ready = prepare(scene, quantities, quadrature)
        found_at = functools.partial(
            _point_by_point if ready.stiffness_by_pressure else _shared, ready, quantities, pressure
        )
        pairs = [None if x is None else x.reshape(-1, group) for x in (velocity, temperature)]
        results = jax.lax.map(found_at, pairs)
        results = {name: jnp.swapaxes(x, 0, 1).reshape(pressure.size, -1) for name, x in results.items()}
        # Every process checks all results, and the first one writes them.
        gather = functools.partial(jax.lax.all_gather, axis_name=_POINTS, axis=1, tiled=True)
        return jax.tree.map(gather, results) if several else results

    across = PartitionSpec(_POINTS)
    return jax.shard_map(
        share,
        mesh=mesh,
        in_specs=(_EVERYWHERE, across, _EVERYWHERE, across),
        out_specs=_EVERYWHERE if several else PartitionSpec(None, _POINTS),
        # The check rejects the constant initial values of the temperature loops.
        check_vma=False,
    )(scene, velocity, pressure, temperature)


def _shared(ready, quantities, pressure, pairs):
    """Compute (pressures, pairs), where work independent of the pressure is done once."""
    velocity, temperature = pairs

    def at(pressure):
        conditions = [velocity, jnp.full_like(velocity, pressure), temperature]
        return evaluate(ready, quantities, [x for x in conditions if x is not None])

    return jax.vmap(at)(pressure)


def _point_by_point(ready, quantities, pressure, pairs):
    """Compute (pressures, pairs) if the stiffness depends on the pressure."""
    shape = pressure.size, pairs[0].size
    conditions = (jnp.broadcast_to(x, shape).reshape(-1) for x in (pairs[0], pressure[:, None], pairs[1]))
    results = evaluate(ready, quantities, list(conditions))
    return {name: x.reshape(shape) for name, x in results.items()}
