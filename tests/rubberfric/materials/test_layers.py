"""Stiffening factor of slabs against the printed formula in 60 digits."""

import functools
import itertools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from support.oracles.oracle_solids import slab_factor

import rubberfric as rf
from rubberfric.materials.in_series import in_series

X = np.array([*np.logspace(-8, 2, 41), 0.999999, 1.0, 1.000001, 59.9, 60.1, 1e4, 1e8])
POISSON = [0.0, 0.2, 0.3, 0.45, 0.499, 0.4999999999, 0.5]


def factor(x, poisson, base="bonded"):
    return rf.Slab(1.0, base).stiffening(poisson, x)


@pytest.mark.parametrize("poisson", POISSON)
def test_bonded(poisson):
    exact = [float(slab_factor(x, poisson)) for x in X]
    np.testing.assert_allclose(factor(X, poisson), exact, rtol=2e-14)


def test_frictionless():
    exact = [float(slab_factor(x, 0.3, "frictionless")) for x in X]
    np.testing.assert_allclose(factor(X, 0.3, "frictionless"), exact, rtol=2e-14)


exact_factor = functools.partial(slab_factor, digits=130)


def exact_derivative(function, at):
    """Central difference in 120 digits; the step is far below the x^2 = 1e-16 over which nu = 1/2 acts."""
    with mp.workdps(120):
        h = mp.mpf(at or 1) * mp.mpf(10) ** -35
        return float((function(mp.mpf(at) + h) - function(mp.mpf(at) - h)) / (2 * h))


factor_and_slopes = jax.jit(jax.value_and_grad(factor, argnums=(0, 1)))


@pytest.mark.parametrize("x", [1e-8, 1e-5, 1e-3, 0.1, 0.9, 1.1, 3.0, 10.0, 50.0])
@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49, 0.5])
def test_bonded_derivatives(x, poisson):
    """Relative to the value per unit ln x, and per unit Poisson ratio."""
    value, (by_x, by_poisson) = factor_and_slopes(x, poisson)
    exact_x = exact_derivative(lambda x: exact_factor(x, mp.mpf(poisson)), x)
    # One-sided at 1/2 would do; the formula itself goes on beyond, and so does the difference.
    exact_poisson = exact_derivative(lambda nu: exact_factor(mp.mpf(x), nu), poisson)
    assert abs(by_x - exact_x) * x < 1e-12 * value
    assert by_poisson == pytest.approx(exact_poisson, rel=1e-10, abs=1e-12 * float(value))


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_derivative_by_poisson_of_a_thin_slab_in_series(mode):
    """1e9 to 1e27 times as stiff as the solid that it is in series with, both modes to 12 digits."""
    rest, weight, tau, s = 4e6, np.array([8e8, 9e7]), np.array([1e-9, 1e-5]), 3e4

    @jax.jit
    @mode
    def slope(poisson, q, thickness, young):
        spring = young / (1 - poisson**2) * rf.Slab(thickness).stiffening(poisson, q)
        return in_series(rest + jnp.sum(weight * (s * tau / (1 + s * tau))), spring)

    for (thickness, young), q in itertools.product([(1e-6, 1e7), (1e-9, 1e7), (6e-10, 1e5)], (300.0, 5e4)):

        def exact(nu, thickness=thickness, young=young, q=q):
            spring = young / (1 - nu**2) * exact_factor(mp.mpf(q) * mp.mpf(thickness), nu)
            terms = (
                mp.mpf(w) * s * mp.mpf(t) / (1 + s * mp.mpf(t)) for w, t in zip(weight, tau, strict=True)
            )
            return 1 / (1 / spring + 1 / (rest + sum(terms)))

        found = slope(0.5, q, thickness, young)
        assert found == pytest.approx(exact_derivative(exact, 0.5), rel=1e-12, abs=0), (thickness, q)


@pytest.mark.parametrize("base", ["bonded", "frictionless"])
def test_thick_is_half_space(base):
    assert factor(1e8, 0.4, base) == 1.0
    assert jax.jit(jax.grad(factor), static_argnums=2)(1e8, 0.4, base) == 0.0


@pytest.mark.parametrize("base", ["bonded", "frictionless"])
def test_single_precision(base):
    x = np.logspace(-6, 8, 57)
    slab = rf.Slab(jnp.float32(1.0), base)
    single = jax.jit(slab.stiffening)(jnp.float32(0.45), jnp.asarray(x, jnp.float32))
    assert single.dtype == jnp.float32
    np.testing.assert_allclose(single, factor(x, 0.45, base), rtol=2e-6)
