r"""Conversions to and from the SI units that everything here is in: pure functions of numbers or arrays.

.. math:: T/\mathrm{K} = \vartheta/{}^\circ\mathrm{C} + 273.15,\qquad \omega = 2\pi f,\qquad
          E = 2(1 + \nu)\, G,\qquad B = \frac{E}{3(1 - 2\nu)}

They hold for complex moduli too where Poisson's ratio is a constant.
"""

import math
from typing import TypeVar

import jax
import numpy as np

_T = TypeVar("_T", float, complex, np.ndarray, jax.Array)

ZERO_CELSIUS = 273.15  # [K]


def celsius(temperature: _T) -> _T:
    """T [K] of a temperature [°C]: `celsius(25.0)` is 298.15."""
    return temperature + ZERO_CELSIUS


def to_celsius(temperature: _T) -> _T:
    """Temperature [°C] of T [K]."""
    return temperature - ZERO_CELSIUS


def hertz(frequency: _T) -> _T:
    """Angular frequency omega [rad/s] of a frequency f [Hz]."""
    return 2 * math.pi * frequency


def to_hertz(omega: _T) -> _T:
    """Frequency f [Hz] of an angular frequency omega [rad/s]."""
    return omega / (2 * math.pi)


def young_from_shear(shear: _T, poisson: _T | float) -> _T:
    """Young's modulus E [Pa] of a shear modulus G [Pa] at Poisson's ratio `poisson` [-]."""
    return 2 * (1 + poisson) * shear


def shear_from_young(young: _T, poisson: _T | float) -> _T:
    """Shear modulus G [Pa] of Young's modulus E [Pa] at Poisson's ratio `poisson` [-]."""
    return young / (2 * (1 + poisson))


def bulk_from_young(young: _T, poisson: _T | float) -> _T:
    """Bulk modulus B [Pa] of Young's modulus E [Pa]; Poisson's ratio < 0.5, where B has no end."""
    return young / (3 * (1 - 2 * poisson))


__all__ = [
    "ZERO_CELSIUS",
    "bulk_from_young",
    "celsius",
    "hertz",
    "shear_from_young",
    "to_celsius",
    "to_hertz",
    "young_from_shear",
]
