r"""Fixed points y = f(y) with implicit derivatives.

In Anderson's method the next iterate is the combination of the last few iterates with the smallest
residual,

.. math:: y_{k+1} = y_k + z_k - \sum_m \gamma_m (\Delta y_m + \Delta z_m),\qquad
          \gamma = \arg\min |z_k - \sum_m \gamma_m \Delta z_m|,\qquad z = M (f(y) - y)

[Walker & Ni, SIAM J. Numer. Anal. 49 (2011) 1715]. M is the identity or an approximate inverse of 1 - f'.
For a linear f the method is equivalent to GMRES, so the same iteration solves the linear systems of the
derivatives, (1 - f') dy = df and its transpose.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

# Number of previous steps that are combined.
_HISTORY = 7

# Largest number of evaluations of a residual.
_MOST_STEPS = 80

# A row takes its last step if its residual divided by its largest element is below this tolerance. The last
# step reduces the residual at least tenfold, and friction then has an error of 1e-12.
_TOLERANCE = 1e-7

# The same tolerance for the linear systems of the derivatives. Their last step reduces the residual likewise.
_LINEAR_TOLERANCE = 1e-9


class Inverse(NamedTuple):
    """An approximate inverse 1 + left right of 1 - f', where f' is the Jacobian of a function f."""

    left: jax.Array  # (points, n, rank)
    right: jax.Array  # (rank, n)

    def __call__(self, x: jax.Array) -> jax.Array:
        """Apply the inverse to the rows of `x`, of shape (points, n)."""
        return x + jnp.einsum("pnm,pm->pn", self.left, x @ self.right.T)

    def transposed(self, x: jax.Array) -> jax.Array:
        """Apply the transpose of the inverse to the rows of `x`, of shape (points, n)."""
        return x + jnp.einsum("pnm,pn->pm", self.left, x) @ self.right


def fixed_point(
    function: Callable[[jax.Array], jax.Array],
    start: jax.Array,
    inverse: Inverse | None = None,
    tolerance: float | None = None,
) -> tuple[jax.Array, jax.Array]:
    """Iterate y = f(y) to a fixed point near a start value; the result carries no derivatives.

    Parameters
    ----------
    function : maps an array of shape (points, n) to an array of the same shape, each row independently
    start : shape (points, n)
    inverse : Inverse of 1 - f' near the start, or None
    tolerance : largest residual of a row, divided by its largest element, from which one last step reduces
        it a hundredfold; None: 1e-7. In float32 always 1e-5.

    Returns
    -------
    Tuple of y, shape (points, n), and an array of shape (points,) that is True for rows that converged
    """
    goal = _TOLERANCE if tolerance is None else tolerance
    return _iterate(lambda y: function(y) - y, start, goal, inverse)[:2]


def implicit(
    function: Callable[[jax.Array], jax.Array],
    solution: jax.Array,
    inverse: Inverse | None = None,
    tolerance: float | None = None,
) -> jax.Array:
    """Return a known fixed point y = f(y) with implicit derivatives, which solve (1 - f') dy = df.

    Parameters
    ----------
    function, inverse : as in `fixed_point`. `inverse` carries no derivatives.
    solution : a fixed point of the function, shape (points, n), without derivatives
    tolerance : of the linear system, as in `fixed_point`; None: 1e-9. For n = 1 it is solved by a division.
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
    """Return the derivative of a quantity at the dy for which the residual f' dy + df - dy is zero.

    The linear system is the one of `implicit`. The result cannot be differentiated again.

    Parameters
    ----------
    residual : linear function of dy of shape (points, n), to the residual of this shape and the derivative of
        the quantity of shape (points,)
    start : initial dy, shape (points, n)
    also : zeros with the shape (points,) and the dtype of the derivative of the quantity
    inverse : as in `fixed_point`
    """
    state = _iterate(residual, start, _LINEAR_TOLERANCE, inverse, also)[2]
    assert state is not None
    return state


def _tangent_solve(inverse, tolerance, linear, right):
    """Solve the linear system linear(y) = right, where `linear` is the derivative of f(y) - y."""

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
    """Find a zero y of a residual by Anderson's method; return y, converged rows, second result or None."""
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
    """Solve f(y) = y for every row by Anderson's method; the result carries no derivatives.

    Parameters
    ----------
    residual : function of y, which has shape (points, n)
        It returns f(y) - y. If `also` is given, it returns a pair of f(y) - y and another result.
    start : shape (points, n)
    reached : function of (y, residual, other result) to an array of shape (points,) that is True for rows
        that have converged. Such rows take one more step.
    inverse : Inverse of 1 - f' near the start, or None
    also : array of zeros like the other result, shape (points,), or None
    history : number of previous steps that are combined
    most_steps : largest number of evaluations of the residual
    rise : factor by which a residual may exceed the smallest one of its row before its history is dropped;
        None: any

    Returns
    -------
    Tuple of y, an array that is True for rows that converged, the other result at the last evaluation of each
    row, and the number of evaluations
    """
    points, n = start.shape

    def step(progress):
        k, y, good, last, moves, changes, products, least, ended, also = progress
        if also is None:
            z = residual(y)
        else:
            z, latest = residual(y)
            also = jnp.where(ended, also, latest)
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
        gamma = _combination(changes, products, z)
        further = y + z - jnp.einsum("pm,mpn->pn", gamma, moves + changes)
        # A row ends at its own convergence, so that its result does not depend on the others.
        following = jnp.where(fine, further, 0.5 * (y + good))
        following, good = jnp.where(ended[:, None], y, following), jnp.where(fine, y, good)
        ended = ended | (reached(y, z, also) & fine[:, 0])
        return k + 1, following, good, z, moves, changes, products, least, ended, also

    def going(progress):
        return (progress[0] < most_steps) & ~jnp.all(progress[-2])

    empty = jnp.zeros((history, points, n), start.dtype)
    products = jnp.zeros((points, history, history), start.dtype)
    least = None if rise is None else jnp.full(points, jnp.inf, start.dtype)
    ended = jnp.zeros(points, bool)
    begin = jnp.zeros((), int), start, start, start, empty, empty, products, least, ended, also
    k, y, *_, done, also = jax.lax.while_loop(going, step, begin)
    return y, done, also, k


def _combination(changes, products, z):
    """Return gamma, (points, history), for changes of z, (history, points, n), with given products."""
    # Normalised columns; an unused one is 0, and gets 0 from its own equation.
    size = jnp.sqrt(jnp.diagonal(products, axis1=1, axis2=2))
    scale = jnp.where(size > 0, size, 1.0)
    # The ridge keeps the matrix regular for nearly parallel columns.
    smallest = 1e-5 if z.dtype != jnp.float64 else 1e-12
    ridge = jnp.where(size > 0, smallest, 1.0)[..., None] * jnp.eye(size.shape[1], dtype=z.dtype)
    normal = products / scale[:, :, None] / scale[:, None, :] + ridge
    right = jnp.einsum("mpn,pn->pm", changes, z) / scale
    return jnp.linalg.solve(normal, right[..., None])[..., 0] / scale
