"""A measured tyre compound and road: conditions and tables, which lie outside the project."""

import numpy as np
from support.folders import TYRE

import rubberfric as rf

PRESSURE, GAMMA, Q1 = 0.3e6, 0.578, 1.017e6  # [Pa], [-], [1/m]: inferred conditions of the program's run


def read(name):
    return np.loadtxt(TYRE / name, delimiter=",", skiprows=2).T


def road(q1=Q1):
    q, C = read("psd_asphalt.csv")
    kept = q < q1
    end = np.exp(np.interp(np.log(q1), np.log(q), np.log(C)))
    return rf.TabulatedSpectrum(np.append(q[kept], q1), np.append(C[kept], end))
