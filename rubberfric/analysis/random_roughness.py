"""Random periodic surfaces with a given spectrum.

Their modes are 2 pi / L sqrt(C(q)) with random phases [Jacobs, Junge & Pastewka, Surf. Topogr. 5 (2017)
013001, arXiv:1607.03040].
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import shown
from rubberfric.base.objects.physical import check_kind
from rubberfric.roughness.spectra import Spectrum, power_spectrum

_COARSEST = 4  # least points per shortest wavelength. The error of friction is 5 %, with eight points 1 %


class Surface(NamedTuple):
    """One period of a rough surface."""

    heights: np.ndarray  # [m], (grid, grid); sliding is along the first axis
    length: float  # of the period along either axis [m]


def random_surface(spectrum: Spectrum, key: jax.Array, grid: int = 512, periods: float = 4.0) -> Surface:
    """Generate a periodic surface with a given spectrum and random phases, in double precision.

    Parameters
    ----------
    spectrum : Spectrum
    key : jax.random key; a key gives the same surface on every grid
    grid : points along each side, even; at least 4 per shortest wavelength
    periods : number of longest wavelengths along each side, >= 1; with few periods there are few
        long-wavelength modes and more scatter between surfaces

    Returns
    -------
    Surface

    Raises
    ------
    ValueError : a grid that does not resolve the spectrum.

    Examples
    --------
    >>> import jax
    >>> spectrum = rf.SelfAffine(q0=1e3, qr=3e3, q1=3e4, hurst=0.8, h_rms=20e-6)
    >>> surface = rf.analysis.random_surface(spectrum, jax.random.key(0), grid=256, periods=2.0)
    >>> round(1e3 * surface.length, 2), round(1e6 * float(surface.heights.std()))  # in mm and µm
    (12.57, 20)
    """
    check_kind("spectrum", spectrum, Spectrum)
    if not periods >= 1:
        raise ValueError(f"periods = {shown(periods)}: must be >= 1")
    q0, q1 = (float(spectrum.power_law().q[i]) for i in (0, -1))
    length, most = 2 * math.pi * periods / q0, periods * q1 / q0
    needed = 2 * math.ceil(_COARSEST / 2 * most * (1 - 1e-9))
    if not isinstance(grid, int) or grid % 2 or grid < needed:
        raise ValueError(
            f"grid = {shown(grid)}: must be even and >= {needed}, so that the shortest wavelength has"
            f" {_COARSEST} points in a period of {periods:g} times the longest wavelength (q1 / q0 ="
            f" {q1 / q0:g}); {2 * needed} reduces the error of friction to 1 %"
        )
    # Modes are drawn independently of the grid.
    reach = math.floor(most * (1 + 1e-9))
    kx, ky = np.arange(-reach, reach + 1)[:, None], np.arange(reach + 1)
    # Include the first and the last wavevector despite rounding.
    q = np.clip(np.hypot(kx, ky) / periods, 1 - 1e-9, q1 / q0 * (1 + 1e-9))
    inside = np.abs(q * periods - np.hypot(kx, ky)) < 1e-6
    q = np.clip(q * q0, q0, q1)
    C = np.asarray(power_spectrum(spectrum, q), float)
    if spectrum.harmonic_count():
        both = spectrum.harmonics_at(jnp.asarray(q))
        cosine, sine = (np.reshape(x, x.shape if x.ndim == 3 else (-1, 1, 1)) for x in both)
        angle = 2 * np.arange(1, len(sine) + 1)[:, None, None] * np.arctan2(ky, kx)
        C = C * np.maximum(1 + np.sum(cosine * np.cos(angle) + sine * np.sin(angle), 0), 0)
    phase = 2 * np.pi * np.asarray(jax.random.uniform(key, (2 * reach + 1, reach + 1)), float)
    mode = np.where(inside, 2 * np.pi / length * np.sqrt(C), 0.0) * np.exp(1j * phase)
    mode[:reach, 0] = np.conj(mode[:reach:-1, 0])  # heights are real
    modes = np.zeros((grid, grid // 2 + 1), complex)
    modes[kx[:, 0] % grid, : reach + 1] = mode
    return Surface(np.fft.irfft2(modes, (grid, grid), norm="forward"), length)
