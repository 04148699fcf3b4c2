"""A second law of contact shear is one class: friction, gradients, scene files, maps and fits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import ROAD, WLF
from support.oracles.numerical import derivatives
from support.scenes.fits import FAST

import fitting
import rubberfric as rf
from rubberfric.base import POSITIVE, Number, child, forget, leaf, physical
from rubberfric.materials.shifts import Shift
from rubberfric.scene.interface import ShearLaw

V = np.array([1e-4, 1e-2, 1.0])


@pytest.fixture(scope="module")
def law():
    class Rising(ShearLaw):
        """tau_f = tau_0 a_T v / (v_0 + a_T v)."""

        tau_0: Number = leaf(POSITIVE, unit="Pa")
        v_0: Number = leaf(POSITIVE, unit="m/s")
        shift: Shift | None = child(default=None)

        def stress(self, log_speed):
            return self.tau_0 * jax.nn.sigmoid(log_speed - jnp.log(self.v_0))

    yield physical(Rising)
    forget(Rising)


@pytest.fixture
def scene(law):
    rubber = rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3], shift=WLF)
    return rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(rubber), shear=law(5e6, 1e-2, WLF))


def shear_friction(*arguments):
    return rf.solve(*arguments, quantities="shear_friction").shear_friction


def test_friction(scene):
    """(tau_f / sigma_0) (A / A_0), odd in the velocity, 0 at rest."""
    p, T = 2e5, 300.0
    area = np.asarray(rf.contact_area(scene, V, p, T))
    speed = V * np.exp(float(WLF.log_factor(T)))
    expected = 5e6 * speed / (1e-2 + speed) * area / p
    np.testing.assert_allclose(shear_friction(scene, V, p, T), expected, rtol=1e-12)
    np.testing.assert_allclose(shear_friction(scene, -V, p, T), -expected, rtol=1e-12)
    assert float(shear_friction(scene, 0.0, p, T)) == 0.0


def test_gradient(scene):
    def friction(x):
        changed = scene.replace({"shear.tau_0": 5e6 * jnp.exp(x[0]), "shear.v_0": 1e-2 * jnp.exp(x[1])})
        return rf.friction(changed, 1e-2, 2e5, 300.0)

    slopes = jax.grad(friction)(jnp.zeros(2))
    np.testing.assert_allclose(slopes, derivatives(friction, 2, 1e-4), rtol=1e-7)


@pytest.mark.parametrize("suffix", ["toml", "h5"])
def test_files(scene, tmp_path, suffix):
    rf.save_scene(tmp_path / f"scene.{suffix}", scene)
    again = rf.load_scene(tmp_path / f"scene.{suffix}")
    assert rf.same(again, scene) and type(again.shear) is type(scene.shear)
    # A table without a kind is the law of the library.
    (tmp_path / "old.toml").write_text(
        '[lower]\nmaterial = { kind = "rigid" }\n[upper]\nmaterial = { kind = "elastic", young = 1e6,'
        " poisson = 0.5 }\n[shear]\ntau_f0 = 1e6\nc = 0.1\nv0 = 1e-2\n"
    )
    assert isinstance(rf.load_scene(tmp_path / "old.toml").shear, rf.ContactShear)


@pytest.mark.slow
def test_a_map_and_a_fit(scene):
    grid = rf.friction_map(scene, V, [1e5, 2e5], [300.0])
    exact = rf.friction(scene, V, 2e5, 300.0)
    np.testing.assert_allclose(np.asarray(grid.solution.friction)[0, 1], exact, rtol=1e-6)
    v = np.geomspace(1e-4, 1.0, 12)
    data = fitting.FrictionData(
        v, rf.friction(scene, v, 2e5, 300.0), pressure=2e5, temperature=300.0, relative=0.01
    )
    start = scene.replace({"shear.tau_0": 3e6, "shear.v_0": 5e-2})
    free = {"shear.tau_0": fitting.Positive(), "shear.v_0": fitting.Positive()}
    found = fitting.fit(start, data, free, quadrature=FAST)
    np.testing.assert_allclose(found.values, [5e6, 1e-2], rtol=1e-4)
