"""Pictures of spectra, moduli, sensitivities and correlations."""

import types

import numpy as np
import pytest
from matplotlib.figure import Figure
from support.scenes.plots import MASTER, ROAD, RUBBER, V, drawn, road, texts

import fitting
import rubberfric as rf
from fitting.results.plot import plot_correlation
from rubberfric import plot

TABLE = rf.TabulatedSpectrum([1e2, 1e3, 1e5], [1e-9, 1e-12, 1e-19])


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
