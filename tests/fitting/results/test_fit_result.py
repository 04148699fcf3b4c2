"""Report, plot and file of a fit."""

import dataclasses
import re

import h5py
import jax
import numpy as np
import pytest
from support.html_tables import cells, pairs
from support.scenes.fits import FAST

import fitting
import rubberfric as rf
from fitting.parameters.scenes import unit
from fitting.results.hdf5 import GROUPS, save
from fitting.results.plot import CurveConditions, PlottedCurve, curve_looks, plot_fit, save_plot
from fitting.results.record import Minimum
from fitting.results.report import LISTED
from fitting.solvers.objective import INTERRUPTED, OUT_OF_STEPS
from rubberfric.base.objects.physical import PhysicalObject
from rubberfric.io.hdf5 import read_object
from rubberfric.plot import style

RUBBER = rf.Prony(
    1e6, np.array([1e8, 1e7, 3e6]), np.array([1e-6, 1e-4, 1e-2]), shift=rf.WLF(8.0, 100.0, 293.15)
)
ROAD = rf.Body(rf.Rigid(), rf.SelfAffine(100.0, 1000.0, 1e4, 0.8, 1e-4))
SCENE = rf.Scene(ROAD, rf.Body(RUBBER))
OMEGA = np.logspace(0, 7, 12)


def noise(size, scale, seed=0):
    return np.exp(scale * np.random.default_rng(seed).standard_normal(size))


def modulus(omega=OMEGA, scene=SCENE, **errors):
    E = np.asarray(rf.complex_modulus(scene.upper.material, omega))
    return fitting.ModulusData(
        omega, E.real * noise(omega.size, 0.03), E.imag * noise(omega.size, 0.03, 1), **errors
    )


@pytest.fixture(scope="module")
def joint():
    """A fit of three quantities, with errors of every kind, priors and a tied parameter."""
    v, p, T = (a.ravel() for a in np.meshgrid(np.logspace(-4, 1, 6), [1e5, 1e6], [283.15, 313.15]))
    mu = rf.friction(SCENE, v, p, T, quadrature=FAST) * noise(24, 0.03)
    omega, q = np.logspace(1, 6, 6), np.geomspace(200.0, 9000.0, 8)
    E = np.asarray(rf.complex_modulus(RUBBER, omega))
    C = np.asarray(rf.power_spectrum(ROAD.spectrum, q)) * noise(8, 0.2)
    data = [
        fitting.FrictionData(v, mu, pressure=p, temperature=T, name="Läufer 1"),
        fitting.ModulusData(omega, E.real, E.imag, sigma_storage=0.1 * E.real, sigma_loss=0.1 * E.imag),
        fitting.SpectrumData(q, C, relative=np.linspace(0.1, 0.3, 8), body="lower"),
    ]
    free = {
        "upper.material.E[:2]": fitting.Positive(start=[9e7, 9e6]),
        "upper.material.E[2]": fitting.Positive(),
        "upper.material.E_inf": fitting.Tied("upper.material.E[2]", ratio=0.3),
        "lower.spectrum.hurst": fitting.Bounded(0.3, 1, start=0.7),
    }
    prior = {"lower.spectrum.hurst": fitting.Gaussian(0.75, 0.1), "upper.material.E": fitting.Smooth(2.0)}
    return fitting.fit(SCENE, data, free, prior=prior, quadrature=FAST)


@pytest.fixture(scope="module")
def quick():
    """A fit to a modulus, which compiles fast; gamma is without any effect on it."""
    free = {"upper.material.E": fitting.Positive(), "gamma": fitting.Free(scale=0.1)}
    return fitting.fit(SCENE, modulus(relative=0.03), free, loss="huber", quadrature=FAST)


def section(text, title):
    """Lines of one section of a report."""
    _, _, rest = text.partition(f"[[{title}]]\n")
    return [line[4:] for line in rest.split("[[")[0].splitlines()]


