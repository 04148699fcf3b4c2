"""Friction of random scenes from boundary elements, for fits.

Forty rubbers with one relaxation time per decade on self-affine surfaces, q1/qr = 8 ... 64, H = 0.6 ... 1, at
twelve velocities over five decades and two pressures. At the middle velocity and the lower pressure A/A0 is
0.8 ... 8 %. None of them is in notebooks/boundary_elements.csv or was used to fit the law of
`contact_model="boundary_elements"`, and the defaults of `fitting.Discrepancy` were chosen before. Curves are
kept in a folder. The first `COUNT` scenes have short periods; they take five minutes on one core. The others
have periods of two or four longest wavelengths; they take a quarter of an hour.
"""

import json
import math
from pathlib import Path

import jax
import numpy as np

import rubberfric as rf
from rubberfric.analysis import boundary_element

# Number of scenes with short periods.
COUNT = 20
# Terms of a rubber, one for each decade, more than the five decades of velocity.
TERMS = 8
# q1/q0, qr/q0, longest wavelengths a side, points a side, surfaces.
GEOMETRIES = (
    (8, 1, 4, 256, 1),
    (16, 1, 2, 256, 1),
    (32, 1, 1, 256, 2),
    (16, 2, 2, 256, 1),
    (64, 1, 1, 512, 1),
)
LONG_PERIODS = (
    (8, 1, 4, 256, 1),
    (16, 1, 4, 512, 1),
    (32, 1, 2, 512, 1),
    (16, 2, 4, 512, 1),
    (64, 1, 2, 1024, 1),
)


def geometry(number):
    """Return the geometry of a scene."""
    return (GEOMETRIES if number < COUNT else LONG_PERIODS)[number % len(GEOMETRIES)]


def drawn_scene(number):
    """Return a random scene, its velocities (12,) and pressures (2,)."""
    random = np.random.default_rng([2027, number])
    ratio, rolloff, *_ = geometry(number)
    hurst, slope, q1 = random.uniform(0.6, 1.0), random.uniform(0.4, 1.3), 10 ** random.uniform(5, 6.5)
    spectrum = rf.SelfAffine(q1 / ratio, rolloff * q1 / ratio, q1, hurst, 1.0)
    spectrum = spectrum.replace(h_rms=slope / float(rf.rms_slope(spectrum)))
    E_inf = 1e6 * np.exp(0.4 * random.standard_normal())
    E = E_inf * random.uniform(0.5, 1.5) * random.uniform(1.6, 2.5) ** np.arange(TERMS)
    E *= np.exp(0.25 * random.standard_normal(TERMS))
    tau = 10.0 ** (-np.arange(TERMS) - random.uniform(0, 2))
    scene = rf.Scene(
        rf.Body(rf.Rigid(), spectrum), rf.Body(rf.Prony(E_inf, E, tau, 0.49)), area_correction=True
    )
    v = 10 ** np.linspace(random.uniform(-1, 0), random.uniform(4.5, 5.5), 12) / (q1 * tau[0])
    area = np.exp(random.uniform(np.log(0.008), np.log(0.08)))
    # The pressure at which the theory has this area at the middle velocity.
    low, high = 1e1, 1e9
    for _ in range(40):
        p = np.sqrt(low * high)
        low, high = (p, high) if float(np.asarray(rf.solve(scene, v[6], p).area)) < area else (low, p)
    return scene, v, np.array([p, 5 * p])


def waves(random, x, shortest, longest):
    """Return a smooth error of amplitude 1 over x = ln v: three waves with lengths in decades."""
    lengths = math.log(10) * np.exp(random.uniform(np.log(shortest), np.log(longest), 3))
    phases = random.uniform(0, 2 * np.pi, 3)
    return math.sqrt(2 / 3) * np.sum(np.cos(2 * np.pi * x[:, None] / lengths + phases), 1)


def is_resolved(number):
    """Return True for the velocities at which the period hardly matters, shape (12,).

    With a short period, slow modes are missing and friction is too small. The modulus at the frequency of the
    longest mode of the grid is then far above the relaxed one.
    """
    scene, v, _ = drawn_scene(number)
    ratio, _, periods, *_ = geometry(number)
    omega = v * float(scene.lower.spectrum.q1) / (ratio * periods)
    modulus = np.abs(np.asarray(rf.complex_modulus(scene.upper.material, omega)))
    return modulus < 2.5 * float(scene.upper.material.E_inf)


def curve(number, folder):
    """Return the friction of a scene by boundary elements, shape (pressures, velocities)."""
    path = Path(folder) / f"sliding_{number}.json"
    if not path.exists():
        scene, velocities, pressures = drawn_scene(number)
        *_, periods, grid, surfaces = geometry(number)

        def mean(p, v):
            keys = (jax.random.key(10_000 + 100 * number + k) for k in range(surfaces))
            found = [
                boundary_element(scene, v, p, key, grid=grid, periods=periods, tolerance=1e-4) for key in keys
            ]
            assert all(one.converged for one in found)
            return float(np.mean([one.friction for one in found]))

        values = [[mean(float(p), float(v)) for v in velocities] for p in pressures]
        path.write_text(json.dumps(values))
    return np.array(json.loads(path.read_text()))
