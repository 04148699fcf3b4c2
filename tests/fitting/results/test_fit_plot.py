"""Pictures of fits: data, bands, residuals and outliers; standard errors of tables and designs."""

import dataclasses

import numpy as np
import pytest
from support.scenes import fits
from support.scenes.fit_problems import OMEGA, REPORTED, RUBBER
from support.scenes.fits import FAST

import fitting
import rubberfric as rf
from fitting.results.plot import CurveConditions, PlottedCurve, curve_looks, plot_fit, save_plot
from rubberfric.plot import style


@pytest.mark.slow
def test_plot_draws_data_fit_band_and_residuals(joint):
    axes = plot_fit(joint)
    assert len(axes) == 6
    friction, residual = axes[:2]
    labels = [text.get_text() for text in friction.get_legend().get_texts()]
    assert labels == ["0.1 MPa, 10 °C", "1 MPa, 10 °C", "0.1 MPa, 40 °C", "1 MPa, 40 °C", "95 % band"]
    lines = [line for line in friction.lines if line.get_xdata().size > 6]
    assert len(lines) == len(friction.collections) / 2 == 4  # error bars and bands
    assert len({(line.get_color().tobytes(), line.get_linestyle()) for line in lines}) == 4
    data = joint.data[0]
    for line, p, T in zip(lines, [1e5, 1e6, 1e5, 1e6], [283.15, 283.15, 313.15, 313.15], strict=True):
        v = 10 ** line.get_xdata()
        np.testing.assert_allclose(v[[0, -1]], [1e-4, 10.0])
        np.testing.assert_allclose(line.get_ydata(), joint.predict(v, p, T), rtol=1e-12)
    band = joint.band(np.logspace(-4, 1, 120), 1e5, 283.15)
    shaded = friction.collections[1].get_paths()[0].vertices[:, 1]
    assert shaded.min() == pytest.approx(band.low.min(), rel=1e-9)
    assert shaded.max() == pytest.approx(band.high.max(), rel=1e-9)

    first = (data.pressure == 1e5) & (data.temperature == 283.15)
    points = friction.containers[0].lines[0]
    np.testing.assert_array_equal(points.get_ydata(), data.friction[first])
    bars = friction.containers[0].lines[2][0].get_segments()
    error = joint.estimated[0]
    np.testing.assert_allclose(
        [bar[:, 1] for bar in bars], data.friction[first, None] * np.exp([-error, error])
    )
    expected = np.log(data.friction[first] / joint.predict(data.velocity[first], 1e5, 283.15)) / error
    np.testing.assert_allclose(residual.lines[0].get_ydata(), expected, rtol=1e-9)
    assert {-2.0, 2.0} <= {line.get_ydata()[0] for line in residual.lines[-3:]}

    for panel, label in zip(
        axes, ["friction", "error", "modulus", "error", "spectrum", "error"], strict=True
    ):
        assert label in panel.get_ylabel()
    assert axes[1].get_xlabel() == "velocity $v$ [m/s]"  # whose ticks are powers of ten of log10 v
    assert [panel.get_xscale() for panel in axes] == ["linear"] * 2 + ["log"] * 4
    assert [panel.get_yscale() for panel in axes[2::2]] == ["log"] * 2
    modulus = [line for line in axes[2].lines if line.get_xdata().size > 12]
    E = np.asarray(rf.complex_modulus(joint.scene.upper.material, modulus[0].get_xdata()))
    for line, expected in zip(modulus, (E.real, E.imag), strict=True):
        np.testing.assert_allclose(line.get_ydata(), expected, rtol=1e-9)
    (spectrum,) = (line for line in axes[4].lines if line.get_xdata().size > 8)
    C = rf.power_spectrum(joint.scene.lower.spectrum, spectrum.get_xdata()[1:-1])
    np.testing.assert_allclose(spectrum.get_ydata()[1:-1], C, rtol=1e-9)


