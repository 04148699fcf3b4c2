"""Fixed points of many rows, and their derivatives, against closed forms."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy

from rubberfric.base import fixed_points
from rubberfric.base.fixed_points import fixed_point, implicit, linear_fixed_point

A = np.array([1e-12, 0.3, 1.0, 30.0, 1e6])
MATRIX = np.array([[0.5, 0.3, 0.0], [-0.2, 0.1, 0.6], [0.1, 0.0, -0.7]])
RIGHT = np.array([[1.0, -2.0, 0.5], [1e-6, 3.0, 1e3]])


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_derivatives_of_one_number_are_exact(mode):
    """y = a exp(-y) is Lambert's function: dy/da = y / (a (1 + y))."""
    known = scipy.special.lambertw(A).real

    def found(a):
        return implicit(lambda y: a[:, None] * jnp.exp(-y), jnp.asarray(known)[:, None])[:, 0]

    slopes = jax.jit(mode(found))(jnp.asarray(A))
    np.testing.assert_allclose(slopes, np.diag(known / (A * (1 + known))), rtol=1e-13)


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_several_numbers_of_a_row(mode):
    """y = M y + b: y = (1 - M)^-1 b."""
    inverse = np.linalg.inv(np.eye(3) - MATRIX)

    def found(right):
        def function(y):
            return y @ MATRIX.T + right

        return implicit(function, jax.lax.stop_gradient(fixed_point(function, right)[0]), tolerance=1e-12)

    y, reached = fixed_point(lambda y: y @ MATRIX.T + RIGHT, jnp.asarray(RIGHT), tolerance=1e-12)
    assert reached.all()
    np.testing.assert_allclose(y, RIGHT @ inverse.T, rtol=1e-9)
    slopes = jax.jit(mode(found))(jnp.asarray(RIGHT))
    expected = np.einsum("ij,pr->pirj", inverse, np.eye(2))
    np.testing.assert_allclose(slopes, expected, atol=1e-10)


def test_what_follows_from_a_linear_fixed_point():
    """Rows with an eigenvalue of -4, as of friction that rises with velocity, by a solution of the system."""
    rng = np.random.default_rng(4)
    f, b, c = 0.1 * rng.standard_normal((3, 6, 6)), rng.standard_normal((3, 6)), rng.standard_normal((3, 6))
    f[:, 0, 0] = -4.0

    def residual(y):
        return jnp.einsum("pij,pj->pi", f, y) + b - y, jnp.sum(c * y, 1)

    found = jax.jit(functools.partial(linear_fixed_point, residual))(jnp.zeros((3, 6)), jnp.zeros(3))
    wanted = [one @ np.linalg.solve(np.eye(6) - a, right) for a, right, one in zip(f, b, c, strict=True)]
    np.testing.assert_allclose(found, wanted, rtol=1e-7)


def test_a_row_alone_equals_itself_among_others():
    """Rows of few and of many steps beside one that never ends, and their derivatives."""
    factors = jnp.array([0.01, 0.5, 1.2, 1e3])[:, None]

    def root(factor):
        start = jnp.zeros((factor.shape[0], 12))
        return fixed_point(lambda y: factor * jnp.cos(jnp.linspace(0.5, 1.5, 12) * y), start)[0]

    def both(factor):
        return jax.jvp(root, (factor,), (jnp.ones_like(factor),))

    together = both(factors)
    for i in range(3):
        for alone, row in zip(both(factors[i : i + 1]), together, strict=True):
            np.testing.assert_allclose(alone[0], row[i], rtol=1e-13)


def test_what_did_not_converge_says_so(monkeypatch):
    monkeypatch.setattr(fixed_points, "_MOST_STEPS", 3)
    y, converged = fixed_point(lambda y: jnp.array([[0.0], [1.0]]) * jnp.cos(y), jnp.zeros((2, 5)))
    assert converged.tolist() == [True, False] and np.isfinite(y).all()
