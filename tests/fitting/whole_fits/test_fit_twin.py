"""The fit of the twin measurements: a known scene found again from its noisy friction curves.

The twin is 240 friction coefficients with 3 % noise; 20 numbers are free, all started far off.
"""

import numpy as np
import pytest
from support.ensembles.twin import DATA, FREE, GUESS, TRUTH, conditions, make_twin, true_values, twin

import fitting
import rubberfric as rf
from fitting.parameters.variables import element_names, to_values
from fitting.solvers.levenberg_marquardt import LevenbergMarquardt
from fitting.solvers.objective import CONVERGED, PERFECT
from fitting.solvers.problem import make_problem
from fitting.solvers.runs import run_fits
from fitting.solvers.search import search
from fitting.uncertainty.covariance import uncertainty

UNSEEN = 0.5e6  # a pressure between the two measured ones [Pa]
# Result of this fit in 11 steps. All values are within 1.1e-5 of the minimum that tolerance=1e-15 finds.
FOUND = [
    *(9.9213538318180e08, 1.4628384348102e08, 3.0583798887253e07, 1.0951944927852e07, 3.6759090483773e06),
    *(2.6125254531510e06, 1.6344129722662e06, 1.3710270376622e06, 7.5357013449488e05, 7.4377608423309e05),
    *(6.6964445445708e05, 1.1663422447516e01, 1.4666280411227e02, 8.0437652608826e-01, 5.2493242091936e-04),
    *(2.5309824075260e04, 6.3361122872635e06, 9.8038145621774e-02, 6.2900026407531e-03, 9.7293505431496e-01),
]


@pytest.fixture(scope="module")
def result():
    return fitting.fit(GUESS, fitting.read(DATA / "twin_friction.csv"), FREE)


def test_the_file_is_what_its_script_makes():
    stored, made = fitting.read(DATA / "twin_friction.csv"), twin()
    np.testing.assert_allclose(stored.measured, made.measured, rtol=1e-9)
    # The last digit of NumPy's powers differs between processors.
    np.testing.assert_allclose(stored.velocity, made.velocity, rtol=1e-15)
    np.testing.assert_array_equal(stored.error, make_twin.NOISE)
    assert len(stored) == 240


@pytest.mark.slow  # the values and steps of every kind of fit are tested in test_every_fit
def test_numbers_and_steps_stay(result):
    """With the former nodes; the default nodes, with errors of 1e-9, give nearly the same."""
    then = rf.Quadrature(order=13, panels=12, graded=8, ratio=4.5, angular_order=13)
    same = fitting.fit(GUESS, fitting.read(DATA / "twin_friction.csv"), FREE, quadrature=then)
    np.testing.assert_allclose(same.values, FOUND, rtol=1e-10)
    assert same.cost == pytest.approx(115.11942747855731, rel=1e-12)
    assert (same.nfev, same.njev) == (result.nfev, result.njev) == (22, 11)
    assert result.problem.structure.quadrature.panels < then.panels
    np.testing.assert_allclose(result.values, FOUND, rtol=1e-9)


def test_all_parameters_are_recovered_within_their_error_bars(result):
    assert result.success and not result.withheld and not result.unidentified
    assert 0.9 < result.redchi < 1.1
    truth = true_values(result.names)
    low, high = result.interval(0.95)
    outside = [name for name, t, a, b in zip(result.names, truth, low, high, strict=True) if not a < t < b]
    assert not outside
    # Error bars that are too wide would pass the above: two thirds of them should be exceeded rarely.
    assert np.sum(np.abs(result.values - truth) > result.stderr) >= 1
    assert np.all(result.stderr < 0.6 * result.values)


def test_an_unseen_pressure_is_predicted_within_one_percent(result):
    errors = []
    for T in np.unique(conditions()[2]):
        v = np.unique(conditions()[0])
        errors.append(np.log(result.predict(v, UNSEEN, T) / rf.friction(TRUTH, v, UNSEEN, T)))
    errors = np.array(errors)
    rms, worst = np.sqrt(np.mean(errors**2)), np.max(np.abs(errors))
    print(f"\nunseen pressure: {100 * rms:.2f} % rms, at most {100 * worst:.1f} %")
    assert rms < 0.01
    # The worst of 120 points, at the cold end, is what 3 % noise on 240 points leaves.
    assert worst < 0.04


def test_its_band_holds_the_truth(result):
    v = np.logspace(-6, 1, 15)
    band = result.band(v, UNSEEN, 293.15)
    truth = np.asarray(rf.friction(TRUTH, v, UNSEEN, 293.15))
    assert np.mean((band.low < truth) & (truth < band.high)) > 0.8
    assert np.all(band.high / band.low < 1.1)


def test_data_without_noise_are_met_to_rounding():
    velocity, pressure, temperature = conditions()
    clean = rf.friction(TRUTH, velocity, pressure, temperature)
    data = fitting.FrictionData(velocity, clean, pressure=pressure, temperature=temperature, relative=0.03)
    result = fitting.fit(GUESS, data, FREE)
    assert result.success and result.cost < 1e-18
    np.testing.assert_allclose(result.values, true_values(result.names), rtol=1e-7)


