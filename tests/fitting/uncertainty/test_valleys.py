"""Numbers that trade with each other: where their bars hold, and where the verdict has other intervals."""

import numpy as np
import pytest
from support.scenes.fits import E_INF, PLAIN, SCENE

import fitting
import rubberfric as rf

E = "upper.material.E[1]"


def fitted(relative, part):
    """Above its loss peak a term is a spring: its sum with E_inf is known, each as its prior says."""
    omega = np.array([1e5])
    modulus = np.asarray(rf.complex_modulus(PLAIN, omega))
    data = fitting.ModulusData(omega, modulus.real, modulus.imag, relative=relative)
    prior = {E: fitting.Gaussian(8e6, part * 8e6), E_INF: fitting.Gaussian(3e6, part * 3e6)}
    return fitting.fit(SCENE, data, {path: fitting.Positive() for path in prior}, prior=prior)


@pytest.fixture(scope="module")
def bent():
    return fitted(0.002, 0.3)


def test_intervals_are_those_of_the_profile(bent):
    assert [(one.name, one.other) for one in bent.valleys] == [(E, E_INF), (E_INF, E)]
    linear = np.transpose(bent.interval())
    for one in bent.valleys:
        assert one.correlation < -0.98 and one.expected == pytest.approx(1.959964**2)
        np.testing.assert_allclose(one.linear, linear[bent.names.index(one.name)], rtol=1e-12)
        exact = bent.profile(one.name, points=12)
        exact = np.log([exact.low, exact.high])
        np.testing.assert_allclose(np.log(one.interval), exact, atol=0.03)
        assert one.holds == (np.abs(np.log(one.linear) - exact).max() < 0.05)
    assert [one.holds for one in bent.valleys] == [False, True]


def test_the_verdict_says_so(bent):
    text, *_ = bent.report().split("[[Fit]]")
    assert f"{E} and {E_INF} compensate each other (correlation -0.996), so the 95 % interval of" in text
    assert "not 6.52e+06 ... 9.81e+06 as its error bar states" in text
    assert f"result.profile({E!r})" in text and f"{E_INF} and" not in text and "left open = nothing" in text


def test_nothing_is_said_where_bars_hold():
    narrow = fitted(2e-5, 0.007)
    assert len(narrow.valleys) == 2 and all(one.holds for one in narrow.valleys)
    for one in narrow.valleys:
        np.testing.assert_allclose(one.rises, one.expected, rtol=0.05)
    assert "compensate" not in narrow.report()
    assert fitted(0.02, 0.02).valleys == ()
