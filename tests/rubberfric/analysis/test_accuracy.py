"""Errors and run times of accuracy settings, checked against brute force; report and file."""

import functools
import unittest.mock

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import ROAD
from problems import SHIFTED_TREAD as TREAD
from support.cases.stored import QUANTITIES, reference, scene, three
from support.folders import DATA

import rubberfric as rf
from rubberfric.analysis import sweep
from rubberfric.analysis.reference import (
    SETTINGS,
    Errors,
    Outcome,
    Reference,
    arguments,
    case_of,
    compare_outcomes,
    node_count,
    rounded,
    with_automatic,
)
from rubberfric.analysis.reference import reference as reference_of
from rubberfric.analysis.sweep import Accuracy, Row

CASE = reference("forward_cases")["smooth-rubber-rough-rigid-0"]
AT = scene(CASE), CASE["v"], CASE["pressure"]
COARSE = rf.Quadrature(order=4, panels=3, graded=1, ratio=6.0, angular_order=4)
MIDDLE = rf.Quadrature(order=10, panels=6, graded=3, ratio=6.0, angular_order=10)
SCENE = rf.Scene(rf.Body(TREAD), rf.Body(rf.Rigid(), ROAD))
VELOCITY = np.array([1e-5, 1e-2, 1.0])


@functools.cache
def known():
    """The reference of a case whose values are known by brute force."""
    return reference_of(case_of(*AT))


@functools.cache
def found():
    """A sweep over that case."""
    with unittest.mock.patch("rubberfric.analysis.reference.reference", return_value=known()):
        options = {"settings": (MIDDLE, COARSE), "textbook": ((60, 24), (120, 48)), "repeats": 3}
        return rf.analysis.accuracy(*AT, **options)


@functools.cache
def value_error(setting):
    """Return errors of area, friction and separation against brute force."""
    here = np.array(three(rf.solve(*AT, quadrature=setting)))
    return np.abs(here / np.array([CASE[name] for name in QUANTITIES]) - 1)


@pytest.mark.slow
def test_errors_are_differences_from_brute_force():
    for row in found().rows[:2]:
        np.testing.assert_allclose(row.errors[:3], value_error(row.setting), rtol=1e-3, atol=3e-10)
    assert min(found().rows[1].errors[:3]) > 1e-7


@pytest.mark.slow
def test_rows_of_a_sweep():
    middle, coarse, single, rough, fine = found().rows
    methods = [(row.method, row.dtype) for row in found().rows]
    assert methods == [*2 * [("panels", "float64")], ("panels", "float32"), *2 * [("textbook", "float64")]]
    assert middle.setting == single.setting == MIDDLE and coarse.setting == COARSE
    assert middle.errors.value < 5e-8 < single.errors.value < 1e-5 < coarse.errors.value
    assert middle.errors.gradient < 1e-3 * coarse.errors.gradient
    assert single.errors.gradient < 1e-4
    assert 0 < fine.errors.value < 0.7 * rough.errors.value
    assert fine.errors.gradient is None and fine.gradient is None
    for row in found().rows:
        assert row.forward > 0
        if row.method == "panels":
            assert row.gradient > 0 and row.compile_gradient > 0 and row.compile_forward > 0
    assert (middle.nodes, rough.nodes) == (node_count(AT[0], MIDDLE), 60 * 24)
    assert found().agreement.worst < 1e-11


def test_single_precision_is_tried_until_it_is_lost_in_rounding():
    assert sweep.in_float32("abcdefg", [1e-1, 1, 1e-3, 1, 1e-7, 1, 1e-9]) == ["a", "c", "e"]
    assert sweep.in_float32("abc", [1e-1, 1e-8, 1e-3]) == ["a", "c"]


@pytest.mark.slow
def test_gradient_errors_are_those_of_all_sensitivities():
    """The definition, written out with a plain Jacobian."""

    def values(scene, conditions):
        return jnp.stack(three(rf.solve(scene, *conditions, quadrature=COARSE)))

    at, exact = case_of(*AT)[:2], known().exact.sensitivities[:, 0]
    jacobian = jax.jit(jax.jacrev(values, (0, 1)))(*at)
    leaves = zip(jax.tree.leaves(jacobian), jax.tree.leaves(at), strict=True)
    coarse = np.concatenate([np.reshape(d * x, (3, -1)) for d, x in leaves], 1)
    expected = np.max(np.abs(coarse - exact), 1) / np.max(np.abs(exact), 1)
    np.testing.assert_allclose(found().rows[1].errors[3:], expected, rtol=1e-3)


