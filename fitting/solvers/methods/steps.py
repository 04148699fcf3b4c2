"""Steps of several fits side by side: their beginning and the next, of every method.

Of least squares the model is computed by one program, and what is done with it by others, as the model takes
all of the time to compile. Where it takes long to compute as well, as that of a heated scene does, every
evaluation has derivatives and is one step (`fitting.solvers.methods.brown_dennis`); else a step of
Levenberg-Marquardt is up to four.
"""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.variables import Array
from fitting.solvers.evaluation import evaluate, takes_long
from fitting.solvers.iterate import CONVERGED, RUNNING, Iterate, begin
from fitting.solvers.methods import brown_dennis
from fitting.solvers.methods.levenberg_marquardt import (
    PROBE,
    LevenbergMarquardt,
    bent,
    brings_enough,
    planned,
    taken,
)
from fitting.solvers.options import Solver
from fitting.solvers.ordered import put_on_bounds, slopes_of_x, x_of
from fitting.solvers.problem import Numbers, Structure, Targets
from fitting.solvers.residuals import (
    aim,
    in_errors,
    loss_of,
    rounding,
    slopes_in_errors,
)
from rubberfric.base import quick_jit

# Numbers of the curvature of all residuals: beyond, to keep it takes longer than to compute the model.
_MOST_BENDS = 1_000_000


@functools.partial(jax.jit, static_argnums=(0, 1))
def _init(solver, structure, numbers, targets, x):
    return jax.vmap(lambda targets, x: solver.init(aim(structure, numbers, targets), x))(targets, x)


@functools.partial(jax.jit, static_argnums=(0, 1))
def _step(solver, structure, numbers, targets, iterate):
    return jax.vmap(lambda targets, iterate: solver.step(aim(structure, numbers, targets), iterate))(
        targets, iterate
    )


@quick_jit(static_argnums=(0, 1))
def _begun(solver, structure, numbers, targets, x, rows):
    def one(targets, x, rows):
        cost = loss_of(structure, numbers).cost(in_errors(structure, numbers, targets, rows))
        return begin(cost, x, jnp.asarray(solver.damping, x.dtype))

    return jax.vmap(one)(targets, x, rows)


@quick_jit(static_argnums=(0,))
def _planned(structure, numbers, targets, iterate, rows, slopes):
    def one(targets, iterate, rows, slopes):
        plain = in_errors(structure, numbers, targets, rows)
        jacobian = slopes_in_errors(structure, numbers, targets, slopes)
        plan = planned(plain, jacobian, iterate, loss_of(structure, numbers))
        return plan, iterate.x + PROBE * plan.velocities

    return jax.vmap(one)(targets, iterate, rows, slopes)


@quick_jit(static_argnums=(0,))
def _bent(structure, numbers, targets, iterate, plan, i, ahead):
    def one(targets, iterate, plan, ahead):
        move = bent(plan, i, in_errors(structure, numbers, targets, ahead))
        return move, iterate.x + move

    return jax.vmap(one)(targets, iterate, plan, ahead)


@quick_jit(static_argnums=(0, 1))
def _taken(solver, structure, numbers, targets, iterate, plan, moves, tried):
    def one(targets, iterate, plan, moves, tried):
        rows = jax.vmap(lambda rows: in_errors(structure, numbers, targets, rows))(tried)
        limits = {"tolerance": solver.tolerance, "rounding": rounding(structure, targets)}
        loss = loss_of(structure, numbers)
        return taken(plan, moves, rows, iterate, loss, **limits), brings_enough(plan, rows[0], iterate, loss)

    return jax.vmap(one)(targets, iterate, plan, moves, tried)


def start(solver: Solver, structure: Structure, numbers: Numbers, targets: Targets, x: Array) -> Iterate:
    """Iterates of several fits at their start vectors; arguments but the first three with a leading axis."""
    if not isinstance(solver, LevenbergMarquardt):
        return _init(solver, structure, numbers, targets, x)
    if _use_brown_dennis(structure, numbers, targets, x):
        found = _weighed(
            structure, numbers, targets, *_evaluated(structure, numbers, targets, x, slopes=True)
        )
        each = zip(np.asarray(x), *map(np.asarray, found[:2]), strict=True)
        return _side_by_side([brown_dennis.begun(*one) for one in each])
    rows, _ = _evaluated(structure, numbers, targets, x)
    return _begun(solver, structure, numbers, targets, x, rows)


