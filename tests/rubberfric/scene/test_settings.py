"""The default setting of a scene, and its error below 1e-9."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import RIGID, ROAD, SOFT, TREAD, WORN, scene

import rubberfric as rf
from rubberfric.analysis import default_quadrature
from rubberfric.base import POSITIVE, Number, child, forget, leaf, physical
from rubberfric.materials.material import Material
from rubberfric.roughness.spectra import Spectrum
from rubberfric.scene.settings import GRADED, PANELS, ROBUST, extent_of

USUAL = scene((RIGID, ROAD), (TREAD,))
TWO = scene((SOFT, WORN), (TREAD, ROAD))
PRESSURE = 3e5
TABLE = rf.TabulatedModulus([1.0, 1e3, 1e6], [1e6, 1e7, 1e8], [1e5, 1e6, 1e7])


def traced_setting(one, pressure=PRESSURE):
    """Return the setting of a scene whose numbers are traced."""
    seen = []
    jax.eval_shape(jax.jit(lambda one: seen.append(default_quadrature(one, pressure))), one)
    return seen[0]


def test_extent_is_that_of_the_docstring():
    assert extent_of(USUAL, PRESSURE).length == pytest.approx(math.log(310) + math.log(10))
    assert extent_of(TWO, PRESSURE).length == pytest.approx(math.log(1000) + 2 * math.log(10))
    C0 = float(rf.power_spectrum(ROAD, 150.0))
    exact = math.log(1.1136e9 / 0.75 * 100.0**2 * math.sqrt(C0) / PRESSURE)
    _, least, largest = extent_of(USUAL, [10 * PRESSURE, PRESSURE])
    assert largest == pytest.approx(exact, rel=1e-3) and least == pytest.approx(largest - math.log(10))
    flat = scene((RIGID, rf.SelfAffine(100.0, 1000.0, 3e4, 0.8, 0.0)), (TREAD,))
    assert extent_of(flat, PRESSURE)[1:] == (-math.inf, -math.inf)
    assert extent_of(scene((RIGID,), (TREAD,)), PRESSURE)[0] == 0.0
    q = np.array([1e2, 1e3, 1e4])
    table = rf.TabulatedSpectrum(q, [1e-9, 1e-9, 1e-12])
    length = extent_of(scene((RIGID, table), (TREAD,)), PRESSURE).length
    assert length == pytest.approx(math.log(100) + math.log(10))


def test_extent_of_a_users_spectrum_and_material():
    """They have the numbers of the table and the Prony series that they are made of."""

    @physical
    class Copied(Spectrum):
        base: Spectrum = child()

        def power_law(self):
            return self.base.power_law()

    @physical
    class Maxwell(Material):
        E: Number = leaf(POSITIVE, unit="Pa")
        poisson: Number = leaf(POSITIVE, unit="-")

        def modulus(self, omega):
            return self.E + self.E * 1j * omega / (1 + 1j * omega)

        def frequency_range(self):
            return 1e-4, 1e4

    own = scene((RIGID, Copied(ROAD)), (Maxwell(1e8, 0.5),))
    same = scene((RIGID, ROAD), (rf.Prony(1e8, [1e8], [1.0], 0.5),))
    np.testing.assert_allclose(extent_of(own, PRESSURE), extent_of(same, PRESSURE), rtol=1e-6)
    assert default_quadrature(own, PRESSURE) == default_quadrature(same, PRESSURE)
    forget(Copied)
    forget(Maxwell)


def test_the_usual_scene_has_fewer_nodes_than_a_wide_or_traced_one():
    small = default_quadrature(USUAL, PRESSURE)
    assert small.panels == 8
    assert default_quadrature(USUAL, PRESSURE, separation=False).panels == 6
    wide = default_quadrature(USUAL.replace("lower.spectrum.q1", 1e14), PRESSURE)
    assert wide.panels > 20
    assert default_quadrature(USUAL, PRESSURE, margin=30.0).panels > 20
    assert default_quadrature(USUAL, 1e-30).graded == GRADED[-1]  # lightest loads
    assert default_quadrature(scene((RIGID,), (TREAD,)), PRESSURE) == ROBUST  # smooth
    assert default_quadrature(USUAL, []).panels == 6  # no load
    robust, seen = traced_setting(USUAL), []
    assert robust == ROBUST

    def traced(pressure, velocity=1.0):
        seen.append(default_quadrature(USUAL, pressure))
        return rf.friction(USUAL, velocity, pressure)

    jax.eval_shape(jax.jit(traced), PRESSURE)
    jax.eval_shape(jax.vmap(traced), jnp.array([PRESSURE]))
    assert seen == [robust] * 2
    seen.clear()
    jax.eval_shape(jax.jit(lambda velocity: traced(PRESSURE, velocity)), 1.0)  # closed over
    assert seen == [small]


def test_the_number_of_panels_follows_the_numbers_in_small_steps():
    """A longer range or a heavier load never has fewer panels, and an e-fold adds at most two entries."""
    roads = [USUAL.replace("lower.spectrum.q1", 3e4 * math.exp(k / 4)) for k in range(60)]
    panels = [PANELS.index(default_quadrature(one, PRESSURE).panels) for one in roads]
    assert panels == sorted(panels) and max(np.diff(panels)) <= 1 and panels[-1] - panels[0] > 5
    graded = [GRADED.index(default_quadrature(USUAL, 1e8 / 10**k).graded) for k in range(12)]
    assert graded == sorted(graded) and max(np.diff(graded)) <= 1 and graded[-1] > graded[0]
    heavy = [default_quadrature(USUAL, 10.0**k).panels for k in range(4, 12)]
    assert heavy == sorted(heavy) and heavy[-1] > heavy[0]


def test_a_tuned_scene_carries_its_setting_through_transformations_and_changes():
    ready, seen, robust = rf.tuned(USUAL, PRESSURE), [], traced_setting(USUAL)
    assert ready.quadrature == default_quadrature(USUAL, PRESSURE) != robust
    assert default_quadrature(ready, 1e-30) == ready.quadrature
    assert rf.tuned(ready, 1e-30).quadrature == default_quadrature(USUAL, 1e-30)
    assert rf.tuned(USUAL, PRESSURE, margin=1.0).quadrature == default_quadrature(USUAL, PRESSURE, margin=1.0)

    @jax.jit
    def curve(one):
        seen.append(default_quadrature(one, PRESSURE))
        return rf.friction(one, 0.1, PRESSURE)

    values = [curve(ready), curve(ready.replace("gamma", 0.4)), curve(USUAL)]
    assert seen == [ready.quadrature, robust]  # a changed number does not trace again
    assert values[0] == pytest.approx(float(values[2]), rel=1e-9) and values[0] != values[1]
    assert jax.grad(curve)(ready).quadrature == ready.quadrature
    explicit = rf.friction(ready, 0.1, PRESSURE, quadrature=rf.Quadrature(panels=2, order=4))
    assert abs(float(explicit / values[0]) - 1) > 1e-9


def test_a_tuned_scene_is_the_same_and_files_do_not_hold_the_setting(tmp_path):
    ready = rf.tuned(USUAL, PRESSURE)
    assert rf.same(ready, USUAL) and ready != USUAL
    assert not rf.same(ready, USUAL.replace("lower.spectrum.hurst", 0.7))
    assert not rf.same(ready, USUAL.replace(area_correction=True))
    assert not rf.same(USUAL, TWO)
    with pytest.raises(ValueError, match="other is a dict: must be a Scene"):
        rf.same(USUAL, {})
    for name in ("scene.h5", "scene.toml"):
        rf.save_scene(tmp_path / name, ready)
        back = rf.load_scene(tmp_path / name)
        assert rf.same(back, ready) and back.quadrature is None


def test_only_concrete_scenes_are_tuned():
    with pytest.raises(ValueError, match="call tuned outside jit and vmap"):
        jax.jit(lambda one: rf.tuned(one, PRESSURE))(USUAL)
    with pytest.raises(ValueError, match="pressure"):
        rf.tuned(USUAL, -1.0)
    with pytest.raises(ValueError, match="margin = -3: must be >= 0"):
        rf.tuned(USUAL, PRESSURE, margin=-3)
    with pytest.raises(ValueError, match=r"Scene\.quadrature is a int: must be a Quadrature or None"):
        USUAL.replace(quadrature=13)


def test_parts_that_need_more_nodes_have_them():
    usual = default_quadrature(USUAL, PRESSURE, separation=False).panels
    same = [
        scene((RIGID, ROAD), (TREAD, None, rf.Slab(1e-3))),
        scene((RIGID, ROAD), (TREAD,), area_correction=True),
        scene((RIGID, rf.Anisotropic(ROAD, 0.5, 0.3)), (TREAD,)),
    ]
    assert {default_quadrature(one, PRESSURE, separation=False).panels for one in same} == {usual}
    more = [
        scene((RIGID, ROAD), (TREAD, None, rf.Coating(1e-3, TREAD))),
        scene((RIGID, ROAD), (TREAD,), adhesion=rf.Adhesion(0.05)),
        scene((RIGID, ROAD), (TREAD,), contact_model="boundary_elements"),
        scene((RIGID, ROAD), (TABLE,)),
    ]
    assert min(default_quadrature(one, PRESSURE, separation=False).panels for one in more) > usual
    assert default_quadrature(more[-1], PRESSURE).angular_order > 12


def test_calls_are_made_with_the_setting_that_fits():
    """Values, derivatives outside of jit, maps, and fits from their start; fewer nodes for friction alone."""
    alone = default_quadrature(USUAL, PRESSURE, separation=False)
    fits = default_quadrature(USUAL, PRESSURE)
    plain = rf.solve(USUAL, 1.0, PRESSURE)
    assert plain == rf.solve(USUAL, 1.0, PRESSURE, quadrature=fits)
    np.testing.assert_allclose(plain[:3], rf.solve(USUAL, 1.0, PRESSURE, quadrature=ROBUST)[:3], rtol=1e-9)

    def by_pressure(pressure, quadrature=None):
        return rf.friction(USUAL, 1.0, pressure, quadrature=quadrature)

    def by_scene(scene, quadrature=None):
        return rf.friction(scene, 1.0, PRESSURE, quadrature=quadrature)

    assert jax.grad(by_pressure)(PRESSURE) == jax.grad(by_pressure)(PRESSURE, alone)
    jax.tree.map(np.testing.assert_array_equal, jax.grad(by_scene)(USUAL), jax.grad(by_scene)(USUAL, alone))
    near_full = 1e7
    alone = default_quadrature(USUAL, near_full, separation=False)
    assert alone.panels < default_quadrature(USUAL, near_full).panels


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("scene", 1e5), "scene is a str: must be a Scene"),
        ((USUAL, [1e5, 0.0]), r"pressure\[1\] = 0.0: must be > 0"),
    ],
)
def test_wrong_arguments_are_one_line(arguments, message):
    with pytest.raises(ValueError, match=message):
        default_quadrature(*arguments)
