"""Pictures of friction maps, and their line of progress."""

import re
import types

import numpy as np
import pytest
from support.scenes.maps import QUICK, SCENE

import rubberfric as rf
from rubberfric.base.progress import Progress
from rubberfric.io.results import Conditions
from rubberfric.plot.maps import plot_map


def drawn_map(velocity, pressure, temperature):
    """Return a map of artificial values that depend on all conditions."""
    v, p, T = (np.asarray(x, float) for x in (velocity, pressure, temperature))
    grid = np.log10(np.abs(v) + 1) + (p / 1e6)[:, None] + (T / 100)[:, None, None]
    solution = rf.Solution(friction=grid, area=np.exp(-5 * grid), shear_friction=0 * grid)
    return rf.FrictionMap(SCENE, Conditions(v, p, T), solution, QUICK, "Title")


def test_panels_are_pressures_over_velocity_and_temperature():
    result = drawn_map([1.0, -1.0, 0.01, 0.0], [3e5, 1e5], [293.15, 273.15, 283.15])
    axes = plot_map(result)
    assert [panel.get_title() for panel in axes] == ["0.3 MPa", "0.1 MPa"]
    for j, panel in enumerate(axes):
        mesh = panel.collections[0]
        # sorted, without velocities that have no logarithm
        expected = result.solution.friction[np.ix_([1, 2, 0], [j], [2, 0])][:, 0]
        np.testing.assert_array_equal(mesh.get_array().reshape(3, 2), expected)
        assert len(panel.collections) == 2 and panel.texts  # contours, labelled
    # shaded between the points, as cells so large would be seen as stripes
    np.testing.assert_allclose(mesh.get_coordinates()[0, :, 0], [-2, 0])
    np.testing.assert_allclose(mesh.get_coordinates()[:, 0, 1], [0, 10, 20])
    assert axes[0].get_ylabel() == "temperature [°C]"
    assert axes[0].get_xlabel() == "velocity $v$ [m/s]"
    figure = axes[0].figure
    assert figure.get_suptitle() == "Title"
    assert figure.axes[-1].get_ylabel() == "friction coefficient $\\mu$ [-]"
    assert [panel.get_title() for panel in plot_map(result, pressure=1)] == ["0.1 MPa"]


def test_one_temperature_is_drawn_over_pressure():
    many = drawn_map([0.1, 1.0, 10.0], [1e5, 1e6], [283.15, 293.15])
    one = drawn_map([0.1, 1.0, 10.0], [1e5, 1e6], [293.15])
    for result, index in ((many, 1), (one, None)):
        (panel,) = plot_map(result, "area", temperature=index)
        assert panel.get_title() == "20 °C"
        assert panel.get_ylabel() == "pressure $p$ [MPa]"
        np.testing.assert_array_equal(
            panel.collections[0].get_array().reshape(2, 3), result.solution.area[-1]
        )
        assert "LogNorm" in type(panel.collections[0].norm).__name__


def test_picture_of_many_pressures_points_and_a_constant():
    result = drawn_map(np.logspace(-6, 2, 1000), np.logspace(4, 7, 9), [283.15, 293.15])
    axes = plot_map(result)
    assert len(axes) == 4
    assert axes[0].get_title() == "0.01 MPa" and axes[-1].get_title() == "10 MPa"
    assert axes[0].collections[0].get_array().size == 2 * 800
    (one,) = plot_map(result, "shear_friction")
    assert one.get_title() == "0.01 … 10 MPa, no difference"
    assert one.figure.axes[-1].get_ylabel() == "shear friction [-]"
    assert len(one.collections) == 1  # no contour of a constant
    given = axes[0].figure.__class__().subplots(1, 4)
    assert plot_map(result, ax=given) is given


@pytest.mark.parametrize(
    ("conditions", "options", "message"),
    [
        (([1.0], [1e5, 2e5], [283.0, 293.0]), {}, "velocity has 1 different values > 0; a map needs 2"),
        (([1.0, -1.0], [1e5, 2e5], [283.0]), {}, "velocity has 1 different values > 0"),
        (([1.0, 2.0], [1e5], [283.0]), {}, "pressure has one value; a map needs 2"),
        (([1.0, 2.0], [1e5], [283.0, 293.0]), {"temperature": 0}, "pressure has one value"),
        (([1.0, 2.0], [1e5], [283.0, 293.0]), {"temperature": 2}, "temperature = 2: must be an index of 2"),
        (([1.0, 2.0], [1e5], [283.0, 293.0]), {"pressure": 0.5}, "pressure = 0.5: must be an index of 1"),
        (([1.0, 2.0], [1e5], [283.0, 293.0]), {"quantity": "separation"}, "must be one of area, friction"),
        (([1.0, 2.0], [1e5], [283.0, 293.0]), {"quantity": "mu"}, "quantity = 'mu': must be one of"),
    ],
)
def test_maps_that_cannot_be_drawn(conditions, options, message):
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        plot_map(drawn_map(*conditions), **options)
    assert message in str(caught.value)


def test_line_of_progress():
    shown = []
    place = types.SimpleNamespace(show=lambda text, _: shown.append(text), end=lambda: None)
    tell = Progress("", place, iter([0.0, 1.0, 3.0, 12.0]).__next__)
    for done in (0, 30, 120):
        tell(done, 120)
    assert shown == ["120 points,   0 %", "120 points,  25 %, 9 s left", "120 points, 100 %, 12 s"]
