"""Exact relations of the theory that need no reference values."""

import jax
import numpy as np
import pytest
from problems import RIGID, ROAD, SOFT, TREAD, WORN, scene
from support.cases.stored import as_arrays, three

import rubberfric as rf
from rubberfric.theory import paper

_solve = jax.jit(rf.solve)


def solve(s, v, p, *temperature):
    """Area, friction and separation; arguments of one shape, so that every structure compiles once."""
    v, p = np.broadcast_arrays(v, p)
    points = [np.resize(x.ravel().astype(float), 16) for x in (v, p)]
    found = three(_solve(*as_arrays((s, *points, *temperature))))
    return np.array([x[: v.size].reshape(v.shape) for x in found])


SMOOTH = scene((SOFT,), (RIGID, ROAD))
ROUGH = scene((SOFT, WORN), (RIGID, ROAD))
TWO_RUBBERS = scene((SOFT, WORN), (TREAD, ROAD))
ELASTIC = scene((rf.Elastic(3e6, 0.4), WORN), (rf.Elastic(2e7, 0.3), ROAD))


def test_full_contact():
    """At a huge load A = 1 and mu is the integral with P = S = 1, falling like 1 / load."""
    A, mu, u = solve(SMOOTH, 0.1, np.array([1e10, 1e12]))
    assert (A == 1).all() and (u < 1e-100).all()
    exact = float(paper.solve(SMOOTH, 0.1, 1e10).friction)
    np.testing.assert_allclose(mu, exact * np.array([1, 1e-2]), rtol=1e-10)


def test_two_roughnesses_over_velocity():
    """Moving roughness meets glass; the rubber's own meets soft rubber, dissipates nothing, costs area."""
    rough, smooth = scene((SOFT, ROAD), (RIGID, ROAD)), SMOOTH
    v = np.array([0.0, 1e6])
    loss = 1 - solve(rough, v, 1e4)[0] / solve(smooth, v, 1e4)[0]
    # G doubles at rest, A ~ G^(-1/2); at speed G grows by (E_inf/E_glass)^2 = 7e-4.
    assert loss[0] == pytest.approx(1 - 1 / np.sqrt(2), rel=0.05) and 0 < loss[1] < 5e-4
    v = np.logspace(-4, 2, 7)
    assert (solve(ROUGH, v, 3e5)[1] > 0).all()
    assert (solve(ROUGH, v, 3e5)[1] < solve(smooth, v, 3e5)[1]).all()
    A, mu, u = solve(TWO_RUBBERS, np.logspace(-6, 6, 16), 3e5)
    assert (np.diff(A) < 0).all() and (np.diff(u) > 0).all() and (mu > 0).all()


@pytest.mark.slow
def test_gamma_and_S_in_G():
    """Light load: mu ~ gamma sqrt(C_0) with S outside G, sqrt(gamma C_0) with S in G."""

    def found(gamma, corrected, height=5e-4, load=1e-4, lower=(SOFT,)):
        road = ROAD.replace(h_rms=height)
        return solve(scene(lower, (RIGID, road), gamma=gamma, area_correction=corrected), 0.1, load)

    assert found(0.8, False, 2.5e-4)[1] == pytest.approx(found(0.4, False)[1], rel=1e-7)
    assert found(0.8, True, 2.5e-4)[1] == pytest.approx(found(0.2, True)[1], rel=1e-7)
    at = {"load": 3e5, "lower": (SOFT, WORN)}
    with_S, without = found(0.4, True, **at), found(0.4, False, **at)
    assert with_S[0] > 1.2 * without[0] and with_S[2] == pytest.approx(without[2], rel=1e-12)


def test_no_friction_without_moving_roughness():
    """Cases II and III, and elastic solids: zero and exactly zero, so is every derivative."""
    for s in (scene((SOFT, WORN), (RIGID,)), scene((SOFT, WORN), (rf.Elastic(1e7, 0.3),)), ELASTIC):
        mu, slopes = jax.jit(jax.value_and_grad(rf.friction))(as_arrays(s), 0.1, 3e5)
        assert mu == 0.0
        assert all((x == 0).all() for x in jax.tree.leaves(slopes))


def test_full_contact_of_smooth_solids_and_of_liquids_at_rest():
    """C = 0, by no spectrum and by no height; E_inf = 0 flows into every valley, under any other solid."""
    liquid = SOFT.replace(E_inf=0.0)
    flat = [
        scene((SOFT,), (upper, spectrum))
        for upper in (RIGID, TREAD)
        for spectrum in (None, ROAD.replace(h_rms=0.0))
    ]
    at_rest = [scene((liquid, WORN), (upper, ROAD)) for upper in (RIGID, TREAD, liquid)]
    for s, v in [(s, 0.1) for s in flat] + [(s, 0.0) for s in at_rest]:
        assert solve(s, v, 3e5).tolist() == [1, 0, 0]


@pytest.mark.parametrize("corrected", [False, True])
@pytest.mark.parametrize("gamma", [0.3, 0.5, 1.0])
def test_area_per_load(corrected, gamma):
    """A/A0 = kappa sigma_0 / (E_r h'): kappa = sqrt(8/pi), or sqrt(8/(pi gamma)) with S in G."""
    s = scene((rf.Elastic(3e6, 0.4),), (RIGID, ROAD), gamma=gamma, area_correction=corrected)
    kappa = solve(s, 0.0, 1e-3)[0] / 1e-3 * 3e6 / (1 - 0.4**2) * float(rf.rms_slope(ROAD))
    assert kappa == pytest.approx(np.sqrt(8 / (np.pi * (gamma if corrected else 1))), rel=1e-8)


@pytest.mark.slow
def test_a_roughness_that_begins_at_a_border_of_the_others():
    """An ulp from the middle of the range; the contact is lost within A^2 = 1e-12 of it: by differences."""
    road = rf.SelfAffine(1e6, 1e6, 3e6, 0.8, 1e-7)
    tread = rf.Prony(1.0, [1.0, 1.0, 1e3], [1.0, 1.0, 1.0])

    @jax.jit
    def friction(q0):
        rough = rf.SelfAffine(q0, 2828427.1247461904, 4e6, 0.8, 1.0)
        return rf.friction(rf.Scene(rf.Body(tread, road), rf.Body(rf.Elastic(1e3, 0.5), rough)), 1.0, 1e3)

    slope = 2e6 * float(jax.jit(jax.grad(friction))(2e6))
    difference = (friction(2e6 * (1 + 1e-5)) - friction(2e6 * (1 - 1e-5))) / 2e-5
    assert slope == pytest.approx(float(difference), rel=1e-7)
