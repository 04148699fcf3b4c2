"""Error bars of parameters that are correlated with one at a bound, against refits by scipy."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import least_squares
from support.scenes.fits import E_INF, E

import fitting
import rubberfric as rf
from fitting import Bounded, ModulusData, Positive
from fitting.results.at_bounds import along_bounds
from fitting.uncertainty.intervals import SolvedProblem, quantile

OMEGA = np.geomspace(0.3, 30.0, 8)
TRUTH = {"E_inf": 1.5e6, "E": 6e6, "tau": 0.5}
ERROR = 0.04
# Lower bound of E_inf, above its true value.
LOW = 2e6
# Upper bound of E_inf, far above its true value.
HIGH = 2e7
NAMES = [E_INF, f"{E}[0]", "upper.material.tau[0]"]


def model(E_inf, E, tau, omega=OMEGA):
    """ln E' and ln E'' of one Maxwell element and a spring."""
    z = omega * tau
    return np.log(np.concatenate([E_inf + E * z**2 / (1 + z**2), E * z / (1 + z**2)]))


def measured(seed=1):
    noise = ERROR * np.random.default_rng(seed).standard_normal(2 * OMEGA.size)
    return model(**TRUTH) + noise


def data(y):
    storage, loss = np.exp(y).reshape(2, -1)
    return ModulusData(OMEGA, storage, loss, relative=ERROR, body="upper", check_units=False)


def scene(E_inf=4e6, E=6e6, tau=0.5):
    return rf.Scene(rf.Body(rf.Rigid()), rf.Body(rf.Prony(E_inf, [E], [tau])))


FREE = {NAMES[0]: Bounded(LOW, HIGH), NAMES[1]: Positive(), NAMES[2]: Positive()}


def refitted(y, k, value, bounds=(LOW, HIGH), omega=OMEGA, error=ERROR, shortest=1e-4):
    """Chi-square by scipy: parameter k held at a value, E_inf within its bounds, tau above `shortest`."""
    others = [i for i in range(3) if i != k]
    low, high = np.log([bounds[0], 1e3, shortest]), np.log([bounds[1], 1e11, 1e4])

    def rows(free):
        p = np.empty(3)
        p[k], p[others] = np.log(value), free
        return (model(*np.exp(p), omega) - y) / error

    start = np.log([3e6, 6e6, max(2 * shortest, 0.5)])
    start = np.clip(start[others], low[others] + 1e-6, high[others] - 1e-6)
    return 2 * least_squares(rows, start, bounds=(low[others], high[others]), xtol=1e-12, ftol=1e-12).cost


def ends_by_scipy(y, k, lowest, value, **setting):
    """Profile likelihood interval of parameter k by bisection."""
    ends = []
    for sign in (-1, 1):
        near, far = 0.0, 4.0
        for _ in range(30):
            middle = 0.5 * (near + far)
            inside = refitted(y, k, value * np.exp(sign * middle), **setting) - lowest < quantile(0.95) ** 2
            near, far = (middle, far) if inside else (near, middle)
        ends.append(value * np.exp(sign * near))
    return ends


@pytest.fixture(scope="module")
def at_bound():
    """E_inf ends at its lower bound, which is above the truth."""
    return fitting.fit(scene(), data(measured()), FREE)


def test_the_interval_is_that_of_refits(at_bound):
    """The fit is at the bound, where it should be. Its union of intervals equals the profile likelihood."""
    assert at_bound.success and at_bound.withheld[NAMES[0]] == "at its lower bound 2e+06"
    y = measured()
    best = least_squares(
        lambda p: (model(LOW, *np.exp(p)) - y) / ERROR, np.log([6e6, 0.5]), xtol=1e-12, ftol=1e-12
    )
    np.testing.assert_allclose(at_bound.chisqr, 2 * best.cost, rtol=1e-4)
    (found,) = at_bound.bounds
    assert found.name == NAMES[0] and found.complete and found.where.startswith("at its lower bound")
    # The rises along the bounded parameter.
    for value, rise in zip(found.held[1:], found.rises[1:], strict=True):
        assert rise == pytest.approx(refitted(y, 0, value) - at_bound.chisqr, abs=2e-3)
    for k, name in enumerate(NAMES[1:], 1):
        low, high = ends_by_scipy(y, k, at_bound.chisqr, at_bound[name].value)
        covered = found.intervals.get(name)
        if covered is None:  # the error bar covers the interval to a fifth of itself
            i = at_bound.names.index(name)
            covered = tuple(end[i] for end in at_bound.interval())
            half = 0.5 * np.log(covered[1] / covered[0])
            assert np.log(covered[0] / low) < 0.25 * half and np.log(high / covered[1]) < 0.25 * half
        else:
            # Half an interval is at most 5 % off, because rows are nonlinear in the logarithms.
            np.testing.assert_allclose(np.log(covered), np.log([low, high]), atol=0.05 * np.log(high / low))


VANISHES = FREE | {NAMES[0]: Positive()}


