"""P, S and Psi against their definitions in 40 digits."""

import functools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from rubberfric.theory.area.partial_contact import (
    contact_argument,
    contact_fraction,
    energy_factor,
    separation_weight,
)

# Both ends, both sides of the change from one table to the others at x = sqrt(2), and where the last ends.
X = [1e-20, 1e-12, 1e-6, 1e-3, 0.03, 0.3, 0.9, 1.4142, 1.4143, 1.9, 3.0, 5.49, 5.51, 8.0, 15.0, 26.0]


def slope(t, gamma):
    """s'(t) of s = gamma erf + (1 - gamma) erf^3."""
    return 2 / mp.sqrt(mp.pi) * mp.exp(-t * t) * (gamma + 3 * (1 - gamma) * mp.erf(t) ** 2)


def psi(x, gamma):
    """Psi(x) = int_x^inf s'(t) / t dt, which is linear in gamma as s' is."""
    with mp.workdps(40):
        return gamma * psi_at_end(x, 1) + (1 - mp.mpf(gamma)) * psi_at_end(x, 0)


@functools.cache
def psi_at_end(x, gamma):
    """Psi at gamma 0 or 1: over ln t up to 1, over t^2 beyond."""
    with mp.workdps(40):
        x, gamma = mp.mpf(x), mp.mpf(gamma)
        middle = max(x, mp.mpf(1))

        def beyond(z):
            t = mp.sqrt(middle**2 + z)
            return slope(t, gamma) / (2 * t * t)

        tail = mp.quad(beyond, [0, 0.5, 2, 8, 30, 100])
        if x >= 1:
            return tail
        return tail + mp.quad(lambda u: slope(mp.exp(u), gamma), [mp.log(x), min(mp.log(x) / 2, -3), -1, 0])


@pytest.mark.slow
@pytest.mark.parametrize("gamma", [0.0, 0.3, 0.5, 1.0])
def test_separation_weight(gamma):
    found = jax.jit(separation_weight)(jnp.array(X), gamma)
    exact = np.array([float(x * psi(x, gamma)) for x in X])
    error = np.abs(found - exact) / exact
    # Beyond 8 it is below 1e-28.
    assert (error <= np.where(np.array(X) < 10, 3e-11, 1e-8)).all(), error


@pytest.mark.parametrize("gamma", [0.0, 0.5, 1.0])
def test_derivatives_of_the_separation_weight(gamma):
    """d(x Psi)/dx = Psi - s', forwards and backwards; it is linear in gamma."""
    for mode in (jax.jacfwd, jax.jacrev):
        by_x, by_gamma = jax.jit(jax.vmap(mode(separation_weight, (0, 1)), (0, None)))(jnp.array(X), gamma)
        whole = [psi(x, gamma) for x in X]
        np.testing.assert_allclose(
            by_x,
            [float(value - slope(mp.mpf(x), gamma)) for x, value in zip(X, whole, strict=True)],
            rtol=1e-8,
        )
        exact = [float(x * (psi(x, 1.0) - psi(x, 0.0))) for x in X]
        np.testing.assert_allclose(by_gamma, exact, rtol=1e-8)


def test_argument_of_the_contact_fraction():
    """x = 1 / (2 sqrt G) to the smallest and largest G, and 27 with derivative 0 at G = 0."""
    g = np.logspace(-300, 300, 13)
    found, by_g = jax.jit(jax.vmap(jax.value_and_grad(contact_argument)))(jnp.array(g))
    free = g > 1 / 54**2
    np.testing.assert_allclose(found, np.where(free, 0.5 / np.sqrt(g), 27.0), rtol=1e-15)
    np.testing.assert_allclose(by_g[free], -0.25 * g[free] ** -1.5, rtol=1e-14)
    assert contact_fraction(contact_argument(jnp.zeros(()))) == 1
    slopes = jax.jit(jax.grad(lambda g, k: contact_fraction(contact_argument(k**2 * g)), (0, 1)))(0.0, 1e3)
    assert all(np.isfinite(slopes))


def test_fractions_and_factors():
    x = jnp.array(X)
    P = np.array([float(mp.erf(x)) for x in X])
    np.testing.assert_allclose(contact_fraction(x), P, rtol=1e-15)
    for gamma in (0.0, 0.4, 1.0):
        S = gamma + (1 - gamma) * P**2
        np.testing.assert_allclose(energy_factor(jnp.array(P), gamma), S, rtol=1e-15)
    assert (contact_fraction(jnp.linspace(0, 10, 300, dtype=jnp.float32)) <= 1).all()
