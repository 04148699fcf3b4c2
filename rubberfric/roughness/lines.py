r"""Spectra along lines of isotropic surfaces, and the areal spectrum C from them.

The spectrum along a line is the projection of the areal spectrum, an Abel transform,

.. math:: C_\mathrm{1D}(q) = \int_{-\infty}^\infty dq_y\, C\big(\sqrt{q^2 + q_y^2}\big)
          = 2 \int_q^\infty \frac{C(x)\, x}{\sqrt{x^2 - q^2}}\, dx

`rubberfric.roughness.projections` computes it. `areal_spectrum` fits ln C at knots to a measured
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
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import (
    POSITIVE,
    ArrayLike,
    as_leaf,
    check_increasing,
    check_lengths,
    check_values,
    is_concrete,
)
from rubberfric.base.compilation import exact_products, quick_jit
from rubberfric.base.quadrature import typed
from rubberfric.roughness.moments import moment
from rubberfric.roughness.periodograms import Sampling, expected_bins
from rubberfric.roughness.projections import line_spectrum, positive_array, projection
from rubberfric.roughness.spectra import log_ratio
from rubberfric.roughness.tabulated import TabulatedSpectrum

# Weights lambda of the penalty, in units of the deviance. The kink of a roll-off, a change of slope by
# 2 (1 + H), costs between 1e-5 and 1e4 units. A factor of 10 in lambda hardly changes the result.
_PENALTIES = 10.0 ** np.arange(3, -7, -1)
# Changes of slope below which the penalty is quadratic; a tenth of the change for H = 0 by 1.
_ROUNDED = 0.1
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


# Corrections of the bins of a profile for window and detrending; the third changes the rms height by less
# than 1 %, for profiles as short as the longest wave.
_CORRECTIONS = 3


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

    Examples
    --------
    >>> q = np.geomspace(1e3, 1e5, 5)
    >>> areal = rf.roughness.areal_spectrum(q, np.pi / 200 * q**-3)
    >>> (100 * np.asarray(areal.C) * q**4).round(4)
    array([1., 1., 1., 1., 1.])
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
        relative = positive_array("relative", relative)
    if q1 is not None:
        q1 = positive_array("q1", q1)
        if is_concrete(q) and is_concrete(q1) and not np.asarray(q1) > np.asarray(q)[-1]:
            raise ValueError(f"q1 = {float(q1):.4g}: must be > q[-1] = {float(np.asarray(q)[-1]):.4g} 1/m")
    return ArealSpectrum(*_areal(q, C_1D, relative, q if at is None else positive_array("at", at), q1))


def areal_of_bins(
    q: np.ndarray,
    C_1D: np.ndarray,
    relative: np.ndarray,
    at: np.ndarray,
    q1: float | None,
    cell: float,
    modes: np.ndarray,
    sampling: Sampling,
) -> ArealSpectrum:
    """Return the areal spectrum of profiles, corrected for their window, detrending and bins.

    C_1D is divided by the ratio of the expected bins (`expected_bins`) to the projection, both for the C of
    the previous inversion. The arguments are those of `areal_spectrum` and `expected_bins`.
    """
    ratio: Any = 1.0
    for _ in range(_CORRECTIONS):
        table = areal_spectrum(q, C_1D / ratio, relative, at=at, q1=q1).table()
        expected = expected_bins(
            lambda q, table=table: np.asarray(line_spectrum(table, q)), cell, modes, sampling
        )
        ratio = expected / np.asarray(line_spectrum(table, q))
    return areal_spectrum(q, C_1D / ratio, relative, at=at, q1=q1)


# One call in a process is the usual case, in which compiling takes 20 times as long as computing.
@quick_jit()
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
    scatter = jnp.median(jnp.abs(jnp.diff(jax.lax.stop_gradient(log_C), n=3))) / (0.6745 * math.sqrt(20))
    return jnp.maximum(scatter, rounding)


def _step(problem, log_C, penalty):
    """Return the Fisher step of ln C, a root of the information of the data, the deviance and the freedom.

    The freedom is the trace of the influence matrix, the number of parameters that the data determine.
    """
    knots, q, measured, weight, q1 = problem
    projected, slopes = projection(log_C, knots, q, q1)
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
