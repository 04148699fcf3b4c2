r"""Share of the area that has never been pulled off, as finer and finer roughness spreads the stress.

Stresses diffuse from sigma_0, and are absorbed where they reach the detachment stress -sigma_a
[Persson, Eur. Phys. J. E 8, 385 (2002), doi:10.1140/epje/i2002-10025-1]: in units of sigma_0, with
t = G(q) and b = sigma_a / sigma_0,

.. math:: \frac{\partial P}{\partial t} = \frac{\partial^2 P}{\partial s^2},\qquad
          P(s, 0) = \delta(s - 1),\qquad P(-b(t), t) = 0,\qquad A(t) = \int_{-b}^\infty P\,ds

Paths that end below -b(t) have been absorbed, and by symmetry as many as would end above their reflection
(the renewal equation) [Fortet, J. Math. Pures Appl. 22 (1943) 177]:

.. math:: A(t) = \mathrm{erf}\frac{1 + b(t)}{2\sqrt t}
          + \int_0^t dA(\tau)\,\mathrm{erf}\frac{b(t) - b(\tau)}{2\sqrt{t - \tau}}

a Volterra equation of the second kind, whose kernel goes as sqrt(t - tau) at its end and needs no derivative
of b. It vanishes for a constant boundary, where the first term is all there is.
"""

import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jax.scipy.special import erf
from numpy.polynomial import legendre

from rubberfric.base.quadrature import chebyshev_fit, gauss, legendre_transform, typed
from rubberfric.theory.area.own_panels import root
from rubberfric.theory.area.partial_contact import TWO_OVER_ROOT_PI

# Nodes of the panel where an integral ends, and of one before it.
_IN_LAST, _BEFORE = 8, 10

# Nodes over the density where b begins, how far it reaches, and x below which much was absorbed before.
_AT_REST, _FAR, _MANY = 16, 4.3, 2.3

# (1 + b) / (2 sqrt t) beyond which nothing is absorbed: erfc(5) = 2e-12.
NOTHING = 5.0

_DEGREE, _END = 16, 5.2  # of the exponent of erfc, to 1e-10 of erf, and where it ends


class _Rule(NamedTuple):
    """From values at the Gauss nodes of a panel to those at other nodes, and to differences of A there."""

    values: np.ndarray  # (..., nodes, order)
    differences: np.ndarray  # slope times weight, the same shape


def passage(t: jax.Array, square: jax.Array, x: jax.Array | None = None) -> jax.Array:
    """A at the nodes, panel after panel.

    Parameters
    ----------
    t : at the Gauss nodes, rising, (panels, order, points)
        Panels may be without width.
    square : b^2 there, of the same shape; where it is negative b = 0
        The square, for it is smooth where b begins.
    x : 1 / (2 sqrt t) where the first panel begins, (points,), of those where b = 0 up to there; elsewhere
        5 or more, or None: nothing was absorbed until then

    Returns
    -------
    array, the same shape

    Limits: b is held where erfc((1 + b) / (2 sqrt t)) = 2e-12. It may have any value above that: rising
    steeply, the kernel would be one, and the equation say that A is A.
    """
    panels, order = t.shape[:2]
    earlier, last = (jax.tree.map(lambda table: typed(table, t), rule) for rule in _rules(order))
    b = _boundary(t, square)
    early, own = jnp.einsum("mj,kjp->kmp", earlier.values, t), jnp.einsum("imj,kjp->kimp", last.values, t)
    early_b = _boundary(early, jnp.einsum("mj,kjp->kmp", earlier.values, square))
    own_b = _boundary(own, jnp.einsum("imj,kjp->kimp", last.values, square))
    within = _kernel(b[:, :, None] - own_b, t[:, :, None] - own)
    right = erf((1 + b) * 0.5 / jnp.sqrt(t)) if x is None else _from_rest(t, b, x)
    later, sooner = np.tril_indices(panels, -1)
    rise = b[later][:, :, None] - early_b[sooner][:, None]
    kernel = _kernel(rise, t[later][:, :, None] - early[sooner][:, None])
    # Panel after panel; those that come later count nothing.
    of_pair = np.full((panels, panels), later.size)
    of_pair[later, sooner] = np.arange(later.size)
    kernel = jnp.concatenate([kernel, jnp.zeros_like(kernel[:1])])[of_pair]

    def next_panel(changes, given):
        k, kernel, within, right, inverse = given
        wanted = right + jnp.sum(kernel * changes[:, None], (0, 2))

        # Derivatives of the kernel meet differences of A, which are small where A hardly changes; in those of
        # the matrix they would meet the differences of any function, and lose three digits.
        def left(area):
            return area - jnp.sum(within * _differences(last.differences, area), 1)

        def solve(inverse, product, right):
            found = jnp.sum(inverse * right, 1)
            # The inverse is of that matrix, and has lost them.
            return found + jnp.sum(inverse * (right - product(found)), 1)

        area = jax.lax.custom_linear_solve(
            left,
            wanted,
            functools.partial(solve, inverse),
            functools.partial(solve, jnp.swapaxes(inverse, 0, 1)),
        )
        change = _differences(earlier.differences, area)
        return changes.at[k].set(change), area

    matrix = jnp.einsum("kimp,imj->kijp", jax.lax.stop_gradient(within), last.differences)
    given = np.arange(panels), kernel, within, right, _inverse(matrix)
    return jax.lax.scan(next_panel, jnp.zeros_like(early), given)[1]


