r"""Spectra along lines of isotropic surfaces, and the areal spectrum C from them.

The spectrum along a line is the projection of the areal spectrum, an Abel transform,

.. math:: C_\mathrm{1D}(q) = \int_{-\infty}^\infty dq_y\, C\big(\sqrt{q^2 + q_y^2}\big)
          = 2 \int_q^\infty \frac{C(x)\, x}{\sqrt{x^2 - q^2}}\, dx

`line_spectrum` computes it exactly for a broken power law. `areal_spectrum` fits ln C at knots to a measured
C_1D. The penalty of the fit is the total variation of the slope,

.. math:: \min_{\ln C}\; 2 \sum_i w_i (r_i - 1 - \ln r_i) + 2 \lambda \sum_k |m_{k+1} - m_k|,\qquad
          r_i = \frac{C_{\mathrm{1D},i}}{f_i},\qquad w_i = \sigma_i^{-2} + \tfrac12

where f is the projection of C, and m_k are the slopes d ln C / d ln q between the knots. The first term is
the deviance of the gamma distribution, which periodograms of Gaussian surfaces have
[Whittle, Ark. Mat. 2 (1953) 423]. It leaves the mean unbiased, and the mean logarithm of few modes does not.
The penalty allows kinks such as a roll-off [Kim et al., SIAM Rev. 51 (2009) 339]. lambda minimises the
estimated error of the prediction: the deviance plus twice the trace of the influence matrix
[Mallows, Technometrics 15 (1973) 661], or for unknown errors the generalised cross-validation
[Golub et al., Technometrics 21 (1979) 215].
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import (
    POSITIVE,
    as_leaf,
    check_increasing,
    check_lengths,
    check_values,
    is_concrete,
)
from rubberfric.base.compilation import exact_products
from rubberfric.base.objects.physical import check_kind
from rubberfric.base.quadrature import gauss, typed
from rubberfric.roughness.moments import moment
from rubberfric.roughness.spectra import Spectrum, log_ratio, mean_growth
from rubberfric.roughness.tabulated import TabulatedSpectrum

# Gauss nodes of Abel's kernel between q and 2 q.
_NODES = 24
# Terms of the series of Abel's kernel beyond 2 q. Each is at most 1/4 of the previous one, the last 2e-16.
_TERMS = 27

# Weights lambda of the penalty, in units of the deviance. The kink of a roll-off, a change of slope by
# 2 (1 + H), costs between 1e-5 and 1e4 units. A factor of 10 in lambda hardly changes the result.
_PENALTIES = 10.0 ** np.arange(3, -7, -1)
# Changes of slope below which the penalty is quadratic; a tenth of the change for H = 0 by 1.
_ROUNDED = 0.1
# C continues beyond the last entry at least as steeply as for H = 0. C_1D diverges from -1 on.
_FLATTEST = -2.0
# Fisher steps for every lambda, which begin at the solution for the previous one.
_STEPS = 4
# Fisher steps for the best lambda.
_LAST_STEPS = 10
# Largest change of ln C in a step; the deviance is not quadratic beyond.
_LONGEST = 2.0
# Information on ln C that a step assumes in addition (Levenberg), for entries that no value depends on. It
# is small compared with one mode, which has the information 1.
_DAMPING = 1e-2
# Smallest difference ln C_1D - ln f that counts. Smaller ones do not change the residual 1 - r.
_LOWEST = -5.0
# Largest difference ln C_1D - ln f. The residual does not grow beyond, against overflow.
_HIGHEST = 3.0
# Most knots. 100 are 20 per decade over five decades; the run time is proportional to them.
_KNOTS = 100


class ArealSpectrum(NamedTuple):
    """Areal spectrum of an isotropic surface from a spectrum along lines.

    Attributes
    ----------
    q : wavevectors [1/m], shape (n,)
    C : spectrum [m^4], > 0, shape (n,)
    covariance : covariance of ln C [-], shape (n, n)
        It is the inverse of the Fisher information plus the inverse variance of the kinks that the penalty
        assumes: the covariance of the estimate, plus the covariance of its bias by the penalty
        [Nychka, J. Am. Stat. Assoc. 83 (1988) 1134].
    """

    q: jax.Array
    C: jax.Array
    covariance: jax.Array

    @property
    def relative(self) -> jax.Array:
        """Standard error of ln C [-], shape (n,)."""
        return jnp.sqrt(jnp.diagonal(self.covariance))

    def table(self) -> TabulatedSpectrum:
        """Return the spectrum for a scene."""
        return TabulatedSpectrum(self.q, self.C)

    def moment_error(self, order: int) -> float:
        """Return the standard error of the logarithm of a root moment [-].

        Order 0 gives the relative error of the rms height of `table()`, order 2 that of the rms slope.
        """
        slope = jax.grad(lambda C: 0.5 * jnp.log(moment(TabulatedSpectrum(self.q, C), order)))(self.C)
        change = slope * self.C
        return float(jnp.sqrt(change @ self.covariance @ change))


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
    """
    check_kind("spectrum", spectrum, Spectrum)
    return _line_spectrum(spectrum, _positive("q", q))


