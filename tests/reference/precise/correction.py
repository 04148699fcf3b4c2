"""S in G in 120-digit arithmetic: G from g = int dG / S."""

import math

import gmpy2
import numpy as np
from arithmetic import ROOT_PI, erf, exp, gauss, sqrt, true
from gmpy2 import mpfr

S_IS_ONE = mpfr(1) / 600  # G below which P and S are 1 to 65 digits


class Correction:
    """G with int_0^G dG / S = g at ascending g: solved once for every gamma, nearby by a Taylor series."""

    def __init__(self):
        self.known = {}  # gamma: (g, G)

    def __call__(self, g, gamma):
        if not g[-1] > S_IS_ONE:
            return g
        known = self.known.get(gamma)
        if known is None or known[0].shape != g.shape:
            known = self.known[gamma] = (g, _solve(g, gamma))
        g_known, G = known
        change = g - g_known
        if not true(change != 0).any():
            return G
        if true(abs(change) > mpfr("1e-24") * g_known).any():
            raise ArithmeticError("too far for a Taylor series")
        x = 1 / (2 * sqrt(G))
        P = erf(x)
        S = gamma + (1 - gamma) * P**2
        dS = -2 * (1 - gamma) * P * x * exp(-x * x) / (ROOT_PI * G)
        return G + S * change + S * dS * change**2 / 2


def _solve(g, gamma):
    """G at ascending g from g = int dG / S, integrated from one to the next."""

    def excess(G):  # 1/S - 1
        P = erf(1 / (2 * sqrt(G)))
        return 1 / (gamma + (1 - gamma) * P**2) - 1

    start = S_IS_ONE
    late = np.flatnonzero(true(g > start))
    result = g.copy()
    target = g[late]
    log_g = np.array([float(gmpy2.log(x)) for x in target])
    log_G = _in_double_precision(log_g, float(gamma))
    G = np.array([gmpy2.exp(mpfr(x)) for x in log_G], object)
    node, weight, _ = gauss(14)
    for _ in range(12):
        left = np.concatenate([[start], G[:-1]])
        width = G - left
        # Neighbouring nodes are so close that one panel of any kind would do.
        between = left[:, None] + width[:, None] * node
        total = start + np.cumsum(width * (1 + excess(between) @ weight))
        step = (total - target) / (1 + excess(G))
        G = G - step
        if true(abs(step) < mpfr("1e-90") * G).all():
            break
    else:
        raise ArithmeticError("S in G did not converge")
    result[late] = G
    return result


def _in_double_precision(log_g, gamma):
    """ln G at ln g in double precision: a start."""
    grid = np.linspace(math.log(1e-3), max(log_g.max(), 0.0) + 5 - math.log(max(gamma, 1e-8)), 20001)
    G = np.exp(grid)
    P = np.vectorize(math.erf)(0.5 / np.sqrt(G))
    f = G / (gamma + (1 - gamma) * P**2)
    g = 1e-3 + np.concatenate([[0], np.cumsum(0.5 * np.diff(grid) * (f[1:] + f[:-1]))])
    return np.interp(log_g, np.log(g), grid)
