"""Adhesion of long range: the load of the contact against brute force over its separations."""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq
from support.oracles.dmt_attraction import DmtAttraction

import rubberfric as rf
from rubberfric.theory.adhesive_contact import relative_attraction
from rubberfric.theory.integrals import prepare
from rubberfric.theory.structure import SurfaceTemperatures

Q0 = 1e4  # [1/m]
Q1 = 1e6  # [1/m]
HURST = 0.8
H_RMS = 2e-7  # [m]
YOUNG = 1e7  # [Pa]
FINE = rf.SelfAffine(q0=Q0, qr=Q0, q1=Q1, hurst=HURST, h_rms=H_RMS)
ROLLING = FINE.replace(qr=3e4)
QUADRATURE = rf.Quadrature(order=8, panels=6, graded=3, ratio=6.0)
AREA = ("area", "separation", "converged")
_solve = jax.jit(functools.partial(rf.solve, quantities=AREA))


def _scene(work=None, reach=None, spectrum=FINE, **options):
    adhesion = None if work is None else rf.Adhesion(work, limit="long", range=reach)
    return rf.Scene(
        rf.Body(rf.Rigid(), spectrum), rf.Body(rf.Elastic(YOUNG, 0.5)), adhesion=adhesion, **options
    )


_area = jax.jit(rf.contact_area)


def _load_of(scene, area, velocity=0.0):
    """The pressure at which contact without adhesion has this area."""
    return brentq(lambda p: float(_area(scene, velocity, p)) - area, 1e3, 1e7, xtol=1e-6)


def _brute(scene):
    """The contact of a scene without adhesion, by a program that shares no code with the library."""
    road, solid = scene.lower.spectrum, scene.upper.material
    numbers = (float(x) for x in (road.q0, road.qr, road.q1, road.hurst, road.h_rms))
    return DmtAttraction(*numbers, float(solid.young / (1 - solid.poisson**2)), float(scene.gamma))


def _plateau(work=None, reach=1.5e-6):
    """A plateau, and areas of 1e-7 to 1e-3."""
    adhesion = None if work is None else rf.Adhesion(work, limit="long", range=reach)
    spectrum = rf.SelfAffine(5.8e4, 1.8e5, 2.5e6, 0.62, 3.1e-6)
    return rf.Scene(
        rf.Body(rf.Rigid(), spectrum), rf.Body(rf.Elastic(4e6, 0.49)), gamma=1.0, adhesion=adhesion
    )


# Pressures, works over pressure and range, and ranges. The first three have several solutions.
LOADS = [(1e3, 30.0, 1e-8), (1e3, 300.0, 3e-9), (1e3, 10.0, 1e-7)]
LOADS += [(1e5, 3.0, 1e-8), (1e4, 10.0, 3e-7), (1e5, 1.0, 1e-7)]
CASES = [(_plateau(0.3), 2e3), (_plateau(0.3), 30.0)]
CASES += [(_scene(share * p * reach, reach), p) for p, share, reach in LOADS]


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "pressure"), CASES)
def test_the_load_is_the_least_that_brute_force_allows(scene, pressure):
    """Nodes placed for another load gave areas of the plateau 2 to 800 times too large."""
    found, brute = _solve(scene, 0.0, pressure), _brute(scene)
    work, reach = float(scene.adhesion.work), float(scene.adhesion.range)
    load = brute.load_of(float(found.area))
    assert found.converged and load > 1.1 * pressure
    assert load == pytest.approx(pressure + work / reach * brute.attraction(load, reach), rel=1e-5)
    for less in np.geomspace(pressure, 0.998 * load, 4):
        assert less - pressure < work / reach * brute.attraction(less, reach)
    without = rf.separation(scene.replace(adhesion=None), 0.0, load)
    assert float(found.separation) == pytest.approx(float(without), rel=1e-5)


@pytest.mark.slow
def test_area_and_separation_are_those_without_adhesion_under_the_load():
    """Also with S in G."""
    for options in ({}, {"area_correction": True}):
        found = _solve(_scene(1e-2, 1e-7, **options), 0.0, 1e5)
        plain = _scene(**options)
        area = float(found.area)
        load = _load_of(plain, area)
        assert load > 1.2e5
        assert float(found.separation) == pytest.approx(float(rf.separation(plain, 0.0, load)), rel=1e-8)


@pytest.mark.slow
def test_a_range_beyond_all_gaps_is_a_load():
    pressure = np.array([1e3, 3e4, 1e5])
    found = rf.solve(_scene(2e4 * 1e2, 1e2), 0.0, pressure, quantities=AREA)
    pressed = rf.solve(_scene(), 0.0, pressure + 2e4, quantities=AREA[:2])
    np.testing.assert_allclose(found.area, pressed.area, rtol=1e-7)
    np.testing.assert_allclose(found.separation, pressed.separation, rtol=1e-7)


