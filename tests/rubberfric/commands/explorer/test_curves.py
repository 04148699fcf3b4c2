"""Curves of the page equal `solve` for scenes made by hand; sensitivities equal differences."""

import threading

import numpy as np
import pytest
from support.folders import DATA, SCENE_FILES

import rubberfric as rf
from rubberfric.commands.explorer.curves import BESIDE, EVERY, POINTS, Explorer, group_points
from rubberfric.commands.explorer.sliders import slider_values
from rubberfric.io.results import Conditions

RUBBER = "upper.material"


@pytest.fixture(scope="module")
def twin(explorer_of):
    return explorer_of("twin_truth", DATA / "twin_friction.csv")


# Sliders moved, and the same by hand.
MOVED = {
    "pressure": 3e5,
    "temperature": 300.0,
    "gamma": 0.4,
    "lower.spectrum.h_rms": 7e-4,
    "lower.spectrum.hurst": 0.7,
    "lower.spectrum.q1": 1e5,
    "upper.material.E_inf": 5e6,
    "upper.material.moduli": 1.5,
    "upper.material.frequencies": 10.0,
    "upper.material.E[2]": 3.0,
    "upper.material.shift.C1": 11.0,
    "shear.tau_f0": 2e6,
    "shear.shift.energy": 0.8,
}


def moved_by_hand(scene):
    scene = scene.replace("gamma", 0.4).replace("lower.spectrum.h_rms", 7e-4)
    scene = scene.replace({"lower.spectrum.hurst": 0.7, "lower.spectrum.q1": 1e5, "shear.tau_f0": 2e6})
    rubber = scene.upper.material
    E = 1.5 * np.asarray(rubber.E)
    E[2] *= 3
    scene = scene.replace({f"{RUBBER}.E": E, f"{RUBBER}.E_inf": 7.5e6, f"{RUBBER}.tau": rubber.tau / 10})
    return scene.replace({f"{RUBBER}.shift.C1": 11.0, "shear.shift.energy": 0.8})


def test_values_are_those_of_solve(twin):
    found = twin.curves(slider_values(twin.sliders, MOVED))
    scene = moved_by_hand(rf.load_scene(DATA / "twin_truth.toml"))
    v = np.geomspace(1e-6, 10.0, POINTS)
    names = ("area", "friction", "separation", "viscoelastic_friction", "shear_friction")
    expected = rf.solve(scene, v, 3e5, 300.0, quadrature=twin.quadrature, quantities=names)
    settled = rf.solve(scene, v, 3e5, 300.0, quantities=names)
    for name in names:
        np.testing.assert_allclose(found["curves"][name], getattr(expected, name), rtol=1e-12)
        np.testing.assert_allclose(found["curves"][name], getattr(settled, name), rtol=2e-9)

    data = np.loadtxt(DATA / "twin_friction.csv", delimiter=",", skiprows=3)
    assert len(found["beside"]) == 6
    for curve, friction in zip(twin.curves_of_points, found["beside"], strict=True):
        assert np.ptp(data[list(curve.points), 2]) == np.ptp(data[list(curve.points), 3]) == 0
        p, T = data[curve.points[0], 2:4]
        mu = rf.friction(scene, v[::BESIDE], p, T, quadrature=twin.quadrature)
        np.testing.assert_allclose(friction, mu, rtol=1e-12)
    mu = rf.friction(scene, data[:, 0], data[:, 2], data[:, 3], quadrature=twin.quadrature)
    misfit = np.sqrt(np.mean(np.log(mu / data[:, 1]) ** 2))
    np.testing.assert_allclose(found["misfit"], misfit, rtol=1e-11)

    storage, loss = found["moduli"]["upper"]
    modulus = rf.complex_modulus(scene.upper.material, twin.omega["upper"])
    np.testing.assert_allclose(storage + 1j * loss, modulus, rtol=1e-13)
    q, C = found["spectra"]["lower"]
    np.testing.assert_allclose(q, [100.0, 1000.0, 1e5], rtol=1e-15)
    np.testing.assert_allclose(C, rf.power_spectrum(scene.lower.spectrum, q), rtol=1e-13)


def test_at_the_truth_the_misfit_is_the_noise(twin):
    found = twin.curves(slider_values(twin.sliders, {}))
    assert 0.025 < found["misfit"] < 0.035


def differences(explorer, values, name):
    """d ln Q / d ln slider by central differences of `solve`."""
    step = 1e-5 * abs(values[name])
    logs = []
    for sign in (1, -1):
        away = dict(values) | {name: values[name] + sign * step}
        scene, (v, p, T) = explorer.moved(away), explorer.conditions_at(away)
        at = [None if x is None else x[:POINTS:EVERY] for x in (v, p, T)]
        options = {"quadrature": explorer.quadrature, "quantities": (explorer.sensitive,)}
        logs.append(np.log(getattr(rf.solve(scene, *at, **options), explorer.sensitive)))
    return (logs[0] - logs[1]) / (2 * step) * values[name]


def assert_sensitivities(explorer, names, values, tolerance=1e-6):
    found = explorer.sensitivities(values)
    assert set(found) == {one.name for one in explorer.sliders}
    for name in names:
        expected = differences(explorer, values, name)
        np.testing.assert_allclose(found[name], expected, rtol=tolerance, atol=tolerance, err_msg=name)


