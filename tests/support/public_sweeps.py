"""Sweeps of E' and E'' that other groups published, as plain numbers."""

import csv

import numpy as np
from support.published import PUBLISHED, outside

POLYISOPRENES = (2.4, 5.1, 23.4, 33.6, 94.9, 634.5, 1131.0)  # kg/mol
NAMES = (*(f"polyisoprene {mass:g}" for mass in POLYISOPRENES), "Eplexor", "EPDM", "foam", "TRIOS")
KELVIN = 273.15
OUTSIDE = {
    name: name.split()[0].lower() for name in NAMES if name.startswith(("poly", "EPDM"))
}  # their folders
PASCAL = {"Eplexor": 1e6, "foam": 1e3}  # of the units of the files


def numbers(path, first, columns=slice(None)):
    """Return the numbers of a CSV file from a line on."""
    with open(path, encoding="utf-8-sig") as file:
        return np.array([[float(x) for x in row[columns]] for row in list(csv.reader(file))[first:]])


def columns_of(name):
    """Return omega, E', E'' and T in degrees Celsius, and published (T, log10 a_T) or None."""
    if name.startswith("polyisoprene"):
        mass = float(name.split()[1])
        raw = numbers(outside("polyisoprene") / "PI_raw_isotherms.csv", 1)
        shifts = numbers(outside("polyisoprene") / "PI_published_shifts.csv", 1)
        _, T, omega, storage, loss = raw[raw[:, 0] == mass].T
        return omega, storage, loss, T, shifts[shifts[:, 0] == mass][:, [1, 4]]
    if name == "Eplexor":
        folder = PUBLISHED / "pyvisco"
        f, storage, loss, T, _ = numbers(folder / "examples" / "freq_user_raw.csv", 2).T
        shifts = numbers(folder / "verification" / "freq_raw" / "freq_Eplexor_raw__shift_factors.csv", 2)
        return 2 * np.pi * f, storage, loss, T, shifts
    if name == "EPDM":
        f, T, storage, loss = numbers(outside("epdm") / "tf_015p.csv", 1, slice(1, 5)).T
        return 2 * np.pi * f, storage, loss, T, None
    file = {"foam": "foam_isotherms.csv", "TRIOS": "trios_isotherms.csv"}[name]
    T, omega, storage, loss = numbers(PUBLISHED / "rheojax" / file, 1, slice(4)).T
    return omega, storage, loss, T, None
