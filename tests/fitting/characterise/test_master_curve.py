"""Master curves of synthetic isotherms: known shifts and laws within their bars, raw data as they come."""

import dataclasses

import numpy as np
import pytest
from support.cases.isotherms import CURVES, LAW, T, fractional_zener, isotherms, part, pulls

import rubberfric as rf
from fitting import FrictionData, MasterCurve, ModulusData, fit_master_curve, fit_prony, read
from fitting.characterise.sweep_shifts import invert_blocks, solve_blocks


def test_blocks_give_the_solution_of_the_whole_system():
    """5 unknowns of each modulus and 3 common ones, against one dense system of 13 equations."""
    rng, own = np.random.default_rng(0), [np.r_[0:5, 10:13], np.r_[5:10, 10:13]]
    H, right, whole, b = np.zeros((2, 8, 8)), rng.standard_normal((2, 8)), np.zeros((13, 13)), np.zeros(13)
    for k, at in enumerate(own):
        root = rng.standard_normal((9, 8))
        H[k] = root.T @ root
        whole[np.ix_(at, at)] += H[k]
        b[at] += right[k]
    c, C, inverse = solve_blocks(H, right, 5), invert_blocks(H, 5), np.linalg.inv(whole)
    for k, at in enumerate(own):
        np.testing.assert_allclose(c[k], (inverse @ b)[at], rtol=1e-10)
        np.testing.assert_allclose(C[k], inverse[np.ix_(at, at)], rtol=1e-10)


@pytest.fixture(scope="module")
def found():
    return fit_master_curve(isotherms())


def test_shifts_and_law_without_noise():
    exact = fit_master_curve(isotherms(noise=0.0))
    np.testing.assert_allclose(exact.log_aT, LAW.log_factor(T), atol=5e-3)
    np.testing.assert_allclose(exact.wlf.values, [8.0, 110.0], rtol=5e-3)
    assert exact.T_ref == 293.15 and exact.log_aT[5] == exact.stderr[5] == 0.0


def test_data_frames(found):
    curve = found.to_dataframe()
    np.testing.assert_array_equal(curve["E_stor [Pa]"], found.data.storage)
    data = read(curve)
    np.testing.assert_array_equal(data.loss, found.data.loss)
    assert set(curve["T_sweep [K]"]) == set(T) and curve.attrs["T_ref"] == 293.15
    shifts = rf.io.read_table(found.to_dataframe("shifts"), ["T", "aT"], ["bT"])
    np.testing.assert_array_equal(shifts["T"], T)
    np.testing.assert_allclose(shifts["aT"], np.exp(found.log_aT), rtol=1e-15)
    with pytest.raises(ValueError, match=r"^part = 'aT': must be 'curve' or 'shifts'$"):
        found.to_dataframe("aT")
    pytest.importorskip("xarray")
    assert found.to_xarray("shifts").aT.sel(T=293.15) == 1.0
    assert found.to_xarray().E_stor.dims == ("omega",)


def test_shifts_and_law_within_their_bars(found):
    assert isinstance(found, MasterCurve) and found.law is found.wlf and found.wlf.holds
    shifts, parameters = pulls(found)
    assert np.abs(shifts).max() < 3.5 and np.abs(parameters).max() < 3
    assert found.scatter == pytest.approx((0.03, 0.03), rel=0.2)
    assert isinstance(found.shift, rf.WLF) and float(found.shift.T_ref) == 293.15
    assert found.arrhenius is not None and found.arrhenius.aic > found.wlf.aic + 100


def with_errors_of_sweeps(curve, seed):
    """Every sweep has its own error of temperature, and its own offsets of E' and E''."""
    rng = np.random.default_rng(seed)
    wrong, offset = 0.5 * rng.standard_normal(T.size), 0.01 * rng.standard_normal((2, T.size))
    data = isotherms(curve, noise=0.0)
    sweep = np.searchsorted(T, data.temperature)
    modulus = CURVES[curve](data.omega * np.exp(np.asarray(LAW.log_factor(data.temperature + wrong[sweep]))))
    noise = 0.02 * rng.standard_normal((2, data.omega.size))
    storage, loss = np.exp(noise + offset[:, sweep]) * [modulus.real, modulus.imag]
    return dataclasses.replace(data, storage=storage, loss=loss)


