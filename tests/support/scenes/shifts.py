"""One shift of every kind."""

import rubberfric as rf

WLF = rf.WLF(8.86, 101.6, 293.15)
ARRHENIUS = rf.Arrhenius(0.97, 293.15)
TABLE = rf.TabulatedShift([263.15, 283.15, 303.15, 333.15], [3e3, 20.0, 0.2, 4e-3], 293.15)
