"""Report of a fit, its tables, and its numbers by key path."""

import dataclasses
import re

import numpy as np
import pytest
from support.html_tables import cells, pairs
from support.scenes import fits
from support.scenes.fit_problems import REPORTED, RUBBER, fitted
from support.scenes.fits import E

import fitting
from fitting.parameters.scenes import unit
from fitting.results.record import Minimum
from fitting.results.report import LISTED
from fitting.solvers.objective import OUT_OF_STEPS


@pytest.fixture
def long():
    return fitted("many terms")


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


def test_report_of_failed_and_of_assumed_errors(quick):
    text = dataclasses.replace(quick, status=OUT_OF_STEPS).report()
    assert text.startswith(
        "THE FIT DID NOT SUCCEED: not converged: out of steps; raise max_steps\n\n[[Verdict]]\n"
    )
    data = fits.modulus_data(RUBBER, np.array([1e3]), 0.03, relative=None)
    result = fitting.fit(REPORTED, data, {f"{E}[1:]": fitting.Positive()})
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


def test_numbers_by_their_key_paths(joint, quick):
    hurst = joint["lower.spectrum.hurst"]
    assert hurst == (joint.values[3], joint.stderr[3], joint.start_values[3])
    moduli = joint[E]
    np.testing.assert_array_equal(moduli.value, joint.values[:3])
    np.testing.assert_array_equal(moduli.stderr, joint.stderr[:3])
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
        row or "-" for row in (unit(REPORTED, name.split("[")[0]) for name in names)
    ]
    one = data.correlation.sel(parameter=names[0], other=names[2])
    assert one == joint.correlation[0, 2] and data.correlation.dims == ("parameter", "other")


def test_units_of_key_paths():
    expected = {"upper.material.E[3]": "Pa", "lower.spectrum.q1": "1/m", "gamma": ""}
    assert {path: unit(REPORTED, path) for path in expected} == expected
    assert unit(REPORTED, "upper.material.shift.C2") == "K"