@jax.jit
def _line_spectrum(spectrum, q):
    law = spectrum.power_law()
    pieces = _pieces(q, law.q[:-1], law.q[1:], law.log_value[:-1], law.exponent)
    return 2 * law.height2 * jnp.sum(pieces, -1)


def areal_spectrum(
    q: ArrayLike,
    C_1D: ArrayLike,
    relative: ArrayLike | None = None,
    *,
    at: ArrayLike | None = None,
    q1: ArrayLike | None = None,
) -> ArealSpectrum:
    r"""Return the spectrum C of an isotropic surface from C_1D along lines, by a regularised fit.

    The formula is in the docstring of the module. ln C is linear in ln q between knots, which are the
    entries of the table (every k-th entry if there are more than 100).

    Parameters
    ----------
    q : wavevectors along the line, strictly increasing, > 0 [1/m], shape (n,), n >= 2
    C_1D : spectrum along a line, > 0 [m^3], shape (n,), h_rms^2 = 2 int C_1D dq
    relative : standard errors of ln C_1D [-], > 0, a number or shape (n,), or None if they are unknown, but
        equal for all entries
    at : wavevectors of the result, >= q[0] [1/m], shape (k,), or None for q
    q1 : cutoff of the surface [1/m], > q[-1], above which C = 0, or None
        C continues beyond q[-1] with the slope of its last piece up to q1. Without q1 it continues without
        an end, at least as steeply as q^-2.

    Returns
    -------
    ArealSpectrum with q, C > 0 and the covariance of ln C

    Raises
    ------
    ValueError : if the table is invalid or its last entry is its largest one.

    Notes
    -----
    An exact table of a broken power law with kinks at its entries gives its C to 1e-9. The function can be
    compiled with jit and is differentiable with respect to q and C_1D, at the chosen lambda and without the
    change of the weights with the data. A roll-off in bins of less than about five modes may be missed; C is
    then too large below it, by more than its standard errors. The C_1D of finite profiles also contains the
    window and the detrending, which `MeasuredSpectrum.areal` takes into account.
    """
    q, C_1D = (as_leaf(name, value, 1) for name, value in (("q", q), ("C_1D", C_1D)))
    check_lengths("areal_spectrum", q=q, C_1D=C_1D)
    if q.shape[0] < 2:
        raise ValueError(f"q has {q.shape[0]} entries: must have at least 2")
    for name, value in (("q", q), ("C_1D", C_1D)):
        check_values(name, value, POSITIVE)
    check_increasing("q", q)
    if is_concrete(C_1D) and not np.asarray(C_1D)[-1] < np.max(np.asarray(C_1D)):
        raise ValueError(
            f"C_1D[-1] = {float(np.asarray(C_1D)[-1]):.4g}: must be below the largest entry, because C_1D of"
            " an isotropic surface decreases"
        )
    if relative is not None:
        relative = _positive("relative", relative)
    if q1 is not None:
        q1 = _positive("q1", q1)
        if is_concrete(q) and is_concrete(q1) and not q1 > np.asarray(q)[-1]:
            raise ValueError(f"q1 = {float(q1):.4g}: must be > q[-1] = {float(np.asarray(q)[-1]):.4g} 1/m")
    return ArealSpectrum(*_areal(q, C_1D, relative, q if at is None else _positive("at", at), q1))


def _positive(name, value):
    value = jnp.asarray(value)
    value = value if jnp.issubdtype(value.dtype, jnp.floating) else value.astype(float)
    check_values(name, value, POSITIVE)
    return value


@jax.jit
@exact_products
def _areal(q, C_1D, relative, at, q1):
    """Return `at`, C there, and the covariance of ln C."""
    n = q.shape[0]
    kept = np.unique(np.append(0, np.arange(n - 1, -1, -math.ceil(n / _KNOTS))))
    knots, measured = q[kept], jnp.log(C_1D)
    # C_1D = pi q C for H = 0
    start = (measured - jnp.log(jnp.pi * q))[kept]
    known = relative is not None
    relative = relative if known else _scatter(measured)
    weight = jnp.broadcast_to(relative, q.shape) ** -2 + 0.5
    problem = (knots, q, measured, weight, q1)
    log_C, penalty = _fitted(*jax.lax.stop_gradient((start, problem)), known)
    # Only this step is differentiated: of the condition for a minimum, by the implicit function theorem.
    change, root, deviance, freedom = _step(problem, jax.lax.stop_gradient(log_C), penalty)
    # The penalty is minus the logarithm of a Laplace distribution of kinks, whose variance is 2/lambda^2.
    prior = jnp.minimum(penalty / math.sqrt(2), 1 / _ROUNDED)
    inverse = _inverse_root(root, prior * _bends(knots))
    if not known:
        inverse *= jnp.sqrt(deviance / _left(n, freedom))
    to = _interpolation(knots, at)
    return at, jnp.exp(to @ (log_C + change)), to @ inverse @ inverse.T @ to.T


