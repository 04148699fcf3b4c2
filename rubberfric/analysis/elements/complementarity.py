r"""Contact without adhesion on a periodic grid, of a solid whose stiffness is complex and known by mode.

With displacements u(q) = p(q) / K(q) and Re K > 0, heights h and a mean pressure, pressures and gaps are

.. math:: p \ge 0,\qquad g = d + u - h \ge 0,\qquad p\, g = 0,\qquad \langle p\rangle = 1

a monotone problem 0 = A p + N p. Douglas and Rachford's splitting alternates its two resolvents, a division
in Fourier space and a projection in real space [Lions & Mercier, SIAM J. Numer. Anal. 16 (1979) 964],

.. math:: p(q) = \frac{K (z + h)}{1 + K},\qquad z \leftarrow z + \max(2 p - z, 0) - p

and Anderson's method speeds it up [Fu, Zhang & Boyd, SIAM J. Sci. Comput. 42 (2020) A3560, arXiv:1908.11482].
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

# Steps that Anderson's method remembers; and how far above its least the residual may rise before it forgets.
_HISTORY, _RISE = 5, 1e2


class Contact(NamedTuple):
    """A solution, in the units of `solve_contact`."""

    pressure: jax.Array
    gap: jax.Array
    iterations: jax.Array
    residual: jax.Array


class _State(NamedTuple):
    """Of the iteration z: its residual, and the last steps of both."""

    step: jax.Array
    z: jax.Array
    change: jax.Array
    steps: jax.Array
    changes: jax.Array
    products: jax.Array  # of the changes with each other
    residual: jax.Array
    least: jax.Array


@functools.partial(jax.jit, static_argnames=("most_steps",))
def solve_contact(
    heights: jax.Array, stiffness: jax.Array, tolerance: float, most_steps: int = 2000
) -> Contact:
    """Pressures and gaps, the mean pressure being 1.

    Parameters
    ----------
    heights : shape (n, n)
    stiffness : K of the modes of `rfft2`, shape (n, n/2 + 1), complex; that of the mean is not used
        Units are such that the stiffness that counts most is 1: the number of steps depends on it.
    tolerance : of the residual, root mean square of a step over that of the pressure
    most_steps : static

    Returns
    -------
    Contact; of more steps than allowed the last one. Pressure and gap are >= 0 and never both > 0, and they
    are those of the heights but for the residual.
    """
    pull = jnp.fft.rfft2(heights)
    share = stiffness / (1 + stiffness)

    def relaxed(z):
        modes = share * (jnp.fft.rfft2(z) + pull)
        return jnp.fft.irfft2(modes.at[0, 0].set(z.size), s=z.shape)

    def change_at(z):
        p = relaxed(z)
        change = jnp.maximum(2 * p - z, 0.0) - p
        return change, jnp.sqrt(jnp.sum(change**2) / jnp.sum(p**2))

    def advance(state):
        # Differences of which nothing is known yet, or that are the same, get no share.
        regular = jnp.diag(1e-10 * jnp.trace(state.products) + (jnp.diag(state.products) == 0))
        projected = jnp.einsum("mxy,xy->m", state.changes, state.change)
        shares = jnp.linalg.solve(state.products + regular, projected)
        step = state.change - jnp.einsum("m,mxy->xy", shares, state.steps + state.changes)
        change, residual = change_at(state.z + step)
        place = state.step % _HISTORY
        changes = state.changes.at[place].set(change - state.change)
        row = jnp.einsum("mxy,xy->m", changes, changes[place])
        # From there the plain splitting, which always approaches a solution.
        kept = residual < _RISE * state.least
        return _State(
            state.step + 1,
            state.z + step,
            change,
            jnp.where(kept, state.steps.at[place].set(step), 0.0),
            jnp.where(kept, changes, 0.0),
            jnp.where(kept, state.products.at[place].set(row).at[:, place].set(row), 0.0),
            residual,
            jnp.minimum(residual, state.least),
        )

    def goes_on(state):
        return (state.step < most_steps) & (state.residual > tolerance)

    start = jnp.ones_like(heights)
    change, residual = change_at(start)
    nothing = jnp.zeros((_HISTORY, *heights.shape), heights.dtype)
    products = jnp.zeros((_HISTORY, _HISTORY), heights.dtype)
    first = _State(jnp.zeros((), int), start, change, nothing, nothing, products, residual, residual)
    last = jax.lax.while_loop(goes_on, advance, first)
    reflected = 2 * relaxed(last.z) - last.z
    return Contact(jnp.maximum(reflected, 0.0), jnp.maximum(-reflected, 0.0), last.step, last.residual)
