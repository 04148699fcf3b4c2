r"""Moments of a roughness spectrum up to a wavevector: heights, slopes, and the cutoff for a slope.

.. math:: m_n(q) = 2\pi\int_{q_0}^{q} q'^{\,1+n}\, C(q')\, dq',\qquad
          h_\mathrm{rms} = \sqrt{m_0},\qquad \mathrm{slope} = \sqrt{m_2}

A spectrum is a broken power law, so a moment and its inverse have closed forms on every piece.
"""

import math
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import POSITIVE, ArrayLike, NumberLike, as_leaf, as_numbers, is_concrete, shown
from rubberfric.base.compilation import exact_products, quick_jit
from rubberfric.base.objects.physical import check_kind
from rubberfric.base.roots import root
from rubberfric.roughness.spectra import BrokenPowerLaw, Spectrum, log_ratio, mean_growth

# Wavevector of the distance of atoms, 0.1 nm [1/m].
LARGEST_WAVEVECTOR = 2 * math.pi / 1e-10


def cumulative_moment(law: BrokenPowerLaw, order: float, distance: NumberLike) -> jax.Array:
    r"""Return the moment up to a wavevector, exact on every piece.

    .. math:: m_n(q) = 2\pi\int_{q_0}^{q} q'^{\,1+n}\, C\, dq',\qquad distance = \ln(q / q_0)

    Parameters
    ----------
    law : BrokenPowerLaw
    order : n, a number
    distance : ln(q / law.q[0]) [-], any shape

    Returns
    -------
    array of the shape of distance [m^(2 - n)]. The moment is 0 below the first wavevector, and constant above
    the last wavevector. All digits are right for any small distance (1e-18 at light loads).

    Limits: derivatives at a kink are taken in the piece above the kink, and at the last wavevector in the
    last piece.
    """
    distance = jnp.asarray(distance)[..., None]
    width = log_ratio(law.q[1:], law.q[:-1])
    border = log_ratio(law.q, law.q[0])
    # `where`, because a clip would halve the derivative at a border.
    last = np.arange(width.shape[0]) == width.shape[0] - 1
    inside = (distance >= border[:-1]) & ((distance < border[1:]) | (last & (distance <= border[1:])))
    reach = jnp.where(inside, distance - border[:-1], jnp.where(distance > border[:-1], width, 0.0))
    return 2 * jnp.pi * law.height2 * jnp.sum(_piece(law, order, reach), -1)


def _piece(law, order, reach):
    """Integrate q^(2 + order) C / height2 over ln q, from the left end of every piece up to `reach`."""
    growth = (law.exponent + order) * reach
    # From the end with the larger integrand, because e^growth may overflow from the other.
    rising = growth > 0
    largest = jnp.exp(_log_left(law, order) + jnp.where(rising, growth, 0.0))
    return largest * reach * mean_growth(jnp.where(rising, -growth, growth))


def _log_left(law, order):
    """Return ln(q^(2 + order) C / height2) at the left end of every piece."""
    return law.log_value[:-1] + order * jnp.log(law.q[:-1])


def moment(spectrum: Spectrum, order: float) -> jax.Array:
    r"""Return the spectral moment 2 pi int q^(1 + order) C dq, exact on every piece.

    The moments of order 0, 2 and 4 are h_rms^2 [m^2], the mean square slope [-] and the mean square curvature
    [1/m^2].

    Examples
    --------
    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> f"{float(np.sqrt(rf.roughness.moment(road, 4))):.4g}"
    '7.662e+04'
    """
    check_kind("spectrum", spectrum, Spectrum)
    return _moment(spectrum, order)


@quick_jit(static_argnames="order")
def _moment(spectrum, order):
    return cumulative_moment(spectrum.power_law(), order, jnp.inf)


def rms_height(spectrum: Spectrum, q: ArrayLike | None = None) -> jax.Array:
    r"""Return the root-mean-square height of the roughness up to q [m].

    .. math:: h(q) = \sqrt{2\pi\int_{q_0}^{q} q'\, C\, dq'}

    Parameters
    ----------
    spectrum : SelfAffine, TabulatedSpectrum, or an anisotropic one (C averaged over all directions)
    q : largest wavevector [1/m], any shape, > 0; None: the whole spectrum

    Returns
    -------
    array of the shape of q [m]. Height and derivative are 0 up to the first wavevector.

    Raises
    ------
    ValueError : if a concrete q is <= 0.

    Examples
    --------
    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> round(float(rf.roughness.rms_height(road)), 9)
    0.0005
    """
    return _root_moment(spectrum, 0, q)


def rms_slope(spectrum: Spectrum, q: ArrayLike | None = None) -> jax.Array:
    r"""Return the root-mean-square slope of the roughness up to q [-].

    .. math:: \mathrm{slope}(q) = \sqrt{2\pi\int_{q_0}^{q} q'^3\, C\, dq'}

    The parameters and errors are the same as for `rms_height`.

    Examples
    --------
    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> round(float(rf.rms_slope(road)), 3)
    1.738
    """
    return _root_moment(spectrum, 2, q)


