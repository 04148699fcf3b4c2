"""Brute-force contact mechanics in NumPy: the measure that the library is held against.

Everything here follows the three lines of the theory literally and shares no code, no
closed form and no change of variables with the library: the complex modulus and the
series compliances at every angle, a panel quadrature over the angle, the cumulative
G(q) on panels halved 150 times towards every kink of the spectra, and the integral over
pressure done over pressure. About 1e-12 accurate, seconds a scene.

A scene is a plain dictionary, as in `reference/*.json`:

    solid1, solid2   {"kind": "rigid"}
                     {"kind": "elastic", "E", "nu"}
                     {"kind": "prony", "E_inf", "E", "tau", "nu"}
                     {"kind": "shear", "G_inf", "G", "tau", "bulk"}
                     {"kind": "table", "omega", "storage", "loss", "nu", "outside" ("fall", "hold", "none"),
                      "smoothing" (default 0.1)}
                     the last four also with "thickness" (null: half-space),
                     "base" ("bonded", "frictionless") and "shift", one of
                     {"kind": "wlf", "C1", "C2", "T_ref"}, {"kind": "arrhenius",
                     "energy", "T_ref"}, {"kind": "table", "T", "aT", "T_ref"}, each also with
                     "vertical": {"kind": "entropic", "expansion"} or {"kind": "table", "T", "bT"};
                     elastic and prony also with "coating": {"thickness", "base"}, a layer of
                     the solid on a half-space of another, "base", an elastic or prony solid;
                     a prony base without a shift has the layer's shift
    psd1, psd2       null, {"q0", "qr", "q1", "H", "h_rms"}, with "ratio" and "angle" if it is stretched,
                     or {"q", "C"}, with "angle" if C is a list of directions for each q, an odd number
    v, pressure, gamma, temperature (default none), area_correction (default false)
    softening        (default none) {"strain", "storage", "loss", "factor"}; a solid may have its own
"""

import functools
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq
from scipy.special import erf
from support.oracles.numerical import composite
from support.oracles.oracle_solids import Solid


def solve(case, halvings=150, order=12):
    """A/A0, mu and mean separation [m] of one scene; of anisotropic roughness also "transverse" friction."""
    found = state(case, halvings, order)
    names = ["area", "friction", "separation"]
    if any(case[psd] and "angle" in case[psd] for psd in ("psd1", "psd2")):
        names.append("transverse")
    return {name: found[name] for name in names}


def state(case, halvings=150, order=12, warm=(None, None), marks=()):
    """The quantities and their parts.

    warm : for each solid its temperature as a function of q, or None for the case's
    marks : wavevectors that must be borders of panels

    Besides the quantities: "q" of the nodes, "terms", the friction of every node by the roughness of
    either solid, and "within", A/A0 as a function of one of the marks.
    """
    sigma, gamma, v = case["pressure"], case["gamma"], case["v"]
    temperature = case.get("temperature")
    solids = [Solid(case[name], temperature) for name in ("solid1", "solid2")]
    spectra = [_Spectrum(case[name]) for name in ("psd1", "psd2")]
    softening = [case[name].get("softening", case.get("softening")) for name in ("solid1", "solid2")]
    for own in softening:
        marks = [*marks, *(strain_knots(own, spectra) if own else ())]
    # solids[i] sees the roughness of the other solid moving and its own at rest.
    weight, q, active = _radial_mesh(spectra, solids, v, halvings, order, marks)
    soft = [_softened(own, spectra, weight, q, active, order) for own in softening]
    square, odd, real, across = np.zeros((4, *q.shape))
    by_roughness = []
    for on, spectrum, moved in zip(active, spectra, (1, 0), strict=True):
        own = np.zeros(q.shape)
        if on.any():
            keys = np.stack(
                [q[on].ravel(), *(row[on].ravel() for i in (moved, 1 - moved) for row in soft[i])]
            )
            flat, back = np.unique(keys, axis=1, return_inverse=True)  # many graded nodes share one q
            T = [None if warm[i] is None else warm[i](flat[0]) for i in (moved, 1 - moved)]
            parts = _angular(solids[moved], solids[1 - moved], flat, v, order, T, spectrum.shape)
            for total, part in zip((square, odd, real, across), parts, strict=True):
                total[on] += spectrum(q[on]) * part[back.reshape(q[on].shape)]
            own[on] = spectrum(q[on]) * parts[1][back.reshape(q[on].shape)]
        by_roughness.append(own)
    if not q.size or not square.any():  # nothing rough, or no resistance: full contact
        nothing = {"area": 1.0, "friction": 0.0, "separation": 0.0, "transverse": 0.0}
        return nothing | {"q": q, "terms": np.zeros((2, *q.shape)), "within": lambda _: 1.0}
    area_element = q * q  # q dq = q^2 d ln q
    g = _cumulative(weight, 0.5 * area_element * square, order)  # G sigma^2 [Pa^2]
    g_end = np.sum(weight * 0.5 * area_element * square)
    if case.get("area_correction", False):
        flat = np.append(g.ravel(), g_end) / sigma**2
        corrected = corrected_G(flat, gamma) * sigma**2
        g_contact, g_contact_end = corrected[:-1].reshape(g.shape), corrected[-1]
    else:
        g_contact, g_contact_end = g, g_end
    with np.errstate(divide="ignore"):  # where a spectrum of no height comes first, g = 0 and P = 1
        P = erf(sigma / (2 * np.sqrt(g_contact)))
    S = gamma + (1 - gamma) * P**2
    terms = weight * area_element * q * S * P * np.array(by_roughness) / sigma
    transverse = np.sum(weight * area_element * q * S * P * across) / sigma
    separation = np.sum(weight * area_element * real * pressure_integral(sigma, g, gamma))

    def within(mark):
        g_mark = np.sum((weight * 0.5 * area_element * square)[q[:, -1] < mark])
        if case.get("area_correction", False) and g_mark > 0:
            g_mark = corrected_G(np.array([g_mark / sigma**2]), gamma)[0] * sigma**2
        return float(erf(sigma / (2 * np.sqrt(g_mark)))) if g_mark > 0 else 1.0

    return {
        "area": float(erf(sigma / (2 * np.sqrt(g_contact_end)))),
        "friction": float(np.sum(terms)),
        "separation": float(separation),
        "transverse": float(transverse),
        "q": q,
        "terms": terms,
        "within": within,
    }


