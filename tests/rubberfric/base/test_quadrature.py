"""Node tables: rules of the host against integrals in closed form."""

import mpmath as mp
import numpy as np
import pytest
from numpy.polynomial import legendre

from rubberfric.base.quadrature import (
    chebyshev_fit,
    cumulative,
    gauss,
    legendre_transform,
    nodes_between,
    weights_between,
)

ORDERS = [4, 7, 12, 20]


@pytest.mark.parametrize("order", ORDERS)
def test_gauss_rules_are_exact_to_their_degree(order):
    node, weight = gauss(order)
    assert ((node > 0) & (node < 1)).all() and (weight > 0).all()
    for degree in range(2 * order):
        assert np.sum(weight * node**degree) == pytest.approx(1 / (degree + 1), rel=1e-14)


@pytest.mark.parametrize("order", ORDERS)
def test_coefficients_of_legendre_polynomials(order):
    node, _ = gauss(order)
    coefficients = np.random.default_rng(0).normal(size=order)
    values = legendre.legval(2 * node - 1, coefficients)
    np.testing.assert_allclose(legendre_transform(order) @ values, coefficients, atol=1e-13)


@pytest.mark.parametrize("order", ORDERS)
def test_gaps_between_nodes_are_summed_by_positive_weights(order):
    """Each gap separately: polynomials of degree 9, because a gap has five nodes."""
    borders = np.concatenate([[0.0], gauss(order)[0]])
    y, weight = nodes_between(order).reshape(order, -1), weights_between(order)
    assert (weight > 0).all()
    assert ((y > borders[:-1, None]) & (y < borders[1:, None])).all()
    for degree in range(10):
        exact = np.diff(borders ** (degree + 1)) / (degree + 1)
        np.testing.assert_allclose(np.sum(weight * y**degree, -1), exact, rtol=1e-12, atol=1e-17)


def up_to(x, growth, degree):
    """int_0^x e^(growth t) [2 + P_degree(2 t - 1)] dt."""
    with mp.workdps(30):
        return float(mp.quad(lambda t: mp.exp(growth * t) * (2 + mp.legendre(degree, 2 * t - 1)), [0, x]))


@pytest.mark.parametrize(("growth", "rtol"), [(0.0, 1e-9), (3.0, 1e-9), (-8.0, 1e-8), (14.0, 3e-7)])
@pytest.mark.parametrize("order", [7, 12])
def test_cumulative_rule(order, growth, rtol):
    """A steep factor known anywhere times a polynomial known at the nodes; all digits of the small end."""
    node, rule = gauss(order)[0], cumulative(order)
    steep = np.exp(growth * nodes_between(order))
    for degree in (0, 1, 4, order - 1):
        known = 2 + legendre.Legendre.basis(degree)(2 * node - 1)
        found = np.einsum("s,ski,i->k", steep, rule, known)
        exact = np.array([up_to(x, growth, degree) for x in node])
        np.testing.assert_allclose(found, exact, rtol=rtol)
        assert found[0] == pytest.approx(exact[0], rel=1e-13)
    assert (np.einsum("s,ski->k", steep, rule) > 0).all()


def test_fit_by_chebyshev_polynomials():
    """In powers of u on [-1, 1]."""
    coefficients = chebyshev_fit(lambda z: np.exp(-z) * z, 1.0, 3.0, 16)
    u = np.linspace(-1, 1, 41)
    z = 2 + u
    np.testing.assert_allclose(np.polyval(coefficients[::-1], u), np.exp(-z) * z, rtol=1e-13)


def test_tables_cannot_be_written_to():
    for table in (*gauss(5), legendre_transform(5), nodes_between(5), weights_between(5), cumulative(5)):
        with pytest.raises(ValueError, match="read-only"):
            table[0] = 1.0
