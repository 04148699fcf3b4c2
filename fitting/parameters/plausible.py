"""Ranges of plausible values of fitted parameters.

A value outside its range satisfies the equations, but hardly describes a rubber or a road. The ranges are
wide. They contain gels and glasses, polished steel and gravel. `rubberfric` has wider ranges, which detect
wrong units.
"""

from collections.abc import Iterable

import numpy as np

# Moduli [Pa], from a gel to a glass.
_MODULUS = 1e3, 1e11

# Wavevectors [1/m], from metres to atoms.
_WAVEVECTOR = 1.0, 1e11

# By the last step of a key path: lowest and highest plausible value.
_RANGES = {
    **dict.fromkeys(("E_inf", "young", "G_inf"), _MODULUS),
    **dict.fromkeys(("q0", "qr", "q1"), _WAVEVECTOR),
    "h_rms": (1e-10, 0.05),
    "tau_f0": (1e2, 1e9),
    "v0": (1e-10, 1e4),
    "c": (1e-3, 10.0),
    "C1": (0.1, 200.0),
    "C2": (1.0, 2000.0),
    "energy": (0.01, 20.0),
    "work": (1e-6, 100.0),
    "thickness": (1e-9, 1.0),
    "conductivity": (0.01, 1e3),
    "radius": (1e-7, 1.0),
}


def implausible(names: Iterable[str], values: np.ndarray) -> dict[str, tuple[float, float]]:
    """Return the plausible range of every parameter whose value is outside it, by name.

    Parameters
    ----------
    names : key paths, such as "shear.tau_f0"
    values : values of the parameters, shape (size,)
    """
    ranges = {}
    for name, value in zip(names, values, strict=True):
        low, high = _RANGES.get(name.rsplit(".", 1)[-1], (-np.inf, np.inf))
        if not low <= value <= high:
            ranges[name] = (low, high)
    return ranges
