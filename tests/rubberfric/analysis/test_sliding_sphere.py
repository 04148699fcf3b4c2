"""Boundary elements of a sphere that slides on a viscoelastic half-space.

Published values: Carbone & Putignano, J. Mech. Phys. Solids 61 (2013), figure 12, for one relaxation time.
The tests of SlipPY (https://github.com/FrictionTribologyEnigma/SlipPY, MIT) have three points of this figure.
"""

import math

import numpy as np
import pytest

import rubberfric as rf
from rubberfric.analysis.boundary_elements import sliding_contact

RADIUS = 0.01  # [m]
FORCE = 0.15  # [N]
TAU = 1e-3  # [s]
SOFT = 1e6  # E(0) [Pa]
STIFFENING = 9.0  # (E(inf) - E(0)) / E(0)
MATERIAL = rf.Prony(SOFT, [STIFFENING * SOFT], [TAU], poisson=0.3)
CONTACT_RADIUS = (0.75 * FORCE * RADIUS * (1 - 0.3**2) / SOFT) ** (1 / 3)  # at rest [m]
PUBLISHED = np.array([(0.1063, 0.00851), (1.169, 0.04028), (7.943, 0.01587)])  # v 0.01 s / contact radius; mu


def friction(velocity, grid, periods):
    """Return the friction coefficient from the pressure and from the heat; `periods` is in contact radii."""
    length = periods * CONTACT_RADIUS
    s = (np.arange(grid) - grid // 2) * length / grid
    x, y = np.meshgrid(s, s, indexing="ij")
    heights = -(x**2 + y**2) / (2 * RADIUS)
    found = sliding_contact(heights, length, MATERIAL, velocity, FORCE / length**2, most_steps=4000)
    assert found.converged
    return float(np.sum(found.pressure * -x / RADIUS) / np.sum(found.pressure)), found.friction_of_heat


def test_slow_sliding_in_closed_form():
    """To first order in v, Hertz's pressure gives mu = v tau / R (E(inf) - E(0)) / E(0)."""
    mu, of_heat = (np.array(value) for value in friction(1e-4, 128, 6))
    assert mu * RADIUS / (1e-4 * TAU) == pytest.approx(STIFFENING, rel=0.015)
    assert of_heat == pytest.approx(mu, rel=0.01)


@pytest.mark.slow
def test_against_published_friction():
    """Friction is within 5 % of the published values at all three velocities."""
    x, published = PUBLISHED.T
    velocity = x * CONTACT_RADIUS / 0.01
    found = {
        (grid, periods): np.array([friction(v, grid, periods)[0] for v in velocity]) / published
        for grid, periods in ((512, 12), (512, 24), (1024, 24), (1024, 48))
    }
    for (grid, periods), ratio in found.items():
        print(f"\n{grid} x {grid} points, period of {periods} contact radii: {ratio.round(3)}", end="")
    # The first order in the velocity alone, an upper bound in slow sliding.
    first_order = STIFFENING * velocity[0] * TAU / RADIUS
    assert published[0] < found[1024, 48][0] * published[0] < first_order
    assert np.allclose(found[1024, 48], 1.0, atol=0.05)
    assert np.allclose(found[512, 24], found[1024, 24], rtol=2e-3)
    # Fast sliding needs the longest period, because the solid relaxes over several contact radii.
    assert math.log(found[512, 12][2]) < 2.5 * math.log(found[512, 24][2]) < 0
