"""What most tests of fits are about: rubbers on a road, and a quadrature that is enough for them."""

import rubberfric as rf

FAST = rf.Quadrature(order=10, panels=6, graded=3, ratio=6.0)
AFFINE = rf.SelfAffine(1e2, 1e3, 3e4, 0.8, 5e-4)
ROAD = rf.Body(rf.Rigid(), AFFINE)
PLAIN = rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3])
SHIFTED = rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3], shift=rf.WLF(12.0, 150.0, 293.15))
E, E_INF = "upper.material.E", "upper.material.E_inf"

# A small job of rubberfric-fit, and its scene file.
JOB_SCENE = """
[lower]
material = { kind = "rigid" }
spectrum = { kind = "self_affine", q0 = 100, qr = 1000, q1 = 1e4, hurst = 0.8, h_rms = 1e-4 }
[upper]
material = { kind = "prony", E_inf = 1e6, E = [1e8, 1e7], tau = [1e-6, 1e-4] }
"""
JOB = """
title = "Small fit"
scene = "scene.toml"
[[data]]
file = "modulus.csv"
body = "upper"
relative = 0.03
[free]
"upper.material.E" = { rule = "positive", start = [5e7, 2e7] }
"upper.material.tau[1]" = "positive"
"upper.material.E_inf" = { rule = "bounded", low = 1e5, high = 1e7 }
[prior]
"upper.material.E_inf" = { mean = 1e6, sigma = 1e5 }
[fit]
method = "lm"
starts = 2
"""
