"""Plots: lines, labels with units, axes, and rejected arguments."""

import subprocess
import sys

import jax.numpy as jnp
import matplotlib.colors
import numpy as np
import pytest
from matplotlib.figure import Figure
from support.scenes.plots import MASTER, ROAD, RUBBER, V, drawn, texts

import fitting
import rubberfric as rf
from fitting.results.plot import plot_correlation
from rubberfric import plot
from rubberfric.analysis.sweep import Accuracy
from rubberfric.io.results import Conditions, Result
from rubberfric.plot.maps import figure_of_map

SCENE = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(RUBBER))


VALUES = 1.0 + np.arange(2 * 2 * 5.0).reshape(2, 2, 5)


RESULT = Result(
    SCENE,
    Conditions(V, np.array([1e5, 5e5]), np.array([283.15, 303.15])),
    rf.Solution(area=VALUES / 100, friction=VALUES, separation=1e-6 * VALUES, shear_friction=0.5 * VALUES),
    rf.Quadrature(),
    "Title",
)


CURVES = {
    plot.plot_friction: ("friction coefficient\n$\\mu$ [-]", 1.0),
    plot.plot_area: ("contact area\n$A/A_0$ [-]", 0.01),
    plot.plot_separation: ("mean separation\n$\\bar u$ [µm]", 1.0),
}


@pytest.mark.parametrize("draw", CURVES, ids=lambda draw: draw.__name__)
def test_curves_of_a_result(draw):
    label, scale = CURVES[draw]
    axes = drawn(draw(RESULT))
    assert axes.get_ylabel() == label and axes.get_ylim()[0] == 0
    assert axes.get_xlabel() == "velocity $v$ [m/s]"
    axes.figure.draw_without_rendering()
    ticks = [one.get_text() for one in axes.get_xticklabels()]
    assert ticks == ["$10^{-3}$", "$10^{-2}$", "$10^{-1}$", "$10^{0}$", "$10^{1}$"]
    assert axes.figure.get_suptitle() == "Title"
    wanted = ["0.1 MPa, 10 °C", "0.5 MPa, 10 °C", "0.1 MPa, 30 °C", "0.5 MPa, 30 °C"]
    assert texts(axes) == wanted + ["contact shear"] * (draw is plot.plot_friction)
    lines = axes.lines[:4]
    for line, values in zip(lines, VALUES.reshape(4, 5), strict=True):
        np.testing.assert_allclose(line.get_xdata(), [-3.0, -1.0, 1.0], atol=1e-15)
        np.testing.assert_allclose(line.get_ydata(), scale * values[[2, 4, 0]])
    # Pressures alternate. Line styles show the parts of the friction instead.
    assert [line.get_marker() for line in lines] == ["o", "s", "o", "s"]
    dashed = draw is not plot.plot_friction
    assert [line.is_dashed() for line in lines] == [False, dashed, False, dashed]
    tones = [tuple(line.get_color()) for line in lines]
    assert tones[0] == tones[1] and tones[2] == tones[3] and is_lighter(tones[::2])
    given = Figure().subplots()
    assert draw(RESULT, given) is given
    assert not given.figure.get_suptitle()


def test_curves_of_many_points_have_no_kinks():
    """They pass through all points, stay between neighbours, and have a continuous slope."""
    v = np.logspace(-6, 2, 33)
    for mu, kinked in ((np.log10(v) ** 2, False), (np.where(v < 1e-2, 0.2, 0.5), False), (v * np.nan, True)):
        (line,) = drawn(plot.plot_curve(v, mu)).lines
        x, y = line.get_data()
        assert (x.size < 40) == kinked
        if kinked:
            continue
        at = np.searchsorted(x, np.log10(v))
        np.testing.assert_allclose(x[at], np.log10(v), atol=1e-12)
        np.testing.assert_allclose(y[at], mu, atol=1e-9)
        place = np.clip(np.searchsorted(np.log10(v), x) - 1, 0, 31)
        low, high = np.sort([mu[place], mu[place + 1]], 0)
        assert (y >= low - 1e-9).all() and (y <= high + 1e-9).all()
    x, y = drawn(plot.plot_curve(v, np.log10(v) ** 2)).lines[0].get_data()
    slope = np.diff(y) / np.diff(x)
    assert np.abs(np.diff(slope)).max() < 0.2  # straight lines between the points have kinks of 0.5