@pytest.fixture(scope="module")
def vanished():
    """E_inf is driven to zero: the data of a liquid have noise that wants E_inf < 0."""
    y = model(1.0, 6e6, 0.5) + ERROR * np.random.default_rng(4).standard_normal(2 * OMEGA.size)
    return y, fitting.fit(scene(E_inf=100.0), data(y), VANISHES)


def minimum_by_scipy(y, low):
    """ln E_inf, ln E and ln tau of the best fit with E_inf above `low`."""
    bounds = (np.log([low, 1e3, 1e-4]), np.log([HIGH, 1e11, 1e4]))
    start = np.log([1.3 * max(low, 1e5), 6e6, 0.5])
    tight = {"xtol": 1e-13, "ftol": 1e-13, "gtol": 1e-13}
    return least_squares(lambda p: (model(*np.exp(p)) - y) / ERROR, start, bounds=bounds, **tight).x


def test_the_interval_of_a_parameter_near_its_bound_is_also_symmetric_in_the_value():
    """A tenth of the fits missed the truth at the bound's end by intervals symmetric in x alone."""
    fit = fitting.fit(
        scene(), data(measured()), FREE | {NAMES[0]: Bounded(2e5, 1.1 * TRUTH["E_inf"], start=1e6)}
    )
    value, reach = fit[NAMES[0]].value, quantile(0.95) * fit[NAMES[0]].stderr
    low, high = (float(end[0]) for end in fit.interval())
    assert high == pytest.approx(min(value + reach, 1.1 * TRUTH["E_inf"]), rel=1e-9)
    assert low < value - reach and high > TRUTH["E_inf"]


# Bounds below the true value and far from the lower bound.
@pytest.mark.parametrize("bound", [1e6, 1.2e6])
def test_the_profile_of_a_parameter_at_its_upper_bound(bound):
    free = FREE | {NAMES[0]: Bounded(1e3, bound)}
    fit = fitting.fit(scene(E_inf=bound / 2), data(measured()), free, further_time=0.0)
    profile = fit.profile(NAMES[0])
    low, _ = ends_by_scipy(measured(), 0, fit.chisqr, bound, bounds=(1e3, 1.001 * bound))
    assert bound - profile.low == pytest.approx(bound - low, rel=2e-3)
    assert profile.high > 0.999 * bound and profile.warning == ""


def test_profiles_at_a_bound_are_those_of_refits(at_bound, vanished):
    """Every parameter: the other ones may leave the bound."""
    for y, fit, low in ((measured(), at_bound, LOW), (*vanished, 1e-3)):
        assert NAMES[0] in fit.withheld
        for k, name in enumerate(NAMES):
            profile = fit.profile(name)
            value = fit[name].value if k else max(low, 0.5 * profile.high)
            lowest, high = ends_by_scipy(y, k, fit.chisqr, value, bounds=(low, HIGH))
            assert profile.high == pytest.approx(high, rel=5e-3), name
            if k:
                assert profile.low == pytest.approx(lowest, rel=5e-3), name
            else:
                assert profile.low < 1.001 * low and profile.ends[0].startswith("open")
        assert fit.bounds[0].interval[1] == pytest.approx(fit.profile(NAMES[0]).high, rel=0.1)


def test_members_of_a_bootstrap_leave_the_bound(at_bound, vanished):
    """About half of them do. Each is the minimum of its drawn data."""
    count = 40
    for fit, low in ((at_bound, LOW), (vanished[1], 1e-3)):
        boot, (_, targets) = fit.bootstrap(count), fit.bootstrap_fits(count, None)
        assert boot.failed == 0
        exact = np.exp([minimum_by_scipy(y, low) for y in targets.measured])
        at_end = exact[:, 0] < 1.001 * max(low, 1.0)
        assert 0.2 < np.mean(at_end) < 0.8
        np.testing.assert_allclose(boot.values[~at_end], exact[~at_end], rtol=2e-3)
        np.testing.assert_allclose(boot.values[at_end, 1:], exact[at_end, 1:], rtol=2e-3)
        assert (boot.values[at_end, 0] < max(1.001 * low, 1e3)).all()


def test_the_report_says_where_the_search_of_an_interval_ended(vanished):
    """Three starts up to which chi-square hardly rises, as if larger values had not been tried."""
    fit = vanished[1]
    (bound,) = fit.bounds
    assert "the largest value tried" not in fit.report()
    low, high = bound.value, bound.held[-2]
    short = bound._replace(held=bound.held[:-1], rises=bound.rises[:-1], interval=(low, high))
    for changes, text in (({}, "the largest value tried"), ({"complete": False}, "as far as time allowed")):
        report = dataclasses.replace(fit, bounds=(short._replace(**changes),)).report()
        assert f"from {low:.4g} to {high:.4g}, {text}" in report


