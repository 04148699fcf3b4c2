"""Jacobians at many points against dense forward mode, for every kind of scene and for fits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import PROBLEMS, RIGID, ROAD, SHEAR, WLF
from support.jacobians import residuals, residuals_and_jacobian

import fitting
import rubberfric as rf
from fitting.solvers.problem import make_problem
from rubberfric.analysis import jacobian as jacobian_module
from rubberfric.analysis.jacobian import BLOCK, linearise_tree, uses_forward_mode, value_and_jacobian
from rubberfric.scene.scene import cast

COARSE = rf.Quadrature(order=6, panels=4, graded=3, angular_order=6)
TREAD = rf.Prony(3e6, [1e9, 1e8, 1e7], [1e-8, 1e-5, 1e-2], shift=WLF)
TABLE = rf.TabulatedModulus(
    np.logspace(-3, 6, 10), np.geomspace(1e6, 1e9, 10), np.geomspace(1e5, 3e8, 10), shift=WLF
)
WORN = rf.SelfAffine(150.0, 2000.0, 5e4, 0.7, 5e-5)
PLATE = rf.TabulatedSpectrum(np.logspace(2, 5, 6), np.geomspace(1e-12, 1e-20, 6))
STIFF_TABLE = rf.TabulatedModulus(
    np.logspace(-2, 7, 12), np.geomspace(1e7, 2e9, 12), np.geomspace(1e6, 2e8, 12), shift=WLF
)
HOT = rf.Heating(1.2e3, 1.6e3, 0.2, 2e-3, 0.2)
SCENES = {
    "smooth rubber": rf.Scene(rf.Body(RIGID, ROAD), rf.Body(TREAD)),
    "sheared": rf.Scene(rf.Body(RIGID, ROAD), rf.Body(TREAD), shear=SHEAR),
    "corrected": rf.Scene(rf.Body(RIGID, ROAD), rf.Body(TREAD), 0.6, area_correction=True, shear=SHEAR),
    "two rubbers": rf.Scene(rf.Body(rf.Prony(2e6, [3e8], [1e-6]), ROAD), rf.Body(TREAD, WORN)),
    "layers": rf.Scene(
        rf.Body(rf.Elastic(1e8, 0.3), PLATE, rf.Slab(1e-3)), rf.Body(TREAD, WORN, rf.Slab(2e-3))
    ),
    "tabulated": rf.Scene(rf.Body(RIGID, PLATE), rf.Body(TABLE)),
    "elastic": rf.Scene(rf.Body(RIGID, ROAD), rf.Body(rf.Elastic(1e7, 0.5)), shear=SHEAR),
    "law": PROBLEMS["law, rough elastic"].scene,
}


def arguments(scene, count):
    rng = np.random.default_rng(3)
    scene = cast(scene, float)
    shifted = "Elastic" not in str(type(scene.upper.material))
    conditions = (
        10 ** rng.uniform(-5, 1, count),
        10 ** rng.uniform(4, 6.5, count),
        rng.uniform(270.0, 320.0, count) if shifted else None,
    )
    leaves, tree = jax.tree_util.tree_flatten(scene)
    ends = np.cumsum([leaf.size for leaf in leaves])

    def scene_of(x):
        """Multiply each leaf by e^x, with separate elements of x for each number."""
        parts = [x[end - leaf.size : end] for end, leaf in zip(ends, leaves, strict=True)]
        scaled = [leaf * jnp.exp(part.reshape(leaf.shape)) for leaf, part in zip(leaves, parts, strict=True)]
        return tree.unflatten(scaled)

    return scene_of, jnp.zeros(sum(leaf.size for leaf in leaves)), conditions


HEATED = {
    "table": rf.Scene(
        rf.Body(RIGID, PLATE), rf.Body(TABLE), 0.6, area_correction=True, shear=SHEAR, heating=HOT
    ),
    "two tables": rf.Scene(rf.Body(STIFF_TABLE, PLATE), rf.Body(TABLE, WORN), heating=HOT),
}
ORDINARY = {("sheared", "friction")}
CASES = [
    pytest.param(name, quantity, marks=() if (name, quantity) in ORDINARY else pytest.mark.slow)
    for name in SCENES
    for quantity in ("area", "friction", "separation")
]


def compiled(scene_of, x, conditions, quantity):
    return jax.jit(lambda x: value_and_jacobian(scene_of, x, conditions, quantity, COARSE))(x)


@pytest.mark.parametrize(("name", "quantity"), CASES)
def test_equals_forward_mode(name, quantity):
    scene_of, x, conditions = arguments(SCENES[name], 5)

    def plain(x):
        solution = rf.solve(scene_of(x), *conditions, quadrature=COARSE, quantities=(quantity,))
        return getattr(solution, quantity)

    values, jacobian = compiled(scene_of, x, conditions, quantity)
    np.testing.assert_allclose(values, plain(x), rtol=1e-13)
    expected = np.asarray(jax.jit(jax.jacfwd(plain))(x))
    scale = np.abs(expected).max(1, keepdims=True) + np.abs(np.asarray(values))[:, None]
    assert np.max(np.abs(jacobian - expected) / scale) < 1e-12
    assert np.any(expected != 0)


POSITIVE = fitting.Positive()
SHARE = fitting.Bounded(0.3, 1.0)
FITS = {
    "moduli and hurst": ("smooth rubber", {"upper.material.E": POSITIVE, "lower.spectrum.hurst": SHARE}),
    "some moduli": ("corrected", {"upper.material.E[1:]": POSITIVE, "gamma": SHARE}),
    "shear alone": ("sheared", {"shear.tau_f0": POSITIVE, "upper.material.shift.C1": POSITIVE}),
    "tied": (
        "two rubbers",
        {
            "lower.material.E": POSITIVE,
            "upper.spectrum.q1": POSITIVE,
            "lower.spectrum.q1": fitting.Tied("upper.spectrum.q1"),
        },
    ),
    "layer and table": ("layers", {"upper.layer.thickness": POSITIVE, "lower.spectrum.C": POSITIVE}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FITS)
def test_first_step_of_a_fit_equals_a_dense_jacobian(name, monkeypatch):
    """Compare with forward mode through `solve`; a derivative set to zero by mistake must be noticed."""
    scene, free = SCENES[FITS[name][0]], FITS[name][1]
    v = np.geomspace(1e-5, 1.0, 6)
    data = [
        fitting.FrictionData(v, np.geomspace(0.5, 1.0, 6), pressure=3e5, temperature=290.0),
        fitting.AreaData(v, np.geomspace(0.01, 0.02, 6), pressure=3e5, temperature=290.0),
    ]
    problem = make_problem(scene, data, free, quadrature=COARSE)
    at = problem.structure, problem.numbers, jax.tree.map(jnp.asarray, problem.targets)
    x = jnp.asarray(problem.start)
    dense = jax.jit(jax.jacfwd(lambda x: residuals(*at, x)))(x)

    def error():
        rows, found = jax.jit(lambda x: residuals_and_jacobian(*at, x))(x)
        np.testing.assert_allclose(rows, residuals(*at, x), rtol=1e-10)
        return np.max(np.abs(found - dense)) / np.max(np.abs(dense))

    def wrong(function, x):
        found = linearise_tree(function, x)
        return found._replace(moving=found.moving[1:], push=lambda tangent: found.push(tangent)[1:])

    assert error() < 1e-12
    assert np.all(np.any(np.asarray(dense) != 0, axis=0))
    if uses_forward_mode(scene):  # without `linearise_tree`
        return
    monkeypatch.setattr(jacobian_module, "linearise_tree", wrong)
    assert error() > 1e-6


def test_leaves_that_do_not_move_are_found_by_jax():
    """Integers, constants and stopped derivatives have zero tangents; complex intermediates have not."""

    def tree(x):
        through_complex = jnp.abs(x[0] * (1 + 1j)) ** 2
        still = [jax.lax.stop_gradient(x), jnp.ones(2), jnp.argsort(x), "text", None]
        return [x[1:], through_complex, *still, jax.lax.fori_loop(0, 3, lambda _, y: y * x[0], 1.0)]

    found = linearise_tree(tree, jnp.array([2.0, 3.0, 5.0]))
    assert [found.leaves[i].shape for i in found.moving] == [(2,), (), ()]
    slice_, square, cube = found.push(jnp.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(slice_, 0.0)
    np.testing.assert_allclose([square, cube], [8.0, 12.0], rtol=1e-14)
    assert found.tree({found.moving[1]: -1.0})[1] == -1.0 and "text" in found.leaves


def test_a_tangent_is_traced_once_for_all_leaves():
    """Every further copy of the mesh's derivatives lengthens the compilation of a fit."""
    found = linearise_tree(lambda x: [jnp.sin(k * x) for k in range(1, 6)], jnp.array([2.0, 3.0]))
    traced = str(jax.make_jaxpr(found.push)(jnp.ones(2)))
    assert len(found.moving) == 5 and traced.count(" mul ") <= 10


