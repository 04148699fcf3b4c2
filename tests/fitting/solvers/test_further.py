"""Further starts of fits with faults, implausible values, and the contact line of the fitted scene."""

import numpy as np
import pytest
from support.scenes import fits
from support.scenes.fits import AFFINE, FAST, H_RMS, PLAIN, Q1, area_data
from support.scenes.fits import HURST as H

import fitting
import rubberfric as rf
from fitting import Bounded, Positive
from fitting.parameters.plausible import implausible

QUADRATURE = rf.Quadrature(order=8, panels=4, angular_order=8)
# The minima below are those of these numbers.
TRUTH = rf.Scene(rf.Body(rf.Rigid(), AFFINE.replace(q1=4e4, h_rms=1e-4)), rf.Body(PLAIN))
V = np.logspace(-4, 1, 8)
FREE = {H_RMS: Positive(), Q1: Positive()}


def data(scene=TRUTH):
    return area_data(scene, V, quadrature=QUADRATURE)


def fit(start, **options):
    return fitting.fit(start, data(), FREE, quadrature=QUADRATURE, **options)


@pytest.fixture(scope="module")
def smooth():
    """From a smooth surface, which is in full contact, no step lowers the cost."""
    return TRUTH.replace(H_RMS, 1e-8)


@pytest.fixture(scope="module")
def known():
    return fit(TRUTH)


def test_a_fit_without_faults_has_no_further_starts(known):
    assert known.success and known.further is None and known.bounds == ()


def test_further_starts_find_the_minimum(smooth, known):
    """The first fit is stuck. The further starts are random, so that they need the decades to the truth."""
    first = fit(smooth, further_time=0.0)
    assert first.further is None and first.chisqr > 100 * known.chisqr
    found = fit(smooth, decades=4.0)
    assert found.success and found.cost == pytest.approx(known.cost, rel=1e-6)
    assert found.further.before == pytest.approx(first.cost, rel=1e-6) and found.further.count <= 8
    assert found.further.after == pytest.approx(found.cost, rel=1e-6) and not found.further.timed_out
    (line,) = (one for one in found.report().splitlines() if "lowered the cost from" in one)
    assert f"{found.further.count} further start" in line
    assert any("tried because at first " in one for one in found.report().splitlines())


def test_time_ends_the_further_starts(smooth):
    found = fit(smooth, further_time=1e-9)
    assert found.further.timed_out and found.further.count == 0
    assert "0 further starts found no lower minimum; time ended (further_time)" in found.report()


def test_several_starts_are_enough(smooth):
    """A user who asks for several starts gets these and no others."""
    assert fit(smooth, starts=2, further_time=1e-9).further is None


@pytest.mark.parametrize("value", [-1.0, np.nan, "long"])
def test_further_time_is_checked(value):
    with pytest.raises(ValueError, match=r"^further_time = .*: must be a number of seconds >= 0$"):
        fit(TRUTH, further_time=value)


def test_implausible_values_are_named():
    names = ["shear.tau_f0", H_RMS, "R20.upper.material.young", "upper.material.E[3]", H]
    found = implausible(names, np.array([1.3e9, 0.8, 11.0, 1.0, 0.8]))
    assert found == {names[0]: (1e2, 1e9), names[1]: (1e-10, 0.05), names[2]: (1e3, 1e11)}
    # One value that the data want, far outside: heights and wavelengths a million times larger.
    rough = {"lower.spectrum.h_rms": 0.1 * TRUTH.lower.spectrum.h_rms * 1e4}
    rough |= {
        f"lower.spectrum.{name}": getattr(TRUTH.lower.spectrum, name) / 1e3 for name in ("q0", "qr", "q1")
    }
    scene = TRUTH.replace({name: float(value) for name, value in rough.items()})
    one = fitting.fit(scene, data(scene), {H_RMS: Positive()}, quadrature=QUADRATURE, further_time=1e-9)
    assert f"IMPLAUSIBLE: {H_RMS} = {one.values[0]:.3g} m, outside 1e-10 ... 0.05" in one.report()
    assert f"{H_RMS} = {one.values[0]:.3g} is outside 1e-10 ... 0.05" in one.further.reasons


def test_the_contact_line_is_of_the_fitted_scene():
    """The start has H = 0.8, with known errors, and the fit ends at H = 0.35, without."""
    truth = TRUTH.replace(H, 0.35)
    start = TRUTH.replace(H, 0.8)
    assert rf.analysis.theory_error(start) is not None and rf.analysis.theory_error(truth) is None
    found = fitting.fit(start, data(truth), {H: Bounded(0.1, 1.0)}, quadrature=QUADRATURE)
    assert found.values[0] == pytest.approx(0.35, abs=0.05)
    (line,) = (one for one in found.report().splitlines() if "contact  " in one)
    assert line.endswith("theory as in the paper, of unknown error in such scenes")


# --- minima that are none, or not the lowest


ROUGH = {f"lower.spectrum.{name}": Positive() for name in ("h_rms", "q1", "qr")}


@pytest.mark.slow
def test_in_full_contact_nothing_is_called_reached():
    """All parameters give full contact. No step lowers the cost, because it is constant."""
    truth = TRUTH.replace(Q1, 1e5)
    data = area_data(truth, np.logspace(-4, 1, 12))
    smooth = truth.replace(H_RMS, 1e-8)
    flat = fitting.fit(smooth, data, ROUGH, quadrature=FAST, further_time=0.0)
    assert not flat.success and flat.cost > 1e3
    assert "no free parameter changes the data" in flat.message and "starts=8" in flat.message
    assert "NOT REACHED" in flat.report()
    # Less smooth, places around it show a way.
    found = fitting.fit(truth.replace(H_RMS, 3e-7), data, ROUGH, quadrature=FAST)
    known = fitting.fit(truth, data, ROUGH, quadrature=FAST)
    assert found.success and found.cost == pytest.approx(known.cost, rel=1e-6)


@pytest.mark.slow
def test_a_minimum_far_above_the_data_is_left_for_a_lower_one():
    """A start without a fall leads to a minimum at q1 = qr, and on from there."""
    truth = fits.SCENE
    data = fits.friction_data(truth, np.logspace(-3, 1, 8), 3e5, 0.03, seed=1)
    free = {name: ROUGH[name] for name in list(ROUGH)[1:]}
    found = fitting.fit(truth.replace(Q1, 1.5e3), data, free, quadrature=FAST)
    known = fitting.fit(truth, data, free, quadrature=FAST)
    assert found.success and found.cost == pytest.approx(known.cost, rel=1e-6)


@pytest.mark.slow
def test_a_right_minimum_of_a_wrong_scene_stays_one():
    """Data that no parameter explains: places around are looked at, and the claim stays."""
    truth = TRUTH.replace(Q1, 1e5)
    data = area_data(truth, np.logspace(-4, 1, 12))
    off = data.replaced(data.measured * np.where(np.arange(12) % 2, 1.3, 0.8))
    found = fitting.fit(truth, off, ROUGH, quadrature=FAST)
    assert found.success and found.verdict.explains is False
    assert found.further is not None and found.further.count >= 3
    assert found.further.after == found.further.before
    assert "further starts found no lower minimum" in found.report()
    once = fitting.fit(truth, off, ROUGH, quadrature=FAST, further_time=0.0)
    assert once.further is None and "starts=8 looks for a lower minimum" in once.report()
