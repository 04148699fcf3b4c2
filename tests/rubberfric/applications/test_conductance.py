"""Conductance from stiffness: a circular spot, closed forms of the theory, scaling, derivatives, refusals."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.special
from support.scenes.common import RIGID, ROAD, SHIFTED_TREAD, TREAD, WORN

import rubberfric as rf
from rubberfric.applications import contact_conductance
from rubberfric.applications.conductance import of_stiffness

ALUMINIUM = rf.Elastic(70e9, 0.34)
STEEL = rf.Elastic(210e9, 0.3)
FINE = rf.SelfAffine(1e4, 4e4, 1e6, 0.8, 1e-6)
METALS = rf.Scene(rf.Body(ALUMINIUM), rf.Body(STEEL, FINE))
LAMBDA = (237.0, 46.0)


def reduced(*solids):
    return 1 / sum((1 - one.poisson**2) / one.young for one in solids)


def test_a_circular_spot():
    """A disc of radius a: the stiffness 2 a E_r gives the resistance (1/lambda_1 + 1/lambda_2) / (4 a)."""
    a, E = 1e-4, float(reduced(ALUMINIUM, STEEL))
    rho = 1 / LAMBDA[0] + 1 / LAMBDA[1]

    def density(r):  # of the current for 1 V, times rho [Smythe, Static and Dynamic Electricity, 1968]
        return 2 / (np.pi * np.sqrt(a**2 - r**2))

    current = scipy.integrate.quad(lambda r: 2 * np.pi * r * density(r), 0, a)[0] / rho
    assert float(of_stiffness(2 * a * E, 1 / E, *LAMBDA)) == pytest.approx(current, rel=1e-8)
    assert current == pytest.approx(4 * a / rho, rel=1e-8)


def test_rough_metals():
    """h = 2 K / (E_r rho) with K from the separation by central differences in the pressure."""
    p = np.array([1e6, 1e7, 1e8])
    found = contact_conductance(METALS, p, conductivity=LAMBDA)
    step = 1e-4
    u = [np.asarray(rf.separation(METALS, 0.0, p * np.exp(k * step))) for k in (-2, -1, 1, 2)]
    slope = (u[0] - 8 * u[1] + 8 * u[2] - u[3]) / (12 * step)  # du / d ln p
    E, rho = float(reduced(ALUMINIUM, STEEL)), 1 / LAMBDA[0] + 1 / LAMBDA[1]
    np.testing.assert_allclose(found, -2 * p / slope / (E * rho), rtol=1e-8)
    # At light load the stiffness is proportional to the pressure.
    light = contact_conductance(METALS, np.array([1e4, 2e4]), conductivity=LAMBDA)
    assert float(light[1] / light[0]) == pytest.approx(2.0, rel=0.05)


def test_scaling():
    """With all moduli and the pressure times s, and all lengths times k, h is divided by k."""
    h = float(contact_conductance(METALS, 1e7, conductivity=LAMBDA))
    stiff = METALS.replace({"lower.material.young": 210e9, "upper.material.young": 630e9})
    assert float(contact_conductance(stiff, 3e7, conductivity=LAMBDA)) == pytest.approx(h, rel=1e-10)
    large = METALS.replace("upper.spectrum", rf.SelfAffine(1e3, 4e3, 1e5, 0.8, 1e-5))
    assert float(contact_conductance(large, 1e7, conductivity=LAMBDA)) == pytest.approx(h / 10, rel=1e-10)
    both = contact_conductance(METALS, 1e7, conductivity=(2 * LAMBDA[0], 2 * LAMBDA[1]))
    assert float(both) == pytest.approx(2 * h, rel=1e-12)


def test_relaxed_rubber():
    """The relaxed modulus counts: rubber at rest equals an elastic solid with its E_inf."""
    rubber = rf.Scene(rf.Body(RIGID, ROAD), rf.Body(TREAD))
    elastic = rf.Scene(rf.Body(RIGID, ROAD), rf.Body(rf.Elastic(3.6e6, 0.5)))
    one, other = (contact_conductance(scene, 1e5, conductivity=(2.0, 0.2)) for scene in (rubber, elastic))
    assert float(one) == pytest.approx(float(other), rel=1e-9)
    warm = rf.Scene(rf.Body(RIGID, ROAD), rf.Body(SHIFTED_TREAD, WORN))
    T = np.array([280.0, 320.0])  # a horizontal shift does not change the relaxed modulus
    h = contact_conductance(warm, 1e5, T, conductivity=(2.0, 0.2))
    assert float(h[0]) == pytest.approx(float(h[1]), rel=1e-9)


def test_derivatives():
    def log_h(x):
        scene = METALS.replace(
            {"lower.material.young": 70e9 * jnp.exp(x[0]), "upper.spectrum.h_rms": 1e-6 * jnp.exp(x[1])}
        )
        conductivity = (237.0 * jnp.exp(x[3]), 46.0)
        return jnp.log(contact_conductance(scene, 1e7 * jnp.exp(x[2]), conductivity=conductivity))

    slopes, step = jax.grad(log_h)(jnp.zeros(4)), 1e-4
    for i, unit in enumerate(np.eye(4)):
        around = [float(log_h(k * step * unit)) for k in (-2, -1, 1, 2)]
        difference = (around[0] - 8 * around[1] + 8 * around[2] - around[3]) / (12 * step)
        assert float(slopes[i]) == pytest.approx(difference, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"upper": rf.Body(TREAD, ROAD, rf.Slab(1e-3))}, "scene.upper.layer: must be None"),
        ({"adhesion": rf.Adhesion(0.05)}, "scene.adhesion: the conductance is not defined with adhesion"),
        ({"contact_model": "boundary_elements"}, "is not defined for 'boundary_elements'"),
        ({"upper": rf.Body(rf.Prony(0.0, [1e7], [1.0]))}, "scene.upper.material has no modulus at rest"),
    ],
)
def test_refused_scenes(change, message):
    scene = rf.Scene(rf.Body(RIGID, ROAD), rf.Body(TREAD)).replace(**change)
    with pytest.raises(ValueError, match=re.escape(message)):
        contact_conductance(scene, 1e5, conductivity=(1.0, 1.0))


@pytest.mark.parametrize(
    ("conductivity", "message"),
    [
        ((1.0,), "conductivity has 1 values: must be (lower, upper)"),
        ((1.0, 0.0), "conductivity[1] = 0.0: must be > 0"),
        ((np.nan, 1.0), "conductivity[0] = nan"),
    ],
)
def test_refused_conductivities(conductivity, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        contact_conductance(METALS, 1e7, conductivity=conductivity)
