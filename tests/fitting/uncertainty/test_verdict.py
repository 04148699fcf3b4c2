"""The verdict if a scene explains its data, on known residuals and on fits."""

import dataclasses
import re

import numpy as np
import pytest
import scipy.stats
from support.scenes.fits import FAST

import fitting
import rubberfric as rf
from fitting.uncertainty.verdict import verdict

V = np.geomspace(1e-3, 1.0, 40)
DATA = fitting.FrictionData(V, np.ones(40), pressure=3e5, relative=0.02, name="R20")
COLUMNS = np.polynomial.legendre.legvander(np.linspace(-1, 1, 40), 3)


def fitted(rows, columns=COLUMNS):
    """Residuals left after a linear fit."""
    return rows - columns @ np.linalg.lstsq(columns, rows, rcond=None)[0]


def judged(rows, estimated=None, loss="linear", data=DATA, parameters=4.0):
    return verdict([data], [rows], parameters, [estimated], loss)


def noise(seed, size=40):
    return np.random.default_rng(seed).standard_normal(size)


def scaled(rows):
    """Residuals with errors estimated from the scatter: mean square one by the degrees of freedom."""
    return rows * np.sqrt((rows.size - 4) / np.sum(rows**2))


@pytest.mark.parametrize(
    ("estimated", "loss"), [(None, "linear"), (0.02, "linear"), (None, "huber"), (0.02, "huber")]
)
def test_few_are_wrongly_accused(estimated, loss):
    """Three checks at one in a thousand each: of 3000 data sets as they should be some 9 at the most."""
    rows = [fitted(noise(i)) for i in range(3000)]
    rows = rows if estimated is None else [scaled(r) for r in rows]
    accused = sum(judged(r, estimated, loss).explains is False for r in rows)
    assert accused <= (9 if loss == "linear" else 18)  # the median's law is one of large numbers


def test_what_it_says_of_good_data():
    rows = fitted(noise(1))
    found = judged(rows)
    assert found.explains is True
    assert not found.reasons
    assert found.text == f"explains the data: chi-square {np.sum(rows**2):.4g} for 36 degrees of freedom"
    found = judged(scaled(rows), 0.03)
    assert found.explains is None
    assert found.text.startswith("nothing contradicts it; but the data have no errors")
    assert judged(0.3 * rows).text.endswith("once in 1000: the given errors are too large")
    assert judged(rows[:4], data=fitting.FrictionData(V[:4], np.ones(4), pressure=3e5)).explains is None
    assert judged(rows * np.nan).text == "cannot be judged: the fitted scene is not finite at all data"


def test_the_sum_of_squares():
    bound = scipy.stats.chi2.isf(1e-3, 36)
    rows = fitted(noise(2))
    rows = rows * np.sqrt(bound / np.sum(rows**2))
    assert judged(0.9999 * rows).explains
    (reason,) = judged(1.0001 * rows).reasons
    assert reason == (
        f"chi-square {bound * 1.0002:.4g} for 36 degrees of freedom, where chance exceeds {bound:.4g}"
        " once in 1000"
    )
    # By the median it takes more, of 40 values, and outliers do not count.
    assert judged(1.1 * rows, loss="huber").explains
    assert judged(3 * rows, loss="huber").explains is False
    rows = fitted(noise(3))
    rows[::9] = 30.0
    found = judged(rows, loss="huber")
    assert found.explains is True
    squares = 40 * (1.4826 * np.median(np.abs(rows))) ** 2
    assert found.text == (
        f"explains the data except 5 outliers of 40 values: chi-square by the median {squares:.4g} for 36"
        " degrees of freedom"
    )
    assert judged(rows).explains is False
    assert "loss=" in judged(rows).reasons[-1]
    assert not any("loss=" in reason for reason in judged(3 * fitted(noise(3))).reasons)


def test_one_bad_set_among_good_ones_is_named():
    sets = [dataclasses.replace(DATA, name=name) for name in ("R20", "R40", "R00")]
    rows = [fitted(noise(i)) for i in range(3)]
    rows[1] = rows[1] * 1.7
    found = verdict(sets, rows, 12.0, [None] * 3, "linear")
    assert found.explains is False
    assert any(reason.startswith("data 'R40': chi-square") for reason in found.reasons)
    assert not any("'R20'" in reason or "'R00'" in reason for reason in found.reasons)


