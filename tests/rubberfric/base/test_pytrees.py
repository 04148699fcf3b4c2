"""Leaves of objects are arrays, as equinox expects; objects compare by value."""

import copy
import pickle

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import RIGID, ROAD, SHEAR, SHIFTED_TREAD, scene
from support.cases.stored import as_arrays
from support.scenes.examples import EXAMPLES, examples

import rubberfric as rf

COARSE = rf.Quadrature(order=6, panels=3, graded=2, ratio=5.0, angular_order=6)
SCENE = scene((SHIFTED_TREAD,), (RIGID, ROAD), shear=SHEAR)


def friction(one):
    return rf.friction(one, 0.1, 1e5, 303.0, quadrature=COARSE)


def test_equinox_returns_all_derivatives():
    found, expected = (jax.tree.leaves(grad(friction)(SCENE)) for grad in (eqx.filter_grad, jax.grad))
    assert len(found) == len(expected) == len(jax.tree.leaves(SCENE)) > 12
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-10)
    hurst, step = ROAD.hurst, 1e-5
    ends = [friction(SCENE.replace("upper.spectrum.hurst", hurst + s)) for s in (step, -step)]
    slope = eqx.filter_grad(friction)(SCENE).upper.spectrum.hurst
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2 * step), rtol=1e-6)


def test_equinox_compiles_once_for_all_values():
    traced = []

    @eqx.filter_jit
    def area(one):
        traced.append(one)
        return one.upper.spectrum.hurst * one.lower.material.E_inf

    for hurst in (0.7, 0.8, jnp.asarray(0.9)[()]):
        np.testing.assert_allclose(
            area(SCENE.replace("upper.spectrum.hurst", float(hurst))),
            float(hurst) * SCENE.lower.material.E_inf,
            rtol=1e-12,
        )
    assert len(traced) == 1
    area(SCENE.replace(area_correction=True))
    assert len(traced) == 2


@pytest.mark.parametrize("name", [name for name, one in EXAMPLES.items() if jax.tree.leaves(one)])
def test_leaves_are_arrays(name):
    one, within = examples()[name], []
    jax.jit(lambda x: within.extend(jax.tree.leaves(one)) or x)(1.0)
    for leaves in (within, jax.tree.leaves(one)):
        assert all(eqx.is_inexact_array(leaf) and not isinstance(leaf, jax.core.Tracer) for leaf in leaves)


def test_leaves_follow_the_precision():
    one = rf.SelfAffine(1e2, 1e3, 1e5, 0.7, 1e-4)
    for x64, dtype in ((True, np.float64), (False, np.float32), (True, np.float64)):
        with jax.enable_x64(x64):
            leaves = jax.tree.leaves(one)
            assert {leaf.dtype for leaf in leaves} == {np.dtype(dtype)} and all(x.weak_type for x in leaves)
    assert float(jax.tree.leaves(one)[3]) == 0.7 == one.hurst and type(one.hurst) is float


def test_equality_by_value():
    made = [examples()[name] for name in ("Scene", "Scene")]
    assert made[0] is not made[1] and made[0] == made[1] and hash(made[0]) == hash(made[1])
    assert {made[0]: "a"}[made[1]] == "a" and made[1] in [made[0]]
    for one in (copy.deepcopy(SCENE), pickle.loads(pickle.dumps(SCENE)), jax.jit(lambda x: x)(SCENE)):
        assert one == SCENE and hash(one) == hash(SCENE)
    others = [
        SCENE.replace(gamma=0.4),
        SCENE.replace("lower.material.E[0]", 3e6),
        SCENE.replace(area_correction=True),
        SCENE.replace(shear=None),
        SCENE.replace(quadrature=COARSE),
        as_arrays(SCENE, np.float32),
        as_arrays(SCENE),  # its numbers widen those of single precision, and Python's do not
        "scene",
        None,
    ]
    assert all(one != SCENE for one in others)
    assert len({SCENE, *others}) == len(others) + 1
    assert rf.same(SCENE, SCENE.replace(quadrature=COARSE))
    assert rf.Slab(1e-3) != rf.Slab(1e-3, "frictionless") and rf.Rigid() == rf.Rigid()
    zero = rf.Correlation(0.0)
    assert zero == rf.Correlation(-0.0) and hash(zero) == hash(rf.Correlation(-0.0))


def test_equality_of_traced_and_other_leaves():
    def within(x):
        one, other = SCENE.replace(gamma=x), SCENE.replace(gamma=x)
        assert one == other and hash(one) == hash(other)
        assert one != SCENE and one != SCENE.replace(gamma=x * x)
        return x

    jax.jit(within)(0.5)
    names = jax.tree.map(lambda _: object(), SCENE)
    assert names == names and names != SCENE and hash(names) != hash(SCENE)


def test_scenes_as_static_arguments():
    traced = []

    def twice(one, x):
        traced.append(one)
        return one.gamma * x

    static = jax.jit(twice, static_argnums=0)
    for gamma in (0.5, 0.5, 0.25):
        assert static(SCENE.replace(gamma=gamma), 2.0) == 2 * gamma
    assert len(traced) == 2
