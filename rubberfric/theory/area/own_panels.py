r"""Panels of every point of its own, over the wavevectors at which its contact is pulled off.

The mesh of the roughness (`rubberfric.roughness.mesh`) serves all loads, and most of its panels are where
only one load in many needs them. A point needs some seventy nodes of its own: from where roughness first
takes contact away, or from where the detachment stress begins, with borders at the kinks of the spectra.
With l = ln(q/q0) from the first wavevector (`log_q`), l_0 where the detachment stress begins and y the
coordinate of a panel

.. math:: l = l_0 + (l_1 - l_0)\, y^2,\qquad l = l_0 + (l_k - l_0) \Big(\frac{l_{k+1} - l_0}{l_k - l_0}\Big)^y

of the one that begins at l_0 and the others: what begins as the square root of l - l_0 is smooth in y.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import gauss, legendre_transform, typed
from rubberfric.roughness.mesh import Mesh

# Panels are even in ln g over the first and log_q over the second number, but for this power of their order:
# closer where the detachment stress begins. Of those tried the least error with six panels.
_RISE, _SPAN, _CLOSER = 5.0, 1.2, 1.5


class Table(NamedTuple):
    """Functions of log_q by their Legendre coefficients in every panel of the mesh of the roughness."""

    borders: jax.Array  # log_q at the borders, (panels + 1,)
    origin: jax.Array  # where the roughness of a panel began, (panels,)
    kinks: jax.Array  # log_q of the kinks of the spectra between the first and the last wavevector
    position: jax.Array  # log_q at the nodes and at the end, in a row, without derivatives
    coefficients: tuple[jax.Array, ...]  # of each function, (panels, points or 1, order)

    def __call__(self, log_q: jax.Array, which: tuple[int, ...]) -> list[jax.Array]:
        """Functions at log_q, (nodes, points), and last of the list dl / d coordinate of a panel."""
        panel = jnp.sum(self.borders[1:-1, None, None] <= log_q, 0)
        ends = self.borders[:-1], self.borders[1:], self.origin
        y, stretch = _coordinate(log_q, *(values.at[panel].get(mode="promise_in_bounds") for values in ends))
        basis = _legendre(y, self.coefficients[0].shape[-1])
        found = []
        for coefficients in (self.coefficients[k] for k in which):
            point = np.arange(log_q.shape[1]) if coefficients.shape[1] > 1 else 0
            found.append(jnp.sum(coefficients.at[panel, point].get(mode="promise_in_bounds") * basis, -1))
        return [*found, stretch]


def table(mesh: Mesh, values: tuple[jax.Array, ...]) -> Table:
    """`Table` of values at the nodes of a mesh, (panels, points or 1, order)."""
    transform = typed(legendre_transform(mesh.q.shape[1]).T, mesh.q)
    position = jnp.append(jnp.log(mesh.q / mesh.first).reshape(-1), mesh.borders[-1])
    return Table(
        mesh.borders,
        jnp.broadcast_to(mesh.origin, mesh.borders.shape[0] - 1),
        jnp.sort(jnp.concatenate(mesh.kinks))[1:-1],
        jax.lax.stop_gradient(position),
        tuple(one @ transform for one in values),
    )


def _legendre(y, order):
    """Legendre polynomials below an order, at y in [0, 1]; (*y.shape, order)."""
    x = 2 * y - 1
    basis = [jnp.ones_like(x), x]
    for n in range(1, order - 1):
        basis.append(((2 * n + 1) * x * basis[n] - n * basis[n - 1]) / (n + 1))
    return jnp.stack(basis, -1)


def _coordinate(log_q, left, right, origin):
    """The inverse of the map of the nodes of a mesh, and dl / d coordinate."""
    fixed_left, fixed_right = jax.lax.stop_gradient((left, right))
    width, span = right - left, fixed_right - origin
    # A panel without width has only one place.
    share = jnp.where(width > 0, (log_q - left) / jnp.where(width > 0, width, 1.0), 0.0)
    share = jnp.clip(share, 0.0, 1.0)
    ratio = jnp.maximum(fixed_left - origin, 0.0) / jnp.where(span > 0, span, 1.0)
    fourth = root(root(share))
    bend = root(ratio + (1 - ratio) * share)
    ratio = jnp.sqrt(ratio)
    first, sum_of_both = fixed_left <= origin, ratio + bend
    later = share * (1 + ratio) / jnp.where(sum_of_both > 0, sum_of_both, 1.0)
    stretch = jnp.where(first, 4 * fourth**3, 2 * bend / (1 + ratio))
    return jnp.where(first, fourth, later), width * stretch


def root(square: jax.Array) -> jax.Array:
    """The square root of what is positive, else 0; with derivative 0 at 0."""
    positive = square > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1.0)), 0.0)


def inverse(position: jax.Array, values: jax.Array, wanted: jax.Array) -> jax.Array:
    """Where rising values at positions, (nodes, points), reach wanted ones, (n, points); linear between."""
    after = jnp.clip(jnp.sum(values[:, None] <= wanted, 0), 1, position.shape[0] - 1)
    point = np.arange(values.shape[1])
    low, high = (values.at[k, point].get(mode="promise_in_bounds") for k in (after - 1, after))
    share = _share(wanted, low, high)
    return position[after - 1] + share * (position[after] - position[after - 1])


def _share(value, low, high):
    rise = high - low
    return jnp.clip(jnp.where(rise > 0, (value - low) / jnp.where(rise > 0, rise, 1.0), 0.0), 0.0, 1.0)


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
        coefficients = jnp.einsum("ij,kjp->kpi", typed(legendre_transform(order), values), values)
        chosen = coefficients.at[panel, point].get(mode="promise_in_bounds")
        return jnp.sum(chosen * _legendre(y, order), -1)


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
    after = jnp.clip(jnp.sum(table.position[:, None] <= begin, 0), 1, table.position.shape[0] - 1)
    low, high = measure[after - 1, np.arange(points)], measure[after, np.arange(points)]
    share = _share(jax.lax.stop_gradient(begin), table.position[after - 1], table.position[after])
    first = low + share * (high - low)
    shares = typed((np.arange(1, count) / count) ** _CLOSER, begin)[:, None]
    even = inverse(table.position, measure, first + (measure[-1] - first) * shares)
    kinks = jnp.broadcast_to(table.kinks[:, None], (table.kinks.shape[0], points))
    inner = jnp.concatenate([jax.lax.stop_gradient(even), kinks])
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
