"""Prony series of retardation spectra, against numerical Laplace transforms and closed forms."""

import mpmath
import numpy as np
import pytest

import rubberfric as rf
from rubberfric.materials import prony_from_compliance

TAU = np.geomspace(1e-4, 1e2, 7)
D = np.array([2.0, 0.5, 3.0, 1e-6, 4.0, 1.0, 0.2]) * 1e-7
CASES = {"solid": (1e-8, 0.0), "liquid": (1e-8, 3e-9), "stiff glass": (1e-12, 0.0)}


def relaxation(material, t):
    """E(t) of a Prony series."""
    return float(material.E_inf) + np.asarray(material.E) @ np.exp(-t / np.asarray(material.tau))


@pytest.mark.parametrize("case", CASES)
def test_the_modulus_is_one_over_the_compliance(case):
    D_0, flow = CASES[case]
    material = prony_from_compliance(D_0, D, TAU, flow)
    omega = np.geomspace(1e-6, 1e8, 60)
    compliance = D_0 + np.sum(D / (1 + 1j * omega[:, None] * TAU), axis=1) + flow / (1j * omega)
    np.testing.assert_allclose(np.asarray(rf.complex_modulus(material, omega)) * compliance, 1, rtol=1e-12)
    assert material.tau.size == TAU.size + (flow > 0)
    assert (np.asarray(material.E) > 0).all() and (np.diff(material.tau) > 0).all()


@pytest.mark.parametrize("case", ["solid", "liquid"])
def test_relaxation_by_numerical_inversion_of_the_laplace_transform(case):
    """The transform of E(t) is 1 / (s^2 L[D](s)) with the transform L[D](s) of the compliance."""
    D_0, flow = CASES[case]
    material = prony_from_compliance(D_0, D, TAU, flow)
    with mpmath.workdps(30):

        def transform(s):
            of_D = (
                D_0 / s + sum(d / s - d / (s + 1 / tau) for d, tau in zip(D, TAU, strict=True)) + flow / s**2
            )
            return 1 / (s**2 * of_D)

        for t in (1e-4, 3e-2, 5.0):
            inverse = float(mpmath.invertlaplace(transform, t, method="talbot", degree=40))
            assert relaxation(material, t) == pytest.approx(inverse, rel=1e-10)


def test_standard_linear_solid_and_burgers_fluid():
    """E_inf = 1/(D_0 + D_1), E_1 = 1/D_0 - E_inf, tau = tau_1 D_0/(D_0 + D_1); a quadratic for the fluid."""
    solid = prony_from_compliance(2e-8, [3e-8], [5.0])
    np.testing.assert_allclose([solid.E_inf, solid.E[0], solid.tau[0]], [2e7, 3e7, 2.0], rtol=1e-14)
    D_0, D_1, rate, flow = 1e-8, 4e-8, 0.5, 1e-9
    fluid = prony_from_compliance(D_0, [D_1], [1 / rate], flow)
    # D_0 (l - x) x + D_1 l x - flow (l - x) = 0
    x = np.sort(np.roots([-D_0, D_0 * rate + D_1 * rate + flow, -flow * rate]))
    np.testing.assert_allclose(np.sort(1 / np.asarray(fluid.tau)), x, rtol=1e-12)
    assert float(fluid.E_inf) == 0 and float(np.sum(fluid.E)) == pytest.approx(1 / D_0, rel=1e-12)


def test_equal_times_and_absent_terms():
    one = prony_from_compliance(1e-8, [1e-8, 2e-8, 0.0], [1.0, 1.0, 7.0])
    np.testing.assert_allclose([one.E[0], one.tau[0]], [0.75e8, 0.25], rtol=1e-14)
    assert one.tau.size == 1


def test_material_properties():
    shift = rf.WLF(8.9, 120.0, 293.15)
    material = prony_from_compliance(1e-8, D, TAU, poisson=0.49, shift=shift)
    assert float(material.poisson) == 0.49 and material.shift == shift


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0, [1e-8], [1.0]), "D_0 = 0.0: must be > 0"),
        ((1e-8, [-1e-8], [1.0]), r"D\[0\] = -1e-08: must be >= 0"),
        ((1e-8, [1e-8], [1.0, 2.0]), "lengths differ"),
        ((1e-8, [0.0], [1.0]), "must have a retarded compliance; use Elastic"),
        ((1e-8, [1e-8], [1.0], -1.0), "fluidity = -1.0: must be >= 0"),
    ],
)
def test_bad_input(arguments, message):
    with pytest.raises(ValueError, match=message):
        prony_from_compliance(*arguments)
