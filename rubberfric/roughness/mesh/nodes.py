r"""Radial meshes: nodes of the integrals over t = ln(q / q_start).

There are two kinds of nodes. The angular integrals of the stiffness are analytic in ln q, without a
singularity nearer than i pi/2. They are evaluated at a few *angular nodes* and interpolated. The spectra
have kinks, and the contact factors P, S, Psi decrease within ln(q/q0) ~ 1e-18 ... 1 of the first wavevector.
Spectra and contact factors are evaluated at *contact nodes*, with the map t ~ s^2 that removes the t^(-1/2)
at the first wavevector. C is exact at the contact nodes, so a table with many knots needs no further
evaluations of the stiffness.

The module `borders` places the borders of the panels.

The mesh does not depend on velocity or pressure and serves all points of a call.
"""

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.compilation import exact_products
from rubberfric.base.quadrature import (
    Quadrature,
    gauss,
    nodes_between,
    slopes_at_nodes,
    typed,
)
from rubberfric.roughness.mesh.borders import place_borders
from rubberfric.roughness.spectra import BrokenPowerLaw, log_ratio


class Between(NamedTuple):
    """Additional nodes between the contact nodes, for integrals up to each contact node.

    Arrays have the shape (contact panels, nodes), unless a comment gives another shape.
    """

    q: jax.Array  # [1/m]
    roughness: tuple[jax.Array, ...]  # q^4 C_j at the nodes, times dt / d(node coordinate)
    interpolate: jax.Array | None  # from angular nodes, (contact panels, nodes, angular_order), if requested


class Mesh(NamedTuple):
    """Nodes, spectra at the nodes, and interpolation from angular to contact nodes."""

    angular_q: jax.Array  # wavevectors of the angular nodes [1/m], (angular panels, angular_order)
    q: jax.Array  # of the contact nodes [1/m], (contact panels, order)
    roughness: tuple[jax.Array, ...]  # q^4 C_j at these nodes, times the weight in an integral over ln q
    between: Between | None  # if graded
    panel: jax.Array  # angular panel of each contact panel, (contact panels,)
    interpolate: jax.Array  # from angular to contact nodes, (contact panels, order, angular_order)
    first: jax.Array  # first and last wavevector of the roughness [1/m]
    last: jax.Array
    borders: jax.Array  # ln(q / first) at the borders of the contact panels, ascending
    origin: jax.Array  # ln(q / first) where the roughness of each panel begins, (contact panels,) or ()
    kinks: tuple[jax.Array, ...]  # ln(q / first) of the ends and kinks of every spectrum
    panels_below: jax.Array | None  # number of contact panels below each requested border

    def serving(self, values: jax.Array) -> jax.Array:
        """Return, for each contact panel, the entry of `values` for the angular panel around it.

        `values` has the shape (angular panels, ...), and the result has the shape (contact panels, ...).
        """
        return values.at[self.panel].get(mode="promise_in_bounds")

    def to_contact(self, values: jax.Array) -> jax.Array:
        """Interpolate `values` from the angular nodes to the contact nodes.

        `values` has the shape (angular panels, points, angular_order), and the result has the shape
        (contact panels, points, order).
        """
        return jnp.einsum("kvi,kci->kvc", self.serving(values), self.interpolate)


