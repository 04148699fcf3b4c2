"""Tables and weights of the separations, against their formulas and SciPy."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import special

from rubberfric.theory.area.separations import loss_table, loss_weight, scaled_erfc, spread


def test_the_table_of_where_contact_is_lost():
    """Against derivatives of the formula."""
    log_x = np.random.default_rng(0).uniform(-12, 1.6, 300)
    small = np.linspace(-39.9, -12, 100)

    @jax.jit
    def both(log_x, gamma, c):
        slope = jax.vmap(jax.grad(lambda t: -loss_weight(jnp.exp(t), c, gamma)))(log_x)
        return loss_table(gamma)(jnp.asarray(log_x), c), slope

    for gamma, c in ((0.5, 4 / math.pi), (0.0, 30.0), (1.0, 0.0)):
        table, slope = both(log_x, gamma, c)
        np.testing.assert_allclose(table, slope, atol=3e-8 * float(np.abs(slope).max()) + 1e-10)
        np.testing.assert_allclose(*both(small, gamma, c), rtol=1e-6)


@pytest.mark.parametrize("place", range(3), ids=["log_x", "c", "gamma"])
def test_derivatives_of_the_table_of_the_losses_are_differences(place):
    log_x = jnp.asarray(np.random.default_rng(1).uniform(-3, 1.5, 50))
    at, move = (log_x, jnp.asarray(1.3), jnp.asarray(0.4)), [jnp.zeros(50), jnp.zeros(()), jnp.zeros(())]
    move[place] = jnp.ones_like(move[place])

    @jax.jit
    def value(log_x, c, gamma):
        return loss_table(gamma)(log_x, c)

    def moved(step):
        return value(*(x + step * dx for x, dx in zip(at, move, strict=True)))

    _, slope = jax.jvp(value, at, tuple(move))
    np.testing.assert_allclose(slope, (moved(1e-5) - moved(-1e-5)) / 2e-5, rtol=1e-5, atol=1e-6)


@pytest.mark.slow
def test_the_weights_of_the_separations():
    """erfcx and the mean over Gaussians, against scipy and a sum."""
    z = np.geomspace(1e-3, 1e9, 100)
    np.testing.assert_allclose(scaled_erfc(jnp.asarray(z)), special.erfcx(z), rtol=1e-14)
    for u, h, r in ((1.0, 0.5, 0.3), (0.2, 1.0, 3.0), (5.0, 0.01, 2.0), (1e-3, 1.0, 0.05), (40.0, 1.0, 5.0)):
        grid, step = np.linspace(-12, 12, 2000001, retstep=True)
        mean = np.sum(np.exp(-np.abs(u + h * grid) / r - grid**2 / 2)) * step / math.sqrt(2 * math.pi)
        assert float(spread(*map(jnp.asarray, (u, h, r)))) == pytest.approx(mean, rel=1e-6)
