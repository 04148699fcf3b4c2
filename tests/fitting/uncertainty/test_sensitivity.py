"""Logarithmic sensitivities against the oracle, forward mode and exact identities."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import ROAD, SHEAR
from problems import SOFT as RUBBER
from support.cases.stored import h_rms, reference
from support.cases.stored import scene as scene_of
from support.counting.compilations import compilations
from support.scenes.fits import FAST

import rubberfric as rf
from fitting import sensitivity, sensitivity_names
from rubberfric.analysis.jacobian import BLOCK

ORACLE = reference("derivative_cases")

SHIFTED = dataclasses.replace(RUBBER, shift=rf.WLF(9.0, 120.0, 293.15))
SCENE = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(SHIFTED, None, rf.Slab(2e-3)), shear=SHEAR)
PATHS = {
    "moduli": ("upper.material.E_inf", "upper.material.E", "shear.tau_f0"),
    "times": ("upper.material.tau",),
    "waves": ("lower.spectrum.q0", "lower.spectrum.qr", "lower.spectrum.q1"),
    "height": ("lower.spectrum.h_rms",),
    "thickness": ("upper.layer.thickness",),
    "v0": ("shear.v0",),
}
V = np.array([1e-4, 0.03, 2.0])  # [m/s]
P = 2e5  # [Pa]
T = 303.15  # [K]

fast = functools.partial(sensitivity, quadrature=FAST)


@functools.cache
def sums(quantity):
    """Sums of the rows of each kind of number, and the slopes over ln v and ln p, each at V."""
    paths = [path for kind in PATHS.values() for path in kind]
    rows = np.array(sensitivity(SCENE, V, P, paths, T, quantity=quantity))
    names = sensitivity_names(SCENE, paths)
    assert len(names) == len(rows)

    def log_of(x):
        at = rf.solve(SCENE, V * jnp.exp(x[0]), P * jnp.exp(x[1]), T, quantities=(quantity,))
        return jnp.log(getattr(at, quantity))

    found = dict(zip(("v", "p"), np.array(jax.jit(jax.jacfwd(log_of))(jnp.zeros(2))).T, strict=True))
    for kind, of_kind in PATHS.items():
        found[kind] = sum(row for name, row in zip(names, rows, strict=True) if name.split("[")[0] in of_kind)
    return found


each_quantity = pytest.mark.parametrize(
    "quantity", ["friction", *(pytest.param(name, marks=pytest.mark.slow) for name in ("area", "separation"))]
)


@pytest.mark.slow
@each_quantity
def test_all_moduli_and_the_pressure_times_one_factor_change_nothing(quantity):
    s = sums(quantity)
    np.testing.assert_allclose(s["moduli"] + s["p"], 0, atol=1e-10)


@pytest.mark.slow
@each_quantity
def test_longer_times_are_a_faster_motion(quantity):
    s = sums(quantity)
    np.testing.assert_allclose(s["times"] - s["v0"], s["v"], atol=1e-10)


@pytest.mark.slow
@each_quantity
def test_all_lengths_times_one_factor_move_only_the_separation(quantity):
    s = sums(quantity)
    total = s["height"] + s["thickness"] - s["waves"] + s["v"] + s["v0"]
    np.testing.assert_allclose(total, float(quantity == "separation"), atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(("quantity", "expected"), [("area", 0.0), ("separation", 1.0)])
def test_heights_and_pressure_times_one_factor(quantity, expected):
    s = sums(quantity)
    np.testing.assert_allclose(s["height"] + s["p"], expected, atol=1e-10)


@pytest.mark.slow
def test_tabulated_modulus():
    """The identity for E' and E'' of a table, and derivatives of results of `solve`."""
    omega = np.geomspace(1e-2, 1e7, 12)
    modulus = np.asarray(rf.complex_modulus(RUBBER, omega))
    rubber = rf.TabulatedModulus(omega, modulus.real, modulus.imag, 0.5)
    scene = rf.Scene(rf.Body(rubber), rf.Body(rf.Rigid(), ROAD))
    rows = np.array(fast(scene, V, P, ("lower.material.storage", "lower.material.loss", "gamma")))
    assert rows.shape == (25, 3) and np.count_nonzero(rows) > 30

    def log_of(x):
        there = dataclasses.replace(scene, gamma=scene.gamma * jnp.exp(x[1]))
        return jnp.log(rf.friction(there, V, P * jnp.exp(x[0]), quadrature=FAST))

    by_pressure, by_gamma = np.array(jax.jit(jax.jacfwd(log_of))(jnp.zeros(2))).T
    np.testing.assert_allclose(rows[:24].sum(0) + by_pressure, 0, atol=1e-10)
    np.testing.assert_allclose(rows[24], by_gamma, atol=1e-11)


