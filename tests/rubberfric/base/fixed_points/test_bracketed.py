"""Fixed points that hang on one number, however steeply."""

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.fixed_points.bracketed import bracketed

SLOPE = 1e2


def _falling(y):
    """x_k = x_(k-1) / 2 + w from x_0 = w on, and w = -tanh(slope (x_3 - aim)), each row with its aim."""
    x, w = y[:, :-1], y[:, -1:]
    before = jnp.concatenate([jnp.zeros_like(w), x[:, :-1]], 1)
    return jnp.concatenate([0.5 * before + w, -jnp.tanh(SLOPE * (x[:, -1:] - AIMS[: y.shape[0], None]))], 1)


AIMS = np.array([-0.3, 1e-3, 0.0, 0.9])


def test_steep_ones_are_found():
    """x_3 = (2 - 1/8) w, and where tanh is this steep it is the aim."""
    found, reached = jax.jit(lambda y: bracketed(_falling, y, np.zeros(4, bool), 1e-12))(jnp.zeros((4, 5)))
    assert reached.all()
    np.testing.assert_allclose(found, _falling(found), atol=1e-12)
    np.testing.assert_allclose(found[:, -2], 1.875 * found[:, -1], atol=1e-12)
    np.testing.assert_allclose(found[:, -2], AIMS, atol=1.2 / SLOPE)


def test_rows_do_not_mix_and_solved_ones_stay():
    alone, _ = bracketed(_falling, jnp.zeros((1, 5)), np.zeros(1, bool), 1e-12)
    found, reached = bracketed(_falling, jnp.zeros((4, 5)), np.array([False, True, False, True]), 1e-12)
    assert reached.all()
    np.testing.assert_array_equal(found[0], alone[0])
    np.testing.assert_array_equal(found[1::2], 0)