def _softened(softening, spectra, weight, q, active, order):
    """Factors of storage and loss modulus at every node."""
    soft = np.ones((2, *q.shape))
    if softening and q.size:
        rough = sum(
            np.where(on[:, None], s(q), 0.0) for on, s in zip(active, spectra, strict=True) if on.any()
        )
        strain = softening.get("factor", 1.0) * np.sqrt(_cumulative(weight, 2 * np.pi * q**4 * rough, order))
        for row, name in zip(soft, ("storage", "loss"), strict=True):
            row[:] = np.interp(np.log(strain), np.log(softening["strain"]), softening[name])
    return soft


def pressure_integral(sigma, g, gamma):
    """int_sigma^inf dp / (2 p) d(S P)/dp with P = erf(p / (2 sqrt g)), over p in u = ln(p / sigma)."""
    out = np.empty(g.size)
    u01, w01 = composite(np.linspace(0, 1, 65))
    flat = g.ravel()
    for start in range(0, flat.size, 2000):
        # No roughness yet, no separation: as with a roughness so small that all underflows.
        root = 2 * np.sqrt(np.maximum(flat[start : start + 2000, None], 1e-20 * sigma**2))
        with np.errstate(over="ignore", under="ignore"):
            top = 0.5 * np.log1p(60 / (sigma / root) ** 2)
            p = sigma * np.exp(top * u01)
            P, dP = erf(p / root), 2 / np.sqrt(np.pi) * np.exp(-((p / root) ** 2)) / root
        out[start : start + 2000] = (0.5 * (gamma + 3 * (1 - gamma) * P**2) * dP) @ w01 * top[:, 0]
    return out.reshape(g.shape)


def corrected_G(g0, gamma):
    """G with dG/dg0 = S(P(G)), G(0) = 0: g0(G) = int dG / S by panels in ln G, inverted by Newton."""

    def inverse_S(G):
        P = erf(0.5 / np.sqrt(G))
        return 1 / (gamma + (1 - gamma) * P**2)

    def piece(left, right):  # int_left^right e^s / S(e^s) ds
        s, weight = composite(np.stack([left, right], -1), 20)
        return np.sum(np.exp(s) * inverse_S(np.exp(s)) * weight, -1)

    # S = 1 to rounding below G = 1e-2 (x = 5: erfc = 1e-12, and S' of it); start lower still.
    edges = np.linspace(np.log(2e-3), max(np.log(np.max(g0)) + 1, 0.0), 4001)
    table = np.exp(edges[0]) + np.concatenate([[0], np.cumsum(piece(edges[:-1], edges[1:]))])
    out = np.array(g0, float)
    late = out > table[0]
    target = out[late]
    k = np.clip(np.searchsorted(table, target) - 1, 0, edges.size - 2)
    s = edges[k]
    for _ in range(6):
        here = table[k] + piece(edges[k], s)
        s = s - (here - target) / (np.exp(s) * inverse_S(np.exp(s)))
    out[late] = np.exp(s)
    return out


