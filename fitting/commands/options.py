"""Options of commands for reading data and heights, which are keyword arguments of functions."""

import argparse
from typing import Any

from rubberfric.commands import Parser

BODIES = ("lower", "upper")
_SWITCH: dict[str, Any] = {"action": "store_const", "const": True}
# Options for reading data: keyword arguments of `fitting.read`, and keys of [[data]] in a job.
READING: dict[str, dict[str, Any]] = {
    "pressure": {"type": float, "metavar": "Pa", "help": "used if the data lack it [Pa]"},
    "temperature": {"type": float, "metavar": "K", "help": "used if the data lack it [K]"},
    "relative": {"type": float, "metavar": "R", "help": "error of the data, 0.05 for 5 %%"},
    "body": {"choices": BODIES, "help": "body of moduli or spectra"},
    "normalisation": {"metavar": "NAME", "help": "normalisation of spectra, see `rubberfric.roughness`"},
    "hurst": {"type": float, "metavar": "H", "help": "Hurst exponent, for a line without a roll-off"},
    "poisson": {"type": float, "metavar": "NU", "help": "Poisson's ratio, needed for shear moduli"},
    "columns": {
        "nargs": "+",
        "metavar": "NAME",
        "help": '"name [unit]" of each column, "-": skip',
    },
    "kind": {
        "nargs": "+",
        "choices": ("friction", "area", "modulus", "relaxation", "creep", "spectrum", "force", "moment"),
        "help": "kind of data in tables that hold several, or kinds to read all of them",
    },
    "check_units": {
        "flag": "--no-check-units",
        "action": "store_const",
        "const": False,
        "help": "accept values that look like values in another unit",
    },
    "bad_rows": {
        "choices": ("error", "drop"),
        "help": "rows with empty or invalid values: an error (default), or left out",
    },
    "area": {"type": float, "metavar": "m2", "help": "contact area, for loads instead of pressures [m^2]"},
    "frequency": {
        "type": float,
        "metavar": "Hz",
        "help": "of moduli or strokes, used if the data lack it [Hz]",
    },
    "block": {"type": int, "metavar": "N", "help": "block of columns to read, from 1, if titles are equal"},
    "zero": _SWITCH | {"help": "subtract the readings without load before and after a run from the forces"},
    "discard": {"metavar": "START", "help": 'start of each section to leave out: "10 mm", "2 s" or settling'},
    "fold": {
        "nargs": "?",
        "const": True,
        "choices": (True, "middle", "speeds"),
        "metavar": "middle|speeds",
        "help": "combine both directions of reciprocating runs; if sinusoidal, in the middle of strokes or"
        " in bins of the speed",
    },
    "stroke": {"type": float, "metavar": "M", "help": "length of sinusoidal strokes [m]"},
    "average": _SWITCH | {"help": "average runs at equal conditions, also of several files, with error"},
}


# Options for measured heights: keyword arguments of `rubberfric.io.read_heights` and
# `rubberfric.roughness.spectrum_of_topography`.
HEIGHTS: dict[str, dict[str, Any]] = {
    "outliers": {
        "type": float,
        "metavar": "S",
        "help": "heights this many standard deviations from their neighbours are holes, often 10",
    },
    "detrend": {"type": int, "choices": (0, 1, 2), "help": "degree of the subtracted surface (default: 1)"},
    "fill_volume": {
        "type": float,
        "metavar": "M",
        "help": "fill cavities by this volume per area [m], as water does",
    },
    "fill_level": {
        "type": float,
        "metavar": "M",
        "help": "fill cavities up to this level above the mean plane [m]",
    },
    "tops": {
        "action": "store_const",
        "const": True,
        "help": "take the top spectrum, of the heights above the mean",
    },
    "tip_radius": {"type": float, "metavar": "M", "help": "radius of the tip of the instrument [m]"},
    "noise": {"type": float, "metavar": "M", "help": "rms noise of the instrument [m]"},
}


def add_reading(parser: Parser, name: str) -> None:
    """Add an option for reading data to a parser."""
    options = dict(READING[name])
    flag = options.pop("flag", f"--{name.replace('_', '-')}")
    parser.add_argument(flag, dest=name, default=None, **options)


def reading_options(arguments: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Return the options for reading data that were given, of all names or of `names`."""
    values = {name: getattr(arguments, name) for name in names or READING}
    return {name: value for name, value in values.items() if value is not None}
