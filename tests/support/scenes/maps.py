"""A small friction map: its scene, conditions, quadrature and scene file."""

import numpy as np

import rubberfric as rf

WLF = rf.WLF(8.0, 100.0, 293.15)
TREAD = rf.Prony(1e6, [1e8, 1e7], [1e-5, 1e-2], shift=WLF)
ROAD = rf.SelfAffine(100.0, 1000.0, 1e4, 0.8, 1e-4)
SCENE = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(TREAD), shear=rf.ContactShear(6.5e6, 0.1, 6e-3))
QUICK = rf.Quadrature(order=6, panels=4, graded=2)
VELOCITY = np.logspace(-6, 1, 9)  # [m/s]
# In falling order, which a map allows.
PRESSURE = np.array([3e5, 1e5])
TEMPERATURE = np.linspace(263.15, 333.15, 5)  # [K]
POINTS = (VELOCITY, PRESSURE, TEMPERATURE)
# Few sizes of batches and sets of quantities in all, for each is compiled.
BLOCK = 7
MATERIAL = (
    'material = { kind = "prony", E_inf = 1e6, E = [1e8], tau = [1e-5],'
    ' shift = { kind = "wlf", C1 = 8.0, C2 = 100.0, T_ref = 293.15 } }'
)
SMALL = f"""
title = "Small scene"
[lower]
material = {{ kind = "rigid" }}
spectrum = {{ kind = "self_affine", q0 = 100, qr = 1000, q1 = 1e4, hurst = 0.8, h_rms = 1e-4 }}
[upper]
{MATERIAL}
"""
# A scene file for all commands.
FILE = f"""{SMALL}
[run]
velocity = {{ from = 1e-3, to = 1e1, points = 5 }}
pressure = [1e5, 3e5]
temperature = [283.15, 293.15, 303.15]
[map]
velocity = {{ from = 1e-3, to = 1e1, points = 5 }}
pressure = {{ from = 1e5, to = 4e5, points = 3 }}
temperature = {{ from = 273.15, to = 293.15, points = 3 }}
"""
