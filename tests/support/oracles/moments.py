"""Moments of broken power laws by their definition: in closed form with NumPy, and in mpmath's precision."""

import itertools

import mpmath as mp
import numpy as np


class Roughness:
    """Moments 2 pi int q^(1 + n) C dq of a SelfAffine with numbers q0, qr, q1, hurst, h_rms."""

    def __init__(self, q0, qr, q1, hurst, h_rms):
        self.q, self.powers, self.C = (q0, qr, q1), (0.0, -2 * (1 + hurst)), 1.0
        self.C = h_rms**2 / self.moment(0, q0, q1)

    def moment(self, n, low, high):
        total = 0.0
        for power, left, right in zip(self.powers, self.q[:-1], self.q[1:], strict=True):
            a, b, e = np.clip(low, left, right), np.clip(high, left, right), power + n + 2
            step = np.log1p((b - a) / a)  # close ends lose no digits
            grown = step if e == 0 else np.expm1(e * step) / e
            total = total + self.C * (a / self.q[1]) ** power * a ** (n + 2) * grown
        return 2 * np.pi * total

    def find(self, slope2):
        """Return q up to which the moment of order 2 is slope2."""
        first = self.moment(2, self.q[0], self.q[1])
        lower = slope2 <= first
        left, start = np.where(lower, self.q[0], self.q[1]), np.where(lower, 0.0, first)
        e = np.where(lower, *self.powers) + 4
        return np.minimum(
            left * np.exp(np.log1p(e * (slope2 - start) / self.density(2, left)) / e), self.q[2]
        )

    def density(self, n, q):
        """Return d(moment) / d ln q."""
        power = np.where(q < self.q[1], *self.powers)
        return 2 * np.pi * self.C * (q / self.q[1]) ** power * q ** (n + 2)


def moment_of_plateau(spectrum, order, q):
    """2 pi int q^(1 + order) C dq up to q, for (q0, qr, q1, H) and C = 1 on the plateau."""
    q0, qr, q1, hurst = spectrum
    rise = max(min(q, qr), q0)
    total = (rise ** (order + 2) - q0 ** (order + 2)) / (order + 2)
    if q > qr:
        k = order - 2 * hurst
        width = mp.log(min(q, q1) / qr)
        total += qr ** (order + 2) * (width if k == 0 else mp.expm1(k * width) / k)
    return 2 * mp.pi * total


def self_affine_moment(leaves, order, q):
    """The moment up to q for (q0, qr, q1, H, h_rms)."""
    *spectrum, h_rms = leaves
    return h_rms**2 * moment_of_plateau(spectrum, order, q) / moment_of_plateau(spectrum, 0, spectrum[2])


def table_moment(knots, values, order, q):
    """The moment up to q of a table that is linear in logarithms."""
    total = mp.mpf(0)
    for (a, b), (left, right) in zip(itertools.pairwise(knots), itertools.pairwise(values), strict=True):
        if q > a:
            k = mp.log(right / left) / mp.log(b / a) + 2 + order
            width = mp.log(min(q, b) / a)
            total += 2 * mp.pi * left * a ** (order + 2) * (width if k == 0 else mp.expm1(k * width) / k)
    return total
