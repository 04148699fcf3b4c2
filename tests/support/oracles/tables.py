"""The law of a tabulated modulus, written down once more, its means over the circle, and random tables."""

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.special import erf, erfc
from support.oracles.angular import angular_means, with_spring


def averaged(knots, values, fall, width, x):
    """Mean over a Gaussian of the lines through knots: the integral over every piece; complex knots too."""
    slopes = np.concatenate([[fall], np.diff(values) / np.diff(knots), [-fall]])
    begin, height = (np.concatenate([row[:1], row]) for row in (knots, values))
    total = 0
    for k, slope in enumerate(slopes):
        low = -np.inf if k == 0 else (knots[k - 1] - x) / width
        high = np.inf if k == slopes.size - 1 else (knots[k] - x) / width
        mass = 0.5 * (erf(high / 2**0.5) - erf(low / 2**0.5))
        mean = (np.exp(-0.5 * np.square(low)) - np.exp(-0.5 * np.square(high))) / np.sqrt(2 * np.pi)
        total = total + (height[k] + slope * (x - begin[k])) * mass + slope * width * mean
    return total


def law(table, outside, x, width=0.1):
    """E' and E'' at x = ln omega; table: ln omega, ln E', ln E''."""
    knots, storage, loss = table
    fall = 1.0 if outside == "fall" else 0.0
    E1, E2 = (np.exp(averaged(knots, *curve, width, x)) for curve in ((storage, 0.0), (loss, fall)))
    if outside == "none":
        E2 = E2 * erfc((knots[0] - x) / width / 2**0.5) * erfc((x - knots[-1]) / width / 2**0.5) / 4
    return E1, E2


def by_quadrature(table, outside, x, spring=None, shares=((), ()), width=0.1):
    """<|F|^2>, <cos phi Im F>, <Re F> and <sin phi Im F> at ln(q v), with shares of the harmonics."""

    def modulus(omega):
        moduli = law(table, outside, np.log(omega), width)
        return moduli if spring is None else with_spring(*moduli, spring)

    means = np.array([angular_means(modulus, np.exp(one), *shares, panel=width, depth=40.0) for one in x])
    return np.concatenate([[means[:, 0] + means[:, 1]], means[:, 2:].T])


def random_table(seed):
    """(ln omega, ln E', ln E'') with 10 ... 300 entries: smooth, stepping up, of little loss, noisy."""
    rng = np.random.default_rng(seed)
    n = (10, 40, 120, 300)[(seed + seed // 4) % 4]  # every length compiles once
    gaps = 10 ** rng.uniform(-2.5, 0, n - 1)
    x = -10 + np.concatenate([[0], np.cumsum(gaps * rng.uniform(10, 45) / gaps.sum())])
    kind = ("smooth", "step", "little loss", "noisy")[seed % 4]
    storage = 3 * np.tanh((x - 5) / 8)
    if kind == "step":  # a factor 20 between two entries, however near
        storage = storage + 3.0 * (x > np.median(x))
    loss = storage + np.log(1e-3 if kind == "little loss" else 0.2)
    scatter = {"smooth": 0.01, "step": 0.1, "little loss": 0.1, "noisy": 0.5}[kind]
    return x, storage + scatter * rng.normal(size=n), loss + scatter * rng.normal(size=n)


def _modulus(table, outside, width):
    """E' and E'' by splines over a grid far finer than the law, beyond which E'' is a power."""
    x = np.arange(table[0][0] - 1, table[0][-1] + 1, 0.05 * width)
    spline = make_interp_spline(x, np.log(law(table, outside, x, width)).T, 7)

    def modulus(at):
        inside = np.clip(at, x[0], x[-1])
        storage, loss = np.exp(spline(inside)).T
        return storage, loss * np.exp(-np.abs(at - inside)) if outside == "fall" else loss

    return modulus


def contact(table, outside, road, velocity, pressure, gamma=0.5, width=0.1):
    """A/A0 and mu of an incompressible half-space on a self-affine road, panels in ln q and ln cos phi.

    Neither tables of means nor an interpolation over q: E is taken in every direction at every q.
    """
    modulus = _modulus(table, outside, width)
    node, weight = np.polynomial.legendre.leggauss(10)
    node, weight = 0.5 * (node + 1), 0.5 * weight
    # Integrals of the interpolant up to every node.
    powers = np.arange(10)
    upto = (node[:, None] ** (powers + 1) / (powers + 1)) @ np.linalg.inv(node[:, None] ** powers)
    span, bend = np.log(road.q1 / road.q0), np.log(road.qr / road.q0)
    graded = 0.05 * 0.3 ** np.arange(24.0)[::-1]
    t = np.unique(np.concatenate([[0.0], graded, np.arange(0.05, span, 0.05), [bend, span]]))
    step = np.diff(t)[:, None]
    q = road.q0 * np.exp(t[:-1, None] + step * node)
    fall = (1 - (road.qr / road.q1) ** (2 * road.hurst)) / (2 * road.hurst)
    plateau = road.h_rms**2 / (2 * np.pi) / (0.5 * (road.qr**2 - road.q0**2) + road.qr**2 * fall)
    rough = q**4 * plateau * np.maximum(q / road.qr, 1.0) ** (-2 * (1 + road.hurst)) * step
    edges = np.arcsin(np.exp(-width * np.arange(int(36 / width))))
    psi = edges[1:, None] - np.diff(edges)[:, None] * node[::-1]
    measure = -np.diff(edges)[:, None] * weight * 2 / np.pi
    shift, found = np.log(np.sin(psi)).ravel(), []
    for v in velocity:
        power, loss = np.empty(q.shape), np.empty(q.shape)
        for panel, one in enumerate(q):
            storage, lossy = modulus((np.log(one * v)[:, None] + shift).ravel())
            storage, lossy = (x.reshape(10, -1) / 0.75 for x in (storage, lossy))
            power[panel] = (storage**2 + lossy**2) @ measure.ravel()
            loss[panel] = (lossy * np.sin(psi).ravel()) @ measure.ravel()
        density = np.pi / 4 * rough * power / pressure**2
        before = np.concatenate([[0.0], np.cumsum(density @ weight)])
        P = erf(0.5 / np.sqrt(before[:-1, None] + density @ upto.T))
        S = gamma + (1 - gamma) * P * P
        mu = np.pi / pressure * np.sum((S * P * rough * loss) @ weight)
        found.append([erf(0.5 / np.sqrt(before[-1])), mu])
    return np.array(found).T
