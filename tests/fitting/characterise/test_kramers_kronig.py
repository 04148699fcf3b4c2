"""Consistent and inconsistent E' and E''."""

import dataclasses

import numpy as np
import pytest
from support.cases.isotherms import CURVES, LAW, isotherms
from support.scenes.fits import noise

from fitting import FrictionData, KramersKronig, ModulusData, kramers_kronig

OMEGA = np.geomspace(1e-4, 1e8, 97)


def data_of(curve, omega=OMEGA, error=0.0, seed=0, loss=1.0, **options):
    """Data with noise, and their loss times a factor."""
    modulus = CURVES[curve](omega)
    values = noise((2, omega.size), error, seed) * [modulus.real, loss * modulus.imag]
    return ModulusData(omega, *values, **options)


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("omega", [OMEGA, np.geomspace(1e-1, 1e3, 33), np.geomspace(1e4, 1e7, 13)[::-1]])
def test_curves_of_one_material_are_consistent(curve, omega):
    """Also where the range ends in the middle of the transition."""
    found = kramers_kronig(data_of(curve, omega))
    assert isinstance(found, KramersKronig) and found.consistent and found.worst == ()
    assert found.rms < 0.005 and np.abs(found.contradiction[found.counted]).max() < 0.02
    assert "no contradiction beyond the scatter" in found.report()


def test_shifted_sweeps_are_consistent():
    data = isotherms(noise=0.0)
    assert kramers_kronig(data, shift=LAW).rms < 0.005
    assert kramers_kronig(data, shift=LAW.replace(C1=6.0)).rms > 0.03


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("error", [pytest.param(0.01, marks=pytest.mark.slow), 0.03])
def test_noise_is_no_contradiction(curve, error):
    found = [kramers_kronig(data_of(curve, error=error, seed=seed)) for seed in range(12)]
    assert np.sum([one.consistent for one in found]) >= 11
    assert np.median([one.rms for one in found]) < 0.01 and max(one.rms for one in found) < 2.0 * error
    pulls = np.concatenate([(one.contradiction / one.stderr)[one.counted] for one in found])
    assert 0.75 < np.sqrt(np.mean(pulls**2)) < 1.15
    assert np.median([one.scatter for one in found]) == pytest.approx(error, rel=0.1)
    middle, ends = (np.median([one.stderr[where] for one in found]) for where in (slice(8, 16), [0, -1]))
    assert ends > 3 * middle


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("factor", [1.1, 0.9])
def test_loss_that_is_wrong_everywhere(curve, factor):
    for seed in range(4):
        found = kramers_kronig(data_of(curve, error=0.01, seed=seed, loss=factor))
        assert not found.consistent and found.rms == pytest.approx(abs(np.log(factor)), abs=0.015)
        assert found.worst[0][1] == pytest.approx(np.log(factor), abs=0.04)
        side = "10% above" if factor > 1 else "10% below"
        assert "CONTRADICT EACH OTHER" in found.report() and side[3:] in found.report()
    clean = kramers_kronig(data_of(curve, loss=factor))
    assert clean.rms == pytest.approx(abs(np.log(factor)), abs=0.005)


@pytest.mark.parametrize("decade", [-1, 1, 3])
def test_loss_that_is_wrong_in_a_decade(decade):
    """It is found, at its place, and nowhere else."""
    inside = (10.0**decade < OMEGA) & (10.0 ** (decade + 1) > OMEGA)
    for seed in range(4):
        found = kramers_kronig(data_of("zener", error=0.01, seed=seed, loss=np.where(inside, 1.1, 1.0)))
        omega, value, error = found.worst[0]
        assert not found.consistent and 10.0**decade < omega < 10.0 ** (decade + 1)
        assert abs(value - np.log(1.1)) < 0.05 and error < 0.03
        away = found.counted & (np.abs(np.log10(found.omega) - decade - 0.5) > 1.6)
        assert np.sqrt(np.mean((found.contradiction / found.stderr)[away] ** 2)) < 1.6


def test_given_errors_are_used():
    plain, scattered = data_of("zener", error=0.01), data_of("zener", error=0.01, loss=1.1)
    for given, consistent in ((0.01, False), (0.3, True)):
        found = kramers_kronig(dataclasses.replace(scattered, relative=np.full(OMEGA.size, given)))
        assert found.scatter == (given, given) and found.consistent is consistent
    sigma = {"sigma_storage": 0.01 * plain.storage, "sigma_loss": 0.02 * plain.loss}
    found = kramers_kronig(dataclasses.replace(plain, **sigma))
    assert found.scatter == pytest.approx((0.01, 0.02)) and found.consistent


def test_nothing_is_said_of_data_that_say_nothing():
    found = kramers_kronig(data_of("prony", np.geomspace(1.0, 100.0, 12), error=0.1))
    assert not found.counted.any() and np.isnan(found.rms) and np.isnan(found.chance)
    assert found.worst == () and "no conclusion" in found.report()


def test_report_and_picture():
    found = kramers_kronig(data_of("zener", error=0.01, loss=1.1, name="sample B"))
    lines = found.report().splitlines()
    assert lines[0] == "E' and E'' of sample B, 0.0001 ... 1e+08 rad/s"
    assert f"{found.rms:.1%} rms" in lines[1] and "rad/s E'' is" in lines[2] and "or E' too flat" in lines[2]
    assert repr(found) == f"<KramersKronig: contradiction {found.rms:.2%} rms, inconsistent>"
    upper, lower = found.plot()
    implied = upper.lines[2].get_ydata()
    np.testing.assert_allclose(np.log(found.data.loss / implied), np.log(1.1), atol=0.35)
    counted = lower.lines[0]
    np.testing.assert_allclose(counted.get_ydata(), 100 * found.contradiction[found.counted])
    upper.figure.canvas.draw()


@pytest.mark.parametrize(
    ("data", "options", "said"),
    [
        (FrictionData(1.0, 0.5, pressure=1e5), {}, "data is a FrictionData: must be ModulusData"),
        (data_of("zener", temperature=300.0), {}, "no shift is given"),
        (data_of("zener"), {"per_decade": 0.0}, "per_decade = 0.0: must be a number > 0"),
        (data_of("zener", OMEGA[:5]), {}, "5 frequencies: must have at least 6"),
        (
            ModulusData([1.0, 2.0], [2e6, 2e6], [-1.0, 1.0], [1.0, 1.0], [1.0, 1.0], check_units=False),
            {},
            "have values <= 0",
        ),
    ],
)
def test_bad_input(data, options, said):
    with pytest.raises(ValueError, match=said) as caught:
        kramers_kronig(data, **options)
    assert "\n" not in str(caught.value)