TO_PATH = {"solid1": "lower.material", "solid2": "upper.material", "psd1": "lower.spectrum"}
TO_PATH |= {"psd2": "upper.spectrum", "nu": "poisson", "H": "hurst"}


def key_path(parameter):
    """Key path of a parameter of the reference table."""
    if parameter.endswith(".thickness"):
        return {"solid1": "lower", "solid2": "upper"}[parameter.split(".")[0]] + ".layer.thickness"
    *parts, last = (TO_PATH.get(part, part) for part in parameter.split("."))
    return ".".join(parts) + f"[{last}]" if last.isdigit() else ".".join([*parts, last])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "quantity"),
    [("two-slabs", "friction"), ("two-slabs", "separation"), ("wlf-hot", "friction"), ("corrected", "area")],
)
def test_equal_to_the_oracle(name, quantity):
    """Derivatives of brute-force values, of every number with one."""
    case = ORACLE[name]
    given = {
        k: d[quantity] for k, d in case["derivatives"].items() if k not in ("v", "pressure", "temperature")
    }
    paths = [key_path(parameter) for parameter in given]
    conditions = case["v"], case["pressure"], paths, case.get("temperature")
    found = np.array(sensitivity(scene_of(case), *conditions, quantity=quantity))
    Q = case[quantity]
    expected = np.array(list(given.values())) / Q
    floor = 1e-6 * h_rms(case) / Q if quantity == "separation" else 0.0
    assert found.shape == expected.shape and len(found) > 15
    assert (np.abs(found - expected) <= 1e-6 * (1 + floor + np.abs(expected))).all()


@pytest.mark.slow
def test_equal_to_forward_mode_over_several_blocks():
    paths = ["upper.material.E[1:]", "lower.spectrum.hurst", "gamma", "upper.material.shift.C2", "shear.c"]
    count = 2 * BLOCK + 3
    v, p = np.logspace(-6, 2, count), np.geomspace(1e5, 1e6, count)
    found = np.array(fast(SCENE, v, p, paths, T))
    assert found.shape == (6, count)

    def log_friction(x):
        material = SCENE.upper.material
        E = material.E.at[1:].multiply(jnp.exp(x[:2]))
        shift = dataclasses.replace(material.shift, C2=material.shift.C2 * jnp.exp(x[4]))
        road = dataclasses.replace(ROAD, hurst=ROAD.hurst * jnp.exp(x[2]))
        scene = dataclasses.replace(
            SCENE,
            lower=dataclasses.replace(SCENE.lower, spectrum=road),
            upper=dataclasses.replace(SCENE.upper, material=dataclasses.replace(material, E=E, shift=shift)),
            gamma=SCENE.gamma * jnp.exp(x[3]),
            shear=dataclasses.replace(SHEAR, c=SHEAR.c * jnp.exp(x[5])),
        )
        return jnp.log(rf.friction(scene, v, p, T, quadrature=FAST))

    expected = np.array(jax.jit(jax.jacfwd(log_friction))(jnp.zeros(6))).T
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


SMALL = rf.Scene(
    rf.Body(dataclasses.replace(RUBBER, E=np.array([2.5e7, 0.0, 3e5]))), rf.Body(rf.Rigid(), ROAD)
)
ROWS = ("lower.material.E", "upper.spectrum.h_rms")


@pytest.mark.slow
def test_shape_is_parameters_then_conditions():
    found = fast(SMALL, V[:, None], np.array([1e5, 3e5]), ROWS)
    assert found.shape == (4, 3, 2)
    one = fast(SMALL, V[1], 3e5, "upper.spectrum.h_rms")
    assert one.shape == (1,)
    np.testing.assert_allclose(one[0], found[3, 1, 1], rtol=1e-12)
    assert sensitivity_names(SMALL, ROWS) == (*(f"lower.material.E[{i}]" for i in range(3)), ROWS[1])
    assert sensitivity_names(SMALL, "lower.material.E[-1]") == ("lower.material.E[2]",)
    # The free parameters of a fit will do, and a number named twice keeps its own row.
    named = dict.fromkeys(ROWS) | {"lower.material.E[2]": None}
    again = fast(SMALL, V, 3e5, named)
    np.testing.assert_allclose(again[4], again[2], rtol=1e-14)
    np.testing.assert_allclose(again[:4], found[..., 1], rtol=1e-11, atol=1e-13)