@pytest.mark.slow
def test_sensitivities_are_differences(twin):
    values = slider_values(twin.sliders, MOVED)
    names = ["pressure", "temperature", "lower.spectrum.q1", "upper.material.moduli", "upper.material.E[2]"]
    assert_sensitivities(twin, [*names, "upper.material.frequencies", "shear.v0"], values)


@pytest.mark.slow
def test_tables(explorer_of):
    """Factors of the moduli, the frequencies and the heights of tables, and where a spectrum ends."""
    explorer = explorer_of("tabulated_tread")
    moved = {"moduli": 2.0, "frequencies": 10.0}
    moved = {f"{RUBBER}.{name}": x for name, x in moved.items()}
    moved |= {"lower.spectrum.heights": 1.5, "lower.spectrum.q1": 1e4, "temperature": 300.0}
    found = explorer.curves(slider_values(explorer.sliders, moved))
    scene = rf.load_scene(DATA / "tabulated_tread.toml")
    rubber, road = scene.upper.material, scene.lower.spectrum
    rubber = rubber.replace(omega=10 * rubber.omega, storage=2 * rubber.storage, loss=2 * rubber.loss)
    scene = scene.replace({RUBBER: rubber, "lower.spectrum": road.replace(C=2.25 * road.C, q1=1e4)})
    mu = rf.friction(scene, explorer.at, 0.15e6, 300.0, quadrature=explorer.quadrature)
    np.testing.assert_allclose(found["curves"]["friction"], mu, rtol=1e-12)


@pytest.mark.slow
def test_curves_over_pressure_where_there_is_no_velocity(monkeypatch):
    body = rf.Body(rf.Rigid(), rf.SelfAffine(1e3, 1e4, 1e6, 0.8, 1e-6))
    scene = rf.Scene(body, rf.Body(rf.Elastic(1e7, 0.5)))
    conditions = Conditions(np.zeros(1), np.array([1e4, 1e6]), None)
    explorer = Explorer(scene, conditions)
    assert explorer.axis == "pressure" and explorer.sensitive == "area"
    assert "pressure" not in {one.name for one in explorer.sliders}
    values = slider_values(explorer.sliders, {"upper.material.young": 2e7})
    harder = scene.replace("upper.material.young", 2e7)
    expected = rf.contact_area(harder, 0.0, np.geomspace(1e4, 1e6, POINTS), quadrature=explorer.quadrature)
    np.testing.assert_allclose(explorer.curves(values)["curves"]["area"], expected, rtol=1e-12)
    assert_sensitivities(explorer, ["upper.material.young", "lower.spectrum.hurst"], values)
    assert not explorer.has_drafts
    monkeypatch.setattr("rubberfric.commands.explorer.curves.PATIENCE", 0.0)
    explorer.compile()
    draft = explorer.curves(values, draft=True)["curves"]["area"]
    assert explorer.has_drafts and 0 < np.max(np.abs(draft / expected - 1)) < 1e-3
    # The stiffness enters as E h_rms / sigma alone.
    found = explorer.sensitivities(values)
    monkeypatch.setattr("rubberfric.commands.explorer.curves._TURN", 0.0)
    assert len(explorer.differences(values)) == 1  # one slider for each request at least
    for _ in explorer.sliders:
        near = explorer.differences(values)
    assert list(near) == [one.name for one in explorer.sliders]
    for slider in explorer.sliders:
        # Poisson's ratio is at the end of its range, where the difference of step 1e-4 has one side.
        rtol = 3e-4 if values[slider.name] in (slider.low, slider.high) else 1e-5
        np.testing.assert_allclose(near[slider.name], found[slider.name], rtol=rtol, atol=1e-6)
    np.testing.assert_allclose(found["upper.material.young"], found["lower.spectrum.h_rms"], rtol=1e-9)


def test_points_without_pressure_are_where_the_slider_is(explorer_of, tmp_path):
    path = tmp_path / "points.csv"
    path.write_text("v,mu\nm/s,-\n1e-3,0.5\n1e-2,0.6\n")
    explorer = explorer_of("twin_truth", path)
    assert [curve[:2] for curve in group_points(explorer.measured)] == [(None, None)]
    found = explorer.curves(slider_values(explorer.sliders, {"pressure": 4e5}))
    np.testing.assert_allclose(found["beside"][0], found["curves"]["friction"][::BESIDE], rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", [path.stem for path in SCENE_FILES])
def test_every_scene_of_the_project(name, explorer_of):
    explorer = explorer_of(name)
    rng = np.random.default_rng(0)
    values = {one.name: one.at(rng.uniform(-0.1, 0.1)) for one in explorer.sliders}
    found = explorer.curves(values)["curves"]
    scene, conditions = explorer.moved(values), explorer.conditions_at(values)
    expected = rf.solve(scene, *conditions, quadrature=explorer.quadrature, quantities=explorer.quantities)
    for quantity, curve in found.items():
        np.testing.assert_allclose(curve, getattr(expected, quantity), rtol=1e-12)
    first = [one.name for one in explorer.sliders if one.start != 0][::4]
    assert_sensitivities(explorer, first, values, 1e-5)


def test_whatever_fails_in_the_thread_ends_the_wait(explorer_of, monkeypatch):
    explorer = explorer_of("twin_truth")

    def fail(_):
        raise TypeError("not of this kind")

    monkeypatch.setattr(explorer, "sensitivities", fail)
    assert not explorer.compiled.is_set()
    thread = threading.Thread(target=explorer.compile_sensitivities)
    thread.start()
    thread.join()
    assert explorer.compiled.is_set() and explorer.failure == "not of this kind"
