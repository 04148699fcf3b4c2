"""Composite Gauss rules of the oracles."""

import numpy as np


def composite(edges, order=12):
    """Return nodes and weights of the Gauss rules between each two edges, which are the last axis."""
    node, weight = (x / 2 for x in np.polynomial.legendre.leggauss(order))
    width = np.diff(edges)[..., None]
    shape = (*np.shape(edges)[:-1], -1)
    nodes = np.asarray(edges)[..., :-1, None] + width * (node + 0.5)
    return nodes.reshape(shape), (width * weight).reshape(shape)
