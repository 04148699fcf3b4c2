"""Free parameters: key paths, and the maps between a scene's numbers and a solver's x."""

import dataclasses
import itertools

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import optax
import pytest
from support.refusals import one_line
from support.scenes.fits import FOUR_WARM, SHEAR, E

import fitting
import rubberfric as rf
from fitting import Bounded, Free, Positive, Tied
from fitting.parameters.scenes import find, scene_paths
from fitting.parameters.variables import element_names, free_parameters, slopes, to_scene, to_values
from rubberfric.scene.scene import cast

SCENE = cast(FOUR_WARM, np.float64)
RUBBER = SCENE.upper.material
SHEARED = cast(SCENE.replace(shear=SHEAR), np.float64)


def leaves(scene):
    """Key path -> leaf."""
    return dict(zip(scene_paths(scene), map(np.asarray, jax.tree_util.tree_leaves(scene)), strict=True))


def test_paths_are_those_of_the_scene_in_the_order_of_its_leaves():
    for path, leaf in zip(scene_paths(SHEARED), jax.tree_util.tree_leaves(SHEARED), strict=True):
        value = SHEARED
        for name in path.split("."):
            value = getattr(value, name)
        assert value is leaf, path


@pytest.mark.parametrize(
    ("path", "elements"),
    [
        ("", (0, 1, 2, 3)),
        ("[0]", (0,)),
        ("[-1]", (3,)),
        ("[ 2 ]", (2,)),
        ("[1:]", (1, 2, 3)),
        ("[:2]", (0, 1)),
        ("[:-1]", (0, 1, 2)),
        ("[-2:]", (2, 3)),
        ("[:]", (0, 1, 2, 3)),
        ("[2:99]", (2, 3)),
    ],
)
def test_elements(path, elements):
    leaf, found = find(SCENE, E + path)
    assert scene_paths(SCENE)[leaf] == E
    assert found == elements
    layout, constants, x = free_parameters(SCENE, {E + path: Positive()})
    assert element_names(layout) == [f"{E}[{i}]" for i in elements]
    np.testing.assert_allclose(np.exp(x), np.asarray(RUBBER.E)[list(elements)], rtol=1e-14)
    scene = to_scene(layout, constants, jnp.log(jnp.arange(1.0, 1 + len(elements))))
    expected = np.array(RUBBER.E)
    expected[list(elements)] = np.arange(1.0, 1 + len(elements))
    np.testing.assert_allclose(scene.upper.material.E, expected, rtol=1e-14)


def test_a_scalar_has_no_elements():
    leaf, found = find(SCENE, "gamma")
    assert scene_paths(SCENE)[leaf] == "gamma" and found is None
    assert element_names(free_parameters(SCENE, {"gamma": Positive()})[0]) == ["gamma"]


RULES = [
    (Positive(), [1e-300, 1e-9, 1.0, 4e8, 1e300]),
    (Bounded(0.3, 1.0), [0.3000001, 0.31, 0.65, 0.9, 0.9999999]),
    (Bounded(-5.0, 5e3), [-4.9, 0.0, 1.0, 4e3]),
    (Bounded(1e-30, 1e-20), [1e-29, 5e-21]),
    (Free(), [-3e8, -1.0, -1e-9, 1e-9, 7.0, 1e200]),
    (Free(scale=2.5), [-3.0, 0.0, 5.0]),
]


@pytest.mark.parametrize(("rule", "value"), [(rule, value) for rule, values in RULES for value in values])
def test_from_value_to_x_and_back(rule, value):
    """At the start, and x -> value -> start= -> x at other places."""
    rule = dataclasses.replace(rule, start=value)
    layout, constants, x = free_parameters(SCENE, {"gamma": rule})
    back = float(to_values(layout, constants, jnp.asarray(x))[0])
    # Inside bounds, digits count from the lower one.
    smallest = 1e-15 * (rule.high - rule.low) if isinstance(rule, Bounded) else 0.0
    assert back == pytest.approx(value, rel=3e-13, abs=smallest)
    for other in (-3.0, -0.1, 0.7, 2.0):
        there = float(to_values(layout, constants, jnp.asarray(x + other))[0])
        if isinstance(rule, Bounded) and min(there - rule.low, rule.high - there) < 1e-7 * (
            rule.high - rule.low
        ):
            continue  # rounding of a value beside its bound is all that is left of x
        again = free_parameters(SCENE, {"gamma": dataclasses.replace(rule, start=there)})
        # A Free one without a scale takes it from the start value: value / |value|.
        scale = 1.0 if not isinstance(rule, Free) or rule.scale else abs(there) / abs(value)
        assert float(again[2][0]) * scale == pytest.approx(float(x[0] + other), rel=1e-7, abs=1e-12)


