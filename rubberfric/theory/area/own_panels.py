r"""Panels of every point of its own, over the wavevectors at which its contact is pulled off.

The mesh of the roughness (`rubberfric.roughness.mesh`) serves all loads, and most of its panels are where
only one load in many needs them. A point needs some seventy nodes of its own: from where roughness first
takes contact away, or from where the detachment stress begins, with borders at the kinks of the spectra.
With l = ln(q/q0) from the first wavevector (`log_q`), l_0 where the detachment stress begins and y the
coordinate of a panel

.. math:: l = l_0 + (l_1 - l_0)\, y^2,\qquad l = l_0 + (l_k - l_0) \Big(\frac{l_{k+1} - l_0}{l_k - l_0}\Big)^y

of the one that begins at l_0 and the others: what begins as the square root of l - l_0 is smooth in y.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import chebyshev

from rubberfric.base.quadrature import gauss, typed
from rubberfric.roughness.mesh.radial_mesh import Mesh

# Panels are even in ln g over the first and log_q over the second number, but for this power of their order:
# closer where the detachment stress begins. Of those tried the least error with six panels.
_RISE, _SPAN, _CLOSER = 5.0, 1.2, 1.5


class Table(NamedTuple):
    """Functions of log_q by their Chebyshev coefficients in every panel of the mesh of the roughness."""

    borders: jax.Array  # log_q at the borders, (panels + 1,)
    maps: jax.Array  # of the coordinate of each panel, (panels, 4): `_maps`
    kinks: jax.Array  # log_q of the kinks of the spectra between the first and the last wavevector
    position: jax.Array  # log_q at the nodes and at the end, in a row, without derivatives
    coefficients: jax.Array  # (panels, points, functions, order)

    def __call__(self, log_q: jax.Array, which: slice) -> tuple[jax.Array, jax.Array]:
        """Functions at log_q (nodes, points), (functions, nodes, points), and dl / d coordinate there."""
        panel = jnp.sum(self.borders[1:-1, None, None] <= log_q, 0)
        y, stretch = _coordinate(log_q, self.maps.at[panel].get(mode="promise_in_bounds"))
        chosen = self.coefficients[:, :, which]
        chosen = chosen.at[panel, np.arange(log_q.shape[1])].get(mode="promise_in_bounds")
        found = jnp.sum(chosen * _chebyshev(y, chosen.shape[-1])[:, :, None], -1)
        return jnp.moveaxis(found, -1, 0), stretch


def table(mesh: Mesh, values: list[jax.Array]) -> Table:
    """`Table` of values at the nodes of a mesh, (panels, points or 1, order)."""
    stacked = jnp.stack(jnp.broadcast_arrays(*values), 2)
    position = jnp.append(jnp.log(mesh.q / mesh.first).reshape(-1), mesh.borders[-1])
    return Table(
        mesh.borders,
        _maps(mesh.borders, mesh.origin),
        jnp.sort(jnp.concatenate(mesh.kinks))[1:-1],
        jax.lax.stop_gradient(position),
        stacked @ typed(_transform(mesh.q.shape[1]).T, mesh.q),
    )


@functools.cache
def _transform(order):
    """Matrix from values at the Gauss nodes to Chebyshev coefficients."""
    return np.linalg.inv(chebyshev.chebvander(2 * gauss(order)[0] - 1, order - 1))


def _chebyshev(y, order):
    """Chebyshev polynomials below an order, at y in [0, 1]; (*y.shape, order).

    T_(k+j) = 2 T_k T_j - T_(k-j): half of them from the other half, in few operations.
    """
    x = 2 * y - 1
    basis = jnp.stack([jnp.ones_like(x), x], -1)
    while (k := basis.shape[-1] - 1) < order - 1:
        further = 2 * basis[..., k:] * basis[..., 1:] - basis[..., k - 1 :: -1]
        basis = jnp.concatenate([basis, further], -1)
    return basis[..., :order]


def _maps(borders, origin):
    """Where panels begin, 1 / width, width, and the root of how far from the origin they begin over end."""
    left, width = borders[:-1], jnp.diff(borders)
    fixed, span, origin = jax.lax.stop_gradient((left, borders[1:] - origin, origin))
    # A panel without width has only one place.
    rate = jnp.where(width > 0, 1 / jnp.where(width > 0, width, 1.0), 0.0)
    start = root((fixed - origin) / jnp.where(span > 0, span, 1.0))
    return jnp.stack([left, rate, width, start], -1)


def _coordinate(log_q, maps):
    """The inverse of the map of the nodes of a mesh, and dl / d coordinate."""
    left, rate, width, start = jnp.moveaxis(maps, -1, 0)
    share = jnp.clip((log_q - left) * rate, 0.0, 1.0)
    bend = root(start * start + (1 - start * start) * share)
    # In the panel at the origin, start = 0, by the fourth root.
    both, first = start + bend, root(bend)
    later = share * (1 + start) / jnp.where(both > 0, both, 1.0)
    stretch = jnp.where(start > 0, 2 * bend / (1 + start), 4 * first**3)
    return jnp.where(start > 0, later, first), width * stretch


def root(square: jax.Array) -> jax.Array:
    """The square root of what is positive, else 0; with derivative 0 at 0."""
    positive = square > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1.0)), 0.0)


def inverse(position: jax.Array, values: jax.Array, wanted: jax.Array) -> jax.Array:
    """Where rising values at positions, both (nodes, points), reach wanted ones, (n, points); linear between.

    Without derivatives: what is found begins a search, or is as good as another place.
    """
    position, values, wanted = jax.lax.stop_gradient((position, values, wanted))
    after = jnp.clip(jnp.sum(values[:, None] <= wanted, 0), 1, values.shape[0] - 1)
    at = jnp.stack([after - 1, after]), np.arange(values.shape[1])
    (low, high), (begin, end) = (each.at[at].get(mode="promise_in_bounds") for each in (values, position))
    rise = high - low
    share = jnp.where(rise > 0, (wanted - low) / jnp.where(rise > 0, rise, 1.0), 0.0)
    return begin + jnp.clip(share, 0.0, 1.0) * (end - begin)


class Panels(NamedTuple):
    """Own panels of points."""

    origin: jax.Array  # l_0, (points,)
    borders: jax.Array  # log_q, rising, (panels + 1, points)
    log_q: jax.Array  # of the nodes, (panels, order, points)
    weight: jax.Array  # of an integral over log_q

    def interpolated(self, values: jax.Array, log_q: jax.Array) -> jax.Array:
        """Values of the nodes at log_q, (any, points); beyond the ends those of the ends."""
        order, point = values.shape[1], np.arange(log_q.shape[1])
        panel = jnp.sum(self.borders[1:-1, None] <= log_q, 0)
        left, right = (self.borders.at[k, point].get(mode="promise_in_bounds") for k in (panel, panel + 1))
        low, high = left - self.origin, right - self.origin
        rise = jnp.clip(log_q - self.origin, low, high)
        apart = (low > 0) & (high > low)
        ratio = jnp.log(jnp.where(apart, high / jnp.where(apart, low, 1.0), 2.0))
        later = jnp.log(jnp.where(apart, rise / jnp.where(apart, low, 1.0), 1.0)) / ratio
        first = root(jnp.where(high > 0, rise / jnp.where(high > 0, high, 1.0), 0.0))
        y = jnp.where(low > 0, later, first)
        coefficients = jnp.einsum("ij,kjp->kpi", typed(_transform(order), values), values)
        chosen = coefficients.at[panel, point].get(mode="promise_in_bounds")
        return jnp.sum(chosen * _chebyshev(y, order), -1)


def panels_from(
    begin: jax.Array, origin: jax.Array, table: Table, log_g: jax.Array, count: int, order: int
) -> Panels:
    """Panels from a first log_q on.

    Parameters
    ----------
    begin : where they begin, (points,)
    origin : l_0, there or before
    table : Table
    log_g : ln g at the positions of the table, (nodes, points)
    count : panels, to which those between kinks are added
    order : nodes of a panel

    Returns
    -------
    Panels; those whose kinks lie before are without width
    """
    end, points = table.borders[-1], begin.shape[0]
    # Between kinks it does not matter where the borders are: they carry no derivatives.
    measure = jax.lax.stop_gradient(log_g / _RISE + table.position[:, None] / _SPAN)
    position = jnp.broadcast_to(table.position[:, None], measure.shape)
    first = inverse(measure, position, begin[None])[0]
    shares = typed((np.arange(1, count) / count) ** _CLOSER, begin)[:, None]
    even = inverse(position, measure, first + (measure[-1] - first) * shares)
    kinks = jnp.broadcast_to(table.kinks[:, None], (table.kinks.shape[0], points))
    inner = jnp.concatenate([even, kinks])
    # Selected, not clipped: a clip would give half the derivative to a border at an end.
    inner = jnp.where(inner > begin, jnp.where(inner < end, inner, end), begin)
    borders = jnp.concatenate([begin[None], jnp.sort(inner, 0), jnp.broadcast_to(end, (1, points))])
    node, weight = (typed(one, begin)[:, None] for one in gauss(order))
    rise = borders - origin
    low, high = rise[:-1, None], rise[1:, None]
    apart = (low > 0) & (high > low)
    ratio = jnp.log(jnp.where(apart, high / jnp.where(apart, low, 1.0), 1.0))
    later, begins = low * jnp.exp(ratio * node), ~(low > 0)
    nodes = origin + jnp.where(begins, high * node**2, later)
    return Panels(origin, borders, nodes, jnp.where(begins, 2 * high * node, ratio * later) * weight)