def test_report_of_a_joint_fit(joint):
    text = joint.report()
    titles = ["Verdict", "Fit", "Data", "Statistics", "Variables", "Tied", "Priors", "Correlations"]
    assert re.findall(r"^\[\[(.*)\]\]$", text, re.M) == titles
    assert text.startswith("[[Verdict]]\n")

    fit = section(text, "Fit")
    assert fit[0] == "method      = lm (Levenberg-Marquardt)"
    assert fit[1] == f"message     = {joint.message}"
    assert fit[2] == "data        = 3 sets, 44 values"
    assert fit[3] == "contact     = theory as in the paper, mu within -77 ... +27 % of boundary elements"
    assert fit[4] == f"evaluations = {joint.nfev} of the residuals, {joint.njev} of their derivatives"

    data = section(text, "Data")
    percent = f"{100 * joint.estimated[0]:.3g}"
    assert data[0] == f"1: Läufer 1: 24 values, no errors given: {percent} % estimated from the scatter"
    assert data[2] == "2: modulus, 6 points: 12 values, errors given"
    assert data[4].startswith("3: spectrum of the lower body, 8 points: 8 values, errors given (relative")
    assert data[4].endswith(" 10 ... 30 %)")
    shares = [float(line.split("=")[1]) for line in data[1::2]]
    sizes = np.array([24, 12, 8])
    np.testing.assert_allclose(np.sum(sizes * shares), joint.chisqr, rtol=1e-3)

    statistics = dict(line.split(" = ") for line in section(text, "Statistics"))
    statistics = {name.strip(): value for name, value in statistics.items()}
    assert float(statistics["chi-square"]) == pytest.approx(joint.chisqr, rel=1e-5)
    assert float(statistics["reduced chi-square"]) == pytest.approx(joint.redchi, rel=1e-4)
    assert float(statistics["degrees of freedom"]) == pytest.approx(joint.freedom, rel=1e-4)
    assert float(statistics["cost"]) == pytest.approx(joint.cost, rel=1e-5)
    assert statistics["identified"] == "4 of 4 directions"
    assert "loss" not in statistics

    assert section(text, "Tied") == [
        f"upper.material.E_inf: {joint.scene.upper.material.E_inf:.6g} Pa, 0.3 times upper.material.E[2]"
    ]
    away = abs(joint.values[3] - 0.75) / 0.1
    assert section(text, "Priors") == [
        f"lower.spectrum.hurst: 0.75 +/- 0.1, fitted value {away:.2g} of these errors away",
        "upper.material.E: smooth, slopes change by about 2 from term to term",
    ]


def test_variables_are_aligned_and_right(joint):
    lines = section(joint.report(), "Variables")
    form = re.compile(r"(\S+): +(\S+) \+/- (\S+) +(Pa)? +\( *(\S+) %\)  \(start = (\S+)\)")
    assert len(lines) == 4
    assert len({line.index("+/-") for line in lines}) == 1
    assert len({line.index("(start") for line in lines}) == 1
    for line, *expected in zip(
        lines, joint.names, joint.values, joint.stderr, joint.start_values, strict=True
    ):
        name, value, error, pascal, percent, start = form.fullmatch(line).groups()
        assert name == expected[0]
        assert pascal == ("Pa" if "material" in name else None)
        assert abs(float(value) - expected[1]) < 0.1 * expected[2]
        assert float(error) == pytest.approx(expected[2], rel=0.05)
        assert float(percent) == pytest.approx(100 * expected[2] / expected[1], abs=0.006)
        assert float(start) == pytest.approx(expected[3], rel=1e-5)


