r"""Radial meshes: where the integrals over t = ln(q / q_start) are evaluated.

Two kinds of nodes. The angular integrals of the stiffness are analytic in ln q, with no
singularity nearer than i pi/2, whatever the spectra do: they are evaluated at a few
*angular nodes* and interpolated. The spectra have kinks, and the contact factors P, S,
Psi fall within ln(q/q0) ~ 1e-18 ... 1 of the wavevector where roughness begins: they are
evaluated at *contact nodes*, on panels between `rubberfric.roughness.mesh.borders`, with
the map t ~ s^2 that removes the t^(-1/2) there. C is exact at the contact nodes: a table with
many knots costs no evaluation of the stiffness.

Nothing here depends on velocity or pressure: one mesh serves all points of a call.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.quadrature import Quadrature, gauss, legendre_transform, nodes_between, typed
from rubberfric.roughness.mesh.borders import place_borders
from rubberfric.roughness.spectra import BrokenPowerLaw


class Between(NamedTuple):
    """Nodes between the contact nodes, for integrals up to every one of them; (contact panels, nodes)."""

    q: jax.Array  # [1/m]
    roughness: tuple[jax.Array, ...]  # q^4 C_j there, times dt / d(node coordinate)
    interpolate: jax.Array | None  # from angular nodes, (contact panels, nodes, angular_order), if asked for


class Mesh(NamedTuple):
    """Nodes, spectra at the nodes, and the way from angular to contact nodes."""

    angular_q: jax.Array  # wavevectors of the angular nodes [1/m], (angular panels, angular_order)
    q: jax.Array  # of the contact nodes [1/m], (contact panels, order)
    roughness: tuple[jax.Array, ...]  # q^4 C_j there, times the weight in an integral over ln q
    between: Between | None  # if graded
    panel: jax.Array  # the angular panel that serves each contact panel, (contact panels,)
    interpolate: jax.Array  # from angular to contact nodes, (contact panels, order, angular_order)
    first: jax.Array  # wavevectors that the roughness begins and ends at [1/m]
    last: jax.Array
    borders: jax.Array  # ln(q / first) at the borders of the contact panels, rising
    origin: jax.Array  # that at which the roughness of each began, (contact panels,) or ()
    kinks: tuple[jax.Array, ...]  # that of the ends and kinks of every spectrum
    panels_below: jax.Array | None  # how many contact panels lie below each border that was asked for

    def serving(self, values: jax.Array) -> jax.Array:
        """Values at the angular nodes, (angular panels, ...), that serve each contact panel."""
        return values.at[self.panel].get(mode="promise_in_bounds")

    def joined(self, join: Callable[[jax.Array, jax.Array], jax.Array]) -> "Mesh":
        """The same with one spectrum, which `join` makes of its two, linear in the unit of both."""
        between = self.between
        if between is not None:
            between = between._replace(roughness=(join(*between.roughness),))
        return self._replace(roughness=(join(*self.roughness),), between=between)

    def to_contact(self, values: jax.Array) -> jax.Array:
        """Values at the angular nodes, (angular panels, points, angular_order), at the contact nodes."""
        return jnp.einsum("kvi,kci->kvc", self.serving(values), self.interpolate)


def build_mesh(
    laws: Sequence[BrokenPowerLaw],
    quadrature: Quadrature,
    graded: bool = True,
    logarithmic: bool = False,
    borders: jax.Array | None = None,
    moving: bool = False,
) -> Mesh:
    """Mesh for one or two broken power laws.

    Parameters
    ----------
    laws : of one rough surface or two
    quadrature : Quadrature
    graded : whether there are panels graded towards the beginnings, and nodes between; without them
        the mesh is enough for G(q1), as the contact area needs.
    logarithmic : whether there is the interpolation to the nodes between.
    borders : wavevectors that must be borders of contact panels [1/m], shape (n,), or None
        Integrals up to one are then sums over whole panels. One outside the roughness counts as
        its nearer end.
    moving : whether all borders carry derivatives
        Where integrands are smooth between kinks of the roughness it does not matter where the others
        are. Flash temperatures have kinks: those of a shift factor from a table.
    """
    panels = place_borders(laws, quadrature, graded, borders, moving)
    t, edges, start = panels.t, panels.edges, panels.start
    left, right = t[:-1], t[1:]
    origin = _origin(jax.lax.stop_gradient(panels.kinks), panels.pieces)

    def at(coordinate):
        """t, dt / d coordinate and q^4 C_j at the same coordinates in [0, 1] of every panel."""
        relative, stretch = _node_map(left, right, origin, coordinate)
        nodes = left[:, None] + (right - left)[:, None] * relative
        spectra = zip(laws, panels.kinks, panels.pieces, strict=True)
        roughness = tuple(_roughness(*one, nodes, start) for one in spectra)
        return nodes, (right - left)[:, None] * stretch, roughness

    node, weight = (typed(table, t) for table in gauss(quadrature.order))
    nodes, measure, roughness = at(node)
    serving = edges[panels.panel], edges[panels.panel + 1], quadrature.angular_order
    between = None
    if graded:
        inner, inner_measure, inner_roughness = at(typed(nodes_between(quadrature.order), t))
        between = Between(
            q=jnp.exp(start + inner),
            roughness=tuple(values * inner_measure for values in inner_roughness),
            interpolate=_interpolation(inner, *serving) if logarithmic else None,
        )
    angular_node = typed(gauss(quadrature.angular_order)[0], t)
    return Mesh(
        angular_q=jnp.exp(start + (edges[:-1, None] + jnp.diff(edges)[:, None] * angular_node)),
        q=jnp.exp(start + nodes),
        roughness=tuple(values * (measure * weight) for values in roughness),
        between=between,
        panel=panels.panel,
        interpolate=_interpolation(nodes, *serving),
        first=panels.first,
        last=jnp.exp(start + edges[-1]),
        borders=t,
        origin=origin,
        kinks=panels.kinks,
        panels_below=panels.panels_below,
    )


def _origin(kinks, pieces):
    """Where the roughness that matters in a panel began (the later spectrum, once it has)."""
    if len(kinks) == 1:
        return kinks[0][0]
    later = jnp.maximum(kinks[0][0], kinks[1][0])
    both = (pieces[0] >= 0) & (pieces[1] >= 0)
    return jnp.where(both, later, 0.0)


def _node_map(left, right, origin, node):
    """Nodes in a panel as fractions of its width, and d fraction / d node coordinate.

    Uniform in s = sqrt(t - origin), in which the integrands are smooth; in the panel at
    the origin, where u_bar goes like s ln s, uniform in sqrt(s).
    """
    left, right = jax.lax.stop_gradient((left, right))
    span = right - origin
    # A panel of no width at the origin has 0/0 here; any map will do for it.
    ratio = jnp.sqrt(jnp.maximum(left - origin, 0.0) / jnp.where(span > 0, span, 1.0))[:, None]
    first = (left <= origin)[:, None]
    relative = jnp.where(first, node**4, node * (2 * ratio + (1 - ratio) * node) / (1 + ratio))
    stretch = jnp.where(first, 4 * node**3, 2 * (ratio + (1 - ratio) * node) / (1 + ratio))
    return relative, stretch


def _roughness(law, kink, piece, nodes, start):
    """q^4 C at the contact nodes; zero in panels outside the spectrum."""
    count = law.exponent.shape[0]
    inside = (piece >= 0) & (piece < count)
    piece = jnp.clip(piece, 0, count - 1)
    distance = nodes - kink[piece][:, None]
    # Outside, the distance is set to zero first: a power law continued far may overflow.
    distance = jnp.where(inside[:, None], distance, 0.0)
    log_value = law.log_value[piece][:, None] + law.exponent[piece][:, None] * distance
    value = law.height2 * jnp.exp(log_value + 2 * (start + nodes))
    return jnp.where(inside[:, None], value, 0.0)


def _interpolation(nodes, left, right, order):
    """Lagrange basis of the angular nodes at the contact nodes, through Legendre polynomials."""
    width = (right - left)[:, None]
    x = 2 * (nodes - left[:, None]) / jnp.where(width > 0, width, 1.0) - 1
    basis = [jnp.ones_like(x), x]
    for n in range(1, order - 1):
        basis.append(((2 * n + 1) * x * basis[n] - n * basis[n - 1]) / (n + 1))
    return jnp.stack(basis, -1) @ typed(legendre_transform(order), x)
