"""Exact relations of the theory that need no reference values."""

import dataclasses

import jax
import numpy as np
import pytest
from problems import ROAD
from problems import SOFT as RUBBER
from support.cases.stored import as_arrays, slow_if, three

import rubberfric as rf
from rubberfric.theory import paper

OTHER = rf.Prony(3.6e6, np.array([1.4e8, 6.5e6]), np.array([1e-8, 1e-5]), 0.5)
STEEL = rf.Rigid()
TREAD = rf.SelfAffine(300.0, 2000.0, 4.0e5, 0.7, 4e-5)
SMOOTH = None
SLAB = rf.Slab(1e-3)

replace = dataclasses.replace
_solve = jax.jit(rf.solve)


def solve(s, v, p, *temperature):
    """Area, friction and separation; arguments of one shape, so that every structure compiles once."""
    v, p = np.broadcast_arrays(v, p)
    points = [np.resize(x.ravel().astype(float), 16) for x in (v, p)]
    found = three(_solve(*as_arrays((s, *points, *temperature))))
    return np.array([x[: v.size].reshape(v.shape) for x in found])


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

# Fields that are stresses.
STRESSES = ("E_inf", "E", "young")
# Factors of all fields of these names, of velocity and pressure, and of area, friction and separation.
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


HARDLY = replace(TREAD, h_rms=1e-14)
SMALLEST = replace(TREAD, h_rms=0.0)
STIFF = rf.Elastic(1e21, 0.3)  # so stiff that only the rubber deforms
HALF = replace(ROAD, h_rms=5e-4 / np.sqrt(2))  # half of the power of the road
DEAD = rf.Prony(3e6, np.zeros(3), np.array([1e-6, 1.0, 1.0]), 0.4)  # all moduli are 0
ALIVE = rf.Elastic(3e6, 0.4)  # the same stiffness without terms
KNOTS = np.array([100.0, 250.0, 1000.0, 9e3, 3.1e4])
ENTRIES = np.asarray(rf.power_spectrum(ROAD, KNOTS * np.array([1 + 1e-13, 1, 1, 1, 1 - 1e-13])))
# One solid in place of two elastic solids, with 1/E_r = sum of 1/E_r.
SUM = rf.Elastic(1 / ((1 - 0.4**2) / 3e6 + (1 - 0.3**2) / 2e7), 0.0)
# The spectrum C_1 + C_2 of two equal roads.
TWICE = replace(ROAD, h_rms=5e-4 * np.sqrt(2))

# A scene, another one that is nearly or exactly the same, the velocity, and the relative tolerance.
ALIKE = {
    "thick slab": (scene((RUBBER, TREAD, rf.Slab(1e3)), (STEEL, ROAD)), SCENES["one-rubber"], 0.1, 1e-12),
    "very stiff": (scene((RUBBER, TREAD), (STIFF, ROAD)), SCENES["one-rubber"], 0.1, 1e-9),
    "sum of two": (SCENES["elastic"], scene((SUM, TREAD), (STEEL, ROAD)), 0.1, 1e-12),
    "thick sliding slab": (
        scene((RUBBER, TREAD, rf.Slab(1e3, "frictionless")), (OTHER, ROAD)),
        SCENES["two-rubbers"],
        0.1,
        1e-12,
    ),
    "very stiff, on a slab": (
        scene((RUBBER, TREAD, SLAB), (STIFF, ROAD)),
        scene((RUBBER, TREAD, SLAB), (STEEL, ROAD)),
        0.1,
        1e-9,
    ),
    "equal spectra": (
        scene((SCENES["elastic"].lower.material, ROAD), (SCENES["elastic"].upper.material, ROAD)),
        scene((SUM, SMOOTH), (STEEL, TWICE)),
        0.1,
        1e-9,
    ),
    "table": (
        scene((RUBBER, TREAD), (STEEL, rf.TabulatedSpectrum(KNOTS, ENTRIES))),
        SCENES["one-rubber"],
        0.1,
        1e-9,
    ),
}
for upper in (STEEL, OTHER):
    name, smooth = ("rigid" if upper is STEEL else "rubber"), scene((RUBBER, SMOOTH), (upper, ROAD))
    for height, tread in (("no height", SMALLEST), ("hardly rough", HARDLY)):
        ALIKE |= {
            f"{height} on {name}": (scene((RUBBER, tread), (upper, ROAD)), smooth, 0.1, 1e-9),
            # The road moved to the rubber: nothing rough passes it.
            f"{height}, road moved, {name}": (
                scene((RUBBER, ROAD), (upper, tread)),
                scene((RUBBER, ROAD), (upper, SMOOTH)),
                0.1,
                1e-9,
            ),
        }
    # At rest everything depends on C_1 + C_2 only, wherever they are.
    exchanged = scene((RUBBER, TREAD), (upper, ROAD)), scene((RUBBER, ROAD), (upper, TREAD))
    ALIKE |= {f"at rest on {name}": (*exchanged, 0.0, 1e-13)}
    ALIKE |= {f"shared at rest, {name}": (scene((RUBBER, HALF), (upper, HALF)), smooth, 0.0, 1e-9)}