def test_what_is_not_identified_has_no_error_bar_but_a_reason(quick):
    text = quick.report()
    (line,) = (line for line in section(text, "Variables") if line.startswith("gamma"))
    assert re.fullmatch(
        r"gamma: +0\.5 \+/- \? .* \(start = 0\.5\) +error bar withheld: not identified, see direction 1", line
    )
    assert section(text, "Not identified") == [f"1: {quick.unidentified[0].text}"]
    assert "identified         = 3 of 4 directions" in section(text, "Statistics")
    assert "loss               = huber, width 1.345 standard errors" in section(text, "Statistics")


def test_numbers_by_their_key_paths(joint, quick):
    hurst = joint["lower.spectrum.hurst"]
    assert hurst == (joint.values[3], joint.stderr[3], joint.start_values[3])
    E = joint["upper.material.E"]
    np.testing.assert_array_equal(E.value, joint.values[:3])
    np.testing.assert_array_equal(E.stderr, joint.stderr[:3])
    assert joint["upper.material.E[1]"].value == joint.values[1]
    assert np.isnan(quick["gamma"].stderr)
    with pytest.raises(KeyError, match=r"'lower\.spectrum\.hirst' was not free: did you mean"):
        joint["lower.spectrum.hirst"]
    frame = quick.to_dataframe()
    assert list(frame.index) == list(quick.names)
    np.testing.assert_array_equal(frame["value"], quick.values)
    assert frame.loc["gamma", "withheld"].startswith("not identified")
    assert list(frame["unit"]) == ["Pa", "Pa", "Pa", "-"]


def test_data_set_of_a_fit(joint):
    pytest.importorskip("xarray")
    data = joint.to_xarray()
    names = list(joint.names)
    assert data.value.sel(parameter="upper.material.E[1]") == joint.values[1]
    assert list(data.unit.values) == [
        row or "-" for row in (unit(SCENE, name.split("[")[0]) for name in names)
    ]
    one = data.correlation.sel(parameter=names[0], other=names[2])
    assert one == joint.correlation[0, 2] and data.correlation.dims == ("parameter", "other")


def test_report_of_failed_and_of_assumed_errors(quick):
    text = dataclasses.replace(quick, status=OUT_OF_STEPS).report()
    assert text.startswith(
        "THE FIT DID NOT SUCCEED: not converged: out of steps; raise max_steps\n\n[[Verdict]]\n"
    )
    data = modulus(np.array([1e3]))
    result = fitting.fit(SCENE, data, {"upper.material.E[1:]": fitting.Positive()})
    lines = section(result.report(), "Data")
    assert lines[0].endswith("2 values, no errors given: 10 % assumed, too few values to estimate")
    stopped = section(dataclasses.replace(result, status=OUT_OF_STEPS).report(), "Data")
    assert stopped[0].endswith("no errors given: 10 % assumed, not estimated without success")
    assert "reduced chi-square = none: no degrees of freedom" in section(result.report(), "Statistics")
    assert (
        section(quick.report(), "Data")[0] == "1: modulus, 12 points: 24 values, errors given (relative 3 %)"
    )


def test_report_says_what_was_done_to_data(quick):
    data = (dataclasses.replace(quick.data[0], history=("E_stor = 2 (1 + poisson) G_stor",)),)
    lines = section(dataclasses.replace(quick, data=data).report(), "Data")
    assert lines[1] == "   E_stor = 2 (1 + poisson) G_stor"


def test_correlations_are_sorted_cut_and_closed(quick):
    def lines(correlation):
        known = quick.uncertainty._replace(correlation=np.array(correlation))
        return section(dataclasses.replace(quick, uncertainty=known).report(), "Correlations")

    nan = np.nan
    first, second, last = lines(
        [[1, -0.6, 0.4999, nan], [-0.6, 1, 0.92344, nan], [0.4999, 0.92344, 1, nan], [nan] * 4]
    )
    assert first == "C(upper.material.E[1], upper.material.E[2]) = +0.9234"
    assert second == "C(upper.material.E[0], upper.material.E[1]) = -0.6000"
    assert last == "(unreported correlations are < 0.500)"
    assert lines(np.eye(4)) == []