def test_a_range_beyond_all_gaps_is_a_load_at_areas_of_1e_11():
    """A table of where contact is lost ended at 1e-6: the area was 40 % too small. Gaps are below 2e-4 r."""
    spectrum = rf.SelfAffine(2e4, 1e5, 1e7, 0.8, 1e-6)
    bodies = rf.Body(rf.Rigid(), spectrum), rf.Body(rf.Elastic(1.6e9, 0.5))
    for pressure in (1e-5, 1e-3, 1e-2):
        adhesion = rf.Adhesion(pressure, limit="long", range=0.1)
        found = _area(rf.Scene(*bodies, adhesion=adhesion), 0.0, pressure)
        assert float(found) == pytest.approx(float(_area(rf.Scene(*bodies), 0.0, 11 * pressure)), rel=3e-4)


@pytest.mark.slow
def test_light_and_heavy_loads():
    """The attraction is a share of a light load, and so is the area."""
    pressure = np.array([1.0, 30.0, 200.0, 2e3, 2e4])
    found = rf.solve(_plateau(0.3), 0.0, pressure, quantities=AREA)
    assert found.converged.all()
    gain = found.area / rf.contact_area(_plateau(), 0.0, pressure)
    np.testing.assert_allclose(gain[:3], gain[0], rtol=1e-5)
    assert _solve(_scene(1.5e-3, 3e-9), 0.0, 1e6).area == 1


@pytest.mark.parametrize(
    "pressure", [2e5, *(pytest.param(p, marks=pytest.mark.slow) for p in (1.0, 1e3, 5e5))]
)
def test_the_attraction_agrees_with_brute_force(pressure):
    @jax.jit
    def attraction(at):
        prepared = prepare(_plateau(0.3), ("area", "separation"), rf.Quadrature())
        given = prepared.adhesion, prepared.roughness, 0 * at, at, [SurfaceTemperatures(None, None)]
        return relative_attraction(*given)[1]

    share = attraction(jnp.array([pressure]))
    assert float(share[0]) == pytest.approx(_brute(_plateau()).attraction(pressure, 1.5e-6), rel=1e-5)


def _random_scenes(count):
    """Parameters of scenes, (9, count): spectrum, modulus, gamma, and the range and work of adhesion."""
    unit = np.random.default_rng(7).uniform(size=(9, count))
    q0 = 10 ** (3 + 2 * unit[0])
    qr = q0 * 10 ** unit[1]
    q1 = qr * 10 ** (1 + 2 * unit[2])
    h_rms = 10 ** (-2 + 2 * unit[4]) / qr
    young = 10 ** (6 + 2 * unit[5])
    reach = h_rms * 10 ** (-1.5 + 2.5 * unit[7])
    stress = young * h_rms * qr
    return np.array(
        [q0, qr, q1, 0.4 + 0.5 * unit[3], h_rms, young, unit[6], reach, 0.3 * unit[8] * stress * reach]
    )


@pytest.mark.slow
def test_areas_grow_with_load_and_work():
    count = 20
    base = _scene(1.0, 1.0, ROLLING)

    def area(parameters, work, pressure):
        q0, qr, q1, hurst, h_rms, young, gamma, reach, _ = parameters
        scene = base.replace({"lower.spectrum.q0": q0, "lower.spectrum.qr": qr, "lower.spectrum.q1": q1})
        scene = scene.replace({"lower.spectrum.hurst": hurst, "lower.spectrum.h_rms": h_rms, "gamma": gamma})
        scene = scene.replace({"upper.material.young": young, "adhesion.range": reach, "adhesion.work": work})
        found = rf.solve(scene, 0.0, pressure, quantities=AREA, quadrature=rf.Quadrature())
        return found.area, found.converged

    parameters = _random_scenes(count)
    loads = np.broadcast_to(np.geomspace(1.0, 1e5, 18), (count, 18))
    works = np.broadcast_to(parameters[8][:, None], loads.shape)
    along_work = parameters[8][:, None] * np.geomspace(1e-3, 1.0, 7)
    pressures = np.concatenate([loads, np.full(along_work.shape, 1.0), np.full(along_work.shape, 1e3)], 1)
    works = np.concatenate([works, along_work, along_work], 1)
    areas, converged = jax.jit(jax.vmap(jax.vmap(area, (None, 0, 0)), (1, 0, 0)))(
        parameters, works, pressures
    )
    assert np.all(converged)
    for part in np.split(np.asarray(areas), [18, 25], axis=1):
        assert np.all(np.diff(part, axis=1) >= -1e-9 * part[:, 1:])


@pytest.mark.slow
def test_values_and_derivatives_are_finite_at_extremes():
    def values(work, reach, young, pressure):
        scene = _scene(1.0, 1.0, ROLLING).replace(
            {"adhesion.work": work, "adhesion.range": reach, "upper.material.young": young}
        )
        found = rf.solve(scene, 0.0, pressure, quadrature=QUADRATURE, quantities=AREA[:2])
        return found.area, found.separation

    cases = np.array(
        [
            (work, reach, young, pressure)
            for work in (1e-6, 1e-2, 10.0)
            for reach in (1e-10, 1e-7, 1e-3)
            for young in (1e4, 1e7, 1e11)
            for pressure in (1.0, 1e5, 1e9)
        ]
    ).T
    found = jax.jit(jax.vmap(values))(*cases)
    slopes = jax.jit(jax.vmap(jax.jacrev(values, (0, 1, 2, 3))))(*cases)
    assert all(np.isfinite(x).all() for x in jax.tree.leaves((found, slopes)))
    assert np.all((found[0] > 0) & (found[0] <= 1) & (found[1] >= 0))


