r"""Lanes: one compiled step for many fits, shared out over the devices of a mesh.

Each device holds a number of lanes, and takes one step of the fit in every lane per call.
On a processor it takes them one after the other: the arithmetic of one fit keeps a core busy,
its working set stays in the cache, a lane without work costs nothing, and a member's numbers
are the same bits whatever the number of lanes, as each is computed by the same program. On an
accelerator, which is idle with one fit, the lanes of a device are one batch.

Nothing is exchanged between devices in a step. Its results, a few numbers a lane, go to all
processes, each of which keeps the whole ensemble's bookkeeping.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, NamedSharding
from jax.sharding import PartitionSpec as P

from fitting.solvers.status import CONVERGED, RUNNING

AXIS = "members"
# Lanes of a device, if memory allows: on a processor as many as hide the host's part of a step.
SERIAL, BATCHED = 32, 1024


class Lanes(NamedTuple):
    """Compiled programs for a number of lanes."""

    mesh: jax.sharding.Mesh
    count: int  # lanes in all
    start: object  # (numbers, targets, state) -> state at its x
    step: object
    numbers: object  # on all devices
    peak: int  # bytes of a device that the step takes: arguments, results and all between


def make_lanes(members, devices, per_device=None, batched=None, max_memory=2**30):
    """Compile the programs of an ensemble, with as many lanes as fit into memory.

    Parameters
    ----------
    members : Members
    devices : list of devices
    per_device : lanes of each; None: as many as there is work and memory for
    batched : whether the lanes of a device are one batch; None: unless it is a processor
    max_memory : bytes of a device that a step may take

    Raises
    ------
    ValueError
        a step does not fit into `max_memory`.
    """
    batched = devices[0].platform != "cpu" if batched is None else batched
    mesh = jax.make_mesh((len(devices),), (AXIS,), axis_types=(AxisType.Auto,), devices=devices)
    most = min(BATCHED if batched else SERIAL, -(-len(members) // len(devices)))
    lanes = per_device or most
    while True:
        count = lanes * len(devices)
        shapes, tree = jax.tree.flatten(_shapes(members, count, mesh))
        program = members.solver, members.problem.structure, mesh, batched, tree, tuple(shapes)
        step = _compiled(*program, stepping=True)
        peak = _peak(step)
        if peak <= max_memory:
            break
        if lanes == 1 or per_device:
            raise ValueError(
                f"max_memory = {max_memory}: a step of {lanes} lane{'s' * (lanes > 1)} takes {peak} bytes on"
                " each device; must be at least that"
            )
        lanes = max(1, min(lanes - 1, int(lanes * max_memory / peak)))
    start = _compiled(*program, stepping=False)
    numbers = jax.tree.map(lambda a: _put(a, mesh, P()), members.problem.numbers)
    return Lanes(mesh, count, start, step, numbers, peak)


def blank_state(members):
    """The solver's state as arrays of zeros with a leading axis of the members, x at the starts."""
    targets, x = jax.tree.map(lambda a: a[0], (members.targets, members.starts))
    begin = functools.partial(members.solver.init, members.problem.structure)
    shapes = jax.eval_shape(begin, members.problem.numbers, targets, x)
    state = jax.tree.map(lambda s: np.zeros((len(members), *s.shape), s.dtype), shapes)
    return state._replace(x=members.starts.copy(), status=state.status + RUNNING)


def advance(lanes, program, members, state, which):
    """Rows `which` of the ensemble's state after one call of a program, as NumPy arrays.

    Parameters
    ----------
    program : lanes.start or lanes.step
    state : of all members
    which : indices, at most as many as there are lanes
    """
    devices = lanes.mesh.size
    # One to every device in turn, so that the last few members are shared out evenly.
    place = np.arange(which.size)
    place = place % devices * (lanes.count // devices) + place // devices
    rows = np.full(lanes.count, which[0])
    rows[place] = which
    empty = np.ones(lanes.count, bool)
    empty[place] = False
    here = jax.tree.map(lambda a: a[rows], state)
    here = here._replace(status=np.where(empty, CONVERGED, here.status).astype(here.status.dtype))
    targets = jax.tree.map(
        lambda a: a[rows if len(a) == len(members) else np.zeros_like(rows)], members.targets
    )
    here, targets = jax.tree.map(lambda a: _put(a, lanes.mesh, P(AXIS)), (here, targets))
    return jax.tree.map(lambda a: np.asarray(a)[place], program(lanes.numbers, targets, here))


@functools.lru_cache(maxsize=8)  # a second ensemble of the same kind compiles nothing
def _compiled(solver, structure, mesh, batched, tree, shapes, stepping):
    """The step of all lanes, or their start, for arguments of certain shapes; results on every device."""

    def one(numbers, targets, state):
        def work(state):
            if stepping:
                return solver.step(structure, numbers, targets, state)
            return solver.init(structure, numbers, targets, state.x)

        # A branch where lanes are taken in turn, a choice of both where they are a batch.
        return jax.lax.cond(state.status == RUNNING, work, lambda state: state, state)

    def of_a_device(numbers, targets, state):
        if batched:
            return jax.vmap(functools.partial(one, numbers))(targets, state)
        return jax.lax.map(lambda lane: one(numbers, *lane), (targets, state))

    shared = jax.shard_map(
        of_a_device, mesh=mesh, in_specs=(P(), P(AXIS), P(AXIS)), out_specs=P(AXIS), check_vma=False
    )
    program = jax.jit(shared, out_shardings=NamedSharding(mesh, P()))
    return program.lower(*jax.tree.unflatten(tree, shapes)).compile()


def _shapes(members, count, mesh):
    """Shapes, dtypes and shardings of the arguments of a program."""

    def shape(a, spec, rows=()):
        a = jnp.asarray(a) if not hasattr(a, "dtype") else a
        return jax.ShapeDtypeStruct((*rows, *a.shape), a.dtype, sharding=NamedSharding(mesh, spec))

    numbers = jax.tree.map(lambda a: shape(a, P()), members.problem.numbers)
    one = jax.tree.map(lambda a: a[0], (members.targets, blank_state(members)))
    targets, state = jax.tree.map(lambda a: shape(a, P(AXIS), (count,)), one)
    return numbers, targets, state


def _put(array, mesh, spec):
    """An array on the devices of all processes, each of which has it whole."""
    array = np.asarray(array)
    return jax.make_array_from_callback(array.shape, NamedSharding(mesh, spec), lambda index: array[index])


def _peak(compiled):
    found = compiled.memory_analysis()
    return int(found.temp_size_in_bytes + found.argument_size_in_bytes + found.output_size_in_bytes)