@pytest.mark.slow
@pytest.mark.parametrize("name", HEATED)
def test_heated_tables_equal_forward_mode(name):
    """Compare along two directions of all numbers: temperatures and their derivatives are iterated."""
    of_leaves, leaves, conditions = arguments(HEATED[name], 4)
    directions = 0.3 * np.random.default_rng(5).standard_normal((2, leaves.size))

    def scene_of(x):
        return of_leaves(leaves + x @ directions)

    def plain(x):
        return rf.solve(scene_of(x), *conditions, quadrature=COARSE, quantities=("friction",)).friction

    x = jnp.zeros(2)
    values, jacobian = compiled(scene_of, x, conditions, "friction")
    value, push = jax.jit(lambda x: jax.jvp(plain, (x,), (jnp.array([1.0, -0.5]),)))(x)
    np.testing.assert_allclose(values, value, rtol=1e-11)
    np.testing.assert_allclose(jacobian @ jnp.array([1.0, -0.5]), push, rtol=1e-7)
    assert np.all(np.abs(push) > 1e-3 * value)


@pytest.mark.slow
def test_more_points_than_a_block():
    scene_of, x, conditions = arguments(SCENES["sheared"], 2 * BLOCK + 7)
    values, jacobian = compiled(scene_of, x, conditions, "area")
    assert values.shape == (2 * BLOCK + 7,) and jacobian.shape == (2 * BLOCK + 7, x.size)
    for part in (slice(BLOCK - 1, BLOCK + 2), slice(-3, None)):
        here = tuple(c[part] for c in conditions)
        few, slopes = compiled(scene_of, x, here, "area")
        np.testing.assert_allclose(few, values[part], rtol=1e-13)
        np.testing.assert_allclose(slopes, jacobian[part], rtol=1e-9, atol=1e-12)


def test_jacobian_is_zero_if_nothing_depends_on_x():
    scene_of, x, conditions = arguments(SCENES["smooth rubber"], 4)
    fixed = scene_of(x)
    values, jacobian = compiled(lambda _: fixed, x, conditions, "friction")
    assert np.all(values > 0) and np.all(np.asarray(jacobian) == 0)


def test_float32_stays():
    scene_of, x, conditions = arguments(SCENES["smooth rubber"], 3)
    single = cast(scene_of(x), jnp.float32)

    def scaled(y):
        return jax.tree.map(lambda leaf: leaf * jnp.exp(y[0]), single)

    at = tuple(np.asarray(c, np.float32) for c in conditions)
    values, jacobian = compiled(scaled, jnp.zeros(1, jnp.float32), at, "area")
    assert values.dtype == jacobian.dtype == jnp.float32
    assert np.all(np.isfinite(jacobian))
