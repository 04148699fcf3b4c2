r"""Random surfaces that have a given power spectrum, periodic and on a grid.

.. math:: h(\mathbf x) = \sum_{\mathbf q} \frac{2\pi}{L}\sqrt{C(q)}\,
          e^{i(\mathbf q\mathbf x + \phi_{\mathbf q})},\qquad \phi_{-\mathbf q} = -\phi_{\mathbf q}

with random phases: of many modes the heights are Gaussian, and the mean squares of heights and slopes are
those of the spectrum but for the sum over modes in place of an integral
[Jacobs, Junge & Pastewka, Surf. Topogr. 5 (2017) 013001, arXiv:1607.03040].
"""

import math
from typing import NamedTuple

import jax
import numpy as np

from rubberfric.base.checks import shown
from rubberfric.base.objects.physical import check_kind
from rubberfric.roughness.spectra import Spectrum, power_spectrum

# Points a shortest wavelength, at the least: friction is 5 % off there, and 1 % at eight.
COARSEST = 4


class Surface(NamedTuple):
    """One period of a rough surface."""

    heights: np.ndarray  # [m], (grid, grid); sliding is along the first axis
    length: float  # of the period along either axis [m]


def random_surface(spectrum: Spectrum, key: jax.Array, grid: int = 512, periods: float = 4.0) -> Surface:
    """A periodic surface of a spectrum, its modes of random phase; host-side, double precision.

    Parameters
    ----------
    spectrum : Spectrum, isotropic
    key : of jax.random; the same key is the same surface on every grid
    grid : points along each side, even; at least 4 a shortest wavelength
    periods : longest wavelengths of the spectrum along each side, >= 1; fewer leave fewer modes at long
        wavelengths, and so more scatter from surface to surface

    Returns
    -------
    Surface

    Raises
    ------
    ValueError : an anisotropic spectrum, or a grid that does not resolve it, with one that does.
    """
    check_kind("spectrum", spectrum, Spectrum)
    if spectrum.harmonic_count():
        raise ValueError(f"spectrum is a {type(spectrum).__name__}: must be isotropic")
    if not periods >= 1:
        raise ValueError(f"periods = {shown(periods)}: must be >= 1")
    q0, q1 = (float(spectrum.power_law().q[i]) for i in (0, -1))
    length, most = 2 * math.pi * periods / q0, periods * q1 / q0
    needed = 2 * math.ceil(COARSEST / 2 * most * (1 - 1e-9))
    if not isinstance(grid, int) or grid % 2 or grid < needed:
        raise ValueError(
            f"grid = {shown(grid)}: must be even and >= {needed}, {COARSEST} points a shortest wavelength"
            f" with {periods:g} longest ones (q1 / q0 = {q1 / q0:g}); {2 * needed} leaves friction 1 % off"
        )
    # Kept apart from the grid, so that the phases do not depend on it.
    reach = math.floor(most * (1 + 1e-9))
    kx, ky = np.arange(-reach, reach + 1)[:, None], np.arange(reach + 1)
    # The first and the last wavevector belong to the spectrum, whatever they round to.
    q = np.clip(np.hypot(kx, ky) / periods, 1 - 1e-9, q1 / q0 * (1 + 1e-9))
    inside = np.abs(q * periods - np.hypot(kx, ky)) < 1e-6
    C = np.asarray(power_spectrum(spectrum, np.clip(q * q0, q0, q1)), float)
    phase = 2 * np.pi * np.asarray(jax.random.uniform(key, (2 * reach + 1, reach + 1)), float)
    mode = np.where(inside, 2 * np.pi / length * np.sqrt(C), 0.0) * np.exp(1j * phase)
    mode[:reach, 0] = np.conj(mode[:reach:-1, 0])  # heights are real
    modes = np.zeros((grid, grid // 2 + 1), complex)
    modes[kx[:, 0] % grid, : reach + 1] = mode
    return Surface(np.fft.irfft2(modes, (grid, grid), norm="forward"), length)
