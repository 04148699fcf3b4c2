"""Adhesion of short range: the first passage against differences and closed forms, and scenes with it."""

import itertools
import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import solve_banded
from scipy.special import erf
from scipy.stats import norm

import rubberfric as rf
from rubberfric.analysis import adhesion_profile, full_contact_energy, pull_off_force
from rubberfric.analysis.jacobian import value_and_jacobian
from rubberfric.base.quadrature import gauss
from rubberfric.theory.area import first_passage, short_range
from rubberfric.theory.area.first_passage import at_end, passage

FINE = rf.SelfAffine(q0=1e4, qr=3e4, q1=1e6, hurst=0.8, h_rms=2e-7)
QUADRATURE = rf.Quadrature(order=8, panels=6, graded=3, ratio=6.0)
AREA = ("area", "converged")


def _elastic(work=None, young=1e7, **options):
    adhesion = None if work is None else rf.Adhesion(work, criterion="stress")
    return rf.Scene(rf.Body(rf.Rigid(), FINE), rf.Body(rf.Elastic(young, 0.5)), adhesion=adhesion, **options)


def _at_nodes(boundary, end=4.0, order=12):
    """t at the nodes, and A there."""
    edges = np.concatenate([[0.0], end * 2.0 ** np.arange(-10, 1)])
    t = (edges[:-1, None] + np.diff(edges)[:, None] * gauss(order)[0])[..., None]
    return t, jax.jit(passage)(jnp.asarray(t), jnp.asarray(boundary(t) ** 2))


def _passed(boundary):
    return float(at_end(_at_nodes(boundary)[1])[0])


def _by_differences(boundary, end=4.0, cells=1500, steps=1500, width=16.0):
    """The same by Crank and Nicolson in the frame of the boundary, z = s + b(t), from a short time on."""
    begin = 1e-2
    z = np.linspace(0.0, width, cells + 1)[1:-1]
    h = width / cells

    def image(t):  # of a boundary at rest at b(0): to 1e-30 nothing has reached it
        s = z - boundary(t)
        return np.exp(-((s - 1) ** 2) / (4 * t)) / math.sqrt(4 * math.pi * t)

    density = image(begin)
    times = begin * (end / begin) ** np.linspace(0, 1, steps + 1)
    for early, late in itertools.pairwise(times):
        k, drift = late - early, (boundary(late) - boundary(early)) / (late - early)
        lower, upper = 1 / h**2 + drift / (2 * h), 1 / h**2 - drift / (2 * h)
        bands = np.zeros((3, z.size))
        bands[0, 1:], bands[1], bands[2, :-1] = -0.5 * k * upper, 1 + k / h**2, -0.5 * k * lower
        right = (1 - k / h**2) * density
        right[1:] += 0.5 * k * lower * density[:-1]
        right[:-1] += 0.5 * k * upper * density[1:]
        density = solve_banded((1, 1), bands, right)
    return density.sum() * h


@pytest.mark.parametrize("b", [0.0, 0.5, 3.0])
def test_a_constant_detachment_stress_has_a_closed_form(b):
    t, area = _at_nodes(lambda t: b + 0 * t)
    np.testing.assert_allclose(area, erf((1 + b) / (2 * np.sqrt(t))), rtol=1e-10)


def test_a_stress_that_rises_evenly_has_a_closed_form():
    b, m, end = 0.3, 0.7, 4.0
    a, width = 1 + b, math.sqrt(2 * end)
    wanted = norm.cdf((a + m * end) / width) - math.exp(-m * a) * norm.cdf((m * end - a) / width)
    assert _passed(lambda t: b + m * t) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize(
    "boundary",
    [
        lambda t: 0.5 * np.sqrt(1 + t),
        lambda t: 1.5 / (1 + t),
        lambda t: 0.1 * t**2,
        lambda t: 0.4 + 0.3 * np.sin(t),
    ],
)
def test_a_moving_boundary_agrees_with_differences(boundary):
    coarse, fine = _by_differences(boundary, cells=750, steps=750), _by_differences(boundary)
    assert _passed(boundary) == pytest.approx(fine + (fine - coarse) / 3, rel=1e-5)


def test_a_known_passage():
    assert _passed(lambda t: 0.5 * np.sqrt(1 + t)) == pytest.approx(0.483471, abs=6e-7)


def test_a_vanishing_work_is_contact_without_adhesion():
    pressure = np.array([1e3, 1e5, 1e6])
    fine = rf.Quadrature()
    plain = rf.contact_area(_elastic(), 0.0, pressure, quadrature=fine)
    # The area that it saves from the finest roughness is in proportion to the work, 1e-9 of all at 1e-12.
    found = rf.contact_area(_elastic(1e-18), 0.0, pressure, quadrature=fine)
    np.testing.assert_allclose(found, plain, rtol=1e-13)


