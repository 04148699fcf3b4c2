"""Splines of degree nine: polynomials exactly, waves, derivatives, and continuity between cells."""

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.splines import BESIDE, MARGIN, at, splines

ENTRIES = np.arange(120.0)
FIRST = MARGIN + BESIDE  # entry at which the first cell begins
POSITIONS = np.linspace(0.2, 70.3, 57)


def test_polynomials_up_to_degree_nine_are_exact():
    # The truncated weights leave an error of 1e-10 of the largest entry.
    for degree in range(10):
        polynomial = np.polynomial.Polynomial.basis(degree, domain=[0, ENTRIES[-1]])
        found = at(splines(jnp.asarray(polynomial(ENTRIES))[None]), jnp.asarray(POSITIONS))[0]
        np.testing.assert_allclose(found, polynomial(FIRST + POSITIONS), atol=1e-9)


def test_a_wave_of_eight_entries_and_its_derivatives():
    """Interpolation of degree n has errors of order (2 pi / period)^(n + 1)."""
    k = 2 * np.pi / 8
    cells = splines(jnp.asarray(np.stack([np.sin(k * ENTRIES), np.cos(k * ENTRIES)])))

    def value(x):
        return at(cells, x[None])[:, 0]

    x = jnp.asarray(POSITIONS)
    exact = np.stack([np.sin(k * (FIRST + x)), np.cos(k * (FIRST + x))])
    np.testing.assert_allclose(jax.vmap(value)(x).T, exact, atol=2e-6)
    slope = jax.vmap(jax.jacfwd(value))(x).T
    np.testing.assert_allclose(slope, k * np.stack([exact[1], -exact[0]]), atol=2e-5)


def test_eight_derivatives_are_continuous_between_cells():
    cells = np.asarray(splines(jnp.asarray(np.random.default_rng(1).normal(size=(1, 120)))))[:, 0]
    pieces = [np.polynomial.Polynomial(cell) for cell in cells.T]
    for order in range(9):
        ends = np.array([piece.deriv(order)(np.array([-0.5, 0.5])) for piece in pieces])
        np.testing.assert_allclose(ends[:-1, 1], ends[1:, 0], atol=1e-11 * np.abs(ends).max())