def test_at_most_twenty_correlations(long):
    size = len(long.names)
    correlation = 0.6 + 0.3 * np.random.default_rng(0).uniform(size=(size, size))
    text = dataclasses.replace(long, uncertainty=long.uncertainty._replace(correlation=correlation)).report()
    *lines, last = section(text, "Correlations")
    left_out = np.sort(correlation[np.triu_indices(size, 1)])[-21]
    assert len(lines) == 20
    below = float(re.fullmatch(r"\(unreported correlations are < (0\.\d{3})\)", last).group(1))
    assert 0 <= below - left_out < 1e-3


@pytest.fixture(scope="module")
def long():
    """A fit of a long array that the data inform only in part."""
    tau = np.logspace(-15, -2, 30)
    scene = rf.Scene(ROAD, rf.Body(rf.Prony(1e6, np.full(30, 1e6), tau)))
    data = modulus(np.logspace(0, 12, 40), scene, relative=0.03)
    return fitting.fit(scene, data, {"upper.material.E": fitting.Positive()}, quadrature=FAST)


def test_of_a_long_array_both_ends_are_listed(long):
    lines = section(long.report(), "Variables")
    half = LISTED // 2
    assert len(lines) == LISTED + 1
    assert [line.split(":")[0] for line in lines[:half]] == list(long.names[:half])
    assert [line.split(":")[0] for line in lines[half + 1 :]] == list(long.names[-half:])
    bare = sum(name in long.withheld for name in long.names[half:-half])
    note = f", {bare} of them without an error bar" if bare else ""
    assert lines[half] == f"... {30 - LISTED} more, see result.values{note}"


@pytest.mark.slow
def test_minima_of_several_starts(quick, joint):
    found = (Minimum(5.0, 7, quick.values), Minimum(12.25, 1, quick.values))
    lines = section(dataclasses.replace(quick, minima=found).report(), "Minima")
    assert lines == ["cost 5            reached by 7 starts", "cost 12.25        reached by 1 start"]
    lines = section(dataclasses.replace(joint, minima=(Minimum(5.0, 2, joint.values),)).report(), "Minima")
    assert lines[1] == "(with the errors assumed to be 10 %, before they were estimated)"
    assert "[[Minima]]" not in quick.report()


def test_units_of_key_paths():
    expected = {"upper.material.E[3]": "Pa", "lower.spectrum.q1": "1/m", "gamma": ""}
    assert {path: unit(SCENE, path) for path in expected} == expected
    assert unit(SCENE, "upper.material.shift.C2") == "K"


def test_table_of_a_fit_in_a_notebook(quick):
    headings, *rows = cells(quick)
    assert headings == ["parameter", "value", "relative error", "start", ""]
    values, errors = quick.values, quick.stderr
    name, value, share, start, note = rows[0]
    assert (name, start, note) == ("upper.material.E[0]", "1e+08 Pa", "")
    assert float(value.split()[0]) == pytest.approx(values[0], rel=1e-2)
    assert value.split()[1:] == ["+/-", f"{errors[0]:#.2g}", "Pa"]
    assert share == f"{100 * errors[0] / values[0]:.2f} %"
    assert rows[3][1] == "0.5 +/- ? " and rows[3][4] == f"error bar withheld: {quick.withheld['gamma']}"
    assert rows[4] == [f"not identified, 1: {quick.unidentified[0].text}"]
    assert rows[5][0].startswith(f"measured values: 24; reduced chi-square [-]: {quick.redchi:.4g}")
    assert quick.message in quick._repr_html_() and "[[Statistics]]" in quick._repr_html_()
    assert pairs(quick)["lower.spectrum.q1"] == "10000 1/m"
    failed = dataclasses.replace(quick, status=OUT_OF_STEPS)
    assert "THE FIT DID NOT SUCCEED: not converged" in failed._repr_html_()


