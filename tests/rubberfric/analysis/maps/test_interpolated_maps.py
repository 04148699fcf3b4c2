"""Interpolated maps equal the model, and maps that do not collapse are not interpolated."""

import types

import numpy as np
import pytest
from support.scenes.maps import QUICK, ROAD, SCENE, TREAD, WLF

import rubberfric as rf
from rubberfric.analysis import collapse
from rubberfric.io.files import load_result, save_result
from rubberfric.io.results import Conditions

VELOCITY = np.concatenate([[0.0, -0.3], np.logspace(-6, 1, 150)])
TEMPERATURE = np.linspace(263.15, 333.15, 21)
RIGID_ROAD = rf.Body(rf.Rigid(), ROAD)
ENTROPIC = rf.WLF(8.0, 100.0, 293.15, vertical=rf.Entropic())
OTHER = rf.WLF(9.0, 100.0, 293.15)


def rubber(shift, spectrum=None):
    return rf.Body(rf.Prony(1e6, [1e8, 1e7], [1e-5, 1e-2], shift=shift), spectrum)


def expected(found, names, count=40):
    """Return values of the map and of the model at random points."""
    shape = found.solution.friction.shape
    rng = np.random.default_rng(0)
    points = tuple(
        np.append(rng.integers(0, n, count), [0, k]) for n, k in zip(shape, (0, 0, 1), strict=True)
    )
    v, p, T = found.conditions
    exact = rf.solve(
        found.scene, v[points[2]], p[points[1]], T[points[0]], quadrature=found.quadrature, quantities=names
    )
    return [(getattr(found.solution, name)[points], np.asarray(getattr(exact, name))) for name in names]


@pytest.mark.parametrize("pressures", [3, pytest.param(120, marks=pytest.mark.slow)])
def test_an_interpolated_map_is_solve_at_every_point(tmp_path, pressures):
    """Include v = 0 and v < 0; few pressures are computed one by one, many as series."""
    pressure = np.geomspace(3e5, 1e5, pressures)
    names = ("area", "friction", "shear_friction", "separation")
    at = SCENE, VELOCITY, pressure, TEMPERATURE[:: 1 if pressures == 3 else 3]
    found = rf.friction_map(*at, quantities=names, quadrature=QUICK, path=tmp_path / "m.h5")
    assert found.interpolation.evaluations < 0.5 * found.solution.area.size
    assert found.interpolation.error < 2e-10
    for values, exact in expected(found, names):
        np.testing.assert_allclose(values, exact, rtol=1e-9)
    assert (found.solution.friction[:, :, 0] == 0).all() and (found.solution.friction[:, :, 1] < 0).all()
    assert load_result(tmp_path / "m.h5").interpolation == found.interpolation
    save_result(tmp_path / "again.h5", found)
    assert load_result(tmp_path / "again.h5").interpolation == found.interpolation
    assert str(found.interpolation) in found._repr_html_()


def test_a_map_can_be_computed_at_every_point():
    found = rf.friction_map(SCENE, np.logspace(-6, 1, 4100), 1e5, quadrature=QUICK, interpolate=False)
    assert found.interpolation is None
    assert rf.friction_map(SCENE, VELOCITY, 1e5, quadrature=QUICK).interpolation is None  # too few