def test_errors_of_samples():
    """Check the maximum over points, vanishing quantities and non-finite values."""
    points = case_of(SCENE, VELOCITY, 1e5)
    values = np.array([[0.5, 0.2, 0.1], [0.0, 1.0, 1.0], [1e-4, 1e-5, 1e-300]])
    slopes = np.ones((3, points.differentiated.size, 4))
    exact = Outcome(values, slopes)
    assert compare_outcomes(exact, exact, points) == Errors(0, 0, 0, 0, 0, 0)
    off = values.copy()
    off[0, 1] *= 1.25
    off[2, 2] = 0.0  # 1e-300 m counts as zero
    steeper = slopes.copy()
    steeper[1, 2, 3] = 1.5
    errors = compare_outcomes(Outcome(off, steeper), exact, points)
    np.testing.assert_allclose(errors, [0.25, 0, 0, 0, 0.5, 0], atol=1e-12, rtol=1e-5)
    assert compare_outcomes(Outcome(off), exact, points).gradient is None
    off[1, 0] = 1e-30  # not zero where zero is exact
    assert compare_outcomes(Outcome(off), exact, points).friction == np.inf
    off[0, 0] = np.nan
    assert compare_outcomes(Outcome(off), exact, points).area == np.inf


def test_single_precision_is_compared_at_its_own_inputs():
    points = case_of(SCENE, VELOCITY, 1.1e5, 283.15)
    near = rounded(points)
    assert near.conditions[0].dtype == near.scene.upper.spectrum.q1.dtype == "float64"
    assert float(near.conditions[2][0]) == float(np.float32(283.15)) != 283.15
    (single, conditions), _ = arguments(points, jnp.float32)
    assert single.lower.material.E.dtype == conditions[0].dtype == "float32"
    np.testing.assert_array_equal(np.asarray(conditions[1], float), near.conditions[1])


@pytest.fixture
def compared(monkeypatch):
    """Record the reference and precision of every row of a sweep, without compilation."""
    seen = []

    def panels(_, exact, setting, dtype):
        seen.append((exact, dtype))
        return Row("panels", setting, str(dtype), 1, Errors(*[0.1] * 6)), {"forward": list, "gradient": list}

    monkeypatch.setattr(sweep, "_panels", panels)
    nothing = Reference("compiled", "exact", Errors(*[0.0] * 6))
    monkeypatch.setattr("rubberfric.analysis.reference.reference", lambda *_: nothing)
    monkeypatch.setattr("rubberfric.analysis.reference.outcome", lambda *arguments: arguments)
    return seen


def test_single_precision_is_compared_with_the_reference_at_rounded_inputs(compared):
    rf.analysis.accuracy(SCENE, VELOCITY, 1.1e5, 283.15, settings=(COARSE,), textbook=(), repeats=1)
    assert compared[0] == ("exact", jnp.float64)
    (function, points), dtype = compared[1]
    assert (function, dtype) == ("compiled", jnp.float32)
    assert float(points.conditions[2][0]) == float(np.float32(283.15))


def test_single_precision_is_left_out_where_it_cannot_hold_the_scene(compared):
    fine = rf.TabulatedSpectrum([1e8, 1e9], [1e-36, 1e-40])
    result = rf.analysis.accuracy(
        rf.Scene(rf.Body(TREAD), rf.Body(rf.Rigid(), fine)),
        1.0,
        1e5,
        settings=(COARSE,),
        textbook=(),
        repeats=1,
    )
    assert [dtype for _, dtype in compared] == [jnp.float64]
    assert "float32 is left out: upper.spectrum.C has values below" in result.report()


@pytest.mark.slow
def test_errors_fall_along_the_ladder():
    settings = SETTINGS
    nodes = [node_count(SCENE, setting) for setting in settings]
    assert len(settings) >= 8 and np.all(np.diff(nodes) > 0)
    assert nodes[0] < 50 and nodes[-1] > node_count(SCENE, rf.Quadrature())
    first, middle, last = (np.max(value_error(settings[i])) for i in (0, 3, 5))
    assert first > 1e-4 and middle < 1e-2 * first and last < 1e-2 * middle


@pytest.mark.slow
def test_the_setting_of_calls_without_one_has_its_row_and_its_line():
    """Settings are sorted by increasing work."""
    automatic = rf.analysis.default_quadrature(SCENE, 1e5)
    settings = with_automatic(SCENE, automatic)
    assert automatic not in SETTINGS and set(settings) == {*SETTINGS, automatic}
    assert np.all(np.diff([node_count(SCENE, setting) for setting in settings]) >= 0)
    assert with_automatic(SCENE, SETTINGS[2]) == SETTINGS
    assert found().automatic == rf.analysis.default_quadrature(*AT[::2])
    row = Row("panels", automatic, "float64", 100, Errors(*3 * [1e-8], *3 * [1e-7]), 1e-3, 2e-3, 1.0, 2.0)
    result = Accuracy(1e-9, (row,), Errors(*6 * [1e-12]), 1, 1, automatic=automatic)
    _, said = result.report().split("without a quadrature: ")
    assert said.endswith("  1 ms, with the gradient 2 ms, errors 1e-08 and 1e-07 or less")