def test_standard_errors_of_a_friction_table_are_those_of_a_narrower_band(joint):
    table = fitting.friction_table(joint, (1e-3, 1e-1), 2e5, 283.15, error=0.3)
    level, T = 0.5, table.temperature[:, None, None]
    band = joint.band(table.velocity, table.pressure[:, None], T, level=level)
    half = np.log(band.high / band.value)
    assert table.sigma.shape == table.friction.shape
    np.testing.assert_allclose(table.sigma, band.value * half / joint.quantile(level), rtol=1e-6)
    assert (table.sigma > 1e-3 * table.friction).all()


@pytest.mark.slow
def test_plot_draws_data_fit_band_and_residuals(joint):
    axes = plot_fit(joint)
    assert len(axes) == 6
    friction, residual = axes[:2]
    labels = [text.get_text() for text in friction.get_legend().get_texts()]
    assert labels == ["0.1 MPa, 10 °C", "1 MPa, 10 °C", "0.1 MPa, 40 °C", "1 MPa, 40 °C", "95 % band"]
    lines = [line for line in friction.lines if line.get_xdata().size > 6]
    assert len(lines) == len(friction.collections) / 2 == 4  # error bars and bands
    assert len({line.get_color().tobytes() for line in lines}) == 4
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
    assert "log" in axes[1].get_xlabel()
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
    spoiled = plot_fit(fitting.fit(SCENE, outlier, quick.free, loss="huber", quadrature=FAST))
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


def test_a_design_states_the_relative_errors_of_the_fit():
    """Errors of x / value for Positive and Bounded parameters, as in the report of the fit."""
    free = {"upper.material.E[0]": fitting.Bounded(1e7, 1e9)}
    result = fitting.fit(SCENE, modulus(relative=0.03), free, quadrature=FAST)
    designed = fitting.design(result, candidates=(np.array([1e-2, 1.0]), 1e5, 293.15), n=1)
    assert designed.rate * designed.before == pytest.approx(result.stderr / result.values, rel=1e-9)
    assert designed.before[0] > 1.05 * result.stderr[0] / result.values[0]
    share = 100 * result.stderr[0] / result.values[0]
    assert f"upper.material.E[0]  {f'{share:.3g} %':>10}" in designed.report()


def test_plot_into_given_axes(quick):
    from matplotlib.figure import Figure

    ax = Figure().subplots(2, 1)
    assert plot_fit(quick, ax) is ax
    with pytest.raises(
        ValueError, match=r"ax has 3 axes: must have 2, a panel and its residuals for each of mod"
    ):
        quick.plot(Figure().subplots(3, 1))


def test_picture_is_written_whole_or_not_at_all(quick, tmp_path, monkeypatch):
    save_plot(tmp_path / "fit.png", quick, "Title")
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG\r\n")
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save_plot(tmp_path / "other.png", quick)
    assert [path.name for path in tmp_path.iterdir()] == ["fit.png"]


def interrupted(*_, **__):
    raise KeyboardInterrupt


def same(one, other):
    """Equality to the last bit, of whatever a result holds."""
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if isinstance(one, fitting.data.measured.Measured | PhysicalObject):
        names = [field.name for field in dataclasses.fields(one)]
        return type(one) is type(other) and all(same(getattr(one, n), getattr(other, n)) for n in names)
    if isinstance(one, tuple):
        return type(one) is type(other) and len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray | jax.Array):
        return one.dtype == other.dtype and np.array_equal(one, other, equal_nan=True)
    return type(one) is type(other) and (one == other or one != one)


@pytest.mark.parametrize("which", ["joint", "quick", "long"])
def test_file_round_trip(which, request, tmp_path):
    result = request.getfixturevalue(which)
    result.save(tmp_path / "fit.h5")
    again = fitting.FitResult.load(tmp_path / "fit.h5")
    names = [
        name for name in dir(fitting.FitResult) if isinstance(getattr(fitting.FitResult, name), property)
    ]
    assert {"scene", "values", "stderr", "redchi", "success", "unidentified"} < set(names)
    for name in (*names, *(field.name for field in dataclasses.fields(result))):
        assert same(getattr(result, name), getattr(again, name)), name
    assert again.report() == result.report()
    assert same(result.interval(), again.interval())


