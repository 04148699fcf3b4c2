"""A kind is one class: a material and a shift that this file alone defines do all that the others do."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.html_tables import pairs
from support.scenes.examples import same
from support.scenes.fits import AFFINE as ROAD
from support.scenes.fits import FAST

import fitting
import rubberfric as rf
from fitting.parameters.scenes import find, scene_paths
from rubberfric.base import POSITIVE, Number, between, child, forget, leaf, physical
from rubberfric.base.checks import PLAUSIBLE_STRESS, PLAUSIBLE_TEMPERATURE
from rubberfric.materials.material import Material, plane_strain_factor
from rubberfric.materials.shifts import Shift, saturated


def vogel_fulcher():
    class VogelFulcher(Shift):
        """ln a_T = B / (T - T_0) - B / (T_ref - T_0)."""

        B: Number = leaf(POSITIVE, unit="K")
        T_0: Number = leaf(POSITIVE, unit="K")
        T_ref: Number = leaf(POSITIVE, unit="K", plausible=PLAUSIBLE_TEMPERATURE)

        def log_factor(self, temperature):
            return saturated(self.B / (temperature - self.T_0) - self.B / (self.T_ref - self.T_0))

    return VogelFulcher


def havriliak_negami():
    class HavriliakNegami(Material):
        """E = E_glassy - (E_glassy - E_inf) / (1 + (i omega tau)^a)^b."""

        E_inf: Number = leaf(POSITIVE, unit="Pa", plausible=PLAUSIBLE_STRESS)
        E_glassy: Number = leaf(POSITIVE, unit="Pa")
        tau: Number = leaf(POSITIVE, unit="s")
        a: Number = leaf(between(0.3, 1.0), unit="-")
        b: Number = leaf(between(0.3, 1.0), unit="-")
        poisson: Number = leaf(between(0.0, 0.5), unit="-", default=0.5)
        shift: Shift | None = child(default=None)

        def frequency_range(self):
            return 1e-10 / self.tau, 1e10 / self.tau

        def modulus(self, omega):
            s = jnp.exp(self.a * (jnp.log(omega * self.tau) + 0.5j * np.pi))
            return self.E_glassy - (self.E_glassy - self.E_inf) * jnp.exp(-self.b * jnp.log1p(s))

    return HavriliakNegami


NUMBERS = {"E_inf": 3e6, "E_glassy": 5e8, "tau": 1e-6, "a": 0.5, "b": 0.8}
SHIFT = {"B": 900.0, "T_0": 170.0, "T_ref": 293.15}
V = np.array([1e-3, 1e-1, 10.0])
TOML = f"""
[lower]
material = {{ kind = "rigid" }}
spectrum = {{ kind = "self_affine", q0 = 1e2, qr = 1e3, q1 = 3e4, hurst = 0.8, h_rms = 5e-4 }}
[upper.material]
kind = "havriliak_negami"
shift = {{ kind = "vogel_fulcher", {", ".join(f"{key} = {value}" for key, value in SHIFT.items())} }}
""" + "".join(f"{key} = {value}\n" for key, value in NUMBERS.items())


@pytest.fixture(scope="module")
def kinds():
    """The new classes by their names, known while these tests run."""
    made = [physical(cls()) for cls in (vogel_fulcher, havriliak_negami)]
    yield {cls.__name__: cls for cls in made}
    for cls in made:
        forget(cls)


@pytest.fixture(scope="module")
def scene(kinds):
    material = kinds["HavriliakNegami"](**NUMBERS, shift=kinds["VogelFulcher"](**SHIFT))
    return rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(material))


def test_toml(scene, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(TOML)
    same(rf.load_scene(path), scene)
    path.write_text(TOML.replace("T_0", "T_O"))
    with pytest.raises(ValueError, match=r"upper\.material\.shift\.T_O: unknown key; did you mean 'T_0'\?"):
        rf.load_scene(path)
    path.write_text(TOML.replace("E_inf = 3000000.0", "E_inf = 3"))
    with pytest.raises(ValueError, match=r"upper\.material\.E_inf = 3 Pa: must be 100 .* is it in MPa"):
        rf.load_scene(path)
    path.write_text(TOML.replace("T_ref = 293.15", "T_ref = 20"))
    with pytest.raises(ValueError, match=r"upper\.material\.shift\.T_ref = 20 K: .* is it in °C"):
        rf.load_scene(path)


def test_files_html_and_key_paths(scene, tmp_path):
    path = tmp_path / "scene.h5"
    rf.save_scene(path, scene)
    same(rf.load_scene(path), scene)
    found = pairs(scene)
    assert found["upper.material"] == "HavriliakNegami"
    assert found["upper.material.E_inf"] == "3e+06 Pa"
    assert found["upper.material.shift.B"] == "900 K"
    assert scene_paths(scene)[find(scene, "upper.material.shift.B")[0]] == "upper.material.shift.B"
    with pytest.raises(ValueError, match=r"did you mean 'upper\.material\.tau'\?"):
        find(scene, "upper.material.tan")
    assert float(scene.replace("upper.material.shift.B", 800.0).upper.material.shift.B) == 800


def test_fields_are_checked(scene):
    with pytest.raises(ValueError, match=r"^upper\.material: HavriliakNegami\.tau = -1\.0: must be > 0$"):
        scene.replace("upper.material.tau", -1)
    allowed = "Rigid, Elastic, Prony, PronyShear, TabulatedModulus, HavriliakNegami"
    with pytest.raises(ValueError, match=rf"^Body\.material = None: must be {allowed}$"):
        rf.Body(None)
    with pytest.raises(ValueError, match=r"must be WLF, Arrhenius, TabulatedShift, VogelFulcher or None$"):
        scene.replace("upper.material.shift", 1)


def formula(omega):
    """E of the material, without its code."""
    s = (1j * omega * NUMBERS["tau"]) ** NUMBERS["a"]
    return NUMBERS["E_glassy"] - (NUMBERS["E_glassy"] - NUMBERS["E_inf"]) / (1 + s) ** NUMBERS["b"]


def test_modulus(scene):
    omega, material = np.logspace(-3, 12, 31), scene.upper.material
    np.testing.assert_allclose(rf.complex_modulus(material, omega), formula(omega), rtol=2e-4)
    hot = rf.complex_modulus(material, omega, 320.0)
    a_T = np.exp(900 / (320 - 170) - 900 / (293.15 - 170))
    np.testing.assert_allclose(hot, formula(a_T * omega), rtol=2e-4)
    poisson = float(plane_strain_factor(material))
    assert float(material.static_reduced()) == pytest.approx(3e6 * poisson, rel=1e-3)
    glassy = abs(formula(1e30))
    assert float(material.glassy_reduced()) == pytest.approx(glassy * poisson, rel=1e-3)


def table_of(material):
    """The modulus as a master curve."""
    omega = np.logspace(-4, 16, 801)
    E = np.asarray(rf.complex_modulus(material, omega))
    return rf.TabulatedModulus(omega, E.real, E.imag)


@jax.jit
def friction(scene, temperature):
    return rf.friction(scene, V, 1e5, temperature, quadrature=FAST)


@pytest.mark.slow
def test_friction_and_its_derivatives(scene):
    """The value of a master curve with many entries; derivatives are differences."""
    table = scene.replace("upper.material", table_of(scene.upper.material))
    value = np.asarray(friction(scene, None))
    np.testing.assert_allclose(value, friction(table, None), rtol=1e-3)

    @jax.jit
    def total(x):
        changed = scene.replace({"upper.material.tau": x[0] * 1e-6, "upper.material.shift.B": 900 * x[1]})
        return jnp.sum(friction(changed, 305.0))

    x, step = jnp.ones(2), 1e-4
    slopes = [(total(x + step * e) - total(x - step * e)) / (2 * step) for e in np.eye(2)]
    np.testing.assert_allclose(jax.jit(jax.grad(total))(x), slopes, rtol=1e-5)


@pytest.mark.slow
def test_fit(scene):
    """A time and a parameter of the shift, from frictions that the scene itself gives."""
    v, T = np.repeat(np.logspace(-4, 1, 4), 2), np.tile([293.15, 313.15], 4)
    mu = rf.friction(scene, v, 1e5, T, quadrature=FAST)
    data = fitting.FrictionData(v, np.asarray(mu), pressure=1e5, temperature=T, relative=np.full(8, 0.01))
    start = scene.replace({"upper.material.tau": 3e-6, "upper.material.shift.B": 850.0})
    free = {"upper.material.tau": fitting.Positive(), "upper.material.shift.B": fitting.Bounded(500, 1500)}
    result = fitting.fit(start, data, free, quadrature=FAST)
    assert result.success
    np.testing.assert_allclose(result.values, [1e-6, 900.0], rtol=1e-6)
    assert "K" in result.report()


@pytest.mark.slow
def test_in_a_layer(kinds):
    """Its modulus is not a series."""
    negami = kinds["HavriliakNegami"](**NUMBERS)
    for layer in (rf.Coating(1e-3, rf.Elastic(1e9, 0.3)), rf.Slab(1e-3)):
        layered = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(negami, None, layer))
        assert 0 < float(rf.friction(layered, 0.1, 1e5, quadrature=FAST)) < 1


def test_a_new_shift_has_a_vertical_one(kinds):
    law = kinds["VogelFulcher"](**SHIFT, vertical=rf.Entropic())
    found, plain = (
        rf.complex_modulus(rf.Prony(1e6, [1e8], [1e-3], shift=shift), V, 320.0)
        for shift in (law, law.replace(vertical=None))
    )
    np.testing.assert_allclose(found, 320.0 / 293.15 * plain, rtol=1e-14)