class _Spectrum:
    def __init__(self, data):
        self.kinks = np.zeros(0)
        self.shape = None  # C(q, phi) / C(q)
        if data is None:
            return
        if "q" in data:
            self.kinks = np.array(data["q"], float)
            C = np.array(data["C"])
            if C.ndim == 2:
                self.shape = functools.partial(_table_shape, data)
                C = C.mean(1)
            logs = np.log(self.kinks), np.log(C)
            self._C = lambda q: np.exp(np.interp(np.log(q), *logs))
            return
        q0, qr, q1, H = data["q0"], data["qr"], data["q1"], data["H"]
        self.kinks = np.unique([q0, qr, q1])
        if "ratio" in data:
            self.shape = functools.partial(_stretched_shape, data)

        def shape(q):
            return np.where(q < qr, 1.0, (q / qr) ** (-2 * (1 + H)))

        # h_rms^2 = 2 pi int q C dq, by Gauss panels in ln q.
        total = 0.0
        for a, b in pairwise(self.kinks):
            t, weight = composite(np.linspace(0, np.log(b / a), 101), 20)
            q = a * np.exp(t)
            total += 2 * np.pi * np.sum(weight * q**2 * shape(q))
        C0 = data["h_rms"] ** 2 / total
        self._C = lambda q: C0 * shape(q)

    def __call__(self, q):
        return self._C(q)

    def covers(self, left, right):
        return self.kinks.size > 0 and self.kinks[0] <= left and right <= self.kinks[-1]


def _stretched_shape(data, _, phi):
    """D / <D> at every phi."""

    def D(phi):
        r, phi = data["ratio"], phi - data["angle"]
        return (r * np.cos(phi) ** 2 + np.sin(phi) ** 2 / r) ** -(1 + data["H"])

    return D(phi) / np.mean(D(2 * np.pi * np.arange(20000) / 20000))


def _table_shape(data, q, phi):
    """Linear in ln q, by Dirichlet's kernel in phi; of C / <C>."""
    C = np.array(data["C"])
    share, n = C / C.mean(1, keepdims=True), C.shape[1]
    total = 0.0
    for k in range(n):
        x = phi - data["angle"] - np.pi * k / n
        small = np.abs(np.sin(x)) < 1e-9
        kernel = np.where(
            small, np.cos(n * x) / np.cos(x), np.sin(n * x) / (n * np.where(small, 1.0, np.sin(x)))
        )
        total = total + np.interp(np.log(q), np.log(data["q"]), share[:, k]) * kernel
    return total


def strain_knots(softening, spectra):
    """Wavevectors where factor times the rms slope is an entry of the table."""
    kinks = np.unique(np.concatenate([s.kinks for s in spectra]))

    def square_slope(q):
        total = 0.0
        for a, b in pairwise(kinks):
            b = min(b, q)
            if b <= a:
                break
            nodes, weight = composite(np.linspace(a, b, 200), 20)
            C = sum(s(nodes) for s in spectra if s.covers(a, b))
            total += 2 * np.pi * np.sum(weight * nodes**3 * C)
        return total

    found = []
    for strain in softening["strain"]:
        target = (strain / softening.get("factor", 1.0)) ** 2
        if square_slope(kinks[0] * (1 + 1e-13)) < target < square_slope(kinks[-1]):
            span = (kinks[0] * (1 + 1e-13), kinks[-1])
            found.append(brentq(lambda q, y=target: square_slope(q) - y, *span, xtol=1e-300, rtol=1e-15))
    return found


def _radial_mesh(spectra, solids, v, halvings, order, marks=()):
    """Panels in ln q, halved towards each kink, as (weight, q, active).

    A knot omega_k of a tabulated modulus starts to matter at q = omega_k / v, like (q - q_k)^(3/2).
    """
    ends = np.concatenate([s.kinks for s in spectra])
    if ends.size:
        knots = np.concatenate([s.kinks for s in solids]) / abs(v) if v else np.zeros(0)
        knots = np.concatenate([knots, np.array(marks)])
        ends = np.concatenate([ends, knots[(knots > ends.min()) & (knots < ends.max())]])
    kinks = np.unique(ends)
    weight, q, active = [], [], [[], []]
    for a, b in pairwise(kinks):
        on = [s.covers(a, b) for s in spectra]
        if not any(on):
            continue
        length = np.log1p((b - a) / a)
        plain = np.linspace(0, length, int(np.ceil(length / 0.2)) + 1)
        edges = np.concatenate([[0.0], plain[1] * 0.5 ** np.arange(halvings, 0, -1), plain[1:]])
        nodes, weights = composite(np.stack([edges[:-1], edges[1:]], -1), order)
        weight.append(weights)
        q.append(a * np.exp(nodes))
        for j in (0, 1):
            active[j] += [on[j]] * len(nodes)
    if not q:
        return (np.zeros((0, order)),) * 2 + (np.zeros((2, 0), bool),)
    return np.concatenate(weight), np.concatenate(q), np.array(active)


