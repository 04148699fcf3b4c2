"""A measured tyre compound and road: conditions and tables, which lie outside the project."""

import numpy as np
from support.published import outside

import rubberfric as rf

# Nominal pressure of the program's run [Pa], inferred.
PRESSURE = 0.3e6
# gamma of the program's run, inferred.
GAMMA = 0.578
# Cutoff of the program's run [1/m], inferred.
Q1 = 1.017e6


def read(name):
    return np.loadtxt(outside("tyre") / name, delimiter=",", skiprows=2).T


def rubber(compound, shifted=False):
    """Return the measured modulus of a compound, with its table of shift factors if wanted."""
    f, storage, loss = read(f"master_curve_{compound}.csv")
    celsius, factor = read(f"shift_factor_{compound}.csv")
    shift = rf.TabulatedShift(celsius + 273.15, factor, T_ref=293.15) if shifted else None
    return rf.TabulatedModulus(2 * np.pi * f, storage, loss, poisson=0.5, shift=shift)


def road(q1=Q1):
    q, C = read("psd_asphalt.csv")
    kept = q < q1
    end = np.exp(np.interp(np.log(q1), np.log(q), np.log(C)))
    return rf.TabulatedSpectrum(np.append(q[kept], q1), np.append(C[kept], end))
