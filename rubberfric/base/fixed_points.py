r"""Fixed points y = f(y) of many independent points with implicit derivatives; zeros of scalar functions.

In Anderson's method the next iterate is the combination of the last few with the smallest residual,

.. math:: y_{k+1} = y_k + z_k - \sum_m \gamma_m (\Delta y_m + \Delta z_m),\qquad
          \gamma = \arg\min |z_k - \sum_m \gamma_m \Delta z_m|,\qquad z = M (f(y) - y)

[Walker & Ni, SIAM J. Numer. Anal. 49 (2011) 1715]. M is the identity or an approximate inverse of 1 - f'.
For a linear f the method is equivalent to GMRES, so the same iteration solves the linear systems of the
derivatives, (1 - f') dy = df and its transpose. For the first zero of a function of one number, `first` finds
a bracket by even steps, and `zero` uses secants within the bracket.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

_HISTORY, _MOST_STEPS = 7, 80

# Residual over the largest element of a row at which a step is the last, for the iteration and for the linear
# systems of the derivatives. The last step reduces the residual at least tenfold; friction has an error of
# 1e-12.
_TOLERANCE, _LINEAR_TOLERANCE = 1e-7, 1e-9

# Largest number of secant steps, and the slope above which the last step is not verified by an evaluation.
_MOST_SECANTS, _STEEP = 60, 0.1


class Inverse(NamedTuple):
    """An approximate inverse of 1 - f', the identity plus a product of low rank: 1 + left right."""

    left: jax.Array  # (points, n, rank)
    right: jax.Array  # (rank, n)

    def __call__(self, x: jax.Array) -> jax.Array:
        """Apply the inverse to rows x, (points, n)."""
        return x + jnp.einsum("pnm,pm->pn", self.left, x @ self.right.T)

    def transposed(self, x: jax.Array) -> jax.Array:
        """Apply the transpose of the inverse to rows x, (points, n)."""
        return x + jnp.einsum("pnm,pn->pm", self.left, x) @ self.right


def fixed_point(
    function: Callable[[jax.Array], jax.Array],
    start: jax.Array,
    inverse: Inverse | None = None,
    tolerance: float | None = None,
) -> tuple[jax.Array, jax.Array]:
    """Iterate to a fixed point near a start value; the result carries no derivatives.

    Parameters
    ----------
    function : maps an array of shape (points, n) to an array of the same shape, each row independently
    start : shape (points, n)
    inverse : Inverse of 1 - f' near the start, or None
    tolerance : a row takes its last step when its residual over its largest element is below this; None:
        1e-7 (float32: 1e-5)

    Returns
    -------
    (y, True for rows that converged), shapes (points, n) and (points,). A row does not depend on other rows.

    Limits: after the last step residuals are about a hundredth of the tolerance (float32: 1e-5).
    """
    goal = _TOLERANCE if tolerance is None else tolerance
    return _iterate(lambda y: function(y) - y, start, goal, inverse)[:2]


def implicit(
    function: Callable[[jax.Array], jax.Array],
    solution: jax.Array,
    inverse: Inverse | None = None,
    tolerance: float | None = None,
) -> jax.Array:
    """Return a known fixed point with its implicit derivatives, (1 - f') dy = df.

    Parameters
    ----------
    function, inverse : as in `fixed_point`; `inverse` carries no derivatives
    solution : shape (points, n), without derivatives; it must be a fixed point
    tolerance : tolerance of the linear system, as in `fixed_point`; None: 1e-9. For n = 1 the solution is
        exact.
    """
    goal = _LINEAR_TOLERANCE if tolerance is None else tolerance
    solve = functools.partial(_tangent_solve, inverse, goal)
    return jax.lax.custom_root(lambda y: function(y) - y, solution, lambda _, y: y, solve)


def linear_fixed_point(
    residual: Callable[[jax.Array], tuple[jax.Array, jax.Array]],
    start: jax.Array,
    also: jax.Array,
    inverse: Inverse | None = None,
) -> jax.Array:
    """Return the derivative of a quantity that depends on a fixed point.

    The result is the derivative of the quantity at the dy for which the residual f' dy + df - dy is zero. It
    cannot be differentiated again. The linear system is the same as in `implicit`, but one function gives the
    residual and the quantity, so only one function is differentiated.

    Parameters
    ----------
    residual : linear function of dy, shape (points, n), that returns (residual, derivative of the quantity),
        shapes (points, n) and (points,)
    start : initial dy, shape (points, n)
    also : zeros with the shape and dtype of the derivative of the quantity, (points,)
    inverse : as in `fixed_point`
    """
    found = _iterate(residual, start, _LINEAR_TOLERANCE, inverse, also)[2]
    assert found is not None
    return found


