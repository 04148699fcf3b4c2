"""Sweeps that no shift superposes are refused or named; error bars of laws that miss the shifts."""

import numpy as np
import pytest
from scipy.optimize import curve_fit
from support.scenes.fits import noise

import rubberfric as rf
from fitting import ModulusData, fit_master_curve, kramers_kronig
from fitting.characterise.shift_laws import arrhenius_through, wlf_through

T = np.array([293.15, 303.15, 313.15])
OMEGA = np.geomspace(0.01, 100.0, 12)


def gel(rise):
    """G' and G'' rise by `rise` per 10 K at every frequency."""
    at, omega = (one.ravel() for one in np.meshgrid(T, OMEGA, indexing="ij"))
    modulus = np.array([[3e3], [3e2]]) * rise ** ((at - T[0]) / 10) * omega**0.1
    return ModulusData(omega, *(modulus * noise(modulus.shape, 0.01, seed=1)), temperature=at)


@pytest.mark.parametrize("vertical", [False, True, "entropic"])
def test_a_gel_that_stiffens_on_heating_is_refused(vertical):
    message = (
        r"isotherms: E' at equal frequencies rises by a factor 9 from 293.15 to 313.15 K; such sweeps do"
    )
    with pytest.raises(ValueError, match=message) as caught:
        fit_master_curve(gel(3.0), vertical=vertical)
    assert "\n" not in str(caught.value)


def test_a_weaker_gel_is_named():
    """Sweeps that rise by 22 % per 10 K are placed decades apart, or shifted to slower relaxation."""
    curve = fit_master_curve(gel(1.22))
    assert curve.fall is not None
    (low, high), fall = curve.fall.omega, curve.fall.change
    # The largest fall is between the means of two neighbouring sweeps, apart from the slope within a sweep.
    assert low < high and fall == pytest.approx(-2 * np.log(1.22) - 0.1 * np.log(1e4), abs=0.8)
    assert "E' FALLS WITH FREQUENCY by" in curve.report()
    # Moduli proportional to omega^0.1 superpose if a_T rises by 1.2^(1/2 / 0.1) per 10 K.
    rising = fit_master_curve(gel(1.2**0.5))
    np.testing.assert_allclose(rising.log_aT, np.log(1.2) * np.array([0, 5, 10]), rtol=0.1)
    assert "a_T RISES WITH TEMPERATURE by 0.8" in rising.report()


def test_rubber_is_not_named():
    """The plateau of a rubber rises with T: E' falls with the reduced frequency, but not by itself."""
    at, omega = (one.ravel() for one in np.meshgrid(T, OMEGA, indexing="ij"))
    z = (1j * omega * 1e-4 * np.exp(np.asarray(rf.WLF(8.0, 110.0, 293.15).log_factor(at)))) ** 0.5
    modulus = at / 293.15 * (2e6 + 1e9 * z / (1 + z))
    values = noise((2, at.size), 0.01, seed=2) * [modulus.real, modulus.imag]
    curve = fit_master_curve(ModulusData(omega, *values, temperature=at))
    assert curve.fall is None and "RISES" not in curve.report() and "FALLS" not in curve.report()


@pytest.mark.parametrize("gap", [0.0, 8.0])
def test_moduli_that_fall_over_wide_gaps_have_a_report(gap):
    """Nodes in a gap are unknown, not certain. E' that falls with frequency has no spectrum."""
    omega = (OMEGA[:, None] * 10.0 ** (-gap * np.arange(3))).ravel()
    fall = np.tile(1.5 ** np.arange(3), OMEGA.size)
    values = noise((2, omega.size), 0.01, seed=3) * [3e3 * fall, 3e2 * fall]
    check = kramers_kronig(ModulusData(omega, *values, check_units=False))
    assert check.report() and np.isfinite(check.stderr).all()
    if gap:
        middle = np.abs(np.log10(check.omega[:, None] / [1e-4, 1e-12])).min(axis=1) < 1.0
        assert middle.any() and not check.counted[middle].any()


@pytest.mark.parametrize(("law", "parameters"), [(wlf_through, (8.0, 110.0)), (arrhenius_through, (0.9,))])
def test_error_bars_of_a_law_include_its_misfit(law, parameters):
    """Against scipy's curve_fit, which scales the covariance by chi-square per degree of freedom."""
    at, rng = np.array([253.15, 263.15, 273.15, 283.15, 303.15, 318.15]), np.random.default_rng(4)

    def log_a(T, *p):
        one = rf.WLF(p[0], p[1], 293.15) if len(p) == 2 else rf.Arrhenius(p[0], 293.15)
        return np.asarray(one.log_factor(T), float)

    root = 0.02 * rng.standard_normal((6, 6))
    covariance = root @ root.T + 1e-4 * np.eye(6)
    misses = log_a(at, *parameters) + 0.3 * rng.standard_normal(6)
    found = law(at, misses, covariance, 293.15)
    p, scaled = curve_fit(log_a, at, misses, parameters, covariance, absolute_sigma=False, xtol=1e-12)
    np.testing.assert_allclose(found.values, p, rtol=1e-4)
    np.testing.assert_allclose(found.covariance, scaled, rtol=2e-3)
    # A misfit that is smaller than the errors does not narrow the error bars.
    exact = law(at, log_a(at, *parameters), covariance, 293.15)
    _, absolute = curve_fit(log_a, at, log_a(at, *parameters), parameters, covariance, absolute_sigma=True)
    np.testing.assert_allclose(exact.covariance, absolute, rtol=2e-3)
