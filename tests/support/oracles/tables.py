"""The law of a tabulated modulus, written down once more, its means over the circle, and random tables."""

import numpy as np
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
