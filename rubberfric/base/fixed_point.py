r"""Fixed points y = f(y) of many independent points at once, with implicit derivatives.

Anderson's method: the next iterate is the combination of the last few whose residual is least,

.. math:: y_{k+1} = y_k + r_k - \sum_m \gamma_m (\Delta y_m + \Delta r_m),\qquad
          \gamma = \arg\min |r_k - \sum_m \gamma_m \Delta r_m|,\qquad r = f(y) - y

[Walker & Ni, SIAM J. Numer. Anal. 49 (2011) 1715]. On a linear f it is GMRES, so that the same
iteration solves the linear systems of the derivatives, (1 - f') dy = df and its transpose.
"""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp

_HISTORY, _MOST_STEPS = 7, 80

# Residual over the largest element of a row at which a step is the last: it divides the residual by ten
# and more, which leaves friction 1e-12 off; and the same for the linear systems of the derivatives.
_TOLERANCE, _LINEAR_TOLERANCE = 1e-7, 1e-9


def fixed_point(function: Callable[[jax.Array], jax.Array], start: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Fixed point next to a start value, and whether it was reached.

    Parameters
    ----------
    function : from an array of shape (points, n) to one of that shape; rows do not mix
    start : shape (points, n)

    Returns
    -------
    (y, converged), shapes (points, n) and (points,). Derivatives of y follow from the fixed point,
    not from the steps; they are those of the last iterate where it was not reached.

    Limits: residuals of 1e-9 of the largest element of a row (float32: 1e-5).
    """
    solve = functools.partial(_iterate, tolerance=_TOLERANCE)
    y, reached = jax.lax.custom_root(lambda y: function(y) - y, start, solve, _tangent_solve, has_aux=True)
    return y, reached > 0


def _tangent_solve(linear, right):
    """y of linear(y) = right, linear the derivative of f(y) - y."""

    def solve(product, right):
        return _iterate(lambda y: product(y) - right, jnp.zeros_like(right), _LINEAR_TOLERANCE)[0]

    return jax.lax.custom_linear_solve(linear, right, solve, solve)


def _iterate(residual, start, tolerance):
    """Zero of a residual, and 1 where it was reached, else 0 (a bool has no derivative in custom_root)."""
    single = start.dtype != jnp.float64
    tolerance, smallest = (1e-5, 1e-5) if single else (tolerance, 1e-12)
    points, n = start.shape

    def reached(y, r):
        return jnp.max(jnp.abs(r), -1) <= tolerance * jnp.max(jnp.abs(y), -1)

    def step(state):
        k, y, good, last, moves, changes, ended = state
        r = residual(y)
        # Far from a solution a residual may be no number; then half the way back is tried.
        fine = jnp.all(jnp.isfinite(r), -1, keepdims=True)
        r = jnp.where(fine, r, last)
        # The first has no other before it: an empty column.
        kept = fine & (k > 0)
        moves = moves.at[(k - 1) % _HISTORY].set(jnp.where(kept, y - good, 0.0))
        changes = changes.at[(k - 1) % _HISTORY].set(jnp.where(kept, r - last, 0.0))
        # Normalised columns; an unused one is 0, and gets 0 from its own equation.
        size = jnp.sqrt(jnp.sum(changes * changes, -1))
        unit = changes / jnp.where(size > 0, size, 1.0)[..., None]
        normal = jnp.einsum("mpn,qpn->pmq", unit, unit)
        # Nearly parallel columns are as good as one; without this the matrix would be singular.
        ridge = jnp.where(size.T > 0, smallest, 1.0)[..., None]
        normal = normal + jnp.eye(_HISTORY, dtype=y.dtype) * ridge
        share = jnp.linalg.solve(normal, jnp.einsum("mpn,pn->pm", unit, r)[..., None])[..., 0]
        share = share.T / jnp.where(size > 0, size, 1.0)
        further = y + r - jnp.einsum("mp,mpn->pn", share, moves + changes)
        # A row ends where it itself is there, however long the others take: alone it is the same.
        following = jnp.where(fine, further, 0.5 * (y + good))
        return (
            k + 1,
            jnp.where(ended[:, None], y, following),
            jnp.where(fine, y, good),
            r,
            moves,
            changes,
            ended | (reached(y, r) & fine[:, 0]),
        )

    def unfinished(state):
        return (state[0] < _MOST_STEPS) & ~jnp.all(state[-1])

    empty = jnp.zeros((_HISTORY, points, n), start.dtype)
    state = (0, start, start, start, empty, empty, jnp.zeros(points, bool))
    _, y, *_, done = jax.lax.while_loop(unfinished, step, state)
    return y, done.astype(y.dtype)