@pytest.mark.parametrize("x", [-30.0, -2.0, 0.0, 0.3, 5.0, 30.0])
def test_values_and_slopes_are_those_of_the_formulas(x):
    """The table in the module's docstring, and its derivatives, with 40 digits."""
    free = {
        "gamma": Positive(),
        "lower.spectrum.hurst": Bounded(0.3, 1.0),
        "upper.material.E_inf": Free(scale=2.5),
    }
    layout, constants, _ = free_parameters(SCENE, free)
    at = jnp.full(3, x)
    with mpmath.workdps(40):
        low, width = mpmath.mpf(0.3), mpmath.mpf(1.0 - 0.3)
        formulas = (mpmath.exp, lambda y: low + width / (1 + mpmath.exp(-y)), lambda y: mpmath.mpf(2.5) * y)
        values = [float(f(mpmath.mpf(x))) for f in formulas]
        derivatives = [float(mpmath.diff(f, mpmath.mpf(x))) for f in formulas]
    np.testing.assert_allclose(to_values(layout, constants, at), values, rtol=1e-14)
    # Close to the upper bound the derivative of a logistic function loses digits, like its value.
    np.testing.assert_allclose(slopes(layout, constants, at), derivatives, rtol=1e-13, atol=2e-16)


EVERY_RULE = {
    E: Positive(),
    "lower.spectrum.hurst": Bounded(0.3, 1.0),
    "gamma": Tied("lower.spectrum.hurst"),
    "upper.material.E_inf": Free(),
}


def test_slopes_are_the_diagonal_of_the_jacobian():
    layout, constants, x = free_parameters(SCENE, EVERY_RULE)
    jacobian = jax.jit(jax.jacfwd(lambda x: to_values(layout, constants, x)))(jnp.asarray(x))
    np.testing.assert_allclose(jacobian, np.diag(slopes(layout, constants, jnp.asarray(x))), rtol=1e-15)


@pytest.mark.parametrize(
    ("rule", "x", "value"),
    [
        (Positive(), 700.0, float(mpmath.exp(700))),
        (Positive(), -700.0, float(mpmath.exp(-700))),
        (Bounded(0.3, 1.0), 800.0, 1.0),
        (Bounded(0.3, 1.0), -800.0, 0.3),
        (Bounded(-1e300, 1e300), 800.0, 1e300),
        (Free(scale=1e-3), 1e300, 1e297),
        (Free(scale=1e3), -1e-300, -1e-297),
    ],
)
def test_far_out_values_and_gradients_are_finite(rule, x, value):
    free = {"gamma": dataclasses.replace(rule, start=0.5)}
    layout, constants, _ = free_parameters(SCENE, free)
    at = jnp.asarray([x])
    assert float(to_values(layout, constants, at)[0]) == pytest.approx(value, rel=1e-13)
    gradient = jax.jit(jax.grad(lambda x: to_values(layout, constants, x)[0]))(at)
    assert np.isfinite(gradient).all() and np.isfinite(slopes(layout, constants, at)).all()
    np.testing.assert_allclose(gradient, slopes(layout, constants, at), rtol=1e-15)


def test_a_bounded_value_never_leaves_its_bounds():
    x = jnp.concatenate([jnp.linspace(-800.0, 800.0, 4001), jnp.asarray([-jnp.inf, jnp.inf])])
    layout, constants, _ = free_parameters(SCENE, {"lower.spectrum.hurst": Bounded(0.3, 1.0)})
    value = jax.jit(jax.vmap(lambda x: to_values(layout, constants, x[None])[0]))(x)
    assert float(value.min()) >= 0.3 and float(value.max()) <= 1.0
    assert np.all(np.diff(value[:-2]) >= 0)