def test_solutions_are_drawn():
    """Conditions may have any arrangement; labels name pressure and temperature."""
    v, p, T = V[[2, 4, 0]], np.array([5e5, 1e5])[:, None], 283.15
    solution = rf.Solution(friction=np.arange(6.0).reshape(2, 3))
    axes = drawn(plot.plot_friction(solution, velocity=v, pressure=p, temperature=T))
    assert texts(axes) == ["0.1 MPa, 10 °C", "0.5 MPa, 10 °C"]
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), [3, 4, 5])
    axes = drawn(plot.plot_friction(np.array([1.0, 2.0, 3.0]), velocity=v, pressure=1e5))
    assert axes.get_legend() is None and axes.get_title(loc="left") == "0.1 MPa"
    for wrong, message in (
        ({"velocity": V, "pressure": p}, r"velocity has \(5,\), pressure has \(2, 1\), but the result has"),
        ({"velocity": v, "pressure": [[1e5], [1e5]]}, r"6 points for 1 x 3 values of"),
        ({"velocity": v}, "pressure is missing"),
    ):
        with pytest.raises(ValueError, match=message):
            plot.plot_friction(solution, **wrong)
    with pytest.raises(ValueError, match="must not be given because the result has it"):
        plot.plot_friction(RESULT, velocity=V)


def test_panels_that_would_repeat_are_one():
    v = np.logspace(-3, 0, 5)
    conditions = Conditions(v, np.array([1e5, 3e5, 5e5]), np.array([283.15, 303.15]))
    mu = np.ones((2, 3, 5)) * np.linspace(0.5, 1.0, 5) * np.array([1.0, 1.2])[:, None, None]
    alike = RESULT._replace(conditions=conditions, solution=rf.Solution(friction=mu))
    (axes,) = plot.plot_map(alike)
    assert axes.get_title() == "0.1 … 0.5 MPa, no difference"
    assert len(plot.plot_map(alike, ax=Figure().subplots(1, 3))) == 3
    other = alike._replace(solution=rf.Solution(friction=mu * np.array([1.0, 1.0, 1.01])[:, None]))
    assert len(plot.plot_map(other)) == 3


def test_of_a_map_panels_that_repeat_are_one_and_labels_are_whole(tmp_path):
    """Area at three pressures, friction that does not depend on it."""
    v, p, T = np.logspace(-6, 2, 41), np.array([0.05e6, 0.15e6, 0.5e6]), np.linspace(243.15, 373.15, 27)
    x = np.log10(v) - 0.1 * (T[:, None, None] - 273.15)
    area = p[:, None] / 1e7 * 10 ** (-0.3 * np.log1p(np.exp(0.8 * x)))
    mu = 0.1 + np.exp(-0.5 * (x - 2) ** 2) * (1 + 1e-3 * p[:, None] / 0.5e6)
    result = RESULT._replace(
        conditions=Conditions(v, p, T), solution=rf.Solution(area=area, friction=mu + 0 * area)
    )
    figure = figure_of_map(result)
    panels = [one for one in figure.axes if one.get_ylabel() == "temperature [°C]" or one.get_title()]
    assert [one.get_title() for one in panels][-1] == "0.05 … 0.5 MPa, no difference" and len(panels) == 4
    figure.savefig(tmp_path / "map.png")
    labels = [(one, text) for one in panels for text in one.texts]
    assert len(labels) > 8
    for axes, text in labels:
        box, frame = text.get_window_extent(), axes.get_window_extent()
        assert frame.x0 < box.x0 and box.x1 < frame.x1 and frame.y0 < box.y0 and box.y1 < frame.y1, text