def test_residuals_in_waves():
    rows = 1.1 * np.sign(np.sin(np.linspace(0.1, 4 * np.pi - 0.1, 40))) * (1 + 0.1 * noise(3))
    for estimated in (None, 0.02):
        (reason,) = judged(rows if estimated is None else scaled(rows), estimated).reasons
        chance = scipy.stats.binom.cdf(3, 39, 0.5)
        assert reason == (
            "data 'R20': residuals change their sign 3 times in 40 values along velocity,"
            f" chance gives so few changes once in {1 / chance:.2g}"
        )


def test_residuals_in_waves_within_the_errors():
    """Signs do not reject a scene whose residuals are smaller than the given errors; the text names them."""
    rows = 0.5 * np.sign(np.sin(np.linspace(0.1, 4 * np.pi - 0.1, 40))) * (1 + 0.1 * noise(3))
    found = judged(rows)
    assert found.explains is True and not found.reasons
    assert "residuals are systematic, but within the errors (data 'R20': residuals change" in found.text
    assert judged(2.2 * rows).explains is False
    # Estimated errors equal the residuals, so that only signs can reject.
    assert judged(scaled(rows), 0.02).explains is False


def test_a_robust_loss_is_recommended_for_a_minority_only():
    """8 of 12 values are outliers: the other 4 agree with their errors, but are no majority."""
    data = fitting.FrictionData(V[:12], np.ones(12), pressure=3e5)
    rows = 0.5 * noise(5, 12)
    rows[:8] = 9.0 * np.array([1, -1] * 4)
    assert not any("loss=" in reason for reason in judged(rows, data=data).reasons)
    rows[2:8] = 0.5
    assert "loss=" in judged(rows, data=data).reasons[-1]
    implausible = verdict([data], [rows], 4.0, [None], "linear", plausible=False)
    assert not any("loss=" in reason for reason in implausible.reasons)


def test_curves_are_followed_one_by_one():
    """A table whose rows alternate between two temperatures, each curve on one side of the fit."""
    T = np.tile([280.0, 320.0], 20)
    data = fitting.FrictionData(V, np.ones(40), pressure=3e5, temperature=T)
    (reason,) = judged(np.where(T == 280.0, 1.1, -1.1), data=data).reasons
    assert "change their sign 1 times in 40 values" in reason


def test_single_values_are_named():
    rows = 0.8 * fitted(noise(4))
    rows[7] = 5.0
    reason, advice = judged(rows).reasons
    assert advice == 'the other values agree with their errors: check the outliers, or use loss="huber"'
    at = f"velocity = {V[7]:g} m/s, pressure = 300000 Pa"
    assert reason == f"data 'R20': at {at} the fit is 5 errors above the measured 1"
    found = judged(scaled(rows), 0.02)
    assert re.search(rf"at velocity = {V[7]:g} m/s.* errors above", found.reasons[-1])
    assert found.explains is False
    rows[[1, 5, 9, 20]] = [-9, 8, -7, 6]
    *_, first, second, third, rest, _ = judged(rows).reasons
    assert ("9 errors below" in first, "8 errors above" in second, "7 errors below" in third) == (True,) * 3
    assert rest == "and 2 further outliers"


@pytest.mark.parametrize("estimated", [None, 0.02])
def test_a_value_that_dominates_chi_square(estimated):
    """One value pulls the fit away from the others, which then disagree with their errors as well."""
    rows = noise(4)
    rows[7] += 100.0
    rows = fitted(rows)
    rows = rows if estimated is None else scaled(rows)
    share = rows[7] ** 2 / np.sum(rows**2)
    assert 0.9 < share < 0.95
    advice = (
        f'the largest residual has {100 * share:.0f} % of chi-square: check this value, or use loss="huber"'
    )
    reasons = judged(rows, estimated).reasons
    assert reasons[-1] == advice
    assert sum("loss=" in reason for reason in reasons) == 1
    assert not any("loss=" in reason for reason in judged(rows, estimated, loss="huber").reasons)
    # Without a value that dominates, a robust loss would not help.
    assert not any("loss=" in reason for reason in judged(10 * fitted(noise(4))).reasons)


