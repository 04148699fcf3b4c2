"""CONTRIBUTING's material in every place of a scene. With alpha = 1 it is a Prony series of one term."""

import jax
import numpy as np
import pytest
from problems import ROAD, SOFTENING, WORN
from support.cases.stored import slow_if
from support.folders import RECIPE

import fitting
import rubberfric as rf
from rubberfric.base import forget
from rubberfric.theory import paper

RIGID = rf.Body(rf.Rigid(), ROAD)
BASE = rf.Prony(3e6, [1e8, 1e7], [1e-5, 1e-2], 0.48)
SCENES = {
    "half-space": lambda one: rf.Scene(RIGID, rf.Body(one)),
    "second rubber": lambda one: rf.Scene(rf.Body(BASE, ROAD), rf.Body(one, WORN)),
    "coating": lambda one: rf.Scene(RIGID, rf.Body(one, layer=rf.Coating(1e-3, BASE))),
    "base": lambda one: rf.Scene(RIGID, rf.Body(BASE, layer=rf.Coating(1e-3, one))),
    "softened": lambda one: rf.Scene(RIGID, rf.Body(one, softening=SOFTENING)),
    "grooved": lambda one: rf.Scene(rf.Body(rf.Rigid(), rf.Anisotropic(ROAD, 1.6, 0.5)), rf.Body(one)),
}
V = np.array([1e-3, 0.3, 20.0])
FILE = """
[lower]
material = { kind = "rigid" }
spectrum = { kind = "self_affine", q0 = 100, qr = 1000, q1 = 1e4, hurst = 0.8, h_rms = 1e-4 }
[upper]
material = { kind = "recipe_solid", E_inf = 3e6, E = 1e9, tau = 1e-6, alpha = 0.5 }
"""


@pytest.fixture(scope="module")
def zener():
    names = {}
    # Another name, because the library may have got the recipe's material.
    exec(compile(RECIPE.replace("FractionalZener", "RecipeSolid"), "CONTRIBUTING.md", "exec"), names)
    yield names["RecipeSolid"]
    forget(names["RecipeSolid"])


def test_files_modulus_gradient_and_messages(zener, tmp_path):
    """The class has them without a line more."""
    (tmp_path / "scene.toml").write_text(FILE)
    scene = rf.load_scene(tmp_path / "scene.toml")
    assert isinstance(scene.upper.material, zener)
    omega = np.logspace(-5, 17, 12)
    exact = 3e6 + 1e9 / (1 + (1e-6j * omega) ** -0.5)
    np.testing.assert_allclose(rf.complex_modulus(scene.upper.material, omega), exact, rtol=1e-13)
    rf.save_scene(tmp_path / "scene.h5", scene)
    again = rf.load_scene(tmp_path / "scene.h5")
    slope = jax.jit(jax.grad(lambda s: rf.friction(s.replace("upper.material.tau", 1e-5), 0.01, 1e5)))(again)
    assert np.isfinite(slope.upper.material.alpha) and slope.upper.material.alpha != 0
    assert "upper.material.alpha" in scene._repr_html_()
    with pytest.raises(ValueError, match=r"RecipeSolid\.alpha = 2\.0: must be between 0\.3 and 1\.0"):
        scene.replace("upper.material.alpha", 2.0)


@pytest.mark.parametrize("name", slow_if(lambda name: name != "half-space", SCENES.keys()))
def test_it_equals_a_prony_series(name, zener):
    """Values, and the derivatives by its three moduli and times."""

    def friction(one, numbers):
        solid = zener(*numbers, alpha=1.0) if one else rf.Prony(numbers[0], numbers[1:2], numbers[2:], 0.5)
        return rf.friction(SCENES[name](solid), V, 2e5)

    numbers = np.array([4e6, 8e8, 1e-6])
    found, wanted = (jax.jit(lambda x, one=one: friction(one, x))(numbers) for one in (True, False))
    np.testing.assert_allclose(found, wanted, rtol=1e-9)
    slopes = [
        jax.jit(jax.jacrev(lambda x, one=one: friction(one, x)))(numbers) * numbers for one in (True, False)
    ]
    np.testing.assert_allclose(*slopes, rtol=1e-7, atol=1e-9)


def test_it_agrees_with_the_paper(zener):
    scene = SCENES["half-space"](zener(4e6, 8e8, 1e-6, 0.6))
    exact = paper.solve(scene, V, 2e5, nodes=paper.gauss_nodes(panels=10, step=0.1))
    np.testing.assert_allclose(rf.friction(scene, V, 2e5), exact.friction, rtol=1e-7)


@pytest.mark.slow
def test_a_fit_finds_its_exponent(zener):
    truth = SCENES["half-space"](zener(4e6, 8e8, 1e-6, 0.6))
    v = np.logspace(-3, 2, 12)
    mu = np.asarray(rf.friction(truth, v, 2e5))
    data = fitting.FrictionData(velocity=v, friction=mu, pressure=2e5, sigma=1e-3)
    start = truth.replace({"upper.material.alpha": 0.75, "upper.material.tau": 2e-6})
    found = fitting.fit(
        start,
        data,
        {"upper.material.alpha": fitting.Bounded(0.3, 1.0), "upper.material.tau": fitting.Positive()},
    )
    assert found.scene.upper.material.alpha == pytest.approx(0.6, rel=1e-4)
    assert found.scene.upper.material.tau == pytest.approx(1e-6, rel=1e-3)
