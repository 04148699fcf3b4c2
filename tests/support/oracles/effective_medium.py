"""Leak of an elastic half-space on a rigid self-affine surface, by brute force with NumPy and SciPy alone.

All integrals use the argument X of P = erf X, composite Gauss rules with many nodes and splines of degree 7.
"""

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq
from scipy.special import erf
from support.oracles.numerical import composite

BELL = 2 / np.sqrt(np.pi)


class Universal:
    """x over X, and w and x s' over ln x, for S in G."""

    def __init__(self, gamma):
        log_X = np.linspace(np.log(1e-7), np.log(7.0), 6001)
        node, weight = composite(log_X, 6)

        def S(X):
            return gamma + (1 - gamma) * erf(X) ** 2

        parts = (weight * np.exp(-2 * node) / (2 * S(np.exp(node)))).reshape(6000, 6).sum(1)
        # g beyond the last X, where S = 1
        g = 1 / (4 * 49) + np.append(np.cumsum(parts[::-1])[::-1], 0.0)
        log_x = -0.5 * np.log(4 * g)
        self.x_of_X = make_interp_spline(log_X, log_x, 7)
        self.X_of_x = make_interp_spline(log_x, log_X, 7)
        self.S = S
        # w / x is the integral of (ds / dX) / x over X.
        X = np.exp(node)
        steep = BELL * np.exp(-X * X) * (gamma + 3 * (1 - gamma) * erf(X) ** 2) * X
        parts = (weight * steep / np.exp(self.x_of_X(node))).reshape(6000, 6).sum(1)
        gap = np.append(np.cumsum(parts[::-1])[::-1], 0.0) * np.exp(log_x)
        X = np.exp(log_X)
        steep = BELL * np.exp(-X * X) * (gamma + 3 * (1 - gamma) * erf(X) ** 2) * X
        growth = S(X) * X**2 * 4 * g
        self.w = make_interp_spline(log_x, gap, 7)
        self.one = make_interp_spline(log_x, steep * growth, 7)


def distribution(roughness, stiffness, gamma):
    """Return A, and arrays of shares, u1 and h of the rest, for stiffness = E_r / sigma_0."""
    q0, qr, q1 = roughness.q
    scale, universal = stiffness**2 / 8, Universal(gamma)
    end = scale * roughness.moment(2, q0, q1)
    X_end = np.exp(universal.X_of_x(-0.5 * np.log(4 * end)))
    X_kink = (
        X_end
        if qr == q0
        else np.exp(
            universal.X_of_x(
                np.clip(-0.5 * np.log(4 * scale * roughness.moment(2, q0, qr)), -16, np.log(5.5))
            )
        )
    )
    marks = np.log(np.sort([X_end, np.clip(X_kink, X_end * (1 + 1e-9), 5.2), 5.3]))
    # Next to q1 the integrand has a root of the distance from q1.
    grades = marks[0] + (marks[1] - marks[0]) * np.linspace(0, 1, 25) ** 3
    log_X, weight = composite(np.append(grades, np.linspace(marks[1], marks[2], 13)[1:]), 16)
    X = np.exp(log_X)
    P, g = erf(X), 0.25 * np.exp(-2 * universal.x_of_X(log_X))
    share = weight * X * BELL * np.exp(-X * X)
    q = roughness.find(g / scale)
    c = np.sqrt(np.pi) / 2 * (P / X) ** 3 * np.exp(X * X) / universal.S(X)
    u1 = np.zeros_like(q)
    for low, high in ((q, np.maximum(q, qr)), (np.maximum(q, qr), np.full_like(q, q1))):
        t, dt = composite(np.concatenate([[0.0], 2.0 ** np.arange(-40, 1)]), 10)
        length = np.log(high / low)[:, None]
        further = low[:, None] * np.exp(length * t)
        gone = scale * roughness.moment(2, q[:, None] + 0 * further, further)
        x = np.minimum(1 / (2 * P[:, None] * np.sqrt(np.maximum(gone, 1e-300))), 6.5)
        log_x = np.log(x)
        w, one = universal.w(log_x), universal.one(log_x)
        k = np.where(x < 6.5, w + one + c[:, None] * x * x * (one - w), 0.0)
        u1 += np.sum(k * roughness.density(1, further) * length * dt, 1)
    h = np.sqrt(np.maximum(roughness.moment(0, q, q1), 1e-30 * roughness.moment(0, q0, q1)))
    return erf(X_end), share, 0.25 * stiffness * P * u1, h


def conductivity(area, share, u1, h, critical_area):
    """Return K of the effective medium [m^3]."""
    # Panels of a standard deviation, and panels that halve towards u = 0.
    halves = 2.0 ** np.arange(-30, 1)
    far = (u1 + 9 * h)[:, None]
    edges = [
        (u1[:, None] + h[:, None] * np.linspace(-9, 9, 19)),
        0 * far,
        far * halves,
        -9 * h[:, None] * halves,
    ]
    edges = np.clip(np.sort(np.concatenate(edges, 1), 1), (u1 - 9 * h)[:, None], far)
    u, weight = composite(edges, 8)
    share, u1, h = (x[:, None] for x in (share, u1, h))
    bell = share * weight * np.exp(-0.5 * ((u - u1) / h) ** 2) / (h * np.sqrt(2 * np.pi))
    u = np.abs(u)

    def excess(log_w):
        return area + np.sum(bell / (1 + (u / np.exp(log_w)) ** 3)) - critical_area

    log_w = brentq(excess, np.log(h.max()) - 20, np.log(h.max()) + 5, xtol=1e-12)
    return np.exp(3 * log_w) / 12 * (1 - critical_area) / critical_area