def test_zeros():
    found = np.array(fast(SMALL, np.array([-0.03, 0.0, 0.03]), 3e5, ROWS))
    assert np.isfinite(found).all()
    assert (found[:, 1] == 0).all(), "no logarithm of the friction at rest"
    assert (found[1] == 0).all(), "no factor changes E = 0"
    assert (found[[0, 2, 3]][:, [0, 2]] != 0).all()
    np.testing.assert_allclose(found[:, 0], found[:, 2], rtol=1e-13)
    area = np.array(fast(SMALL, np.array([0.0, 0.03]), 3e5, ROWS, quantity="area"))
    assert (area[3] < 0).all() and np.isfinite(area).all()


@pytest.mark.parametrize("quantity", ["friction", "viscoelastic_friction", "shear_friction"])
def test_scene_without_friction(quantity):
    rough_rubber = rf.Scene(rf.Body(RUBBER, ROAD), rf.Body(rf.Rigid()))
    found = fast(rough_rubber, V, P, ("lower.material.E", "gamma"), quantity=quantity)
    assert (found == np.zeros((4, 3))).all()


@pytest.mark.slow
def test_transformations():
    expected = np.array(fast(SMALL, V, P, ROWS))
    jitted = jax.jit(lambda s, v: fast(s, v, P, ROWS))(SMALL, V)
    np.testing.assert_allclose(jitted, expected, rtol=1e-13)
    mapped = jax.vmap(lambda p: fast(SMALL, V, p, ROWS))(np.array([P, 2 * P]))
    np.testing.assert_allclose(mapped[0], expected, rtol=1e-12, atol=1e-14)
    scenes = jax.tree.map(lambda leaf: jnp.stack([jnp.asarray(leaf, float)] * 2), SMALL)
    np.testing.assert_allclose(
        jax.vmap(lambda s: fast(s, V, P, ROWS))(scenes)[1], expected, rtol=1e-12, atol=1e-14
    )
    slope = jax.jit(jax.grad(lambda s: jnp.sum(fast(s, np.array([0.0, 0.1]), P, ROWS) ** 2)))(SMALL)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slope))


@pytest.mark.slow
def test_second_call_compiles_nothing():
    other = dataclasses.replace(SMALL, gamma=0.6)
    with compilations() as compiled:
        fast(SMALL, V, P, ROWS)
        assert compiled
        compiled.clear()
        fast(other, 2 * V, 1.1 * P, ROWS)
    assert not compiled


def test_dtype():
    single = jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float32), SMALL)
    found = fast(single, V.astype(np.float32), np.float32(P), ROWS)
    assert found.dtype == jnp.float32
    np.testing.assert_allclose(found, fast(SMALL, V, P, ROWS), atol=1e-4)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"parameters": "lower.material.e"}, "did you mean"),
        ({"parameters": ["gamma", "lower.material.E[3]"]}, r"\[0\] \.\.\. \[2\]"),
        ({"parameters": "area_correction"}, "static field"),
        ({"parameters": "lower.material"}, "must be one of its numbers"),
        ({"parameters": "shear.tau_f0"}, "the scene has no shear"),
        ({"parameters": []}, "must be one or several key paths"),
        ({"quantity": "mu"}, "must be one of area, friction"),
        ({"velocity": np.array([1.0, np.nan])}, r"velocity\[1\] = nan"),
        ({"pressure": np.array([0.0])}, r"pressure\[0\] = 0.0: must be > 0"),
        ({"pressure": "1e5"}, "pressure = '1e5': must be a number"),
        ({"velocity": V, "pressure": np.ones(2)}, "must broadcast"),
        ({"temperature": 300.0}, "must be None"),
        ({"scene": 1.0}, "must be a Scene"),
        ({"quadrature": 12}, "must be a Quadrature"),
    ],
)
def test_bad_input(changes, said):
    good = {"scene": SMALL, "velocity": 1.0, "pressure": 1e5, "parameters": "gamma"}
    with pytest.raises(ValueError, match=said) as caught:
        sensitivity(**good | changes)
    assert "\n" not in str(caught.value)


def test_bad_names():
    with pytest.raises(ValueError, match="did you mean 'gamma'"):
        sensitivity_names(SMALL, "gama")
