"""120-digit arithmetic on NumPy arrays of objects, and Gauss-Legendre quadrature in it."""

import functools
import math

import gmpy2
import numpy as np
from gmpy2 import mpfr

gmpy2.get_context().precision = 400
PI = gmpy2.const_pi()
ROOT_PI = gmpy2.sqrt(gmpy2.const_pi())

exp, erf, sqrt = (np.frompyfunc(f, 1, 1) for f in (gmpy2.exp, gmpy2.erf, gmpy2.sqrt))
sinh, cosh = (np.frompyfunc(f, 1, 1) for f in (gmpy2.sinh, gmpy2.cosh))
lesser = np.frompyfunc(min, 2, 1)


def true(mask):
    """Comparisons of objects as a mask that NumPy selects by."""
    return np.asarray(mask, bool)


@functools.cache
def gauss(order):
    """Nodes and weights on [0, 1], and the matrix of integrals from 0 to each node."""
    nodes, weights = [], []
    for i in range(order):
        x = mpfr(math.cos(math.pi * (order - i - 0.25) / (order + 0.5)))
        for _ in range(9):
            value, slope = _legendre(order, x)
            x -= value[-1] / slope
        value, slope = _legendre(order, x)
        nodes.append(x)
        weights.append(2 / ((1 - x * x) * slope**2))
    basis = np.array([_legendre(order, x)[0] for x in nodes], object)  # [node, degree]
    degree = np.arange(order)
    to_coefficients = (2 * degree[:, None] + 1) * basis[:, :-1].T * np.array(weights, object) / mpfr(2)
    integral = np.empty((order, order), object)  # of P_n from -1: (P_(n+1) - P_(n-1)) / (2 n + 1)
    integral[:, 0] = np.array(nodes, object) + 1
    integral[:, 1:] = (basis[:, 2:] - basis[:, : order - 1]) / (2 * degree[1:] + 1)
    nodes, weights = np.array(nodes, object), np.array(weights, object)
    return (nodes + 1) / 2, weights / 2, integral @ to_coefficients / 2


def _legendre(order, x):
    """P_0 ... P_order at x, and the slope of the last."""
    p = [mpfr(1), x]
    for n in range(1, order):
        p.append(((2 * n + 1) * x * p[n] - n * p[n - 1]) / (n + 1))
    return p, order * (x * p[-1] - p[-2]) / (x * x - 1)