def advance(
    solver: Solver,
    structure: Structure,
    numbers: Numbers,
    targets: Targets,
    iterate: Iterate,
    *,
    at_bounds: bool = True,
) -> Iterate:
    """Iterates after one step each; at_bounds: whether a step on the bounds of an order is tried as well."""
    if not isinstance(solver, LevenbergMarquardt):
        return _step(solver, structure, numbers, targets, iterate)
    running = np.flatnonzero(np.asarray(iterate.status) == RUNNING)
    if running.size == 0:
        return iterate
    if _use_brown_dennis(structure, numbers, targets, iterate.x):
        return _moved(solver, structure, numbers, targets, iterate, running)

    def rows_at(x, which, slopes=False):
        """Rows at x, shape (fits, size), of some fits; those of the others are never looked at."""
        some = targets._replace(moving=np.asarray(targets.moving)[which])
        found = _evaluated(structure, numbers, some, np.asarray(x)[which], slopes)
        return [_filled(part, which, len(x)) for part in found]

    def trial(i, which):
        """The move of damping i, and the rows that it leads to."""
        known = structure, numbers, targets, iterate, plan, i
        move, there = _bent(*known, rows_at(ahead[:, i], which)[0])
        return np.asarray(move), rows_at(there, which)[0]

    plan, ahead = _planned(structure, numbers, targets, iterate, *rows_at(iterate.x, running, slopes=True))
    ahead = np.asarray(ahead)  # a part of which is no program
    first = trial(0, running)

    def after(second):
        both = (np.stack(pair, 1) for pair in zip(first, second, strict=True))
        return _taken(solver, structure, numbers, targets, iterate, plan, *both)

    found, enough = after(first)
    again = running[~np.asarray(enough)[running]]
    found = found if again.size == 0 else after(trial(1, again))[0]
    if not (at_bounds and structure.variables.order):
        return found
    return _at_bounds(solver, structure, numbers, targets, iterate, found)


def _evaluated(structure, numbers, targets, z, slopes=False):
    """Rows of the model, and their derivatives by z, of fits at rows of z."""
    variables, constants, z = structure.variables, numbers.constants, np.asarray(z)
    if not variables.order:
        return evaluate(structure, numbers, z, slopes)
    pairs = list(zip(z, np.asarray(targets.moving), strict=True))
    x = np.stack([x_of(variables, constants, *pair) for pair in pairs])
    rows, by_x = evaluate(structure, numbers, x, slopes)
    if slopes:
        by_x = by_x @ np.stack([slopes_of_x(variables, constants, *pair) for pair in pairs])
    return rows, by_x


def _at_bounds(solver, structure, numbers, targets, before, after):
    """Iterates after a step, or a step from the bounds of an order that it brought them near to, if lower."""
    x, fits = np.array(after.x), np.flatnonzero(np.asarray(after.status) == RUNNING)
    for i in fits:
        known = structure.variables, numbers.constants, np.asarray(before.x)[i], x[i]
        x[i] = put_on_bounds(*known, np.asarray(targets.moving)[i])
    tried = (x != np.asarray(after.x)).any(1)
    if not tried.any():
        return after
    rows, _ = _evaluated(structure, numbers, targets, x)
    costs = _costs(structure, numbers, targets, rows)
    status = np.where(tried & np.isfinite(costs), after.status, CONVERGED)
    there = after._replace(x=x, cost=costs, status=status, nfev=after.nfev + 1, njev=after.njev + 1)
    there = advance(solver, structure, numbers, targets, there, at_bounds=False)
    lower = tried & (np.asarray(there.cost) < np.asarray(after.cost))
    return jax.tree.map(lambda new, old: np.where(_column(lower, old), new, old), there, after)


def _column(mask, like):
    """A mask over fits with as many axes as an array."""
    return mask.reshape(-1, *[1] * (np.ndim(like) - 1))


@quick_jit(static_argnums=(0,))
def _costs(structure, numbers, targets, rows):
    def one(targets, rows):
        return loss_of(structure, numbers).cost(in_errors(structure, numbers, targets, rows))

    return jax.vmap(one)(targets, rows)


def _use_brown_dennis(structure, numbers, targets, x):
    """Return True if the model takes so long that steps of Brown and Dennis, with fewer evaluations, pay."""
    size = np.shape(x)[-1]
    few = np.shape(targets.measured)[-1] * size**2 <= _MOST_BENDS
    return few and structure.loss == "linear" and takes_long(structure, numbers)


@quick_jit(static_argnums=(0,))
def _weighed(structure, numbers, targets, rows, slopes):
    def one(targets, rows, slopes):
        plain = in_errors(structure, numbers, targets, rows)
        return plain, slopes_in_errors(structure, numbers, targets, slopes), rounding(structure, targets)

    return jax.vmap(one)(targets, rows, slopes)


def _moved(solver, structure, numbers, targets, iterate, running):
    """Iterates after one evaluation each, of fits whose evaluations are spared."""
    each = [jax.tree.map(lambda a, i=i: np.asarray(a)[i], iterate) for i in range(len(iterate.status))]
    moves = {i: brown_dennis.proposed(each[i]) for i in running}
    x = np.stack([one.x for one in each])
    for i, move in moves.items():
        x[i] += move.astype(x.dtype)
    some = targets._replace(moving=np.asarray(targets.moving)[running])
    found = _evaluated(structure, numbers, some, x[running], slopes=True)
    rows, slopes = (_filled(part, running, len(x)) for part in found)
    rows, slopes, least = map(np.asarray, _weighed(structure, numbers, targets, rows, slopes))
    for i, move in moves.items():
        each[i] = brown_dennis.taken(
            each[i], move, rows[i], slopes[i], tolerance=solver.tolerance, rounding=float(least[i])
        )
    return _side_by_side(each)


def _filled(part, which, count):
    """Arrays of some fits among those of all, zeros elsewhere."""
    whole = np.zeros((count, *part.shape[1:]), part.dtype)
    whole[which] = part
    return whole


def _side_by_side(iterates: list[Iterate]) -> Any:
    """One iterate with an axis of fits."""
    return jax.tree.map(lambda *a: np.stack(a), *iterates)