@pytest.mark.slow
@pytest.mark.parametrize("curve", CURVES)
def test_coverage_over_40_seeds(curve):
    """With the errors between sweeps that the default error bars are for."""
    both = [pulls(fit_master_curve(with_errors_of_sweeps(curve, seed))) for seed in range(40)]
    shifts, parameters = (np.concatenate([one[k] for one in both]) for k in (0, 1))
    within = [np.mean(np.abs(x) < 1.96) for x in (shifts, parameters)]
    print(f"{curve}: shifts {within[0]:.1%}, C1 and C2 {within[1]:.1%} within 95 % error bars")
    assert 0.90 <= within[0] <= 0.985 and 0.90 <= within[1] <= 1.0


@pytest.mark.slow
@pytest.mark.parametrize("curve", CURVES)
def test_coverage_with_temperatures_that_are_not_exact(curve):
    """Errors of 0.5 K with temperature_error=0: C1 and C2 are covered, and the report names the errors.

    95 % intervals over 24 seeds. The binomial standard error of the share is 3 %.
    """
    curves = [fit_master_curve(with_errors_of_sweeps(curve, k), temperature_error=0.0) for k in range(24)]
    inside = np.mean([np.abs(pulls(one)[1]) < 1.96 for one in curves])
    reports = [one.report() for one in curves]
    named = [float(one.split("errors of ")[1].split(" K")[0]) for one in reports if "would hold if" in one]
    print(f"{curve}: {inside:.1%} of C1 and C2 inside 95 % error bars; errors named: {named} K")
    assert inside >= 0.88 and len(named) >= 12
    assert 0.25 < np.median(named) < 1.0


def test_arrhenius_is_told_from_wlf():
    law = rf.Arrhenius(0.9, 293.15)
    found = fit_master_curve(isotherms(law=law, temperatures=np.arange(263.15, 344.0, 10.0)))
    assert found.law is found.arrhenius and isinstance(found.shift, rf.Arrhenius)
    shifts, parameters = pulls(found, law)
    assert np.abs(shifts).max() < 3.5 and np.abs(parameters).max() < 3


def test_shifts_of_no_law_become_a_table():
    class Kinked:
        def log_factor(self, temperature):
            return np.where(temperature < 283.0, 2.0, 0.0) - 0.25 * (temperature - 293.15)

    found = fit_master_curve(isotherms(law=Kinked(), noise=0.01, temperatures=T[2:]))
    assert not found.law.holds and isinstance(found.shift, rf.TabulatedShift)
    np.testing.assert_allclose(found.table.aT, np.exp(found.log_aT))
    assert "no law holds within the errors: shift is the table" in found.report()


@pytest.mark.slow
def test_order_files_and_drift_do_not_matter(found):
    """Rows in any order, in two files, at temperatures that scatter by some tenths of a kelvin."""
    data, rng = dataclasses.replace(isotherms(), body="upper"), np.random.default_rng(1)
    rows = rng.permutation(data.omega.size)
    two = fit_master_curve([part(data, rows[:70]), part(data, rows[70:])])
    assert (two.data.body, found.data.body) == ("upper", None)
    np.testing.assert_allclose(two.log_aT, found.log_aT, atol=1e-5)
    np.testing.assert_allclose(two.data.omega, found.data.omega, rtol=1e-5)
    at = T.repeat(16) + rng.uniform(-0.4, 0.4, T.size * 16)
    omega = np.tile(data.omega[:16], T.size)
    modulus = fractional_zener(omega * np.exp(np.asarray(LAW.log_factor(at))))
    moved = fit_master_curve(ModulusData(omega, modulus.real, modulus.imag, temperature=at))
    np.testing.assert_allclose(moved.log_aT, LAW.log_factor(moved.T) - LAW.log_factor(moved.T_ref), atol=0.03)
    assert max(moved.scatter) < 0.005


def test_vertical_shifts():
    sweeps = isotherms(noise=0.01, factor=lambda T: np.exp(0.002 * (T - 293.15)))
    found = fit_master_curve(sweeps, vertical=True)
    pull = (found.log_bT - 0.002 * (T - 293.15)) / np.maximum(found.stderr_bT, 1e-12)
    assert np.abs(pull).max() < 3.5 and found.log_bT[5] == 0.0 and found.stderr_bT[5] == 0.0
    assert np.abs(pulls(found)[0]).max() < 3.5 and "b_T" in found.report()
    assert not np.any(fit_master_curve(isotherms(noise=0.01)).log_bT)


def test_reference_temperature():
    found = fit_master_curve(isotherms(noise=0.01), 318.0)
    assert found.T_ref == 318.15 and found.log_aT[7] == 0.0
    np.testing.assert_allclose(found.log_aT, LAW.log_factor(T) - LAW.log_factor(318.15), atol=0.2)


