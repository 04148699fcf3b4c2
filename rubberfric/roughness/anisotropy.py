r"""Anisotropic roughness: C(q, phi) as harmonics of the angle to the direction of sliding.

.. math:: C(q, \varphi) = C(q)\Big[1 + \sum_{m\ge1} c_m \cos 2m\varphi + s_m \sin 2m\varphi\Big]

C(q) is the mean over all directions, which determines heights and slopes. A real surface has
C(q, phi + pi) = C(q, phi), so only even multiples occur.
"""

import dataclasses
from typing import ClassVar, Literal

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import FINITE, PLAUSIBLE_WAVEVECTOR, POSITIVE, ArrayLike, check_increasing
from rubberfric.base.objects.fields import Matrix, Number, OptionalNumber, Vector, child, leaf, static
from rubberfric.base.objects.physical import check_kind, physical
from rubberfric.roughness.spectra import BrokenPowerLaw, SelfAffine, Spectrum, log_ratio
from rubberfric.roughness.tabulated import Table, check_ends

# Number of directions for the harmonics of a stretched surface. They are exact to rounding up to ratios of
# 30.
_DIRECTIONS = 1024


@physical
class Anisotropic(Spectrum):
    r"""Self-affine roughness stretched in one direction.

    .. math:: C(q, \varphi) = C(q)\,\frac{D(\varphi - \alpha)}{\langle D\rangle},\qquad
              D = \left(r\cos^2\varphi + \tfrac1r \sin^2\varphi\right)^{-(1+H)}

    For q > q_r this is the spectrum of a surface stretched by sqrt(r) along alpha and by 1/sqrt(r) across.
    Below q_r and at the ends the same shape is used, so that the mean over all directions is C(q) of `base`.

    Parameters
    ----------
    base : SelfAffine
        the mean over all directions.
    ratio : r, correlation length along alpha divided by the transverse correlation length [-], > 0
        If r > 1, grooves run along alpha.
    angle : alpha, from the direction of sliding [rad]
    harmonics : 4, 8, 16, 32 or 64 (static)
        number of harmonics. `harmonics_left_out` returns the share of the higher harmonics: 2e-7 for 16 at a
        ratio of 2, 3e-6 for 32 at a ratio of 4.

    Examples
    --------
    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> grooved = rf.Anisotropic(road, ratio=2.0, angle=np.radians(30.0))
    >>> c, s = grooved.replace(angle=0.0).harmonics_at(2e3)
    >>> signs = (-1.0) ** np.arange(1, grooved.harmonic_count() + 1)
    >>> round(float((1 + np.sum(c)) / (1 + np.sum(signs * c))), 4)
    0.0825
    """

    endless: ClassVar[bool] = True

    base: SelfAffine = child()
    ratio: Number = leaf(POSITIVE, unit="-")
    angle: Number = leaf(FINITE, unit="rad", default=0.0)
    harmonics: Literal[4, 8, 16, 32, 64] = static(default=16)

    def power_law(self) -> BrokenPowerLaw:
        """Return the power law of `base`."""
        return self.base.power_law()

    def height_scale(self) -> jax.Array:
        """Return the height scale of `base` [m]."""
        return self.base.height_scale()

    def cut(self, q1: jax.Array) -> "Anisotropic":
        """Return the spectrum with `base` cut at q1 [1/m]."""
        return dataclasses.replace(self, base=self.base.cut(q1))

    def harmonic_count(self) -> int:
        """Return the number of harmonics."""
        return self.harmonics

    def harmonics_at(self, q: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Return c_m and s_m for m = 1 ... harmonics, which do not depend on q.

        The two arrays have the shape (harmonics,).
        """
        del q
        return _turned(self._all_harmonics()[: self.harmonics], self.angle)

    def harmonics_left_out(self) -> jax.Array:
        """Return the sum of the absolute values of all harmonics d_m with m > `harmonics` [-]."""
        return jnp.sum(jnp.abs(self._all_harmonics()[self.harmonics :]))

    def _all_harmonics(self):
        """Return d_m in D / <D> = 1 + sum_m d_m cos 2m phi for 1 <= m < `_DIRECTIONS` / 2."""
        phi = np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
        ratio = jnp.asarray(self.ratio)
        square = ratio * np.cos(phi).astype(ratio.dtype) ** 2 + np.sin(phi).astype(ratio.dtype) ** 2 / ratio
        log_D = -(1 + self.base.hurst) * jnp.log(square)
        D = jnp.exp(log_D - jax.lax.stop_gradient(jnp.max(log_D)))
        return (jnp.fft.rfft(D).real * 2 / jnp.sum(D))[1:-1]


@physical
class TabulatedAnisotropic(Table):
    r"""Anisotropic spectrum from a table over wavevector and direction.

    Between the entries, two quantities are linear in ln q: the logarithm of the mean over the directions, and
    every harmonic divided by this mean.

    Parameters
    ----------
    q : wavevectors, strictly increasing [1/m], shape (n,), n >= 2
    C : power spectrum [m^4], > 0, shape (n, directions), directions >= 4
        the directions are k pi / directions, k = 0, 1, ..., from the x-axis of the surface.
    angle : angle of the x-axis from the direction of sliding [rad]
    q0, q1 : first and last wavevector of the roughness [1/m], as in `TabulatedSpectrum`

    Limits: there are (directions - 1) // 2 harmonics, which are all that the table determines.

    Examples
    --------
    >>> phi = np.pi * np.arange(16) / 16
    >>> q = np.array([1e3, 1e4])
    >>> C = 1e-14 * (q[:, None] / 1e3) ** -3.6 * (1.5 + 0.5 * np.cos(2 * phi))
    >>> table = rf.TabulatedAnisotropic(q, C)
    >>> f"{float(rf.power_spectrum(table, 1e3)):.4g}"  # mean over the directions
    '1.5e-14'
    >>> c, s = table.harmonics_at(2e3)
    >>> round(float(c[0]), 6)
    0.333333
    """

    harmonics_vary: ClassVar[bool] = True
    rising: ClassVar = (("q",), ("q[0]", "q0", "q1", "q[-1]"))

    q: Vector = leaf(POSITIVE, unit="1/m", plausible=PLAUSIBLE_WAVEVECTOR, column="q")
    C: Matrix = leaf(POSITIVE, unit="m^4", column="C")
    angle: Number = leaf(FINITE, unit="rad", default=0.0)
    q0: OptionalNumber = leaf(POSITIVE, unit="1/m", plausible=PLAUSIBLE_WAVEVECTOR, default=None)
    q1: OptionalNumber = leaf(POSITIVE, unit="1/m", plausible=PLAUSIBLE_WAVEVECTOR, default=None)

    def _check(self):
        if self.C.shape[0] != self.q.shape[0] or self.q.shape[0] < 2 or self.C.shape[1] < 4:
            raise ValueError(
                f"TabulatedAnisotropic.C has shape {self.C.shape}, q {self.q.shape}: must be (n, directions) "
                "and (n,) with n >= 2 and directions >= 4"
            )
        check_increasing("TabulatedAnisotropic.q", self.q)
        check_ends("TabulatedAnisotropic", self.q, self.q0, self.q1)

    def harmonic_count(self) -> int:
        """Return the number of harmonics of the table."""
        return (self.C.shape[1] - 1) // 2

    def harmonic_knots(self) -> jax.Array:
        """Return the wavevectors of the table [1/m]."""
        return self.q

    def harmonics_at(self, q: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Return c_m and s_m at wavevectors q [1/m] of any shape.

        The two arrays have the shape (harmonics, ``*q.shape``).
        """
        count = self.harmonic_count()
        even = jnp.fft.rfft(self.C, axis=1)[:, 1 : count + 1] * (2 / self.C.shape[1])
        mean = jnp.mean(self.C, 1, keepdims=True)
        cosine, sine = even.real / mean, -even.imag / mean
        m = np.arange(1, count + 1, dtype=mean.dtype)
        turn_c, turn_s = jnp.cos(2 * m * self.angle), jnp.sin(2 * m * self.angle)
        cosine, sine = cosine * turn_c - sine * turn_s, cosine * turn_s + sine * turn_c
        position, knots = log_ratio(q, self.q[0]), log_ratio(self.q, self.q[0])
        at = jax.vmap(lambda values: jnp.interp(position, knots, values), 1)
        return at(cosine), at(sine)

    def harmonics_left_out(self) -> jax.Array:
        """Return the largest amplitude of the highest harmonic, relative to the mean, over all q [-]."""
        cosine, sine = self.harmonics_at(self.q)
        return jnp.max(jnp.hypot(cosine[-1], sine[-1]))


def harmonics_left_out(spectrum: Spectrum) -> jax.Array:
    r"""Return the sum of \|d_m\| over the harmonics d_m that are left out, a share of the roughness [-].

    This share bounds the relative errors of G, of the mean separation, and of friction in full contact. The
    true errors are smaller, because slow modes depend only on low harmonics.

    Parameters
    ----------
    spectrum : Anisotropic, SelfAffine, TabulatedSpectrum or TabulatedAnisotropic
        The share is 0 for SelfAffine and TabulatedSpectrum. For TabulatedAnisotropic, the result is the
        largest relative amplitude of the highest harmonic over all q, which shows if the table has enough
        directions.

    Examples
    --------
    >>> road = rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3)
    >>> for harmonics in (8, 16, 32):
    ...     grooved = rf.Anisotropic(road, ratio=3.0, harmonics=harmonics)
    ...     print(harmonics, f"{float(rf.roughness.harmonics_left_out(grooved)):.1g}")
    8 0.04
    16 0.0002
    32 6e-09
    """
    check_kind("spectrum", spectrum, Spectrum)
    return spectrum.harmonics_left_out()


def slope_anisotropy(spectrum: Spectrum) -> jax.Array:
    r"""Return e^2 at q1 [-], with :math:`e = |\langle C\,e^{2i\varphi}\rangle| / \langle C\rangle`.

    If the anisotropy does not depend on q, e is the difference of the mean square slopes along the two
    principal directions over their sum.
    """
    if not spectrum.harmonic_count():
        return jnp.zeros(())
    cosine, sine = spectrum.harmonics_at(spectrum.power_law().q[-1])
    return (cosine[0] ** 2 + sine[0] ** 2) / 4


def _turned(size, angle):
    """Return c_m and s_m of the function sum_m size_m cos(2 m (phi - angle))."""
    m = np.arange(1, size.shape[0] + 1, dtype=size.dtype)
    return size * jnp.cos(2 * m * angle), size * jnp.sin(2 * m * angle)


def from_grid(
    qx: ArrayLike, qy: ArrayLike, C: ArrayLike, q: ArrayLike, directions: int = 64
) -> TabulatedAnisotropic:
    """Convert a spectrum on a (q_x, q_y) grid to a table over (q, directions), on the host.

    The logarithm of C is bilinear between the entries of the grid.

    Parameters
    ----------
    qx, qy : increasing [1/m], shapes (n,) and (m,)
        qx and qy must cover -q ... q. Either qx or qy may begin at 0, because C(-q) = C(q).
    C : power spectrum [m^4], > 0, shape (n, m)
    q : wavevectors of the table [1/m]
    directions : number of directions of the table

    Returns
    -------
    TabulatedAnisotropic

    Raises
    ------
    ValueError : if the grid does not reach a q, if C <= 0, or if qx or qy does not increase.

    Examples
    --------
    >>> kx, ky = np.linspace(-2e4, 2e4, 161), np.linspace(0.0, 2e4, 81)
    >>> C = 1e-14 * np.maximum(np.hypot(kx[:, None], ky) / 1e3, 0.1) ** -3.6
    >>> table = rf.roughness.from_grid(kx, ky, C, q=np.geomspace(2e3, 1.6e4, 10), directions=16)
    >>> round(float(rf.power_spectrum(table, 4e3) / rf.power_spectrum(table, 8e3)), 1)  # 2^3.6
    12.1
    """
    qx, qy, C, q = (np.asarray(x, float) for x in (qx, qy, C, q))
    if C.shape != (qx.size, qy.size) or not (C > 0).all():
        raise ValueError(f"C has shape {C.shape}: must be {(qx.size, qy.size)}, all > 0")
    check_increasing("qx", qx)
    check_increasing("qy", qy)
    phi = np.pi * np.arange(directions) / directions
    x, y = q[:, None] * np.cos(phi), q[:, None] * np.sin(phi)
    # C(-q) = C(q), so use the point of each pair that the grid has.
    flip = np.where((x < qx[0]) | (y < qy[0]), -1.0, 1.0)
    x, y = flip * x, flip * y
    if (x < qx[0]).any() or (x > qx[-1]).any() or (y < qy[0]).any() or (y > qy[-1]).any():
        raise ValueError(f"q up to {q.max():g} 1/m: the grid must reach this wavevector in every direction")
    i = np.clip(np.searchsorted(qx, x) - 1, 0, qx.size - 2)
    j = np.clip(np.searchsorted(qy, y) - 1, 0, qy.size - 2)
    s, t = (x - qx[i]) / (qx[i + 1] - qx[i]), (y - qy[j]) / (qy[j + 1] - qy[j])
    L = np.log(C)
    mean = (1 - s) * ((1 - t) * L[i, j] + t * L[i, j + 1]) + s * ((1 - t) * L[i + 1, j] + t * L[i + 1, j + 1])
    return TabulatedAnisotropic(q, np.exp(mean))