def build_mesh(
    laws: Sequence[BrokenPowerLaw],
    quadrature: Quadrature,
    graded: bool = True,
    logarithmic: bool = False,
    borders: jax.Array | None = None,
    moving: bool = False,
    join: Callable[[jax.Array, jax.Array], jax.Array] | None = None,
) -> Mesh:
    """Return the mesh for one or two broken power laws.

    Parameters
    ----------
    laws : spectra of one or two rough surfaces
    quadrature : Quadrature
    graded : use panels graded towards the first wavevectors, and nodes between the contact nodes
        If False, the mesh suffices only for G(q1), which gives the contact area.
    logarithmic : also interpolate to the nodes between the contact nodes
    borders : wavevectors that must be borders of contact panels [1/m], shape (n,), or None
        Integrals up to such a wavevector are sums over whole panels. The nearer end replaces a wavevector
        outside the roughness.
    moving : let all borders carry derivatives
        This is necessary if integrands have kinks elsewhere, such as the kinks of flash temperatures with
        tabulated shift factors. Otherwise only the borders at kinks of the roughness need derivatives.
    join : function of q^4 C of two laws that returns q^4 C of one spectrum, or None
        The mesh then has this spectrum only.
    """
    panels = place_borders(laws, quadrature, graded, borders, moving)
    t, edges, start = panels.t, panels.edges, panels.start
    origin = _origin(panels.kinks, panels.pieces)
    left, right = t[:-1], t[1:]
    if len(laws) == 1:
        # A kink at the origin, as for q_r = q0, stays there. Otherwise nodes would move where contact is lost
        # within a tiny distance, and derivatives would have quadrature errors of up to 5e-3. The integral of
        # a continuous integrand does not depend on the position of the border. Where a second spectrum
        # begins, the integrand has a step, so its border must move.
        left, right = (jnp.where(edge == origin, origin, edge) for edge in (left, right))
    origin = jax.lax.stop_gradient(origin)

    node, weight = (typed(table, t) for table in gauss(quadrature.order))
    # One pass over all nodes compiles in half the time of two.
    order, coordinates = quadrature.order, node
    if graded:
        coordinates = jnp.concatenate([node, typed(nodes_between(order), t)])
    relative, stretch = _node_map(left, right, origin, coordinates)
    nodes = left[:, None] + (right - left)[:, None] * relative
    measure = (right - left)[:, None] * stretch
    spectra = zip(laws, panels.kinks, panels.pieces, strict=True)
    roughness = tuple(_roughness(*parts, nodes, start) for parts in spectra)
    if join is not None:
        # Before the weights: where kinks coincide, the weight of a panel of zero width is 0, and its
        # derivative must be multiplied by the joined spectrum.
        roughness = (join(*roughness),)
    q = jnp.exp(start + nodes)
    roughness = tuple(values * measure for values in roughness)
    inner = graded and logarithmic
    basis = interpolation(
        nodes if inner else nodes[:, :order],
        _entries(edges, panels.panel),
        _entries(edges, panels.panel + 1),
        quadrature.angular_order,
    )
    between = None
    if graded:
        between = Between(
            q=q[:, order:],
            roughness=tuple(values[:, order:] for values in roughness),
            interpolate=basis[:, order:] if logarithmic else None,
        )
    angular_node = typed(gauss(quadrature.angular_order)[0], t)
    return Mesh(
        angular_q=jnp.exp(start + (edges[:-1, None] + jnp.diff(edges)[:, None] * angular_node)),
        q=q[:, :order],
        roughness=tuple(values[:, :order] * weight for values in roughness),
        between=between,
        panel=panels.panel,
        interpolate=basis[:, :order],
        first=panels.first,
        last=jnp.exp(start + edges[-1]),
        borders=t,
        origin=origin,
        kinks=panels.kinks,
        panels_below=panels.panels_below,
    )


def _origin(kinks, pieces):
    """Return t = ln(q / first) at the wavevector q where the roughness in each panel begins.

    If two spectra contribute to a panel, q is the larger of the two first wavevectors.
    """
    if len(kinks) == 1:
        return kinks[0][0]
    later = jnp.maximum(kinks[0][0], kinks[1][0])
    both = (pieces[0] >= 0) & (pieces[1] >= 0)
    return jnp.where(both, later, 0.0)


