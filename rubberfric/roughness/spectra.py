r"""Roughness power spectra C(q), isotropic.

Normalisation: C(q) = (2 pi)^-2 int d^2x <h(x) h(0)> e^{-i q x}, so that
h_rms^2 = 2 pi int q C dq and slope^2 = 2 pi int q^3 C dq. (contact.engineering's C_iso
is 4 pi^2 times this.) [Persson et al., J. Phys.: Condens. Matter 17 (2005) R1,
arXiv:cond-mat/0502419]

Internally a spectrum is a broken power law. It is stored as the wavevectors of its kinks and ends, ln(q^2 C)
at these wavevectors [m^2], and the exponent of every piece. The forward model uses only this power law. It
never forms C, which underflows float32 in SI units (1e-39 m^4 at q = 1e9 1/m).
"""

from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import (
    NONNEGATIVE,
    PLAUSIBLE_HEIGHT,
    PLAUSIBLE_WAVEVECTOR,
    POSITIVE,
    ArrayLike,
    NumberLike,
    as_numbers,
    between,
    either,
    is_concrete,
)
from rubberfric.base.compilation import exact_products, quick_jit
from rubberfric.base.objects.fields import Number, leaf
from rubberfric.base.objects.physical import Kind, check_kind, kinds, physical


class BrokenPowerLaw(NamedTuple):
    """Broken power law: q^2 C(q) is height2 * exp(log_value) at the kinks, and a power of q in between."""

    q: jax.Array  # wavevectors of the kinks [1/m], ascending, shape (n,)
    log_value: jax.Array  # ln(q^2 C / height2) at the kinks, shape (n,)
    exponent: jax.Array  # d ln(q^2 C) / d ln q of the pieces, shape (n - 1,)
    height2: jax.Array  # scale [m^2]; outside the logarithm because it may be 0


