"""Scenes for tests of fits: rubbers on a road, and a sufficient quadrature."""

import numpy as np

import fitting
import rubberfric as rf

FAST = rf.Quadrature(order=10, panels=6, graded=3, ratio=6.0)
AFFINE = rf.SelfAffine(1e2, 1e3, 3e4, 0.8, 5e-4)
ROAD = rf.Body(rf.Rigid(), AFFINE)
PLAIN = rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3])
SHIFTED = rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3], shift=rf.WLF(12.0, 150.0, 293.15))
THREE_TERMS = rf.Prony(3e6, [5e7, 8e6, 2e6], [1e-5, 1e-3, 1e-1])
FOUR_TERMS = rf.Prony(3e6, [5e8, 5e7, 8e6, 2e6], [1e-7, 1e-5, 1e-3, 1e-1])
SCENE = rf.Scene(ROAD, rf.Body(PLAIN))
WARM = rf.Scene(ROAD, rf.Body(SHIFTED))
THREE = rf.Scene(ROAD, rf.Body(THREE_TERMS))
FOUR = rf.Scene(ROAD, rf.Body(FOUR_TERMS))
FOUR_WARM = FOUR.replace({"upper.material.shift": SHIFTED.shift})
SHEAR = rf.ContactShear(6.5e6, 0.1, 6e-3)
E = "upper.material.E"
E_INF = "upper.material.E_inf"
H_RMS = "lower.spectrum.h_rms"
HURST = "lower.spectrum.hurst"
Q1 = "lower.spectrum.q1"


def noise(size, error, seed=0):
    """Factors of a relative error."""
    return np.exp(error * np.random.default_rng(seed).standard_normal(size))


def modulus_data(material, omega, error=0.02, seed=0, **options):
    """E' and E'' of a material with noise; the data state its size unless `relative` is given."""
    exact = np.asarray(rf.complex_modulus(material, omega, options.get("temperature")))
    values = np.stack([exact.real, exact.imag]) * noise((2, omega.size), error, seed)
    return fitting.ModulusData(omega, *values, **{"relative": error} | options)


def linear_data(material, omega, size=0.1, seed=0):
    """E' and E'' of a Prony series with absolute errors: the model is linear in E and E_inf."""
    exact = maxwell_columns(omega, material.tau) @ [*material.E, material.E_inf]
    sigma = size * exact
    measured = exact + sigma * np.random.default_rng(seed).standard_normal(exact.size)
    return fitting.ModulusData(omega, *np.split(measured, 2), *np.split(sigma, 2), check_units=False)


def friction_data(scene, v, p=1e5, error=0.02, seed=0, quadrature=FAST, **options):
    """Friction of a scene with noise; the data state its size unless `relative` is given."""
    mu = np.asarray(rf.friction(scene, v, p, options.get("temperature"), quadrature=quadrature))
    return fitting.FrictionData(
        v, mu * noise(v.size, error, seed), pressure=p, **{"relative": error} | options
    )


def area_data(scene, v, p=5e5, error=0.03, seed=0, quadrature=FAST):
    """Relative contact area of a scene with noise."""
    area = np.asarray(rf.contact_area(scene, v, p, quadrature=quadrature))
    values = area * noise(v.size, error, seed)
    return fitting.AreaData(v, values, pressure=p, relative=error, check_units=False)


def maxwell_columns(omega, tau):
    """E' and then E'' of terms of 1 Pa and of E_inf = 1 Pa: one column each, by the formula."""
    a = omega[:, None] * np.asarray(tau)
    terms = np.concatenate([a**2 / (1 + a**2), a / (1 + a**2)])
    return np.column_stack([terms, np.repeat([1.0, 0.0], omega.size)])


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
