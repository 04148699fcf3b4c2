r"""Conversions to and from SI units: pure functions of numbers or arrays.

.. math:: T/\mathrm{K} = \vartheta/{}^\circ\mathrm{C} + 273.15,\qquad \omega = 2\pi f,\qquad
          E = 2(1 + \nu)\, G,\qquad B = \frac{E}{3(1 - 2\nu)}

The relations also hold for complex moduli if Poisson's ratio is a constant.
"""

import math
from typing import TypeVar

import jax
import numpy as np

_T = TypeVar("_T", float, complex, np.ndarray, jax.Array)

ZERO_CELSIUS = 273.15  # [K]


def celsius(temperature: _T) -> _T:
    """Convert a temperature from °C to K: `celsius(25.0)` is 298.15.

    Examples
    --------
    >>> rf.units.celsius(20.0)
    293.15
    """
    return temperature + ZERO_CELSIUS


def to_celsius(temperature: _T) -> _T:
    """Convert a temperature from K to °C.

    Examples
    --------
    >>> rf.units.to_celsius(293.15)
    20.0
    """
    return temperature - ZERO_CELSIUS


def hertz(frequency: _T) -> _T:
    """Convert a frequency f [Hz] to the angular frequency omega [rad/s].

    Examples
    --------
    >>> round(rf.units.hertz(10.0), 3)
    62.832
    """
    return 2 * math.pi * frequency


def to_hertz(omega: _T) -> _T:
    """Convert an angular frequency omega [rad/s] to the frequency f [Hz].

    Examples
    --------
    >>> round(rf.units.to_hertz(62.832), 3)
    10.0
    """
    return omega / (2 * math.pi)


def young_from_shear(shear: _T, poisson: _T | float) -> _T:
    """Return Young's modulus E [Pa] for a shear modulus G [Pa] and Poisson's ratio [-].

    Examples
    --------
    >>> rf.units.young_from_shear(1e6, 0.5)
    3000000.0
    """
    return 2 * (1 + poisson) * shear


def shear_from_young(young: _T, poisson: _T | float) -> _T:
    """Return the shear modulus G [Pa] for Young's modulus E [Pa] and Poisson's ratio [-].

    Examples
    --------
    >>> rf.units.shear_from_young(3e6, 0.5)
    1000000.0
    """
    return young / (2 * (1 + poisson))


def bulk_from_young(young: _T, poisson: _T | float) -> _T:
    """Return the bulk modulus B [Pa] for Young's modulus E [Pa] and Poisson's ratio < 0.5.

    Examples
    --------
    >>> f"{rf.units.bulk_from_young(3e6, 0.4995):.3g}"  # a rubber that is almost incompressible
    '1e+09'
    """
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
