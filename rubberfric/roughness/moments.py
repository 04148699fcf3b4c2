r"""Moments of a roughness spectrum up to a wavevector: heights, slopes, and where a slope is reached.

.. math:: m_n(q) = 2\pi\int_{q_0}^{q} q'^{\,1+n}\, C(q')\, dq',\qquad
          h_\mathrm{rms} = \sqrt{m_0},\qquad \mathrm{slope} = \sqrt{m_2}

A spectrum is a broken power law, so both a moment and its inverse are closed piece by piece.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import POSITIVE, check_values, is_concrete
from rubberfric.roughness.spectra import BrokenPowerLaw, Spectrum, log_ratio, mean_growth, power_law_of


def cumulative_moment(law: BrokenPowerLaw, order: float, distance: ArrayLike) -> jax.Array:
    r"""Moment up to a wavevector, exact piece by piece.

    .. math:: m_n(q) = 2\pi\int_{q_0}^{q} q'^{\,1+n}\, C\, dq',\qquad distance = \ln(q / q_0)

    Parameters
    ----------
    law : BrokenPowerLaw
    order : n, a number
    distance : ln(q / law.q[0]) [-], any shape

    Returns
    -------
    array, shape of distance [m^(2 - n)]: 0 below the first wavevector, the whole moment above the
    last; all digits however small the distance (1e-18 at light loads).

    Limits: derivatives at a kink are those of the piece above it, at the last wavevector those of
    the last piece.
    """
    distance = jnp.asarray(distance)[..., None]
    width = log_ratio(law.q[1:], law.q[:-1])
    border = log_ratio(law.q, law.q[0])
    # Selected, not clipped: a clip would give half the derivative at a border.
    last = np.arange(width.shape[0]) == width.shape[0] - 1
    inside = (distance >= border[:-1]) & ((distance < border[1:]) | (last & (distance <= border[1:])))
    reach = jnp.where(inside, distance - border[:-1], jnp.where(distance > border[:-1], width, 0.0))
    return 2 * jnp.pi * law.height2 * jnp.sum(_piece(law, order, reach), -1)


def _piece(law, order, reach):
    """Integral of q^(2 + order) C / height2 over ln q from the left end of every piece, reach wide."""
    growth = (law.exponent + order) * reach
    # From the end where the integrand is larger: from the other, e^growth may overflow.
    rising = growth > 0
    largest = jnp.exp(_log_left(law, order) + jnp.where(rising, growth, 0.0))
    return largest * reach * mean_growth(jnp.where(rising, -growth, growth))


def _log_left(law, order):
    """ln(q^(2 + order) C / height2) at the left end of every piece."""
    return law.log_value[:-1] + order * jnp.log(law.q[:-1])


def moment(spectrum: Spectrum, order: float) -> jax.Array:
    r"""Spectral moment 2 pi int q^(1 + order) C dq, exact piece by piece.

    order 0: h_rms^2 [m^2]; 2: mean square slope [-]; 4: mean square curvature [1/m^2].
    """
    return cumulative_moment(power_law_of(spectrum), order, jnp.inf)


def rms_height(spectrum: Spectrum, q: ArrayLike | None = None) -> jax.Array:
    r"""Root-mean-square height of the roughness up to q [m].

    .. math:: h(q) = \sqrt{2\pi\int_{q_0}^{q} q'\, C\, dq'}

    Parameters
    ----------
    spectrum : SelfAffine or TabulatedSpectrum; or an anisotropic one, for C averaged over all directions
    q : largest wavevector counted [1/m], any shape, > 0; None: all

    Returns
    -------
    array, shape of q [m]; 0 up to the first wavevector, where it has derivative 0.

    Raises
    ------
    ValueError : concrete q <= 0.
    """
    return _root_moment(spectrum, 0, q)


def rms_slope(spectrum: Spectrum, q: ArrayLike | None = None) -> jax.Array:
    r"""Root-mean-square slope of the roughness up to q [-].

    .. math:: \mathrm{slope}(q) = \sqrt{2\pi\int_{q_0}^{q} q'^3\, C\, dq'}

    Parameters, errors and limits as for `rms_height`.
    """
    return _root_moment(spectrum, 2, q)


def _root_moment(spectrum, order, q):
    law = power_law_of(spectrum)
    distance = jnp.inf
    if q is not None:
        check_values("q", q, POSITIVE)
        q = jnp.asarray(q)
        # Below, ln q may be -inf, with a derivative that 0 does not silence.
        distance = log_ratio(jnp.where(q >= law.q[0], q, law.q[0]), law.q[0])
    # The height stays out of the root: that of height^2 has no derivative at a smooth surface.
    square = cumulative_moment(law._replace(height2=jnp.ones_like(law.height2)), order, distance)
    rough = square > 0
    root = jnp.where(rough, jnp.sqrt(jnp.where(rough, square, 1.0)), 0.0)
    return spectrum.height_scale() * root


def cutoff(spectrum: Spectrum, rms_slope: ArrayLike = 1.3) -> jax.Array:
    r"""Wavevector up to which a spectrum has an rms slope: the usual choice of q1 for rubber on roads.

    .. math:: 2\pi\int_{q_0}^{q_1} q^3\, C\, dq = \mathrm{slope}^2

    Parameters
    ----------
    spectrum : SelfAffine
            its plateau C0, q0, qr and Hurst exponent are kept, its present q1 is not a limit: the
            result may be smaller or larger. Note that h_rms of a SelfAffine belongs to its own q1:
            with another q1 and the same h_rms, C0 and so the slope would change. `with_cutoff`
            gives the spectrum that has this slope.
        or TabulatedSpectrum
            the result lies inside the table.
        or Anisotropic or TabulatedAnisotropic, as these: the slope is that of all directions together.
    rms_slope : [-], > 0, any shape

    Returns
    -------
    array, shape of rms_slope [1/m]. Under jit infinite, with derivative 0, where there is none.

    Raises
    ------
    ValueError : concrete rms_slope <= 0, or one that the spectrum (a table, a smooth surface) never has.

    Limits: closed form, differentiable; `rms_slope` at the result is good to 1e-13. A slope that
    grows like ln q (H = 1) may put it beyond the floating-point range: infinite.
    """
    return _cut(spectrum, rms_slope)[0]


def _cut(spectrum, rms_slope):
    """The wavevector with the slope, the piece that it is in and ln of it over the piece's left end."""
    check_values("rms_slope", rms_slope, POSITIVE)
    law = power_law_of(spectrum)
    piece, beyond, reachable = _where_reached(law, jnp.asarray(rms_slope), spectrum.endless)
    if is_concrete(reachable) and not np.all(reachable):
        has = float(_root_moment(spectrum, 2, None))
        shown = float(np.asarray(rms_slope)[~np.asarray(reachable)].flat[0])
        raise ValueError(f"rms_slope = {shown!r}: must be at most {has:.6g}, the slope of the whole spectrum")
    return jnp.where(reachable, law.q[piece] * jnp.exp(beyond), jnp.inf), piece, beyond