def _tangent_solve(inverse, tolerance, linear, right):
    """Solve linear(y) = right, where linear is the derivative of f(y) - y."""

    def solve(inverse, product, right):
        if right.shape[-1] == 1:  # scalar systems need a division only
            return right / product(jnp.ones_like(right))
        start = jnp.zeros_like(right)
        return _iterate(lambda y: product(y) - right, start, tolerance, inverse)[0]

    back = None if inverse is None else inverse.transposed
    return jax.lax.custom_linear_solve(
        linear, right, functools.partial(solve, inverse), functools.partial(solve, back)
    )


def _iterate(residual, start, tolerance, inverse=None, also=None):
    """Return the zero of a residual, True for rows that converged, and the residual's other result there."""
    single = start.dtype != jnp.float64
    tolerance = 1e-5 if single else tolerance

    def reached(y, z, _):
        return jnp.max(jnp.abs(z), -1) <= tolerance * jnp.max(jnp.abs(y), -1)

    y, done, also, _ = anderson(
        residual, start, reached, inverse, also, history=_HISTORY, most_steps=_MOST_STEPS
    )
    return y, done, also


def anderson(
    residual: Callable[[jax.Array], Any],
    start: jax.Array,
    reached: Callable[[jax.Array, jax.Array, Any], jax.Array],
    inverse: Inverse | None = None,
    also: jax.Array | None = None,
    *,
    history: int,
    most_steps: int,
    rise: float | None = None,
) -> tuple[jax.Array, jax.Array, Any, jax.Array]:
    """Iterate y until the residual of every row is small, without derivatives.

    Parameters
    ----------
    residual : function of y, shape (points, n), that returns f(y) - y; with `also`, a pair of this and
        another result
    start : shape (points, n)
    reached : function of (y, residual, other result). It returns True for rows that have
        converged, shape (points,); these take one more step
    inverse : Inverse of 1 - f' near the start, or None
    also : array of zeros like the other result, shape (points,), or None
    history : number of previous steps combined
    most_steps : largest number of evaluations of the residual
    rise : the history is dropped where the residual exceeds its minimum by this factor; None: never

    Returns
    -------
    (y, True for rows that converged, other result at the last evaluation, number of evaluations)
    """
    smallest = 1e-5 if start.dtype != jnp.float64 else 1e-12
    points, n = start.shape

    def step(progress):
        k, y, good, last, moves, changes, products, least, ended, also = progress
        if also is None:
            z = residual(y)
        else:
            z, found = residual(y)
            also = jnp.where(ended, also, found)
        z = z if inverse is None else inverse(z)
        # Far from a solution the residual may be NaN; then half of the step is tried.
        fine = jnp.all(jnp.isfinite(z), -1, keepdims=True)
        z = jnp.where(fine, z, last)
        # The first iterate has no predecessor, so its column is empty.
        kept = fine & (k > 0)
        if rise is not None:
            norm = jnp.max(jnp.abs(z), -1)
            drop = norm > rise * least
            least = jnp.minimum(norm, least)
            kept = kept & ~drop[:, None]
            moves, changes = (jnp.where(drop[:, None], 0.0, x) for x in (moves, changes))
            products = jnp.where(drop[:, None, None], 0.0, products)
        slot = (k - 1) % history
        change = jnp.where(kept, z - last, 0.0)
        moves = moves.at[slot].set(jnp.where(kept, y - good, 0.0))
        changes = changes.at[slot].set(change)
        row = jnp.einsum("mpn,pn->pm", changes, change)
        products = products.at[:, slot].set(row).at[:, :, slot].set(row)
        # Normalised columns; an unused one is 0, and gets 0 from its own equation.
        size = jnp.sqrt(jnp.diagonal(products, axis1=1, axis2=2))
        scale = jnp.where(size > 0, size, 1.0)
        # The ridge keeps the matrix regular for nearly parallel columns.
        ridge = jnp.where(size > 0, smallest, 1.0)[..., None] * jnp.eye(history, dtype=y.dtype)
        normal = products / scale[:, :, None] / scale[:, None, :] + ridge
        share = jnp.linalg.solve(normal, (jnp.einsum("mpn,pn->pm", changes, z) / scale)[..., None])[..., 0]
        further = y + z - jnp.einsum("pm,mpn->pn", share / scale, moves + changes)
        # A row ends at its own convergence, so that its result does not depend on the others.
        following = jnp.where(fine, further, 0.5 * (y + good))
        return (
            k + 1,
            jnp.where(ended[:, None], y, following),
            jnp.where(fine, y, good),
            z,
            moves,
            changes,
            products,
            least,
            ended | (reached(y, z, also) & fine[:, 0]),
            also,
        )

    def going(progress):
        return (progress[0] < most_steps) & ~jnp.all(progress[-2])

    empty = jnp.zeros((history, points, n), start.dtype)
    products = jnp.zeros((points, history, history), start.dtype)
    least = None if rise is None else jnp.full(points, jnp.inf, start.dtype)
    begin = (
        jnp.zeros((), int),
        start,
        start,
        start,
        empty,
        empty,
        products,
        least,
        jnp.zeros(points, bool),
        also,
    )
    k, y, *_, done, also = jax.lax.while_loop(going, step, begin)
    return y, done, also, k


