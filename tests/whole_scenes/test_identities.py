"""Exact relations of the theory that need no reference values."""

import collections
import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.cases.stored import QUANTITIES, as_arrays, slow_if, three
from support.oracles import oracle
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
Values = collections.namedtuple("Values", QUANTITIES)


def solve(s, v, p, *temperature):
    """rf.solve with arguments of one shape and type, so that every structure of scene compiles once."""
    v, p = np.broadcast_arrays(v, p)
    points = [np.resize(x.ravel().astype(float), 16) for x in (v, p)]
    found = _solve(*as_arrays((s, *points, *temperature)))
    return Values(*(np.array(x)[: v.size].reshape(v.shape) for x in three(found)))


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
all_scenes = pytest.mark.parametrize("s", slow_if(SLOW.__contains__, SCENES))


def assert_same(a, b, rtol=1e-9, factors=(1.0, 1.0, 1.0), atol=0.0):
    """Two solutions agree, the second multiplied by the factors of (area, friction, separation)."""
    np.testing.assert_allclose(
        np.array(a), np.array(b) * np.reshape(factors, (3,) + (1,) * np.ndim(b[0])), rtol=rtol, atol=atol
    )


def with_material(s, change):
    def body(b):
        return b if isinstance(b.material, rf.Rigid) else replace(b, material=change(b.material))

    return replace(s, lower=body(s.lower), upper=body(s.upper))


def with_spectrum(s, change):
    def body(b):
        return b if b.spectrum is None else replace(b, spectrum=change(b.spectrum))

    return replace(s, lower=body(s.lower), upper=body(s.upper))


def times(obj, factor, *names):
    return replace(obj, **{name: getattr(obj, name) * factor for name in names if hasattr(obj, name)})


# Exact groups: at any load.


@all_scenes
@pytest.mark.parametrize("factor", [1e-3, 7.0])
def test_stiffness_over_pressure(s, factor):
    """(E, sigma_0) -> l (E, sigma_0) changes nothing."""
    stiffer = with_material(s, lambda m: times(m, factor, "E_inf", "E", "young"))
    assert_same(solve(stiffer, 0.1, 3e5 * factor), solve(s, 0.1, 3e5), 1e-12)


@all_scenes
def test_height_over_pressure(s):
    """h -> l h, sigma_0 -> l sigma_0 leaves A and multiplies mu and u_bar by l."""
    higher = with_spectrum(s, lambda c: times(c, 7.0, "h_rms"))
    assert_same(solve(higher, 0.1, 3e5 * 7), solve(s, 0.1, 3e5), 1e-12, (1, 7, 7))


@all_scenes
def test_all_lengths(s):
    """All lengths and v -> l (...) leaves A and mu and multiplies u_bar by l."""
    larger = with_spectrum(s, lambda c: times(times(c, 1 / 7, "q0", "qr", "q1"), 7.0, "h_rms"))
    for name in ("lower", "upper"):
        body = getattr(larger, name)
        if body.layer is not None:
            larger = replace(larger, **{name: replace(body, layer=times(body.layer, 7.0, "thickness"))})
    assert_same(solve(larger, 0.7, 3e5), solve(s, 0.1, 3e5), 1e-11, (1, 1, 7))


@all_scenes
def test_time_over_velocity(s):
    slower = with_material(s, lambda m: times(m, 7.0, "tau"))
    assert_same(solve(slower, 0.1 / 7, 3e5), solve(s, 0.1, 3e5), 1e-12)


@pytest.mark.slow
def test_temperature_moves_the_velocity():
    """With one shift for all, T acts through v a_T alone; without T the reference temperature holds."""
    law = rf.WLF(8.86, 101.6, 293.15)
    plain = SCENES["two-rubbers"]
    shifted = with_material(plain, lambda m: replace(m, shift=law))
    for T in (280.0, 293.15, 330.0):
        a_T = np.exp(float(law.log_factor(T)))
        assert_same(solve(shifted, 0.1, 3e5, T), solve(plain, 0.1 * a_T, 3e5), 1e-12)
    assert_same(solve(shifted, 0.1, 3e5), solve(plain, 0.1, 3e5), 1e-12)


# Which solid is which.


