"""Units of columns of tables, with their factors to SI, and their spellings."""

import math

from rubberfric.base.units import ZERO_CELSIUS, hertz

ONE = {"-": 1.0}  # factors, which are never in percent
RATIO = {"-": 1.0, "%": 1e-2}  # friction, area, strain, relative errors
FREQUENCY = {"Hz": hertz(1.0), "kHz": hertz(1e3), "MHz": hertz(1e6), "mHz": hertz(1e-3)}  # [rad/s]
FREQUENCY |= {"rpm": hertz(1 / 60), "cpm": hertz(1 / 60)}
ANGULAR = {"rad/s": 1.0}  # angular frequencies
PSI = 6894.757293168361  # lbf/in^2 [Pa]
PRESSURE = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5}  # pressures and moduli [Pa]
PRESSURE |= {"psi": PSI, "ksi": 1e3 * PSI, "dyn/cm2": 0.1, "mbar": 100.0, "N/cm2": 1e4}
PRESSURE |= {"hPa": 100.0, "atm": 101325.0, "kgf/cm2": 98066.5}
COMPLIANCE = {f"1/{unit}": 1 / PRESSURE[unit] for unit in ("Pa", "kPa", "MPa", "GPa", "bar", "psi")}  # [1/Pa]
COMPLIANCE |= {"cm2/dyn": 10.0}
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0}  # [s]
FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": 9.80665, "lbf": 4.4482216152605}  # [N]
PATH = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "cm": 1e-2, "in": 0.0254}  # lengths of a sliding path [m]
AREA = {"m^2": 1.0, "mm^2": 1e-6, "cm^2": 1e-4, "in^2": 0.0254**2}  # nominal contact areas [m^2]
MOMENT = {"N m": 1.0, "N mm": 1e-3, "kN m": 1e3, "lbf ft": 4.4482216152605 * 0.3048}  # [N m]
ANGLE = {"rad": 1.0, "deg": math.pi / 180, "mrad": 1e-3}  # [rad]
SPEED = {"m/s": 1.0, "mm/s": 1e-3, "um/s": 1e-6, "nm/s": 1e-9}  # [m/s]
SPEED |= {"cm/s": 1e-2, "mm/min": 1e-3 / 60, "m/min": 1.0 / 60, "km/h": 1 / 3.6}
SPEED |= {"mph": 0.44704, "in/s": 0.0254, "ft/s": 0.3048, "in/min": 0.0254 / 60, "ft/min": 0.3048 / 60}
TEMPERATURE = {"K": 1.0, "C": 1.0, "°C": 1.0, "°F": 5 / 9}  # kelvins per degree
OFFSETS = {"C": ZERO_CELSIUS, "°C": ZERO_CELSIUS, "°F": 459.67 * 5 / 9}  # zeros of the scales [K]
LENGTHS = {"m": 1.0, "cm": 1e2, "mm": 1e3, "um": 1e6, "nm": 1e9}  # number of each length in a metre
WAVEVECTOR = {f"1/{length}": per for length, per in LENGTHS.items()}  # angular wavevectors [1/m]
# Spatial frequencies. 1/m of a column n or "spatial frequency" is cycles/m.
CYCLES = {f"{of}/{length}": 2 * math.pi * per for of in ("cycles", "1") for length, per in LENGTHS.items()}
# 1/m is no unit of a wavenumber, which may be 2 pi over the wavelength or one over it.
NUMBER = {f"rad/{length}": per for length, per in LENGTHS.items()}
NUMBER |= {unit: factor for unit, factor in CYCLES.items() if unit.startswith("cycles")}
SPECTRUM = {"m^4": 1.0, "cm^4": 1e-8, "mm^4": 1e-12, "um^4": 1e-24, "nm^4": 1e-36}  # C of a surface [m^4]
LINE = {"m^3": 1.0, "cm^3": 1e-6, "mm^3": 1e-9, "um^3": 1e-18, "nm^3": 1e-27}  # C_1D of a profile [m^3]

# Other spellings of units. Signs such as µ, ², ⁻¹ and · are recognised in all of them.
UNIT_SPELLINGS = {
    "C": ("°C", "\u00baC", "℃", "degC", "deg C", "° C", "Grad C", "Cel"),
    "K": ("Kelvin",),
    "°F": ("degF", "deg F", "° F", "F"),
    "rad/s": ("rad/sec", "rad s-1", "s-1", "1/s"),
    "deg": ("°", "degree", "degrees", "Grad"),
    "MPa": ("N/mm2", "N mm-2", "MN/m2"),
    "kPa": ("kN/m2",),
    "kgf/cm2": ("kp/cm2", "kg/cm2"),
    "cpm": ("CPM", "cycles/min", "1/min"),
    "rpm": ("rev/min", "r/min", "U/min", "tr/min"),
    "Pa": ("N/m2", "N m-2"),
    **{f"{of}N m": (f"{of}Nm", f"{of}N*m") for of in ("", "k")},
    **{"N mm": ("Nmm", "N*mm"), "lbf ft": ("lbf*ft", "ft lbf", "ft*lbf", "lb ft", "lb-ft", "ft-lb")},
    **{f"1/{of}Pa": (f"{of}Pa-1",) for of in ("k", "G")},
    "1/Pa": ("Pa-1", "m2/N", "m2 N-1"),
    "1/MPa": ("MPa-1", "mm2/N", "mm2 N-1", "m2/MN"),
    "s": ("sec", "seconds", "Sek", "Sekunden", "secondes"),
    "min": ("minutes", "Minuten"),
    "h": ("hr", "hours", "Std", "Stunden", "heures"),
    "-": ("", "1"),
    **{f"{of}m/s": (f"{of}m s-1", f"{of}m/sec") for of in ("", "m", "u", "n")},
    **{f"{of}m^4": (f"{of}m4",) for of in ("", "c", "m", "u", "n")},
    **{f"{of}m^3": (f"{of}m3",) for of in ("", "c", "m", "u", "n")},
    **{f"{of}m^2": (f"{of}m2",) for of in ("", "c", "m")},
    "in^2": ("in2", "sq in"),
    **{f"1/{of}m": (f"{of}m-1", f"rad/{of}m") for of in ("", "c", "m", "u", "n")},
    **{f"cycles/{of}m": (f"cycle/{of}m", f"cyc/{of}m", f"c/{of}m") for of in ("", "c", "m", "u", "n")},
}
# Plain spelling of units: u for micro, digits for exponents.
_PLAIN = str.maketrans("\u00b5\u03bc⁻¹²³⁴·\u22c5", "uu-1234  ", "^")


def plain_unit(unit: str) -> str:
    """Return a unit in plain spelling, with u for micro, digits for exponents and single blanks."""
    return " ".join(unit.translate(_PLAIN).split())
