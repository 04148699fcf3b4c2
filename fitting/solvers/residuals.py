r"""Residuals of a problem, and their derivatives.

.. math:: r_i = \frac{\ln(model_i / measured_i)}{relative_i} \quad\text{or}\quad
          r_i = \frac{model_i - measured_i}{sigma_i}

The first form is for data with relative errors. Rows with infinite errors are added (`padded`), so that, for
example, 6 and 7 points share a compiled function. The rows of the priors follow
(`fitting.parameters.priors`), and rows that keep arrays smooth during a search (`fitting.solvers.search`).
"""

import functools
from collections.abc import Callable, Collection, Mapping
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from fitting.parameters.priors import prior_residuals
from fitting.parameters.scenes import OrderedPair, by_name, in_order, scene_paths
from fitting.parameters.variables import Array, Constants, Variables, to_scene
from fitting.solvers.objective import Loss, Objective
from fitting.solvers.ordered import x_of
from fitting.solvers.problem import (
    CONTACT_QUANTITIES,
    CURVE_QUANTITIES,
    SLIP_QUANTITIES,
    FitStructure,
    Numbers,
    Problem,
    Targets,
)
from rubberfric.analysis import value_and_jacobian
from rubberfric.applications import friction_points, grip_of_friction
from rubberfric.base import Kind, PhysicalObject, fields_of, recurring_length
from rubberfric.roughness import log_power_spectrum


def cost(structure: FitStructure, numbers: Numbers, targets: Targets, x: jax.Array) -> jax.Array:
    """Return the cost of a problem at x of shape (size,)."""
    return cost_of(structure, numbers, targets, rows_of(structure, numbers, x))


def solver_objective(structure: FitStructure, numbers: Numbers, targets: Targets) -> Objective:
    """Return the cost in the variables z of solvers. See `fitting.solvers.ordered`."""

    def cost_at(z: jax.Array) -> jax.Array:
        x = x_of(structure.variables, numbers.constants, jnp.asarray(z), targets.moving)
        return cost(structure, numbers, targets, jnp.asarray(x))

    return Objective(cost_at, rounding(structure, targets), targets.moving)


def loss_of(structure: FitStructure, numbers: Numbers) -> Loss:
    """Return the `Loss` of a problem."""
    return Loss(structure.loss, numbers.width, data_rows(structure))


def predictions(structure: FitStructure, numbers: Numbers, x: jax.Array) -> tuple[jax.Array, Any]:
    """Return the predictions of all data, of shape (rows,), and the scene or the dict of scenes at x."""
    scene = to_scene(structure.variables, numbers.constants, x)
    scenes, slip_rows = by_name(scene), {}
    for group in _slip_groups(structure, numbers):
        own = scenes[group.scene]
        mu = curve_values("friction", structure.quadrature, own, group.points(own))
        slip_rows |= group.split(group.rows(own, mu))
    rows = [
        _predicted(structure, block, at, scenes[block.scene], slip_rows.get(i))
        for i, (block, at) in enumerate(zip(structure.blocks, numbers.conditions, strict=True))
    ]
    return _if_in_order(structure, scene, jnp.concatenate(rows)), scene


def _if_in_order(structure, scene, rows):
    """Replace the rows by NaN if numbers of the scene violate a required order, such as q0 <= qr <= q1."""
    order = structure.variables.order
    return jnp.where(in_order(order, jax.tree.leaves(scene)), rows, jnp.nan) if order else rows


def _predicted(structure, block, conditions, scene, slip_rows=None):
    """Return the predictions of one block, or the logarithms if the block is logarithmic.

    `slip_rows` are the predictions of a block of slip data.
    """
    if slip_rows is not None:
        values = slip_rows
    elif block.quantity in CURVE_QUANTITIES:
        values = curve_values(block.quantity, structure.quadrature, scene, conditions)
    elif block.quantity == "modulus":
        modulus = rf.complex_modulus(getattr(scene, block.body).material, *conditions)
        values = jnp.concatenate([modulus.real, modulus.imag])
    else:
        # The spectrum is extrapolated, because a fit may move its ends past a measured wavevector.
        log_C = log_power_spectrum(getattr(scene, block.body).spectrum.power_law(), *conditions)
        return log_C if block.logarithmic else jnp.exp(log_C)
    return jnp.log(values) if block.logarithmic else values


