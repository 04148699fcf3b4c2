"""Friction curves whose time is measured, and the same by trapezoids in NumPy."""

import numpy as np
import scipy.integrate
import scipy.special

import rubberfric as rf

TAU = 10.0 ** np.arange(-12, 1)
E = np.array([1.18e9, 8.2e8, 1.82e9, 7.6e8, 1.43e8, 4.5e7, 1.55e7, 6.5e6, 3.6e6, 2.2e6, 1.6e6, 1.1e6, 9.0e5])
TREAD = rf.Prony(3.6e6, E, TAU, 0.5)
TRACK = rf.Prony(2.0e6, 0.5 * E, 2.3 * TAU, 0.49)
ROAD = rf.SelfAffine(100.0, 1000.0, 3.1e4, 0.8, 5e-4)
WORN = rf.SelfAffine(150.0, 2000.0, 5.0e4, 0.8, 5e-5)
ONE = rf.Scene(rf.Body(TREAD), rf.Body(rf.Rigid(), ROAD))
TWO = rf.Scene(rf.Body(TREAD, WORN), rf.Body(TRACK, ROAD))
VELOCITY = np.logspace(-6, 1, 50)
PRESSURE = 0.15e6


def numpy_friction(nodes_q=200, nodes_phi=64):
    """Uniform trapezoids in ln q and phi, all velocities at once."""
    q = np.geomspace(100.0, 3.1e4, nodes_q)
    phi = np.linspace(0, 2 * np.pi, nodes_phi, endpoint=False)
    omega = q[None, :, None] * VELOCITY[:, None, None] * np.cos(phi)
    modulus = np.full(omega.shape, 3.6e6, complex)
    for weight, tau in zip(E, TAU, strict=True):
        s = 1j * omega * tau
        modulus += weight * s / (1 + s)
    modulus /= 1 - 0.5**2
    roughness = q**4 * np.asarray(rf.power_spectrum(ROAD, q))
    step = 2 * np.pi / nodes_phi
    density = roughness / (8 * PRESSURE**2) * np.sum(abs(modulus) ** 2, -1) * step
    G = scipy.integrate.cumulative_trapezoid(density, np.log(q), axis=-1, initial=0.0)
    with np.errstate(divide="ignore"):
        P = scipy.special.erf(0.5 / np.sqrt(G))
    S = 0.5 + 0.5 * P**2
    integrand = roughness * S * P * np.sum(np.cos(phi) * modulus.imag, -1) * step / (2 * PRESSURE)
    return np.trapezoid(integrand, np.log(q), axis=-1)