def test_start_gives_the_start_instead_of_the_scene():
    free = {
        E: Positive([1e9, 2e9, 3e9, 4e9]),
        "upper.material.tau[1:]": Positive(2e-4),
        "lower.spectrum.hurst": Bounded(0.3, 1.0, start=0.5),
        "upper.material.E_inf": Free(start=-2.0, scale=10.0),
        "gamma": Tied("lower.spectrum.hurst"),
    }
    layout, constants, x = free_parameters(SCENE, free)
    scene = to_scene(layout, constants, jnp.asarray(x))
    np.testing.assert_allclose(scene.upper.material.E, [1e9, 2e9, 3e9, 4e9], rtol=1e-14)
    np.testing.assert_allclose(scene.upper.material.tau, [1e-7, 2e-4, 2e-4, 2e-4], rtol=1e-14)
    assert float(scene.lower.spectrum.hurst) == pytest.approx(0.5, rel=1e-15)
    assert float(scene.upper.material.E_inf) == -2.0 and x[-1] == -0.2
    # Tied parameters keep the ratio of the start values, not of the scene's values.
    assert float(scene.gamma) == pytest.approx(0.5, rel=1e-14)


def test_a_value_of_zero_can_be_free_but_not_positive():
    dry = cast(dataclasses.replace(SHEARED, shear=rf.ContactShear(0.0, 0.1, 6e-3)), np.float64)
    assert "starts at 0" in one_line(lambda: free_parameters(dry, {"shear.tau_f0": Positive()}))
    layout, constants, x = free_parameters(dry, {"shear.tau_f0": Free()})
    assert x == [0.0] and float(to_scene(layout, constants, jnp.asarray([2.0])).shear.tau_f0) == 2.0


def test_tied_elements_keep_their_ratio_to_their_source():
    free = {"gamma": Positive(), E + "[1:]": Tied(E + "[0]"), E + "[0]": Positive()}
    layout, constants, x = free_parameters(SCENE, free)
    assert layout.size == 2 and element_names(layout) == ["gamma", E + "[0]"]
    scene = to_scene(layout, constants, jnp.asarray(x) + np.log([1.0, 3.0]))
    np.testing.assert_allclose(scene.upper.material.E, 3 * np.array(RUBBER.E), rtol=1e-13)
    free = {E: Positive(), "upper.material.tau": Tied(E)}
    layout, constants, x = free_parameters(SCENE, free)
    factor = np.array([2.0, 3.0, 5.0, 7.0])
    scene = to_scene(layout, constants, jnp.asarray(x) + np.log(factor))
    np.testing.assert_allclose(scene.upper.material.tau, factor * np.array(RUBBER.tau), rtol=1e-13)
    free = {"upper.material.E_inf": Positive(), E + "[:2]": Tied("upper.material.E_inf", ratio=10.0)}
    layout, constants, x = free_parameters(SCENE, free)
    scene = to_scene(layout, constants, jnp.asarray(x))
    np.testing.assert_allclose(scene.upper.material.E, [3e7, 3e7, 8e6, 2e6], rtol=1e-14)
    free = {E + "[0]": Positive(), "upper.material.E_inf": Tied(E + "[0]")}
    layout, constants, x = free_parameters(SCENE, free)

    def relaxed(x):
        return to_scene(layout, constants, x).upper.material.E_inf

    assert float(jax.jit(jax.grad(relaxed))(jnp.asarray(x))[0]) == pytest.approx(3e6, rel=1e-13)


def test_to_scene_touches_only_what_is_free():
    free = {E + "[1]": Positive(), "lower.spectrum.hurst": Bounded(0.3, 1.0), "shear.v0": Positive()}
    layout, constants, x = free_parameters(SHEARED, free)
    scene = to_scene(layout, constants, jnp.asarray(x) + 0.5)
    assert jax.tree.structure(scene) == jax.tree.structure(SHEARED)
    touched = set()
    for path, before in leaves(SHEARED).items():
        after = leaves(scene)[path]
        assert after.shape == before.shape and after.dtype == before.dtype, path
        if np.any(after != before):
            touched.add(path)
    assert touched == {E, "lower.spectrum.hurst", "shear.v0"}
    changed = np.flatnonzero(np.asarray(scene.upper.material.E) != np.asarray(RUBBER.E))
    assert changed.tolist() == [1]