def _fitted(start, problem, known):
    """Return ln C at the knots, and the penalty with the smallest risk.

    Decreasing penalties come first, several steps for each. The last steps start again from the iterate with
    the smallest risk. One loop for both compiles in half the time of two.
    """
    penalties = typed(np.append(np.repeat(_PENALTIES, _STEPS), np.zeros(_LAST_STEPS)), start)
    first = np.arange(penalties.size) == _PENALTIES.size * _STEPS

    def better(state, now):
        log_C, least, best, at_best = state
        penalty, is_first = now
        log_C = jnp.where(is_first, best, log_C)
        penalty = jnp.where(penalty > 0, penalty, at_best)
        change, _, deviance, freedom = _step(problem, log_C, penalty)
        n = problem[1].shape[0]
        risk = deviance + 2 * freedom if known else deviance / _left(n, freedom) ** 2
        lower = risk < least
        least, best, at_best = (
            jnp.where(lower, *pair) for pair in ((risk, least), (log_C, best), (penalty, at_best))
        )
        log_C += change * jnp.minimum(1.0, _LONGEST / jnp.max(jnp.abs(change)))
        return (log_C, least, best, at_best), None

    state = (start, jnp.full((), jnp.inf, start.dtype), start, penalties[0])
    (log_C, _, _, penalty), _ = jax.lax.scan(better, state, (penalties, first))
    return log_C, penalty


def _scatter(log_C):
    """Return a standard error of ln C_1D from the median of third differences, at least the rounding.

    It is the unit of the penalties if errors are unknown. Kinks of a coarse table make it too large.
    """
    rounding = math.sqrt(jnp.finfo(log_C.dtype).eps)
    if log_C.shape[0] < 4:
        return jnp.asarray(rounding, log_C.dtype)
    # sqrt(1 + 9 + 9 + 1) standard errors; the median of |x| is 0.6745 of one
    found = jnp.median(jnp.abs(jnp.diff(jax.lax.stop_gradient(log_C), n=3))) / (0.6745 * math.sqrt(20))
    return jnp.maximum(found, rounding)


def _step(problem, log_C, penalty):
    """Return the Fisher step of ln C, a root of the information of the data, the deviance and the freedom.

    The freedom is the trace of the influence matrix, the number of parameters that the data determine.
    """
    knots, q, measured, weight, q1 = problem
    projected, slopes = _projection(log_C, knots, q, q1)
    slopes = jax.lax.stop_gradient(slopes)
    difference = jnp.clip(measured - projected, _LOWEST, _HIGHEST)
    residual = jnp.expm1(difference)
    bends = _bends(knots)
    bend = bends @ log_C
    # The weights of a quadratic penalty with the same gradient as the absolute value.
    rounded = jax.lax.stop_gradient(penalty / jnp.sqrt(bend**2 + _ROUNDED**2))
    root = jnp.sqrt(weight)[:, None] * slopes
    inverse = _inverse_root(root, jnp.sqrt(rounded)[:, None] * bends)
    downhill = slopes.T @ (weight * residual) - bends.T @ (rounded * bend)
    change = inverse @ (inverse.T @ downhill)
    freedom = jnp.sum((root @ inverse) ** 2)
    # max against rounding: the terms are not negative
    deviance = 2 * jnp.sum(weight * jnp.maximum(residual - difference, 0.0))
    return change, root, deviance, freedom


def _inverse_root(*rows):
    """Return R^-1 of the information R^T R of rows, which has the damping added."""
    eye = jnp.eye(rows[0].shape[1], dtype=rows[0].dtype)
    rows = jax.lax.stop_gradient(jnp.concatenate([*rows, math.sqrt(_DAMPING) * eye]))
    return jax.scipy.linalg.solve_triangular(jnp.linalg.qr(rows, mode="r"), eye)


def _left(n, freedom):
    """Return the degrees of freedom of the residuals, which are lost in rounding for very small penalties."""
    return jnp.maximum(n - freedom, n * math.sqrt(jnp.finfo(freedom.dtype).eps))


def _bends(knots):
    """Return the matrix from ln C at the knots to the changes of the slope d ln C / d ln q."""
    eye = jnp.eye(knots.shape[0], dtype=knots.dtype)
    return jnp.diff(jnp.diff(eye, axis=0) / log_ratio(knots[1:], knots[:-1])[:, None], axis=0)


def _interpolation(knots, at):
    """Return the matrix from ln C at the knots to ln C at `at`, linear in ln q and beyond the ends."""
    left = jnp.clip(jnp.searchsorted(knots, at, side="right") - 1, 0, knots.shape[0] - 2)
    share = (log_ratio(at, knots[left]) / log_ratio(knots[left + 1], knots[left]))[:, None]
    eye = jnp.eye(knots.shape[0], dtype=knots.dtype)
    return (1 - share) * eye[left] + share * eye[left + 1]


def _projection(log_C, knots, q, q1):
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
