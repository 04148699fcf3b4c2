"""The law of `contact_model="boundary_elements"` by an independent quadrature with errors of 1e-13."""

import numpy as np
from scipy import optimize, special
from support.oracles.numerical import composite

from rubberfric.theory.area.law_roughness import CONSTANTS


def friction_law(
    E_of, road, velocity, pressure, *, stiffer=np.ones_like, density=np.ones_like, step=0.06, per_e_fold=8
):
    """Return area and friction along and across, for E / (1 - nu^2) as a function of omega.

    Trapezoids in t, cos(phi) = 1 / cosh(t), up to t = 60, and Gauss panels in ln q, graded towards q0.
    The modulus is evaluated at every node, without interpolation.

    road : self-affine, the mean over the directions
    stiffer : ratio of the stiffnesses of a slab and a half-space, as a function of q
    density : C(q, phi) over its mean over phi
    """
    c = CONSTANTS
    q0, qr, q1, hurst, h_rms = (float(getattr(road, k)) for k in ("q0", "qr", "q1", "hurst", "h_rms"))
    t = step * np.arange(int(60 / step))
    dphi = 1 / np.cosh(t)
    dphi[0] /= 2
    dphi = np.tile(dphi / (2 * dphi.sum()), 2)
    t = np.append(t, -t)
    cosine, sine, phi = 1 / np.cosh(t), np.tanh(t), np.arctan(np.sinh(t))
    circle = np.linspace(0, np.pi, 2000, endpoint=False)
    full, light = (dphi * density(phi) ** x / np.mean(density(circle) ** x) for x in (1, 1 - c.c_g))
    e2 = abs(np.mean(density(circle) * np.exp(2j * circle)) / np.mean(density(circle))) ** 2

    end, roll = np.log(q1 / q0), np.log(qr / q0)
    even = [np.linspace(a, b, 2 + int((b - a) * per_e_fold)) for a, b in ((0.0, roll), (roll, end)) if b > a]
    graded = even[0][1] * 3.0 ** -np.arange(1, 31)
    x, dx = composite(np.unique(np.concatenate([*even, graded])))
    y, dy = composite(np.linspace(0, np.log(6), 9))
    q, beyond = q0 * np.exp(x), q1 * np.exp(y)
    falling = -2 * (1 + hurst)
    C, C_end = (np.exp(falling * np.maximum(x - roll, 0.0)) for x in (x, end))
    norm = h_rms**2 / (2 * np.pi * np.sum(q**2 * C * dx))
    C, C_end = norm * C, norm * C_end
    m0, m2, m4 = (2 * np.pi * np.sum(q ** (2 + n) * C * dx) for n in (0, 2, 4))
    log_alpha = np.log(m0 * m4 / m2**2)
    rise = 2 - 2 * hurst
    plateau = q0**4 * np.expm1(4 * np.minimum(x, roll)) / 4
    sloped = qr**4 * np.expm1(rise * np.maximum(x - roll, 0.0)) / rise
    F = norm * (plateau + sloped) / (m2 / (2 * np.pi))
    D, D_end = q**4 * C / (m2 / (2 * np.pi)), q1**4 * C_end / (m2 / (2 * np.pi))
    E, E_beyond = (E_of(k[:, None] * velocity * cosine) * stiffer(k)[:, None] for k in (q, beyond))
    log_E, log_E_beyond = np.log(np.abs(E)), np.log(np.abs(E_beyond))

    def weights(A):
        return A * full + (1 - A) * light

    def means(log_E, A):
        """Return ln E_g, ln E_r and ln E_h."""
        low = log_E.min(1, keepdims=True)
        squares = (np.exp(2 * log_E) @ weights(A), np.exp(2 * (low - log_E)) @ weights(A))
        return log_E @ weights(A), 0.5 * np.log(squares[0]), low[:, 0] - 0.5 * np.log(squares[1])

    N2 = c.c_n * np.log(F / D + 0.25) ** 2
    lightly = c.c_0 - c.c_D * np.log(D) + c.c_f * np.log(F) - N2 - c.c_e0 * e2
    heavily = c.h_0 - c.h_D * np.log(D) + c.h_F * np.log(F) - N2
    S_0 = (1 - 1 / (c.s_0 + c.s_alpha * log_alpha)) * (1 - c.c_eS * e2)

    def tail(A):
        above = c.c_T * A * (1 - A) * D_end**c.c_e * np.exp(-c.c_eT * e2)
        return above / ((1 + c.c_r * A) ** 2 * (1 + c.c_alpha * log_alpha))

    def bound(A):
        """Return -ln W_m."""
        B = 1 - A
        log_W = (np.log(A) + B**c.c_A * lightly + A * B * heavily) / B
        return np.logaddexp(0, -c.n * log_W) * B / c.n

    def log_effective(A):
        B = (1 - A) ** c.a
        here, there = D * np.exp(-bound(A)) * dx, c.k * D_end * tail(A) * dy
        total = 0.0
        for share, log in ((here, log_E), (there, log_E_beyond)):
            g, r, _ = means(log, A)
            total += np.sum(share * np.exp(2 * (B * g + (1 - B) * r)))
        return 0.5 * np.log(total / (here.sum() + there.sum()))

    def excess(log_A):
        A = np.exp(log_A)
        load = np.sqrt(2) * pressure / (np.exp(log_effective(A)) * np.sqrt(m2))
        return np.log(special.erf(load / np.sqrt(S_0 + (1 - S_0) * A**c.s))) - log_A

    nearly_full = -1e-12
    is_full = excess(nearly_full) > 0
    log_A = nearly_full if is_full else optimize.brentq(excess, -40, nearly_full, xtol=1e-14, rtol=1e-14)
    A = np.exp(log_A)
    B, E_eff = 1 - A, log_effective(A)
    _, r, h = means(log_E, A)
    h_beyond = means(log_E_beyond, A)[2]
    E_W = B**c.a * h + (1 - B**c.a) * r
    odds = -np.log(np.expm1(bound(A))) + (c.c_v * B + c.c_w * A) * (E_eff - E_W)
    W = special.expit(odds[:, None] + c.c_phi * B * (E_W[:, None] - log_E))
    heat = E_beyond.imag * np.exp(c.c_phi * (h_beyond[:, None] - log_E_beyond))
    decay = np.exp(-3 * y + c.c_b * (E_eff - h_beyond)) * dy
    forces = []
    for direction in (cosine, sine):
        inside = np.sum(q**4 * C * dx * ((E.imag * W) @ (weights(A) * direction)))
        outside = tail(A) * q1**4 * C_end * np.sum(decay * (heat @ (weights(A) * direction)))
        forces.append(np.pi / pressure * (inside + outside))
    return A, *forces