def curve_values(
    quantity: str, quadrature: rf.Quadrature, scene: rf.Scene, conditions: tuple[Any, ...]
) -> jax.Array:
    """Return a quantity of `CURVE_QUANTITIES` at velocities, pressures and temperatures.

    The values are NaN where the temperatures did not converge, so that no step is accepted there and a start
    is refused.
    """
    also = () if "converged" not in rf.quantities_of(scene) else ("converged",)
    solution = rf.solve(scene, *conditions, quadrature=quadrature, quantities=(quantity, *also))
    values = getattr(solution, quantity)
    return values if solution.converged is None else jnp.where(solution.converged, values, jnp.nan)


class SlipGroup(NamedTuple):
    """Blocks of slip data of one scene, as forces and moments, whose friction is one call of the theory.

    One call for both forces and moments takes half the time to compile.
    """

    scene: str
    kind: Literal["angle", "ratio"]  # of the slip
    conditions: tuple[Any, ...]  # slip, speed, load and temperature of all blocks in turn
    quantities: dict[int, str]  # position of a block -> its quantity
    ends: np.ndarray  # of the blocks' parts

    def points(self, scene: rf.Scene) -> tuple[Any, ...]:
        """Return the conditions (v, p, T) of the friction that `rows` needs, vectors of equal length."""
        slip, speed, load, temperature = self.conditions
        patch: Any = scene.patch  # make_problem refuses a scene without a patch
        at = friction_points(patch, slip, speed, load, temperature, self.kind)
        shape = jnp.broadcast_shapes(*(c.shape for c in at if c is not None))
        return tuple(None if c is None else jnp.broadcast_to(c, shape).ravel() for c in at)

    def rows(self, scene: rf.Scene, mu: jax.Array) -> jax.Array:
        """Return the forces or moments of all blocks in turn, from the friction at `points`."""
        slip, _, load, _ = self.conditions
        patch: Any = scene.patch
        grip = grip_of_friction(patch, slip, load, mu.reshape(slip.size, -1), self.kind)
        parts = zip(self.quantities.values(), [0, *self.ends[:-1]], self.ends, strict=True)
        return jnp.concatenate([getattr(grip, quantity)[first:last] for quantity, first, last in parts])

    def split(self, rows: jax.Array) -> dict[int, jax.Array]:
        """Return the rows of each block, by its position."""
        return dict(zip(self.quantities, jnp.split(rows, self.ends[:-1]), strict=True))


def slip_group(scene: str, blocks: Mapping[int, tuple[str, tuple[Any, ...]]]) -> SlipGroup:
    """Return the group of blocks with the same kind of slip: position -> quantity and conditions."""
    kinds, conditions = zip(*(_slip_of(at) for _, at in blocks.values()), strict=True)
    columns = tuple(
        None if any(c is None for c in column) else jnp.concatenate(column)
        for column in zip(*conditions, strict=True)
    )
    ends = np.cumsum([slip.size for slip, *_ in conditions])
    return SlipGroup(scene, kinds[0], columns, {i: quantity for i, (quantity, _) in blocks.items()}, ends)


def _slip_groups(structure, numbers):
    """Return the `SlipGroup`s of a problem: for each scene, kind of slip, and with or without temperature."""
    members: dict[Any, dict[int, Any]] = {}
    for i, (block, at) in enumerate(zip(structure.blocks, numbers.conditions, strict=True)):
        if block.quantity in SLIP_QUANTITIES:
            key = block.scene, _slip_of(at)[0], at[-1] is None
            members.setdefault(key, {})[i] = block.quantity, at
    return [slip_group(scene, blocks) for (scene, *_), blocks in members.items()]


def _slip_of(conditions):
    """Return the kind of the slip, and slip, speed, load and temperature, of slip data."""
    *slips, speed, load, temperature = conditions
    kind = "angle" if slips[0] is not None else "ratio"
    return kind, (next(slip for slip in slips if slip is not None), speed, load, temperature)


def rows_of(structure: FitStructure, numbers: Numbers, x: jax.Array) -> jax.Array:
    """Return the predictions, followed by the rows of priors and smoothing in units of their errors."""
    model, scene = predictions(structure, numbers, x)
    prior = prior_residuals(numbers.prior, scene, x)
    return jnp.concatenate(
        [model, prior, numbers.smoothing * (_second_differences(structure.variables, x.dtype) @ x)]
    )


