"""Plots: lines, labels with units, axes, and rejected arguments."""

import io
import subprocess
import sys
import types

import jax.numpy as jnp
import matplotlib.colors
import numpy as np
import pytest
from matplotlib.figure import Figure

import fitting
import rubberfric as rf
from fitting.results.plot import plot_correlation
from rubberfric import plot
from rubberfric.analysis.sweep import Accuracy
from rubberfric.io.results import Conditions, Result
from rubberfric.plot.maps import figure_of_map

V = np.array([10.0, -1.0, 1e-3, 0.0, 1e-1])
ROAD = rf.SelfAffine(100.0, 1000.0, 1e5, 0.8, 1e-4)
TABLE = rf.TabulatedSpectrum([1e2, 1e3, 1e5], [1e-9, 1e-12, 1e-19])
RUBBER = rf.Prony(1e6, [1e8, 1e7], [1e-6, 1e-2], shift=rf.WLF(8.0, 100.0, 293.15))
MASTER = rf.TabulatedModulus([1e-3, 1.0, 1e2], [1e6, 2e6, 3e6], [1e5, 2e5, 1e5])
SCENE = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(RUBBER))
VALUES = 1.0 + np.arange(2 * 2 * 5.0).reshape(2, 2, 5)
RESULT = Result(
    SCENE,
    Conditions(V, np.array([1e5, 5e5]), np.array([283.15, 303.15])),
    rf.Solution(area=VALUES / 100, friction=VALUES, separation=1e-6 * VALUES, shear_friction=0.5 * VALUES),
    rf.Quadrature(),
    "Title",
)


