"""Measure the cost of the optional parts of a scene.

    python notebooks/benchmarks/parts.py

A friction curve of 50 velocities and its gradient with respect to every number of the scene are timed in
turns with the same curve without the part. Errors are against a finer quadrature.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from scenes import PRESSURE, ROAD, TREAD, TWO, VELOCITY
from turns import in_turns, least

import rubberfric as rf

jax.config.update("jax_enable_x64", True)

T = 293.15  # [K]
FINE = rf.Quadrature(order=20, panels=24, graded=12, ratio=4.0, angular_order=24, heat=320)
STRAIN = np.array([1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0, 3.0])
SOFTENING = rf.Softening(STRAIN, 0.12 + 0.88 / (1 + STRAIN / 0.02), 0.15 + 0.85 / (1 + STRAIN / 0.08))
HEATING = rf.Heating(density=1200.0, heat_capacity=1600.0, conductivity=0.23, radius=2e-3)
SHEAR = rf.ContactShear(6.5e6, 0.1, 6e-3, rf.Arrhenius(0.97, T))
WARM = replace(TREAD, shift=rf.WLF(12.0, 150.0, T))
PHI = np.pi * np.arange(32) / 32


def stretched(ratio, harmonics):
    return rf.Anisotropic(ROAD, ratio, angle=0.5, harmonics=harmonics)


def table():
    """The stretched road as a table over 32 directions."""
    q = np.geomspace(100.0, 3.1e4, 24)
    shape = (2 * np.cos(PHI - 0.5) ** 2 + np.sin(PHI - 0.5) ** 2 / 2) ** -1.8
    return rf.TabulatedAnisotropic(q, np.asarray(rf.power_spectrum(ROAD, q))[:, None] * shape / shape.mean())


def on(spectrum, upper=TREAD, layer=None):
    return rf.Scene(rf.Body(rf.Rigid(), spectrum), rf.Body(upper, None, layer))


CLOSED = on(ROAD)
SHIFTED = on(ROAD, WARM)
BASE = rf.Prony(1e6, np.array([2e8, 8e6, 5e5]), np.array([1e-9, 1e-5, 1e-1]), 0.5)

# Name: (scene with the part, scene without, temperature).
PARTS = {
    "heating": (replace(SHIFTED, heating=HEATING), SHIFTED, T),
    "heating and contact shear": (
        replace(SHIFTED, heating=HEATING, shear=SHEAR),
        replace(SHIFTED, shear=SHEAR),
        T,
    ),
    "softening": (replace(CLOSED, softening=SOFTENING), CLOSED, None),
    "softening, two rubbers": (replace(TWO, softening=SOFTENING), TWO, None),
    "anisotropy, ratio 2, 16 harmonics": (on(stretched(2.0, 16)), CLOSED, None),
    "anisotropy, table of 32 directions": (on(table()), CLOSED, None),
    "a coating": (on(ROAD, layer=rf.Coating(2e-3, BASE)), CLOSED, None),
    "a relaxing Poisson's ratio": (
        on(ROAD, rf.PronyShear(1.2e6, TREAD.E / 3, TREAD.tau, bulk=2e9)),
        CLOSED,
        None,
    ),
    "the law of boundary elements": (replace(CLOSED, contact_model="boundary_elements"), CLOSED, None),
}


GROUND = rf.SelfAffine(q0=1e4, qr=3e4, q1=1e6, hurst=0.8, h_rms=2e-7)
# Rubber on ground steel, where adhesion matters: scene, velocities and pressures. Areas of the rubber are
# 0.14 to 0.20 without adhesion, and 0.27 to 0.50 with it.
STICKING = {
    "rubber, over velocity": (on(GROUND), np.logspace(-8, -4, 50), 1e4),
    "elastic solid, over pressure": (on(GROUND, rf.Elastic(1e7, 0.5)), 0.0, np.geomspace(1e4, 1e6, 50)),
}
ADHESION = {"energy": rf.Adhesion(1e-3), "long": rf.Adhesion(1e-2, limit="long", range=1e-7)}


def area_with_adhesion(name, limit):
    """Print the least times of a contact area with and without adhesion, and of its gradient."""
    without, velocity, pressure = STICKING[name]
    area = jax.jit(lambda scene: rf.contact_area(scene, velocity, pressure))
    gradient = jax.jit(jax.grad(lambda scene: jnp.sum(rf.contact_area(scene, velocity, pressure))))
    scene = replace(without, adhesion=ADHESION[limit])
    calls = {
        "without": lambda: area(without),
        "with": lambda: area(scene),
        "gradient": lambda: gradient(scene),
    }
    times = least(calls, rounds=16, calls=4)
    print(
        f"\n{limit:5s} range, {name:28s} {1e3 * times['with']:8.2f} ms = "
        f"{times['with'] / times['without']:6.1f} x without, gradient {1e3 * times['gradient']:8.2f} ms"
    )
    assert times["gradient"] < 5 * times["with"]


def part(name):
    """Print the times of a curve and its gradient, relative to those without the part, and the error."""
    scene, without, temperature = PARTS[name]

    def curve(scene, quadrature=None):
        return rf.friction(scene, VELOCITY, PRESSURE, temperature, quadrature=quadrature or rf.Quadrature())

    forward, gradient = jax.jit(curve), jax.jit(jax.grad(lambda scene: jnp.sum(curve(scene))))
    times = in_turns(
        {
            "without": lambda: forward(without),
            "without, gradient": lambda: gradient(without),
            "with": lambda: forward(scene),
            "with, gradient": lambda: gradient(scene),
        },
        rounds=12,
    )
    error = float(jnp.max(jnp.abs(forward(scene) / curve(scene, FINE) - 1)))
    value, slope = times["with"], times["with, gradient"]
    print(
        f"\n{name:36s} {1e3 * value:8.2f} ms = {value / times['without']:6.1f} x without, gradient "
        f"{1e3 * slope:8.2f} ms = {slope / value:.1f} x values = {slope / times['without, gradient']:.1f} x "
        f"gradient without; error {error:.1e}"
    )
    assert error < 1e-8


if __name__ == "__main__":
    for adhesive in STICKING:
        for kind in ADHESION:
            area_with_adhesion(adhesive, kind)
    for optional in PARTS:
        part(optional)