def test_float32_scenes_keep_their_dtype():
    scene = cast(SHEARED, np.float32)
    free = {
        E + "[1]": Positive(),
        "upper.material.tau": Positive(),
        "lower.spectrum.hurst": Bounded(0.3, 1.0),
        "gamma": Tied("lower.spectrum.hurst"),
        "shear.v0": Free(),
    }
    layout, constants, x = free_parameters(scene, free)
    constants, x = cast((constants, x), np.float32)
    assert {a.dtype for a in jax.tree.leaves(to_scene(layout, constants, x))} == {np.dtype(np.float32)}
    gradient = jax.jit(jax.grad(lambda x: to_scene(layout, constants, x).gamma))(x)
    assert gradient.dtype == np.float32 and np.isfinite(gradient).all()


def test_layouts_of_one_structure_are_equal_and_hash_alike():
    rest = {"lower.spectrum.hurst": Bounded(0.3, 1.0), "gamma": Tied("lower.spectrum.hurst")}
    free = {E + "[1:]": Positive(), **rest}
    other = jax.tree.map(lambda leaf: leaf * 1.01, SCENE)
    one, _, _ = free_parameters(SCENE, free)
    two, _, _ = free_parameters(other, free | {"lower.spectrum.hurst": Bounded(0.2, 0.95)})
    assert one == two and hash(one) == hash(two)
    for change in (
        {E + "[1:]": Free(), **rest},
        {E + "[:3]": Positive(), **rest},
        {E + "[1:]": Positive(), "lower.spectrum.hurst": Bounded(0.3, 1.0)},
    ):
        assert free_parameters(SCENE, change)[0] != one
    # A static field of the scene changes the compiled function, too.
    assert free_parameters(dataclasses.replace(SCENE, area_correction=True), free)[0] != one


def test_every_order_of_freeing_gives_the_same_scene():
    free = {E + "[2]": Positive(), "gamma": Bounded(0.1, 0.9), "upper.material.tau[2]": Tied(E + "[2]")}
    expected = None
    for order in itertools.permutations(free):
        layout, constants, x = free_parameters(SCENE, {path: free[path] for path in order})
        scene = to_scene(layout, constants, jnp.asarray(x) + np.where(x > 1, 1.0, 0.25))
        expected = scene if expected is None else expected
        for a, b in zip(jax.tree.leaves(scene), jax.tree.leaves(expected), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-15)


def test_an_optimiser_on_unconstrained_numbers():
    """Adam moves h_rms by its own scale, keeps H within its bounds, and lowers the cost."""
    free = {"lower.spectrum.h_rms": Positive(), "lower.spectrum.hurst": Bounded(0.3, 1.0)}
    x, to_scene = fitting.unconstrained(SCENE, free)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-15), to_scene(x), SCENE)
    assert x.shape == (2,)
    np.testing.assert_allclose(x[0], np.log(SCENE.lower.spectrum.h_rms), rtol=1e-15)
    target = 1.3 * SCENE.lower.spectrum.h_rms
    optimiser = optax.adam(0.05)
    state = optimiser.init(x)
    slope = jax.jit(jax.grad(lambda x: jnp.log(to_scene(x).lower.spectrum.h_rms / target) ** 2))
    for _ in range(200):
        change, state = optimiser.update(slope(x), state)
        x = optax.apply_updates(x, change)
    np.testing.assert_allclose(to_scene(x).lower.spectrum.h_rms, target, rtol=1e-3)
    far = jax.jit(jax.vmap(to_scene))(jnp.array([[0.0, -50.0], [0.0, 50.0]]))
    assert np.all((far.lower.spectrum.hurst >= 0.3) & (far.lower.spectrum.hurst <= 1.0))