def texts(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def drawn(axes):
    """The axes, after all of their figure was drawn; every label says a unit."""
    axes.figure.savefig(io.BytesIO(), format="png")
    for one in axes.figure.axes:
        for axis in (one.xaxis, one.yaxis):
            label = axis.get_label_text()
            assert not label or "[" in label or "/" in label, label
    return axes


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


def road(q):
    """C of ROAD, from h_rms^2 = 2 pi int q C dq."""
    q0, qr, q1, H, h = 100.0, 1000.0, 1e5, 0.8, 1e-4
    C0 = h**2 / (np.pi * qr**2 * (1 - (q0 / qr) ** 2 + (1 - (q1 / qr) ** (-2 * H)) / H))
    return C0 * np.maximum(q / qr, 1.0) ** (-2 * (1 + H))


def test_spectra():
    data = fitting.SpectrumData([1e4, 2e2, 1e3], [1e-16, 1e-10, 1e-12], relative=[0.1, 0.2, 0.3], name="scan")
    stretched = rf.Anisotropic(ROAD, 2.0)
    spectra = {"road": ROAD, "table": TABLE, "grooves": stretched, "scan": data}
    axes = drawn(plot.plot_spectrum(spectra))
    right = axes.figure.axes[-1]
    assert (axes.get_ylabel(), axes.get_xlabel()) == ("power spectrum $C$ [m$^4$]", "wavevector $q$ [1/m]")
    assert right.get_ylabel() == "rms slope up to $q$ [-]"
    assert {axes.get_xscale(), axes.get_yscale(), right.get_yscale()} == {"log"}
    marks = ["$q_0$, first", "$q_r$, roll-off", "$q_1$, cut-off", "rms slope (thin, right)"]
    assert texts(axes) == ["road", "table", "grooves", "scan", *marks]
    line, *road_marks = axes.lines[:4]
    assert [mark.get_xdata()[0] for mark in road_marks] == [100.0, 1000.0, 1e5]
    assert {100.0, 1000.0, 1e5} <= set(line.get_xdata())
    np.testing.assert_allclose(line.get_ydata(), road(line.get_xdata()), rtol=1e-12)
    log_q = np.linspace(np.log(100.0), np.log(1e5), 100_001)
    square = 2 * np.pi * np.trapezoid(np.exp(4 * log_q) * road(np.exp(log_q)), log_q)
    assert right.lines[0].get_ydata()[-1] == pytest.approx(np.sqrt(square), rel=1e-6)
    table, entries = axes.lines[4:6]
    np.testing.assert_allclose(entries.get_ydata(), TABLE.C)
    assert table.get_linestyle() != line.get_linestyle()
    points, _, (bars,) = axes.containers[0].lines
    np.testing.assert_array_equal(points.get_xdata(), [2e2, 1e3, 1e4])
    np.testing.assert_allclose(bars.get_segments()[0][:, 1], 1e-10 * np.exp([-0.2, 0.2]))


def test_one_spectrum_at_given_wavevectors_and_one_measured():
    axes = plot.plot_spectrum(ROAD, Figure().subplots(), q=[1e6, 300.0, 3000.0])
    np.testing.assert_array_equal(axes.lines[0].get_xdata(), [300.0, 3000.0])
    assert texts(axes)[0] == "$q_0$, first"
    x = np.arange(64) * 1e-6
    height = 1e-6 * np.outer(np.sin(3e5 * x), np.cos(2e5 * x))
    measured = rf.roughness.spectrum_of_topography(height, 1e-6, window="none", detrend=None)
    points = drawn(plot.plot_spectrum({"map": measured})).containers[0].lines[0]
    np.testing.assert_array_equal(points.get_ydata(), measured.C[measured.C > 0])


@pytest.mark.parametrize(
    "material", [RUBBER, rf.PronyShear(1e6, [1e8, 1e7], [1e-6, 1e-2], 2e9)], ids=["E", "G"]
)
def test_modulus_over_all_relaxation_times(material):
    axes = drawn(plot.plot_modulus(material))
    right = axes.figure.axes[-1]
    assert axes.get_xlabel() == "angular frequency $\\omega$ [rad/s]"
    assert axes.get_ylabel() == "modulus $E'$, $E''$ [Pa]"
    assert right.get_ylabel() == "$\\tan\\delta = E''/E'$ [-]" and right.get_ylim()[0] == 0
    assert (axes.get_xscale(), axes.get_yscale(), right.get_yscale()) == ("log", "log", "linear")
    storage, loss = axes.lines
    omega = storage.get_xdata()
    np.testing.assert_allclose(omega[[0, -1]], [1.0, 1e8])
    E = np.asarray(rf.complex_modulus(material, omega))
    np.testing.assert_allclose(storage.get_ydata(), E.real)
    np.testing.assert_allclose(loss.get_ydata(), E.imag)
    np.testing.assert_allclose(right.lines[0].get_ydata(), E.imag / E.real)
    assert len({line.get_linestyle() for line in (storage, loss, *right.lines)}) == 3
    assert texts(axes) == ["storage $E'$", "loss $E''$", "$\\tan\\delta$ (right)"]


def test_modulus_at_another_temperature_with_data_of_several():
    """Measured points and curve move by the same factors, and lie on each other."""
    omega, T = np.array([1e2, 1e3, 1e2, 1e3]), np.array([283.15, 283.15, 313.15, 313.15])
    E = np.asarray(rf.complex_modulus(RUBBER, omega, T))
    data = fitting.ModulusData(omega, E.real, E.imag, temperature=T)
    axes = plot.plot_modulus(RUBBER, temperature=303.15, data=data)
    assert axes.get_title() == "30 °C"
    storage, loss, *points = axes.lines
    for line, measured in zip((storage, loss), points, strict=True):
        at = np.interp(np.log(measured.get_xdata()), np.log(line.get_xdata()), np.log(line.get_ydata()))
        np.testing.assert_allclose(np.log(measured.get_ydata()), at, atol=2e-3)
    assert texts(axes)[-1] == "measured"
    own = plot.plot_modulus(
        MASTER, omega=[1.0, 1e-5], data=types.SimpleNamespace(omega=[2], storage=[3], loss=[4])
    )
    np.testing.assert_array_equal(own.lines[0].get_xdata(), [1e-5, 1.0])
    assert texts(own)[-2:] == ["entries of the table", "measured"]
    elastic = drawn(plot.plot_modulus(rf.Elastic(1e9, 0.3)))
    assert len(elastic.lines) == 1 and not elastic.figure.axes[-1].get_visible()


def test_sensitivity():
    tau, values = np.array([1e-2, 1e-6, 1e-4]), np.array([[0.1, 9, -0.2, 9, 0.3]] * 3) * [[1], [2], [-3]]
    axes = drawn(plot.plot_sensitivity(V, tau, values))
    assert axes.get_ylabel() == "relaxation time $\\tau_i$ [s]"
    assert axes.figure.axes[-1].get_ylabel().endswith("[-]")
    mesh, *contours = axes.collections
    np.testing.assert_allclose(mesh.get_array(), values[[1, 2, 0]][:, [2, 4, 0]])
    assert mesh.norm.vmin == -mesh.norm.vmax == -np.abs(values[:, [0, 2, 4]]).max()
    (contours,) = contours
    looks = dict(
        zip(
            contours.levels,
            zip(contours.get_linestyles(), contours.get_linewidths(), strict=True),
            strict=True,
        )
    )
    assert looks[0.0][1] > 1.5 and looks[0.0][0][1] is None
    assert all((style[1] is not None) == (level < 0) for level, (style, _) in looks.items())
    given = Figure().subplots()
    assert plot.plot_sensitivity(V, tau, 0 * values, given) is given


def fit_of(names, correlation):
    return types.SimpleNamespace(names=names, correlation=np.array(correlation))


def test_correlation_matrix():
    result = fit_of(
        ("upper.material.E[0]", "gamma", "x"), [[1, -0.804, np.nan], [-0.804, 1, np.nan], [np.nan] * 3]
    )
    axes = drawn(plot_correlation(result))
    assert [tick.get_text() for tick in axes.get_yticklabels()] == list(result.names)
    assert [tick.get_text() for tick in axes.get_xticklabels()] == list(result.names)
    assert [text.get_text() for text in axes.texts] == [
        "1.00",
        "\N{MINUS SIGN}0.80",
        "\N{MINUS SIGN}0.80",
        "1.00",
    ]
    assert len(axes.patches) == 5 and texts(axes) == ["error bar withheld"]
    assert axes.images[0].get_clim() == (-1, 1)
    given = Figure().subplots()
    assert plot_correlation(types.SimpleNamespace(fit=result), given) is given


def test_correlation_matrix_of_many():
    many = np.eye(20)
    many[0, 1] = many[1, 0] = -0.9
    axes = plot_correlation(fit_of([f"p{i}" for i in range(20)], many))
    assert [t.get_text() for t in axes.texts if t.get_text()] == ["\N{MINUS SIGN}"] * 2
    assert not plot_correlation(fit_of([f"p{i}" for i in range(41)], np.eye(41))).texts


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
        (plot.auto, (object(),), "found must be a scene, a result of solve, friction_map or a fit"),
        (plot.plot_profile, (RESULT,), "profile is a Result: must be a Profile"),
        (plot.plot_accuracy, (RESULT,), "accuracy is a Result: must be a Accuracy"),
        (fitting.plot.plot_fit, (RESULT,), "result is a Result: must be of class FitResult"),
        (plot.plot_accuracy, (Accuracy(1e-6, (), None, 1, 1), 1), "ax must be one matplotlib axes"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_named(draw, arguments, message):
    with pytest.raises(ValueError, match=f"^{message}"):
        draw(*arguments)


def test_data_of_several_temperatures_need_a_shift():
    data = fitting.ModulusData([1.0, 2.0], [1e6, 1e6], [1e5, 1e5], temperature=[280.0, 300.0])
    with pytest.raises(
        ValueError, match=r"data\.temperature has several values; then the material must have a shift"
    ):
        plot.plot_modulus(MASTER, data=data)


def test_single_precision_and_a_spectrum_below_its_smallest_number():
    far = rf.SelfAffine(*(np.float32(x) for x in (1e6, 1e7, 1e10, 0.8, 1e-12)))
    line = plot.plot_spectrum(far).lines[0]
    assert 0 < line.get_ydata()[-1] < 1e-46


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