@pytest.mark.slow
def test_adhesion_enlarges_the_area_up_to_full_contact():
    works = [1e-6, 1e-4, 1e-3, 1e-2, 0.1, 10.0]
    found = [rf.solve(_elastic(w), 0.0, [1e4, 1e5], quadrature=QUADRATURE, quantities=AREA) for w in works]
    areas = np.array([one.area for one in found])
    assert np.all(np.diff(areas, axis=0) > -1e-5)
    assert np.all((areas > 0) & (areas <= 1))
    np.testing.assert_allclose(areas[-1], 1.0, atol=1e-9)
    assert np.all([one.converged for one in found])


@pytest.mark.slow
def test_full_contact_has_the_work_of_adhesion_less_the_elastic_energy():
    scene = _elastic(1.0)
    true_area = 1 + 0.5 * float(rf.rms_slope(FINE)) ** 2
    left = true_area - float(full_contact_energy(scene, quadrature=QUADRATURE))
    force = pull_off_force(scene, 1e-2, 1e4, quadrature=QUADRATURE)
    assert float(force) == pytest.approx(1.5 * math.pi * 1e-2 * left, rel=1e-6)
    profile = adhesion_profile(scene, 0.0, 1e4, quadrature=QUADRATURE)
    modulus = 1e7 / 0.75
    np.testing.assert_allclose(profile.stress**2, 4 / np.pi * modulus * profile.q * profile.work, rtol=1e-9)
    assert float(profile.work[-1]) == pytest.approx(true_area, rel=1e-2)


@pytest.mark.parametrize(("work", "pressure"), [(1e-3, 1e4), (1e-3, 1e5), (5e-3, 3e4), (5e-3, 8e3)])
def test_area_and_energy_are_a_solution(work, pressure):
    """Of the differences above along the boundary found, and of the balance by a sum over wavevectors.

    In the first two the detachment stress begins within the roughness; in the last contact spreads almost by
    itself.
    """
    scene = _elastic(work)
    profile = adhesion_profile(scene, 0.0, pressure, quadrature=rf.Quadrature(order=13, panels=16))
    q, area = (np.append(values, values[-1]) for values in (profile.q, np.asarray(profile.area)))
    q[-1], area[-1] = 1e6, float(rf.contact_area(scene, 0.0, pressure, quadrature=rf.Quadrature()))
    C, modulus = np.asarray(rf.power_spectrum(FINE, q * (1 - 1e-12))), 1e7 / 0.75
    log_q = np.log(q)

    def up_to(density):
        return np.append(0.0, np.cumsum(0.5 * np.diff(log_q) * (density[1:] + density[:-1])))

    stored = up_to(np.pi / 2 * modulus * q**3 * C * (0.5 + 0.5 * area**2) * area)
    true_area = 1 + 0.5 * float(rf.rms_slope(FINE)) ** 2
    left = np.maximum(work * true_area * area[-1] - (stored[-1] - stored), 0.0) / area
    np.testing.assert_allclose(profile.work, left[:-1], atol=2e-3 * work)
    t = up_to(np.pi / 4 * (modulus / pressure) ** 2 * q**4 * C)
    square = np.append(np.asarray(profile.stress) ** 2, 4 / np.pi * modulus * 1e6 * left[-1]) / pressure**2
    found = _by_differences(
        lambda at: np.sqrt(np.interp(at, t, square)), t[-1], 3000, 3000, 60.0 * max(1.0, 2e4 / pressure)
    )
    assert area[-1] == pytest.approx(found, rel=2e-3)


@pytest.mark.slow
def test_panels_and_nodes_are_enough(monkeypatch):
    """More of all of them change areas by 1e-7 at most, of most scenes by 1e-8."""
    seal = rf.SelfAffine(q0=1e4, qr=3e4, q1=1e7, hurst=0.8, h_rms=2e-7)
    cases = [(FINE, 1e7, 1e-3), (FINE, 1e7, 2e-2), (FINE, 1e10, 0.05), (seal, 1e7, 2e-3)]
    cases = [(rf.Scene(rf.Body(rf.Rigid(), s), rf.Body(rf.Elastic(E, 0.5))), w) for s, E, w in cases]

    def areas():
        jax.clear_caches()
        scenes = [replace(scene, adhesion=rf.Adhesion(work, criterion="stress")) for scene, work in cases]
        at = {"quadrature": rf.Quadrature(angular_order=8)}
        return np.array([rf.contact_area(scene, 0.0, [1e1, 1e4, 1e5, 4e5], **at) for scene in scenes])

    usual = areas()
    for module, name, count in (
        (short_range, "PANELS", 10),
        (short_range, "ORDER", 14),
        (first_passage, "_AT_REST", 26),
        (first_passage, "_IN_LAST", 14),
        (first_passage, "_BEFORE", 18),
    ):
        monkeypatch.setattr(module, name, count)
    first_passage._rules.cache_clear()
    fine = areas()
    monkeypatch.undo()
    first_passage._rules.cache_clear()
    jax.clear_caches()
    np.testing.assert_allclose(usual, fine, rtol=1e-7)
    assert np.median(np.abs(usual / fine - 1)) < 1e-8