@pytest.mark.parametrize(
    ("scene", "collapses"),
    [
        (rf.Scene(RIGID_ROAD, rubber(WLF)), True),
        (rf.Scene(rubber(WLF, ROAD), rubber(rf.WLF(8.0, 100.0, 293.15), ROAD)), True),
        (rf.Scene(rubber(OTHER), rubber(WLF, ROAD)), True),  # it faces a smooth solid and stays at rest
        (rf.Scene(rubber(OTHER, ROAD), rubber(WLF, ROAD)), False),
        (rf.Scene(rubber(None, ROAD), rubber(WLF, ROAD)), False),
        (rf.Scene(RIGID_ROAD, rubber(ENTROPIC)), False),
        (rf.Scene(rubber(ENTROPIC), rubber(WLF, ROAD)), False),
        (
            rf.Scene(
                RIGID_ROAD, rf.Body(TREAD, None, rf.Coating(1e-4, rf.Prony(1e6, [1e7], [1e-3], shift=OTHER)))
            ),
            False,
        ),
        (rf.Scene(RIGID_ROAD, rubber(WLF), heating=rf.Heating(1200.0, 1650.0, 0.2, 1e-3)), False),
    ],
)
def test_conditions_for_a_collapse(scene, collapses):
    """Maps collapse with one common shift, no vertical shift and no heating, or at one temperature."""
    conditions = Conditions(VELOCITY, np.array([1e5]), TEMPERATURE)
    assert (collapse.log_speeds(scene, conditions) is not None) == collapses
    one = collapse.log_speeds(scene, conditions._replace(temperature=TEMPERATURE[:1]))
    assert (one is not None) == (scene.heating is None)


def found_over(function, **options):
    """Interpolate a function of ln u and p at 40 000 points."""
    x = np.linspace(-12.0, 12.0, 40_000)
    p = options.get("pressure", np.array([1e5]))

    def evaluate(speed, pressure):
        with np.errstate(divide="ignore"):
            return {"area": function(np.log(speed), pressure[:, None]) * np.ones((pressure.size, 1))}

    made = collapse.interpolant(x, np.log(p), evaluate)
    if made is None:
        return None, x, p
    return made.at(x[None], np.log(p))["area"][0], x, p


@pytest.mark.parametrize("width", [1.0, 0.05])
def test_panels_are_halved_at_steep_steps(width):
    """Use a step as wide as a relaxation, and one as in a table with little smoothing."""

    def step(x, _):
        return 1.5 + np.tanh(np.maximum(x, -50.0) / width)

    found, x, _ = found_over(step)
    np.testing.assert_allclose(found[0], step(x, 1e5), rtol=1e-10)


@pytest.mark.slow
def test_series_over_the_pressure():
    def area(x, p):
        return np.tanh(p / 1e6 / (2 + np.tanh(np.maximum(x, -50.0) / 2)))

    found, x, p = found_over(area, pressure=np.geomspace(1e4, 1e6, 300))
    np.testing.assert_allclose(found, area(x, p[:, None]), rtol=1e-9)


@pytest.mark.parametrize(
    "function",
    [
        lambda x, _: 2 + np.abs(np.tanh(x - 0.123)),  # a kink
        lambda x, _: 1.0 + (x > 0.123),  # a step
        lambda x, _: np.maximum(np.tanh(x - 0.123), 0.0),  # no contact on one side
        lambda x, _: np.where(x > 3, np.nan, 1.0),
    ],
)
def test_slow_convergence_gives_no_interpolant(function):
    assert found_over(function)[0] is None


def test_a_model_that_depends_on_temperature_is_detected():
    """The interpolation is compared with points of the map, whatever the structure of the scene."""
    conditions = Conditions(VELOCITY, np.array([1e5, 2e5]), TEMPERATURE)

    def model(heat, quantities, conditions):
        v, p, T = conditions.grid()
        reduced = np.abs(v) * np.exp(np.asarray(WLF.log_factor(T)))
        return {name: reduced / (1 + reduced) + 0.5 + p * (1e-9 + heat * T) for name in quantities}

    scene = rf.Scene(RIGID_ROAD, rubber(WLF))
    for heat, expected in ((0.0, True), (1e-13, False)):
        found = collapse.collapse(
            scene, conditions, ("area",), lambda names, at, heat=heat: model(heat, names, at)
        )
        assert (found is not None) == expected


def test_shear_friction_is_zero_in_a_scene_without_contact_shear():
    scene = rf.Scene(RIGID_ROAD, rubber(WLF))
    series = types.SimpleNamespace(at=lambda *_: {})
    curve = collapse.CollapsedMap(scene, ("shear_friction",), series, None)
    conditions = Conditions(VELOCITY, np.array([1e5]), TEMPERATURE)
    assert not collapse.whole(curve, conditions)["shear_friction"].any()
