"""Kept tables of means give the values of the compiled function, never of other numbers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import RIGID, ROAD, TREAD, scene
from support.counting.operations import primitives

import rubberfric as rf
from rubberfric.theory.stiffness import means
from rubberfric.theory.stiffness.means import known_tables

OMEGA = np.geomspace(1e-2, 1e9, 40)
STORAGE = 1e6 * OMEGA**0.2
LOSS = 2e5 * OMEGA**0.22
VELOCITY = np.array([0.0, 1e-4, 0.1])
QUADRATURE = rf.Quadrature(order=8, panels=5, graded=4, angular_order=12)


def rubber(storage=STORAGE):
    return rf.TabulatedModulus(OMEGA, storage, LOSS)


def friction(one, velocity=VELOCITY):
    return rf.friction(one, velocity, 3e5, quadrature=QUADRATURE)


ON_ROAD = scene((RIGID, ROAD), (rubber(),))


@pytest.mark.slow
def test_values_are_those_of_the_program():
    """A plain call, closed over in jit, under a derivative by v, and in vmap."""
    traced = jax.jit(friction)(ON_ROAD)
    np.testing.assert_allclose(friction(ON_ROAD), traced, rtol=1e-13)
    np.testing.assert_allclose(jax.jit(lambda v: friction(ON_ROAD, v))(VELOCITY), traced, rtol=1e-13)
    np.testing.assert_allclose(jax.vmap(lambda v: friction(ON_ROAD, v))(VELOCITY), traced, rtol=1e-13)
    by_velocity = jax.vmap(jax.grad(lambda v, one: friction(one, v)), (0, None))
    slopes = jax.jit(lambda v: by_velocity(v, ON_ROAD))(VELOCITY)
    np.testing.assert_allclose(slopes, jax.jit(by_velocity)(VELOCITY, ON_ROAD), rtol=1e-12)


def test_a_table_is_built_once_for_its_numbers():
    """It does not depend on the roughness."""
    friction(ON_ROAD)
    before = set(means._kept)
    friction(scene((RIGID, ROAD), (rubber(),)))
    friction(ON_ROAD.replace("lower.spectrum.hurst", 0.7))
    warm = ON_ROAD.replace("upper.material.storage", 1.01 * STORAGE)
    friction(warm)
    friction(warm)
    assert len(set(means._kept) - before) == 1
    # A program that has its table has no grid of the modulus.
    assert "iota" in primitives(friction, ON_ROAD)
    assert "iota" not in primitives(lambda v: friction(ON_ROAD, v), jnp.asarray(VELOCITY))


def test_changed_arrays_and_few_tables():
    storage = STORAGE.copy()
    first = friction(scene((RIGID, ROAD), (rubber(storage),)))
    storage *= 2.0
    second = friction(scene((RIGID, ROAD), (rubber(storage),)))
    known = jax.jit(friction)(scene((RIGID, ROAD), (rubber(2 * STORAGE),)))
    np.testing.assert_allclose(second, known, rtol=1e-13)
    assert (second[1:] != first[1:]).all()
    for factor in np.linspace(1.0, 2.0, 9):
        friction(ON_ROAD.replace("upper.material.storage", factor * STORAGE))
    assert len(means._kept) <= 4


@pytest.mark.parametrize("other", [scene((RIGID, ROAD), (TREAD,)), scene((RIGID,), (rubber(),))])
def test_scenes_that_have_none(other):
    assert known_tables(other, ("friction",), np.dtype(float)) is None


def test_a_number_that_is_traced_has_none():
    found = []

    def look(storage):
        one = scene((RIGID, ROAD), (rubber(storage),))
        found.append(known_tables(one, ("friction",), np.dtype(float)))

    jax.eval_shape(look, STORAGE)
    assert found == [None]
