"""Adhesion of short range by its energy: contact that is held while the load falls."""

import math

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from support.oracles.numerical import composite

import fitting
import rubberfric as rf
from rubberfric.theory.area.constant_area import Unloading, _slopes

ROUGH = rf.SelfAffine(q0=1e5, qr=2e5, q1=1.6e6, hurst=0.8, h_rms=1e-6)
WIDE = rf.SelfAffine(q0=1e4, qr=3e4, q1=1e8, hurst=0.6, h_rms=2e-7)
TREAD = rf.Prony(3.6e6, [1e7, 4e7], [1e-3, 1e-5])


def _scene(work=None, spectrum=ROUGH, material=None, **options):
    adhesion = None if work is None else rf.Adhesion(work)
    solid = rf.Body(rf.Elastic(1e7, 0.5) if material is None else material)
    return rf.Scene(rf.Body(rf.Rigid(), spectrum), solid, adhesion=adhesion, **options)


FULL, FULL_WIDE = (
    float(rf.analysis.full_contact_energy(_scene(spectrum=spectrum))) for spectrum in (ROUGH, WIDE)
)


@jax.jit
def _compliance(plain, velocity, pressure):
    """-du/dp at pressures, shape (n,)."""
    return -jax.vmap(jax.grad(lambda p: rf.separation(plain, velocity, p)))(pressure)


@jax.jit
def _attraction(plain, velocity, work, pressure):
    """Difference of the loads without and with adhesion by the formula, at pressures of shape (n,)."""
    area = jax.vmap(jax.grad(lambda p: rf.contact_area(plain, velocity, p)))(pressure)
    bend = jax.vmap(jax.grad(jax.grad(lambda p: rf.separation(plain, velocity, p))))(pressure)
    return jnp.sqrt(2 * work * area / bend)


def _held(scene, work, pressure, velocity=0.0):
    """Load without adhesion by the formula, from derivatives of the area and the separation without it."""
    plain, low, high = scene.replace(adhesion=None), pressure, 1e3 * pressure
    for _ in range(6):  # 200 parts each time: to 1e-13
        tried = np.geomspace(low, high, 201)
        after = int(np.argmax(tried - pressure - _attraction(plain, velocity, work, tried) > 0))
        assert after > 0
        low, high = tried[after - 1], tried[after]
    return float(high)


@pytest.mark.slow
@pytest.mark.parametrize("corrected", [False, True])
@pytest.mark.parametrize(("share", "load"), [(0.3, 4e5), (0.03, 3e4), (0.2, 1e5)])
def test_area_separation_and_friction_are_those_of_the_load_that_the_formula_has(corrected, share, load):
    shear = rf.ContactShear(tau_f0=1e6, c=0.0, v0=1.0)
    scene = _scene(share * FULL, material=TREAD, area_correction=corrected, shear=shear)
    velocity = 1e-4
    found = rf.solve(scene, velocity, load, quantities=rf.quantities_of(scene))
    held = _held(scene, share * FULL, load, velocity)
    plain = scene.replace(adhesion=None)
    assert bool(found.converged) and held > 1.1 * load
    assert float(found.area) == pytest.approx(float(rf.contact_area(plain, velocity, held)), rel=1e-9)
    compliance = float(_compliance(plain, velocity, np.array([held]))[0])
    gap = float(rf.separation(plain, velocity, held)) + compliance * (held - load)
    assert float(found.separation) == pytest.approx(gap, rel=1e-9)
    pressed = rf.solve(plain, velocity, held, quantities=("viscoelastic_friction",))
    wanted = float(pressed.viscoelastic_friction) * held / load
    assert float(found.viscoelastic_friction) == pytest.approx(wanted, rel=1e-9)
    assert float(found.shear_friction) == pytest.approx(1e6 / load * float(found.area), rel=1e-12)


