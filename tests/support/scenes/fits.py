"""Scenes for tests of fits: rubbers on a road, and a sufficient quadrature."""

import numpy as np

import fitting
import rubberfric as rf

FAST = rf.Quadrature(order=10, panels=6, graded=3, ratio=6.0)
AFFINE = rf.SelfAffine(1e2, 1e3, 3e4, 0.8, 5e-4)
ROAD = rf.Body(rf.Rigid(), AFFINE)
PLAIN = rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3])
SHIFTED = rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3], shift=rf.WLF(12.0, 150.0, 293.15))
E = "upper.material.E"
E_INF = "upper.material.E_inf"

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

JOB_FILES = ["friction.csv", "friction.h5", "job.toml", "modulus.csv", "scene.toml"]


def write_job(folder):
    """Write the job and all that it names; its path."""
    (folder / "scene.toml").write_text(JOB_SCENE)
    (folder / "job.toml").write_text(JOB)
    omega = np.logspace(0, 7, 10)
    E = np.asarray(rf.complex_modulus(rf.Prony(1e6, [1e8, 1e7], [1e-6, 1e-4]), omega))
    noise = np.exp(0.03 * np.random.default_rng(0).standard_normal((2, 10)))
    data = fitting.ModulusData(omega, E.real * noise[0], E.imag * noise[1])
    fitting.write(folder / "modulus.csv", data)
    v = np.logspace(-3, 1, 5)
    data = fitting.FrictionData(v, 0.1 + 0.01 * v, pressure=1e5, name="own")
    fitting.write(folder / "friction.h5", data)
    (folder / "friction.csv").write_text("v,mu\nm/s,-\n1e-2,0.1\n1e-1,0.2\n")
    return folder / "job.toml"
