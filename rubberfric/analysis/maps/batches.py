"""Batches of a friction map: which points one compiled program computes together, on every device.

A map is a grid of pressures and of pairs (temperature, velocity). Most of the work, the angular means
of the stiffness and g(q), depends on the pair alone: a batch is all its pairs at all its pressures, and
does that part once. Pairs are shared out to the devices, and each device takes them a few at a time,
as many as its fast memory holds.
"""

import functools
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, NamedSharding, PartitionSpec

from rubberfric.base.quadrature import Quadrature
from rubberfric.io.results import Conditions
from rubberfric.scene.scene import Scene
from rubberfric.theory.integrals import evaluate, prepare

# Points of a batch: enough that what a call costs beside its points does not count. A processor core
# takes few pairs at once, whose 300 nodes in q stay in its cache; any other device as many as it can.
BLOCK = {"cpu": 2**13}
_BLOCK_ELSEWHERE = 2**18
_AT_ONCE, _AT_ONCE_ELSEWHERE = 256, 2**14
_FEWEST, _MOST = 4, 16  # pairs at once on a processor core

# Pressures of a batch: beside so many, what a pair costs by itself is little. With fewer pairs than this
# many points more, else a batch would be small. Both depend on the map alone, and so does the order.
_PRESSURES, _LEAST = 64, 1024

# Batches up to which their size is that of the map; of more, one program serves maps of any size.
_FEW = 8

# Bytes that the programs of all devices of a process may hold.
MEMORY = 2**28

_POINTS = "points"
_EVERYWHERE = PartitionSpec()  # one copy on every device


class Task(NamedTuple):
    """What to compute: quantities at every combination of the conditions."""

    scene: Scene
    conditions: Conditions
    quadrature: Quadrature
    quantities: tuple[str, ...]


class Tiling(NamedTuple):
    """How a map is cut into batches."""

    pairs: int  # of the map, in all
    pressures: int
    columns: int  # pressures of a batch
    group: int  # pairs that a device evaluates at once
    groups: int  # of them on every device in a batch
    mesh: jax.sharding.Mesh

    @property
    def batch(self) -> int:
        """Pairs of a batch."""
        return self.group * self.groups * self.mesh.size


