"""Contact shear: formula and derivatives in 30 digits, and the sum with viscoelastic friction."""

import dataclasses
import functools
import itertools
import re

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from problems import CONTACT_MODELS, RIGID, ROAD, SHEAR, STEEL, TREAD, WORN, scene
from support.cases.stored import paths, slow_if
from support.counting.operations import primitives
from support.scenes.shifts import ARRHENIUS, TABLE, WLF

import rubberfric as rf
from rubberfric.scene.interface import shear_friction
from rubberfric.scene.scene import cast
from rubberfric.theory.integrals import evaluate, prepare

VELOCITY = jnp.logspace(-6, 1, 50)
PARTS = ("area", "friction", "viscoelastic_friction", "shear_friction")

replace = dataclasses.replace


SCENES = {
    "case-I": scene((TREAD,), (RIGID, ROAD), shear=SHEAR),
    "case-II": scene((TREAD, ROAD), (RIGID,), shear=SHEAR),
    "case-III": scene((TREAD, ROAD), (STEEL,), shear=SHEAR),
    "two-rubbers": scene((TREAD, WORN), (TREAD, ROAD), shear=SHEAR),
    "corrected": scene((TREAD,), (RIGID, ROAD), area_correction=True, shear=SHEAR),
    "smooth": scene((TREAD,), (RIGID,), shear=SHEAR),
    "law": scene((TREAD,), (RIGID, ROAD), shear=SHEAR, **CONTACT_MODELS["law"]),
}
SLOW = ("case-III", "two-rubbers", "corrected", "law")


def parts(s, *conditions, quantities=PARTS):
    return rf.solve(s, *conditions, quantities=quantities)


def sheared_with(shift):
    return replace(SCENES["case-I"], shear=replace(SHEAR, shift=shift))


def exact_log_factor(shift, T):
    """ln a_T of a WLF or Arrhenius shift in the working precision of mpmath."""
    if isinstance(shift, rf.WLF):
        return -mp.log(10) * shift.C1 * (T - shift.T_ref) / (shift.C2 + T - shift.T_ref)
    return shift.energy / mp.mpf("8.617333262e-5") * (1 / T - 1 / shift.T_ref)


def exact(tree):
    """mu_con of (shear, area, velocity, pressure[, temperature]) in the working precision of mpmath."""
    shear, area, v, p, *temperature = tree
    if v == 0:
        return mp.mpf(0)
    log_speed = mp.log(abs(v))
    if temperature and shear.shift is not None:
        log_speed += exact_log_factor(shear.shift, *temperature)
    decades = (log_speed - mp.log(shear.v0)) / mp.log(10)
    return mp.sign(v) * shear.tau_f0 * mp.exp(-shear.c * decades**2) / p * area


def as_mp(tree):
    return jax.tree.map(lambda x: mp.mpf(float(x)), tree)


def exact_slopes(tree):
    """theta d mu_con / d theta of every number, or d mu_con / d theta where theta = 0."""
    leaves, structure = jax.tree.flatten(as_mp(tree))

    def moved(k, s):
        leaf = leaves[k] * mp.exp(s) if leaves[k] else s
        return exact(structure.unflatten([*leaves[:k], leaf, *leaves[k + 1 :]]))

    return [float(mp.diff(functools.partial(moved, k), 0)) for k in range(len(leaves))]


AT = (0.02, 0.1, 2e5)  # area, velocity, pressure
POINTS = {
    "no-shift": (replace(SHEAR, shift=None), *AT),
    "no-temperature": (SHEAR, *AT),
    "arrhenius": (SHEAR, *AT, 283.15),
    "wlf": (replace(SHEAR, shift=WLF), *AT, 330.0),
    "backwards": (SHEAR, 0.02, -0.1, 2e5, 313.15),
    "hot": (SHEAR, 0.02, 0.1, 2e5, 900.0),
    "cold": (SHEAR, 0.02, 1e-8, 2e5, 200.0),
    "at-the-maximum": (SHEAR, 0.02, 6e-3, 2e5, 293.15),
    "slowest": (SHEAR, 0.02, 1e-30, 2e5, 293.15),
    "fastest": (SHEAR, 0.02, 1e12, 2e5, 293.15),
    "light": (SHEAR, 3e-14, 0.1, 1e-6, 293.15),
    "heavy": (SHEAR, 1.0, 0.1, 1e12, 293.15),
    "narrow": (replace(SHEAR, c=1e30), *AT, 293.15),
    "wide": (replace(SHEAR, c=1e-12), 0.02, 1e-30, 2e5, 293.15),
    "flat": (replace(SHEAR, c=0.0), *AT, 293.15),
    "no-stress": (replace(SHEAR, tau_f0=0.0), *AT, 293.15),
    "no-area": (SHEAR, 0.0, 0.1, 2e5, 293.15),
}
both_modes = jax.jit(lambda at: [jac(lambda at: shear_friction(*at))(at) for jac in (jax.jacfwd, jax.jacrev)])


