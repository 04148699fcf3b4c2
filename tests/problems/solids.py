"""Solids, roughness and optional parts that many tests use: their numbers stand here once."""

import math

import numpy as np

import rubberfric as rf

RIGID = rf.Rigid()
ROAD = rf.SelfAffine(100.0, 1000.0, 3.1e4, 0.8, 5e-4)
WORN = rf.SelfAffine(200.0, 2000.0, 1e5, 0.8, 5e-5)
TREAD = rf.Prony(3.6e6, [1e9, 1e8, 1e7], [1e-9, 1e-6, 1e-3])
SOFT = rf.Prony(8.0e5, np.array([2.5e7, 4.0e6, 3.0e5]), np.array([3e-7, 2e-4, 0.7]), 0.48)
WLF = rf.WLF(12.0, 150.0, 293.15)
SHIFTED_TREAD = rf.Prony(3e6, [4e8, 5e7, 8e6], [1e-7, 1e-5, 1e-3], 0.5, WLF)
SHEAR = rf.ContactShear(6.5e6, 0.1, 6e-3, rf.Arrhenius(0.97, 293.15))
ELASTIC = rf.Elastic(1e7, 0.4)
STEEL = rf.Elastic(1e8, 0.3)
HEATING = rf.Heating(1.2e3, 1.6e3, 0.23, 1e-3, 0.05, 0.4)
SOFTENING = rf.Softening([0.01, 0.1, 1.0], [1.0, 0.7, 0.4], [1.0, 1.2, 0.6])
GROOVES = rf.Anisotropic(ROAD, 2.0, 0.4, 4)
# Roughness so fine that adhesion matters.
FINE = rf.SelfAffine(5e4, 1e5, 3e6, 0.7, 1e-6)
# Options of a scene for each contact model of half-spaces without further parts.
CONTACT_MODELS = {
    "paper": {"area_correction": False},
    "paper, `area_correction`": {"area_correction": True},
    "law": {"area_correction": False, "contact_model": "boundary_elements"},
}

# Boundary elements compute without units, with one relaxation time and this first wavevector.
MAXWELL = rf.Prony(1.0, [9.0], [1.0], 0.0)
Q0 = 8 * math.pi


def slope_one(ratio=8.0):
    """A spectrum of rms slope 1 from Q0 to `ratio` times it, without roll-off."""
    road = rf.SelfAffine(Q0, Q0, ratio * Q0, 0.8, 1.0)
    return road.replace(h_rms=1 / float(rf.rms_slope(road)))


def scene(lower, upper, **options):
    """Two bodies, each as (material, spectrum, layer) or the first of them."""
    return rf.Scene(rf.Body(*lower), rf.Body(*upper), **options)
