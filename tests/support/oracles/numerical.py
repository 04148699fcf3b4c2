"""Integrals by Gauss rules, and derivatives by differences."""

import numpy as np

# Central differences of fourth order times 12. Integers do not round.
_WEIGHTS = {-2: 1, -1: -8, 1: 8, 2: -1}


def composite(edges, order=12):
    """Return nodes and weights of the Gauss rules between each two edges, which are the last axis."""
    node, weight = (x / 2 for x in np.polynomial.legendre.leggauss(order))
    width = np.diff(edges)[..., None]
    shape = (*np.shape(edges)[:-1], -1)
    nodes = np.asarray(edges)[..., :-1, None] + width * (node + 0.5)
    return nodes.reshape(shape), (width * weight).reshape(shape)


def derivatives(function, size, step):
    """Return the derivatives of a function of a vector at 0, with respect to each of its elements."""

    def along(unit):
        return sum(weight * np.asarray(function(k * step * unit)) for k, weight in _WEIGHTS.items())

    return np.array([along(unit) / (12 * step) for unit in np.eye(size)])
