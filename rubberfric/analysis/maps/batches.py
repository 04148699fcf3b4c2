"""Batches of a friction map: which points one compiled program computes together, on every device.

A map is a grid of pressures and of pairs (temperature, velocity). Most of the work, the angular means
of the stiffness and g(q), depends on the pair alone: a batch is all its pairs at all its pressures, and
does that part once. Pairs are shared out to the devices, and each device takes them a few at a time,
as many as its fast memory holds.
"""

import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, NamedSharding, PartitionSpec

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


class Layout(NamedTuple):
    """How a map is cut up."""

    pairs: int  # of the map, in all
    pressures: int
    columns: int  # pressures of a batch
    group: int  # pairs that a device evaluates at once
    groups: int  # of them on every device in a batch
    mesh: jax.sharding.Mesh

    @property
    def batch(self):
        """Pairs of a batch."""
        return self.group * self.groups * self.mesh.size

    @property
    def work(self):
        """What there is to do: pairs, for every set of pressures."""
        return self.pairs * -(-self.pressures // self.columns)

    def points(self, done):
        """Points that are in the work done."""
        sets, pairs = divmod(done, self.pairs)
        low = sets * self.columns
        return min(low, self.pressures) * self.pairs + pairs * min(self.columns, self.pressures - low)


class Batch(NamedTuple):
    """A piece of the work: the pairs first ... stop at the pressures low ... high."""

    first: int
    stop: int
    low: int
    high: int
    done: int  # work done with it


def plan(pairs, pressures, *, shared=True, block=None, devices=None):
    """Layout of a map of so many pairs and pressures.

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
    if platform == "cpu":
        group = max(_FEWEST, min(_MOST, _AT_ONCE // columns))
    else:
        group = max(1, _AT_ONCE_ELSEWHERE // columns)
    group = min(group, local)
    groups = local // group
    count = -(-pairs // (group * groups * len(devices)))
    if count <= _FEW:
        # Of one size, as nearly as can be: padding the last would count.
        groups = -(-pairs // (group * len(devices) * count))
    return Layout(pairs, pressures, columns, group, groups, mesh)


def smaller(layout):
    """The layout that takes half as many pairs at once; None if it takes one."""
    if layout.group == 1:
        return None
    group = layout.group // 2
    return layout._replace(group=group, groups=layout.groups * layout.group // group)


def batches(layout, done=0):
    """Every `Batch` after the work done."""
    while done < layout.work:
        part, first = divmod(done, layout.pairs)
        stop = min(first + layout.batch, layout.pairs)
        low = part * layout.columns
        done += stop - first
        yield Batch(first, stop, low, min(low + layout.columns, layout.pressures), done)


def fitted(layout, scene, conditions, options):
    """The layout, or the next smaller one whose program stays within `MEMORY`."""
    local = sum(device.process_index == jax.process_index() for device in layout.mesh.devices.flat)
    while program_bytes(layout, scene, conditions, options) > MEMORY / local and smaller(layout):
        layout = smaller(layout)
    return layout


def program_bytes(layout, scene, conditions, options):
    """Bytes that the program of a batch holds on one device: its own, what it takes and what it returns."""
    first = next(batches(layout))
    arguments, static = _arguments(layout, scene, conditions, first, options)
    # JAX keeps what is compiled here for the calls that follow.
    found = _evaluate.lower(*arguments, **static).compile().memory_analysis()
    return found.temp_size_in_bytes + found.argument_size_in_bytes + found.output_size_in_bytes


def launch(layout, scene, conditions, batch, options):
    """Begin to compute a batch: a dict of quantities, arrays (pressures, pairs) that are padded."""
    arguments, static = _arguments(layout, scene, conditions, batch, options)
    return _evaluate(*arguments, **static)


def points(conditions, batch):
    """Velocity and temperature of the pairs of a batch, (pairs,) each, and its pressures."""
    T, v = np.divmod(np.arange(batch.first, batch.stop), conditions.velocity.size)
    temperature = None if conditions.temperature is None else conditions.temperature[T]
    return conditions.velocity[v], conditions.pressure[batch.low : batch.high], temperature


def on_all(mesh, tree, spec=_EVERYWHERE):
    """A tree of arrays that every process has, as arrays of all devices."""
    sharding = NamedSharding(mesh, spec)

    def put(x):
        x = np.asarray(x)
        return jax.make_array_from_callback(x.shape, sharding, lambda index: x[index])

    return jax.tree.map(put, tree)


def from_first(value):
    """An integer that the first process knows, in every process."""
    if jax.process_count() == 1:
        return value
    mesh = jax.make_mesh((jax.device_count(),), (_POINTS,), axis_types=(AxisType.Auto,))
    # In two parts, for without double precision JAX's integers have 32 bits.
    parts = divmod(value, 2**30) if jax.process_index() == 0 else (-(2**30), -(2**30))
    known = np.full((jax.device_count(), 2), parts, np.int32)
    everywhere = jax.jit(lambda x: jnp.max(x, 0), out_shardings=NamedSharding(mesh, _EVERYWHERE))
    high, low = np.asarray(everywhere(on_all(mesh, known, PartitionSpec(_POINTS)))).tolist()
    return high * 2**30 + low


def _arguments(layout, scene, conditions, batch, options):
    # The last pair and the last pressure pad what is short: every batch has one shape.
    velocity, pressure, temperature = (
        None if x is None else np.pad(x, (0, count - x.size), mode="edge")
        for x, count in zip(
            points(conditions, batch), (layout.batch, layout.columns, layout.batch), strict=True
        )
    )
    across = PartitionSpec(_POINTS)
    velocity, temperature = on_all(layout.mesh, (velocity, temperature), across)
    pressure = on_all(layout.mesh, pressure)
    return (scene, velocity, pressure, temperature), dict(mesh=layout.mesh, group=layout.group, **options)


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


def bytes_of(shape, dtypes):
    """Bytes of arrays of one shape."""
    return math.prod(shape) * sum(dtype.itemsize for dtype in dtypes)