def test_numbers_that_leave_a_bound_stay_in_order():
    """qr is at its lower bound, and q1 is near. A thousandth of the range of qr would move it beyond q1."""
    road = rf.SelfAffine(1e2, 1e3, 2e4, 0.8, 1e-4)
    q = np.geomspace(1.2e2, 9e3, 12)
    C = np.asarray(rf.power_spectrum(road, q))
    start = rf.Scene(rf.Body(rf.Rigid(), road.replace(qr=3e3)), rf.Body(rf.Elastic(1e6, 0.5)))
    free = {"lower.spectrum.qr": Bounded(2e3, 3e6), "lower.spectrum.h_rms": Positive()}
    free |= {"lower.spectrum.q1": Bounded(1e3, 2e5)}
    prior = {"lower.spectrum.q1": fitting.Gaussian(4e3, 1e3)}
    fit = fitting.fit(start, fitting.SpectrumData(q, C, relative=1.0), free, prior=prior)
    starts, _ = fit.bootstrap_fits(2, None)
    spectrum = fit.problem.scene(starts[0]).lower.spectrum
    assert float(spectrum.q0) <= float(spectrum.qr) <= float(spectrum.q1)
    assert fit.bootstrap(8).failed == 0


def test_two_parameters_at_bounds_are_followed_side_by_side():
    """Each is held apart from the other, until chi-square has passed the threshold on each side."""
    shortest, names = 0.7, (NAMES[0], NAMES[2])
    free = FREE | {names[1]: Bounded(shortest, 50.0)}
    result = fitting.fit(scene(tau=1.0), data(measured()), free)
    assert tuple(path.name for path in result.bounds) == names
    for k, path in zip((0, 2), result.bounds, strict=True):
        assert path.complete and path.value == pytest.approx((LOW, shortest)[k // 2], rel=1e-3)
        rises = np.array(path.rises)
        expected = [refitted(measured(), k, value, shortest=shortest) - result.chisqr for value in path.held]
        np.testing.assert_allclose(rises, expected, rtol=1e-3, atol=5e-3)
        assert rises[-1] > quantile(0.95) ** 2 > rises[-2] >= 0


def test_a_lower_solution_along_a_bound_is_returned(at_bound):
    """The cost of the fit is overstated."""
    known, none = at_bound.uncertainty, np.zeros((0, 3))
    for excess, lower in ((50.0, True), (0.0, False)):
        solved = SolvedProblem(
            problem=at_bound.problem,
            x=at_bound.x,
            cost=at_bound.cost + excess,
            estimated=at_bound.estimated,
            error_scale=at_bound.error_scale,
            uncertainty=known,
        )
        bounds, _, x = along_bounds(solved, none, 60.0)
        assert (x is not None) == lower and len(bounds) == (not lower)


WIDE = FREE | {NAMES[0]: Bounded(1e3, 5e6)}
FAST = np.geomspace(20.0, 200.0, 8)


def open_data():
    """Only high frequencies, where E_inf and E are nearly the same, and E_inf has no lower limit."""
    y = model(**TRUTH, omega=FAST) + 0.05 * np.random.default_rng(3).standard_normal(16)
    return y, ModulusData(FAST, *np.exp(y).reshape(2, -1), relative=0.05, body="upper", check_units=False)


def test_error_bars_that_hold_at_the_bound_only_are_withheld(tmp_path):
    """E_inf is open between its bounds. The intervals of E and tau agree with refits by scipy."""
    y, measured_data = open_data()
    found = fitting.fit(scene(E_inf=1e5), measured_data, WIDE)
    assert found.success and all(name in found.withheld for name in NAMES)
    first = found.bounds[0]
    assert first.name == NAMES[0] and first.interval[1] > TRUTH["E_inf"]
    setting = {"bounds": (1e3, 5e6), "omega": FAST, "error": 0.05}
    for k, name in enumerate(NAMES[1:], 1):
        ends = ends_by_scipy(y, k, found.chisqr, found[name].value, **setting)
        assert ends[0] < list(TRUTH.values())[k] < ends[1]
        # Places between the held values are left out, and rows are not quite linear.
        np.testing.assert_allclose(
            np.log(first.intervals[name]), np.log(ends), atol=0.008 * np.log(ends[1] / ends[0])
        )
    text = found.report()
    assert "[[Bounds]]" in text and "95 % intervals by profile likelihood" in text
    assert np.isnan(found[NAMES[1]].stderr) and np.isnan(found.interval()[0]).all()
    found.save(tmp_path / "fit.h5")
    again = fitting.FitResult.load(tmp_path / "fit.h5")
    assert again.bounds == found.bounds and again.further == found.further and again.report() == text
    off = fitting.fit(scene(E_inf=1e5), measured_data, WIDE, further_time=0.0)
    assert off.bounds == () and off.further is None and "[[Bounds]]" not in off.report()


def test_another_minimum_of_the_same_cost_withholds_the_error_bar():
    """E'' at one frequency is the same for omega tau = 3 and 1/3."""
    one = ModulusData([1.0], [4e6], [0.3 * 6e6], [1e12], [3e4], body="upper", check_units=False)
    found = fitting.fit(scene(tau=1.5), one, {NAMES[2]: Positive()}, starts=8)
    value = found[NAMES[2]].value
    assert value == pytest.approx(3.0, rel=1e-3) or value == pytest.approx(1 / 3, rel=1e-3)
    assert "a minimum of chi-square" in found.withheld[NAMES[2]]
