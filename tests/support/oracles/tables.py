"""The law of a tabulated modulus, written down once more, its means over the circle, and random tables."""

import numpy as np
from scipy.special import erf, erfc

_NODE, _SHARE = np.polynomial.legendre.leggauss(16)


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


def by_quadrature(table, outside, x, spring=None, harmonic=0, width=0.1):
    """<|F|^2>, <cos Im F>, <Re F> with cos 2 m phi at ln(q v), by Gauss panels of one width in ln cos phi."""
    edges = np.arcsin(np.exp(-width * np.arange(int(40 / width))))
    psi = edges[1:, None] - np.diff(edges)[:, None] * 0.5 * (1 + _NODE)
    measure = -np.diff(edges)[:, None] * _SHARE / np.pi * np.cos(2 * harmonic * (0.5 * np.pi - psi))
    found = []
    for one in x:
        storage, loss = law(table, outside, one + np.log(np.sin(psi)), width)
        if spring is None:
            parts = storage**2 + loss**2, loss, storage
        else:
            square, under = storage**2 + loss**2, (storage + spring) ** 2 + loss**2
            parts = (
                spring**2 * square / under,
                spring**2 * loss / under,
                spring * (spring * storage + square) / under,
            )
        found.append([np.sum(measure * p) for p in (parts[0], parts[1] * np.sin(psi), parts[2])])
    return np.array(found).T


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
