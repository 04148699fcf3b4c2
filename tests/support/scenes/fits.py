"""What most tests of fits are about: rubbers on a road, and a quadrature that is enough for them."""

import rubberfric as rf

FAST = rf.Quadrature(order=10, panels=6, graded=3, ratio=6.0)
AFFINE = rf.SelfAffine(1e2, 1e3, 3e4, 0.8, 5e-4)
ROAD = rf.Body(rf.Rigid(), AFFINE)
PLAIN = rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3])
SHIFTED = rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3], shift=rf.WLF(12.0, 150.0, 293.15))
E, E_INF = "upper.material.E", "upper.material.E_inf"