@pytest.mark.parametrize("v", [0.0, 1e-3, 10.0])
def test_solids_exchanged(v):
    """Case IV is Case I with the solids exchanged; so is every other scene."""
    for name in ("smooth-rubber", "two-rubbers"):
        s = SCENES[name]
        assert_same(solve(replace(s, lower=s.upper, upper=s.lower), v, 3e5), solve(s, v, 3e5), 1e-13)


@all_scenes
def test_odd_in_velocity(s):
    forth, back = solve(s, 0.1, 3e5), solve(s, -0.1, 3e5)
    assert_same(back, forth, 1e-15, (1, -1, 1))


@all_scenes
def test_no_friction_at_rest(s):
    """mu(0) = 0 exactly, and A, u_bar meet their limit."""
    rest = solve(s, 0.0, 3e5)
    assert rest.friction == 0.0
    slow = solve(s, 1e-14, 3e5)
    np.testing.assert_allclose([slow.area, slow.separation], [rest.area, rest.separation], rtol=1e-10)


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


# One solid or surface that hardly is one.


@pytest.mark.parametrize("h", [0.0, 1e-14])
@pytest.mark.parametrize("rigid", [True, False])
@pytest.mark.slow
def test_hardly_rough_is_smooth(h, rigid):
    upper = STEEL if rigid else OTHER
    hardly = replace(TREAD, h_rms=h)
    assert_same(
        solve(scene((RUBBER, hardly), (upper, ROAD)), 0.1, 3e5),
        solve(scene((RUBBER, SMOOTH), (upper, ROAD)), 0.1, 3e5),
    )
    # The road moved to the rubber: nothing rough passes it.
    a = solve(scene((RUBBER, ROAD), (upper, hardly)), 0.1, 3e5)
    b = solve(scene((RUBBER, ROAD), (upper, SMOOTH)), 0.1, 3e5)
    np.testing.assert_allclose([a.area, a.separation], [b.area, b.separation], rtol=1e-9)
    np.testing.assert_allclose(a.friction, b.friction, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("layer", [None, pytest.param(SLAB, marks=pytest.mark.slow)])
def test_very_stiff_is_rigid(layer):
    rigid = scene((RUBBER, TREAD, layer), (STEEL, ROAD))
    stiff = scene((RUBBER, TREAD, layer), (rf.Elastic(1e21, 0.3), ROAD))
    assert_same(solve(stiff, 0.1, 3e5), solve(rigid, 0.1, 3e5))


@pytest.mark.parametrize(
    ("upper", "base"), [(STEEL, "bonded"), pytest.param(OTHER, "frictionless", marks=pytest.mark.slow)]
)
def test_thick_slab_is_half_space(upper, base):
    slab = scene((RUBBER, TREAD, rf.Slab(1e3, base)), (upper, ROAD))
    assert_same(solve(slab, 0.1, 3e5), solve(scene((RUBBER, TREAD), (upper, ROAD)), 0.1, 3e5), 1e-12)


@pytest.mark.slow
def test_no_relaxation_is_elastic():
    """All E_i = 0: values of the elastic solid, through the closed forms of the viscoelastic one."""
    dead = rf.Prony(3e6, np.zeros(3), np.array([1e-6, 1.0, 1.0]), 0.4)
    elastic = rf.Elastic(3e6, 0.4)
    for upper in ((STEEL, ROAD), (rf.Elastic(1e7, 0.3), ROAD), (OTHER, ROAD)):
        one, other = (solve(scene((material, TREAD), upper), 0.1, 3e5) for material in (dead, elastic))
        # A part of 1e-30 of the stiffness may still relax.
        assert_same(one, other, atol=1e-28)


def zero_term_scene(kind, E, tau):
    """Scenes in which a series is solved for; E and tau are of one of its solids."""
    soft = rf.Prony(4e6, E, tau, 0.45)
    lower, upper = {
        "spring": ((rf.Elastic(1e9, 0.3), ROAD), (soft,)),
        "slab": ((rf.Elastic(1e9, 0.3), ROAD), (soft, None, rf.Slab(1e-4))),
        "two": ((OTHER, ROAD), (soft,)),
        "coating": ((STEEL, ROAD), (soft, None, rf.Coating(1e-4, OTHER))),
        "base": ((STEEL, ROAD), (OTHER, None, rf.Coating(1e-4, soft))),
        "bulk": ((STEEL, ROAD), (rf.PronyShear(4e6, E, tau, 2e9),)),
    }[kind]
    return scene(lower, upper)


@pytest.mark.slow  # the series itself is in materials/test_series.py
@pytest.mark.parametrize("kind", ["spring", "slab", "two", "coating", "base", "bulk"])
def test_a_term_of_no_modulus_is_no_term(kind):
    """Whatever its time is, at velocities whose friction is 1e-24 and 1e-3: values and derivatives."""
    v, E, tau = np.array([1e-25, 1e-2]), np.array([8e8, 9e7]), np.array([1e-9, 1e-5])
    small = rf.Quadrature(order=8, panels=3, graded=1, angular_order=8)

    @jax.jit
    def both(E, tau):
        def friction(E):
            mu = rf.friction(zero_term_scene(kind, E, tau), v, 1e5, quadrature=small)
            return mu, mu

        slope, mu = jax.jacrev(friction, has_aux=True)(E)
        return mu, slope

    mu, slope = both(E, tau)
    for long in (1e-20, 1e-5, 1.0, 1e20):
        found, slopes = both(np.append(E, 0.0), np.append(tau, long))
        np.testing.assert_allclose(found, mu, rtol=1e-12)
        np.testing.assert_allclose(slopes[:, :2], slope, rtol=1e-11)
        # The derivative goes on from E > 0: no smaller than what moves the friction by a millionth.
        step = 1e-6 * mu / np.maximum(np.abs(slopes[:, 2]), 1e-300)
        for i in range(2):
            moved = both(np.append(E, min(step[i], 1.0)), np.append(tau, long))[1]
            np.testing.assert_allclose(moved[i, 2], slopes[i, 2], rtol=1e-4)


@pytest.mark.slow
def test_derivatives_by_poisson_of_a_very_thin_slab():
    """d ln Q / d nu of a bonded slab at nu = 1/2 falls as its thickness, in both modes."""

    def found(poisson, thickness):
        slab = rf.Body(rf.Elastic(1e7, poisson), ROAD, rf.Slab(thickness))
        return jnp.stack(three(rf.solve(rf.Scene(slab, rf.Body(OTHER)), 0.1, 1e5)))

    slopes = [
        jax.jit(mode(found))(0.5, d) / d for mode in (jax.jacfwd, jax.jacrev) for d in (1e-7, 1e-9, 6e-10)
    ]
    np.testing.assert_allclose(slopes[3:], slopes[:3], rtol=1e-11)
    np.testing.assert_allclose(slopes[:3], np.broadcast_to(slopes[2], (3, 3)), rtol=1e-4)


def test_surface_mapping():
    """Two elastic solids are one with 1/E_r = sum of 1/E_r and the spectra C_1 + C_2."""
    s = SCENES["elastic"]
    reduced = [b.material.young / (1 - b.material.poisson**2) for b in (s.lower, s.upper)]
    one = rf.Elastic(1 / (1 / reduced[0] + 1 / reduced[1]), 0.0)
    mapped = solve(scene((one, TREAD), (STEEL, ROAD)), 0.1, 3e5)
    assert_same(solve(s, 0.1, 3e5), mapped, 1e-12)
    # Equal spectra on both sides add up to one of sqrt(2) the height.
    twice = solve(scene((s.lower.material, ROAD), (s.upper.material, ROAD)), 0.1, 3e5)
    sum_of_both = replace(ROAD, h_rms=5e-4 * np.sqrt(2))
    assert_same(twice, solve(scene((one, SMOOTH), (STEEL, sum_of_both)), 0.1, 3e5))


@pytest.mark.slow
def test_table_is_self_affine():
    """A spectrum given by its values at the kinks is the same spectrum."""
    q = np.array([100.0, 250.0, 1000.0, 9e3, 3.1e4])
    C = np.asarray(rf.power_spectrum(ROAD, q * np.array([1 + 1e-13, 1, 1, 1, 1 - 1e-13])))
    table = rf.TabulatedSpectrum(q, C)
    assert_same(
        solve(scene((RUBBER, TREAD), (STEEL, table)), 0.1, 3e5), solve(SCENES["one-rubber"], 0.1, 3e5)
    )


def test_smooth_is_full_contact():
    """C = 0, by no spectrum and by no height: A = 1, mu = 0, u_bar = 0."""
    flat = replace(ROAD, h_rms=0.0)
    for upper in (STEEL, OTHER):
        for spectrum in (SMOOTH, flat):
            assert [float(x) for x in solve(scene((RUBBER, SMOOTH), (upper, spectrum)), 0.1, 3e5)] == [
                1,
                0,
                0,
            ]


def test_liquid_at_rest():
    """E_inf = 0 flows into every valley, under any other solid."""
    liquid = replace(RUBBER, E_inf=0.0)
    for upper in (STEEL, OTHER, liquid):
        assert [float(x) for x in solve(scene((liquid, TREAD), (upper, ROAD)), 0.0, 3e5)] == [1, 0, 0]


# Light and huge loads.


@pytest.mark.parametrize(
    "name",
    ["smooth-rubber", "one-rubber", "two-rubbers"]
    + [pytest.param(name, marks=pytest.mark.slow) for name in ("two-slabs", "corrected")],
)
def test_light_load(name):
    """A ~ load, mu independent of it, u_bar falls by the same amount every decade."""
    A, mu, u = solve(SCENES[name], 0.1, np.array([1e-4, 1e-3, 1e-2]))
    np.testing.assert_allclose(A / A[0], [1, 10, 100], rtol=1e-8)
    np.testing.assert_allclose(mu, mu[0], rtol=2e-7)
    np.testing.assert_allclose(u[1] - u[0], u[2] - u[1], rtol=2e-7)
    assert u[0] > u[1] > 0


@pytest.mark.parametrize("corrected", [False, True])
@pytest.mark.parametrize("gamma", [0.3, 0.5, 1.0])
def test_area_per_load(corrected, gamma):
    """A/A0 = kappa sigma_0 / (E_r h'): kappa = sqrt(8/pi), or sqrt(8/(pi gamma)) with S in G."""
    s = scene((rf.Elastic(3e6, 0.4), SMOOTH), (STEEL, ROAD), gamma, area_correction=corrected)
    slope2 = _moment_by_quadrature(ROAD, 2)
    kappa = solve(s, 0.0, 1e-3).area / 1e-3 * 3e6 / (1 - 0.4**2) * np.sqrt(slope2)
    assert kappa == pytest.approx(np.sqrt(8 / (np.pi * (gamma if corrected else 1))), rel=1e-8)


def _moment_by_quadrature(spectrum, order):
    """2 pi int q^(1 + order) C dq, by Gauss nodes in ln q between the kinks."""
    total = 0.0
    for a, b in ((spectrum.q0, spectrum.qr), (spectrum.qr, spectrum.q1)):
        node, weight = np.polynomial.legendre.leggauss(60)
        half = 0.5 * np.log(b / a)
        q = a * np.exp(half * (1 + node))
        total += (
            2 * np.pi * half * np.sum(weight * q ** (2 + order) * np.asarray(rf.power_spectrum(spectrum, q)))
        )
    return total


@pytest.mark.parametrize("spectrum", [ROAD, TREAD], ids=["road", "tread"])
def test_moments_by_quadrature(spectrum):
    assert _moment_by_quadrature(spectrum, 0) == pytest.approx(float(spectrum.h_rms) ** 2, rel=1e-12)
    assert rf.rms_slope(spectrum) ** 2 == pytest.approx(_moment_by_quadrature(spectrum, 2), rel=1e-12)


def test_gamma_and_height_cannot_be_told_apart_at_light_load():
    """mu ~ gamma sqrt(C_0) with S outside G, sqrt(gamma C_0) with S in G."""

    def mu(gamma, height, corrected):
        s = scene((RUBBER, SMOOTH), (STEEL, replace(ROAD, h_rms=height)), gamma, area_correction=corrected)
        return solve(s, 0.1, 1e-4).friction

    assert mu(0.8, 2.5e-4, False) == pytest.approx(mu(0.4, 5e-4, False), rel=1e-7)
    assert mu(0.8, 2.5e-4, True) == pytest.approx(mu(0.2, 5e-4, True), rel=1e-7)


def test_correction_vanishes_at_gamma_one_and_raises_the_area():
    """gamma = 1 is S = 1; below it G shrinks, and the separation keeps the plain G."""
    plain, corrected = (
        {g: solve(scene((RUBBER, TREAD), (STEEL, ROAD), g, area_correction=c), 0.1, 3e5) for g in (0.4, 1.0)}
        for c in (False, True)
    )
    assert_same(corrected[1.0], plain[1.0])
    assert corrected[0.4].area > 1.2 * plain[0.4].area
    np.testing.assert_allclose(corrected[0.4].separation, plain[0.4].separation, rtol=1e-12)


def test_full_contact():
    """At a huge load A = 1 and mu is the integral with P = S = 1, falling like 1 / load."""
    s = SCENES["smooth-rubber"]
    case = {
        "solid1": {
            "kind": "prony",
            "E_inf": 8.0e5,
            "E": [2.5e7, 4.0e6, 3.0e5],
            "tau": [3e-7, 2e-4, 0.7],
            "nu": 0.48,
        },
        "solid2": {"kind": "rigid"},
        "psd1": None,
        "psd2": {"q0": 100.0, "qr": 1000.0, "q1": 3.1e4, "H": 0.8, "h_rms": 5e-4},
        "v": 0.1,
        "pressure": 1e10,
        "gamma": 0.5,
    }
    A, mu, u = solve(s, 0.1, np.array([1e10, 1e12]))
    assert (A == 1).all()
    assert (u < 1e-100).all()
    np.testing.assert_allclose(mu, oracle.full_contact_friction(case) * np.array([1, 1e-2]), rtol=1e-10)


# Statements of the paper about the two roughnesses.


@pytest.mark.slow
def test_both_roughnesses_count_alike_at_rest():
    """v -> 0: everything depends on C_1 + C_2 only, wherever they are."""
    for upper in (STEEL, OTHER):
        one = solve(scene((RUBBER, TREAD), (upper, ROAD)), 0.0, 3e5)
        other = solve(scene((RUBBER, ROAD), (upper, TREAD)), 0.0, 3e5)
        assert_same(one, other, 1e-13)
        half = replace(ROAD, h_rms=5e-4 / np.sqrt(2))
        shared = solve(scene((RUBBER, half), (upper, half)), 0.0, 3e5)
        assert_same(shared, solve(scene((RUBBER, SMOOTH), (upper, ROAD)), 0.0, 3e5))


def test_rubber_roughness_fades_with_speed():
    """Moving roughness meets glass, the rubber's own meets soft rubber: 8.5e5 against 3e7 Pa."""
    v = np.array([0.0, 1e6])
    rough = solve(scene((RUBBER, ROAD), (STEEL, ROAD)), v, 1e4).area
    smooth = solve(scene((RUBBER, SMOOTH), (STEEL, ROAD)), v, 1e4).area
    loss = 1 - rough / smooth
    # G doubles at rest, A ~ G^(-1/2); at speed G grows by (E_inf/E_glass)^2 = 7e-4.
    assert loss[0] == pytest.approx(1 - 1 / np.sqrt(2), rel=0.05)
    assert 0 < loss[1] < 5e-4


def test_friction_comes_from_the_road():
    """The rubber's own roughness adds no dissipation: mu falls when it takes contact away."""
    v = np.logspace(-4, 2, 7)
    rough = solve(scene((RUBBER, TREAD), (STEEL, ROAD)), v, 3e5).friction
    smooth = solve(scene((RUBBER, SMOOTH), (STEEL, ROAD)), v, 3e5).friction
    assert (rough > 0).all()
    assert (rough < smooth).all()


def test_stiffer_and_less_contact_with_speed():
    A, mu, u = solve(SCENES["two-rubbers"], np.logspace(-6, 6, 16), 3e5)
    assert (jnp.diff(A) < 0).all()
    assert (jnp.diff(u) > 0).all()
    assert (mu > 0).all()


# How it is called.


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


def test_vmap_over_scenes():
    s = as_arrays(SCENES["one-rubber"])
    scenes = [replace(s, gamma=jnp.asarray(gamma)) for gamma in (0.3, 0.6)]
    stacked = jax.tree.map(lambda *x: jnp.stack(x), *scenes)
    both = jax.jit(jax.vmap(rf.solve, (0, None, None)))(stacked, 0.1, 3e5)
    np.testing.assert_allclose(
        np.array(three(both)), np.array([solve(x, 0.1, 3e5) for x in scenes]).T, rtol=1e-13
    )


@pytest.mark.parametrize("name", ["elastic", pytest.param("two-slabs", marks=pytest.mark.slow)])
def test_jit_is_eager(name):
    assert_same(solve(SCENES[name], 0.1, 3e5), three(rf.solve(SCENES[name], 0.1, 3e5)), 1e-13)