@pytest.mark.slow
def test_a_fit_from_a_file_predicts_and_goes_on(joint, quick, tmp_path):
    for result in (joint, quick):
        result.save(tmp_path / "fit.h5")  # over the first
        again = fitting.FitResult.load(tmp_path / "fit.h5")
        at = (np.array([1e-3, 1e-1]), 2e5, 300.0)
        np.testing.assert_array_equal(again.predict(*at), result.predict(*at))
        if result is joint:
            assert same(again.band(*at), result.band(*at))
        else:
            assert same(again.profile(result.names[0], points=2), result.profile(result.names[0], points=2))
            assert same(again.bootstrap(2), result.bootstrap(2))


def test_other_tools_can_read_the_file(joint, tmp_path):
    save(tmp_path / "fit.h5", joint, title="Title")
    with h5py.File(tmp_path / "fit.h5") as file:
        assert file.attrs["format"] == "rubberfric fit"
        assert file.attrs["title"] == "Title"
        assert file.attrs["message"] == joint.message
        assert file["report"].asstr()[()] == joint.report()
        parameters = file["parameters"]
        assert parameters["names"].asstr()[()].tolist() == list(joint.names)
        assert parameters["units"].asstr()[()].tolist() == ["Pa", "Pa", "Pa", "-"]
        for name in ("values", "start_values", "stderr"):
            np.testing.assert_array_equal(parameters[name], getattr(joint, name))
        np.testing.assert_array_equal(file["uncertainty/covariance"], joint.covariance)
        np.testing.assert_array_equal(file["uncertainty/correlation"], joint.correlation)
        assert same(read_object(file["scene"]), joint.scene)
        assert file["data/0"].attrs["name"] == "Läufer 1"


@pytest.mark.parametrize(("element", "x"), [(-1, 50.0), (0, 800.0)])
def test_a_fitted_scene_that_no_constructor_accepts_is_left_out(quick, tmp_path, element, x):
    """gamma = 5, which is refused at once, and E = inf, which is found deep inside."""
    moved = quick.x.copy()
    moved[element] = x
    save(tmp_path / "fit.h5", dataclasses.replace(quick, x=moved))
    with h5py.File(tmp_path / "fit.h5") as file:
        assert "scene" not in file
    assert fitting.FitResult.load(tmp_path / "fit.h5").values[element] == (5.0 if element else np.inf)


@pytest.mark.slow
def test_single_precision_stays(tmp_path):
    scene = jax.tree.map(lambda leaf: np.asarray(leaf, np.float32), SCENE)
    data = modulus(relative=0.03)
    result = fitting.fit(scene, data, {"upper.material.E": fitting.Positive()}, max_steps=2)
    assert result.scene.upper.material.tau.dtype == result.problem.targets.error.dtype == np.float32
    result.save(tmp_path / "fit.h5")
    again = fitting.FitResult.load(tmp_path / "fit.h5")
    assert same(again.scene, result.scene)
    assert same(again.problem.targets, result.problem.targets)
    assert same(again.values, result.values)


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_earlier_file_survives_a_failure(quick, tmp_path, monkeypatch, failure):
    path = tmp_path / "fit.h5"
    quick.save(path)
    before = path.read_bytes()

    def fail(*_):
        raise failure

    monkeypatch.setattr("fitting.results.hdf5._write_minima", fail)
    with pytest.raises(type(failure)):
        quick.save(path)
    assert path.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["fit.h5"]


def drop(name):
    return lambda file: file.__delitem__(name)


def attribute(group, **values):
    return lambda file: file[group].attrs.update(values)


