r"""Roughness power spectra C(q), isotropic.

Normalisation: C(q) = (2 pi)^-2 int d^2x <h(x) h(0)> e^{-i q x}, so that
h_rms^2 = 2 pi int q C dq and slope^2 = 2 pi int q^3 C dq. (contact.engineering's C_iso
is 4 pi^2 times this.)

Inside, a spectrum is a broken power law: wavevectors of its kinks, from its first to
its last wavevector, ln(q^2 C) there [m^2], and the exponent of every piece. The forward
model needs no other knowledge of it, and C itself, which underflows float32 in SI units
(1e-39 m^4 at q = 1e9 1/m), is never formed.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.checks import (
    NONNEGATIVE,
    POSITIVE,
    between,
    check_increasing,
    check_lengths,
    is_concrete,
)
from rubberfric.base.objects import leaf, physical


@physical
class SelfAffine:
    r"""Self-affine fractal with a plateau, given by its rms height.

    .. math:: C = C_0 \; (q_0 < q < q_r), \qquad C = C_0 (q/q_r)^{-2(1+H)} \; (q_r < q < q_1)

    Parameters
    ----------
    q0 : smallest wavevector [1/m], > 0
    qr : roll-off wavevector [1/m], q0 <= qr <= q1
    q1 : cut-off wavevector [1/m], > q0
    hurst : H [-], 0 ... 1
    h_rms : root-mean-square height of all q0 < q < q1 [m], >= 0
    """

    q0: float = leaf(POSITIVE)
    qr: float = leaf(POSITIVE)
    q1: float = leaf(POSITIVE)
    hurst: float = leaf(between(0.0, 1.0))
    h_rms: float = leaf(NONNEGATIVE)

    def _check(self):
        if all(is_concrete(x) for x in (self.q0, self.qr, self.q1)):
            _check_order(float(self.q0), float(self.qr), float(self.q1))

    @classmethod
    def from_C0(cls, q0, qr, q1, hurst, C0):
        """The same spectrum given by its plateau C0 [m^4] instead of h_rms [m]."""
        unit = cls(q0, qr, q1, hurst, 1.0)
        if is_concrete(C0) and not C0 >= 0:
            raise ValueError(f"SelfAffine.C0 = {C0!r}: must be >= 0")
        scale = qr * jnp.exp(-0.5 * log_plateau(unit))
        return cls(q0, qr, q1, hurst, scale * jnp.sqrt(C0))


def _check_order(q0, qr, q1):
    if not q0 <= qr:
        raise ValueError(f"SelfAffine.qr = {qr!r}: must be >= q0 = {q0!r}")
    if not qr <= q1:
        raise ValueError(f"SelfAffine.q1 = {q1!r}: must be >= qr = {qr!r}")
    if not q0 < q1:
        raise ValueError(f"SelfAffine.q1 = {q1!r}: must be > q0 = {q0!r}")


@physical
class TabulatedSpectrum:
    """Power spectrum from a table: ln C linear in ln q between the entries, zero outside.

    A power law is reproduced exactly. Values and gradients are exact integrals of this
    broken power law: every entry is a border of the radial quadrature.

    Parameters
    ----------
    q : wavevectors, strictly increasing [1/m], shape (n,), n >= 2
    C : power spectrum [m^4], > 0, shape (n,)
    """

    q: object = leaf(POSITIVE, ndim=1)
    C: object = leaf(POSITIVE, ndim=1)

    def _check(self):
        check_lengths("TabulatedSpectrum", q=self.q, C=self.C)
        if self.q.shape[0] < 2:
            raise ValueError(f"TabulatedSpectrum.q has {self.q.shape[0]} entries: must have at least 2")
        check_increasing("TabulatedSpectrum.q", self.q)


class BrokenPowerLaw(NamedTuple):
    """q^2 C(q) = height2 * exp(log_value) at the kinks, a power of q between them."""

    q: jax.Array  # wavevectors of the kinks [1/m], ascending, shape (n,)
    log_value: jax.Array  # ln(q^2 C / height2) at the kinks, shape (n,)
    exponent: jax.Array  # d ln(q^2 C) / d ln q of the pieces, shape (n - 1,)
    height2: jax.Array  # scale [m^2]; may be 0, so it stays out of the logarithm


def broken_power_law(spectrum):
    """The spectrum, averaged over all directions, as kinks and exponents (see the module's docstring)."""
    if isinstance(spectrum, SelfAffine):
        q = jnp.stack([jnp.asarray(x) for x in (spectrum.q0, spectrum.qr, spectrum.q1)])
        to_rolloff, beyond = log_ratio(q[1], q[0]), log_ratio(q[2], q[1])
        top = log_plateau(spectrum)
        exponent = jnp.stack([jnp.full_like(top, 2.0), -2.0 * spectrum.hurst + 0 * top])
        log_value = jnp.stack([top - 2 * to_rolloff, top, top + exponent[1] * beyond])
        return BrokenPowerLaw(q, log_value, exponent, spectrum.h_rms**2)
    if isinstance(spectrum, TabulatedSpectrum):
        return tabulated_law(spectrum.q, spectrum.C)
    if not hasattr(spectrum, "mean_law"):  # of anisotropic roughness
        kinds = "SelfAffine, TabulatedSpectrum, Anisotropic or TabulatedAnisotropic"
        raise ValueError(f"spectrum is a {type(spectrum).__name__}: must be {kinds}")
    return spectrum.mean_law()


def tabulated_law(q, C):
    """The broken power law through the entries of a table."""
    log_C = jnp.log(C)
    exponent = jnp.diff(log_C) / log_ratio(q[1:], q[:-1]) + 2
    return BrokenPowerLaw(q, log_C + 2 * jnp.log(q), exponent, jnp.ones_like(q[0]))


def log_ratio(q, start):
    """ln(q / start), with all digits when q is close to start."""
    return jnp.log1p((q - start) / start)


def power_spectrum(spectrum, q):
    """C(q) [m^4] at q [1/m], zero outside the spectrum's range; for plots and moments."""
    law = broken_power_law(spectrum)
    q = jnp.asarray(q)
    inside = (q >= law.q[0]) & (q <= law.q[-1])
    return jnp.where(inside, law.height2 * jnp.exp(log_shape(law, q)), 0.0)


def log_power_spectrum(law, q):
    """ln C at q, its first and last piece continued beyond the ends; for fits of C."""
    return jnp.log(law.height2) + log_shape(law, q)


def log_shape(law, q):
    """ln(C / height2) at q."""
    piece = jnp.clip(jnp.searchsorted(law.q, q, side="right") - 1, 0, law.exponent.shape[0] - 1)
    return law.log_value[piece] + law.exponent[piece] * log_ratio(q, law.q[piece]) - 2 * jnp.log(q)


def log_plateau(spectrum):
    r"""ln(q_r^2 C_0 / h_rms^2), from h_rms^2 = 2 pi int q C dq.

    .. math:: \frac{h^2}{\pi C_0 q_r^2} = 1 - (q_0/q_r)^2 + \frac{1 - (q_1/q_r)^{-2H}}{H}
    """
    plateau = log_ratio(spectrum.qr, spectrum.q0)
    tail = log_ratio(spectrum.q1, spectrum.qr)
    area = -jnp.expm1(-2 * plateau) + 2 * tail * mean_growth(-2 * spectrum.hurst * tail)
    return -jnp.log(jnp.pi * area)


def mean_growth(y):
    """(e^y - 1) / y, the mean of a power law over a piece; 1 at y = 0, where the quotient is 0/0."""
    near = jnp.abs(y) < 1e-2
    safe = jnp.where(near, 1.0, y)
    series = 1 + y / 2 * (1 + y / 3 * (1 + y / 4 * (1 + y / 5 * (1 + y / 6))))
    return jnp.where(near, series, jnp.expm1(safe) / safe)
