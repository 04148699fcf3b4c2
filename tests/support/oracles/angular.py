"""Means over the circle by Gauss panels, analytic in all numbers: complex steps give their derivatives."""

import numpy as np


def angular_means(modulus, qv, cosine=(), sine=(), panel=0.25, depth=90.0):
    """Return <F'^2>, <F''^2>, <cos phi F''>, <F'> and <sin phi F''>, where F', F'' = modulus(q v cos phi).

    The first four are weighted with 1 + sum of cosine_m cos 2m phi, the last one with the sum of sine_m sin
    2m phi. The panels are in y, cos phi = sin psi, psi = (pi/2) e^-y: every relaxation time is one step.
    """
    node, share = np.polynomial.legendre.leggauss(16)
    y = np.arange(0.0, depth, panel)[:, None] + 0.5 * panel * (1 + node)
    psi = 0.5 * np.pi * np.exp(-y)  # phi = pi/2 - psi
    measure = panel * share * psi / np.pi
    real, imaginary = modulus(qv * np.sin(psi))
    order = np.arange(1, len(cosine) + 1)
    even = 1 + np.sum(cosine * (-1.0) ** order * np.cos(2 * order * psi[..., None]), -1)
    odd = -np.sum(sine * (-1.0) ** order * np.sin(2 * order * psi[..., None]), -1)
    parts = real**2 * even, imaginary**2 * even, np.sin(psi) * imaginary * even, real * even
    return np.array([np.sum(measure * part) for part in (*parts, np.cos(psi) * imaginary * odd)])


def prony(rest, weight, tau):
    """Return F' and F'' of a Prony series as a function of omega."""

    def modulus(omega):
        a = omega[..., None] * tau
        return rest + np.sum(weight * a * (a / (1 + a * a)), -1), np.sum(weight * a / (1 + a * a), -1)

    return modulus


def with_spring(real, imaginary, spring):
    """Return F' and F'' of a solid in series with a spring."""
    square, size = real**2 + imaginary**2, (real + spring) ** 2 + imaginary**2
    return spring * (square + spring * real) / size, spring**2 * imaginary / size