for name, other in (("rigid", STEEL), ("elastic", rf.Elastic(1e7, 0.3)), ("rubber", OTHER)):
    dead = (scene((material, TREAD), (other, ROAD)) for material in (DEAD, ALIVE))
    ALIKE |= {f"no relaxation on {name}": (*dead, 0.1, 1e-9)}


@pytest.mark.parametrize("name", slow_if(lambda name: name not in ("thick slab", "very stiff"), ALIKE.keys()))
def test_limits(name):
    """Friction that vanishes does so to 1e-12, a part of 1e-30 of a stiffness without relaxation to 1e-28."""
    one, other, v, rtol = ALIKE[name]
    atol = [0.0, 1e-28 if "relaxation" in name else 1e-12, 0.0]
    found, exact = solve(one, v, 3e5), solve(other, v, 3e5)
    assert (np.abs(found - exact) <= rtol * np.abs(exact) + atol).all(), (found, exact)


@pytest.mark.parametrize("s", slow_if(SLOW.__contains__, SCENES))
def test_at_rest_and_backwards(s):
    """mu is odd and 0 at rest; A and u_bar are even and meet their limit."""
    at = solve(s, np.array([0.1, -0.1, 0.0, 1e-14]), 3e5).T
    np.testing.assert_allclose(at[1], at[0] * [1, -1, 1], rtol=1e-15)
    assert at[2][1] == 0.0
    np.testing.assert_allclose(at[3][[0, 2]], at[2][[0, 2]], rtol=1e-10)


@pytest.mark.parametrize("s", slow_if(lambda name: name in ("two-slabs", "corrected"), SCENES))
def test_light_load(s):
    """A ~ load, mu independent of it, u_bar falls by the same amount every decade."""
    A, mu, u = solve(s, 0.1, np.array([1e-4, 1e-3, 1e-2]))
    np.testing.assert_allclose(A / A[0], [1, 10, 100], rtol=1e-8)
    np.testing.assert_allclose(mu, mu[0], rtol=2e-7)
    np.testing.assert_allclose(u[1] - u[0], u[2] - u[1], rtol=2e-7)
    assert u[0] > u[1] > 0


def test_full_contact():
    """At a huge load A = 1 and mu is the integral with P = S = 1, falling like 1 / load."""
    A, mu, u = solve(SCENES["smooth-rubber"], 0.1, np.array([1e10, 1e12]))
    assert (A == 1).all() and (u < 1e-100).all()
    exact = float(paper.solve(SCENES["smooth-rubber"], 0.1, 1e10).friction)
    np.testing.assert_allclose(mu, exact * np.array([1, 1e-2]), rtol=1e-10)


def test_two_roughnesses_over_velocity():
    """Moving roughness meets glass; the rubber's own meets soft rubber, dissipates nothing, costs area."""
    rough, smooth = scene((RUBBER, ROAD), (STEEL, ROAD)), SCENES["smooth-rubber"]
    v = np.array([0.0, 1e6])
    loss = 1 - solve(rough, v, 1e4)[0] / solve(smooth, v, 1e4)[0]
    # G doubles at rest, A ~ G^(-1/2); at speed G grows by (E_inf/E_glass)^2 = 7e-4.
    assert loss[0] == pytest.approx(1 - 1 / np.sqrt(2), rel=0.05) and 0 < loss[1] < 5e-4
    v = np.logspace(-4, 2, 7)
    assert (solve(SCENES["one-rubber"], v, 3e5)[1] > 0).all()
    assert (solve(SCENES["one-rubber"], v, 3e5)[1] < solve(smooth, v, 3e5)[1]).all()
    A, mu, u = solve(SCENES["two-rubbers"], np.logspace(-6, 6, 16), 3e5)
    assert (np.diff(A) < 0).all() and (np.diff(u) > 0).all() and (mu > 0).all()


@pytest.mark.slow
def test_gamma_and_S_in_G():
    """Light load: mu ~ gamma sqrt(C_0) with S outside G, sqrt(gamma C_0) with S in G; gamma = 1 is S = 1."""

    def found(gamma, corrected, height=5e-4, load=1e-4, lower=(RUBBER, SMOOTH)):
        road = replace(ROAD, h_rms=height)
        return solve(scene(lower, (STEEL, road), gamma, area_correction=corrected), 0.1, load)

    assert found(0.8, False, 2.5e-4)[1] == pytest.approx(found(0.4, False)[1], rel=1e-7)
    assert found(0.8, True, 2.5e-4)[1] == pytest.approx(found(0.2, True)[1], rel=1e-7)
    at = {"load": 3e5, "lower": (RUBBER, TREAD)}
    np.testing.assert_allclose(found(1.0, True, **at), found(1.0, False, **at), rtol=1e-9)
    with_S, without = found(0.4, True, **at), found(0.4, False, **at)
    assert with_S[0] > 1.2 * without[0] and with_S[2] == pytest.approx(without[2], rel=1e-12)


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