def _differences(table, area):
    """Of A by a `_Rule`; of what it is more than its first value, for those of a constant are rounding."""
    return jnp.einsum("...mj,jp->...mp", table, area - area[:1])


def _from_rest(t, b, x):
    r"""Paths that end above -b less those that end below it, of those not absorbed at b = 0 before x.

    Of their density there, with t_x = 1 / (4 x^2),

    .. math:: \mathrm{erf}\,x - \frac1{\sqrt\pi}\int_0^\infty dz\,
              \big[e^{-(z - x)^2} - e^{-(z + x)^2}\big]\,
              \mathrm{erfc}\frac{2\sqrt{t_x}\,z + b}{2\sqrt{t - t_x}}

    or where few were absorbed of all paths and those few, as in the equation of A.
    """
    time = t - 0.25 / (x * x)
    some = time > 0
    spread = 0.5 / jnp.sqrt(jnp.where(some, time, 1.0))
    steep, shift = spread / x, spread * b
    node, weight = (typed(one, t)[:, None] for one in gauss(_AT_REST))
    # Of the density: a Gaussian of less width, for what ends far above is 0.
    width = 1 / jnp.sqrt(1 + steep * steep)
    reach = (width * (_FAR + x * width))[:, :, None]
    z = reach * node
    # As a product: at light loads x is small, and of the difference of two Gaussians little would be left.
    density = -jnp.exp(-((z - x) ** 2)) * jnp.expm1(-4 * x * z)
    share = reach * weight * density / math.sqrt(math.pi)
    # Of those before, by ln t.
    many = x < _MANY
    longest = jnp.maximum(2 * jnp.log(NOTHING / jnp.maximum(x, _MANY)), 0.0)
    early = jnp.maximum(x, _MANY) * jnp.exp(0.5 * longest * node**3)
    change = -0.5 * TWO_OVER_ROOT_PI * longest * early * jnp.exp(-early * early) * 3 * node**2 * weight
    early = b[:, :, None] * 0.5 / jnp.sqrt(jnp.where(some, t, 1.0)[:, :, None] - 0.25 / (early * early))
    argument = jnp.where(many, steep[:, :, None] * z + shift[:, :, None], early)
    missing = jnp.sum(jnp.where(many, share, change) * _missing(argument), 2)
    whole = jnp.where(many, erf(x), erf((1 + b) * 0.5 / jnp.sqrt(t)) + jnp.sum(change, 0))
    return jnp.where(some, whole - missing, erf(x))


def _inverse(matrix):
    """Of 1 - matrix, many small matrices (panels, n, n, points), nearly triangular: no pivots."""
    n = matrix.shape[1]
    unit = np.eye(n, dtype=matrix.dtype)

    def eliminate(rows, here):
        one, column = here[:, None, None], here[None, :, None]
        row = jnp.sum(jnp.where(one, rows, 0.0), 1, keepdims=True)
        factor = jnp.sum(jnp.where(column, rows, 0.0), 2, keepdims=True)
        pivot = jnp.sum(jnp.where(column, row, 0.0), 2, keepdims=True)
        row, factor = (jnp.where(column, 1.0, row) / pivot, jnp.where(one, 0.0, factor))
        kept = jnp.where(column, 0.0, rows)
        return jnp.where(one, row, kept - factor * row), None

    return jax.lax.scan(eliminate, unit[..., None] - matrix, np.eye(n, dtype=bool))[0]


