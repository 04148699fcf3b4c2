"""Area and elastic energy of contact against published Green's function molecular dynamics.

Their areas count points of the grid. In boundary elements this is 7 % more at light load than the area
corrected for the perimeter, to which the law was fitted.
"""

import numpy as np
import pytest
from support.folders import PUBLIC

import rubberfric as rf

TABLE = PUBLIC / "gfmd" / "gfmd_area_energy.csv"
pytestmark = pytest.mark.skipif(not TABLE.exists(), reason="the public data are not beside the project")
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


def test_elastic_energy_at_17_loads():
    """The energy is the work of the load: dU = -p du, with du/dp from the stiffness of the contact.

    The theory stores too much energy in partial contact: 80 % at the lightest load, and less at higher loads.
    """
    load, energy = np.loadtxt(TABLE, delimiter=",", skiprows=2, usecols=(0, 3)).T
    node, weight = (table / 2 for table in np.polynomial.legendre.leggauss(40))
    p = MODULUS * load[:, None] * (node + 0.5)
    work = p / np.asarray(rf.analysis.contact_stiffness(scene(), 0.0, p)) @ weight * load
    error = work / energy - 1
    print(f"\nrms {np.sqrt(np.mean(error**2)):.1%}, {error.min():+.1%} ... {error.max():+.1%}")
    assert 0.75 < error[0] < 0.85 and np.all(np.diff(error[:13]) < 0)
    assert 0.005 < error[-1] < 0.01
    full = float(rf.analysis.full_contact_energy(scene(), 0.0)) / MODULUS
    assert work[-1] == pytest.approx(full, rel=1e-3)