def rows_and_slopes(structure: FitStructure, numbers: Numbers, x: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the result of `rows_of`, and the derivatives with respect to x, of shape (rows, size)."""

    def scene_of(x, name=None):
        scene = to_scene(structure.variables, numbers.constants, x)
        return scene if name is None else by_name(scene)[name]

    slip = {}
    for group in _slip_groups(structure, numbers):
        values, slopes = _slip_slopes(group, functools.partial(scene_of, name=group.scene), x, structure)
        slopes = group.split(slopes)
        slip |= {i: (predicted, slopes[i]) for i, predicted in group.split(values).items()}
    parts = []
    for i, (block, conditions) in enumerate(zip(structure.blocks, numbers.conditions, strict=True)):
        own_scene = functools.partial(scene_of, name=block.scene)
        if block.quantity in CONTACT_QUANTITIES:
            values, slopes = slip.get(i) or value_and_jacobian(
                own_scene, x, conditions, block.quantity, structure.quadrature
            )
            if block.logarithmic:
                values, slopes = jnp.log(values), slopes / values[:, None]
        else:
            values, slopes = forward(
                lambda x, b=block, c=conditions, of=own_scene: _predicted(structure, b, c, of(x)), x
            )
        parts.append((_if_in_order(structure, scene_of(x), values), slopes))
    parts.append(forward(lambda x: prior_residuals(numbers.prior, scene_of(x), x), x))
    differences = numbers.smoothing * _second_differences(structure.variables, x.dtype)
    parts.append((differences @ x, differences))
    rows, slopes = (jnp.concatenate(part) for part in zip(*parts, strict=True))
    return rows, slopes


def _slip_slopes(group, scene_of, x, structure):
    """Return the rows of a `SlipGroup` and their derivatives, as `rubberfric.analysis.value_and_jacobian`."""
    mu, slopes = value_and_jacobian(
        scene_of, x, lambda x: group.points(scene_of(x)), "friction", structure.quadrature
    )
    value, push = jax.linearize(lambda x, mu: group.rows(scene_of(x), mu), x, mu)
    return value, jax.vmap(push)(jnp.eye(x.size, dtype=x.dtype), slopes.T).T


def in_errors(structure: FitStructure, numbers: Numbers, targets: Targets, rows: Array) -> jax.Array:
    """Convert the result of `rows_of` to residuals in units of the errors."""
    count, end = data_rows(structure), data_rows(structure) + targets.prior.size
    of_data = (rows[:count] - targets.measured) / targets.error
    return jnp.concatenate([_whitened(numbers, of_data), rows[count:end] - targets.prior, rows[end:]])


def cost_of(structure: FitStructure, numbers: Numbers, targets: Targets, rows: Array) -> jax.Array:
    """Return the cost for the result of `rows_of`."""
    return loss_of(structure, numbers).cost(in_errors(structure, numbers, targets, rows))


def slopes_in_errors(structure: FitStructure, numbers: Numbers, targets: Targets, slopes: Array) -> jax.Array:
    """Convert derivatives of `rows_of` to the Jacobian of the residuals, 0 for fixed elements of x."""
    count = data_rows(structure)
    of_data = _whitened(numbers, slopes[:count] / targets.error[:, None])
    return jnp.concatenate([of_data, slopes[count:]]) * targets.moving


def _whitened(numbers, rows):
    """Multiply data rows, along the first axis, by the matrix that makes the errors independent."""
    return rows if numbers.whitening is None else numbers.whitening @ rows


def _second_differences(variables: Variables, dtype):
    """Return the matrix, shape (rows, size), of second differences of x along arrays of Positive elements."""
    rows = [np.zeros((0, variables.size))]
    rows += [np.diff(np.eye(variables.size)[slice(*slot)], 2, axis=0) for slot in smooth_slots(variables)]
    return np.concatenate(rows).astype(dtype)


def smooth_slots(variables: Variables) -> list[tuple[int, int]]:
    """Return the slots in x of the arrays of Positive elements, which the search can smooth."""
    return [g.slot for g in variables.groups if g.kind == "Positive" and g.slot[1] - g.slot[0] >= 3]


def forward(function: Callable[[jax.Array], jax.Array], x: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the value of a function, and the derivatives by forward mode along a last axis."""
    jacobian, value = jax.jacfwd(lambda x: (function(x),) * 2, has_aux=True)(x)
    return value, jacobian


def data_rows(structure: FitStructure) -> int:
    """Return the number of rows that belong to data."""
    return structure.blocks[-1].rows[1]


def rounding(structure: FitStructure, targets: Targets) -> jax.Array:
    """Return the cost that rounding causes if the data are fitted exactly."""
    error = 100 * float(jnp.finfo(targets.measured.dtype).eps)  # of a prediction, relative
    offset = np.zeros(data_rows(structure))
    for block in structure.blocks:
        offset[slice(*block.rows)] = block.logarithmic  # ln 1 = 0 has the same absolute error as ln 2
    scale = jnp.abs(targets.measured) + offset.astype(targets.measured.dtype)
    return 0.5 * jnp.sum((error * scale / targets.error) ** 2)


class Padded(NamedTuple):
    """A problem with blocks padded to standard lengths, so that problems share compiled functions."""

    structure: FitStructure
    numbers: Numbers
    targets: Targets
    data: np.ndarray  # positions of the data among the rows of all blocks

    def kept(self, rows: Array) -> np.ndarray:
        """Return the rows without the padding. The first axis of the array counts the rows."""
        return np.concatenate([np.asarray(rows)[self.data], np.asarray(rows)[data_rows(self.structure) :]])


def padded(problem: Problem, targets: Targets | None = None) -> Padded:
    """Pad a problem with points of zero weight, so that problems of similar size share compiled functions.

    Every block repeats its last conditions up to a standard length. The error of these rows is infinite, so
    their residuals and derivatives are exactly 0 for every loss. Tables without free numbers are padded to
    standard lengths as well. If `targets` of other data are given, they may have axes before the rows.
    """
    targets = problem.targets if targets is None else targets
    blocks, conditions, data, first = [], [], [], 0
    for block, columns in zip(problem.structure.blocks, problem.numbers.conditions, strict=True):
        size = next(column.size for column in columns if column is not None)
        parts, length = (block.rows[1] - block.rows[0]) // size, recurring_length(size)
        conditions.append(
            tuple(None if c is None else np.pad(np.asarray(c), (0, length - size), "edge") for c in columns)
        )
        data.append((first + np.arange(parts)[:, None] * length + np.arange(size)).ravel())
        blocks.append(block._replace(rows=(first, first + parts * length)))
        first += parts * length
    rows = np.concatenate(data)
    variables, constants, moved = _with_longer_tables(problem.structure.variables, problem.numbers.constants)

    def spread(values, added):
        values = np.asarray(values)
        full = np.full((*values.shape[:-1], first), added, values.dtype)
        full[..., rows] = values
        return full

    whitening = problem.numbers.whitening
    if whitening is not None:
        longer = np.eye(first, dtype=whitening.dtype)
        longer[np.ix_(rows, rows)] = whitening
        whitening = longer
    prior = tuple(density.moved(moved) for density in problem.numbers.prior)
    numbers = {
        "constants": constants,
        "conditions": tuple(conditions),
        "prior": prior,
        "whitening": whitening,
    }
    return Padded(
        problem.structure._replace(variables=variables, blocks=tuple(blocks)),
        problem.numbers._replace(**numbers),
        targets._replace(measured=spread(targets.measured, 0.0), error=spread(targets.error, np.inf)),
        rows,
    )


def _with_longer_tables(
    variables: Variables, constants: Constants
) -> tuple[Variables, Constants, dict[int, int]]:
    """Pad tables of the scene without free numbers, and return variables and constants for them.

    The third result is a dict from old to new indices of leaves.
    """
    scene = jax.tree.unflatten(variables.tree, constants.leaves)
    paths = scene_paths(scene)
    free = {paths[group.leaf].rpartition(".")[0] for group in variables.groups}
    padded: Any = {
        name: _with_padded_tables(own_scene, name, free) for name, own_scene in by_name(scene).items()
    }
    padded = padded if isinstance(scene, dict) else padded[""]
    leaves, tree = jax.tree.flatten(padded)
    after = {path: i for i, path in enumerate(scene_paths(padded))}
    moved = {i: after[path] for i, path in enumerate(paths)}
    groups = tuple(group._replace(leaf=moved[group.leaf]) for group in variables.groups)
    order = tuple(
        OrderedPair(*(end._replace(leaf=moved[end.leaf]) for end in pair)) for pair in variables.order
    )
    longer = variables._replace(tree=tree, groups=groups, order=order)
    return longer, constants._replace(leaves=tuple(leaves)), moved


def _with_padded_tables(value: PhysicalObject, path: str, free: Collection[str]) -> PhysicalObject:
    """Return an object with padded tables, except in objects at the key paths `free`."""
    parts = {name: getattr(value, name) for name in fields_of(type(value))}
    parts = {name: part for name, part in parts.items() if isinstance(part, PhysicalObject)}
    new = {
        name: _with_padded_tables(part, f"{path}.{name}".lstrip("."), free) for name, part in parts.items()
    }
    changes = {name: part for name, part in new.items() if part is not parts[name]}
    value = value.replace(**changes) if changes else value
    return value if path in free or not isinstance(value, Kind) else value.padded()