def test_any_picks_the_picture(tmp_path):
    assert len(plot.auto(RESULT)) == 3 and len(plot.auto(RESULT, ax=None)) == 3
    many = RESULT._replace(
        conditions=Conditions(V, np.geomspace(1e5, 1e6, 11), None),
        solution=rf.Solution(friction=np.ones((1, 11, 1)) * np.arange(5.0)),
    )
    (panel,) = plot.auto(many)
    assert panel.get_ylabel() == "pressure $p$ [MPa]"
    table = rf.io.FrictionTable(V[[2, 4, 0]], np.array([1e5]), None, np.ones((1, 1, 3)))
    assert len(plot.auto(table)) == 1
    assert plot.auto(RUBBER).get_ylabel().startswith("modulus")
    for spectrum in (ROAD, {"road": ROAD}, fitting.SpectrumData([1.0, 2.0], [1.0, 0.5])):
        assert plot.auto(spectrum).get_ylabel() == "power spectrum $C$ [m$^4$]"
    panels = plot.auto(rf.Solution(friction=np.ones(5)), velocity=V, pressure=1e5)
    plot.save_figure(tmp_path / "a.png", panels)
    plot.save_figure(tmp_path / "b.png", panels[0])
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    with pytest.raises(ValueError, match="pressure is missing; curves of a scene need it"):
        plot.auto(SCENE)
    with pytest.raises(ValueError, match="pressure is given, but SelfAffine has its own or needs none"):
        plot.auto(ROAD, pressure=1e5)


def is_lighter(colours):
    """Return True if each colour is lighter than the last, also in grey."""
    grey = [float(np.dot(matplotlib.colors.to_rgb(colour), [0.299, 0.587, 0.114])) for colour in colours]
    return (np.diff(grey) > 0.03).all()


def test_legends_do_not_cover_what_is_drawn():
    """Legends are outside the axes if the layout makes room."""
    for axes in (plot.plot_friction(RESULT), plot.plot_spectrum({"road": ROAD}), plot.plot_modulus(RUBBER)):
        figure = drawn(axes).figure
        box = axes.get_legend().get_window_extent()
        assert box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1 and box.y0 >= 0
        assert not any(box.overlaps(one.patch.get_window_extent()) for one in figure.axes)
        labels = [one.yaxis.label.get_window_extent() for one in figure.axes if one.get_ylabel()]
        assert not any(box.overlaps(label) for label in labels)


def test_a_second_picture_in_the_same_axes_is_seen_whole():
    axes = plot.plot_curve(V, VALUES[0, 0])
    plot.plot_curve(V, 10 * VALUES[0, 0], ax=axes)
    assert axes.get_ylim()[0] == 0 and axes.get_ylim()[1] > 50
    assert axes.get_legend() is None


def test_curves_of_arrays():
    axes = drawn(plot.plot_curve(V, {"wet": VALUES[0, 0], "dry": -jnp.asarray(VALUES[0, 1])}, "separation"))
    assert texts(axes) == ["wet", "dry"]
    assert axes.get_ylabel().endswith("[µm]") and axes.get_ylim()[0] < -1e6
    np.testing.assert_allclose(axes.lines[1].get_ydata(), [-8e6, -10e6, -6e6])
    assert plot.plot_curve([1.0], [0.5]).lines[0].get_marker() == "o"


def test_all_plots_are_public():
    names = {name.removeprefix("plot_") for name in plot.__all__ if name.startswith("plot_")}
    assert names == {
        *("accuracy", "area", "curve", "friction", "map", "modulus", "profile", "result", "sensitivity"),
        *("separation", "spectrum"),
    }
    assert rf.plot is plot and fitting.plot.plot_correlation is plot_correlation


NO_FRICTION = RESULT._replace(solution=rf.Solution(area=VALUES))


AT_REST = RESULT._replace(conditions=RESULT.conditions._replace(velocity=np.zeros(5)))


SQUARE = np.ones((3, 5))


