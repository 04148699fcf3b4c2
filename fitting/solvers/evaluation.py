"""Predictions of a problem and their derivatives, compiled once for a whole fit.

One compiled function serves trial steps, starts, derivatives, error bars, bands and figures, or two if
derivatives use reverse mode. The function takes several points x (`fitting.solvers.devices`), and computes
derivatives along the requested directions. The steps compile quickly and are separate functions
(`fitting.solvers.steps`).
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.scenes import by_name
from fitting.parameters.variables import Array
from fitting.solvers.devices import Devices, OverFits, default_device
from fitting.solvers.problem import CONTACT_QUANTITIES, FitStructure, Numbers, Problem
from fitting.solvers.residuals import (
    Padded,
    cost_of,
    in_errors,
    padded,
    rows_and_slopes,
    rows_of,
    slopes_in_errors,
)
from rubberfric.analysis import uses_forward_mode
from rubberfric.base import quick_jit

# Up to this number of calls, a compiled function takes less time than another compilation.
CALLS = 100


def evaluate_rows(
    structure: FitStructure, numbers: Numbers, x: Array, slopes: bool = False, on: Devices | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate `fitting.solvers.residuals.rows_of` at every row of x, with derivatives if `slopes`.

    `structure` and `numbers` are `padded`, so that other problems share the compiled function. For x of the
    shape (k, size), the results have the shapes (k, rows) and (k, rows, size), or (k, rows, 0) without
    derivatives. If `on` is None, JAX's default device is used.
    """
    x, on = np.asarray(x), default_device() if on is None else on
    evaluated, columns = _evaluated(structure, slopes), x.shape[1] if slopes else 0
    rows, derivatives, most = [], [], on.places * on.count
    for first in range(0, len(x), most):
        values, by_x = evaluated.of_some(on, structure, (numbers, columns), x[first : first + most])
        rows.append(values)
        derivatives.append(by_x[:, :, :columns])
    return np.concatenate(rows), np.concatenate(derivatives)


def memory_of_evaluation(structure: FitStructure, numbers: Numbers, x: np.ndarray, on: Devices) -> int:
    """Return the memory of a device for predictions and derivatives at the rows of x [B]."""
    here = np.resize(x, (on.places * on.count, x.shape[1]))
    return _evaluated(structure, True).memory(on, structure, (numbers, x.shape[1]), here)


def _evaluated(structure, slopes):
    """Return the compiled function for predictions, with derivatives if `slopes`."""
    if _by_forward_mode(structure):
        return _along
    return _both if slopes else _rows


@functools.lru_cache(maxsize=64)  # steps ask many times
def _by_forward_mode(structure):
    """Return True if all derivatives use forward mode, so that one function serves all calls."""
    tree = structure.variables.tree
    scenes = by_name(jax.tree.unflatten(tree, [0.0] * tree.num_leaves))  # the numbers do not matter
    return all(
        block.quantity not in CONTACT_QUANTITIES or uses_forward_mode(scenes[block.scene])
        for block in structure.blocks
    )


@OverFits
def _rows(structure, shared, x):
    """Return the result of `rows_of` at one x, and an array of shape (rows, 0) instead of derivatives."""
    values = rows_of(structure, shared[0], x)
    return values, jnp.zeros((values.size, 0), x.dtype)


@OverFits
def _both(structure, shared, x):
    """Return the result of `rows_of` at one x and the derivatives, by the mode that suits each block."""
    return rows_and_slopes(structure, shared[0], x)


@OverFits
def _along(structure, shared, x):
    """Return the result of `rows_of` at one x, and derivatives by its first elements."""
    numbers, directions = shared
    values, push = jax.linearize(lambda x: rows_of(structure, numbers, x), x)

    def add(k, slopes):
        return slopes.at[:, k].set(push(jnp.zeros_like(x).at[k].set(1.0)))

    return values, jax.lax.fori_loop(0, directions, add, jnp.zeros((values.size, x.size), x.dtype))


# Not with NumPy: where the model is not finite, padded rows divide infinity by infinity.
_rows_in_errors = quick_jit(static_argnums=(0,))(in_errors)
_slopes_in_errors = quick_jit(static_argnums=(0,))(slopes_in_errors)
_cost_of_rows = quick_jit(static_argnums=(0,))(cost_of)


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
    of = padded(problem)
    rows, _ = evaluate_rows(of.structure, of.numbers, x.astype(problem.start.dtype))
    costs = [float(_cost_of_rows(of.structure, of.numbers, of.targets, row)) for row in rows]
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
    present = [c is not None for c in conditions]
    size = next(c.size for c in conditions if c is not None)
    for i, block in enumerate(of.structure.blocks):
        here = of.numbers.conditions[i]
        if (block.quantity, block.body, block.scene) == key and [c is not None for c in here] == present:
            break
    else:
        return None
    length = next(c.size for c in here if c is not None)
    if size > CALLS * length:
        return None
    first, last = block.rows
    parts_of_calls = []
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
        parts_of_calls.append([p.reshape(-1, length, *p.shape[1:])[:, :count] for p in (values, slopes)])
    values, slopes = (np.concatenate(part, 1) for part in zip(*parts_of_calls, strict=True))
    return values.reshape(-1), slopes.reshape(-1, slopes.shape[-1])