@pytest.mark.slow
def test_what_the_load_does_is_stored_or_comes_of_adhesion():
    """-p du = dU - work dA, U by a sum over the separations without adhesion."""
    work = 0.2 * FULL
    scene, plain = _scene(work), _scene()
    pressure = 1e5 * np.geomspace(0.9, 1.1, 21)

    def state(p):
        found = rf.solve(scene, 0.0, p)
        held = np.array([_held(scene, work, one) for one in p])
        compliance = np.asarray(_compliance(plain, 0.0, held))
        at, weight = composite(held)
        steps = (weight * at * np.asarray(_compliance(plain, 0.0, at))).reshape(held.size - 1, -1).sum(1)
        stored = np.append(0.0, np.cumsum(steps)) - 0.5 * compliance * (held**2 - p**2)
        return np.asarray(found.area), np.asarray(found.separation), stored

    area, gap, stored = state(pressure)
    # Simpson's rule over all of the loads.
    done = -pressure * np.gradient(gap, pressure, edge_order=2)
    weights = np.tile([2.0, 4.0], 10)
    weights = np.append(weights, 1.0)
    weights[0] = 1.0
    log_step = math.log(pressure[1] / pressure[0])
    total = np.sum(weights * done * pressure) * log_step / 3
    change = (stored[-1] - stored[0]) - work * (area[-1] - area[0])
    assert total == pytest.approx(change, rel=2e-4)


@pytest.mark.slow
def test_light_loads_have_an_area_that_is_larger_by_one_share():
    """A = kappa p and u = - u0 ln p, so that p_1 = p / (1 - share)."""
    plain, work, p = _scene(), 0.1 * FULL, 1e-3
    area = float(rf.contact_area(plain, 0.0, p))
    u0 = p * float(_compliance(plain, 0.0, np.array([p]))[0])
    share = math.sqrt(2 * work * area / p / u0)
    found = float(rf.contact_area(_scene(work), 0.0, p))
    assert 0.2 < share < 1 and found == pytest.approx(area / (1 - share), rel=1e-6)
    # From a share of 1 on nothing holds the solids apart.
    sticky = rf.contact_area(_scene(1.5 * work / share**2), 0.0, np.array([1e-3, 1.0, 1e3]))
    np.testing.assert_allclose(sticky, sticky[0], rtol=0.01)
    assert sticky[0] > 0.1


@pytest.mark.parametrize("log_load", [0.0, 1.5])
def test_terms_of_the_formula_are_derivatives_over_the_load(log_load):
    """A, and p u' = du / d ln p of s = P (gamma + (1 - gamma) P^2), differentiated by mpmath."""
    x, storage, gamma, stiffness, end = [0.3, 0.7, 1.1], [2.0, 0.5, 1.0], 0.4, 3.0, 0.2
    point = Unloading(jnp.array(x), jnp.array(storage), jnp.array(end), stiffness, 1.0, gamma, None)

    def s(y):
        P = mpmath.erf(y)
        return P * (gamma + (1 - gamma) * P**2)

    def fall(z):
        terms = zip(x, storage, strict=True)
        total = sum(U * y * mpmath.exp(z) * mpmath.diff(s, y * mpmath.exp(z)) for y, U in terms)
        return 0.5 * stiffness * mpmath.exp(-z) * total

    rise = mpmath.diff(lambda z: mpmath.erf(end * mpmath.exp(z)), log_load)
    expected = rise, fall(log_load), fall(log_load) - mpmath.diff(fall, log_load)
    np.testing.assert_allclose(_slopes(point, log_load), [float(one) for one in expected], rtol=1e-10)


def test_the_pull_off_force_is_that_of_the_least_energy():
    """A smooth sphere has the pull-off force of Johnson, Kendall and Roberts; stiff roughness removes it."""
    force = rf.analysis.pull_off_force
    smooth = rf.Scene(rf.Body(rf.Rigid()), rf.Body(rf.Elastic(1e7, 0.5)), adhesion=rf.Adhesion(0.05))
    assert float(force(smooth, 1e-2, 1e5)) == pytest.approx(1.5 * math.pi * 1e-2 * 0.05, rel=1e-14)
    assert float(force(_scene(0.1 * FULL), 1e-2, 1e5)) == 0
    # Full contact is what holds most where the work is more than its energy, whatever load made the contact.
    for share in (1.5, 10):
        whole = np.asarray(force(_scene(share * FULL), 1e-2, [1e-20, 1.0, 1e5, 1e7, 1e9, 1e20]))
        np.testing.assert_allclose(whole, 1.5 * math.pi * 1e-2 * (share - 1) * FULL, rtol=1e-9)


