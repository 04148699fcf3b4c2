"""Unidentified directions in the report: roughness with gamma, and with contact shear."""

import numpy as np
import pytest
from support.scenes.fits import H_RMS as H
from support.scenes.fits import HURST, Q1, SHEAR
from support.scenes.fits import SCENE as SHEARLESS

from fitting import Bounded, Positive
from fitting.parameters.variables import free_parameters
from fitting.uncertainty.covariance import describe_direction

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
