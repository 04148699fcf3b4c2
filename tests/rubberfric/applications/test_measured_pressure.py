"""Grip under a measured pressure: unloaded ends, and many scattered values."""

import jax.numpy as jnp
import numpy as np
import pytest

from rubberfric import MeasuredPressure, Patch
from rubberfric.applications import slip_stiffness
from rubberfric.applications.brush_model import brush

L, W, K, LOAD = 0.12, 0.15, 2e7, 3000.0
MEAN = LOAD / (L * W)


@pytest.mark.parametrize(("ahead", "behind"), [(2, 2), (3, 1), (0, 4)])
def test_zeros_at_the_ends_of_a_measured_pressure_are_outside_the_contact(ahead, behind):
    """Force, share and stiffness are those of a shorter patch, and the moment has another centre."""
    loaded, count = [150.0, 300.0, 200.0], 4 + ahead + behind
    padded = Patch(L, W, K, MeasuredPressure([0.0] * (1 + ahead) + loaded + [0.0] * (1 + behind)))
    length = L * 4 / count
    short = Patch(length, W, K, MeasuredPressure([0.0, *loaded, 0.0]))
    centre = L * (ahead + 2) / count - L / 2
    assert float(slip_stiffness(padded)) == pytest.approx(float(slip_stiffness(short)), rel=1e-14)
    for sigma in (1e-4, 0.02, -0.1, 3.0):
        for_patch = [
            brush(patch, jnp.asarray(sigma), LOAD / patch.area, jnp.full(8, 0.7)) for patch in (padded, short)
        ]
        (force, moment, sliding), (exact, exact_moment, share) = for_patch
        assert float(force) == pytest.approx(float(exact), rel=1e-12)
        assert float(sliding) == pytest.approx(float(share), rel=1e-10)
        assert float(moment) == pytest.approx(float(exact_moment + centre * exact), abs=1e-11 * LOAD * L)


@pytest.mark.parametrize("count", [44, 88, pytest.param(200, marks=pytest.mark.slow)])
def test_many_scattered_values_of_a_pressure(count):
    """The first crossing may lie at a narrow minimum; the force was up to 3 % off."""
    s = np.linspace(0, 1, count)
    for seed in range(6):
        noise = 1 + 0.1 * np.random.default_rng(seed).standard_normal(count)
        values = np.minimum(1.0, np.minimum(s, 1 - s) / 0.15) * noise
        patch = Patch(L, W, K, MeasuredPressure(values))
        at = (np.arange(200_000) + 0.5) / 200_000
        friction = 0.7 * MEAN * np.interp(at, s, values / np.trapezoid(values, s))
        for sigma in (0.005, 0.02, 0.05):
            stress = K * sigma * L * at
            stress = np.where(np.maximum.accumulate(stress > friction), friction, stress)
            force = brush(patch, jnp.asarray(sigma), jnp.asarray(MEAN), jnp.full(8, 0.7))[0]
            assert float(force) == pytest.approx(L * W * stress.mean(), rel=1e-6)
