"""A measured tyre compound against the established commercial program (linear case).

The data lie outside the project; tests are skipped without them.
"""

import itertools
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.cases.stored import slow_if
from support.published import needs
from support.scenes.tyre import GAMMA, PRESSURE, read, road, rubber

import rubberfric as rf

pytestmark = needs("tyre")


def scene():
    return rf.Scene(rf.Body(rubber("R00")), rf.Body(rf.Rigid(), road()), gamma=GAMMA, area_correction=True)


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


@pytest.mark.slow
def test_gradients_of_the_real_scene_are_finite():
    gradient = jax.jit(jax.grad(lambda s: jnp.sum(rf.friction(s, np.logspace(-5, 1, 7), PRESSURE))))(scene())
    for leaf in jax.tree_util.tree_leaves(gradient):
        assert bool(jnp.all(jnp.isfinite(leaf)))
    by_storage, by_loss = gradient.lower.material.storage, gradient.lower.material.loss
    assert float(jnp.sum(by_loss * scene().lower.material.loss)) > 0
    assert bool(jnp.any(by_storage != 0))


@pytest.mark.parametrize("compound", slow_if(lambda name: name != "R00", ["R00", "R20", "R40"]))
def test_shift_tables_of_all_compounds_are_accepted(compound):
    one = rf.Scene(rf.Body(rubber(compound, shifted=True)), rf.Body(rf.Rigid(), road()))
    cold, warm = rf.friction(one, 1e-3, PRESSURE, np.array([283.15, 313.15]))
    assert np.isfinite(cold) and np.isfinite(warm) and cold != warm


@pytest.mark.slow
def test_little_of_the_friction_comes_from_outside_the_table():
    crawling, slow, middle = rf.analysis.friction_outside_table(
        scene(), np.array([1e-12, 1e-5, 1e-2]), PRESSURE
    )
    assert abs(slow) < 0.02 and abs(middle) < 0.02
    assert crawling > 0.5


HOT_V = np.logspace(-4, 1, 6)
HOT_T = 293.35  # [K]; an entry of the table of shifts lies at 293.344


def measured(compound, heated, softened):
    """Tables of modulus, shift, road and softening with contact shear, as a laboratory would fit them."""
    return rf.Scene(
        rf.Body(rubber(compound, shifted=True)),
        rf.Body(rf.Rigid(), road(1.05e5)),
        shear=rf.ContactShear(5e6, 0.1, 1e-3),
        heating=rf.Heating(1200.0, 1600.0, 0.23, 2e-3) if heated else None,
        softening=rf.Softening(*read("strain_softening_R00.csv")) if softened else None,
    )


@pytest.mark.parametrize(
    ("compound", "heated", "softened"), list(itertools.product(("R20", "R40"), (False, True), (False, True)))
)
@pytest.mark.slow
def test_every_derivative_of_tables_is_that_of_the_values(compound, heated, softened):
    """With respect to every field of the scene, its entries by random shares; pressure and temperature."""
    call = jax.tree.map(np.asarray, (measured(compound, heated, softened), PRESSURE, HOT_T))
    leaves, structure = jax.tree.flatten(call)
    rng = np.random.default_rng(0)
    # Entries must stay in order, and temperatures on their side of the entry beside them.
    shares = []
    for leaf in leaves:
        gap = np.min(np.abs(np.diff(leaf) / leaf[1:])) if leaf.ndim and np.all(np.diff(leaf) > 0) else 10.0
        shares.append(min(1.0, 0.1 * gap) * rng.uniform(0.2, 1, leaf.shape))
        if leaf.ndim == 0 and 200 < leaf < 400:
            shares[-1] = np.asarray(1e-4)

    def friction(step):
        moved = [x * jnp.exp(a * share) for x, a, share in zip(leaves, step, shares, strict=True)]
        scene, pressure, temperature = jax.tree.unflatten(structure, moved)
        return rf.friction(scene, HOT_V, pressure, temperature)

    # Where flash temperatures move past an entry of the shift its slope changes.
    none, one, h = np.zeros(len(leaves)), np.eye(len(leaves)), 2e-5 if heated else 1e-3
    forward, reverse = (jax.jit(slopes(friction))(none) for slopes in (jax.jacfwd, jax.jacrev))
    values = jax.jit(lambda steps: jax.lax.map(friction, steps))
    weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
    difference = sum(w / h * (values(k * h * one) - values(-k * h * one)) for k, w in weights.items()).T
    mu = np.asarray(friction(none))[:, None]
    for slopes in (forward, reverse):
        assert (np.abs(slopes - difference) <= 1e-7 * np.maximum(mu, np.abs(difference))).all()


COMPOUND_V = np.logspace(-5, 2, 15)
COMPOUND_T = np.array([283.15, 333.15])  # cold and hot


def wlf(name):
    """WLF through a table of shift factors: flash temperatures lie above its end."""
    celsius, factor = read(name)
    away, log = celsius - 20, np.log10(factor)
    far = np.abs(away) > 5
    # log a_T (C2 + T - T_ref) = -C1 (T - T_ref), linear in the constants.
    C1, C2 = np.linalg.lstsq(np.stack([away, log], 1)[far], -(log * away)[far], rcond=None)[0]
    return rf.WLF(C1, C2, T_ref=293.15)


@pytest.fixture(scope="module")
def compound():
    """Solutions [temperature, velocity] of the compound as measured, softening, heated, and both."""
    strain, f, g = read("strain_softening_R00.csv")
    shifted = replace(scene().lower.material, shift=wlf("shift_factor_R00.csv"))
    rough = rf.with_cutoff(road(), rms_slope=1.3)
    linear = replace(scene(), lower=rf.Body(shifted), upper=rf.Body(rf.Rigid(), rough))
    softening = rf.Softening(strain, f, g)
    heating = rf.Heating(density=1200.0, heat_capacity=1600.0, conductivity=0.23, radius=2e-3)
    scenes = {
        "linear": linear,
        "softening": replace(linear, softening=softening),
        "heating": replace(linear, heating=heating),
        "both": replace(linear, softening=softening, heating=heating),
    }
    return {
        name: rf.solve(
            one,
            COMPOUND_V,
            PRESSURE,
            COMPOUND_T[:, None],
            quadrature=rf.Quadrature(order=8, panels=8, graded=3, ratio=6.0, angular_order=8),
            quantities=rf.quantities_of(one),
        )
        for name, one in scenes.items()
    }


@pytest.mark.slow
def test_the_compound_with_softening_and_heating(compound):
    linear, soft, hot, both = (compound[name] for name in ("linear", "softening", "heating", "both"))
    for one in compound.values():
        assert (np.asarray(one.friction) > 0).all() and (np.asarray(one.friction) < 3).all()
        assert (np.asarray(one.area) > 0).all() and (np.asarray(one.area) < 1).all()
    # Softer rubber touches more; so does warmer rubber.
    assert (soft.area > linear.area).all() and (both.area > hot.area).all()
    assert (hot.area > linear.area * (1 - 1e-4)).all()  # a tabulated modulus is not integrated closer
    for one in (hot, both):
        rise = np.asarray(one.flash_temperature) - COMPOUND_T[:, None]
        assert one.converged.all()
        assert (np.diff(rise, axis=1) > 0).all()
        assert rise[:, 0].max() < 2.0 and 10 < rise[:, -1].max() < 150.0
    # Crawling is isothermal; fast sliding on the glassy side heats itself towards the maximum.
    np.testing.assert_allclose(hot.friction[:, 0], linear.friction[:, 0], rtol=0.02)
