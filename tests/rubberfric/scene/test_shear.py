"""Contact shear: formula and derivatives in 30 digits, and the sum with viscoelastic friction."""

import dataclasses
import functools
import itertools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from problems import ROAD, SHEAR, TREAD, WORN
from support.cases.stored import paths, slow_if
from support.counting.operations import primitives
from support.scenes.shifts import ARRHENIUS, TABLE, WLF

import rubberfric as rf
from rubberfric.scene.interface import shear_friction
from rubberfric.scene.scene import cast
from rubberfric.theory.integrals import evaluate, prepare

STEEL = rf.Rigid()
GLASS = rf.Elastic(7e10, 0.2)
VELOCITY = jnp.logspace(-6, 1, 50)
PARTS = ("area", "friction", "viscoelastic_friction", "shear_friction")

replace = dataclasses.replace


def scene(lower, upper, shear=SHEAR, **options):
    return rf.Scene(rf.Body(*lower), rf.Body(*upper), shear=shear, **options)


SCENES = {
    "case-I": scene((TREAD,), (STEEL, ROAD)),
    "case-II": scene((TREAD, ROAD), (STEEL,)),
    "case-III": scene((TREAD, ROAD), (GLASS,)),
    "two-rubbers": scene((TREAD, WORN), (TREAD, ROAD)),
    "corrected": scene((TREAD,), (STEEL, ROAD), area_correction=True),
    "smooth": scene((TREAD,), (STEEL,)),
}
SLOW = ("case-III", "two-rubbers", "corrected")
every_scene = pytest.mark.parametrize("s", slow_if(SLOW.__contains__, SCENES))


def parts(s, *conditions, quantities=PARTS):
    return rf.solve(s, *conditions, quantities=quantities)


# --- The formula


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
    return jax.tree.map(lambda x: [mp.mpf(float(y)) for y in x] if np.ndim(x) else mp.mpf(float(x)), tree)


def exact_slopes(tree):
    """theta d mu_con / d theta of every leaf element, or d mu_con / d theta where theta = 0."""
    leaves, structure = jax.tree.flatten(tree)
    leaves = as_mp(leaves)

    def moved(k, i, s):
        def along(x):
            return x * mp.exp(s) if x else s

        leaf = leaves[k]
        new = along(leaf) if i is None else [along(x) if j == i else x for j, x in enumerate(leaf)]
        return exact(structure.unflatten([new if j == k else old for j, old in enumerate(leaves)]))

    elements = [
        (k, i) for k, x in enumerate(leaves) for i in (range(len(x)) if isinstance(x, list) else [None])
    ]
    return [float(mp.diff(functools.partial(moved, k, i), 0)) for k, i in elements]


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
every_point = pytest.mark.parametrize("at", POINTS.values(), ids=POINTS)
both_modes = jax.jit(lambda at: [jac(lambda at: shear_friction(*at))(at) for jac in (jax.jacfwd, jax.jacrev)])


@every_point
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


@pytest.mark.parametrize(
    ("x64", "dtype"), [(True, jnp.float64), (True, jnp.float32), (False, jnp.float32)], ids=str
)
@pytest.mark.parametrize("shift", [ARRHENIUS, WLF, TABLE, None], ids=lambda shift: type(shift).__name__)
def test_finite_and_of_its_dtype_at_all_extremes(shift, dtype, x64):
    """5832 corners, jitted, where a temperature outside its law saturates: values and both derivatives."""
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


# --- In a scene


@every_scene
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
    np.testing.assert_allclose(found.friction[0], -found.friction[3], rtol=1e-12)  # odd


def test_scenes_without_viscoelastic_friction_still_resist_shear():
    for name in ("case-II", "case-III", "smooth"):
        found = parts(SCENES[name], 0.1, 3e5)
        assert found.viscoelastic_friction == 0
        assert found.friction == found.shear_friction > 0
    with mp.workdps(30):
        full = float(exact(as_mp((SHEAR, 1.0, 0.1, 3e5))))
    assert found.friction == pytest.approx(full, rel=1e-14)  # nothing rough: A = A0


@pytest.mark.parametrize("shift", [ARRHENIUS, WLF, TABLE, None], ids=lambda shift: type(shift).__name__)
def test_python_numbers_do_not_widen_a_float32_scene(shift):
    single = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), replace(SCENES["case-I"], shear=None))
    shear = rf.ContactShear(6.5e6, 0.1, 6e-3, shift)
    # Python numbers are unchanged, tables of numbers are converted.
    shear = jax.tree.map(lambda x: x if isinstance(x, float) else jnp.asarray(x, jnp.float32), shear)
    single = replace(single, shear=shear)
    conditions = (0.1, 3e5) if shift is None else (0.1, 3e5, 300.0)
    shapes = jax.eval_shape(functools.partial(parts, single), *conditions)
    assert {shape.dtype for shape in jax.tree.leaves(shapes)} == {jnp.dtype(jnp.float32)}


