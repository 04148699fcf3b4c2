"""The law of `contact_model="boundary_elements"` by trapezoids."""

import numpy as np
from scipy import optimize, special

from rubberfric.theory.area.law_roughness import CONSTANTS


def isotropic(phi):
    return np.ones_like(phi)


def law_by_trapezoids(
    E_of, road, velocity, pressure, count=3000, angles=400, *, stiffer=np.ones_like, density=isotropic
):
    """Area and friction along and across, by trapezoids, on E / (1 - nu^2) = `E_of` omega.

    road : self-affine, the mean over the directions
    stiffer : ratio of the stiffnesses of a slab and a half-space, as a function of q
    density : C(q, phi) over its mean over phi
    """
    c = CONSTANTS
    q0, qr, q1, hurst = (float(x) for x in (road.q0, road.qr, road.q1, road.hurst))
    s = np.linspace(0, 1, count + 1)[1:]
    q = q0 * np.exp(s**2 * np.log(q1 / q0))
    step = 2 * s * np.log(q1 / q0) / count
    step[-1] /= 2
    shape = np.where(q < qr, 1.0, (q / qr) ** (-2 - 2 * hurst))
    C = float(road.h_rms) ** 2 * shape / (2 * np.pi * np.sum(q**2 * shape * step))
    phi = (np.arange(angles) + 0.5) / angles
    phi = np.pi / 2 * (1 - (1 - phi) ** 4)  # towards cos(phi) = 0
    dphi = np.gradient(phi) / np.sum(np.gradient(phi)) / 2
    phi, dphi = np.append(phi, -phi), np.append(dphi, dphi)
    beyond = q1 * np.exp((np.arange(count) + 0.5) / count * np.log(6))
    dln = np.log(6) / count
    circle = np.linspace(0, np.pi, 2000, endpoint=False)
    full, light = (density(phi) ** x / np.mean(density(circle) ** x) for x in (1, 1 - c.c_g))
    e2 = abs(np.mean(density(circle) * np.exp(2j * circle)) / np.mean(density(circle))) ** 2

    def mean(f, A):
        return f @ (dphi * (A * full + (1 - A) * light))

    E, E_beyond = (E_of(x[:, None] * velocity * np.cos(phi)) * stiffer(x)[:, None] for x in (q, beyond))
    m0, m2, m4 = (2 * np.pi * np.sum(q ** (2 + n) * C * step) for n in (0, 2, 4))
    alpha = m0 * m4 / m2**2
    density_q = q**4 * C
    F = (np.cumsum(density_q * step) - 0.5 * density_q * step) / np.sum(density_q * step)
    D = density_q / np.sum(density_q * step)

    def means(E, A):
        """E_g, E_r and E_h."""
        squares = (mean(abs(E) ** n, A) ** (1 / n) for n in (2.0, -2.0))
        return np.exp(mean(np.log(abs(E)), A)), *squares

    def tail(A):
        above = c.c_T * A * (1 - A) * D[-1] ** c.c_e * np.exp(-c.c_eT * e2)
        return above / ((1 + c.c_r * A) ** 2 * (1 + c.c_alpha * np.log(alpha)))

    def bound(A):
        """-ln W_m"""
        N2 = c.c_n * np.log(F / D + 0.25) ** 2
        light = c.c_0 - c.c_D * np.log(D) + c.c_f * np.log(F) - N2 - c.c_e0 * e2
        heavy = c.h_0 - c.h_D * np.log(D) + c.h_F * np.log(F) - N2
        log_W = np.log(A) + (1 - A) ** c.c_A * light + A * (1 - A) * heavy
        return np.logaddexp(0, -c.n / (1 - A) * log_W) * (1 - A) / c.n

    def effective(A):
        here, there = D * np.exp(-bound(A)) * step, c.k * D[-1] * tail(A) * dln * np.ones(count)
        total, B = 0.0, (1 - A) ** c.a
        for weight, one in ((here, E), (there, E_beyond)):
            E_g, E_r, _ = means(one, A)
            total += np.sum(weight * (E_g**B * E_r ** (1 - B)) ** 2)
        return np.sqrt(total / (here.sum() + there.sum()))

    S_0 = (1 - 1 / (c.s_0 + c.s_alpha * np.log(alpha))) * (1 - c.c_eS * e2)

    def excess(log_A):
        A = np.exp(log_A)
        load = np.sqrt(2) * pressure / (effective(A) * np.sqrt(m2))
        return special.erf(load / np.sqrt(S_0 + (1 - S_0) * A**c.s)) - A

    A = np.exp(optimize.brentq(excess, -20, -1e-9, xtol=1e-13))
    E_eff, B = effective(A), (1 - A) ** c.a
    _, E_r, E_h = means(E, A)
    E_W, E_h_beyond = (E_h**B * E_r ** (1 - B))[:, None], means(E_beyond, A)[2]
    Y = 1 / np.expm1(bound(A))[:, None] * (E_eff / E_W) ** (c.c_v * (1 - A) + c.c_w * A)
    Y = Y * (E_W / abs(E)) ** (c.c_phi * (1 - A))
    heat = E_beyond.imag * (E_h_beyond[:, None] / abs(E_beyond)) ** c.c_phi
    tail_factor = tail(A) * q1**4 * C[-1] * (beyond / q1) ** -3 * (E_eff / E_h_beyond) ** c.c_b * dln
    forces = []
    for side in (np.cos(phi), np.sin(phi)):
        inside = np.sum(q**4 * C * step * mean(side * E.imag * Y / (1 + Y), A))
        forces.append(np.pi / pressure * (inside + np.sum(tail_factor * mean(side * heat, A))))
    return A, *forces


def brute_force(E_of, road, velocity, pressure, count=500, angles=200, **options):
    """Return the brute force with the error of second order removed, from two meshes [Richardson]."""
    coarse, fine = (
        np.array(
            law_by_trapezoids(E_of, road, velocity, pressure, count=n * count, angles=n * angles, **options)
        )
        for n in (1, 2)
    )
    return (4 * fine - coarse) / 3
