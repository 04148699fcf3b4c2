"""Exact relations of the theory that need no reference values."""

import dataclasses

import jax
import numpy as np
import pytest
from support.cases.stored import as_arrays, slow_if, three
from support.scenes.common import ROAD
from support.scenes.common import SOFT as RUBBER

import rubberfric as rf

OTHER = rf.Prony(3.6e6, np.array([1.4e8, 6.5e6]), np.array([1e-8, 1e-5]), 0.5)
STEEL = rf.Rigid()
TREAD = rf.SelfAffine(300.0, 2000.0, 4.0e5, 0.7, 4e-5)
SMOOTH = None
SLAB = rf.Slab(1e-3)

replace = dataclasses.replace
_solve = jax.jit(rf.solve)


def solve(s, v, p):
    """Area, friction and separation; arguments of one shape, so that every structure compiles once."""
    v, p = np.broadcast_arrays(v, p)
    points = [np.resize(x.ravel().astype(float), 16) for x in (v, p)]
    return np.array([x[: v.size].reshape(v.shape) for x in three(_solve(*as_arrays((s, *points))))])


def scene(lower, upper, gamma=0.5, **options):
    """Scene from (material, spectrum[, layer]) of each solid."""
    return rf.Scene(rf.Body(*lower), rf.Body(*upper), gamma, **options)


SCENES = {
    "smooth-rubber": scene((RUBBER, SMOOTH), (STEEL, ROAD)),
    "one-rubber": scene((RUBBER, TREAD), (STEEL, ROAD)),
    "two-rubbers": scene((RUBBER, TREAD), (OTHER, ROAD)),
    "two-slabs": scene((RUBBER, TREAD, SLAB), (OTHER, ROAD, rf.Slab(3e-4))),
    "elastic": scene((rf.Elastic(3e6, 0.4), TREAD), (rf.Elastic(2e7, 0.3), ROAD)),
    "corrected": scene((RUBBER, TREAD), (STEEL, ROAD), area_correction=True),
}
SLOW = ("elastic", "two-slabs", "corrected")

# Factors of all fields of these names, of velocity and pressure, and of area, friction and separation.
STRESSES = ("E_inf", "E", "young")
GROUPS = {
    "stiffness over pressure": (dict.fromkeys(STRESSES, 7.0), 1.0, 7.0, (1, 1, 1)),
    "softness over pressure": (dict.fromkeys(STRESSES, 1e-3), 1.0, 1e-3, (1, 1, 1)),
    "height over pressure": ({"h_rms": 7.0}, 1.0, 7.0, (1, 7, 7)),
    "all lengths": (
        {"h_rms": 7.0, "thickness": 7.0, **dict.fromkeys(("q0", "qr", "q1"), 1 / 7)},
        7.0,
        1.0,
        (1, 1, 7),
    ),
    "time over velocity": ({"tau": 7.0}, 1 / 7, 1.0, (1, 1, 1)),
}


@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("s", slow_if(SLOW.__contains__, SCENES))
def test_exact_groups(s, group):
    """At any load."""
    fields, v, p, factors = GROUPS[group]

    def scaled(path, x):
        return x * fields.get(getattr(path[-1], "name", None), 1.0)

    found = solve(jax.tree.map_with_path(scaled, s), 0.1 * v, 3e5 * p)
    np.testing.assert_allclose(found, solve(s, 0.1, 3e5) * factors, rtol=1e-11)


@pytest.mark.parametrize("name", ["smooth-rubber", "two-rubbers"])
def test_solids_exchanged(name):
    """Case IV is Case I with the solids exchanged; so is every other scene."""
    s, v = SCENES[name], np.array([0.0, 1e-3, 10.0])
    found = solve(replace(s, lower=s.upper, upper=s.lower), v, 3e5)
    np.testing.assert_allclose(found, solve(s, v, 3e5), rtol=1e-13)


def test_no_friction_without_moving_roughness():
    """Cases II and III, and elastic solids: zero and exactly zero, so is every derivative."""
    for s in (
        scene((RUBBER, TREAD), (STEEL, SMOOTH)),
        scene((RUBBER, TREAD), (rf.Elastic(1e7, 0.3), SMOOTH)),
        SCENES["elastic"],
    ):
        mu, slopes = jax.jit(jax.value_and_grad(rf.friction))(as_arrays(s), 0.1, 3e5)
        assert mu == 0.0
        assert all((x == 0).all() for x in jax.tree.leaves(slopes))


def test_full_contact_of_smooth_solids_and_of_liquids_at_rest():
    """C = 0, by no spectrum and by no height; E_inf = 0 flows into every valley, under any other solid."""
    liquid = replace(RUBBER, E_inf=0.0)
    flat = [
        scene((RUBBER, SMOOTH), (upper, spectrum))
        for upper in (STEEL, OTHER)
        for spectrum in (SMOOTH, replace(ROAD, h_rms=0.0))
    ]
    at_rest = [scene((liquid, TREAD), (upper, ROAD)) for upper in (STEEL, OTHER, liquid)]
    for s, v in [(s, 0.1) for s in flat] + [(s, 0.0) for s in at_rest]:
        assert solve(s, v, 3e5).tolist() == [1, 0, 0]


@pytest.mark.parametrize("corrected", [False, True])
@pytest.mark.parametrize("gamma", [0.3, 0.5, 1.0])
def test_area_per_load(corrected, gamma):
    """A/A0 = kappa sigma_0 / (E_r h'): kappa = sqrt(8/pi), or sqrt(8/(pi gamma)) with S in G."""
    s = scene((rf.Elastic(3e6, 0.4), SMOOTH), (STEEL, ROAD), gamma, area_correction=corrected)
    kappa = solve(s, 0.0, 1e-3)[0] / 1e-3 * 3e6 / (1 - 0.4**2) * float(rf.rms_slope(ROAD))
    assert kappa == pytest.approx(np.sqrt(8 / (np.pi * (gamma if corrected else 1))), rel=1e-8)


@pytest.mark.parametrize("name", ["one-rubber", pytest.param("two-slabs", marks=pytest.mark.slow)])
def test_vmap_is_loop_is_broadcast(name):
    s = SCENES[name]
    v, p = np.array([1e-3, 0.1, 10.0]), np.array([1e4, 3e5, 2e6])
    loop = np.array([solve(s, *point) for point in zip(v, p, strict=True)]).T
    mapped = jax.jit(jax.vmap(rf.solve, (None, 0, 0)))(s, v, p)
    np.testing.assert_allclose(np.array(three(mapped)), loop, rtol=1e-13)
    grid = jax.jit(rf.solve)(s, v[:, None], p)
    assert grid.area.shape == (3, 3)
    np.testing.assert_allclose(np.array(three(grid))[:, [0, 1, 2], [0, 1, 2]], loop, rtol=1e-13)