@pytest.mark.slow
def test_given_errors_make_the_bars(found):
    given = fit_master_curve(isotherms(relative=0.03))
    np.testing.assert_allclose(given.stderr, found.stderr, rtol=0.25)
    assert given.redchi == pytest.approx(1.0, abs=0.3)
    np.testing.assert_allclose(given.data.sigma_storage, 0.03 * given.data.storage)
    narrow, wide = (fit_master_curve(isotherms(relative=one), temperature_error=0.0) for one in (0.03, 0.3))
    moved = np.arange(T.size) != wide.reference
    assert np.all(wide.stderr[moved] > 3 * narrow.stderr[moved]) and wide.redchi < 0.05


@pytest.mark.slow
def test_errors_of_the_temperatures_add_to_the_error_bars():
    """They add the slope of ln a_T times the error of a temperature, and of the reference temperature."""
    exact, wrong = (fit_master_curve(isotherms(), temperature_error=one) for one in (0.0, 2.0))
    slope = np.gradient(exact.log_aT, T)
    added = 2.0 * np.hypot(slope, slope[exact.reference])
    moved = np.arange(T.size) != exact.reference
    np.testing.assert_allclose(wrong.stderr[moved], np.hypot(exact.stderr, added)[moved], rtol=1e-6)


def test_curve_goes_on_to_a_series(found):
    assert isinstance(found.data, ModulusData) and (np.diff(found.data.omega) >= 0).all()
    series = fit_prony(found.data, shift=found.shift)
    true = fractional_zener(found.data.omega)
    fitted = np.asarray(rf.complex_modulus(series.material, found.data.omega))
    assert np.sqrt(np.mean(np.log(fitted.real / true.real) ** 2)) < 0.05
    assert float(series.material.shift.C2) == found.wlf.values[1]


def test_report_and_picture(found):
    report = found.report().splitlines()
    assert report[0].startswith("Master curve of 9 sweeps at 293.15 K, ")
    assert report[8].split() == ["293.15", "0.0000", "(reference)"]
    C1, C2 = (f"{v:.4g} +/- {e:.2g}" for v, e in zip(found.wlf.values, found.wlf.stderr, strict=True))
    assert any(f"WLF: C1 = {C1}, C2 = {C2} K" in line and "the better" in line for line in report)
    assert repr(found) == "<MasterCurve: 9 sweeps, T_ref = 293.15 K, WLF>"
    upper, lower = found.plot()
    np.testing.assert_allclose(
        np.sort(np.concatenate([line.get_ydata() for line in upper.lines[::2]])), np.sort(found.data.storage)
    )
    assert {line.get_label() for line in lower.lines} >= {"WLF", "Arrhenius"}
    upper.figure.canvas.draw()


def test_a_sweep_that_does_not_superpose_is_named():
    """Glassy sweeps that scatter little, one of them 15 % too stiff."""
    data = isotherms(noise=0.002)
    factor = np.where(data.temperature == T[3], 1.15, 1.0)
    curve = fit_master_curve(dataclasses.replace(data, storage=factor * data.storage))
    named = [line for line in curve.report().splitlines() if "does not superpose" in line]
    assert len(named) == 1 and f"the sweep at {T[3]:g} K" in named[0] and "E' +1" in named[0]
    others = np.arange(T.size) != 3
    pull = (curve.log_aT - np.asarray(LAW.log_factor(T)))[others] / np.maximum(curve.stderr[others], 1e-9)
    assert np.abs(pull).max() < 4
    assert "does not superpose" not in fit_master_curve(data).report()


def test_neighbours_that_share_nothing_are_joined_with_large_errors():
    apart = np.array([253.15, 263.15, 318.15, 328.15])
    curve = fit_master_curve(isotherms(temperatures=apart, noise=0.005))
    error = curve.log_aT - (LAW.log_factor(curve.T) - LAW.log_factor(curve.T_ref))
    moved = np.arange(4) != curve.reference
    assert np.abs(error / np.maximum(curve.stderr, 1e-9))[moved].max() < 4
    # Two and two of the four overlap.
    near, far = sorted(np.sqrt(np.diag(np.diff(np.diff(curve.covariance, axis=0), axis=1))))[::2]
    assert far > 3 * near


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_shifts_of_glassy_sweeps_are_regular(seed):
    """The coldest of five sweeps that are 20 K apart hardly overlaps. No prior leaves it 2 decades off."""
    law = rf.WLF(12.0, 50.0, 253.15)
    data = isotherms(noise=0.02, seed=seed, law=law, temperatures=np.arange(233.15, 320.0, 20.0))
    curve = fit_master_curve(data, 293.15, temperature_error=0.0)
    true = np.asarray(law.log_factor(curve.T)) - float(law.log_factor(293.15))
    error = (curve.log_aT - true) / np.log(10)
    assert abs(error[0]) < 0.8 and np.abs(error[1:]).max() < 0.1
    assert abs(error[0]) < 3 * curve.stderr[0] / np.log(10)