@pytest.mark.parametrize("share", [1.1, pytest.param(1.5, marks=pytest.mark.slow), 3.0])
def test_the_work_of_separation_is_the_largest_of_all_loads(share):
    plain, work = _scene(), share * FULL
    load = np.geomspace(1e-3, 3e8, 4001)
    area = np.asarray(rf.contact_area(plain, 0.0, load))
    step = math.log(load[1] / load[0])
    done = load**2 * np.asarray(_compliance(plain, 0.0, load))
    stored = step * np.concatenate([[0.0], np.cumsum(0.5 * (done[1:] + done[:-1]))]) + done[0]
    left = np.max(work * area - stored + 0.5 * done)
    scene = _scene(work)
    found = float(rf.analysis.pull_off_force(scene, 1.0, 1e5)) / (1.5 * math.pi)
    assert left > 0 and found == pytest.approx(left, rel=1e-4)
    # Nothing is lost or gained between no load and the load that pulls them off: W is where it comes to rest.
    slope = jax.jit(jax.grad(lambda s: rf.analysis.pull_off_force(s, 1.0, 1e5)))(scene).adhesion.work
    near = [float(rf.analysis.pull_off_force(_scene(work * (1 + d)), 1.0, 1e5)) for d in (-1e-4, 1e-4)]
    assert float(slope) == pytest.approx((near[1] - near[0]) / (2e-4 * work), rel=1e-5)


@pytest.mark.slow
def test_values_and_derivatives_are_finite_at_extremes():
    def values(work, young, pressure):
        scene = _scene(work, WIDE, rf.Elastic(young, 0.5))
        return tuple(rf.solve(scene, 0.0, pressure)[:3:2])

    cases = np.array(
        [
            (work, young, pressure)
            for work in (1e-6, 1e-3, 10.0)
            for young in (1e4, 1e7, 1e11)
            for pressure in (1e-3, 1.0, 1e5, 1e10)
        ]
    ).T
    found = jax.jit(jax.vmap(values))(*cases)
    slopes = jax.jit(jax.vmap(jax.jacrev(values, (0, 1, 2))))(*cases)
    assert all(np.isfinite(x).all() for x in jax.tree.leaves((found, slopes)))
    assert np.all((found[0] > 0) & (found[0] <= 1) & (found[1] >= 0))


def test_areas_grow_with_the_load():
    pressure = np.geomspace(1e2, 1e7, 40)
    assert np.all(np.diff(rf.contact_area(_scene(0.05 * FULL_WIDE, WIDE), 0.0, pressure)) >= 0)


@pytest.mark.slow
def test_a_fit_finds_the_work_of_adhesion_across_jumps():
    """Friction from contact shear, with some points in full contact and some not."""
    ground = rf.SelfAffine(q0=1e4, qr=3e4, q1=1e6, hurst=0.8, h_rms=2e-7)

    def scene(work, tau):
        shear = rf.ContactShear(tau, 0.1, 1e-3)
        return _scene(work, ground, TREAD, area_correction=True, shear=shear)

    velocity, pressure = (x.ravel() for x in np.meshgrid(np.geomspace(1e-5, 0.1, 8), [1e4, 3e4, 6e4]))
    truth = scene(5e-4, 5e4)
    area = np.asarray(rf.contact_area(truth, velocity, pressure))
    assert np.any(area == 1) and np.any(area < 0.3)
    friction = np.asarray(rf.friction(truth, velocity, pressure))
    noise = 0.02 * friction * np.random.default_rng(0).standard_normal(friction.size)
    data = fitting.FrictionData(velocity, friction + noise, 0.02 * friction, pressure)
    free = {"adhesion.work": fitting.Positive(), "shear.tau_f0": fitting.Positive()}
    found = fitting.fit(scene(1e-4, 3e4), data, free)
    assert found.success
    for name, value in (("adhesion.work", 5e-4), ("shear.tau_f0", 5e4)):
        assert abs(found[name].value - value) < 3 * found[name].stderr < 0.1 * value


def test_what_adhesion_does_not_define_is_refused():
    with pytest.raises(ValueError, match=r"^scene.adhesion: the distribution of stresses is not"):
        rf.analysis.stress_distribution(_scene(0.05), 1e5, 0.0, 1e5)
    with pytest.raises(ValueError, match=r"^scene.adhesion is None; it must be an Adhesion"):
        rf.analysis.pull_off_force(_scene(), 1e-2, 1e5)
    with pytest.raises(ValueError, match=r"work"):
        rf.Adhesion(work=-1.0)
