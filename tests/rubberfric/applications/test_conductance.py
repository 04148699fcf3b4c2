"""Conductance from stiffness: a circular spot, closed forms of the theory, scaling, derivatives, refusals."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.special
from problems import RIGID, ROAD, SHIFTED_TREAD, TREAD, WORN
from support.oracles.numerical import derivatives

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
    (slope,) = derivatives(lambda x: rf.separation(METALS, 0.0, p * np.exp(x)), 1, 1e-4)  # du / d ln p
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

    slopes = jax.grad(log_h)(jnp.zeros(4))
    np.testing.assert_allclose(slopes, derivatives(log_h, 4, 1e-4), rtol=1e-6, atol=1e-9)


def conducted(contact, length):
    """Conductance for conductivities 1 of half-spaces that touch where `contact` is True, by its potential.

    A flux density i(q) has the potential i(q) / q. The flux that makes it constant over the contact is found
    by conjugate gradients.
    """
    wave = 2 * np.pi * np.fft.fftfreq(len(contact), length / len(contact))
    q = np.hypot(*np.meshgrid(wave, wave))
    response = np.divide(1.0, q, out=np.zeros_like(q), where=q > 0)

    def potential(flux):
        return np.fft.ifft2(np.fft.fft2(flux) * response).real

    def varying(field):
        return np.where(contact, field - field[contact].mean(), 0.0)

    flux = np.where(contact, 1 / contact.mean(), 0.0)
    left = way = -varying(potential(flux))
    while np.ptp(potential(flux)[contact]) > 1e-8 * potential(flux)[contact].mean():
        push = varying(potential(way))
        step = np.sum(left**2) / np.sum(way * push)
        flux, after = flux + step * way, left - step * push
        way, left = after + np.sum(after**2) / np.sum(left**2) * way, after
    return 1 / (2 * potential(flux)[contact].mean())


@pytest.mark.slow
@pytest.mark.parametrize(("pressure", "lowest"), [(1e6, 0.85), (3e6, 0.88)])
def test_conduction_through_boundary_elements(pressure, lowest):
    """The potential of the contact itself, their stiffness (Barber), and the theory (3 to 12 % below)."""
    solid = rf.Elastic(1e9, 0.3)
    scene = rf.Scene(rf.Body(RIGID, rf.SelfAffine(1e4, 1e4, 8e4, 0.8, 1e-6)), rf.Body(solid))
    ratios = []
    for seed in range(4):
        at = [
            rf.analysis.boundary_element(scene, 0.0, share * pressure, jax.random.key(seed), grid=256)
            for share in (0.95, 1.0, 1.05)
        ]
        found = conducted(at[1].pressure > 0, at[1].length)
        stiffness = 0.1 * pressure / (at[0].separation - at[2].separation)
        assert of_stiffness(stiffness, (1 - 0.3**2) / 1e9, 1.0, 1.0) == pytest.approx(found, rel=0.02)
        ratios.append(float(contact_conductance(scene, pressure, conductivity=(1.0, 1.0))) / found)
    print("theory over conduction", ratios)
    assert lowest < np.mean(ratios) < 1.0


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