def _cumulative(weight, density, order):
    """Integral of the density from the first q up to every node."""
    node, node_weight = np.polynomial.legendre.leggauss(order)
    k = np.arange(order)
    # Legendre coefficients of the interpolant, and the integral of every Legendre polynomial.
    to_coefficients = (k[:, None] + 0.5) * np.polynomial.legendre.legvander(node, order - 1).T * node_weight
    integrals = np.stack(
        [
            np.polynomial.legendre.legval(node, np.polynomial.legendre.legint(row, lbnd=-1))
            for row in np.eye(order)
        ]
    )
    matrix = integrals.T @ to_coefficients
    half = weight[:, :1] / node_weight[0]
    inside = half * (density @ matrix.T)
    total = np.sum(weight * density, axis=1)
    return inside + np.concatenate([[0.0], np.cumsum(total)[:-1]])[:, None]


def _angular(moved, resting, at, v, order, temperatures, shape):
    """int dphi of |K|^2, cos phi Im K, Re K, sin phi Im K; K = 1 / (M_moved(q v cos phi) + M_resting(0)).

    cos phi = sin psi, psi = (pi/2) e^-y: every relaxation time is one step on the y axis.

    at : q, and there f and g of the softening of the moved and of the resting solid
    temperatures : of the moved and the resting solid at every q, or None
    shape : C(q, phi) / C(q), or None: all under the integrals
    """
    q, *soft = at
    factor_m, factor_r = moved.factor(q), resting.factor(q)
    out = np.zeros((4, q.size))
    node, node_weight = np.polynomial.legendre.leggauss(order)
    for rows in np.array_split(np.arange(q.size), max(1, q.size // 200)):
        q_i = q[rows, None]
        edges = np.tile(np.arange(0.0, 42.0, 0.5), (rows.size, 1))
        T = [None if x is None else x[rows, None, None] for x in temperatures]
        soft_m, soft_r = np.reshape(soft, (2, 2, -1))[..., rows, None, None]
        if moved.kinks.size and v != 0:  # panel borders where q v cos phi meets a knot of the table
            kinks = moved.kinks if T[0] is None else moved.kinks * moved.a_T / moved.shift(T[0][..., 0])
            sine = np.minimum(kinks / (q_i * abs(v)), 1.0)
            at_kink = np.clip(-np.log(np.arcsin(sine) * 2 / np.pi), 0.0, edges[0, -1])
            edges = np.sort(np.concatenate([edges, at_kink], axis=1), axis=1)
        half = 0.5 * np.diff(edges)[:, :, None]
        y = edges[:, :-1, None] + half * (1 + node)
        psi = 0.5 * np.pi * np.exp(-y)
        cosine = np.sin(psi)
        measure = 4 * psi * half * node_weight
        q_i = q_i[:, :, None]
        M = moved.compliance(q_i, q_i * abs(v) * cosine, factor_m[rows, None, None], soft_m, T[0])
        M = M + resting.compliance(q_i, np.zeros(q_i.shape), factor_r[rows, None, None], soft_r, T[1])
        K = 1 / M
        even = measure
        if shape is not None:  # the four quarters of the circle; the measure has one
            phi = 0.5 * np.pi - psi
            quarters = [shape(q_i, x) for x in (phi, np.pi - phi, np.pi + phi, -phi)]
            even = 0.25 * measure * sum(quarters)
            # sin phi Im K(q v cos phi) changes sign with either sine or cosine.
            odd = 0.25 * measure * sum(x * y for x, y in zip((1, -1, 1, -1), quarters, strict=True))
            out[3, rows] = np.sign(v) * np.sum(odd * np.cos(psi) * K.imag, axis=(1, 2))
        out[0, rows] = np.sum(even * np.abs(K) ** 2, axis=(1, 2))
        out[1, rows] = np.sign(v) * np.sum(even * cosine * K.imag, axis=(1, 2))
        out[2, rows] = np.sum(even * K.real, axis=(1, 2))
    return out