def test_offsets_are_those_from_the_curve_and_its_hidden_shift(found):
    """Residuals that are made of an offset of each sweep and of a shift that the curve allows for."""
    count = found.T.size
    hidden, own = np.linspace(-0.2, 0.3, count), np.stack([np.arange(count), np.arange(count) ** 2])
    sweep = np.repeat(np.arange(count), found.shifts.t.size // count)
    shifts = found.shifts._replace(hidden=hidden)
    np.testing.assert_allclose(shifts.offsets((own + hidden)[:, sweep], sweep)[0], own, atol=1e-12)


def test_bad_points_are_named_and_lose_weight(found):
    data = isotherms()
    storage = np.array(data.storage)
    storage[40] *= 3
    curve = fit_master_curve(dataclasses.replace(data, storage=storage))
    kind, temperature, omega = curve.bad_points[0]
    assert (kind, temperature) == ("E'", data.temperature[40]) and omega == pytest.approx(data.omega[40])
    assert len(curve.bad_points) == 1 and "points with little or no weight: E' at" in curve.report()
    np.testing.assert_allclose(curve.log_aT, found.log_aT, atol=0.1)


def test_moduli_of_a_sweep_that_was_left_out():
    data = isotherms(noise=0.02, seed=3)
    out = data.temperature == T[4]
    curve = fit_master_curve(part(data, ~out))
    y, error = curve.moduli(data.omega[out], T[4])
    z = (np.log([data.storage[out], data.loss[out]]) - y) / error
    assert np.mean(np.abs(z) < 1.96) > 0.85 and 0.02 < error.max() < 0.5
    with pytest.raises(ValueError, match=r"temperature = 400 K: must be 243.15 ... 333.15 K"):
        curve.moduli(data.omega[out], 400.0)


def test_moduli_that_rise_with_temperature_are_noticed():
    """The moduli rise as in rubber elasticity. Entropic shifts describe this rise."""
    rising = isotherms(noise=0.005, factor=lambda T: T / 293.15)
    plain, entropic = fit_master_curve(rising), fit_master_curve(rising, vertical="entropic")
    assert (
        plain.shifts.scaled and not plain.log_bT.any() and "moduli change with temperature" in plain.report()
    )
    np.testing.assert_allclose(entropic.log_bT, rf.Entropic(6e-4).log_factor(T, 293.15))
    for curve in (plain, entropic):
        assert np.abs(pulls(curve)[0]).max() < 3.5
    assert entropic.data.storage[0] != plain.data.storage[0]


@pytest.mark.parametrize(
    ("data", "options", "said"),
    [
        (isotherms(temperatures=T[:1]), {}, "all rows are at 243.15 K within 1 K"),
        (isotherms(points=1), {}, "the sweep at 243.15 K has 1 points > 0: must have at least 2"),
        (isotherms(), {"reference": 298.0}, "reference = 298 K: must be the temperature of a sweep: 243.15"),
        (isotherms(), {"reference": "room"}, "reference = 'room': must be None or a temperature"),
        (isotherms(), {"vertical": 1}, 'vertical = 1: must be True, False or "entropic"'),
        (isotherms(), {"same": 0}, "same = 0: must be a number > 0"),
        (isotherms(), {"temperature_error": -1}, "temperature_error = -1: must be a number >= 0"),
        ([], {}, "isotherms is a list: must be ModulusData"),
        ([isotherms(), isotherms(relative=0.1)], {}, r"isotherms\[0\] has no errors, but other data sets"),
        ([FrictionData(1.0, 0.5, pressure=1e5)], {}, r"isotherms\[0\] is a FrictionData"),
        (ModulusData([1.0], [1e6], [1e5]), {}, r"isotherms\[0\], .*, has no temperature"),
    ],
)
def test_bad_input(data, options, said):
    with pytest.raises(ValueError, match=said) as caught:
        fit_master_curve(data, **options)
    assert "\n" not in str(caught.value)
