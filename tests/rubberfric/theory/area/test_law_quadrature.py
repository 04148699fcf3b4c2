"""The law by an independent quadrature with errors of 1e-13: random scenes, fast sliding, and tables."""

import numpy as np
import pytest
from scipy import interpolate, optimize, special

import rubberfric as rf
from rubberfric.theory.area.law_roughness import CONSTANTS

TERMS = 5
ROBUST = rf.Quadrature()


def _panels(edges, order=12):
    x, w = np.polynomial.legendre.leggauss(order)
    half = np.diff(edges) / 2
    return (edges[:-1, None] + half[:, None] * (1 + x)).ravel(), np.outer(half, w).ravel()


def _law(E_of, road, velocity, pressure, *, step=0.06, per_e_fold=8):
    """Return area and friction of self-affine roughness, for E / (1 - nu^2) as a function of omega.

    Trapezoids in t, cos(phi) = 1 / cosh(t), up to t = 60, and Gauss panels in ln q, graded towards q0.
    The modulus is evaluated at every node, without interpolation.
    """
    c = CONSTANTS
    q0, qr, q1, hurst, h_rms = (float(getattr(road, k)) for k in ("q0", "qr", "q1", "hurst", "h_rms"))
    t = step * np.arange(int(60 / step))
    cosine, dphi = 1 / np.cosh(t), 1 / np.cosh(t)
    dphi[0] /= 2
    dphi /= dphi.sum()
    end, roll = np.log(q1 / q0), np.log(qr / q0)
    even = [np.linspace(a, b, 2 + int((b - a) * per_e_fold)) for a, b in ((0.0, roll), (roll, end)) if b > a]
    graded = even[0][1] * 3.0 ** -np.arange(1, 31)
    x, dx = _panels(np.unique(np.concatenate([*even, graded])))
    y, dy = _panels(np.linspace(0, np.log(6), 9))
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
    E, E_beyond = (E_of(k[:, None] * velocity * cosine) for k in (q, beyond))

    def means(E):
        """Return ln E_g, ln E_r and ln E_h."""
        log_E = np.log(np.abs(E))
        low = log_E.min(1, keepdims=True)
        squares = (np.exp(2 * log_E) @ dphi, np.exp(2 * (low - log_E)) @ dphi)
        return log_E @ dphi, 0.5 * np.log(squares[0]), low[:, 0] - 0.5 * np.log(squares[1])

    (g, r, h), (g_beyond, r_beyond, h_beyond) = means(E), means(E_beyond)
    N2 = c.c_n * np.log(F / D + 0.25) ** 2
    light = c.c_0 - c.c_D * np.log(D) + c.c_f * np.log(F) - N2
    heavy = c.h_0 - c.h_D * np.log(D) + c.h_F * np.log(F) - N2
    S_0 = 1 - 1 / (c.s_0 + c.s_alpha * log_alpha)

    def tail(A):
        return c.c_T * A * (1 - A) * D_end**c.c_e / ((1 + c.c_r * A) ** 2 * (1 + c.c_alpha * log_alpha))

    def bound(A):
        """Return -ln W_m."""
        B = 1 - A
        log_W = (np.log(A) + B**c.c_A * light + A * B * heavy) / B
        return np.logaddexp(0, -c.n * log_W) * B / c.n

    def log_effective(A):
        B = (1 - A) ** c.a
        here, there = D * np.exp(-bound(A)) * dx, c.k * D_end * tail(A) * dy
        squares = np.sum(here * np.exp(2 * (B * g + (1 - B) * r)))
        squares += np.sum(there * np.exp(2 * (B * g_beyond + (1 - B) * r_beyond)))
        return 0.5 * np.log(squares / (here.sum() + there.sum()))

    def excess(log_A):
        A = np.exp(log_A)
        load = np.sqrt(2) * pressure / (np.exp(log_effective(A)) * np.sqrt(m2))
        return np.log(special.erf(load / np.sqrt(S_0 + (1 - S_0) * A**c.s))) - log_A

    full = -1e-12
    log_A = full if excess(full) > 0 else optimize.brentq(excess, -40, full, xtol=1e-14, rtol=1e-14)
    A = np.exp(log_A)
    B, E_eff = 1 - A, log_effective(A)
    E_W = B**c.a * h + (1 - B**c.a) * r
    odds = -np.log(np.expm1(bound(A))) + (c.c_v * B + c.c_w * A) * (E_eff - E_W)
    W = special.expit(odds[:, None] + c.c_phi * B * (E_W[:, None] - np.log(np.abs(E))))
    inside = np.sum(q**4 * C * dx * ((E.imag * W) @ (cosine * dphi)))
    heat = (E_beyond.imag * np.exp(c.c_phi * (h_beyond[:, None] - np.log(np.abs(E_beyond))))) @ (
        cosine * dphi
    )
    outside = tail(A) * q1**4 * C_end * np.sum(np.exp(-3 * y + c.c_b * (E_eff - h_beyond)) * heat * dy)
    return A, np.pi / pressure * (inside + outside)


def _prony(E_inf, E, tau, poisson):
    def of(omega):
        relaxing = sum(e * (1j * omega * t) / (1 + 1j * omega * t) for e, t in zip(E, tau, strict=True))
        return (E_inf + relaxing) / (1 - poisson**2)

    return of


