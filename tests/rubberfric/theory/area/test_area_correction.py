"""S inside G: the table against dG/dg = S(P(G)) in 25 digits, solved as g(G) = int dG / S."""

import functools
import itertools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from rubberfric.theory.area.area_correction import correct_argument, correction_table

# From where S = 1 to the last bit, up to 1/400, to far beyond the table.
G = [1 / 400, 6e-3, 8e-3, 0.03, 0.1, 0.4, 1.0, 5.0, 30.0, 1e3, 1e6, 1e12, 1e17, 1e24]
GAMMAS = [0.3, 0.5, 1.0]


def energy_factor(G, gamma):
    """S = gamma + (1 - gamma) P^2."""
    return gamma + (1 - gamma) * mp.erf(1 / (2 * mp.sqrt(G))) ** 2


def integrals(function, start):
    """Integrals of a function of G up to every G, over ln G, from the value at the first one."""
    found = [mp.mpf(start)]
    for low, high in itertools.pairwise(map(mp.log, G)):
        ends = mp.linspace(low, high, 1 + int(mp.ceil((high - low) / 3)))
        found.append(found[-1] + mp.quad(lambda u: mp.exp(u) * function(mp.exp(u)), ends))
    return found


@functools.cache
def plain(gamma):
    """The plain g at which the corrected one is G, and its derivative by gamma, at every G."""
    with mp.workdps(25):

        def moving(G):
            S = energy_factor(G, gamma)
            return -(1 - mp.erf(1 / (2 * mp.sqrt(G))) ** 2) / S**2

        return integrals(lambda G: 1 / energy_factor(G, gamma), G[0]), integrals(moving, 0)


def arguments(values):
    """x = 1 / (2 sqrt G), as the functions have it at most 27."""
    return jnp.array([min(float(1 / (2 * mp.sqrt(value))), 27.0) for value in values])


def corrected(x, gamma):
    return correct_argument(correction_table(gamma), x)


@pytest.mark.parametrize("gamma", [GAMMAS[0], *(pytest.param(g, marks=pytest.mark.slow) for g in GAMMAS[1:])])
def test_corrected_argument(gamma):
    found = jax.jit(corrected)(arguments(plain(gamma)[0]), jnp.array(gamma))
    np.testing.assert_allclose(found, arguments(G), rtol=2e-11)


@pytest.mark.parametrize("gamma", [GAMMAS[0], *(pytest.param(g, marks=pytest.mark.slow) for g in GAMMAS[1:])])
def test_derivatives(gamma):
    """d ln G / d ln g = S g / G; and by gamma, at a given g."""
    g, by_gamma = plain(gamma)
    x, gamma = arguments(g), jnp.array(gamma)
    value, by_x = jax.jit(jax.vmap(jax.value_and_grad(corrected), (0, None)))(x, gamma)
    slope = jax.jit(jax.vmap(jax.jacfwd(corrected, 1), (0, None)))(x, gamma)
    S = [energy_factor(G, float(gamma)) for G in G]
    exact = [float(S * g / G) for S, g, G in zip(S, g, G, strict=True)]
    np.testing.assert_allclose(by_x * x / value, exact, rtol=1e-9)
    # dG/dgamma at constant g is -S dg/dgamma at constant G, and d ln x = -d ln G / 2.
    exact = [float(S * by / (2 * G)) for S, by, G in zip(S, by_gamma, G, strict=True)]
    np.testing.assert_allclose(slope / value, exact, rtol=1e-9, atol=1e-11)


def test_light_loads_without_an_elastic_energy_factor():
    """At gamma = 0 G grows like a root of g only; there is a solution all the same."""
    x = jnp.logspace(-12, 1.4, 60)
    value, slope = jax.jit(jax.vmap(jax.value_and_grad(corrected), (0, None)))(x, jnp.zeros(()))
    assert np.isfinite(value).all() and np.isfinite(slope).all()
    assert (np.diff(value) > 0).all() and (np.array(value) >= x * (1 - 1e-12)).all()
    # P^2 = 1 / (pi G) there, and G^2 = 2 g / pi: within the table and beyond it.
    x = np.array([1e-12, 1e-20, 1e-26])
    G = np.sqrt(2 / np.pi) / (2 * x)
    np.testing.assert_allclose(jax.jit(corrected)(jnp.array(x), jnp.zeros(())), 0.5 / np.sqrt(G), rtol=1e-9)
