"""The law by an independent quadrature with errors of 1e-13: random scenes, fast sliding, and tables."""

import numpy as np
import pytest
from scipy import interpolate
from support.oracles.friction_law import friction_law

import rubberfric as rf

TERMS = 5
ROBUST = rf.Quadrature()


def _prony(E_inf, E, tau, poisson):
    def of(omega):
        relaxing = sum(e * (1j * omega * t) / (1 + 1j * omega * t) for e, t in zip(E, tau, strict=True))
        return (E_inf + relaxing) / (1 - poisson**2)

    return of


def _errors(numbers, road, velocity, pressure, quadrature=ROBUST):
    """Return the relative errors of area and friction of a Prony scene."""
    E_inf, E, tau, poisson = numbers
    expected = friction_law(_prony(*numbers), road, velocity, pressure)[:2]
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

    expected = friction_law(modulus, road, velocity, 1e5, step=0.03, per_e_fold=16)[:2]
    np.testing.assert_allclose([found.area, found.friction], expected, rtol=1e-6)