class Near(NamedTuple):
    """An initial guess of a zero, with a bracket that may not contain the zero."""

    start: jax.Array
    low: jax.Array
    high: jax.Array
    slope: jax.Array  # estimate of the function's slope at the zero


def first(function: Callable[[jax.Array], jax.Array], top: jax.Array, tried: int) -> Near:
    """Bracket the first zero of a function between 0 and top by even steps.

    Parameters
    ----------
    function : function of a number that is negative at 0
    top : end of the range, which is returned if the function is below 0 throughout
    tried : number of nodes, including both ends
    """
    step = top / (tried - 1)

    def going(progress):
        k, _, high = progress
        return (k < tried - 1) & (high <= 0) & (top > 0)

    def further(progress):
        k, _, low = progress
        return k + 1, low, function(step * (k + 1))

    begin = function(jnp.zeros_like(top))
    k, low, high = jax.lax.while_loop(going, further, (0, begin, begin))
    none, rise = high <= 0, high - low
    share = jnp.where(rise > 0, -low / jnp.where(rise > 0, rise, 1.0), 0.5)
    slope = jnp.where(rise > 0, rise / jnp.where(step > 0, step, 1.0), 1.0)
    start = step * (k - 1 + jnp.clip(share, 0.0, 1.0))
    start, low, high = (jnp.where(none, top, x) for x in (start, step * (k - 1), step * k))
    return Near(start, low, high, slope)


def zero(
    function: Callable[[jax.Array], jax.Array], near: Near, top: jax.Array
) -> tuple[jax.Array, jax.Array, Near]:
    """Find the zero of a function between 0 and top by secants in a bracket, without derivatives.

    Parameters
    ----------
    function : function of a number that is negative at 0. If it is also negative at top, top is returned as
        not found
    near : initial guess and bracket
    top : end of the range

    Returns
    -------
    (zero, whether it was found, initial guess for a similar function)

    Limits: the function's absolute value is at most 1e-11 at the zero (float32: 1e-5).
    """
    start, low, high, slope = near
    tolerance = 1e-5 if start.dtype != jnp.float64 else 1e-11
    no = jnp.zeros_like(start, bool)

    def step(progress):
        k, z, low, high, below, above, before, value_before, slope, *_ = progress
        value = function(z)
        here, short = jnp.abs(value) <= tolerance, value < 0
        # If the bracket failed, the zero lies beyond its end.
        high = jnp.where(short & (z >= high), top, jnp.where(short, high, z))
        low = jnp.where(~short & (z <= low), 0.0, jnp.where(short, z, low))
        below, above = below | short, above | ~short
        moved = z != before
        slope = jnp.where(moved, (value - value_before) / jnp.where(moved, z - before, 1.0), slope)
        further = z - value / jnp.where(slope > 0, slope, 1.0)
        inside = (slope > 0) & (further > low) & (further < high)
        outside = jnp.where(
            short, jnp.where(above, 0.5 * (z + high), high), jnp.where(below, 0.5 * (low + z), low)
        )
        following = jnp.where(inside, further, outside)
        # A secant leaves the product of the last two errors, times a curvature over the slope.
        there = moved & inside & (slope > _STEEP) & (jnp.abs((further - z) * (z - before)) <= 0.1 * tolerance)
        following = jnp.where(here | (short & (z >= top)), z, following)
        found = here | there
        return k + 1, following, low, high, below, above, z, value, slope, found, found | (short & (z >= top))

    def going(progress):
        return (progress[0] < _MOST_SECANTS) & ~progress[-1]

    begin = 0, start, low, high, no, no, start, jnp.zeros_like(start), slope, no, no
    _, z, *_, slope, found, _ = jax.lax.while_loop(going, step, begin)
    return z, found, Near(z, near.low, near.high, slope)