def _root_moment(spectrum, order, q):
    check_kind("spectrum", spectrum, Spectrum)
    return _root(spectrum, order, None if q is None else as_numbers("q", q, POSITIVE))


@quick_jit(static_argnames="order")
@exact_products
def _root(spectrum, order, q):
    law, distance = spectrum.power_law(), jnp.inf
    if q is not None:
        # Below, ln q may be -inf, whose derivative times 0 is not 0.
        distance = log_ratio(jnp.where(q >= law.q[0], q, law.q[0]), law.q[0])
    # The height is outside the root, because sqrt(height^2) has no derivative for a smooth surface.
    return spectrum.height_scale() * safe_root(cumulative_moment(unscaled(law), order, distance))


def safe_root(square: jax.Array) -> jax.Array:
    """Return the square root, with derivative 0 where `square` is 0 (smooth surface)."""
    rough = square > 0
    return jnp.where(rough, jnp.sqrt(jnp.where(rough, square, 1.0)), 0.0)


def unscaled(law: BrokenPowerLaw) -> BrokenPowerLaw:
    """Return the law with `height2` replaced by 1 m^2."""
    return law._replace(height2=jnp.ones_like(law.height2))


def cutoff(
    spectrum: Spectrum, rms_slope: NumberLike = 1.3, *, keep: Literal["C", "h_rms"] = "C"
) -> jax.Array:
    r"""Return the wavevector up to which a spectrum has a given rms slope.

    This wavevector is the usual q1 for rubber on roads.

    .. math:: 2\pi\int_{q_0}^{q_1} q^3\, C\, dq = \mathrm{slope}^2

    Parameters
    ----------
    spectrum : SelfAffine, TabulatedSpectrum, Anisotropic or TabulatedAnisotropic
        The result may exceed the spectrum's q1, but not the end of a table. For a SelfAffine, q0, qr and the
        Hurst exponent stay constant. If q1 is replaced and h_rms is kept, C0 and the slope change.
        `with_cutoff` returns a spectrum with the given slope and the same C0. The slope of anisotropic
        roughness includes all directions.
    rms_slope : [-], > 0, any shape
    keep : "C" or "h_rms"
        "C" keeps C(q). "h_rms" keeps the height of a SelfAffine and changes C0, so that
        `spectrum.replace(q1=...)` has the given slope. For a table, "C" and "h_rms" give the same result.

    Returns
    -------
    array of the shape of rms_slope [1/m]. Under jit, the result is inf with derivative 0 if no wavevector has
    the slope.

    Raises
    ------
    ValueError : if a concrete rms_slope is <= 0, or if the spectrum never reaches the slope. With "h_rms",
        also if the slope is below the slope of the plateau.

    Limits: the result is differentiable (a closed form for "C"), and `rms_slope` at the result has an error
    of 1e-13. If the squared slope grows like ln q (H = 1), the result may exceed the floating-point range and
    is then infinite.

    Examples
    --------
    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> round(float(rf.roughness.cutoff(road, 1.3)), -1)  # in 1/m
    30570.0
    """
    check_kind("spectrum", spectrum, Spectrum)
    rms_slope = as_numbers("rms_slope", rms_slope, POSITIVE)
    if keep not in ("C", "h_rms"):
        raise ValueError(f'keep = {shown(keep)}: must be "C" or "h_rms"')
    at_height = keep == "h_rms" and spectrum.endless
    wavevector, reachable = (_cutoff_at_height if at_height else _cutoff_below)(spectrum, rms_slope)
    if is_concrete(reachable) and not np.all(reachable):
        wrong = float(np.asarray(rms_slope)[~np.asarray(reachable)].flat[0])
        if at_height:
            raise ValueError(
                f"rms_slope = {wrong!r}: no cutoff gives this slope if h_rms is kept; rms_slope must be "
                f"larger than the slope of the plateau, and the surface must be rough"
            )
        whole = cumulative_moment(unscaled(spectrum.uncut_law()), 2, jnp.inf)
        has = float(spectrum.height_scale() * jnp.sqrt(whole))
        raise ValueError(f"rms_slope = {wrong!r}: must be at most {has:.6g}, the slope of the whole spectrum")
    return wavevector


@quick_jit()
@exact_products
def _cutoff_below(spectrum, slope):
    """Return the cutoff q1 for an rms slope, and a mask that is True if q1 exists.

    q1 is infinite if no cutoff exists.
    """
    law = spectrum.uncut_law()
    piece, beyond, reachable = _where_reached(law, slope, spectrum.endless)
    return jnp.where(reachable, law.q[piece] * jnp.exp(beyond), jnp.inf), reachable


