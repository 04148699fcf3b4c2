"""Columns of the tables: what their names and units mean, and how they become SI."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from rubberfric.base.units import ZERO_CELSIUS, hertz

Units = Mapping[str, float]


class Column(NamedTuple):
    """What a column of that name is."""

    name: str  # of the quantity it gives in SI
    units: Units  # unit: factor, value in SI = factor * value + offset
    positive: bool = True
    log10: bool = False  # the file holds the logarithm of the value in the unit
    offered: bool = True  # named in messages; the others are read where another program wrote the table

    def value(self, number: float, unit: str) -> float:
        """A number of a file in SI."""
        offset = ZERO_CELSIUS if unit in ("C", "°C") else 0.0
        return self.units[unit] * (10.0**number if self.log10 else number) + offset

    def read(self, where: str, text: str, unit: str) -> float:
        """A field of a file in SI; ValueError, which begins with `where`, if the column cannot hold it."""
        try:
            if "_" in text:  # Python's digit grouping is no CSV number
                raise ValueError
            value = float(text)
        except ValueError:
            raise ValueError(f"{where}: must be a number") from None
        if not math.isfinite(value):
            raise ValueError(f"{where}: must be finite")
        try:
            value = self.value(value, unit)
        except OverflowError:
            value = math.inf
        self.check(where, value)
        return value

    def check(self, where: str, value: float) -> None:
        """ValueError, which begins with `where`, unless the column may hold a value in SI."""
        if not math.isfinite(value):
            raise ValueError(f"{where}: must be finite in SI units")
        if self.positive and not value > 0:
            raise ValueError(f"{where}: must be > 0{' K' if self.name == 'T' else ''}")


def _logarithms(units: Units) -> Units:
    return {f"log10({unit})": factor for unit, factor in units.items()}


_ONE = {"-": 1.0}
_RATIO = {"-": 1.0, "%": 1e-2}
_FREQUENCY = {"Hz": hertz(1.0), "kHz": hertz(1e3), "MHz": hertz(1e6)}
_ANGULAR = {"rad/s": 1.0}
_PRESSURE = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5}
_SPEED = {"m/s": 1.0, "mm/s": 1e-3, "um/s": 1e-6}
_WAVEVECTOR = {"1/m": 1.0, "1/mm": 1e3, "1/um": 1e6, "1/nm": 1e9}
_SPECTRUM = {"m^4": 1.0, "mm^4": 1e-12, "um^4": 1e-24, "nm^4": 1e-36}
_LINE = {"m^3": 1.0, "mm^3": 1e-9, "um^3": 1e-18, "nm^3": 1e-27}


# Names a file may use. The first unit of each is SI, in which tables are written.
COLUMNS = {
    "omega": Column("omega", _ANGULAR),
    "f": Column("omega", _FREQUENCY),
    "E_stor": Column("E_stor", _PRESSURE),
    "E_loss": Column("E_loss", _PRESSURE),
    "q": Column("q", _WAVEVECTOR),
    "log10_q": Column("q", _logarithms(_WAVEVECTOR), log10=True),
    "C": Column("C", _SPECTRUM),
    "log10_C": Column("C", _logarithms(_SPECTRUM), log10=True),
    "C_1D": Column("C_1D", _LINE),
    "log10_C_1D": Column("C_1D", _logarithms(_LINE), log10=True),
    "phi": Column("phi", {"rad": 1.0}, positive=False),
    "phi_deg": Column("phi", {"deg": math.pi / 180}, positive=False),
    "T": Column("T", {"K": 1.0, "C": 1.0, "°C": 1.0}),
    "aT": Column("aT", _ONE),
    "bT": Column("bT", _ONE),
    "strain": Column("strain", _RATIO),
    "storage_factor": Column("storage_factor", _ONE),
    "loss_factor": Column("loss_factor", _ONE),
    "v": Column("v", _SPEED, positive=False),
    "log10_v": Column("v", _logarithms(_SPEED), log10=True),
    "p": Column("p", _PRESSURE),
    "mu": Column("mu", _ONE, positive=False),
    "A_over_A0": Column("A_over_A0", _ONE),
    "sigma": Column("sigma", _ONE),
    "sigma_stor": Column("sigma_stor", _PRESSURE),
    "sigma_loss": Column("sigma_loss", _PRESSURE),
    "sigma_C": Column("sigma_C", _SPECTRUM),
    "relative_sigma": Column("relative_sigma", _RATIO),
    "log10_omega": Column("omega", _logarithms(_ANGULAR), log10=True, offered=False),
    "log10_f": Column("omega", _logarithms(_FREQUENCY), log10=True, offered=False),
    "log10_E_stor": Column("E_stor", _logarithms(_PRESSURE), log10=True, offered=False),
    "log10_E_loss": Column("E_loss", _logarithms(_PRESSURE), log10=True, offered=False),
    "log10_aT": Column("aT", {"-": 1.0, "log10(-)": 1.0}, log10=True, offered=False),
    "log10_bT": Column("bT", {"-": 1.0, "log10(-)": 1.0}, log10=True, offered=False),
    "log10_p": Column("p", _logarithms(_PRESSURE), log10=True, offered=False),
    "E_comp": Column("E_comp", _PRESSURE, offered=False),
    "G_stor": Column("G_stor", _PRESSURE, offered=False),
    "G_loss": Column("G_loss", _PRESSURE, offered=False),
    "G_comp": Column("G_comp", _PRESSURE, offered=False),
    "log10_G_stor": Column("G_stor", _logarithms(_PRESSURE), log10=True, offered=False),
    "log10_G_loss": Column("G_loss", _logarithms(_PRESSURE), log10=True, offered=False),
    "tan_del": Column("tan_del", _RATIO, offered=False),
}

# Quantities that E' and E'' follow from.
MODULI = ("E_comp", "G_stor", "G_loss", "G_comp", "tan_del")
