"""Stresses, separations, stiffness and power of the interface, by quadrature and brute force."""

import functools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from support.cases.cut import CASES, ELASTIC, ROAD, RUBBER, SMOOTH, TYRE, by_paper, case, cut, ordinary

import rubberfric as rf
from rubberfric.analysis.interface import _stress_density

node, weight = np.polynomial.legendre.leggauss(24)


@pytest.mark.parametrize("G", [1e-30, 1e-12, 1e-3, 0.2, 1.0, 40.0, 1e9, 1e30])
def test_stress_density_in_50_digits(G):
    p = 2e5
    near = p * (1 + 2 * np.sqrt(G) * np.array([-2.0, -0.3, 0.0, 0.7, 3.0]))
    s = np.concatenate([near[near > 0], p * np.array([1e-30, 1e-12, 1e-3, 1.0, 50.0, 1e16])])
    with mp.workdps(80):
        g = mp.mpf(G) * mp.mpf(p) ** 2
        both = [[mp.e ** (-((mp.mpf(x) + sign * mp.mpf(p)) ** 2) / (4 * g)) for sign in (-1, 1)] for x in s]
        wanted = np.array([float((a - b) / mp.sqrt(4 * mp.pi * g)) for a, b in both])
    found = jax.jit(_stress_density)(s, p, np.full(s.shape, G))
    # s / p - 1 has no more digits, and the exponent multiplies them.
    rtol = 1e-13 + 1e-15 / np.sqrt(G)
    np.testing.assert_allclose(found, wanted, rtol=rtol, atol=1e-300)
    derivatives = jax.jit(jax.vmap(jax.grad(_stress_density, (0, 1, 2)), (0, None, None)))(s, p, G)
    assert all(np.isfinite(x).all() for x in derivatives)


def test_stress_density_of_no_roughness_and_of_tension():
    density = jax.jit(_stress_density)
    assert not np.any(density(np.array([-1.0, 0.0, 1.0, 3.0]), 2.0, np.zeros(4)))
    assert not np.any(density(np.array([-1e9, -1e-9, 0.0, 0.0]), 2.0, np.ones(4)))
    assert np.isfinite(jax.jit(jax.grad(_stress_density, (0, 1, 2)))(1.0, 2.0, 0.0)).all()