@pytest.mark.parametrize("at", POINTS.values(), ids=POINTS)
def test_formula_and_derivatives(at):
    with mp.workdps(30):
        expected = float(exact(as_mp(at)))
    assert jax.jit(shear_friction)(*at) == pytest.approx(expected, rel=1e-13, abs=1e-300)
    # Derivatives by tau_f0, c, v0, the shift, area, velocity, pressure and temperature; both modes.
    with mp.workdps(60):
        expected, value = np.array(exact_slopes(at)), float(exact(as_mp(at)))
    theta = np.concatenate([np.ravel(x) for x in jax.tree.leaves(at)])
    for slopes in both_modes(jax.tree.map(lambda x: jnp.asarray(x, float), at)):
        found = np.concatenate([np.ravel(x) for x in jax.tree.leaves(slopes)])
        found = found * np.where(theta == 0, 1.0, theta)
        assert (np.abs(found - expected) <= 1e-12 * (abs(value) + np.abs(expected)) + 1e-290).all()


@pytest.mark.parametrize("c", [1e-12, 0.1, 1e30, 0.0])
def test_at_rest(c):
    """Value and all slopes are 0: for c > 0 from the formula, for c = 0 by convention."""
    at = jax.tree.map(lambda x: jnp.asarray(x, float), (replace(SHEAR, c=c), 0.3, 0.0, 2e5, 300.0))
    assert shear_friction(*at) == 0.0
    for slopes in both_modes(at):
        assert all(slope == 0 for slope in jax.tree.leaves(slopes))
    dry = replace(SHEAR, c=0.0)
    assert shear_friction(dry, 0.3, 1e-30, 2e5) == -shear_friction(dry, 0.3, -1e-30, 2e5) == 0.3 * 6.5e6 / 2e5


KINDS = {"arrhenius": ARRHENIUS, "wlf": WLF, "table": TABLE, "none": None}
PRECISIONS = {
    "double": (True, jnp.float64),
    "single": (True, jnp.float32),
    "without x64": (False, jnp.float32),
}
# A table saturates in its own way, and its numbers are arrays.
EXTREMES = {f"{kind}, {name}": (KINDS[kind], *PRECISIONS[name]) for kind in KINDS for name in PRECISIONS}


@pytest.mark.parametrize(
    "case", slow_if(lambda name: name not in ("arrhenius, double", "wlf, double", "table, single"), EXTREMES)
)
def test_finite_and_of_its_dtype_at_all_extremes(case):
    """5832 corners, jitted, where a temperature outside its law saturates: values and both derivatives."""
    shift, x64, dtype = case
    corners = itertools.product(
        (0.0, 6.5e6, 1e9),
        (0.0, 1e-10, 0.1, 1e30),
        (1e-12, 6e-3, 1e6),
        (0.0, 1e-30, -1e-30, 1e-3, -1e-3, 6e-3, -6e-3, 1e12, -1e12),
        (1e-6, 1e5, 1e12),
        (-5.0, 191.55, 293.15, 1e6),
    )
    tau_f0, c, v0, v, p, T = np.array(list(corners)).T
    # The area that such a load makes of a soft rubber.
    area = np.minimum(1.0, 1e-6 * p) * (np.arange(p.size) % 7 > 0)

    def friction(shift, tau_f0, c, v0, area, v, p, T):
        return shear_friction(rf.ContactShear(tau_f0, c, v0, shift), area, v, p, T)

    def derivatives(*at):
        return [jac(friction, range(len(at)))(*at) for jac in (jax.jacfwd, jax.jacrev)]

    axes = (None, *[0] * 7)
    with jax.enable_x64(x64):
        at = jax.tree.map(lambda x: jnp.asarray(x, dtype), (shift, tau_f0, c, v0, area, v, p, T))
        value = jax.jit(jax.vmap(friction, axes))(*at)
        assert value.dtype == dtype
        assert np.isfinite(value).all()
        assert (value * np.sign(v) >= 0).all()
        for slopes in jax.jit(jax.vmap(derivatives, axes))(*at):
            for name, slope in zip(paths(slopes), jax.tree.leaves(slopes), strict=True):
                assert slope.dtype == dtype, name
                assert np.isfinite(slope).all(), name


@pytest.mark.parametrize("s", slow_if(SLOW.__contains__, SCENES))
def test_parts_add_up(s):
    plain = replace(s, shear=None)
    v = np.array([-0.1, 0.0, 1e-5, 0.1, 10.0])
    found, without = parts(s, v, 3e5), parts(plain, v, 3e5)
    total = found.viscoelastic_friction + found.shear_friction
    np.testing.assert_allclose(found.friction, total, rtol=1e-15)
    # XLA fuses each set of quantities in its own way: equal to rounding.
    np.testing.assert_allclose(found.viscoelastic_friction, without.friction, rtol=1e-12)
    np.testing.assert_allclose(found.area, without.area, rtol=1e-14)
    np.testing.assert_allclose(
        found.shear_friction, shear_friction(s.shear, without.area, v, 3e5), rtol=1e-13
    )
    np.testing.assert_array_equal(without.viscoelastic_friction, without.friction)
    np.testing.assert_array_equal(without.shear_friction, np.zeros(5))


