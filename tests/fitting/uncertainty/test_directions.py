"""Unidentified directions in the report: roughness with gamma, and with contact shear."""

import functools

import numpy as np
import pytest
from support.scenes.bars import (
    BOTH,
    MODULI,
    OMEGA,
    TAU,
    VELOCITY,
    every_gap_is_explained,
    modulus,
    modulus_data,
)
from support.scenes.fit_problems import DRY
from support.scenes.fits import E_INF, FAST, HURST, Q1, SHEAR, THREE, E, area_data, friction_data
from support.scenes.fits import H_RMS as H
from support.scenes.fits import SCENE as SHEARLESS

import rubberfric as rf
from fitting import Bounded, FrictionData, ModulusData, Positive, Smooth, fit
from fitting.parameters.variables import free_parameters
from fitting.uncertainty.covariance import OPEN
from fitting.uncertainty.directions import describe_direction

SCENE = SHEARLESS.replace(shear=SHEAR)
GAMMA = "gamma"
V0 = "shear.v0"


def said(**loadings):
    """The line on a direction with parts of key paths, __ for the dots."""
    paths = [name.replace("__", ".") for name in loadings]
    rules = {path: Bounded(0.3, 1.0) if path in (GAMMA, HURST) else Positive() for path in paths}
    variables, _, _ = free_parameters(SCENE, rules)
    vector = np.array(list(loadings.values()))
    return describe_direction(variables, vector / np.linalg.norm(vector), 10.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_more_roughness_and_less_gamma(sign):
    text = said(lower__spectrum__h_rms=sign, lower__spectrum__q1=0.5 * sign, gamma=-0.8 * sign)
    assert f"more roughness ({H}, {Q1}) with less gamma gives the same curve" in text
    assert "add a measured spectrum or an area curve, or fix gamma or the cut-off" in text


def test_what_directions_mean():
    text = said(lower__spectrum__hurst=1.0, gamma=0.7)
    assert f"more roughness ({HURST}) with less gamma" in text
    text = said(lower__spectrum__q1=-0.4, shear__v0=1.0)
    assert f"more roughness ({Q1}) with less {V0} gives the same curve" in text
    assert "contact shear and roughness compensate each other: fix the cut-off or give it by RmsSlope" in text
    assert "more roughness" not in said(lower__spectrum__h_rms=1.0, lower__spectrum__q1=-1.0)
    assert "more roughness" not in said(shear__v0=1.0, shear__c=0.3)


# --- of fits


@functools.cache
def light():
    """Friction under 1 kPa: 24 points, 3 %, of a rubber with three terms."""
    return friction_data(THREE, np.logspace(-4, 1, 24), 1e3, 0.03)


def within_four_sigma(result, truth):
    return np.all(np.abs(result.values - truth) < 4 * result.stderr)


@pytest.mark.slow
def test_friction_at_light_load_does_not_know_the_scale_of_the_moduli():
    result = fit(THREE, light(), BOTH, quadrature=FAST)
    assert result.success
    (direction,) = result.unidentified
    assert direction.deviation > 10
    np.testing.assert_allclose(direction.loadings, direction.loadings[0], rtol=0.05)
    assert direction.text.startswith(f"{E_INF} * λ, {E} (all 3 elements) * λ: ")
    assert "depends on ratios of moduli only: add a measured modulus (one point is enough)" in direction.text
    assert result.withheld == dict.fromkeys(result.names, "not identified, see direction 1")
    every_gap_is_explained(result)
    # Ratios are known well, whatever the scale: the other directions are short.
    assert np.sort(result.uncertainty.deviations)[-2] < 0.1
    ratios = result.values[1:] / result.values[0]
    np.testing.assert_allclose(ratios, MODULI / 3e6, rtol=0.2)
    # The friction under that load is determined although no modulus is.
    band = result.band(light().velocity, 1e3)
    assert np.all(np.log(band.high / band.low) < 0.3)


@pytest.mark.parametrize("kind", ["modulus", "area"])
@pytest.mark.slow
def test_one_point_of_modulus_or_an_area_curve_identify_it(kind):
    if kind == "modulus":
        exact = modulus(np.array([1e4]))
        more = ModulusData([1e4], exact.real * 1.02, exact.imag * 0.99, relative=0.03)
    else:
        more = area_data(THREE, light().velocity[::4], 1e3, seed=5)
    result = fit(THREE, [light(), more], BOTH, quadrature=FAST)
    assert result.success and not result.unidentified and not result.withheld
    every_gap_is_explained(result)
    assert np.all(result.stderr < 0.2 * result.values)
    assert within_four_sigma(result, np.array([3e6, *MODULI]))


@pytest.mark.slow
def test_friction_at_light_load_cannot_tell_gamma_from_the_height_of_the_roughness():
    """Data without noise, so that the fit keeps its start along unidentified directions."""
    data = light().replaced(np.asarray(rf.friction(THREE, light().velocity, 1e3, quadrature=FAST)))
    free = {"gamma": Bounded(0.1, 1.0), H: Positive()}
    result = fit(THREE, data, free, quadrature=FAST)
    (direction,) = result.unidentified
    up, height = direction.loadings
    assert up * height < 0 and abs(up) > 0.1 and abs(height) > 0.1
    assert "gamma" in direction.text and "lower.spectrum.h_rms * λ" in direction.text
    assert "add a measured spectrum or an area curve, or fix gamma or the cut-off" in direction.text
    assert set(result.withheld) == set(free)
    every_gap_is_explained(result)


@pytest.mark.slow
def test_a_term_outside_the_measured_frequencies_is_named_alone():
    scene = THREE.replace(upper=rf.Body(rf.Prony(3e6, [1e8, *MODULI], [1e-14, *TAU])))
    result = fit(scene, modulus_data(noise=0.0), BOTH)
    (direction,) = result.unidentified
    assert direction.text.startswith(f"{E}[0] * λ: ")
    assert direction.text.endswith("; the data do not determine it: fix it, or give it a prior")
    assert set(result.withheld) == {f"{E}[0]"}
    every_gap_is_explained(result)
    # A prior is as good as data that reach it.
    smooth = fit(scene, modulus_data(noise=0.0), BOTH, prior={E: Smooth(0.05)})
    assert not smooth.withheld and not smooth.unidentified


def test_two_parameters_that_enter_as_a_product():
    exact = np.asarray(rf.friction(DRY, VELOCITY, 1e3, quadrature=FAST))
    data = FrictionData(VELOCITY, exact, pressure=1e3, relative=0.03)
    free = {"shear.tau_f0": Positive(), "upper.material.young": Positive(), "shear.c": Positive()}
    result = fit(DRY, data, free, quadrature=FAST, further_time=0.0)
    (direction,) = result.unidentified
    assert direction.text.startswith("shear.tau_f0 * λ, upper.material.young * λ: ")
    assert "contact shear depends only on tau_f0 times the contact area" in direction.text
    assert set(result.withheld) == {"shear.tau_f0", "upper.material.young"}
    assert 0 < result.stderr[2] < 0.01
    # A rubber that is a thousand times softer is in full contact, where another c fits.
    followed = fit(DRY, data, free, quadrature=FAST)
    assert set(followed.withheld) == {*result.withheld, "shear.c"} and len(followed.bounds) == 2
    every_gap_is_explained(result)


def test_a_number_that_no_data_see_at_all():
    """gamma does not change a modulus: its column is exactly zero."""
    result = fit(THREE, modulus_data(), BOTH | {"gamma": Bounded(0.1, 1.0)})
    (direction,) = result.unidentified
    assert np.isinf(direction.deviation) and np.isinf(result.uncertainty.condition)
    assert result.uncertainty.rank == 4
    assert direction.text.startswith("gamma up: without any effect")
    assert result.withheld == {"gamma": "not identified, see direction 1"}
    assert result.values[-1] == pytest.approx(0.5, abs=1e-12)  # left where it was
    every_gap_is_explained(result)
    # Unidentified directions are equally wide for every loss.
    robust = fit(THREE, modulus_data(), BOTH | {"gamma": Bounded(0.1, 1.0)}, loss="soft_l1")
    for one in (result, robust):
        assert one.uncertainty.spread[-1, -1] == pytest.approx(OPEN**2, rel=1e-12)


@pytest.mark.slow
def test_a_bound_does_not_hide_what_trades_with_it():
    """With noise, gamma runs along its trade with h_rms to a bound, where its x hardly counts."""
    free = {"gamma": Bounded(0.1, 1.0), H: Positive()}
    result = fit(THREE, light(), free, quadrature=FAST)
    assert "bound" in result.withheld["gamma"]
    assert result.withheld["lower.spectrum.h_rms"] == "not identified, see direction 1"
    (direction,) = result.unidentified
    assert "gamma" in direction.text and "lower.spectrum.h_rms * λ" in direction.text
    every_gap_is_explained(result)
    # The friction itself is known.
    band = result.band(light().velocity, 1e3)
    assert np.all(np.log(band.high / band.low) < 0.3)


@pytest.mark.parametrize(("low", "high", "side"), [(1e6, 2e6, "upper"), (4e6, 9e6, "lower")])
def test_at_a_bound(low, high, side):
    free = {E: Positive(), E_INF: Bounded(low, high, start=0.5 * (low + high))}
    result = fit(THREE, modulus_data(), free)
    bound = low if side == "lower" else high
    assert result.values[-1] == pytest.approx(bound, rel=1e-3)
    assert result.withheld == {E_INF: f"at its {side} bound {bound:g}"}
    every_gap_is_explained(result)


def test_driven_towards_zero():
    """A slow term that the data have no room for."""
    scene = THREE.replace(upper=rf.Body(rf.Prony(3e6, [*MODULI, 1e5], [*TAU, 3e-1])))
    exact = modulus()
    data = ModulusData(OMEGA, exact.real, exact.imag * np.where(OMEGA < 50, 0.97, 1.0), relative=0.02)
    result = fit(scene, data, {E: Positive()})
    assert result.success
    assert result.withheld == {f"{E}[3]": "driven towards zero: the data want it absent"}
    assert result.values[-1] < 0.1
    every_gap_is_explained(result)
