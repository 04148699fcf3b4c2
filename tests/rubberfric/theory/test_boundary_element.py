"""Published boundary-element runs, and the errors of both versions of G.

Elastic half-space on rigid self-affine roughness, H = 0.8, without roll-off, q1/q0 = 16, whose
numbers depend on p / (E* h') only, h' the rms slope.
"""

import numpy as np
import pytest

import rubberfric as rf

# Pressure over E* h': A/A0.
AREA = {0.005: 0.0121, 0.02: 0.0463, 0.1: 0.2089, 0.4: 0.6511}
# Mean separation over that at 0.005.
SEPARATION = {0.02: 0.688, 0.1: 0.288}

YOUNG = 2.0e6  # [Pa]
POISSON = 0.3  # [-]


def solve(gamma, quantity, corrected):
    """The quantity at every pressure of AREA."""
    road = rf.SelfAffine(1e3, 1e3, 1.6e4, 0.8, h_rms=2e-5)
    rubber = rf.Body(rf.Elastic(YOUNG, POISSON))
    scene = rf.Scene(rf.Body(rf.Rigid(), road), rubber, gamma, area_correction=corrected)
    stress = YOUNG / (1 - POISSON**2) * rf.rms_slope(road)
    return np.asarray(getattr(rf.solve(scene, 0.0, np.array(list(AREA)) * stress), quantity))


@pytest.mark.parametrize("gamma", [0.45, 0.5])
def test_area_with_the_elastic_energy_factor_in_G(gamma):
    np.testing.assert_allclose(solve(gamma, "area", True), list(AREA.values()), rtol=0.08)


def test_ratios_to_published_values():
    found = solve(0.45, "separation", False)
    np.testing.assert_allclose(found[1:3] / found[0], list(SEPARATION.values()), rtol=0.03)
    found = solve(0.45, "area", False) / np.array(list(AREA.values()))
    assert found[0] < 0.7
    assert (np.diff(found) > 0).all()
    assert found[-1] < 0.9
