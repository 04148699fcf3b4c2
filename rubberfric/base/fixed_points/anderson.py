r"""Fixed points y = f(y) of many independent points at once, with implicit derivatives.

Anderson's method: the next iterate is the combination of the last few whose residual is least,

.. math:: y_{k+1} = y_k + z_k - \sum_m \gamma_m (\Delta y_m + \Delta z_m),\qquad
          \gamma = \arg\min |z_k - \sum_m \gamma_m \Delta z_m|,\qquad z = M (f(y) - y)

[Walker & Ni, SIAM J. Numer. Anal. 49 (2011) 1715], M the identity or an approximate inverse of 1 - f'.
On a linear f it is GMRES, so that the same iteration solves the linear systems of the derivatives,
(1 - f') dy = df and its transpose.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

_HISTORY, _MOST_STEPS = 7, 80

# Residual over the largest element of a row at which a step is the last: it divides the residual by ten
# and more, which leaves friction 1e-12 off; and the same for the linear systems of the derivatives.
_TOLERANCE, _LINEAR_TOLERANCE = 1e-7, 1e-9


class Inverse(NamedTuple):
    """An approximate inverse of 1 - f', the identity plus a product of low rank: 1 + left right."""

    left: jax.Array  # (points, n, rank)
    right: jax.Array  # (rank, n)

    def __call__(self, x: jax.Array) -> jax.Array:
        """Of rows x, (points, n)."""
        return x + jnp.einsum("pnm,pm->pn", self.left, x @ self.right.T)

    def transposed(self, x: jax.Array) -> jax.Array:
        """The transpose, of rows x, (points, n)."""
        return x + jnp.einsum("pnm,pn->pm", self.left, x) @ self.right


def fixed_point(
    function: Callable[[jax.Array], jax.Array],
    start: jax.Array,
    inverse: Inverse | None = None,
    tolerance: float | None = None,
) -> tuple[jax.Array, jax.Array]:
    """Fixed point next to a start value, and whether it was reached; no derivatives.

    Parameters
    ----------
    function : from an array of shape (points, n) to one of that shape; rows do not mix
    start : shape (points, n)
    inverse : Inverse of 1 - f' near the start, or None
    tolerance : residual over the largest element of a row at which a step is the last; None: 1e-7
        (float32: 1e-5)

    Returns
    -------
    (y, reached), shapes (points, n) and (points,). A row does not depend on the others.

    Limits: residuals are a hundredth of the tolerance (float32: 1e-5).
    """
    goal = _TOLERANCE if tolerance is None else tolerance
    return _iterate(lambda y: function(y) - y, start, goal, inverse)[:2]


def implicit(
    function: Callable[[jax.Array], jax.Array],
    solution: jax.Array,
    inverse: Inverse | None = None,
    tolerance: float | None = None,
) -> jax.Array:
    """A known fixed point, with the derivatives that follow from it: (1 - f') dy = df.

    Parameters
    ----------
    function, inverse : as of `fixed_point`; `inverse` and what it was made from carry no derivatives
    solution : shape (points, n), without derivatives; where it is no fixed point, nor are they
    tolerance : of the linear system, as of `fixed_point`; None: 1e-9; of one number each it is exact
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
    """What a function of dy says at the zero of a residual f' dy + df - dy; no derivatives.

    As `implicit` gives derivatives, where f and what follows from it are one function, derived once.

    Parameters
    ----------
    residual : linear function of dy, shape (points, n), to that residual and what follows, of shape (points,)
    start : dy to begin with, shape (points, n)
    also : zeros of what follows, shape (points,)
    inverse : as of `fixed_point`
    """
    found = _iterate(residual, start, _LINEAR_TOLERANCE, inverse, also)[2]
    assert found is not None
    return found


def _tangent_solve(inverse, tolerance, linear, right):
    """Y of linear(y) = right, linear the derivative of f(y) - y."""

    def solve(inverse, product, right):
        if right.shape[-1] == 1:  # of one number each it is a division
            return right / product(jnp.ones_like(right))
        start = jnp.zeros_like(right)
        return _iterate(lambda y: product(y) - right, start, tolerance, inverse)[0]

    back = None if inverse is None else inverse.transposed
    return jax.lax.custom_linear_solve(
        linear, right, functools.partial(solve, inverse), functools.partial(solve, back)
    )


def _iterate(residual, start, tolerance, inverse=None, also=None):
    """Zero of a residual, whether it was reached, and what else the residual says where a row ends.

    also : zeros of that, shape (points,); None: nothing
    """
    single = start.dtype != jnp.float64
    tolerance, smallest = (1e-5, 1e-5) if single else (tolerance, 1e-12)
    points, n = start.shape

    def reached(y, z):
        return jnp.max(jnp.abs(z), -1) <= tolerance * jnp.max(jnp.abs(y), -1)

    def step(progress):
        k, y, good, last, moves, changes, ended, also = progress
        if also is None:
            z = residual(y)
        else:
            z, found = residual(y)
            also = jnp.where(ended, also, found)
        z = z if inverse is None else inverse(z)
        # Far from a solution a residual may be no number; then half the way back is tried.
        fine = jnp.all(jnp.isfinite(z), -1, keepdims=True)
        z = jnp.where(fine, z, last)
        # The first has no other before it: an empty column.
        kept = fine & (k > 0)
        moves = moves.at[(k - 1) % _HISTORY].set(jnp.where(kept, y - good, 0.0))
        changes = changes.at[(k - 1) % _HISTORY].set(jnp.where(kept, z - last, 0.0))
        # Normalised columns; an unused one is 0, and gets 0 from its own equation.
        size = jnp.sqrt(jnp.sum(changes * changes, -1))
        unit = changes / jnp.where(size > 0, size, 1.0)[..., None]
        normal = jnp.einsum("mpn,qpn->pmq", unit, unit)
        # Nearly parallel columns are as good as one; without this the matrix would be singular.
        ridge = jnp.where(size.T > 0, smallest, 1.0)[..., None]
        normal = normal + jnp.eye(_HISTORY, dtype=y.dtype) * ridge
        share = jnp.linalg.solve(normal, jnp.einsum("mpn,pn->pm", unit, z)[..., None])[..., 0]
        share = share.T / jnp.where(size > 0, size, 1.0)
        further = y + z - jnp.einsum("mp,mpn->pn", share, moves + changes)
        # A row ends where it itself is there, however long the others take: alone it is the same.
        following = jnp.where(fine, further, 0.5 * (y + good))
        return (
            k + 1,
            jnp.where(ended[:, None], y, following),
            jnp.where(fine, y, good),
            z,
            moves,
            changes,
            ended | (reached(y, z) & fine[:, 0]),
            also,
        )

    def going(progress):
        return (progress[0] < _MOST_STEPS) & ~jnp.all(progress[-2])

    empty = jnp.zeros((_HISTORY, points, n), start.dtype)
    progress = (0, start, start, start, empty, empty, jnp.zeros(points, bool), also)
    _, y, *_, done, also = jax.lax.while_loop(going, step, progress)
    return y, done, also
