"""Factors of units against their definitions, in exact fractions."""

import math
import re
from fractions import Fraction

import numpy as np
import pytest

import rubberfric as rf
from rubberfric.io.text_tables import units

PREFIXES = {"": 0, "n": -9, "u": -6, "m": -3, "c": -2, "h": 2, "k": 3, "M": 6, "G": 9}
UNITS = {
    f"{prefix}{unit}": Fraction(10) ** power
    for prefix, power in PREFIXES.items()
    for unit in ("m", "s", "N", "Pa", "Hz", "rad")
}
# The international inch and pound, standard gravity, and the standard atmosphere.
INCH, POUND, GRAVITY = Fraction(254, 10000), Fraction(45359237, 10**8), Fraction(980665, 10**5)
UNITS |= {f"{prefix}bar": 10**5 * Fraction(10) ** power for prefix, power in PREFIXES.items()}
UNITS |= {"in": INCH, "ft": 12 * INCH, "lbf": POUND * GRAVITY, "kgf": GRAVITY, "dyn": Fraction(1, 10**5)}
UNITS |= {"psi": POUND * GRAVITY / INCH**2, "ksi": 1000 * POUND * GRAVITY / INCH**2, "atm": Fraction(101325)}
UNITS |= {"min": Fraction(60), "h": Fraction(3600), "mph": 5280 * 12 * INCH / 3600}
UNITS |= {"rpm": Fraction(1, 60), "cpm": Fraction(1, 60), "cycles": Fraction(1), "1": Fraction(1)}
# Tables of units, and the factor from revolutions to radians where they count revolutions.
TABLES = {name: 1.0 for name in ("PRESSURE", "COMPLIANCE", "TIME", "FORCE", "PATH", "AREA", "MOMENT")}
TABLES |= {name: 1.0 for name in ("SPEED", "ANGULAR", "WAVEVECTOR", "SPECTRUM", "LINE")}
TABLES |= {"FREQUENCY": 2 * math.pi, "CYCLES": 2 * math.pi}


def factor(unit):
    """Return the product of the powers in a unit such as "kgf/cm2"."""
    result = Fraction(1)
    for sign, name, power in re.findall(r"([/ ]?)([A-Za-z]+|^1)\^?(\d?)", unit):
        result *= UNITS[name] ** (int(power or 1) * (-1 if sign == "/" else 1))
    return float(result)


@pytest.mark.parametrize("name", TABLES)
def test_factors_are_those_of_the_definitions(name):
    table = getattr(units, name)
    expected = [TABLES[name] * factor(unit) for unit in table]
    np.testing.assert_allclose(list(table.values()), expected, rtol=1e-15)


def test_degrees():
    """273.15 K are 0 degrees Celsius and 32 degrees Fahrenheit; 373.15 K are 100 and 212."""
    scale, zero = units.TEMPERATURE, units.OFFSETS
    for unit, freezing, boiling in (("°C", 0, 100), ("C", 0, 100), ("°F", 32, 212)):
        assert zero[unit] + scale[unit] * freezing == pytest.approx(273.15, rel=1e-15)
        assert zero[unit] + scale[unit] * boiling == pytest.approx(373.15, rel=1e-15)
    assert units.ANGLE["deg"] * 180 == pytest.approx(math.pi, rel=1e-15) and units.ANGLE["mrad"] == 1e-3


def test_unit_helpers():
    assert rf.units.celsius(25.0) == 298.15 and rf.units.to_celsius(298.15) == 25.0
    assert rf.units.hertz(1.0) == 2 * math.pi and rf.units.to_hertz(2 * math.pi) == 1.0
    np.testing.assert_allclose(rf.units.young_from_shear(np.array([1e6, 2e6]), 0.5), [3e6, 6e6])
    np.testing.assert_allclose(rf.units.shear_from_young(3e6, 0.5), 1e6)
    # Lame: B = lambda + 2 G / 3, lambda = 2 G nu / (1 - 2 nu)
    G, nu = 2.0, 0.3
    E = rf.units.young_from_shear(G, nu)
    np.testing.assert_allclose(rf.units.bulk_from_young(E, nu), 2 * G * nu / (1 - 2 * nu) + 2 * G / 3)
