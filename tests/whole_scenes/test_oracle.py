"""The oracle itself, against values and a method that are not its own."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import erf
from support.cases.stored import h_rms, reference, slow_if
from support.oracles import oracle

CASES = reference("forward_cases") | reference("edge_cases")


QUICK = ("extreme-light-1", "edge-narrow")
OTHER = ("general-layered-0", "general-both-rubber-both-rough-1", "edge-liquid-rough-static")


@pytest.mark.parametrize("name", slow_if(OTHER.__contains__, QUICK + OTHER))
def test_reference_values(name):
    case = CASES[name]
    result = oracle.solve(case)
    assert result["area"] == pytest.approx(case["area"], rel=1e-12)
    assert result["friction"] == pytest.approx(case["friction"], rel=1e-12)
    assert abs(result["separation"] / case["separation"] - 1) < 1e-12 or case["separation"] < 1e-12 * h_rms(
        case
    )


@pytest.mark.slow
def test_option_cases_are_current():
    """A scene with every option gives the stored values on another mesh."""
    for name in ("correction-two-rubbers", "frictionless-slab", "table-spectrum", "table-modulus", "wlf-hot"):
        case = reference("option_cases")[name]
        result = oracle.solve(case, halvings=110, order=14)
        for quantity, value in result.items():
            assert value == pytest.approx(case[quantity], rel=1e-12), (name, quantity)


@pytest.mark.parametrize("gamma", [0.0, 0.3, 1.0])
def test_corrected_G_solves_its_equation(gamma):
    """dG/dg0 = S(P(G)) stepped by an ordinary solver instead of inverted."""

    def slope(s, G):
        return [(gamma + (1 - gamma) * erf(0.5 / np.sqrt(G[0])) ** 2) * np.exp(s)]

    s = np.log([1e-3, 0.1, 1.0, 30.0, 1e4])
    stepped = solve_ivp(slope, (s[0], s[-1]), [1e-3], method="DOP853", rtol=1e-13, atol=0, t_eval=s)
    np.testing.assert_allclose(oracle.corrected_G(np.exp(s), gamma), stepped.y[0], rtol=1e-11)