@pytest.mark.slow
def test_quadrature_for_is_the_cheapest_that_meets_the_error(monkeypatch):
    """The cheapest setting with which the values are as near to brute force as wanted."""
    monkeypatch.setattr("rubberfric.analysis.reference.reference", lambda *_: known())
    settings = SETTINGS
    chosen = settings.index(rf.analysis.quadrature_for(AT[0], 1e-5, *AT[1:], gradients=False))
    assert np.max(value_error(settings[chosen])) <= 1e-5 < np.max(value_error(settings[chosen - 1]))


def test_for_error_with_and_without_gradients(monkeypatch):
    """Values and gradients must meet it, or the values alone; by default where the docstring says."""
    errors = {COARSE: Errors(*3 * [1e-8], *3 * [1e-3]), MIDDLE: Errors(*6 * [1e-9])}
    seen = []

    def measured(points, setting, gradients):
        seen.append(points.conditions)
        return Errors(*errors[setting][: None if gradients else 3]), None

    monkeypatch.setattr("rubberfric.analysis.reference.SETTINGS", (COARSE, MIDDLE))
    monkeypatch.setattr("rubberfric.analysis.reference.measured", measured)
    monkeypatch.setattr("rubberfric.analysis.reference.compare_outcomes", lambda found, *_: found)
    nothing = Reference(None, None, Errors(*6 * [1e-12]))
    monkeypatch.setattr("rubberfric.analysis.reference.reference", lambda *_: nothing)
    assert rf.analysis.quadrature_for(SCENE, 1e-6) == MIDDLE
    assert rf.analysis.quadrature_for(SCENE, 1e-6, gradients=False) == COARSE
    velocity, pressure = seen[0]
    assert velocity.shape == pressure.shape == (55,)
    limits = [velocity.min(), velocity.max(), pressure.min(), pressure.max()]
    np.testing.assert_allclose(limits, [1e-8, 1e2, 1e3, 1e7], rtol=1e-12)
    message = "error = 1e-10: none of 2 settings meets it on this scene; the smallest error is 1.0e-09"
    with pytest.raises(ValueError, match=message):
        rf.analysis.quadrature_for(SCENE, 1e-10)


@pytest.mark.slow
def test_no_reference_if_its_refinements_disagree(monkeypatch):
    """Nothing is claimed below their difference."""
    at = rf.load_scene(DATA / "tabulated_tread.toml"), 1e-3, 1.5e5, 278.15
    exact = reference_of(case_of(*at), gradients=False)
    assert exact.agreement.worst < 1e-14
    exact = exact._replace(agreement=exact.agreement._replace(area=1e-7, friction=1e-7, separation=1e-7))
    row = Row("panels", COARSE, "float64", 100, Errors(*[1e-11] * 6), 1e-3, 1e-2, 1.0, 2.0)
    result = Accuracy(1e-9, (row,), Errors(*exact.agreement[:3], *exact.agreement[:3]), 1, 1)
    assert result.chosen is None and result.chosen_values is None
    assert result.report().count("to 1e-09: no reference, because its refinements agree to") == 2
    assert result.report().count("<") == 6  # none of these errors is known
    monkeypatch.setattr("rubberfric.analysis.reference.reference", lambda *_: exact)
    with pytest.raises(ValueError, match=r"error = 1e-09: the reference cannot resolve it on this scene"):
        rf.analysis.quadrature_for(at[0], 1e-9, *at[1:], gradients=False)


def test_times_are_medians_over_alternating_rounds():
    calls = []
    functions = {name: functools.partial(calls.append, name) for name in "ab"}
    times = sweep.in_turns(functions, 3)
    assert "".join(calls) == "ab" + 3 * "aabb"
    assert all(0 <= t < 1e-3 for t in times.values())


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"error": -1e-6}, "error = -1e-06: must be a number, >= 1e-15 and < 1"),
        ({"settings": ()}, "settings is empty"),
        ({"settings": (12,)}, "settings has 12: every setting must be a Quadrature"),
        ({"textbook": ((200, 1),)}, r"textbook has \(200, 1\): every size must be a pair of integers >= 2"),
        ({"repeats": 0}, "repeats = 0: must be an integer >= 1"),
        ({"scene": 3}, "scene is a int: must be a Scene"),
        ({"velocity": []}, "velocity, pressure and temperature have no points"),
        ({"velocity": [1.0, 2.0], "pressure": [1e5, 1e5, 1e5]}, "must broadcast"),
    ],
)
def test_bad_arguments(changed, message):
    given = {"scene": SCENE, "velocity": VELOCITY, "pressure": 1e5} | changed
    with pytest.raises(ValueError, match=message):
        rf.analysis.accuracy(given.pop("scene"), **given)


def test_double_precision_is_needed():
    with jax.enable_x64(False):
        at = rf.Scene(rf.Body(rf.Elastic(1e6, 0.5)), rf.Body(rf.Rigid()))
        for call in (
            lambda: rf.analysis.accuracy(at, 1.0, 1e5),
            lambda: rf.analysis.quadrature_for(at, 1e-6),
        ):
            with pytest.raises(
                ValueError, match=r'write jax\.config\.update\("jax_enable_x64", True\) first$'
            ):
                call()