class Batch(NamedTuple):
    """The pairs first ... stop at the pressures low ... high."""

    first: int
    stop: int
    low: int
    high: int

    @property
    def size(self) -> int:
        """Points."""
        return (self.stop - self.first) * (self.high - self.low)

    def pieces(self, velocities: int) -> Iterator[tuple[slice, slice, slice]]:
        """Its rectangles in a map of so many velocities: temperatures, velocities, pairs of the batch."""
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
    """Tiling of a map of so many pairs and pressures.

    Parameters
    ----------
    shared : whether pressures have work in common
    block : points of a batch, at most, but one for each device; None: as suits the devices
    devices : sequence of jax devices; None: all there are, of all processes
    """
    devices = jax.devices() if devices is None else list(devices)
    mesh = jax.make_mesh((len(devices),), (_POINTS,), axis_types=(AxisType.Auto,), devices=devices)
    platform = devices[0].platform
    most = block or BLOCK.get(platform, _BLOCK_ELSEWHERE) * len(devices)
    columns = max(_PRESSURES, _LEAST // pairs) if shared else 1
    columns = columns if block is None else min(block, columns)
    columns = -(-pressures // -(-pressures // columns))  # sets of one size, as nearly as can be
    local = max(1, min(most // columns, pairs) // len(devices))
    at_once = max(_FEWEST, min(_MOST, _AT_ONCE // columns)), max(1, _AT_ONCE_ELSEWHERE // columns)
    group = min(at_once[platform != "cpu"], local)
    groups = local // group
    count = -(-pairs // (group * groups * len(devices)))
    if count <= _FEW:
        # Of one size, as nearly as can be: padding the last would count.
        groups = -(-pairs // (group * len(devices) * count))
    return Tiling(pairs, pressures, columns, group, groups, mesh)


def smaller(tiling: Tiling) -> Tiling | None:
    """The tiling that takes half as many pairs at once; None if it takes one."""
    if tiling.group == 1:
        return None
    group = tiling.group // 2
    return tiling._replace(group=group, groups=tiling.groups * tiling.group // group)


def batches(tiling: Tiling) -> Iterator[Batch]:
    """Every batch: all pairs at the first pressures, then all pairs at the next."""
    for low in range(0, tiling.pressures, tiling.columns):
        high = min(low + tiling.columns, tiling.pressures)
        for first in range(0, tiling.pairs, tiling.batch):
            yield Batch(first, min(first + tiling.batch, tiling.pairs), low, high)


def fitted(tiling: Tiling, task: Task) -> Tiling:
    """The tiling, or the next smaller one whose program stays within `MEMORY`."""
    local = sum(device.process_index == jax.process_index() for device in tiling.mesh.devices.flat)
    while program_bytes(tiling, task) > MEMORY / local and (less := smaller(tiling)):
        tiling = less
    return tiling


def program_bytes(tiling: Tiling, task: Task) -> int:
    """Bytes that the program of a batch holds on one device: its own, what it takes and what it returns."""
    arguments, static = _arguments(tiling, task, next(batches(tiling)))
    # JAX keeps what is compiled here for the calls that follow.
    found = _evaluate.lower(*arguments, **static).compile().memory_analysis()
    if found is None:
        return 0  # the device does not say
    return found.temp_size_in_bytes + found.argument_size_in_bytes + found.output_size_in_bytes


def launch(tiling: Tiling, task: Task, batch: Batch) -> dict[str, jax.Array]:
    """Begin to compute a batch: a dict of quantities, arrays (pressures, pairs) that are padded."""
    arguments, static = _arguments(tiling, task, batch)
    return _evaluate(*arguments, **static)


def points(conditions: Conditions, batch: Batch) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Velocity and temperature of the pairs of a batch, (pairs,) each, and its pressures."""
    T, v = np.divmod(np.arange(batch.first, batch.stop), conditions.velocity.size)
    temperature = None if conditions.temperature is None else conditions.temperature[T]
    return conditions.velocity[v], conditions.pressure[batch.low : batch.high], temperature


def on_all(mesh: jax.sharding.Mesh, tree: Any, spec: PartitionSpec = _EVERYWHERE) -> Any:
    """A tree of arrays that every process has, as arrays of all devices."""
    sharding = NamedSharding(mesh, spec)

    def put(x):
        x = np.asarray(x)
        return jax.make_array_from_callback(x.shape, sharding, lambda index: x[index])

    return jax.tree.map(put, tree)


def all_ready(ready: bool) -> bool:
    """Whether every process is ready; each must ask."""
    if jax.process_count() == 1:
        return ready
    mesh = jax.make_mesh((jax.device_count(),), (_POINTS,), axis_types=(AxisType.Auto,))
    everywhere = jax.jit(jnp.all, out_shardings=NamedSharding(mesh, _EVERYWHERE))
    known = on_all(mesh, np.full(jax.device_count(), ready), PartitionSpec(_POINTS))
    return bool(np.asarray(everywhere(known)))


def _arguments(tiling, task, batch):
    # The last pair and the last pressure pad what is short: every batch has one shape.
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
    """Quantities at every pressure and pair: dict of arrays (pressures, pairs)."""
    several = jax.process_count() > 1

    def share(scene, velocity, pressure, temperature):
        ready = prepare(scene, quantities, quadrature)
        found_at = functools.partial(_heated if ready.thermal else _shared, ready, quantities, pressure)
        pairs = [None if x is None else x.reshape(-1, group) for x in (velocity, temperature)]
        found = jax.lax.map(found_at, pairs)
        found = {name: jnp.swapaxes(x, 0, 1).reshape(pressure.size, -1) for name, x in found.items()}
        # Every process needs all of it: to find what is not finite, and the first to write it.
        gather = functools.partial(jax.lax.all_gather, axis_name=_POINTS, axis=1, tiled=True)
        return jax.tree.map(gather, found) if several else found

    across = PartitionSpec(_POINTS)
    return jax.shard_map(
        share,
        mesh=mesh,
        in_specs=(_EVERYWHERE, across, _EVERYWHERE, across),
        out_specs=_EVERYWHERE if several else PartitionSpec(None, _POINTS),
        # The loops of the temperatures begin with constants, which the check takes for equal ever after.
        check_vma=False,
    )(scene, velocity, pressure, temperature)


def _shared(ready, quantities, pressure, pairs):
    """Quantities (pressures, pairs): what does not depend on the pressure is computed once."""
    velocity, temperature = pairs

    def at(pressure):
        conditions = [velocity, jnp.full_like(velocity, pressure), temperature]
        return evaluate(ready, quantities, [x for x in conditions if x is not None])

    return jax.vmap(at)(pressure)


def _heated(ready, quantities, pressure, pairs):
    """The same where every pressure has temperatures of its own, and so nothing is shared."""
    shape = pressure.size, pairs[0].size
    conditions = (jnp.broadcast_to(x, shape).reshape(-1) for x in (pairs[0], pressure[:, None], pairs[1]))
    found = evaluate(ready, quantities, list(conditions))
    return {name: x.reshape(shape) for name, x in found.items()}
