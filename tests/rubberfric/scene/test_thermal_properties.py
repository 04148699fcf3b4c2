"""Two bodies that take up heat: what each has of the heat of contact shear, and that none of it is lost."""

import dataclasses
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy
from support.cases.stored import slow_if
from support.scenes.fits import AFFINE as ROAD

import rubberfric as rf
from rubberfric.scene.heating import diffusion, heat_kernel, heating_of, rise_below_surface, shear_shares
from rubberfric.theory.heat.balance import heat_balance, inner_temperatures
from rubberfric.theory.integrals import prepare

RUBBER = rf.ThermalProperties(1200.0, 1600.0, 0.23)
STONE = rf.ThermalProperties(2400.0, 900.0, 1.5)
STEEL = rf.ThermalProperties(7800.0, 460.0, 50.0)
HEATING = rf.Heating(1200.0, 1600.0, 0.23, 2e-3, 0.05)
SHEAR = rf.ContactShear(6.5e6, 0.1, 6e-3)


def effusivity(x):
    return np.sqrt(float(x.conductivity * x.density * x.heat_capacity))


def test_share_by_effusivity():
    lower, upper = (heating_of(HEATING, x) for x in (STONE, None))
    shares = shear_shares(lower, upper, False)
    both = effusivity(STONE) + effusivity(RUBBER)
    np.testing.assert_allclose(shares, [effusivity(STONE) / both, effusivity(RUBBER) / both], rtol=1e-14)
    assert float(sum(shares)) == pytest.approx(1, rel=1e-15)
    assert [float(x) for x in shear_shares(upper, upper, True)] == [0.5, 0.5]


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 1.0])
def test_a_given_share_leaves_the_rest_to_the_other_solid(share):
    given = heating_of(dataclasses.replace(HEATING, shear_share=share), None)
    np.testing.assert_allclose(shear_shares(given, given, True), [1 - share, share], rtol=1e-15)
    np.testing.assert_allclose(shear_shares(given, given, False), [share, share], rtol=1e-15)


@pytest.mark.parametrize(
    ("lower", "q", "hotter"),
    [(STEEL, 3e2, 10.0), (STEEL, 1e4, 3.5), (STEEL, 1e9, 1.0), (STONE, 1e9, 1.0), (RUBBER, 1e9, 0.99)],
)
def test_rise_below_the_surface_is_a_share_of_that_of_either_solid(lower, q, hotter):
    r"""Each solid has its share of the rise from all heat, which at finite q is not a harmonic sum.

    By scipy: T_i = s_i (2/pi) Q/(rho c_p) int dk (1 - exp(-D k^2 t_0))/(D k^2) 4 q^2/(k^2 + 4 q^2). At the
    surface each solid alone rises by 2 Q sqrt(t_0/pi) / effusivity; with both it is the same on either side,
    1/T = 1/T_1 + 1/T_2 [Jaeger 1942, at high Peclet number].
    """
    v, power, t0 = 1.0, 3e6, 2e-3
    bodies = heating_of(HEATING, lower), heating_of(HEATING, None)
    at = jnp.array([q])
    ready = diffusion(at, at, (at[0], at[0]), 161)
    shares = shear_shares(*bodies, True)
    np.testing.assert_allclose(shares[0] / shares[1], effusivity(lower) / effusivity(RUBBER), rtol=1e-12)
    found, alone = [], []
    for body, share in zip(bodies, shares, strict=True):
        heat = float(body.density * body.heat_capacity)
        D = float(body.conductivity) / heat

        def density(log_k, D=D):  # over ln k
            k = np.exp(log_k)
            return -np.expm1(-D * k**2 * t0) / (D * k) * 4 * q**2 / (k**2 + 4 * q**2)

        borders = np.linspace(-20.0, 40.0, 31)
        pieces = [
            scipy.integrate.quad(density, a, b, epsrel=1e-12)[0] for a, b in itertools.pairwise(borders)
        ]
        alone.append(2 / np.pi * power * v / heat * sum(pieces))
        given = share * jnp.array([power])
        found.append(float(rise_below_surface(heat_kernel(body, ready, jnp.array([v]), True), given)[0, 0]))
    np.testing.assert_allclose(found, np.array(shares) * alone, rtol=1e-7)
    # The better conductor is hotter.
    assert found[0] > hotter * found[1]
    if q > 1e7:  # The temperature at q is the mean over a depth of 1e-9 m.
        at_surface = [2 * power * v * np.sqrt(t0 / np.pi) / effusivity(x) for x in bodies]
        np.testing.assert_allclose(alone, at_surface, rtol=1e-4)
        np.testing.assert_allclose(found, 1 / sum(1 / x for x in at_surface), rtol=1e-4)


def two_rubbers(share=None):
    rubber = rf.Prony(4e6, [8e8, 9e7, 1.5e7], [1e-9, 1e-5, 1e-3], shift=rf.WLF(14.0, 100.0, 293.15))
    worn = rf.SelfAffine(300.0, 2000.0, 3e4, 0.7, 4e-5)
    heating = dataclasses.replace(HEATING, shear_share=share)
    lower, upper = rf.Body(rubber, ROAD, thermal=STONE), rf.Body(rubber, worn)
    return rf.Scene(lower, upper, shear=SHEAR, heating=heating)


HEATED = {
    "one rubber": (two_rubbers().replace(shear=None, lower=rf.Body(rf.Rigid(), ROAD)), (RUBBER,)),
    "two rubbers": (two_rubbers(), (STONE, RUBBER)),
    "share of the upper one": (two_rubbers(0.8), (STONE, RUBBER)),
}


@pytest.mark.parametrize("name", slow_if(lambda name: name == "share of the upper one", list(HEATED)))
def test_energy_is_what_friction_set_free(name):
    r"""Near the surfaces, rho c_p int dz T of all bodies add up to R mu sigma_0 / P_m.

    q -> 0 sees T_q = 2 q int dz T. This holds at any temperatures, a solution or not.
    """
    scene, bodies = HEATED[name]
    v, q = jnp.array([1e-3, 0.1, 1.0]), jnp.array([1e-13])
    points = v, jnp.full(3, 3e5), jnp.full(3, 290.0)

    @jax.jit
    def both(scene):
        ready = prepare(scene, ("friction",), rf.Quadrature(panels=4, order=6))
        mesh, thermal = ready.roughness.mesh, ready.thermal
        kernel = diffusion(mesh.q.reshape(-1), q, (q[0], mesh.last), 600)
        count = len(bodies) * thermal.diffusion.wavevector.size
        rises = jnp.linspace(2.0, 20.0, count) * jnp.ones((3, 1))
        caused = heat_balance(thermal, ready.roughness, kernel, points)(rises)
        inside, flash = inner_temperatures(thermal, mesh, rises, points[2])
        contact = ready.roughness.contact(*points[:2], inside)
        mu = sum(jnp.sum(x, (0, 2)) for x in contact.friction_terms().values())
        if scene.shear is not None:
            mu += rf.scene.interface.shear_friction(scene.shear, contact.area(), *points[:2], flash)
        return caused / (2 * q), mu

    depth, mu = both(scene)
    volume = np.array([float(x.density * x.heat_capacity) for x in bodies])
    energy = (volume * depth).sum(1)
    np.testing.assert_allclose(energy, 2e-3 * mu * 3e5 / 0.05, rtol=1e-12)