def _boundary(t, square):
    return jnp.minimum(root(square), jnp.maximum(2 * NOTHING * jnp.sqrt(t) - 1, 0.0))


def _kernel(rise, time):
    """Erf of the rise over the spread of the stresses; 0 where no time passes, in panels without width."""
    some = time > 0
    z = 0.5 * rise / jnp.sqrt(jnp.where(some, time, 1.0))
    return jnp.where(some, jnp.copysign(1 - _missing(jnp.abs(z)), z), 0.0)


@jax.custom_jvp
def _missing(z):
    """The function erfc(z) of z >= 0, to 1e-10 of 1 - erfc; 2e-13 beyond 5.2."""
    low = jnp.minimum(z, _END)
    u, exponent = low * (2 / _END) - 1, 0.0
    for coefficient in _exponent()[::-1]:
        exponent = exponent * u + coefficient
    return jnp.exp(-low * exponent)


@_missing.defjvp
def _missing_jvp(primals, tangents):
    (z,) = primals
    return _missing(z), -TWO_OVER_ROOT_PI * jnp.exp(-z * z) * tangents[0]


@functools.cache
def _exponent():
    """Coefficients of -ln erfc(z) / z, which is smooth: a quarter of the cost of erf."""
    coefficients = chebyshev_fit(lambda z: -np.log(scipy.special.erfc(z)) / z, 0.0, _END, _DEGREE)
    return tuple(map(float, coefficients))


def at_end(values: jax.Array) -> jax.Array:
    """Values at the right border of the last panel, (points,), of those at the nodes."""
    return jnp.tensordot(typed(_basis(values.shape[1], np.ones(1))[0], values), values[-1], 1)


def from_nodes_on(values: jax.Array) -> jax.Array:
    """Integrals from nodes (panels, points, order) to the end, of terms of the whole one."""
    within = jnp.einsum("kpj,ij->kpi", values, typed(_rest(values.shape[-1]), values))
    panels = jnp.sum(values, -1)
    after = typed(_is_before(values.shape[0]).T, values) @ panels
    return after[..., None] + within


def _is_before(count):
    """Whether panel l lies before panel k, (k, l)."""
    return np.tri(count, k=-1, dtype=bool)


@functools.cache
def _rules(order):
    """Integrals over a whole panel, and over one up to each of its nodes."""
    # sqrt(t - tau) with t a little beyond the panel is smooth in v, 1 - v^3.
    node, weight = gauss(_BEFORE)
    whole = _rule(order, 1 - node**3, 3 * node**2 * weight)
    # Up to z: z (1 - u^2), in which sqrt(z - y) is smooth.
    node, weight = gauss(_IN_LAST)
    up_to = gauss(order)[0][:, None]
    return whole, _rule(order, up_to * (1 - node**2), up_to * 2 * node * weight)


def _rule(order, y, weight):
    return _Rule(_basis(order, y), _basis(order, y, 1) * weight[..., None])


def _basis(order: int, y: np.ndarray, derivative: int = 0) -> np.ndarray:
    """Lagrange polynomials of the Gauss nodes at y, or their derivatives; (*y.shape, order)."""
    polynomials = np.eye(order)
    if derivative:
        polynomials = legendre.legder(polynomials, derivative, scl=2)
    values = np.moveaxis(legendre.legval(2 * y - 1, polynomials), 0, -1)
    return values @ legendre_transform(order)


@functools.cache
def _rest(order):
    """Integrals from every Gauss node to the end of a panel, of terms of the whole one at the nodes."""
    node, weight = gauss(order)
    fine, fine_weight = gauss(order)
    y = node[:, None] + (1 - node[:, None]) * fine
    return np.einsum("imj,m->ij", _basis(order, y), fine_weight) * (1 - node[:, None]) / weight
