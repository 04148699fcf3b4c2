"""Logarithmic sensitivities against forward mode, and how they are called.

`tests/properties` compares derivatives of the quantities with the oracle and checks their scaling identities.
"""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import ROAD, SHEAR
from problems import SOFT as RUBBER
from support.counting.compilations import compilations
from support.scenes.fits import FAST

import rubberfric as rf
from fitting import Positive, sensitivity, sensitivity_names
from fitting.parameters.variables import element_names, free_parameters, to_scene
from rubberfric.analysis.jacobian import BLOCK

SHIFTED = dataclasses.replace(RUBBER, shift=rf.WLF(9.0, 120.0, 293.15))
SCENE = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(SHIFTED, None, rf.Slab(2e-3)), shear=SHEAR)
PATHS = (
    *("upper.material.E_inf", "upper.material.E", "upper.material.tau", "upper.material.shift.C2", "gamma"),
    *("lower.spectrum.q0", "lower.spectrum.qr", "lower.spectrum.q1", "lower.spectrum.hurst"),
    *("lower.spectrum.h_rms", "upper.layer.thickness", "shear.tau_f0", "shear.c", "shear.v0"),
)
OMEGA = np.geomspace(1e-2, 1e7, 12)
E = np.asarray(rf.complex_modulus(RUBBER, OMEGA))
TABULATED = rf.Scene(rf.Body(rf.TabulatedModulus(OMEGA, E.real, E.imag, 0.5)), rf.Body(rf.Rigid(), ROAD))
V = np.array([1e-4, 0.03, 2.0])  # [m/s]
P = 2e5  # [Pa]
T = 303.15  # [K]

fast = functools.partial(sensitivity, quadrature=FAST)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "paths", "temperature", "quantity"),
    [
        (SCENE, PATHS, T, "friction"),
        (SCENE, PATHS, T, "area"),
        (SCENE, PATHS, T, "separation"),
        (TABULATED, ("lower.material.storage", "lower.material.loss", "gamma"), None, "friction"),
    ],
    ids=["friction", "area", "separation", "table"],
)
def test_equal_to_forward_mode_over_several_blocks(scene, paths, temperature, quantity):
    count = 2 * BLOCK + 3
    v, p = np.logspace(-6, 2, count), np.geomspace(1e5, 1e6, count)
    found = np.array(fast(scene, v, p, paths, temperature, quantity=quantity))
    # The x of a Positive parameter is the logarithm of its value.
    variables, constants, x = free_parameters(scene, dict.fromkeys(paths, Positive()))
    assert sensitivity_names(scene, paths) == tuple(element_names(variables))

    def log_of(x):
        there = to_scene(variables, constants, x)
        at = rf.solve(there, v, p, temperature, quadrature=FAST, quantities=(quantity,))
        return jnp.log(getattr(at, quantity))

    expected = np.array(jax.jit(jax.jacfwd(log_of))(jnp.asarray(x))).T
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    assert np.any(expected != 0, 1).sum() >= 14  # gamma and contact shear do not change the area


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
        ({"parameters": []}, "must be one or several key paths"),
        ({"quantity": "mu"}, "must be one of area, friction"),
        ({"velocity": np.array([1.0, np.nan])}, r"velocity\[1\] = nan"),
        ({"temperature": 300.0}, "must be None"),
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