def test_an_outlier_does_not_squeeze_the_plot(quick):
    """It is an arrow at the edge; the limits are those without it."""
    data = quick.data[0]
    outlier = dataclasses.replace(data, storage=data.storage * np.where(np.arange(12) == 5, 1e4, 1))
    spoiled = plot_fit(fitting.fit(REPORTED, outlier, quick.free, loss="huber", quadrature=FAST))
    plain = plot_fit(quick)
    assert spoiled[0].get_ylim()[1] < 2 * plain[0].get_ylim()[1]
    assert spoiled[1].get_ylim()[1] < 2 * plain[1].get_ylim()[1]
    arrows = [
        [line.get_xdata().tolist() for line in panel.lines if line.get_marker() == "^"] for panel in spoiled
    ]
    assert arrows[0][:2] == [[data.omega[5]], []] and arrows[1] == [[data.omega[5]]]
    texts = [text.get_text() for text in spoiled[0].get_legend().get_texts()]
    assert "outlier, beyond the axes" in texts
    assert "outlier, beyond the axes" not in [text.get_text() for text in plain[0].get_legend().get_texts()]


def test_colours_of_temperatures_and_markers_of_pressures():
    def at(p, T):
        return CurveConditions("", "", "velocity", (("pressure", p), ("temperature", T)))

    keys = [at(p, T) for T in (263.15, 293.15) for p in (1e5, 5e5, 2e6)]
    curves = [PlottedCurve("", key, 0, look, np.arange(1)) for look, key in enumerate(keys)]
    looks = curve_looks(curves)
    assert [look["marker"] for look in looks] == 2 * ["o", "s", "^"]
    assert [look["linestyle"] for look in looks] == 2 * list(style.DASHES[:3])
    tones = [tuple(look["color"]) for look in looks]
    assert len(set(tones[:3])) == len(set(tones[3:])) == 1 and tones[0] != tones[3]
    one = [PlottedCurve("", at(p, 293.15), 0, k, np.arange(1)) for k, p in enumerate((1e5, 2e6))]
    np.testing.assert_array_equal([look["color"] for look in curve_looks(one)], style.colours(2))
    (alone,) = curve_looks([one[0]._replace(conditions=None)])
    np.testing.assert_array_equal(alone["color"], style.colours(1)[0])


def test_plot_into_given_axes(quick):
    from matplotlib.figure import Figure

    ax = Figure().subplots(2, 1)
    assert plot_fit(quick, ax) is ax
    with pytest.raises(
        ValueError, match=r"ax has 3 axes: must have 2, a panel and its residuals for each of mod"
    ):
        quick.plot(Figure().subplots(3, 1))


def interrupted(*_, **__):
    raise KeyboardInterrupt


def test_picture_is_written_whole_or_not_at_all(quick, tmp_path, monkeypatch):
    save_plot(tmp_path / "fit.png", quick, "Title")
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG\r\n")
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save_plot(tmp_path / "other.png", quick)
    assert [path.name for path in tmp_path.iterdir()] == ["fit.png"]


@pytest.mark.slow
def test_standard_errors_of_a_friction_table_are_those_of_a_narrower_band(joint):
    table = fitting.friction_table(joint, (1e-3, 1e-1), 2e5, 283.15, error=0.3)
    level, T = 0.5, table.temperature[:, None, None]
    band = joint.band(table.velocity, table.pressure[:, None], T, level=level)
    half = np.log(band.high / band.value)
    assert table.sigma.shape == table.friction.shape
    np.testing.assert_allclose(table.sigma, band.value * half / joint.quantile(level), rtol=1e-6)
    assert (table.sigma > 1e-3 * table.friction).all()


def test_a_design_states_the_relative_errors_of_the_fit():
    """Errors of x / value for Positive and Bounded parameters, as in the report of the fit."""
    free = {"upper.material.E[0]": fitting.Bounded(1e7, 1e9)}
    result = fitting.fit(REPORTED, fits.modulus_data(RUBBER, OMEGA, 0.03), free, quadrature=FAST)
    designed = fitting.design(result, candidates=(np.array([1e-2, 1.0]), 1e5, 293.15), n=1)
    assert designed.rate * designed.before == pytest.approx(result.stderr / result.values, rel=1e-9)
    assert designed.before[0] > 1.05 * result.stderr[0] / result.values[0]
    share = 100 * result.stderr[0] / result.values[0]
    assert f"upper.material.E[0]  {f'{share:.3g} %':>10}" in designed.report()