class Spectrum(Kind):
    """A roughness power spectrum: base class of SelfAffine, TabulatedSpectrum and anisotropic spectra.

    A subclass implements `power_law`.
    """

    # True if the last piece continues beyond the last wavevector in the search for a given slope.
    endless: ClassVar[bool] = False
    # True if `harmonics_at` depends on the wavevector.
    harmonics_vary: ClassVar[bool] = False

    def power_law(self) -> BrokenPowerLaw:
        """Return the spectrum, averaged over all directions, as a `BrokenPowerLaw`."""
        raise NotImplementedError(f"{type(self).__name__}.power_law")

    def height_scale(self) -> jax.Array:
        """Return the square root of `power_law().height2` [m].

        A subclass overrides this method if the height may be 0, where the square root has no derivative.
        """
        return jnp.sqrt(self.power_law().height2)

    def uncut_law(self) -> BrokenPowerLaw:
        """Return the power law in which `cutoff` searches for a slope.

        The power law of a table continues beyond q1 to the last entry.
        """
        return self.power_law()

    def cut(self, q1: jax.Array) -> "Spectrum":
        """Return the spectrum that ends at q1 [1/m], with an unchanged C(q) below q1."""
        del q1
        can = [name for name, kind in kinds(Spectrum).items() if kind.cut is not Spectrum.cut]
        raise ValueError(f"spectrum is a {type(self).__name__}: must be {either(can)}")

    def harmonic_count(self) -> int:
        """Return the highest m of the harmonics cos(2 m phi) and sin(2 m phi), or 0 if C is isotropic."""
        return 0

    def harmonics_at(self, q: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Return c_m and s_m for m = 1 ... harmonic_count at q [1/m].

        c_m and s_m have the shape (harmonics,), or (harmonics, ``*q.shape``) if the harmonics depend on q.
        """
        raise NotImplementedError(f"{type(self).__name__}.harmonics_at")

    def harmonic_knots(self) -> jax.Array:
        """Return wavevectors between which the harmonics are linear in ln q, if the harmonics depend on q."""
        raise NotImplementedError(f"{type(self).__name__}.harmonic_knots")

    def harmonics_left_out(self) -> jax.Array:
        """Return the share of the roughness in the harmonics that are left out [-]."""
        return jnp.zeros(())

    def entries(self) -> jax.Array | None:
        """Return C [m^4] at the entries of a table, or None if the spectrum is given by a formula."""
        return None


@physical
class SelfAffine(Spectrum):
    r"""Self-affine fractal with a plateau, given by its rms height.

    .. math:: C = C_0 \; (q_0 < q < q_r), \qquad C = C_0 (q/q_r)^{-2(1+H)} \; (q_r < q < q_1)

    Parameters
    ----------
    q0 : smallest wavevector [1/m], > 0
    qr : roll-off wavevector [1/m], q0 <= qr <= q1
    q1 : cutoff wavevector [1/m], > q0
    hurst : H [-], 0 ... 1
    h_rms : root-mean-square height of the roughness in q0 < q < q1 [m], >= 0

    Examples
    --------
    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> f"{float(rf.power_spectrum(road, 500.0)):.4g}"
    '3.554e-14'
    >>> again = rf.SelfAffine.from_C0(100.0, 1000.0, 1e5, 0.8, C0=3.554e-14)
    >>> round(1e3 * float(again.h_rms), 3)  # in mm
    0.5
    """

    endless: ClassVar[bool] = True
    alternatives: ClassVar = {"C0": "h_rms"}
    rising: ClassVar = (("q0", "qr", "q1"),)

    q0: Number = leaf(POSITIVE, unit="1/m", plausible=PLAUSIBLE_WAVEVECTOR)
    qr: Number = leaf(POSITIVE, unit="1/m", plausible=PLAUSIBLE_WAVEVECTOR)
    q1: Number = leaf(POSITIVE, unit="1/m", plausible=PLAUSIBLE_WAVEVECTOR)
    hurst: Number = leaf(between(0.0, 1.0), unit="-")
    h_rms: Number = leaf(NONNEGATIVE, unit="m", plausible=PLAUSIBLE_HEIGHT)

    def _check(self):
        if is_concrete(self.q0) and is_concrete(self.q1) and float(self.q0) == float(self.q1):
            q = float(self.q0)
            raise ValueError(f"SelfAffine.q1 = {q!r}: must be > q0 = {q!r}")

    def doubts(self) -> list[str]:
        """Return the warnings of `doubts_of_roughness` for this spectrum."""
        log_q = np.log(np.array([self.q0, self.qr, self.q1], float))
        log_C = np.array([0.0, 0.0, -2 * (1 + float(self.hurst)) * (log_q[2] - log_q[1])])
        return doubts_of_roughness(log_q, log_C, float(self.h_rms))

    @classmethod
    def from_C0(
        cls, q0: NumberLike, qr: NumberLike, q1: NumberLike, hurst: NumberLike, C0: NumberLike
    ) -> "SelfAffine":
        """Create a spectrum from its plateau C0 [m^4] instead of h_rms [m]."""
        unit = cls(q0, qr, q1, hurst, 1.0)
        if is_concrete(C0) and not np.asarray(C0) >= 0:
            raise ValueError(f"SelfAffine.C0 = {C0!r}: must be >= 0")
        return cls(q0, qr, q1, hurst, _height_of_plateau(unit, C0))

    def power_law(self) -> BrokenPowerLaw:
        """Return a broken power law of two pieces, the plateau and the self-affine range."""
        q = jnp.stack([jnp.asarray(x) for x in (self.q0, self.qr, self.q1)])
        to_rolloff, beyond = log_ratio(q[1], q[0]), log_ratio(q[2], q[1])
        top = log_plateau(self)
        exponent = jnp.stack([jnp.full_like(top, 2.0), -2.0 * self.hurst + 0 * top])
        log_value = jnp.stack([top - 2 * to_rolloff, top, top + exponent[1] * beyond])
        return BrokenPowerLaw(q, log_value, exponent, self.h_rms**2)

    def height_scale(self) -> jax.Array:
        """Return h_rms [m]."""
        return self.h_rms

    def cut(self, q1: jax.Array) -> "SelfAffine":
        """Return the spectrum up to q1 [1/m] with unchanged C0, q0 and H.

        If q1 lies on the plateau, qr equals q1.
        """
        qr, h_rms = _when_cut(self, q1)
        return SelfAffine(self.q0, qr, q1, self.hurst, h_rms)


@quick_jit()
@exact_products
def _height_of_plateau(unit, C0):
    """Return h_rms of a self-affine spectrum with the plateau C0; `unit` has h_rms = 1 m."""
    return unit.qr * jnp.exp(-0.5 * log_plateau(unit)) * jnp.sqrt(C0)


@quick_jit()
@exact_products
def _when_cut(spectrum, q1):
    """Return qr and h_rms of a self-affine spectrum with another q1 and an unchanged plateau C0."""
    qr = jnp.minimum(spectrum.qr, q1)
    unit = SelfAffine(spectrum.q0, qr, q1, spectrum.hurst, 1.0)
    # h^2 = qr^2 C0 / e^(log plateau) without C0, which may underflow.
    growth = 0.5 * (log_plateau(spectrum) - log_plateau(unit))
    return qr, spectrum.h_rms * (qr / spectrum.qr) * jnp.exp(growth)


def power_law_of(spectrum: Spectrum) -> BrokenPowerLaw:
    """Return the power law of a spectrum, or raise ValueError if the object is not a spectrum."""
    check_kind("spectrum", spectrum, Spectrum)
    return _power_law(spectrum)


# Compiled as a whole, so that a call compiles once instead of once per operation.
@quick_jit()
def _power_law(spectrum):
    return spectrum.power_law()


def log_ratio(q: jax.Array | np.ndarray, start: jax.Array | np.ndarray) -> jax.Array:
    """Return ln(q / start), without cancellation for q close to start."""
    return jnp.log1p((q - start) / start)


def power_spectrum(spectrum: Spectrum, q: ArrayLike) -> jax.Array:
    """Return C [m^4] at wavevectors q [1/m] of any shape. C is zero outside the spectrum's range.

    A ValueError is raised if q is not numeric.

    Examples
    --------
    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> round(float(rf.power_spectrum(road, 2e3) / rf.power_spectrum(road, 1e3)), 4)  # 2^(-2 (1 + H))
    0.0825
    """
    check_kind("spectrum", spectrum, Spectrum)
    return _power_spectrum(spectrum, as_numbers("q", q))


@quick_jit()
@exact_products
def _power_spectrum(spectrum, q):
    law = spectrum.power_law()
    inside = (q >= law.q[0]) & (q <= law.q[-1])
    return jnp.where(inside, law.height2 * jnp.exp(log_shape(law, q)), 0.0)


@quick_jit()
def log_power_spectrum(law: BrokenPowerLaw, q: jax.Array | np.ndarray) -> jax.Array:
    """Return ln C at wavevectors q, where the first and last piece continue beyond the ends of the law.

    Fits of C use this function.

    Examples
    --------
    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> log_C = rf.roughness.log_power_spectrum(road.power_law(), np.array([1e5, 1e6]))
    >>> round(float((log_C[1] - log_C[0]) / np.log(10.0)), 6)  # the slope continues beyond q1
    -3.6
    """
    return jnp.log(law.height2) + log_shape(law, q)


def log_shape(law: BrokenPowerLaw, q: jax.Array | np.ndarray) -> jax.Array:
    """Return ln(C / height2) at q."""
    piece = jnp.clip(jnp.searchsorted(law.q, q, side="right") - 1, 0, law.exponent.shape[0] - 1)
    return law.log_value[piece] + law.exponent[piece] * log_ratio(q, law.q[piece]) - 2 * jnp.log(q)


def log_plateau(spectrum: SelfAffine) -> jax.Array:
    r"""Return ln(q_r^2 C_0 / h_rms^2), from h_rms^2 = 2 pi int q C dq.

    .. math:: \frac{h^2}{\pi C_0 q_r^2} = 1 - (q_0/q_r)^2 + \frac{1 - (q_1/q_r)^{-2H}}{H}
    """
    plateau = log_ratio(spectrum.qr, spectrum.q0)
    tail = log_ratio(spectrum.q1, spectrum.qr)
    area = -jnp.expm1(-2 * plateau) + 2 * tail * mean_growth(-2 * spectrum.hurst * tail)
    return -jnp.log(jnp.pi * area)


def mean_growth(y: jax.Array) -> jax.Array:
    """Return (e^y - 1) / y, which is the mean of e^(x y) over x = 0 ... 1. The value at y = 0 is 1."""
    near = jnp.abs(y) < 1e-2
    safe = jnp.where(near, 1.0, y)
    series = 1 + y / 2 * (1 + y / 3 * (1 + y / 4 * (1 + y / 5 * (1 + y / 6))))
    return jnp.where(near, series, jnp.expm1(safe) / safe)


def doubts_of_roughness(log_q: np.ndarray, log_C: np.ndarray, h_rms: float | None = None) -> list[str]:
    r"""Return warnings if the rms height exceeds 1/q_0 or the rms slope exceeds 30.

    .. math:: h_\mathrm{rms} q_0 \le 1, \qquad \Big(2\pi\int q^3 C\,dq\Big)^{1/2} \le 30

    Parameters
    ----------
    log_q, log_C : ln of wavevectors [1/m], increasing, and ln of C [m^4], shape (n,)
        ln C is linear in ln q between the entries.
    h_rms : rms height to which C is scaled [m], or None
    """
    x = np.linspace(log_q[0], log_q[-1], 513)
    log_height, log_slope = (_log_root(n * x + np.interp(x, log_q, log_C), x) for n in (2, 4))
    if h_rms is not None:
        if h_rms == 0:
            return []
        log_height, log_slope = np.log(h_rms), log_slope + np.log(h_rms) - log_height
    doubts = []
    if log_height + x[0] > 0:
        doubts.append(
            f"rms height {_shown(log_height)} m: must be below 1/q0 = {_shown(-x[0])} m;"
            " is it in mm or um, or is C in another normalisation?"
        )
    if log_slope > np.log(30):
        doubts.append(f"rms slope {_shown(log_slope)}: must be at most 30; are heights, q and C in SI?")
    return doubts


def _log_root(log_integrand, x):
    """Return ln sqrt(2 pi int exp(log_integrand) dx) without overflow."""
    peak = log_integrand.max()
    return 0.5 * (np.log(2 * np.pi * np.trapezoid(np.exp(log_integrand - peak), x)) + peak)


def _shown(logarithm):
    return f"{np.exp(min(logarithm, 700.0)):.3g}"
