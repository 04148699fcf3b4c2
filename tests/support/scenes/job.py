"""A small job of rubberfric-fit, and its scene file."""

SCENE = """
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
