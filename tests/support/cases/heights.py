"""Heights of five surfaces with a fixed seed, also for a script without JAX.

Each is (heights [m], spacings [m]): a self-affine surface with a roll-off, the same with steps and with white
noise, the image of a rougher one by a round tip, and a line across a larger self-affine surface.
"""

import numpy as np
import scipy.ndimage

Surface = tuple[np.ndarray, tuple[float, ...]]
SPACING = 1e-5  # between points [m]
ROLLOFF = 2e4  # wavevector [1/m]
TIP_RADIUS = 4e-4  # so blunt that it removes short waves [m]
NOISE = 6e-7  # rms height of the noise, a third of the surface [m]


def self_affine(shape: tuple[int, ...], hurst: float, h_rms: float, seed: int) -> np.ndarray:
    """Return a periodic Gaussian surface, or a line across one."""
    k = np.meshgrid(*(2 * np.pi * np.fft.fftfreq(n, SPACING) for n in shape), indexing="ij")
    q = np.sqrt(sum(component**2 for component in k))
    amplitude = np.maximum(q, ROLLOFF) ** -(hurst + len(shape) / 2)
    amplitude.flat[0] = 0
    noise = np.random.default_rng(seed).standard_normal(shape)
    heights = np.fft.ifftn(np.fft.fftn(noise) * amplitude).real
    return heights * h_rms / heights.std()


def surfaces() -> dict[str, Surface]:
    """Return the five surfaces by name."""
    smooth = self_affine((192, 160), 0.8, 2e-6, 1)
    rough = self_affine((192, 160), 0.5, 2e-6, 2)
    noise = np.random.default_rng(3).standard_normal(smooth.shape)
    reach = SPACING * np.arange(-8, 9)
    tip = -(reach[:, None] ** 2 + reach**2) / (2 * TIP_RADIUS)
    area = (SPACING, SPACING)
    return {
        "self-affine": (smooth, area),
        "stepped": (np.round(smooth / 1e-6) * 1e-6, area),
        "noisy": (smooth + NOISE * noise, area),
        "tip": (scipy.ndimage.grey_dilation(rough, structure=tip, mode="wrap"), area),
        # Cut out of a longer line, so that it is not periodic.
        "line": (self_affine((6000,), 0.8, 2e-6, 4)[:4096], (SPACING,)),
    }