@pytest.mark.parametrize("pressure", [1e3, 2e5, 3e8])
@pytest.mark.parametrize("q", [400.0, pytest.param(None, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_stresses_add_up_to_the_area_and_the_load(pressure, q):
    scene, v, _ = CASES["S in G"]
    found = rf.analysis.profile(scene, v, pressure, q=[3.1e4 if q is None else q])
    width = 2 * pressure * np.sqrt(float(found.fluctuation[0]))
    low, high = max(0.0, pressure - 28 * width), pressure + 28 * width
    edges = np.linspace(low, high, 61)
    s = edges[:-1, None] + np.diff(edges)[:, None] * 0.5 * (1 + node)
    measure = np.diff(edges)[:, None] * 0.5 * weight
    density = rf.analysis.stress_distribution(scene, s, v, pressure, q=q)
    assert np.sum(measure * density) == pytest.approx(float(found.area[0]), rel=1e-9)
    assert np.sum(measure * s * density) == pytest.approx(pressure, rel=1e-9)
    if q is None:
        assert found.area[0] == pytest.approx(float(rf.contact_area(scene, v, pressure)), rel=1e-9)


def test_stresses_broadcast_and_check():
    scene, v, p = TYRE
    shape = rf.analysis.stress_distribution(scene, np.ones((5, 1, 1)), np.ones(3), np.ones((2, 1))).shape
    assert shape == (5, 2, 3)
    with pytest.raises(ValueError, match=r"^stress\[1\] = nan: must be finite$"):
        rf.analysis.stress_distribution(scene, [1.0, np.nan], v, p)


@pytest.mark.parametrize("name", ordinary("S in G"))
def test_contact_stiffness(name):
    """The paper's plain G in the separation, with S in the G of the area or without."""
    scene, v, p = CASES[name]
    found = float(rf.analysis.contact_stiffness(scene, v, p))
    assert found == pytest.approx(-1 / float(jax.jit(jax.grad(rf.separation, 2))(scene, v, p)), rel=1e-8)


@pytest.mark.slow
def test_stiffness_of_full_contact_and_of_light_load():
    scene, v, _ = TYRE
    assert (rf.analysis.contact_stiffness(SMOOTH, np.ones(2), 1e5) == np.inf).all()
    full = rf.analysis.contact_stiffness(scene, v, np.array([1e12, 1e30]))
    assert (full > 1e100).all()
    assert np.isfinite(jax.jit(jax.grad(rf.analysis.contact_stiffness, 2))(scene, v, 1e30))
    light = rf.analysis.contact_stiffness(scene, v, np.array([1e-3, 2e-3]))
    assert light[1] / light[0] == pytest.approx(2.0, rel=1e-6)  # u_bar ~ -ln(pressure)


@pytest.mark.parametrize("name", ordinary("tyre"))
def test_power_adds_up_to_the_friction(name):
    scene, v, p = CASES[name]
    found = rf.analysis.dissipated_power(scene, v, p)
    total = float(rf.friction(scene, v, p)) * p * v
    assert found.total == pytest.approx(total, rel=1e-13, abs=1e-300)
    assert found.lower + found.upper + found.shear == pytest.approx(float(found.total), rel=1e-15)
    assert min(found) >= 0 and found.shear == 0


@pytest.mark.slow
def test_power_goes_to_the_solid_that_is_strained():
    pairs = (RUBBER, RUBBER), (RUBBER, ELASTIC), (ELASTIC, RUBBER)
    both, one, other = (case((lower, ROAD), (upper, ROAD))[0] for lower, upper in pairs)
    shear = rf.ContactShear(6.5e6, 0.1, 6e-3)
    v, p = np.array([1e-2, -1e-2]), 2e5
    found = rf.analysis.dissipated_power(both, v, p)
    np.testing.assert_allclose(found.lower, found.upper, rtol=1e-13)
    assert (found.lower > 0).all() and found.total[0] == pytest.approx(float(found.total[1]), rel=1e-13)
    found = rf.analysis.dissipated_power(one, v, p)
    assert (found.lower > 0).all() and not np.any(found.upper)
    np.testing.assert_allclose(rf.analysis.dissipated_power(other, v, p).upper, found.lower, rtol=1e-13)
    sheared = rf.Scene(one.lower, one.upper, one.gamma, shear=shear)
    found = rf.analysis.dissipated_power(sheared, v, p)
    parts = rf.solve(sheared, v, p, quantities=("shear_friction", "friction"))
    np.testing.assert_allclose(found.shear, parts.shear_friction * p * v, rtol=1e-13)
    np.testing.assert_allclose(found.total, parts.friction * p * v, rtol=1e-13)
    smooth = rf.Scene(rf.Body(one.lower.material), rf.Body(rf.Rigid()), shear=shear)
    found = rf.analysis.dissipated_power(smooth, v, p)
    np.testing.assert_allclose(found.total, rf.friction(smooth, v, p) * p * v, rtol=1e-13)


@functools.cache
def separations(name, edges):
    """A separation profile at Gauss nodes between the edges (in t = ln(q/q0)), and at the edges."""
    edges = np.array(edges)
    t = edges[:-1, None] + np.diff(edges)[:, None] * 0.5 * (1 + node)
    q = np.minimum(100.0 * np.exp(np.concatenate([edges, t.ravel()])), 3.1e4)
    scene, v, p = CASES[name]
    return t, q, rf.analysis.separation_profile(scene, v, p, q=q), rf.analysis.profile(scene, v, p, q=q)


def lost_area(edges, G):
    """-dP/dt from ln G at Gauss nodes by Legendre differentiation: relative accuracy where P = 1."""
    legendre = np.polynomial.legendre
    slope = np.zeros_like(G)
    for k, row in enumerate(np.log(G)):
        fit = legendre.legfit(node, row, node.size - 1)
        slope[k] = legendre.legval(node, legendre.legder(fit)) * 2 / (edges[k + 1] - edges[k])
    return np.exp(-0.25 / G) / (2 * np.sqrt(np.pi * G)) * slope


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tyre", "layer"])
def test_separations_add_up_to_the_mean(name):
    """int u1 (-dP) = u_bar P at the first q."""
    edges = (*np.log([2.0, 4.0, 7.0, 10.0]), *np.linspace(3.0, np.log(310.0), 5))
    t, _, found, contact = separations(name, edges)
    n = len(edges)
    G = np.asarray(contact.fluctuation[n:]).reshape(t.shape)
    u1 = np.asarray(found.separation[n:]).reshape(t.shape)
    measure = 0.5 * np.diff(edges)[:, None] * weight
    total = np.sum(measure * u1 * lost_area(edges, G))
    # At q1 no roughness is left: the remaining contact area has no separation.
    assert found.contact_separation[n - 1] == 0
    assert total == pytest.approx(float(found.contact_separation[0] * found.area[0]), rel=1e-8)
    assert (np.diff(u1.ravel()) < 0).all()


@pytest.mark.parametrize("name", ordinary())
def test_separation_within_the_contact_of_each_scale(name):
    """u_bar(q) is the separation from roughness beyond q alone, at the pressure sigma_0 / P(q)."""
    scene, v, p = CASES[name]
    q = np.array([150.0, 1000.0, 9e3])
    found = rf.analysis.separation_profile(scene, v, p, q=q)
    for i in range(q.size):
        plain = rf.analysis.profile(scene.replace(area_correction=False), v, p, q=q)
        assert found.area[i] == pytest.approx(float(plain.area[i]), rel=1e-12)
        known = by_paper(cut(scene, q[i], "above"), v, p / found.area[i])
        assert found.contact_separation[i] == pytest.approx(float(known.separation), rel=2e-8)


@pytest.mark.slow
def test_separation_profile_ends():
    scene, v, p = TYRE
    found = rf.analysis.separation_profile(scene, v, np.array([p, p]), q=[50.0, 100.0, 3.1e4, 1e5])
    assert found.separation.shape == (2, 4)
    whole = float(rf.separation(scene, v, p))
    np.testing.assert_allclose(found.contact_separation[:, :2], whole, rtol=1e-9)
    assert not np.any(found.contact_separation[:, 2:]) and not np.any(found.separation[:, 2:])
    assert (found.separation[:, 0] == np.inf).all() and (found.area[:, 0] == 1).all()
    assert not np.any(rf.analysis.separation_profile(SMOOTH, v, p, q=[1.0]).separation)
    with pytest.raises(ValueError, match=r"^q is None, but the scene has no roughness; give wavevectors$"):
        rf.analysis.separation_profile(SMOOTH, v, p)


@pytest.mark.slow
def test_derivatives_of_the_separation_profile_agree():
    coarse = rf.Quadrature(order=8, panels=4, graded=3, angular_order=8)
    arguments = jax.tree.map(lambda x: jnp.asarray(x, float), TYRE)

    def fields(scene, v, p):
        found = rf.analysis.separation_profile(scene, v, p, q=jnp.array([600.0, 5e3]), quadrature=coarse)
        return jnp.stack([found.contact_separation, found.separation])

    forward, reverse = (jax.jit(j(fields, (0, 1, 2)))(*arguments) for j in (jax.jacfwd, jax.jacrev))
    for one, other in zip(jax.tree.leaves(forward), jax.tree.leaves(reverse), strict=True):
        assert np.isfinite(one).all()
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-11 * np.max(np.abs(one)))