RUBBER = rf.Prony(3e6, [1e8, 3e7, 8e6], [1e-7, 1e-5, 1e-3], shift=rf.WLF(12.0, 150.0, 293.15))
ROAD = rf.SelfAffine(200.0, 1500.0, 5e4, 0.8, 3e-4)
SCENE = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(RUBBER))
CONDITIONS = tuple(a.ravel() for a in np.meshgrid(np.geomspace(1e-4, 3.0, 16), [283.15, 313.15]))
ERROR = 0.01
# Parts that a scene may lack or have wrong.
TRUTHS = {
    "nothing": SCENE,
    "heat": SCENE.replace(heating=rf.Heating(1.2e3, 1.6e3, 0.2, 2e-3)),
    "cut-off": SCENE.replace("lower.spectrum.q1", 2.5e4),
    "softening": SCENE.replace(softening=rf.Softening([1e-2, 0.1, 1.0], [1.0, 0.5, 0.2], [1.0, 0.9, 0.5])),
}


def measured(kind, seed):
    v, T = CONDITIONS
    scene = TRUTHS.get(kind, SCENE)
    mu = np.asarray(rf.friction(scene, v, 3e5, T, quadrature=FAST)) * np.exp(ERROR * noise(seed, v.size))
    if kind == "one bad point":
        mu[seed % v.size] *= 1 + 7 * ERROR * (-1) ** seed
    return fitting.FrictionData(v, mu, pressure=3e5, temperature=T, relative=ERROR)


def fit(data, **options):
    free = {"upper.material.E": fitting.Positive(), "upper.material.shift.C1": fitting.Positive()}
    return fitting.fit(SCENE, data, free, quadrature=FAST, **options)


@pytest.mark.slow
def test_twins():
    """Scenes that explain their data, and as many that lack something, or data with one bad point."""
    count = 10
    good = [fit(measured("nothing", seed)).verdict.explains for seed in range(4 * count)]
    assert good.count(True) >= 0.95 * len(good)
    wrong = {
        kind: [fit(measured(kind, seed)).verdict.explains for seed in range(count)]
        for kind in ("heat", "cut-off", "softening", "one bad point")
    }
    print({kind: found.count(False) for kind, found in wrong.items()}, good.count(True))
    assert sum(found.count(False) for found in wrong.values()) >= 0.95 * 4 * count, wrong


@pytest.mark.slow
def test_bars_by_the_scatter(tmp_path):
    """Errors given a factor 3 too small: bars, bands and the file follow, and the report says so."""
    data = dataclasses.replace(measured("nothing", 3), relative=ERROR / 3)
    plain, right = fit(data), fit(dataclasses.replace(data, relative=ERROR))
    found = fit(data, scale_errors=True)
    assert plain.verdict.explains is found.verdict.explains is False
    assert found.error_scale == pytest.approx(np.sqrt(plain.redchi), rel=1e-6)
    assert found.redchi == pytest.approx(plain.redchi, rel=1e-6)
    np.testing.assert_allclose(found.values, plain.values, rtol=1e-6)
    np.testing.assert_allclose(found.stderr, plain.stderr * found.error_scale, rtol=1e-5)
    np.testing.assert_allclose(right.stderr, plain.stderr * 3, rtol=1e-3)
    at = 0.1, 3e5, 293.15
    narrow, wide = plain.band(*at), found.band(*at)
    ratio = np.log(wide.high / wide.low) / np.log(narrow.high / narrow.low)
    assert ratio > found.error_scale  # Student's quantile instead of the normal one

    text = plain.report()
    assert text.startswith("THE SCENE DOES NOT EXPLAIN THE DATA: chi-square")
    assert "error bars in brackets are scaled by the scatter" in text
    for error in found.stderr:
        assert f"[{error:#.2g}]" in text
    text = found.report()
    assert f"times {found.error_scale:.4g} by the scatter" in text
    assert "brackets" not in text
    assert "DOES NOT EXPLAIN" in found._repr_html_()

    found.save(tmp_path / "fit.h5")
    again = fitting.FitResult.load(tmp_path / "fit.h5")
    assert again.error_scale == found.error_scale
    np.testing.assert_array_equal(again.interval(), found.interval())
    assert again.chisqr == pytest.approx(found.chisqr, rel=1e-12)
    assert again.report() == text


@pytest.mark.slow
def test_coverage_of_bars_by_the_scatter():
    """Errors given a factor 3 too small; the truth lies within 95 % intervals in 90 to 98 of 100."""
    truth, inside = None, []
    for seed in range(100):
        data = dataclasses.replace(measured("nothing", seed), relative=ERROR / 3)
        found = fit(data, scale_errors=True)
        if truth is None:
            truth = np.array([*np.asarray(RUBBER.E), 12.0])
        low, high = found.interval()
        inside.append((low < truth) & (truth < high))
    print(np.mean(inside, axis=0), np.mean(inside))
    assert 0.90 <= np.mean(inside) <= 0.98