@quick_jit()
@exact_products
def _cutoff_at_height(spectrum, slope):
    """Return the q1 for which m_2 / m_0 = slope^2 / height^2, and a mask that is True if q1 exists.

    q1 is the end of the last piece of the power law, whose other pieces are kept. height is the rms height of
    the spectrum. q1 is infinite if it does not exist.
    """
    law = unscaled(spectrum.uncut_law())
    width = log_ratio(law.q[1:], law.q[:-1])
    last = np.arange(width.shape[0]) == width.shape[0] - 1

    def log_moment(order, t):
        return jnp.log(jnp.sum(_piece(law, order, jnp.where(last, t[..., None], width)), -1))

    height = spectrum.height_scale()
    rough = height > 0
    # ln(slope^2 / h^2), with h up to the present end.
    log_height2 = 2 * jnp.log(jnp.where(rough, height, 1.0)) + jnp.log(2 * jnp.pi) + log_moment(0, width[-1])
    target = 2 * jnp.log(slope) - log_height2
    # At zero width without a plateau the moments are 0/0.
    nearest, farthest = 1e-12, 0.4 * math.log(float(jnp.finfo(target.dtype).max))

    def miss(t):
        return log_moment(2, t) - log_moment(0, t) - target

    t, between = root(miss, jnp.full_like(target, nearest), jnp.full_like(target, farthest))
    reachable = rough & between
    t = jnp.where(reachable, t, 0.0)
    return jnp.where(reachable, law.q[-2] * jnp.exp(t), jnp.inf), reachable


def _where_reached(law, slope, endless):
    """Find the wavevector q up to which the rms slope is `slope`.

    Return the index of the piece that contains q, ln(q / left end of this piece), and a mask that is True if
    q exists. If `endless` is True, the last piece continues without an end.
    """
    unit = 2 * jnp.pi * jnp.exp(_log_left(law, 2))
    width = log_ratio(law.q[1:], law.q[:-1])
    before = jnp.concatenate([jnp.zeros(1, unit.dtype), jnp.cumsum(2 * jnp.pi * _piece(law, 2, width))])
    rough = law.height2 > 0
    target = slope**2 / jnp.where(rough, law.height2, 1.0)
    # By rounding, the squared slope of a whole table may exceed its moment.
    rounding = 1 + 8 * float(jnp.finfo(target.dtype).eps)
    reachable = rough & (endless | (target <= before[-1] * rounding))
    target = jnp.where(reachable, target, before[-1])
    # A slope reached at a border belongs to the piece before it.
    piece = jnp.clip(jnp.searchsorted(before, target) - 1, 0, width.shape[0] - 1)
    integral = (target - before[piece]) / unit[piece]
    return piece, _inverse_growth(law.exponent[piece] + 2, integral), reachable


def _inverse_growth(exponent, integral):
    """Solve (e^(exponent u) - 1) / exponent = integral for u, with u = integral if exponent is 0."""
    y = exponent * integral
    near = jnp.abs(y) < 1e-2
    series = integral * sum((-y) ** n / (n + 1) for n in range(8))
    # If the slope saturates, the integral may exceed its limit over an endless piece.
    far = jnp.log1p(jnp.maximum(jnp.where(near, 1.0, y), -1 + 1e-15)) / jnp.where(near, 1.0, exponent)
    return jnp.where(near, series, far)


def with_cutoff(spectrum: Spectrum, rms_slope: NumberLike = 1.3) -> Spectrum:
    """Return the spectrum cut at the wavevector up to which the rms slope has the given value.

    C(q) below this wavevector is unchanged.

    Parameters
    ----------
    spectrum : SelfAffine, Anisotropic, TabulatedSpectrum or TabulatedAnisotropic
    rms_slope : [-], > 0, a number

    Returns
    -------
    SelfAffine with the new q1, h_rms for the same plateau C0, and qr = q1 if q1 lies on the plateau;
    Anisotropic with such a base; or the same table with the new q1. Under jit, a table that never reaches the
    slope is not cut.

    Raises
    ------
    ValueError : as in `cutoff`, if the spectrum is of another kind, or if a concrete q1 exceeds
        2 pi / 0.1 nm. Waves shorter than the distance of atoms are no roughness.

    Examples
    --------
    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> round(float(rf.rms_slope(rf.with_cutoff(road, 1.3))), 6)
    1.3
    """
    check_kind("spectrum", spectrum, Spectrum)
    rms_slope = as_leaf("rms_slope", rms_slope, 0)
    q1 = cutoff(spectrum, rms_slope)
    if is_concrete(q1) and not np.all(np.asarray(q1) <= LARGEST_WAVEVECTOR):
        raise ValueError(
            f"rms_slope = {shown(rms_slope)}: is reached only at q1 = {np.max(q1):.3g} 1/m, by waves shorter"
            f" than the distance of atoms, {LARGEST_WAVEVECTOR:.2g} 1/m; must be smaller, 1.3 is usual"
        )
    return spectrum.cut(q1)
