"""Fixed points of many rows, and their derivatives, against closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy

from rubberfric.base.fixed_points import fixed_point, implicit

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
