r"""Radial meshes: where the integrals over t = ln(q / q_start) are evaluated.

Two kinds of nodes. The angular integrals of the stiffness are analytic in ln q, with no
singularity nearer than i pi/2, whatever the spectra do: they are evaluated at a few
*angular nodes* and interpolated. The spectra have kinks, and the contact factors P, S,
Psi fall within ln(q/q0) ~ 1e-18 ... 1 of the wavevector where roughness begins: they are
evaluated at *contact nodes*, with the map t ~ s^2
that removes the t^(-1/2) there. C is exact at the contact nodes: a table with many knots costs no evaluation
of the stiffness.

Panels have borders at every kink of the spectra, which move with q0, q_r and q1, so that gradients are right.
The range between is shared out evenly, and panels are graded towards every beginning of roughness.

Nothing here depends on velocity or pressure: one mesh serves all points of a call.
"""

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.quadrature import Quadrature, gauss, legendre_transform, nodes_between, typed
from rubberfric.roughness.spectra import BrokenPowerLaw, log_ratio

# Beyond the end of a plateau sqrt(G) has a branch point a quarter of an e-fold below it, so near that no
# number of equal panels is enough: a border of a contact panel so far beyond it is.
_BEYOND_ROLLOFF = 0.6

# What the exponent of q^2 C adds to a piece's share of the panels.
_STEEPNESS = 0.5


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


class Borders(NamedTuple):
    """Borders of panels, as t = ln(q / first), and what lies in which panel."""

    t: jax.Array  # of the contact panels, rising
    first: jax.Array  # the wavevector that all roughness begins at [1/m]
    start: jax.Array  # ln(first / (1/m))
    kinks: tuple[jax.Array, ...]  # t of the ends and kinks of every spectrum
    edges: jax.Array  # t of the borders of the angular panels, from end to end
    panel: jax.Array  # the angular panel that each contact panel lies in
    pieces: tuple[jax.Array, ...]  # the power law of every spectrum that it lies in, -1 before them
    panels_below: jax.Array | None  # how many contact panels lie below each border that was asked for


def place_borders(
    laws: Sequence[BrokenPowerLaw],
    quadrature: Quadrature,
    graded: bool,
    asked: jax.Array | None,
    moving: bool,
) -> Borders:
    """Borders for one or two broken power laws; `asked` [1/m] and the rest as for `build_mesh`."""
    begins = jnp.stack([law.q[0] for law in laws])
    leader = jnp.argmin(jax.lax.stop_gradient(begins))
    first = begins[leader]
    start = jnp.log(first)
    kinks = [_from_first(law.q, first, leader == j) for j, law in enumerate(laws)]
    end = functools.reduce(jnp.maximum, [kink[-1] for kink in jax.lax.stop_gradient(kinks)])
    followed, exponents = kinks, [law.exponent for law in laws]
    if not moving:
        followed, exponents = jax.lax.stop_gradient((followed, exponents))
    width, uniform = _uniform_borders(followed, exponents, quadrature.panels)
    if not moving:  # and not with the first wavevector either, from which t counts
        uniform = uniform - (start - jax.lax.stop_gradient(start))
    fixed, graded_ones = [uniform], []
    fixed += [
        jnp.minimum(_rolloff(law, kink) + _BEYOND_ROLLOFF, end)[None]
        for law, kink in zip(laws, followed, strict=True)
        if law.exponent.size > 1
    ]
    if graded:
        fractions = typed(quadrature.ratio ** (-2.0 * np.arange(1, quadrature.graded + 1)), end)
        # These hang on the beginning and move with it: fixed, the innermost panel, 1e-10
        # wide, would stretch with q0, and its quadrature error with it.
        grades = [width(begin[0]) * fractions for begin in followed]
        graded_ones = [jnp.minimum(kink[0] + grade, end) for kink, grade in zip(kinks, grades, strict=True)]
        if quadrature.graded and not moving:
            fixed = [_among_graded(border, kinks, grades) for border in fixed]
    groups = [fixed[0], *kinks, *fixed[1:], *graded_ones]
    if asked is not None:
        # Selected, not clipped: a clip would give half the derivative to a border at an end.
        distance = log_ratio(jnp.where(asked >= first, asked, first), first)
        groups.append(jnp.where(distance <= end, distance, end))
    t = jnp.concatenate(groups)
    ranks = jnp.split(_ranks(jax.lax.stop_gradient(t)), np.cumsum([group.size for group in groups])[:-1])
    # The outer angular nodes move with the ends of the roughness: fixed, the contact nodes there
    # would move along the interpolant, whose slope is 1e3 times less accurate than its values.
    begin = functools.reduce(jnp.minimum, [kink[0] for kink in kinks])
    last = functools.reduce(jnp.maximum, [kink[-1] for kink in kinks])
    return Borders(
        t=jnp.sort(t),
        first=first,
        start=start,
        kinks=tuple(kinks),
        edges=jnp.concatenate([begin[None], uniform, last[None]]),
        panel=_passed(ranks[0], t.size - 1),
        pieces=tuple(_passed(rank, t.size - 1) - 1 for rank in ranks[1 : 1 + len(kinks)]),
        panels_below=None if asked is None else ranks[-1],
    )


