"""Area of elastic contact against Green's function molecular dynamics that others have published.

Their areas count points of the grid. In boundary elements this is 7 % more at light load than the area
corrected for the perimeter, to which the law was fitted.
"""

import numpy as np
import pytest
from support.folders import PUBLIC

import rubberfric as rf

TABLE = PUBLIC / "gfmd" / "gfmd_area_energy.csv"


@pytest.mark.skipif(not TABLE.exists(), reason="the public data are not beside the project")
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
    """E / (1 - nu^2) = 1 GPa, q0 = q_r = 1e4 and q1 = 1e6 1/m, H = 0.8, h_rms = 6 um."""
    load, area = np.loadtxt(TABLE, delimiter=",", skiprows=2, usecols=(0, 1)).T
    rigid = rf.Body(rf.Rigid(), rf.SelfAffine(1e4, 1e4, 1e6, 0.8, 6e-6))
    scene = rf.Scene(rf.Body(rf.Elastic(1e9, 0.0)), rigid, **options)
    error = np.asarray(rf.contact_area(scene, 0.0, 1e9 * load)) / area - 1
    print(f"\nrms {np.sqrt(np.mean(error**2)):.1%}, {error.min():+.1%} ... {error.max():+.1%}")
    assert least < np.sqrt(np.mean(error**2)) < most
