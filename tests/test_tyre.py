"""A measured tyre compound against the established commercial program (linear case).

The data lie beside the project, not in it; without them there is nothing to compare with.
"""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import rubberfric as rf

TYRE = Path(__file__).parents[2] / "shared" / "data" / "tyre"
PRESSURE, GAMMA, Q1 = 0.3e6, 0.578, 1.017e6  # [Pa], [-], [1/m]: inferred conditions of the program's run

pytestmark = pytest.mark.skipif(not TYRE.is_dir(), reason="no measured tyre data beside the project")


def read(name):
    return np.loadtxt(TYRE / name, delimiter=",", skiprows=2).T


def road():
    q, C = read("psd_asphalt.csv")
    kept = q < Q1
    end = np.exp(np.interp(np.log(Q1), np.log(q), np.log(C)))
    return rf.TabulatedSpectrum(np.append(q[kept], Q1), np.append(C[kept], end))


def scene():
    f, storage, loss = read("master_curve_R00.csv")
    rubber = rf.TabulatedModulus(2 * np.pi * f, storage, loss, poisson=0.5)
    return rf.Scene(rf.Body(rubber), rf.Body(rf.Rigid(), road()), gamma=GAMMA, area_correction=True)


def test_friction_and_area_follow_the_program():
    log_v, mu, area = read("program_linear_R00.csv")
    ours = rf.solve(scene(), 10**log_v, PRESSURE, quantities=("area", "friction"))
    for name, value, program, level in (
        ("friction", ours.friction, mu, 0.014),
        ("area", ours.area, area, 0.018),
    ):
        error = np.log(np.asarray(value) / program)
        assert error.std() < 0.007, f"{name}: shape is off by {error.std():.2%}"
        assert abs(error.mean()) < 0.02, f"{name}: level is off by {error.mean():.2%}"
        # Exact integrals lie this much above the program's coarse rule; closer would be luck.
        assert error.mean() == pytest.approx(level, abs=0.002)


def test_gradients_of_the_real_scene_are_finite():
    gradient = jax.grad(lambda s: jnp.sum(rf.friction(s, np.logspace(-5, 1, 7), PRESSURE)))(scene())
    for leaf in jax.tree_util.tree_leaves(gradient):
        assert bool(jnp.all(jnp.isfinite(leaf)))
    by_storage, by_loss = gradient.lower.material.storage, gradient.lower.material.loss
    assert float(jnp.sum(by_loss * scene().lower.material.loss)) > 0
    assert bool(jnp.any(by_storage != 0))


@pytest.mark.parametrize("compound", ["R00", "R20", "R40"])
def test_shift_tables_of_all_compounds_are_accepted(compound):
    celsius, factor = read(f"shift_factor_{compound}.csv")
    kelvin = celsius + 273.15
    f, storage, loss = read(f"master_curve_{compound}.csv")
    shift = rf.TabulatedShift(kelvin, factor, T_ref=293.15)
    rubber = rf.TabulatedModulus(2 * np.pi * f, storage, loss, shift=shift)
    cold, warm = rf.friction(
        rf.Scene(rf.Body(rubber), rf.Body(rf.Rigid(), road())), 1e-3, PRESSURE, np.array([283.15, 313.15])
    )
    assert np.isfinite(cold) and np.isfinite(warm) and cold != warm


def test_little_of_the_friction_comes_from_outside_the_table():
    crawling, slow, middle = rf.friction_outside_table(scene(), np.array([1e-12, 1e-5, 1e-2]), PRESSURE)
    assert abs(slow) < 0.02 and abs(middle) < 0.02
    assert crawling > 0.5
