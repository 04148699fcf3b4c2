"""Area and elastic energy of contact against published Green's function molecular dynamics.

Their areas count points of the grid. In boundary elements this is 7 % more at light load than the area
corrected for the perimeter, to which the law was fitted.
"""

import numpy as np
import pytest
import scipy.special
from support.published import needs, outside

import rubberfric as rf

TABLE = outside("gfmd") / "gfmd_area_energy.csv"
pytestmark = needs("gfmd")
MODULUS = 1e9  # E / (1 - nu^2) [Pa]


def scene(**options):
    """Return the contact of the simulation: q0 = q_r = 1e4 and q1 = 1e6 1/m, H = 0.8, h_rms = 6 um."""
    rigid = rf.Body(rf.Rigid(), rf.SelfAffine(1e4, 1e4, 1e6, 0.8, 6e-6))
    return rf.Scene(rf.Body(rf.Elastic(MODULUS, 0.0)), rigid, **options)


@pytest.mark.parametrize(
    ("options", "least", "most"),
    [
        ({"area_correction": True}, 0.02, 0.03),
        ({"contact_model": "boundary_elements"}, 0.02, 0.08),
        ({}, 0.15, 0.20),
    ],
    ids=["S in G", "law", "paper"],
)
def test_area_at_17_loads(options, least, most):
    load, area = np.loadtxt(TABLE, delimiter=",", skiprows=2, usecols=(0, 1)).T
    error = np.asarray(rf.contact_area(scene(**options), 0.0, MODULUS * load)) / area - 1
    print(f"\nrms {np.sqrt(np.mean(error**2)):.1%}, {error.min():+.1%} ... {error.max():+.1%}")
    assert least < np.sqrt(np.mean(error**2)) < most


def direct_energy(load, weight):
    """U/A = (pi/2) E* int q^2 w(P) C dq with w = S P and P = erf(p / (2 sqrt G)): trapezoidal rule."""
    x = np.append(0.0, np.geomspace(1e-10, np.log(100.0), 4000))  # ln q/q0; P falls steeply at q0
    q = 1e4 * np.exp(x)
    C = q**-3.6
    C *= 6e-6**2 / (2 * np.pi * np.trapezoid(q**2 * C, x))
    slope = np.pi / 4 * q**4 * C
    G = np.append(0.0, np.cumsum(np.diff(x) * (slope[1:] + slope[:-1]) / 2))
    with np.errstate(divide="ignore"):
        P = scipy.special.erf(load[:, None] / (2 * np.sqrt(G)))
    return np.pi / 2 * np.trapezoid(q**3 * C * weight(P), x)


@pytest.mark.parametrize(
    ("gamma", "lightest", "others"), [(0.5, 0.803, 0.150), (0.35, 0.26, 0.037)], ids=["default", "best"]
)
def test_elastic_energy_at_17_loads(gamma, lightest, others):
    """The energy is the work of the load: dU = -p du, with du/dp from the stiffness of the contact.

    With the default gamma the theory stores too much energy in partial contact, most at the lightest load.
    There, the energy of single surfaces has a standard deviation of 42 %.
    """
    load, energy, deviation = np.loadtxt(TABLE, delimiter=",", skiprows=2, usecols=(0, 3, 4)).T
    assert deviation[0] / energy[0] == pytest.approx(0.42, abs=0.005)
    node, weight = (table / 2 for table in np.polynomial.legendre.leggauss(40))
    p = MODULUS * load[:, None] * (node + 0.5)
    stiffness = rf.analysis.contact_stiffness(scene(gamma=gamma), 0.0, p)
    work = p / np.asarray(stiffness) @ weight * load
    np.testing.assert_allclose(
        work, direct_energy(load, lambda P: P * (gamma + (1 - gamma) * P**2)), rtol=2e-3
    )
    error = work / energy - 1
    rms = np.sqrt(np.mean(error[1:] ** 2))
    print(f"\ngamma {gamma}: {error[0]:+.1%} at the lightest load, rms {rms:.1%} at the others")
    assert error[0] == pytest.approx(lightest, abs=0.01) and rms == pytest.approx(others, abs=0.002)
    assert 0.005 < error[-1] < 0.01
    full = float(rf.analysis.full_contact_energy(scene(), 0.0)) / MODULUS
    assert work[-1] == pytest.approx(full, rel=1e-3)


@pytest.mark.parametrize(
    ("form", "lightest", "others"),
    [
        (lambda P: P * (0.42 - 2 / 9 * P**2 + (11 / 9 - 0.42) * P**4), 0.51, 0.061),
        (lambda P: P * (5 / 9 + 2 / 9 * P**2 + 2 / 9 * P**4), 1.0, 0.185),
    ],
    ids=["0.42 - 2/9 P^2 + ...", "5/9 + 2/9 P^2 + ..."],
)
def test_other_forms_of_the_energy_factor(form, lightest, others):
    """Polynomials with P^4 are no closer than gamma = 0.35, so the theory keeps its form of S."""
    load, energy = np.loadtxt(TABLE, delimiter=",", skiprows=2, usecols=(0, 3)).T
    error = direct_energy(load, form) / energy - 1
    rms = np.sqrt(np.mean(error[1:] ** 2))
    assert error[0] == pytest.approx(lightest, abs=0.01) and rms == pytest.approx(others, abs=0.002)