def _where_reached(law, slope, endless):
    """The piece in which the slope is reached, ln(q / its left end), and whether it is reached.

    endless : whether the last piece goes on for ever
    """
    unit = 2 * jnp.pi * jnp.exp(_log_left(law, 2))
    width = log_ratio(law.q[1:], law.q[:-1])
    before = jnp.concatenate([jnp.zeros(1, unit.dtype), jnp.cumsum(2 * jnp.pi * _piece(law, 2, width))])
    rough = law.height2 > 0
    target = slope**2 / jnp.where(rough, law.height2, 1.0)
    # The slope of a whole table, squared again, may come out above it by rounding.
    rounding = 1 + 8 * float(jnp.finfo(target.dtype).eps)
    reachable = rough & (endless | (target <= before[-1] * rounding))
    target = jnp.where(reachable, target, before[-1])
    # A slope reached at a border is reached at the end of the piece before it.
    piece = jnp.clip(jnp.searchsorted(before, target) - 1, 0, width.shape[0] - 1)
    integral = (target - before[piece]) / unit[piece]
    return piece, _inverse_growth(law.exponent[piece] + 2, integral), reachable


def _inverse_growth(exponent, integral):
    """u with (e^(exponent u) - 1) / exponent = integral; u = integral where the exponent vanishes."""
    y = exponent * integral
    near = jnp.abs(y) < 1e-2
    series = integral * sum((-y) ** n / (n + 1) for n in range(8))
    # There, where the slope saturates, it could ask for more than an endless piece has.
    far = jnp.log1p(jnp.maximum(jnp.where(near, 1.0, y), -1 + 1e-15)) / jnp.where(near, 1.0, exponent)
    return jnp.where(near, series, far)


def with_cutoff(spectrum: Spectrum, rms_slope: ArrayLike = 1.3) -> Spectrum:
    """The spectrum cut at `cutoff`, so that it has this rms slope; C(q) is the same below.

    Parameters
    ----------
    spectrum : SelfAffine, Anisotropic or TabulatedSpectrum
    rms_slope : [-], > 0, a number

    Returns
    -------
    SelfAffine with the new q1, the h_rms that the same plateau C0 has up to there, and qr = q1 if
    that lies on the plateau; Anisotropic with such a base; or TabulatedSpectrum with as many entries,
    those beyond the cut moved to even places in the interval of the cut, on the same power law.

    Raises
    ------
    ValueError : as `cutoff`, or another kind of spectrum.
    """
    reached = _cut(spectrum, rms_slope)
    return spectrum.cut(*reached)