def _passed(ranks, panels):
    """How many borders of one kind lie before each panel.

    Rank in the sorted list, not comparison of values, says what lies inside what: borders that coincide
    (two spectra with equal q1) keep their one-sided derivatives.
    """
    return jnp.sum(ranks <= np.arange(panels)[:, None], -1)


def _among_graded(border, kinks, grades):
    """Fixed borders, but those that lie among the graded ones of a beginning, which move with it.

    They do by chance, an ulp from where a second roughness begins: a panel between the two that grew from
    no width would have nodes before and after it at which the contact is another by then.
    """
    for kink, grade in zip(kinks, grades, strict=True):
        distance = jax.lax.stop_gradient(border - kink[0])
        border = jnp.where(jnp.abs(distance) < grade[0], kink[0] + distance, border)
    return border


def _rolloff(law, kink):
    """Where the exponent of a law falls most."""
    return kink[1:-1][jnp.argmin(jnp.diff(jax.lax.stop_gradient(law.exponent)))]


def _from_first(q, first, leads):
    """ln(q / first) of the wavevectors of a law, which `leads` if its first is that of all.

    Then that one is 0 whatever moves. Written as a difference of two that move alike, it would
    leave their rounding, times 1 over the innermost panel's width of 1e-14, in reverse mode.
    """
    t = log_ratio(q, first)
    return jnp.concatenate([jnp.where(leads, 0.0, t[:1]), t[1:]])


def _ranks(values):
    """Position of every value in the sorted list, equal ones in the order given."""
    index = np.arange(values.shape[0])
    before = (values < values[:, None]) | ((values == values[:, None]) & (index < index[:, None]))
    return jnp.sum(before, -1)


def _uniform_borders(kinks, exponents, panels):
    """Borders that share out the range, closer where the roughness rises steeply.

    On the plateau G ~ q^4, so that P may switch within a quarter of e-fold: there a
    piece counts 1 + 1/2 of its exponent of q^2 C (2 on the plateau), elsewhere 1.

    Returns
    -------
    width : function, width of one share that begins at t
    uniform : the borders between `panels` equal shares, shape (panels - 1,)
    """
    slopes = [_STEEPNESS * jnp.clip(exponent, 0.0, 2.0) for exponent in exponents]

    def share(t):
        steep = [_ramps(t, kink, slope) for kink, slope in zip(kinks, slopes, strict=True)]
        return t + functools.reduce(jnp.add, steep)

    knots = kinks[0] if len(kinks) == 1 else jnp.sort(jnp.concatenate(kinks))
    shares = share(knots)
    rise = jnp.diff(shares)
    back = jnp.diff(knots) / jnp.where(rise > 0, rise, 1.0)
    step = shares[-1] / panels

    def width(begin):
        return _ramps(jnp.minimum(share(begin) + step, shares[-1]), shares, back) - begin

    return width, _ramps(step * np.arange(1, panels), shares, back)


def _ramps(t, knots, slopes):
    """Continuous piecewise linear function, 0 at the first knot, with given slopes.

    A sum over pieces: for the few knots of a spectrum quicker than a search.
    """
    return jnp.sum(slopes * jnp.clip(t[..., None] - knots[:-1], 0.0, jnp.diff(knots)), -1)
