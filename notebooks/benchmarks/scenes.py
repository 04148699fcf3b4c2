"""Scenes whose friction curves are measured, and the same curves by trapezoids in NumPy."""

import numpy as np
import scipy.integrate
import scipy.special

import rubberfric as rf
from rubberfric.scene.interface import shear_friction

ROAD = rf.SelfAffine(100.0, 1000.0, 3.1e4, 0.8, 5e-4)
TAU = 10.0 ** np.arange(-12, 1)
E = np.array([1.18e9, 8.2e8, 1.82e9, 7.6e8, 1.43e8, 4.5e7, 1.55e7, 6.5e6, 3.6e6, 2.2e6, 1.6e6, 1.1e6, 9.0e5])
TREAD = rf.Prony(3.6e6, E, TAU, 0.5)
TRACK = rf.Prony(2.0e6, 0.5 * E, 2.3 * TAU, 0.49)
WORN = rf.SelfAffine(150.0, 2000.0, 5.0e4, 0.8, 5e-5)
ONE = rf.Scene(rf.Body(TREAD), rf.Body(rf.Rigid(), ROAD))
TWO = rf.Scene(rf.Body(TREAD, WORN), rf.Body(TRACK, ROAD))
VELOCITY = np.logspace(-6, 1, 50)  # [m/s]
PRESSURE = 0.15e6  # [Pa]


def numpy_friction(scene=ONE, velocity=VELOCITY, pressure=PRESSURE, temperature=None):
    """Return the friction of a Prony solid on a self-affine surface, by 200 trapezoids in ln q and 64 in phi.

    It includes the contact shear of the scene. With a temperature, the shifts of both are applied.
    """
    rigid_first = isinstance(scene.lower.material, rf.Rigid)
    road, rubber = (scene.lower, scene.upper) if rigid_first else (scene.upper, scene.lower)
    road, rubber, shear = road.spectrum, rubber.material, scene.shear
    shift = 1.0 if temperature is None else np.exp(np.asarray(rubber.shift.log_factor(temperature)))
    q = np.geomspace(float(road.q0), float(road.q1), 200)
    phi = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    omega = q[None, :, None] * (velocity * shift)[:, None, None] * np.cos(phi)
    modulus = np.full(omega.shape, float(rubber.E_inf), complex)
    for weight, tau in zip(np.asarray(rubber.E), np.asarray(rubber.tau), strict=True):
        s = 1j * omega * tau
        modulus += weight * s / (1 + s)
    modulus /= 1 - float(rubber.poisson) ** 2
    p, step = np.broadcast_to(pressure, velocity.shape)[:, None], 2 * np.pi / 64
    roughness = q**4 * np.asarray(rf.power_spectrum(road, q))
    density = roughness / (8 * p**2) * np.sum(abs(modulus) ** 2, -1) * step
    G = scipy.integrate.cumulative_trapezoid(density, np.log(q), axis=-1, initial=0.0)
    with np.errstate(divide="ignore"):
        P = scipy.special.erf(0.5 / np.sqrt(G))
    S = 0.5 + 0.5 * P**2
    integrand = roughness * S * P * np.sum(np.cos(phi) * modulus.imag, -1) * step / (2 * p)
    friction = np.trapezoid(integrand, np.log(q), axis=-1)
    if shear is None:
        return friction
    return friction + np.asarray(shear_friction(shear, P[:, -1], velocity, pressure, temperature))