@pytest.mark.slow
def test_coverage_of_the_intervals():
    velocity, pressure, temperature = conditions()
    seeds = 1000
    log_truth = np.log(np.asarray(rf.friction(TRUTH, velocity, pressure, temperature)))
    noise = np.stack([np.random.default_rng(s).standard_normal(velocity.size) for s in range(seeds)])
    problem = make_problem(TRUTH, [twin()], FREE)
    targets = problem.targets.of_several(measured=log_truth + make_twin.NOISE * noise)
    starts = np.tile(problem.start, (seeds, 1))
    runs = run_fits(LevenbergMarquardt(), problem, starts, targets)
    inside, chisqr = [], []
    for x, measured in zip(runs.x, targets.measured, strict=True):
        one = problem._replace(targets=problem.targets._replace(measured=measured))
        known = uncertainty(one, x)
        z = np.abs(x - problem.start) / known.deviation
        inside.append(np.where(np.isnan(z), np.nan, z < 1.959964))
        chisqr.append(known.chisqr / (velocity.size - known.parameters))
    inside = np.array(inside)
    first, all_of_them = np.nanmean(inside[:200], 0), np.nanmean(inside, 0)
    print(f"\nconverged {np.isin(runs.status, (CONVERGED, PERFECT)).sum()} of {seeds}, ", end="")
    print(f"withheld {np.isnan(inside).sum()} of {inside.size}, redchi {np.mean(chisqr):.3f}")
    names = element_names(problem.structure.variables)
    for name, a, b in zip(names, first, all_of_them, strict=True):
        print(f"  {name:28s} {100 * a:5.1f} % of 200, {100 * b:5.1f} % of {seeds}")
    print(f"  all of them                  {100 * first.mean():5.1f} %, {100 * all_of_them.mean():5.1f} %")
    # 1.4 % is two standard errors of a coverage over a thousand seeds.
    assert np.all((all_of_them > 0.92) & (all_of_them < 0.98))


@pytest.mark.slow
def test_starts_far_off_reach_the_same_minimum():
    problem = make_problem(TRUTH, [twin()], FREE)
    rng = np.random.default_rng(0)
    starts = np.tile(problem.start, (100, 1))
    starts[:, :11] += np.log(10.0) * rng.choice([-1.0, 1.0], (100, 11))
    hurst = np.clip(0.8 + 0.3 * rng.choice([-1.0, 1.0], 100), None, 0.99)
    starts[:, 13] = np.log((hurst - 0.3) / (1.0 - hurst))
    values = np.asarray(to_values(problem.structure.variables, problem.numbers.constants, starts[0]))
    assert values[13] == pytest.approx(hurst[0]) and values[0] / 9.5e8 in (
        pytest.approx(10.0),
        pytest.approx(0.1),
    )
    runs = search(LevenbergMarquardt(), problem, starts)
    reached = runs.cost < runs.cost.min() * (1 + 1e-6)
    print(f"\n{reached.sum()} of 100 reach cost {runs.cost.min():.6f} in {np.median(runs.njev):.0f} steps")
    assert np.all(np.isfinite(runs.cost)) and reached.mean() >= 0.95


@pytest.mark.slow
def test_a_fit_that_leaves_the_limits_of_its_quadrature_goes_on_with_a_finer_one():
    """Roughness to 10 nm, from a guess that ends at 50 um: as with nodes enough from the beginning."""
    rubber = rf.Prony(2e6, [2e7, 1e8], [1e-6, 1e-3])

    def scene(q1, h_rms):
        road = rf.SelfAffine(100.0, 1000.0, q1, 0.8, h_rms)
        return rf.Scene(rf.Body(rf.Rigid(), road), rf.Body(rubber))

    v, told = np.logspace(-6, 1, 15), []
    truth = scene(1e8, 1e-4)
    data = fitting.FrictionData(v, rf.friction(truth, v, 1e5), pressure=1e5, relative=0.01)
    free = {"lower.spectrum.q1": fitting.Positive(), "lower.spectrum.h_rms": fitting.Positive()}
    result = fitting.fit(scene(2e4, 2e-4), data, free, progress=told.append)
    ended, lowest = result.problem.structure.quadrature, np.min(data.pressure)
    assert ended.panels >= rf.analysis.default_quadrature(truth, lowest, margin=-1.0, separation=False).panels
    start = rf.analysis.default_quadrature(scene(2e4, 2e-4), lowest, margin=0.5, separation=False)
    assert start.panels < ended.panels and sum("needs" in one for one in told) == 1
    np.testing.assert_allclose(result.values, [1e8, 1e-4], rtol=1e-6)
    given = fitting.fit(scene(2e4, 2e-4), data, free, quadrature=start)
    assert given.problem.structure.quadrature == start