def test_single_precision_is_accurate():
    s = SCENES["case-I"]
    single = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), s)
    v = np.logspace(-8, 2, 11)
    found = parts(single, v.astype(np.float32), np.float32(3e5), np.float32(280.0))
    exact = parts(s, v, 3e5, 280.0)
    assert found.friction.dtype == np.float32
    np.testing.assert_allclose(found.shear_friction, exact.shear_friction, rtol=2e-5)
    np.testing.assert_allclose(found.friction, exact.friction, rtol=2e-5)


@pytest.mark.slow
def test_share_from_outside_the_table_is_that_of_the_viscoelastic_friction():
    omega = np.logspace(1, 5, 20)
    rubber = rf.TabulatedModulus(omega, 1e6 * omega**0.2, 3e5 * omega**0.2)
    s = scene((rubber,), (STEEL, ROAD))
    v = np.array([1e-6, 1e-2])
    found = rf.analysis.friction_outside_table(s, v, 3e5)
    assert found[0] > 0.1
    np.testing.assert_allclose(
        found, rf.analysis.friction_outside_table(replace(s, shear=None), v, 3e5), rtol=1e-9
    )


# --- Temperatures


@pytest.mark.slow
def test_shear_alone_makes_a_temperature_meaningful():
    s = SCENES["case-I"]
    cold, middle, warm = rf.friction(s, 0.1, 3e5, np.array([283.15, 293.15, 303.15]))
    assert cold < middle < warm  # past the maximum, where warming is slowing down
    assert rf.friction(s, 0.1, 3e5) == pytest.approx(float(middle), rel=1e-12)
    unshifted = replace(s, shear=replace(SHEAR, shift=None))
    with pytest.raises(
        ValueError, match=r"^temperature is given, but nothing in the scene has a shift: it must be"
    ):
        rf.friction(unshifted, 0.1, 3e5, 293.15)
    material = replace(TREAD, shift=WLF)
    both = scene((material,), (STEEL, ROAD), shear=unshifted.shear)
    of_material, of_both = parts(both, 0.1, 3e5, 320.0), parts(replace(both, shear=SHEAR), 0.1, 3e5, 320.0)
    assert of_material.viscoelastic_friction == of_both.viscoelastic_friction
    expected = shear_friction(unshifted.shear, of_material.area, 0.1, 3e5)
    assert of_material.shear_friction == pytest.approx(float(expected), rel=1e-13)


@pytest.mark.parametrize(
    ("shift", "T", "message"),
    [
        (WLF, 190.0, r"^temperature = 190\.0: must be > 191\.55 K, the pole of the WLF law$"),
        (TABLE, 400.0, r"^temperature = 400\.0: must be inside the table"),
    ],
)
def test_temperature_outside_the_shift_of_the_shear(shift, T, message):
    s = scene((TREAD,), (STEEL, ROAD), shear=replace(SHEAR, shift=shift))
    with pytest.raises(ValueError, match=message):
        rf.friction(s, 0.1, 3e5, T)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: scene((TREAD,), (STEEL, ROAD), shear=0.1),
            "Scene.shear = 0.1: must be ContactShear or None",
        ),
        (
            lambda: replace(SHEAR, shift=1.0),
            "ContactShear.shift = 1.0: must be WLF, Arrhenius, TabulatedShift or None",
        ),
        (
            lambda: parts(SCENES["case-I"], 0.1, 3e5, quantities=("shear",)),
            "quantities has 'shear': must be one of area, friction, separation, viscoelastic_friction, "
            "shear_friction, transverse_friction, flash_temperature, converged",
        ),
    ],
)
def test_wrong_calls(call, message):
    with pytest.raises(ValueError, match=r"must be") as caught:
        call()
    assert str(caught.value) == message


# --- Absent and unrequested parts are not traced


def test_a_scene_without_shear_traces_nothing_new():
    for s in (replace(s, shear=None) for s in SCENES.values()):
        friction = primitives(lambda s, v: rf.friction(s, v, 1e5, quadrature=rf.Quadrature()), s, VELOCITY)
        part = primitives(
            lambda s, v: (
                rf.solve(
                    s, v, 1e5, quadrature=rf.Quadrature(), quantities="viscoelastic_friction"
                ).viscoelastic_friction
            ),
            s,
            VELOCITY,
        )
        assert friction == part

        def integral(s, v):
            s, v, p = cast((s, v, jnp.full_like(v, 1e5)), jnp.float64)
            found = evaluate(prepare(s, ("friction",), rf.Quadrature()), ("friction",), (v, p))
            return found["friction"]

        # In addition to the integral: the dtype of every number, and the broadcast of three conditions.
        plumbing = {"convert_element_type", "broadcast_in_dim", "reshape", "squeeze"}
        bare = [name for name in primitives(integral, s, VELOCITY) if name not in plumbing]
        assert [name for name in friction if name not in plumbing] == bare


@pytest.mark.parametrize("name", ["case-II", "case-III", "smooth"])
def test_no_graded_panels_where_only_the_shear_dissipates(name):
    names = primitives(lambda s, v: rf.friction(s, v, 1e5), SCENES[name], VELOCITY)
    area = primitives(lambda s, v: rf.contact_area(s, v, 1e5), SCENES[name], VELOCITY)
    assert len(names) <= len(area) + 30
