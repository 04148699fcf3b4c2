r"""Spectra along lines of isotropic surfaces: the projection of an areal spectrum, an Abel transform.

.. math:: C_\mathrm{1D}(q) = \int_{-\infty}^\infty dq_y\, C\big(\sqrt{q^2 + q_y^2}\big)
          = 2 \int_q^\infty \frac{C(x)\, x}{\sqrt{x^2 - q^2}}\, dx

For a broken power law the pieces of the integral are computed to rounding. `rubberfric.roughness.lines`
inverts the projection.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import (
    POSITIVE,
    ArrayLike,
    NumberLike,
    as_leaf,
    check_increasing,
    check_lengths,
    check_values,
)
from rubberfric.base.objects.physical import check_kind
from rubberfric.base.quadrature import gauss, typed
from rubberfric.roughness.spectra import Spectrum, log_ratio, mean_growth

# Gauss nodes of Abel's kernel between q and 2 q.
_NODES = 24
# Terms of the series of Abel's kernel beyond 2 q. Each is at most 1/4 of the previous one, the last 2e-16.
_TERMS = 27
# C continues beyond the last entry at least as steeply as for H = 0. C_1D diverges from -1 on.
_FLATTEST = -2.0


def line_spectrum(spectrum: Spectrum, q: ArrayLike) -> jax.Array:
    r"""Return the spectrum along a line of an isotropic surface, exact for its broken power law.

    .. math:: C_\mathrm{1D}(q) = 2 \int_q^\infty \frac{C(x)\, x}{\sqrt{x^2 - q^2}}\, dx,\qquad
              h_\mathrm{rms}^2 = 2 \int_0^\infty C_\mathrm{1D}\, dq

    Parameters
    ----------
    spectrum : SelfAffine or TabulatedSpectrum
    q : wavevectors along the line, > 0 [1/m], any shape
        Below the spectrum's range C_1D tends to a constant. Above the range C_1D is 0.

    Returns
    -------
    C_1D [m^3], shape of q, with errors of 1e-13 for slopes d ln C / d ln q of -20 ... 20

    Notes
    -----
    C_1D is differentiable with respect to the spectrum and q, except at the ends of C, where C_1D is like a
    square root.

    Examples
    --------
    >>> surface = rf.TabulatedSpectrum(q=[1e2, 1e7], C=[1e-10, 1e-30])
    >>> round(float(rf.roughness.line_spectrum(surface, 1e4)) * 100 * 1e4**3, 4)
    1.5708
    """
    check_kind("spectrum", spectrum, Spectrum)
    return _line_spectrum(spectrum, positive_array("q", q))


@jax.jit
def _line_spectrum(spectrum, q):
    law = spectrum.power_law()
    pieces = _pieces(q, law.q[:-1], law.q[1:], law.log_value[:-1], law.exponent)
    return 2 * law.height2 * jnp.sum(pieces, -1)


def projected_table(q: ArrayLike, C: ArrayLike) -> jax.Array:
    """Return C_1D [m^3] at the entries q of a table of C, which continues beyond the last entry.

    C is log-log linear, and beyond q[-1] it has the slope of its last piece, at least as steep as q^-2. This
    is the projection that `areal_spectrum` inverts.
    """
    q, C = (as_leaf(name, value, 1) for name, value in (("q", q), ("C", C)))
    check_lengths("projected_table", q=q, C=C)
    for name, value in (("q", q), ("C", C)):
        check_values(name, value, POSITIVE)
    check_increasing("q", q)
    return _projected_table(q, C)


@jax.jit
def _projected_table(q, C):
    return jnp.exp(projection(jnp.log(C), q, q, None)[0])


def positive_array(name: str, value: ArrayLike) -> jax.Array:
    """Return values > 0 as a floating-point array."""
    value = jnp.asarray(value)
    value = value if jnp.issubdtype(value.dtype, jnp.floating) else value.astype(float)
    check_values(name, value, POSITIVE)
    return value


def projection(
    log_C: jax.Array, knots: jax.Array, q: jax.Array, q1: NumberLike | None
) -> tuple[jax.Array, jax.Array]:
    """Return ln C_1D at q, and its derivatives with respect to ln C at the knots.

    The last piece continues beyond the last knot up to q1, or without an end if q1 is None.
    """
    width = log_ratio(knots[1:], knots[:-1])
    value = log_C + 2 * jnp.log(knots)
    exponent = jnp.diff(value) / width
    last, free = exponent[-1], jnp.ones_like(exponent[-1])
    if q1 is None:
        last, free = jnp.minimum(last, _FLATTEST + 2), jnp.where(last < _FLATTEST + 2, free, 0.0)
    end = jnp.append(knots[1:], jnp.inf if q1 is None else q1)
    # d exponent / d (difference of ln C)
    share = jnp.append(1 / width, free / width[-1])
    exponent = jnp.append(exponent, last)
    top = jax.lax.stop_gradient(jnp.max(value))
    each, by_exponent = jax.jvp(
        lambda exponent: _pieces(q, knots, end, value - top, exponent),
        (exponent,),
        (jnp.ones_like(exponent),),
    )
    eye = np.eye(knots.shape[0])
    differences = typed(np.diff(eye, axis=0)[np.append(np.arange(eye.shape[0] - 1), -1)], q)
    total = jnp.sum(each, -1)
    slopes = each + (by_exponent * share[None]) @ differences
    return jnp.log(2 * total) + top, slopes / total[:, None]


def _pieces(x, begin, end, log_value, exponent):
    """Return int f(q) / (q sqrt(q^2 - x^2)) dq of every piece, shape (*x.shape, pieces), over q > x.

    In a piece, f is a power of q that equals exp(log_value) at the start of the piece. For q < 2 x, Gauss
    nodes in arcosh(q/x) remove the root. For q > 2 x, the root is a series in (x/q)^2, in which each term is
    a power of q.
    """
    x = x[..., None]
    shape = (*x.shape[:-1], begin.shape[0])
    start, end, log_value, exponent = (jnp.broadcast_to(a, shape) for a in (begin, end, log_value, exponent))
    u0, u1 = (_arcosh(jnp.clip(border, x, 2 * x), x) for border in (start, end))
    nodes, weights = (typed(table, x) for table in gauss(_NODES))
    u = u0[..., None] + (u1 - u0)[..., None] * nodes
    ratio = jnp.log(jnp.cosh(u)) + jnp.log(x / start)[..., None]
    # An empty piece far from x must not overflow before the multiplication by its width 0.
    ratio = jnp.where((u1 > u0)[..., None], ratio, 0.0)
    near = jnp.exp(log_value[..., None] + exponent[..., None] * ratio) / jnp.cosh(u)
    near = (u1 - u0) * jnp.sum(near * weights, -1) / x
    begin = jnp.maximum(start, 2 * x)
    empty = end <= begin
    begin = jnp.where(empty, start, begin)
    endless = jnp.isinf(end)
    width = log_ratio(jnp.where(endless | empty, begin, end), begin)
    k = np.arange(_TERMS)
    root = typed([math.comb(2 * n, n) / 4.0**n for n in range(_TERMS)], x)
    powers = jnp.exp(typed(2.0 * k, x) * jnp.log(jnp.where(empty, 0.5, x / begin))[..., None])
    order = exponent[..., None] - typed(1.0 + 2 * k, x)
    endless, width = endless[..., None], width[..., None]
    falling = jnp.where(endless, order, -1.0)  # the order of other pieces may be 0
    terms = jnp.where(endless, -1 / falling, width * mean_growth(order * width))
    series = jnp.sum(root * powers * terms, -1)
    far = jnp.exp(log_value + exponent * jnp.log(begin / start)) / begin * series
    return near + jnp.where(empty, 0.0, far)


def _arcosh(q, x):
    """Return arcosh(q / x) for x <= q <= 2 x. The derivative at q = x, which is infinite, is set to 0."""
    excess = (q - x) / x
    beyond = excess > 0
    excess = jnp.where(beyond, excess, 1.0)
    return jnp.where(beyond, jnp.log1p(excess + jnp.sqrt(excess * (excess + 2))), 0.0)