@pytest.mark.parametrize(
    ("draw", "arguments", "message"),
    [
        (plot.plot_friction, (V,), "velocity is missing: must be given as to solve and friction"),
        (plot.plot_friction, (NO_FRICTION,), "result has no friction, only area; compute it first"),
        (plot.plot_area, (AT_REST,), "velocity has no value > 0; log10 v needs at least one"),
        (plot.plot_area, (RESULT, Figure()), "ax must be one matplotlib axes or None, got Figure"),
        (plot.plot_curve, (V, SQUARE), r"values has shape \(3, 5\): must be one-dimensional, 5 numbers"),
        (plot.plot_curve, (V, {"a": "b"}), r"values\['a'\] must be an array of numbers, got str"),
        (plot.plot_curve, (V, V, "frictoin"), "quantity = 'frictoin': did you mean 'friction'"),
        (plot.plot_curve, (V, V, "area", [1]), "ax must be one matplotlib axes or None, got list"),
        (plot.plot_spectrum, (RUBBER,), "spectrum must be a spectrum or have q and C, got Prony"),
        (plot.plot_spectrum, ({},), "spectra is empty"),
        (plot.plot_spectrum, ({"a": rf.SelfAffine(1.0, 2.0, 3.0, 0.8, 0.0)},), "a is smooth; log C"),
        (plot.plot_spectrum, (ROAD, None, [1.0, -1.0]), r"q\[1\] = -1.0: must be > 0"),
        (plot.plot_spectrum, (ROAD, None, [1.0]), r"spectrum: no q lies within 100 \.\.\. 100000 1/m"),
        (plot.plot_spectrum, (ROAD, 3), "ax must be one matplotlib axes or None, got int"),
        (plot.plot_modulus, (rf.Rigid(),), "material must be deformable, got Rigid"),
        (plot.plot_modulus, (ROAD,), "material must be deformable, got SelfAffine"),
        (plot.plot_modulus, (MASTER, None, None, 300.0), "temperature = 300.0: must be None because"),
        (plot.plot_modulus, (RUBBER, None, None, [300.0]), r"temperature has shape \(1,\): must be one"),
        (plot.plot_modulus, (RUBBER, None, [0.0]), r"omega\[0\] = 0.0: must be > 0"),
        (plot.plot_modulus, (RUBBER, None, None, None, V), "data must have omega, storage, loss, got nd"),
        (plot.plot_sensitivity, (V, V[[0, 2]], SQUARE), r"values has shape \(3, 5\): must be \(2, 5\)"),
        (plot.plot_sensitivity, (V, [1.0, 1.0], SQUARE), "tau has 1 different values > 0: must have 2"),
        (plot.plot_sensitivity, (V, [1.0, 1.0, 2.0], SQUARE), "tau has equal entries; all must be different"),
        (plot.plot_sensitivity, (V, V[[0, 2, 4]], np.nan * SQUARE), "values has a number that is not finite"),
        (plot_correlation, (RESULT,), "result is a Result: must be a FitResult, PronyFit or SpectrumFit"),
        (plot.plot_result, (RESULT, [Figure().subplots()]), r"ax has 1 axes: must have 3 \(area, friction"),
        (plot.plot_result, (RESULT, Figure().subplots()), "ax is one axes, not a sequence: must have 3"),
        (plot.plot_result, (RESULT, ["a"]), "ax is a list, not a sequence of axes: must have 3"),
        (plot.plot_map, (RESULT, "area", [Figure().subplots()]), r"ax has 1 axes: must have 2 \(0.1 MPa"),
        (plot.plot_result, (V,), "velocity is missing: must be given as to solve and friction"),
        (plot.plot_map, (V,), "velocity is missing: must be given as to solve and friction"),
        (plot.plot_result, ("V",), "result must come from friction_map, solve or friction, got str"),
        (plot.auto, (object(),), "drawn must be a scene, a result of solve, friction_map or a fit"),
        (plot.plot_profile, (RESULT,), "profile is a Result: must be a Profile"),
        (plot.plot_accuracy, (RESULT,), "accuracy is a Result: must be a Accuracy"),
        (fitting.plot.plot_fit, (RESULT,), "result is a Result: must be of class FitResult"),
        (plot.plot_accuracy, (Accuracy(1e-6, (), None, 1, 1), 1), "ax must be one matplotlib axes"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_named(draw, arguments, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        draw(*arguments)


@pytest.mark.slow
def test_a_notebook_shows_a_figure_before_pyplot_has_made_one():
    script = """
from IPython.core.interactiveshell import InteractiveShell
shell = InteractiveShell.instance()
import rubberfric as rf
figure = rf.plot.auto(rf.SelfAffine(100.0, 1e3, 1e5, 0.8, 1e-4)).figure
print(sorted(shell.display_formatter.format(figure)[0]))
"""
    pytest.importorskip("IPython", reason="shown by notebooks alone")
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert found.stdout == "['image/png', 'text/plain']\n"
