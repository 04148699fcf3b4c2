"""Area, friction and separation of a scene in 120-digit arithmetic: the theory's radial integrals."""

import math
from itertools import pairwise

import gmpy2
import numpy as np
from arithmetic import PI, ROOT_PI, erf, exp, gauss, sqrt, true
from correction import Correction
from gmpy2 import mpfr
from solids import angular_means, forget_poles, shift_factor


def kinks_of(psd):
    return tuple(psd["q"]) if "q" in psd else (psd["q0"], psd["qr"], psd["q1"])


def spectrum(psd, q, log_q):
    """C(q) inside the spectrum."""
    if "q" in psd:
        table_q, table_C = ([gmpy2.log(x) for x in psd[key]] for key in ("q", "C"))
        middle = log_q.ravel()[log_q.size // 2]
        i = max(j for j in range(len(table_q) - 1) if table_q[j] <= middle)
        slope = (table_C[i + 1] - table_C[i]) / (table_q[i + 1] - table_q[i])
        return exp(table_C[i] + slope * (log_q - table_q[i]))
    q0, qr, q1, H = (psd[key] for key in ("q0", "qr", "q1", "H"))
    tail = gmpy2.log(q1 / qr) if H == 0 else (1 - (q1 / qr) ** (-2 * H)) / (2 * H)
    C0 = psd["h_rms"] ** 2 / (2 * PI * ((qr**2 - q0**2) / 2 + qr**2 * tail))
    if log_q.ravel()[log_q.size // 2] < gmpy2.log(qr):
        return C0 + 0 * q
    return C0 * exp(-2 * (1 + H) * (log_q - gmpy2.log(qr)))


class Piece:
    """Panels between two neighbouring kinks: nodes, and values of the spectra and means there."""

    def __init__(self, left, right, active, edges, order):
        self.left, self.active = left, active
        node, weight, _ = gauss(order)
        length = gmpy2.log(right / left)
        edges = np.array([mpfr(x) for x in edges], object) * length
        self.width = edges[1:] - edges[:-1]
        t = edges[:-1, None] + self.width[:, None] * node
        self.q, self.log_q = left * exp(t), gmpy2.log(left) + t
        self.weight = self.width[:, None] * weight


class Contact:
    """The quantities of one case and of neighbouring cases, on one mesh."""

    def __init__(self, case, mesh):
        self.order, self.widest, self.ratio = mesh
        self.edges = {}
        self.cache = {}
        self.correct = Correction()
        forget_poles()
        self._lay_out(case)

    def __call__(self, case):
        """Area, friction and separation."""
        sigma, gamma = case["pressure"], case["gamma"]
        square, odd, real, width, weight = self._densities(case)
        g = np.zeros(0, object)
        if square.size:
            g, g_end = self._cumulative(square, width)
        if not g.size or not g_end > 0:
            area, friction, separation = mpfr(1), mpfr(0), mpfr(0)
        else:
            G, G_end = g, g_end
            if case.get("area_correction"):
                both = self.correct(np.append(g.ravel(), g_end) / sigma**2, gamma) * sigma**2
                G, G_end = both[:-1].reshape(g.shape), both[-1]
            area = gmpy2.erf(sigma / (2 * gmpy2.sqrt(G_end)))
            P = self._contact(sigma, G)
            S = gamma + (1 - gamma) * P**2
            friction = PI / sigma * np.sum(weight * odd * S * P)
            # Psi = int s'(x) dG / (2 G), s = gamma erf + (1 - gamma) erf^3
            P0 = P if G is g else self._contact(sigma, g)
            rough = true(g > 0)
            safe = np.where(rough, g, mpfr(1))
            x = sigma / (2 * sqrt(safe))
            slope = 2 / ROOT_PI * exp(-x * x) * (gamma + 3 * (1 - gamma) * P0**2)
            psi, _ = self._cumulative(
                np.where(rough, slope * (PI / 4 * square) / (2 * safe), mpfr(0)), width, 1
            )
            separation = PI / (2 * sigma) * np.sum(weight * real * np.where(rough, x * psi, mpfr(0)))
        if "shear" in case:
            friction = friction + self._shear(case, area)
        return area, friction, separation

    @staticmethod
    def _contact(sigma, g):
        rough = true(g > 0)
        return np.where(rough, erf(sigma / (2 * sqrt(np.where(rough, g, mpfr(1))))), mpfr(1))

    @staticmethod
    def _shear(case, area):
        shear, v = case["shear"], case["v"]
        shifted = shift_factor(shear.get("shift"), case.get("temperature")) * abs(v) / shear["v0"]
        bell = gmpy2.exp(-shear["c"] * gmpy2.log10(shifted) ** 2)
        return gmpy2.sign(v) * shear["tau_f0"] / case["pressure"] * area * bell

    def _cumulative(self, density, width, factor=PI / 4):
        """Integral up to every node, and up to the end."""
        _, weight, matrix = gauss(self.order)
        inside = factor * width[:, None] * (density @ matrix.T)
        ends = np.cumsum(factor * width * (density @ weight))
        return inside + np.concatenate([[mpfr(0)], ends[:-1]])[:, None], ends[-1]

    def _remember(self, key, make):
        """A few results, the least recently used forgotten first."""
        value = self.cache.pop(key) if key in self.cache else make()
        self.cache[key] = value
        while len(self.cache) > 40:
            del self.cache[next(iter(self.cache))]
        return value

    def _pieces(self, case):
        kinks = [kinks_of(case[psd]) for psd in ("psd1", "psd2")]
        return self._remember(("pieces", *kinks), lambda: self._cut(kinks)), tuple(kinks)

    def _cut(self, kinks):
        pieces = []
        for left, right in pairwise(sorted(set(kinks[0] + kinks[1]))):
            active = [own[0] <= left and right <= own[-1] for own in kinks]
            if any(active):
                # A piece that the case itself has not is a sliver, of width STEP.
                edges = self.edges.get((float(left), float(right)), (0.0, 1.0))
                pieces.append(Piece(left, right, active, edges, self.order))
        return pieces

    def _densities(self, case):
        """q^4 sum C <|F|^2>, q^4 sum C <cos Im F>, q^3 sum C <Re F>, and the panels' widths and weights."""
        pieces, kinks = self._pieces(case)
        parts = [[], [], []]
        for number, piece in enumerate(pieces):
            total = [piece.q * 0] * 3
            for psd, on, rough, other in zip(
                ("psd1", "psd2"), piece.active, ("solid1", "solid2"), ("solid2", "solid1"), strict=True
            ):
                if not on:
                    continue
                C = self._remember(
                    (psd, number, kinks, frozen(case[psd])),
                    lambda piece=piece, psd=psd: piece.q**3 * spectrum(case[psd], piece.q, piece.log_q),
                )
                how = (frozen(case[rough]), frozen(case[other]), case["v"], case.get("temperature"))
                means = self._remember(
                    ("means", number, kinks, how),
                    lambda piece=piece, rough=rough, other=other: angular_means(
                        case[rough], case[other], piece.q, case["v"], case.get("temperature")
                    ),
                )
                for i, factor in enumerate((C * piece.q, C * piece.q, C)):
                    total[i] = total[i] + factor * means[i]
            for part, values in zip(parts, total, strict=True):
                part.append(values)
        return (
            *(np.concatenate(part) for part in parts),
            np.concatenate([piece.width for piece in pieces]),
            np.concatenate([piece.weight for piece in pieces]),
        )

    def _lay_out(self, case):
        """Borders of the panels of every piece, from a coarse look at G."""
        kinks = [kinks_of(case[psd]) for psd in ("psd1", "psd2")]
        G = 0.0
        for left, right in pairwise(sorted(set(kinks[0] + kinks[1]))):
            length = float(gmpy2.log(right / left))
            t = np.linspace(0.0, length, max(6, int(length / 0.1)))
            points = np.array([mpfr(x) for x in t], object)
            q, log_q = left * exp(points), gmpy2.log(left) + points
            density = q * 0
            pairs = ((0, "solid1", "solid2"), (1, "solid2", "solid1"))
            for i, rough, other in pairs:
                if kinks[i][0] <= left and right <= kinks[i][-1]:
                    mean = angular_means(case[rough], case[other], q, case["v"], case.get("temperature"))[0]
                    C = spectrum(case[f"psd{i + 1}"], q, log_q)
                    density = density + PI / 4 * q**4 * C * mean / case["pressure"] ** 2
            logs = np.array([float(gmpy2.log(d)) if d > 0 else -700.0 for d in density])
            edges, G = self._march(t, logs, G, length)
            self.edges[float(left), float(right)] = tuple(x / length for x in edges)

    def _march(self, t, logs, G, length):
        edges = [0.0]
        here = 0.0
        while True:
            i = min(max(int(np.searchsorted(t, here, side="right")) - 1, 0), len(t) - 2)
            p = (logs[i + 1] - logs[i]) / (t[i + 1] - t[i])
            density = math.exp(min(logs[i] + p * (here - t[i]), 600.0))
            if G < 1.5e-3:  # P = 1 to 70 digits
                width = (1.5e-3 - G) / density if density > 0 else self.widest
            elif abs(p * G / density) < 1e-6:
                width = self.ratio * G / density
            else:
                share = p * G / density
                # where G = 0 if the density goes on like that to the left
                width = self.ratio * -math.log1p(-share) / p if share < 0.99 else self.widest
            width = min(width, self.widest)
            if here + 1.2 * width >= length:
                edges.append(length)
                width = length - here
            else:
                edges.append(here + width)
            growth = math.expm1(p * width) / p if abs(p * width) > 1e-9 else width
            G += density * growth
            here += width
            if edges[-1] == length:
                return edges, G


def frozen(value):
    """Something to look up a dictionary by."""
    if isinstance(value, dict):
        return tuple((key, frozen(item)) for key, item in sorted(value.items()))
    return tuple(map(frozen, value)) if isinstance(value, list) else value
