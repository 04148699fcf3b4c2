"""Batches of an ensemble: one compiled step for many fits, distributed over the devices of a mesh.

In one call, each device takes one step of every fit in its batch. A processor takes these steps one after the
other: one fit keeps a core busy, its working set stays in the cache, empty places of the batch take no time,
and the results are bit-identical for every size of the batch. An accelerator takes all steps of a batch in
one vectorised function. The results, a few numbers for each member, go to all processes, and each process
keeps the state of the whole ensemble.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.sharding import AxisType, NamedSharding
from jax.sharding import PartitionSpec as P

from fitting.ensemble.members import Members
from fitting.solvers.objective import CONVERGED, RUNNING, Iterate
from fitting.solvers.ordered import each_fit, z_of
from fitting.solvers.problem import Numbers, Targets
from fitting.solvers.residuals import solver_objective

AXIS = "members"
# Largest number of members in the batch of a device. IN_TURN is large enough to hide the work of the host.
IN_TURN, VECTORISED = 32, 1024

Program = Callable[[Numbers, Targets, Iterate], Iterate]


class Batch(NamedTuple):
    """Compiled functions that start the fits of one batch of members, or take one step of each fit."""

    mesh: jax.sharding.Mesh
    size: int  # members of each device
    start: Program  # evaluates the iterates at their start x
    step: Program
    numbers: Numbers  # on all devices
    peak: int  # memory of a device for a step [B]: arguments, results and temporaries

    @property
    def count(self) -> int:
        """Number of members on all devices."""
        return self.size * self.mesh.size


def make_batch(
    members: Members,
    devices: Sequence[jax.Device],  # pyright: ignore[reportInvalidTypeForm]: a class
    size: int | None = None,
    vectorised: bool | None = None,
    max_memory: float = 2**30,
) -> Batch:
    """Compile the functions of an ensemble, with the largest batch that fits into memory.

    See `run_ensemble` for the arguments. Raise ValueError if a step does not fit into `max_memory`.
    """
    vectorised = devices[0].platform != "cpu" if vectorised is None else vectorised
    mesh = jax.make_mesh((len(devices),), (AXIS,), axis_types=(AxisType.Auto,), devices=devices)
    most = min(VECTORISED if vectorised else IN_TURN, -(-len(members) // len(devices)))
    tried = size or most
    while True:
        shapes, tree = jax.tree.flatten(_shapes(members, tried * len(devices), mesh))
        program = members.solver, members.problem.structure, mesh, vectorised, tree, tuple(shapes)
        step = _compiled(*program, stepping=True)
        found: Any = step.memory_analysis()
        peak = int(found.temp_size_in_bytes + found.argument_size_in_bytes + found.output_size_in_bytes)
        if peak <= max_memory:
            break
        if tried == 1 or size:
            raise ValueError(
                f"max_memory = {max_memory}: a step of a batch of {tried} takes {peak} bytes on each device;"
                " raise max_memory to at least this number"
            )
        tried = max(1, min(tried - 1, int(tried * max_memory / peak)))
    start = _compiled(*program, stepping=False)
    numbers = jax.tree.map(lambda a: _put(a, mesh, P()), members.problem.numbers)
    return Batch(mesh, tried, start, step, numbers, peak)


def blank_iterate(members: Members) -> Iterate:
    """Return the iterates of all members before the first step, all zero except x and status."""
    targets, x = jax.tree.map(lambda a: a[0], (members.targets, members.starts))
    shapes = jax.eval_shape(functools.partial(_begin, members), members.problem.numbers, targets, x)
    blank = jax.tree.map(lambda s: np.zeros((len(members), *s.shape), s.dtype), shapes)
    moving = np.broadcast_to(members.targets.moving, members.starts.shape)
    variables, constants = members.problem.variables, members.problem.numbers.constants
    x = each_fit(z_of, variables, constants, members.starts.copy(), moving)
    return blank._replace(x=x, status=blank.status + RUNNING)


def _begin(members, numbers, targets, x):
    return members.solver.init(solver_objective(members.problem.structure, numbers, targets), x)


def advance_members(
    batch: Batch, program: Program, members: Members, iterate: Iterate, which: np.ndarray
) -> Iterate:
    """Return the iterates of at most `batch.count` members `which` after one call of `program`, in NumPy.

    `program` is the start or the step of the batch, and `iterate` has a row for each member.
    """
    # Members are dealt to the devices in turn, so that the last few are distributed evenly.
    place = np.arange(which.size)
    place = place % batch.mesh.size * batch.size + place // batch.mesh.size
    rows = np.full(batch.count, which[0])
    rows[place] = which
    empty = np.ones(batch.count, bool)
    empty[place] = False
    here = jax.tree.map(lambda a: a[rows], iterate)
    here = here._replace(status=np.where(empty, CONVERGED, here.status).astype(here.status.dtype))
    targets = jax.tree.map(
        lambda a: a[rows if len(a) == len(members) else np.zeros_like(rows)], members.targets
    )
    here, targets = jax.tree.map(lambda a: _put(a, batch.mesh, P(AXIS)), (here, targets))
    return jax.tree.map(lambda a: np.asarray(a)[place], program(batch.numbers, targets, here))


@functools.lru_cache(maxsize=8)  # a second ensemble of the same kind compiles nothing
def _compiled(solver, structure, mesh, vectorised, tree, shapes, stepping):
    """Compile one step of a batch, or the first evaluation, whose results go to all devices."""

    def one(numbers, targets, iterate):
        objective = solver_objective(structure, numbers, targets)

        def work(iterate):
            return solver.step(objective, iterate) if stepping else solver.init(objective, iterate.x)

        # A branch where members are taken in turn, a choice of both where they are vectorised.
        return jax.lax.cond(iterate.status == RUNNING, work, lambda iterate: iterate, iterate)

    def of_a_device(numbers, targets, iterate):
        if vectorised:
            return jax.vmap(functools.partial(one, numbers))(targets, iterate)
        return jax.lax.map(lambda member: one(numbers, *member), (targets, iterate))

    shared = jax.shard_map(
        of_a_device, mesh=mesh, in_specs=(P(), P(AXIS), P(AXIS)), out_specs=P(AXIS), check_vma=False
    )
    program = jax.jit(shared, out_shardings=NamedSharding(mesh, P()))
    return program.lower(*jax.tree.unflatten(tree, shapes)).compile()


def _shapes(members, count, mesh):
    def shape(a, spec, rows=()):
        return jax.ShapeDtypeStruct((*rows, *a.shape), a.dtype, sharding=NamedSharding(mesh, spec))

    numbers = jax.tree.map(lambda a: shape(a, P()), members.problem.numbers)
    one = jax.tree.map(lambda a: a[0], (members.targets, blank_iterate(members)))
    targets, iterate = jax.tree.map(lambda a: shape(a, P(AXIS), (count,)), one)
    return numbers, targets, iterate


def _put(array, mesh, spec):
    # A callback fills the array, because the devices may belong to several processes.
    array = np.asarray(array)
    return jax.make_array_from_callback(array.shape, NamedSharding(mesh, spec), lambda index: array[index])