def _node_map(left, right, origin, node):
    """Return the positions of nodes as fractions of the panel width, and d(fraction) / d(node).

    `node` holds coordinates 0 ... 1, which are linear in s = sqrt(t - origin), because the integrands are
    smooth functions of s. In the panel at the origin, where u_bar is like s ln s, the coordinates are linear
    in sqrt(s).
    """
    left, right = jax.lax.stop_gradient((left, right))
    span = right - origin
    # A panel of zero width at the origin gives 0/0; any map is valid for it.
    ratio = jnp.sqrt(jnp.maximum(left - origin, 0.0) / jnp.where(span > 0, span, 1.0))[:, None]
    first = (left <= origin)[:, None]
    relative = jnp.where(first, node**4, node * (2 * ratio + (1 - ratio) * node) / (1 + ratio))
    stretch = jnp.where(first, 4 * node**3, 2 * (ratio + (1 - ratio) * node) / (1 + ratio))
    return relative, stretch


def locate(mesh: Mesh, q: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the contact panels of wavevectors within the roughness, and their node coordinates 0 ... 1.

    `q` has the shape (wavevectors,). The mesh must have one spectrum.
    """
    t = log_ratio(q, mesh.first)
    left, right = mesh.borders[:-1], mesh.borders[1:]
    panel = jnp.clip(jnp.searchsorted(mesh.borders, t, side="right") - 1, 0, left.size - 1)
    left, right = left[panel], right[panel]
    wide = right > left
    relative = jnp.clip((t - left) / jnp.where(wide, right - left, 1.0), 0.0, 1.0)
    # The inverse of `_node_map`.
    ratio = jnp.sqrt(jnp.maximum(left - mesh.origin, 0.0) / jnp.where(wide, right - mesh.origin, 1.0))
    root = ratio + jnp.sqrt(ratio**2 + (1 - ratio**2) * relative)
    first = left <= mesh.origin
    further = (1 + ratio) * relative / jnp.where(first, 1.0, root)
    return panel, jnp.where(first, jnp.sqrt(jnp.sqrt(relative)), further)


def _roughness(law, kink, piece, nodes, start):
    """Return q^4 C at the nodes, with zeros in panels outside the range of the spectrum."""
    count = law.exponent.shape[0]
    inside = (piece >= 0) & (piece < count)
    piece = jnp.clip(piece, 0, count - 1)
    at_kink = [_entries(values, piece)[:, None] for values in (kink[:-1], law.log_value[:-1], law.exponent)]
    distance = nodes - at_kink[0]
    # Outside, the distance is 0, because a power law may overflow far from its range.
    distance = jnp.where(inside[:, None], distance, 0.0)
    log_value = at_kink[1] + at_kink[2] * distance
    value = law.height2 * jnp.exp(log_value + 2 * (start + nodes))
    return jnp.where(inside[:, None], value, 0.0)


def _entries(values, index):
    """Return values[index]. A sum has a derivative that compiles faster than that of a look-up."""
    return jnp.sum(jnp.where(index[:, None] == np.arange(values.shape[0]), values, 0.0), -1)


def interpolation(nodes: jax.Array, left: jax.Array, right: jax.Array, order: int) -> jax.Array:
    """Evaluate the Lagrange polynomials of the Gauss nodes of panels at `nodes`, by Legendre polynomials.

    `nodes` has the shape (panels, nodes). `left` and `right` are the ends of the panels. The result has the
    shape (panels, nodes, order).
    """
    width = (right - left)[:, None]
    return _lagrange(order, (nodes - left[:, None]) / jnp.where(width > 0, width, 1.0))


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _lagrange(order, position):
    """Return the Lagrange polynomials of the Gauss nodes at positions 0 ... 1, on a new last axis."""
    node = gauss(order)[0]
    own = np.eye(order, dtype=bool)
    scale = 1 / np.prod(np.where(own, 1.0, node[:, None] - node), 1)
    distance = position[..., None, None] - typed(node, position)
    # One reduction compiles faster than a recurrence.
    return jnp.prod(jnp.where(own, typed(scale[:, None] * own, position), distance), -1)


@_lagrange.defjvp
@exact_products
def _lagrange_jvp(order, primals, tangents):
    # The slope is a polynomial, which its values at the nodes determine.
    values = _lagrange(order, *primals)
    return values, (values @ typed(slopes_at_nodes(order), values)) * tangents[0][..., None]
