"""Zeros within brackets against scipy and closed forms, and their implicit derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy

from rubberfric.base.roots import _search, first, root, zero

# Function and bracket.
FUNCTIONS = {
    "cosine": (lambda x: jnp.cos(x) - x, 0.0, 1.0),
    "cube in a wide bracket": (lambda x: x**3 - 2, 0.0, 1e3),
    "exponential": (lambda x: jnp.exp(x) - 1e5, -30.0, 200.0),
    "falling": (lambda x: 0.3 - x, -1.0, 2.0),
    "falling slowly": (lambda x: 1e-9 * (0.3 - x), -1.0, 2.0),
    "rising slowly": (lambda x: 1e-9 * (x - 0.3), -1.0, 2.0),
    "steep": (lambda x: jnp.tanh(50 * (x - 0.77)), -5.0, 9.0),
    "step": (lambda x: jnp.where(x > 0.123, 1.0, -1.0), -1.0, 1.0),
    "kink": (lambda x: jnp.where(x > 0.4, 1e6 * (x - 0.4), 1e-3 * (x - 0.4)), -3.0, 2.0),
    "exchanged ends": (lambda x: jnp.cos(x) - x, 1.0, 0.0),
}
# x exp(x) = A; dx/da and its derivative follow from those of the equation.
A = np.array([1e-30, 1e-6, 0.3, 1.0, 40.0, 1e6, 1e30])
X = scipy.special.lambertw(A).real
SLOPE = X / (A * (1 + X))
CURVATURE = -(X**2) * (X + 2) / (A**2 * (1 + X) ** 3)


def lambert(a):
    """Solve x exp(x) = a by y + exp(y) = ln a with y = ln x."""
    ends = jnp.full_like(a, -80.0), jnp.full_like(a, 5.0)
    return jnp.exp(root(lambda y: y + jnp.exp(y) - jnp.log(a), *ends)[0])


def cubic(numbers):
    """Solve x^3 + a x = b."""
    a, b = numbers
    return root(lambda x: x**3 + a * x - b, jnp.zeros_like(a), jnp.full_like(a, 10.0))[0]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_zeros_are_those_of_scipy(name):
    function, low, high = FUNCTIONS[name]
    found, changes = root(function, jnp.array(low), jnp.array(high))
    expected = scipy.optimize.brentq(lambda x: float(function(x)), low, high, xtol=1e-15, rtol=1e-14)
    assert changes and float(found) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("power", [1.0, 0.5])
def test_zeros_from_1e_minus_30_to_1e30(power):
    zeros = jnp.array(10.0 ** np.arange(-30.0, 31.0))

    def function(x):
        difference = jnp.exp(x) - zeros
        return jnp.sign(difference) * jnp.abs(difference) ** power

    found, changes = jax.jit(lambda: root(function, jnp.full(61, -80.0), jnp.full(61, 80.0)))()
    assert changes.all()
    np.testing.assert_allclose(found, np.log(zeros), rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("name", ["cosine", "cube in a wide bracket", "exponential", "steep"])
def test_smooth_functions_take_a_few_evaluations(name):
    """Bisection alone takes more than 50."""
    function, low, high = FUNCTIONS[name]
    assert _search(function, jnp.array(low), jnp.array(high)).round <= 25


def test_functions_may_overflow_within_the_bracket():
    found, changes = jax.jit(lambda: root(lambda x: jnp.exp(x) - 1e300, jnp.zeros(()), jnp.full((), 1e4)))()
    assert changes and float(found) == pytest.approx(300 * np.log(10), rel=1e-14)


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_first_derivatives(mode):
    np.testing.assert_allclose(jax.jit(lambert)(A), X, rtol=3e-14)
    np.testing.assert_allclose(jax.jit(mode(lambert))(jnp.asarray(A)), np.diag(SLOPE), rtol=1e-13)


@pytest.mark.parametrize("outer", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("inner", [jax.jacfwd, jax.jacrev])
def test_second_derivatives(outer, inner):
    numbers = jnp.array([0.7, 3.0])
    x = float(scipy.optimize.brentq(lambda x: x**3 + 0.7 * x - 3.0, 0.0, 10.0, xtol=1e-15))
    rise = 3 * x**2 + 0.7
    mixed = 6 * x**2 / rise**3 - 1 / rise**2
    expected = [[2 * x / rise**2 - 6 * x**3 / rise**3, mixed], [mixed, -6 * x / rise**3]]
    np.testing.assert_allclose(jax.jit(outer(inner(cubic)))(numbers), expected, rtol=1e-12)


def test_second_derivatives_along_a_direction():
    def slope(a):
        return jax.grad(lambda a: lambert(a).sum())(a)

    along = jax.jit(lambda a: jax.jvp(slope, (a,), (jnp.ones_like(a),))[1])(jnp.asarray(A[2:]))
    # At smaller a, where ln x = ln a, the second derivative of the exponential cancels.
    np.testing.assert_allclose(along, CURVATURE[2:], rtol=1e-12)


def test_elements_do_not_depend_on_each_other():
    a, jitted = jnp.asarray(A), jax.jit(lambert)
    for k in range(a.size):
        np.testing.assert_array_equal(jitted(jnp.full_like(a, 7.0).at[k].set(a[k]))[k], jitted(a)[k])


def test_vmap_of_values_and_slopes():
    a = jnp.asarray(A)
    np.testing.assert_allclose(jax.jit(jax.vmap(lambert))(a), jax.jit(lambert)(a), rtol=1e-14)
    np.testing.assert_allclose(jax.jit(jax.vmap(jax.grad(lambert)))(a), SLOPE, rtol=1e-13)


def test_ends_may_be_zeros():
    def found(c):
        return root(lambda x: x**2 - c, jnp.array([1.0, 0.0, 2.0]), jnp.array([2.0, 1.0, 1.0]))

    (x, changes), slope = jax.jit(found)(jnp.ones(3)), jax.jit(jax.jacrev(lambda c: found(c)[0]))(jnp.ones(3))
    assert changes.all()
    np.testing.assert_array_equal(x, 1.0)
    np.testing.assert_allclose(slope, np.diag([0.5] * 3), rtol=1e-14)


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_without_a_zero_the_nearer_end_is_returned(mode):
    def found(c):
        return root(lambda x: x**2 + c, jnp.array([1.0, -3.0, 0.5]), jnp.array([2.0, -2.0, 3.0]) * c)

    x, changes = jax.jit(found)(jnp.ones(3))
    assert not changes.any()
    np.testing.assert_array_equal(x, [1.0, -2.0, 0.5])
    np.testing.assert_array_equal(jax.jit(mode(lambda c: found(c)[0]))(jnp.ones(3)), 0.0)


def test_flat_functions():
    """Functions that are 0, constant, or 0 in a part of the bracket."""

    def found(c):
        def function(x):
            flat = jnp.maximum(x - c, 0.0) + jnp.minimum(x + c, 0.0)
            return jnp.stack([0 * x[0], 1 + 0 * x[1], flat[2]])

        return root(function, jnp.full(3, -3.0), jnp.full(3, 2.0))

    x, changes = jax.jit(found)(1.0)
    assert changes.tolist() == [True, False, True]
    assert x[0] == -3 and x[1] in (-3, 2) and -1 <= x[2] <= 1
    for mode in (jax.jacfwd, jax.jacrev):
        np.testing.assert_array_equal(jax.jit(mode(lambda c: found(c)[0]))(1.0), 0.0)


def test_not_a_number_is_no_zero():
    x, changes = jax.jit(lambda: root(lambda x: jnp.sqrt(x), jnp.full(2, -2.0), jnp.array([-1.0, 3.0])))()
    assert not changes.any() and np.isfinite(x).all()


def test_single_precision():
    a = jnp.asarray(A[1:-1], jnp.float32)
    x, slope = jax.jit(lambert)(a), jax.jit(jax.vmap(jax.grad(lambert)))(a)
    assert x.dtype == slope.dtype == jnp.float32
    np.testing.assert_allclose(x, X[1:-1], rtol=1e-6)
    np.testing.assert_allclose(slope, SLOPE[1:-1], rtol=2e-6)


def test_zeros_by_secants_of_functions_of_any_slope():
    """The first zero of a (exp(0.3 (z - r)) - 1) is r; a function that is negative everywhere has none."""
    top = jnp.asarray(10.0)

    def solved(scale, r):
        def function(z):
            return scale * jnp.expm1(0.3 * (z - r))

        return zero(function, first(function, top, 24), top)

    scale, r = (x.ravel() for x in np.meshgrid([1.0, 10.0, 100.0], [0.01, 0.7, 5.0, 9.9, 11.0]))
    z, found, _ = jax.jit(jax.vmap(solved))(scale, r)
    np.testing.assert_array_equal(found, r < 10)
    np.testing.assert_allclose(z, np.minimum(r, 10), rtol=0, atol=1e-10)
