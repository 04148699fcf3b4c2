"""Predictions of a problem and their derivatives, compiled once for a whole fit.

One compiled function serves trial steps, starts, derivatives, error bars, bands and figures, or two if
derivatives use reverse mode. The function takes up to `PLACES` points x and computes only the given points,
one after the other, with derivatives along the requested directions. The steps compile quickly and are
separate functions (`fitting.solvers.levenberg_marquardt`).
"""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.scenes import by_name
from fitting.parameters.variables import Array
from fitting.solvers.problem import CURVE_QUANTITIES, FitStructure, Numbers, Problem
from fitting.solvers.residuals import (
    Padded,
    in_errors,
    loss_of,
    padded,
    rows_and_slopes,
    rows_of,
    slopes_in_errors,
)
from rubberfric.analysis import uses_forward_mode
from rubberfric.base import quick_jit

# Number of x in one call of a compiled function.
PLACES = 8
# Up to this number of calls, a compiled function takes less time than another compilation.
CALLS = 100


def evaluate_rows(
    structure: FitStructure, numbers: Numbers, x: Array, slopes: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate `fitting.solvers.residuals.rows_of` at every row of x, with derivatives if `slopes`.

    `structure` and `numbers` are `padded`, so that other problems share the compiled function. For x of the
    shape (k, size), the results have the shapes (k, rows) and (k, rows, size), or (k, rows, 0) without
    derivatives.
    """
    x, rows, found = np.asarray(x), [], []
    name = "along" if _by_forward_mode(structure, numbers) else "both" if slopes else "rows"
    for first in range(0, len(x), PLACES):
        here = x[first : first + PLACES]
        places = np.concatenate([here, np.repeat(here[-1:], PLACES - len(here), 0)])
        values, derivatives = _PROGRAMS[name](
            structure, numbers, places, len(here), x.shape[1] if slopes else 0
        )
        rows.append(np.asarray(values)[: len(here)])
        found.append(np.asarray(derivatives)[: len(here), :, : x.shape[1] if slopes else 0])
    return np.concatenate(rows), np.concatenate(found)


def _by_forward_mode(structure, numbers):
    """Return True if all derivatives use forward mode, so that one function serves all calls."""
    scenes = by_name(jax.tree.unflatten(structure.variables.tree, numbers.constants.leaves))
    return all(
        block.quantity not in CURVE_QUANTITIES or uses_forward_mode(scenes[block.scene])
        for block in structure.blocks
    )


def rows(structure: FitStructure, numbers: Numbers, x: jax.Array, directions: jax.Array) -> Any:
    """Return the result of `rows_of` at one x, and an array of shape (rows, 0) instead of derivatives."""
    del directions
    values = rows_of(structure, numbers, x)
    return values, jnp.zeros((values.size, 0), x.dtype)


def both(structure: FitStructure, numbers: Numbers, x: jax.Array, directions: jax.Array) -> Any:
    """Return the result of `rows_of` at one x and the derivatives, by the mode that suits each block."""
    del directions
    return rows_and_slopes(structure, numbers, x)


def along(structure: FitStructure, numbers: Numbers, x: jax.Array, directions: jax.Array) -> Any:
    """Return the result of `rows_of` at one x, and derivatives by the first `directions` elements of x."""
    values, push = jax.linearize(lambda x: rows_of(structure, numbers, x), x)

    def add(k, slopes):
        return slopes.at[:, k].set(push(jnp.zeros_like(x).at[k].set(1.0)))

    return values, jax.lax.fori_loop(0, directions, add, jnp.zeros((values.size, x.size), x.dtype))


def _at_places(kind):
    """Return a function that evaluates `kind` at the first `count` of several x.

    A processor evaluates one point after the other. An accelerator evaluates all points at once.
    """
    traced = jax.jit(kind, static_argnums=0)  # traced only once

    def evaluated(structure, numbers, x, count, directions):
        one = functools.partial(traced, structure, numbers)
        if jax.default_backend() != "cpu":
            return jax.vmap(lambda x: one(x, directions))(x)
        blank = jax.tree.map(
            lambda a: jnp.zeros((len(x), *a.shape), a.dtype), jax.eval_shape(one, x[0], directions)
        )

        def put(i, found):
            return jax.tree.map(lambda all_of, new: all_of.at[i].set(new), found, one(x[i], directions))

        return jax.lax.fori_loop(0, count, put, blank)

    evaluated.__name__ = f"evaluated_{kind.__name__}"
    return evaluated


# Compiled functions of (structure, numbers, x, how many of x, along how many directions).
_PROGRAMS = {kind.__name__: quick_jit(static_argnums=(0,))(_at_places(kind)) for kind in (rows, both, along)}


# Not with NumPy: where the model is not finite, padded rows divide infinity by infinity.
_rows_in_errors = quick_jit(static_argnums=(0,))(in_errors)
_slopes_in_errors = quick_jit(static_argnums=(0,))(slopes_in_errors)


def errors_of_rows(of: Padded, rows: Array) -> np.ndarray:
    """Return the residuals for the result of `rows_of`, in units of the errors and without the padding."""
    return of.kept(_rows_in_errors(of.structure, of.numbers, of.targets, rows))


def errors_of_slopes(of: Padded, slopes: Array) -> np.ndarray:
    """Return the Jacobian of the residuals for the derivatives of `rows_of`, without the padding."""
    return of.kept(_slopes_in_errors(of.structure, of.numbers, of.targets, slopes))


def residual_rows(problem: Problem, x: np.ndarray) -> np.ndarray:
    """Return the residuals at x, in units of the errors. The rows of the priors follow the data."""
    of = padded(problem)
    return errors_of_rows(of, _rows_at(of, x))


def costs_at(problem: Problem, x: np.ndarray) -> np.ndarray:
    """Return the cost at every row of x, or inf if the model is not finite there."""
    of, loss = padded(problem), loss_of(problem.structure, problem.numbers)
    rows, _ = evaluate_rows(of.structure, of.numbers, x.astype(problem.start.dtype))
    costs = [float(loss.cost(jnp.asarray(errors_of_rows(of, one)))) for one in rows]
    return np.where(np.isfinite(costs), costs, np.inf)


def model_rows(problem: Problem, x: np.ndarray) -> np.ndarray:
    """Return predictions of the measured values, or of the logarithms if the errors are relative."""
    of = padded(problem)
    return _rows_at(of, x)[of.data]


def _rows_at(of, x):
    return evaluate_rows(of.structure, of.numbers, np.asarray(x)[None])[0][0]


def at_conditions(
    problem: Problem, key: tuple[str, str | None, str], conditions: tuple[Array | None, ...], x: Array
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return predictions and derivatives at other conditions, with the compiled function of the fit.

    `key` is the quantity, body and scene of a `Block`. The `conditions` of such data are arrays of the length
    n, or None. The results have the shapes (parts * n,) and (parts * n, size), and are never of logarithms.
    For a modulus, all E' come before all E". The result is None if the fit has no such data, or if it would
    take more than `CALLS` calls.
    """
    of = padded(problem)
    given = [c is not None for c in conditions]
    size = next(c.size for c in conditions if c is not None)
    for i, block in enumerate(of.structure.blocks):
        here = of.numbers.conditions[i]
        if (block.quantity, block.body, block.scene) == key and [c is not None for c in here] == given:
            break
    else:
        return None
    length = next(c.size for c in here if c is not None)
    if size > CALLS * length:
        return None
    first, last = block.rows
    found = []
    for k in range(0, size, length):
        columns = [None if c is None else np.asarray(c)[k : k + length] for c in conditions]
        count = min(length, size - k)
        filled = tuple(
            None if c is None else np.pad(c, (0, length - count), "edge").astype(h.dtype)
            for c, h in zip(columns, here, strict=True)
        )
        others = (*of.numbers.conditions[:i], filled, *of.numbers.conditions[i + 1 :])
        numbers = of.numbers._replace(conditions=others)
        parts = evaluate_rows(of.structure, numbers, np.asarray(x)[None], slopes=True)
        values, slopes = (part[0, first:last] for part in parts)
        if block.logarithmic:
            values = np.exp(values)
            slopes = slopes * values[:, None]
        found.append([p.reshape(-1, length, *p.shape[1:])[:, :count] for p in (values, slopes)])
    values, slopes = (np.concatenate(part, 1) for part in zip(*found, strict=True))
    return values.reshape(-1), slopes.reshape(-1, slopes.shape[-1])