@pytest.mark.slow
def test_contact_that_spreads_by_itself_is_found_at_every_load():
    """More with more load, and a finite area however light it is; less work, and none is left of it."""
    pressures = np.geomspace(1e-3, 1e6, 19)
    found = rf.solve(_elastic(5e-3), 0.0, pressures, quadrature=QUADRATURE, quantities=AREA)
    assert found.converged.all() and (np.diff(found.area) > -1e-9).all() and found.area[0] > 0.3
    found = rf.solve(_elastic(4e-3), 0.0, pressures, quadrature=QUADRATURE, quantities=AREA)
    assert found.converged.all() and (np.diff(found.area) > -1e-9).all() and found.area[0] < 1e-6


@pytest.mark.slow
def test_stiff_roughness_has_no_adhesion_at_large_scales():
    scene = _elastic(0.05, young=1e10)
    assert float(pull_off_force(scene, 1e-2, 1e5, quadrature=QUADRATURE)) == 0
    profile = adhesion_profile(scene, 0.0, 1e5, quadrature=QUADRATURE)
    assert profile.work[0] == 0
    assert profile.work[-1] > 0.01


@pytest.mark.slow
def test_values_and_derivatives_are_finite_at_extremes():
    def area(work, young, pressure):
        scene = _elastic(1.0, young).replace("adhesion.work", work)
        return rf.contact_area(scene, 0.0, pressure, quadrature=QUADRATURE)

    works = jnp.array([1e-6, 1e-6, 1e-2, 10.0, 10.0, 1e-2])
    youngs = jnp.array([1e5, 1e11, 1e7, 1e5, 1e8, 1e7])
    pressures = jnp.array([1e2, 1e2, 1e9, 1e2, 1e5, 1e5])
    found = jax.jit(jax.vmap(jax.value_and_grad(area, (0, 1, 2))))(works, youngs, pressures)
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(found))


@pytest.mark.slow
def test_derivatives_are_those_of_the_values():
    def area(step):
        return rf.contact_area(_elastic(0.1 * (1 + step)), 0.0, 1e4, quadrature=QUADRATURE)

    def left(step):
        scene = _elastic(0.2 * (1 + step), young=1e7 * (1 + step) ** 2)
        return pull_off_force(scene, 1.0, 1e4, quadrature=QUADRATURE)

    for function in (area, left):
        slope = (function(1e-4) - function(-1e-4)) / 2e-4
        assert float(jax.grad(function)(0.0)) == pytest.approx(float(slope), rel=1e-5, abs=1e-8)


@pytest.mark.slow
def test_full_contact_does_not_feel_the_wavevectors():
    """In both modes, and of what is prepared once for many points: no panel has a width."""
    pressures = np.array([1e3, 1e4])

    def scene_of(q0):
        return _elastic(5e-2, 2e6).replace("lower.spectrum.q0", q0[0])

    def area(q0):
        return rf.contact_area(scene_of(q0), 0.0, pressures, quadrature=QUADRATURE)

    q0 = jnp.array([1e4])
    zeros = np.zeros(pressures.size)
    conditions = zeros, pressures, None
    values, jacobian = value_and_jacobian(scene_of, q0, conditions, "area", QUADRATURE)
    np.testing.assert_allclose(values, 1, atol=1e-10)
    for slopes in (jacobian, jax.jacfwd(area)(q0), jax.jacrev(area)(q0)):
        np.testing.assert_allclose(q0 * slopes, zeros[:, None], atol=1e-9)


def test_friction_and_shear_follow_the_area():
    tread = rf.Prony(3.6e6, [1e7], [1e-3])
    shear = rf.ContactShear(tau_f0=1e6, c=0.0, v0=1.0)
    scene = rf.Scene(rf.Body(rf.Rigid(), FINE), rf.Body(tread), shear=shear)
    quantities = ("area", "viscoelastic_friction", "shear_friction")
    plain, sticking = (
        rf.solve(one, 1e-3, 1e4, quadrature=QUADRATURE, quantities=quantities)
        for one in (scene, scene.replace(adhesion=rf.Adhesion(0.05, criterion="stress")))
    )
    assert float(sticking.shear_friction) == pytest.approx(100 * float(sticking.area), rel=1e-12)
    assert sticking.area > 1.1 * plain.area
    assert sticking.viscoelastic_friction > plain.viscoelastic_friction


def test_what_adhesion_does_not_define_is_refused():
    scene = _elastic(0.05)
    for function in (rf.separation, rf.solve, rf.analysis.profile, rf.analysis.contact_stiffness):
        with pytest.raises(ValueError, match=r"^scene.adhesion: .* is not defined with it; must be None$"):
            function(scene, 0.0, 1e5)
    with pytest.raises(ValueError, match=r"^scene.adhesion: the distribution of stresses is not"):
        rf.analysis.stress_distribution(scene, 1e5, 0.0, 1e5)
    with pytest.raises(ValueError, match=r"^Scene.adhesion: not together with area_correction"):
        _elastic(0.05, area_correction=True)
    with pytest.raises(ValueError, match=r"^scene.adhesion is None; it must be an Adhesion"):
        pull_off_force(_elastic(), 1e-2, 1e5)
    with pytest.raises(ValueError, match=r"work"):
        rf.Adhesion(work=-1.0)
    assert "separation" not in rf.quantities_of(scene)