def _errors(numbers, road, velocity, pressure, quadrature=ROBUST):
    """Return the relative errors of area and friction of a Prony scene."""
    E_inf, E, tau, poisson = numbers
    expected = _law(_prony(*numbers), road, velocity, pressure)
    # Equal numbers of terms need one compilation: the last term is divided.
    parts = TERMS - len(E) + 1
    E, tau = [*E[:-1], *[E[-1] / parts] * parts], [*tau, *[tau[-1]] * (parts - 1)]
    rubber, rigid = rf.Body(rf.Prony(E_inf, E, tau, poisson)), rf.Body(rf.Rigid(), road)
    scene = rf.Scene(rubber, rigid, contact_model="boundary_elements", quadrature=quadrature)
    found = rf.solve(scene, velocity, pressure, quantities=("area", "friction"))
    return abs(np.array([found.area, found.friction]) / expected - 1)


@pytest.mark.parametrize(
    ("ratio", "velocity"), [(1e3, 1.0), (1e4, 0.01), (1e4, 1.0), (1e3, 10.0), (1e4, 100.0), (3.0, 0.1)]
)
def test_one_relaxation_time(ratio, velocity):
    """<1/|E|^2> comes from a small part of the circle if sliding is fast."""
    road = rf.SelfAffine(100.0, 300.0, 3e4, 0.8, 1e-4)
    errors = _errors((1e6, [1e6 * ratio], [1.0], 0.5), road, velocity, 1e5)
    assert errors[0] < 1e-9 and errors[1] < 2e-8


def _random_scene(seed):
    """Return a random material with 1 to 5 terms, roughness, velocity and pressure."""
    rng = np.random.default_rng(seed)
    terms = 1 + seed % TERMS
    shares = rng.dirichlet(np.ones(terms))
    E_inf = 10 ** rng.uniform(5, 7)
    E, tau = E_inf * 10 ** rng.uniform(0, 4) * shares, 10 ** rng.uniform(-6, 1, terms)
    q0 = 10 ** rng.uniform(1, 4)
    qr, q1 = q0 * 10 ** rng.uniform(0.01, 1), q0 * 10 ** rng.uniform(1.2, 3)
    road = rf.SelfAffine(q0, qr, q1, rng.uniform(0.3, 0.99), 1.0)
    road = road.replace(h_rms=10 ** rng.uniform(-1.5, 0.5) / float(rf.rms_slope(road)))
    velocity = 10 ** rng.uniform(-6, 2)
    numbers = E_inf, E, tau, rng.uniform(0.3, 0.5)
    stiffness = abs(_prony(*numbers)(np.array(0.3 * q1 * velocity))) * float(rf.rms_slope(road))
    return numbers, road, velocity, stiffness * 10 ** rng.uniform(-3, -0.3)


@pytest.mark.parametrize("seed", range(5))
def test_random_scenes(seed):
    assert np.all(_errors(*_random_scene(seed)) < 1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("quadrature", [ROBUST, None], ids=["robust", "default"])
def test_sixty_random_scenes(quadrature):
    """1 to 5 terms, ratios of moduli up to 1e4, eight decades of velocity."""
    errors = np.array([_errors(*_random_scene(seed), quadrature) for seed in range(100, 160)])
    print("\nlargest errors of area and friction", errors.max(0), "median", np.median(errors, 0))
    for seed, (area, friction) in enumerate(errors, 100):
        assert area < 1e-7 and friction < 1e-7, f"seed {seed}: {area:.1e}, {friction:.1e}"


@pytest.mark.parametrize("velocity", [1e-3, 10.0])
def test_jagged_table(velocity):
    """Entries of a table with a noise of 20 %."""
    rng = np.random.default_rng(0)
    omega, tau = np.logspace(-4, 8, 37), np.logspace(-6, 2, 9)
    E = _prony(1e6, np.geomspace(1e8, 1e6, 9), tau, 0.0)(omega)
    storage, loss = (x * np.exp(0.2 * rng.normal(size=37)) for x in (E.real, E.imag))
    table = rf.TabulatedModulus(omega, storage, loss, poisson=0.5)
    road = rf.SelfAffine(100.0, 300.0, 3e4, 0.8, 1e-4)
    scene = rf.Scene(rf.Body(table), rf.Body(rf.Rigid(), road), contact_model="boundary_elements")
    found = rf.solve(scene, velocity, 1e5, quantities=("area", "friction"))
    # Values on a grid of a 50th of the smoothing width, because direct evaluations take a minute.
    log_omega = np.linspace(np.log(1e-25), np.log(1e9), 40_000)
    fine = np.log(np.asarray(rf.complex_modulus(table, np.exp(log_omega))) / 0.75)
    curve = interpolate.CubicSpline(log_omega, fine)

    def modulus(omega):
        return np.exp(curve(np.log(np.maximum(omega, 1e-25))))

    expected = _law(modulus, road, velocity, 1e5, step=0.03, per_e_fold=16)
    np.testing.assert_allclose([found.area, found.friction], expected, rtol=1e-6)