def replace(name, values, units="-"):
    def change(file):
        del file[name]
        file[name] = values
        file[name].attrs["units"] = units

    return change


BAD = {
    "newer": (attribute("/", format_version=2), "format_version = 2: must be 1"),
    "foreign": (attribute("/", format="rubberfric scene"), "format = 'rubberfric scene': must be"),
    "status": (attribute("/", status=99), "status = 99: must be one of 0, 1, "),
    "cost": (attribute("/", cost="low"), "attribute cost = 'low': must be of type float"),
    "loss": (attribute("/", loss="hubert"), "loss = 'hubert': did you mean 'huber'? must be one of linear"),
    "extra": (attribute("/", colour="red"), "attribute 'colour' is unknown"),
    "x": (replace("parameters/x", [1.0]), "/parameters/x has shape (1,): must be (4,)"),
    "names": (replace("parameters/names", ["a", "b", "c", "d"]), "/parameters/names: must list the"),
    "no names": (replace("parameters/names", [1.0]), "/parameters/names: is missing; must be a dataset of"),
    "covariance": (drop("uncertainty/covariance"), "/uncertainty/covariance: is missing; must be a dataset"),
    "rank": (lambda file: file["uncertainty"].attrs.__delitem__("rank"), "attribute rank = None: must be"),
    "count": (replace("minima/count", [1.5]), "/minima/count: must be 1 integers"),
    "estimated": (replace("estimated", [1.0, 2.0]), "/estimated has shape (2,): must be (1,)"),
    "rule": (attribute("free/0", rule="Positiv"), "/free/0: rule = 'Positiv': did you mean 'Positive'?"),
    "no rule": (attribute("free/1", low=1.0), "/free/1: attribute 'low' is unknown"),
    "scale": (attribute("free/1", scale=-1.0), "/free/1: Free: scale = -1.0: must be a number > 0"),
    "path": (attribute("free/0", path="upper.material.F"), "'upper.material.F': unknown key path; did you"),
    "no path": (lambda file: file["free/0"].attrs.__delitem__("path"), "must be a key path like"),
    "numbers": (lambda file: file.move("free/0", "free/2"), "/free/0: is missing; must be a group"),
    "data": (attribute("data/0", kind="mass"), "/data/0: kind = 'mass': must be one of friction, area"),
    "order": (attribute("quadrature", order=1), "Quadrature.order = 1"),
    **{name: (drop(name), f"/{name}: is missing; must be a group") for name in GROUPS},
}


@pytest.mark.parametrize("which", BAD)
def test_damaged_files(quick, tmp_path, which):
    change, message = BAD[which]
    path = tmp_path / "fit.h5"
    quick.save(path)
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        fitting.FitResult.load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_files_that_are_none(quick, tmp_path):
    for name, said in (("fit.hdf", "'.hdf': must be .h5"), ("no/fit.h5", "does not exist"), (".", "''")):
        with pytest.raises(ValueError, match=said):
            quick.save(tmp_path / name)
    assert list(tmp_path.iterdir()) == []
    path = tmp_path / "fit.h5"
    with pytest.raises(ValueError, match=r"fit\.h5: cannot be read: No such file"):
        fitting.FitResult.load(path)
    quick.save(path)
    whole = path.read_bytes()
    for length in (0, 100, len(whole) // 2, len(whole) - 100):
        path.write_bytes(whole[:length])
        with pytest.raises(ValueError, match=r"fit\.h5: must be a whole HDF5 file"):
            fitting.FitResult.load(path)


def test_interrupted_fits_are_stored_as_such(quick, tmp_path):
    dataclasses.replace(quick, status=INTERRUPTED, cost=np.inf).save(tmp_path / "fit.h5")
    again = fitting.FitResult.load(tmp_path / "fit.h5")
    assert not again.success
    assert again.message == "interrupted: these are the best values so far"
    assert again.cost == np.inf
