"""Evaluate <e^-u/r> of contact without adhesion on an elastic half-space by composite Gauss rules over q.

The spectrum has a plateau from q0 to qr and a power law up to q1; its moments are closed. No code is shared
with rubberfric. More panels change the results by 1e-7 at most, mostly by 1e-14; rules of 20 nodes by 3e-12.
"""

import math

import numpy as np
from scipy import special
from scipy.interpolate import CubicSpline
from support.oracles.moments import Roughness
from support.oracles.numerical import composite

ORDER = 12  # nodes of a panel


class DmtAttraction:
    """A rough elastic half-space; `modulus` is E / (1 - nu^2)."""

    def __init__(self, q0, qr, q1, hurst, h_rms, modulus, gamma):
        self.q0, self.qr, self.q1, self.modulus, self.gamma = q0, qr, q1, modulus, gamma
        self.roughness = Roughness(q0, qr, q1, hurst, h_rms)
        log_x = np.linspace(-40, math.log(8), 20001)
        at, weight = composite(log_x)
        steps = (weight * self._slope(np.exp(at))).reshape(-1, ORDER).sum(1)
        # Psi, the integral of s' d ln x from x on.
        self.psi = CubicSpline(log_x, np.append(np.cumsum(steps[::-1])[::-1], 0.0))

    def _slope(self, x):
        """Return s' of s = S P."""
        return (
            2
            / math.sqrt(math.pi)
            * np.exp(-x * x)
            * (self.gamma + 3 * (1 - self.gamma) * special.erf(x) ** 2)
        )

    def stress(self, low, high):
        """Return G times the squared pressure, of the roughness between two wavevectors."""
        return self.modulus**2 / 8 * self.roughness.moment(2, low, high)

    def load_of(self, area):
        """Return the load at which contact without adhesion has an area."""
        return 2 * math.sqrt(self.stress(self.q0, self.q1)) * special.erfinv(area)

    def _first_gap(self, q, pressure):
        """Return u1 at each q."""
        X = 0.5 * pressure / np.sqrt(self.stress(self.q0, q))
        P = special.erf(X)
        c = (math.sqrt(math.pi) / 2 * (P / X) ** 3 * np.exp(np.minimum(X, 6.0) ** 2))[:, None]
        length = np.log(self.q1 / q)[:, None]
        knee = np.clip(np.log(self.qr / q)[:, None], 0.0, length)
        grading = np.append(0.0, 10.0 ** np.linspace(-14, 0, 43))
        total = 0.0
        for edges in (knee * grading, knee + (length - knee) * grading):
            at, weight = composite(edges)
            beyond = q[:, None] * np.exp(at)
            rise = np.maximum(self.stress(q[:, None], beyond), 1e-300)
            x = np.minimum(0.5 * pressure / (P[:, None] * np.sqrt(rise)), 27.0)
            gap = x * np.where(x < 8, self.psi(np.log(np.minimum(x, 7.999))), 0.0)
            slope = x * self._slope(x)
            k = gap + slope + c * x * x * (slope - gap)
            total = total + np.sum(weight * 0.5 * self.roughness.density(1, beyond) * k, 1)
        return 0.5 * self.modulus / pressure * P * total

    def attraction(self, pressure, reach):
        """Return <e^-u/r> at a load."""
        length, knee = math.log(self.q1 / self.q0), math.log(self.qr / self.q0)
        first = knee if knee > 0 else 0.5 * length
        # The contact begins to be lost at X = 6.5, where G is still linear in q - q0.
        start = pressure**2 / 169 / (self.modulus**2 / 8 * self.roughness.density(2, self.q0)) / length
        start = min(start, 1e-3)
        rise = np.exp(np.linspace(math.log(start), 0, int(-3 * math.log(start)) + 1))
        middle = first + (length - first) * np.linspace(0, 0.5, 13)[1:]
        last = length - 0.5 * (length - first) * 0.25 ** np.arange(1, 22)
        at, weight = composite(np.concatenate([[0.0], first * rise, middle, last, [length]]))
        q = self.q0 * np.exp(at)
        G = self.stress(self.q0, q)
        X = 0.5 * pressure / np.sqrt(G)
        density = self.modulus**2 / 8 * self.roughness.density(2, q)
        lost = weight * np.exp(-X * X) * X / math.sqrt(math.pi) * density / G
        some = lost > 1e-17
        if not some.any():
            return 1.0
        q, lost = q[some], lost[some]
        u1, h = self._first_gap(q, pressure), np.sqrt(self.roughness.moment(0, q, self.q1))
        a, t = h / reach, u1 / h
        below = t < a
        bell = np.exp(-0.5 * np.minimum(t, 100.0) ** 2)
        near = bell * special.erfcx(np.where(below, a - t, 0.0) / math.sqrt(2))
        far = np.exp(np.where(below, 0.0, a * (0.5 * a - t)))
        far = far * special.erfc(np.where(below, 0.0, a - t) / math.sqrt(2))
        mean = 0.5 * (np.where(below, near, far) + bell * special.erfcx((a + t) / math.sqrt(2)))
        area = math.erf(0.5 * pressure / math.sqrt(self.stress(self.q0, self.q1)))
        return area + np.sum(lost * mean)