@pytest.mark.slow
def test_friction_is_that_of_the_load_over_the_pressure():
    tread = rf.Prony(3.6e6, [1e7], [1e-3])
    shear = rf.ContactShear(tau_f0=1e6, c=0.0, v0=1.0)
    plain = rf.Scene(rf.Body(rf.Rigid(), FINE), rf.Body(tread), shear=shear)
    scene = plain.replace(adhesion=rf.Adhesion(0.05, limit="long", range=1e-7))
    quantities = ("area", "viscoelastic_friction", "shear_friction")
    found = rf.solve(scene, 1e-3, 1e4, quantities=quantities)
    area = float(found.area)
    load = _load_of(plain, area, 1e-3)
    pressed = rf.solve(plain, 1e-3, load, quantities=quantities)
    assert float(found.shear_friction) == pytest.approx(100 * area, rel=1e-12)
    assert float(found.viscoelastic_friction) == pytest.approx(
        float(pressed.viscoelastic_friction) * load / 1e4, rel=1e-8
    )
    power = rf.analysis.dissipated_power(scene, 1e-3, 1e4)
    total = float(found.viscoelastic_friction + found.shear_friction) * 1e4 * 1e-3
    assert float(power.total) == pytest.approx(total, rel=1e-9)


def test_wrong_ranges_are_refused():
    with pytest.raises(ValueError, match=r"^Adhesion.range is None: must be given, in m"):
        rf.Adhesion(0.05, limit="long")
    with pytest.raises(ValueError, match=r"^Adhesion.range: must be None for adhesion of short range"):
        rf.Adhesion(0.05, range=1e-8)
    with pytest.raises(ValueError, match=r"range"):
        rf.Adhesion(0.05, limit="long", range=-1.0)
    assert "separation" in rf.quantities_of(_scene(1e-2, 1e-7))


def _work_left(work, reach, spectrum=FINE):
    """Derivatives of the pull-off force, relative to the work."""
    force = rf.analysis.pull_off_force(_scene(work, reach, spectrum), 1e-2, 1e5)
    return float(force) / (2 * math.pi * 1e-2 * work)


@pytest.mark.slow
@pytest.mark.parametrize(("work", "reach"), [(1e-3, 1e-7), (1e-2, 3e-8)])
def test_the_work_of_separation_agrees_with_brute_force(work, reach):
    """Attraction less elastic energy at loads one by one, and the largest of it."""
    log_load = math.log(work / reach) + np.linspace(-12, 2, 57)
    gaps = make_interp_spline(log_load, rf.separation(_scene(), 0.0, np.exp(log_load)))
    brute = _brute(_scene())
    share = make_interp_spline(log_load, [brute.attraction(load, reach) for load in np.exp(log_load)])
    at, step = np.linspace(log_load[0], log_load[-1], 20001, retstep=True)
    rate = -gaps.derivative()(at) * np.exp(at)
    stored = rate[0] + step * np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1])))
    assert _work_left(work, reach) == pytest.approx(np.max(work * share(at) - stored) / work, rel=2e-4)


@pytest.mark.slow
def test_limits_of_the_work_of_separation():
    """Smooth solids have all of it, stiff ones nothing; full contact is one of the states."""
    assert _work_left(1e-2, 1e-7, FINE.replace(h_rms=1e-13)) == pytest.approx(1.0, abs=1e-9)
    assert _work_left(1e-4, 1e-9) == 0
    for work in (4e-3, 1e-2, 1.0):
        left = _work_left(work, 1e-7)
        full = 1 - float(rf.analysis.full_contact_energy(_scene(work, 1e-7))) / work
        assert full - 1e-9 <= left < 1
    # If the range exceeds all gaps, only the range determines the separation.
    assert _work_left(1e-2, 1e-3) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.slow
def test_a_work_beyond_all_others_has_a_derivative():
    slope = jax.grad(lambda work: rf.analysis.pull_off_force(_scene(work, 1e-7), 1e-2, 1e5))(1e6)
    assert float(slope) == pytest.approx(2 * math.pi * 1e-2, rel=1e-9)


@pytest.mark.slow
def test_derivatives_of_the_pull_off_force():
    def force(x):
        spectrum = FINE.replace(h_rms=H_RMS * jnp.exp(x[1]))
        return jnp.log(rf.analysis.pull_off_force(_scene(1e-3 * jnp.exp(x[0]), 1e-7, spectrum), 1e-2, 1e5))

    force, x = jax.jit(force), np.zeros(2)
    forward, reverse = jax.jacfwd(force)(x), jax.jacrev(force)(x)
    h = 1e-4 * np.eye(2)
    differences = [float(force(x + step) - force(x - step)) / 2e-4 for step in h]
    np.testing.assert_allclose(forward, reverse, rtol=1e-9)
    np.testing.assert_allclose(forward, differences, rtol=1e-5)