def test_scenes_without_viscoelastic_friction_still_resist_shear():
    for name in ("case-II", "case-III", "smooth"):
        found = parts(SCENES[name], 0.1, 3e5)
        assert found.viscoelastic_friction == 0
        assert found.friction == found.shear_friction > 0
    with mp.workdps(30):
        full = float(exact(as_mp((SHEAR, 1.0, 0.1, 3e5))))
    assert found.friction == pytest.approx(full, rel=1e-14)  # nothing rough: A = A0


@pytest.mark.slow
def test_share_from_outside_the_table_is_that_of_the_viscoelastic_friction():
    omega = np.logspace(1, 5, 20)
    rubber = rf.TabulatedModulus(omega, 1e6 * omega**0.2, 3e5 * omega**0.2)
    s = scene((rubber,), (RIGID, ROAD), shear=SHEAR)
    v = np.array([1e-6, 1e-2])
    found = rf.analysis.friction_outside_table(s, v, 3e5)
    assert found[0] > 0.1
    np.testing.assert_allclose(
        found, rf.analysis.friction_outside_table(replace(s, shear=None), v, 3e5), rtol=1e-9
    )


@pytest.mark.slow
def test_shear_alone_makes_a_temperature_meaningful():
    s = SCENES["case-I"]
    cold, middle, warm = rf.friction(s, 0.1, 3e5, np.array([283.15, 293.15, 303.15]))
    assert cold < middle < warm  # past the maximum, where warming is slowing down
    assert rf.friction(s, 0.1, 3e5) == pytest.approx(float(middle), rel=1e-12)
    unshifted = sheared_with(None)
    with pytest.raises(
        ValueError, match=r"^temperature is given, but nothing in the scene has a shift: it must be"
    ):
        rf.friction(unshifted, 0.1, 3e5, 293.15)
    material = replace(TREAD, shift=WLF)
    both = scene((material,), (RIGID, ROAD), shear=unshifted.shear)
    of_material, of_both = parts(both, 0.1, 3e5, 320.0), parts(replace(both, shear=SHEAR), 0.1, 3e5, 320.0)
    assert of_material.viscoelastic_friction == of_both.viscoelastic_friction


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: rf.friction(sheared_with(WLF), 0.1, 3e5, 190.0),
            "temperature = 190.0: must be > 191.55 K, the pole of the WLF law",
        ),
        (
            lambda: rf.friction(sheared_with(TABLE), 0.1, 3e5, 400.0),
            "temperature = 400.0: must be inside the table",
        ),
        (
            lambda: sheared_with(0.1),
            "ContactShear.shift = 0.1: must be WLF, Arrhenius, TabulatedShift or None",
        ),
        (lambda: replace(SCENES["case-I"], shear=0.1), "Scene.shear = 0.1: must be ContactShear or None"),
        (
            lambda: parts(SCENES["case-I"], 0.1, 3e5, quantities=("shear",)),
            "quantities has 'shear': must be one of area, friction, separation, viscoelastic_friction, "
            "shear_friction, transverse_friction, flash_temperature, converged",
        ),
    ],
)
def test_wrong_calls(call, message):
    with pytest.raises(ValueError, match=rf"^{re.escape(message)}"):
        call()


# --- Absent and unrequested parts are not traced


def test_a_scene_without_shear_traces_nothing_new():
    usual = rf.Quadrature()
    for s in (replace(s, shear=None) for s in SCENES.values()):
        friction = primitives(lambda s, v: rf.friction(s, v, 1e5, quadrature=usual), s, VELOCITY)
        assert friction == primitives(
            lambda s, v: rf.solve(s, v, 1e5, quadrature=usual, quantities="viscoelastic_friction")[3],
            s,
            VELOCITY,
        )

        def integral(s, v):
            s, v, p = cast((s, v, jnp.full_like(v, 1e5)), jnp.float64)
            return evaluate(prepare(s, ("friction",), usual), ("friction",), (v, p))["friction"]

        # In addition to the integral: the dtype of every number, and the broadcast of three conditions.
        plumbing = {"convert_element_type", "broadcast_in_dim", "reshape", "squeeze"}
        bare = [name for name in primitives(integral, s, VELOCITY) if name not in plumbing]
        assert [name for name in friction if name not in plumbing] == bare


def test_no_graded_panels_where_only_the_shear_dissipates():
    for name in ("case-II", "case-III", "smooth"):
        friction = primitives(lambda s, v: rf.friction(s, v, 1e5), SCENES[name], VELOCITY)
        area = primitives(lambda s, v: rf.contact_area(s, v, 1e5), SCENES[name], VELOCITY)
        assert len(friction) <= len(area) + 30
