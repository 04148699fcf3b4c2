"""Adhesion of long range: the load of the contact against brute force over its separations."""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import special
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq
from support.oracles.dmt_attraction import DmtAttraction

import rubberfric as rf
from rubberfric.theory.adhesive_contact import relative_attraction
from rubberfric.theory.area.separations import loss_table, loss_weight, scaled_erfc, spread
from rubberfric.theory.integrals import prepare
from rubberfric.theory.structure import SurfaceTemperatures

Q0, Q1, HURST, H_RMS, YOUNG = 1e4, 1e6, 0.8, 2e-7, 1e7
FINE = rf.SelfAffine(q0=Q0, qr=Q0, q1=Q1, hurst=HURST, h_rms=H_RMS)
ROLLING = FINE.replace(qr=3e4)
MODULUS = YOUNG / 0.75
QUADRATURE = rf.Quadrature(order=8, panels=6, graded=3, ratio=6.0)
AREA = ("area", "separation", "converged")
_solve = jax.jit(functools.partial(rf.solve, quantities=AREA))


def _scene(work=None, reach=None, spectrum=FINE, **options):
    adhesion = None if work is None else rf.Adhesion(work, limit="long", range=reach)
    return rf.Scene(
        rf.Body(rf.Rigid(), spectrum), rf.Body(rf.Elastic(YOUNG, 0.5)), adhesion=adhesion, **options
    )


_area = jax.jit(rf.contact_area)
_fine_area = jax.jit(functools.partial(rf.contact_area, quadrature=rf.Quadrature()))


def _load_of(scene, area, velocity=0.0):
    """The pressure at which contact without adhesion has this area."""
    return brentq(lambda p: float(_area(scene, velocity, p)) - area, 1e3, 1e7, xtol=1e-6)


class _Theory:
    """The distribution of separations at a load by sums over wavevectors, of a power law from q0 to q1."""

    def __init__(self, pressure, gamma=0.5, count=3000):
        power = 2 * (1 + HURST)
        C0 = H_RMS**2 * HURST / (math.pi * Q0**2 * (1 - (Q1 / Q0) ** (-2 * HURST)))
        t = np.linspace(0, 1, count + 1) ** 2 * math.log(Q1 / Q0)
        self.q = Q0 * np.exp(t)
        scale = math.pi / 4 * (MODULUS / pressure) ** 2 * C0 * Q0**power
        self.G = scale * (self.q ** (4 - power) - Q0 ** (4 - power)) / (4 - power)
        with np.errstate(divide="ignore"):
            self.P = special.erf(0.5 / np.sqrt(self.G))
        self.h2 = 2 * math.pi * C0 * Q0**power * (self.q ** (2 - power) - Q1 ** (2 - power)) / (power - 2)
        # d^2q C K at the middle of every cell.
        q = np.sqrt(self.q[1:] * self.q[:-1])
        storage = 2 * math.pi * q**2 * C0 * (q / Q0) ** -power * q / 2 * MODULUS * np.diff(np.log(self.q))
        G = scale * (q ** (4 - power) - Q0 ** (4 - power)) / (4 - power)
        # Psi by the sum of its integral, with s' = erf'(gamma + 3 (1 - gamma) erf^2).
        s = np.exp(np.linspace(-16, 3, 60001))
        slope = 2 / math.sqrt(math.pi) * np.exp(-s * s) * (gamma + 3 * (1 - gamma) * special.erf(s) ** 2)
        steps = 0.5 * (slope[1:] + slope[:-1]) * np.diff(np.log(s))
        psi = np.append(np.cumsum(steps[::-1])[::-1], 0.0)
        volume = []
        for at, P in zip(self.G, self.P, strict=True):
            rise = np.where(at < G, G - at, 1.0)
            x = np.where(at < G, 0.5 / (P * np.sqrt(rise)), 20.0)
            mean = np.interp(np.log(x), np.log(s), psi) * x * P / (2 * pressure)
            volume.append(P * np.sum(np.where(at < G, mean, 0.0) * storage))
        self.volume = np.array(volume)

    def attraction(self, reach):
        """Mean of exp(-u / r): of the gaps by their density on a grid."""
        lost = -np.diff(self.P)
        some = lost > 1e-13
        u1 = np.diff(self.volume)[some] / np.diff(self.P)[some]
        h = np.sqrt(0.5 * (self.h2[1:] + self.h2[:-1])[some])
        # Over u / h about u1, both sides folded into u > 0.
        z, step = np.linspace(-8.5, 8.5, 681, retstep=True)
        u = np.abs(u1[:, None] + h[:, None] * z)
        mean = np.exp(-u / reach) @ np.exp(-z * z / 2) * step / math.sqrt(2 * math.pi)
        return self.P[-1] + np.sum(lost[some] * mean)


@pytest.mark.parametrize(
    ("pressure", "share", "reach"),
    [
        (1e5, 3.0, 1e-8),
        pytest.param(1e4, 10.0, 3e-7, marks=pytest.mark.slow),
        pytest.param(1e5, 1.0, 1e-7, marks=pytest.mark.slow),
        pytest.param(1e6, 0.5, 3e-9, marks=pytest.mark.slow),
    ],
)
def test_the_load_agrees_with_brute_force(pressure, share, reach):
    strength = share * pressure

    def excess(load):
        return load - pressure - strength * _Theory(load, count=1500).attraction(reach)

    load = brentq(excess, pressure, pressure + strength, rtol=1e-5)
    found = _solve(_scene(strength * reach, reach), 0.0, pressure)
    at = _Theory(load)
    assert found.converged
    assert float(found.area) == pytest.approx(at.P[-1], rel=3e-4)
    assert float(found.separation) == pytest.approx(at.volume[0], rel=2e-3)
    assert load > 1.1 * pressure


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


@pytest.mark.slow
def test_a_vanishing_work_is_contact_without_adhesion():
    pressure = np.array([1e3, 1e5, 1e6])
    for spectrum in (FINE, ROLLING):
        scene, plain = _scene(1e-26, 1e-7, spectrum), _fine_area(_scene(spectrum=spectrum), 0.0, pressure)
        usual = [_solve(scene, 0.0, p).area for p in pressure]
        np.testing.assert_allclose(usual, plain, rtol=1e-9)
        np.testing.assert_allclose(_fine_area(scene, 0.0, pressure), plain, rtol=1e-13)


@pytest.mark.slow
def test_nodes_are_enough():
    """Twice as many change areas by 3e-5 at most, at very light load by 2e-3."""
    cases = [(1e5, 1e-2, 1e-7), (1e3, 1e-3, 1e-8), (1e5, 1e-3, 1e-9), (1e2, 1e-4, 1e-7)]
    for pressure, work, reach in cases:
        scene = _scene(work, reach, ROLLING)
        usual, fine = (
            float(rf.contact_area(scene, 0.0, pressure, quadrature=rf.Quadrature(order=order)))
            for order in (13, 26)
        )
        assert usual == pytest.approx(fine, rel=3e-5 if pressure > 1e2 else 2e-3)


@pytest.mark.slow
def test_attraction_enlarges_the_area_and_brings_the_solids_together():
    works = [1e-6, 1e-4, 1e-3, 1e-2, 0.1, 10.0]
    found = [
        rf.solve(_scene(w, 1e-7), 0.0, [1e4, 1e5], quadrature=QUADRATURE, quantities=AREA) for w in works
    ]
    areas, gaps = (np.array([getattr(one, name) for one in found]) for name in ("area", "separation"))
    assert np.all(np.diff(areas, axis=0) >= 0) and np.all(np.diff(gaps, axis=0) <= 0)
    np.testing.assert_allclose(areas[-1], 1.0, atol=1e-12)
    assert np.all([one.converged for one in found])


def _plateau(work=None, reach=1.5e-6):
    """A plateau, and areas of 1e-7 to 1e-3."""
    adhesion = None if work is None else rf.Adhesion(work, limit="long", range=reach)
    spectrum = rf.SelfAffine(5.8e4, 1.8e5, 2.5e6, 0.62, 3.1e-6)
    return rf.Scene(
        rf.Body(rf.Rigid(), spectrum), rf.Body(rf.Elastic(4e6, 0.49)), gamma=1.0, adhesion=adhesion
    )


@pytest.mark.slow
def test_light_loads_agree_with_brute_force():
    """Nodes placed for another load gave areas 2 to 800 times too large."""
    brute = DmtAttraction(5.8e4, 1.8e5, 2.5e6, 0.62, 3.1e-6, 4e6 / (1 - 0.49**2), 1.0)
    pressure = np.array([1.0, 30.0, 200.0, 2e3, 2e4])
    found = rf.solve(_plateau(0.3), 0.0, pressure, quantities=AREA)
    for p, area in zip(pressure[1:4:2], found.area[1:4:2], strict=True):
        assert float(area) == pytest.approx(brute.area(brute.load(p, 0.3, 1.5e-6)), rel=1e-6)
    assert found.converged.all()
    # At light load the attraction is a share of the load, and so is the area.
    gain = found.area / rf.contact_area(_plateau(), 0.0, pressure)
    np.testing.assert_allclose(gain[:3], gain[0], rtol=1e-5)


@pytest.mark.parametrize(
    "pressure", [2e5, *(pytest.param(p, marks=pytest.mark.slow) for p in (1.0, 1e3, 5e5))]
)
def test_the_attraction_agrees_with_brute_force(pressure):
    brute = DmtAttraction(5.8e4, 1.8e5, 2.5e6, 0.62, 3.1e-6, 4e6 / (1 - 0.49**2), 1.0)

    @jax.jit
    def attraction(at):
        prepared = prepare(_plateau(0.3), ("area", "separation"), rf.Quadrature())
        given = prepared.adhesion, prepared.roughness, 0 * at, at, [SurfaceTemperatures(None, None)]
        return relative_attraction(*given)[1]

    share = attraction(jnp.array([pressure]))
    assert float(share[0]) == pytest.approx(brute.attraction(pressure, 1.5e-6), rel=1e-5)


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
@pytest.mark.parametrize(("share", "reach"), [(30.0, 1e-8), (300.0, 3e-9), (10.0, 1e-7)])
def test_no_lesser_load_is_a_solution(share, reach):
    """Below it the attraction always exceeds the missing load."""
    scene, pressure = _scene(share * 1e3 * reach, reach), 1e3
    found = _solve(scene, 0.0, pressure)
    area = float(found.area)
    load = _load_of(_scene(), area)
    for less in np.geomspace(pressure, 0.998 * load, 12):
        assert less - pressure < share * pressure * _Theory(less, count=1000).attraction(reach)
    assert found.converged


@pytest.mark.slow
@pytest.mark.parametrize("mode", [jax.jacrev, jax.jacfwd])
def test_derivatives_are_those_of_the_values(mode):
    def found(parameters):
        work, reach, young, h_rms, pressure = jnp.exp(parameters)
        scene = _scene(1.0, 1.0, ROLLING).replace(
            {"adhesion.work": work, "adhesion.range": reach, "upper.material.young": young}
        )
        scene = scene.replace("lower.spectrum.h_rms", h_rms)
        at_points = rf.solve(scene, 0.0, pressure, quadrature=rf.Quadrature(), quantities=AREA[:2])
        return jnp.stack([at_points.area, at_points.separation])

    at = jnp.log(jnp.array([1e-2, 1e-7, 1e7, 2e-7, 1e5]))
    slopes = jax.jit(mode(found))(at)
    steps = 1e-5 * jnp.concatenate([jnp.eye(5), -jnp.eye(5)])
    above, below = jnp.split(jax.jit(jax.vmap(found))(at + steps), 2)
    np.testing.assert_allclose(slopes, (above - below).T / 2e-5, rtol=1e-5)
    # Whatever the units: lengths times l and pressures times p leave the area.
    assert float(slopes[0, jnp.array([0, 2, 4])].sum()) == pytest.approx(0.0, abs=1e-6)


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


def test_the_table_of_where_contact_is_lost():
    """Against derivatives of the formula."""
    log_x = np.random.default_rng(0).uniform(-12, 1.6, 300)

    @jax.jit
    def both(gamma, c):
        slope = jax.vmap(jax.grad(lambda t: -loss_weight(jnp.exp(t), c, gamma)))(log_x)
        return loss_table(gamma)(jnp.asarray(log_x), c), slope

    for gamma, c in ((0.5, 4 / math.pi), (0.0, 30.0), (1.0, 0.0)):
        table, slope = both(gamma, c)
        np.testing.assert_allclose(table, slope, atol=3e-8 * float(np.abs(slope).max()) + 1e-10)


@pytest.mark.parametrize("place", range(3), ids=["log_x", "c", "gamma"])
def test_derivatives_of_the_table_of_the_losses_are_differences(place):
    log_x = jnp.asarray(np.random.default_rng(1).uniform(-3, 1.5, 50))
    at, move = (log_x, jnp.asarray(1.3), jnp.asarray(0.4)), [jnp.zeros(50), jnp.zeros(()), jnp.zeros(())]
    move[place] = jnp.ones_like(move[place])

    @jax.jit
    def value(log_x, c, gamma):
        return loss_table(gamma)(log_x, c)

    def moved(step):
        return value(*(x + step * dx for x, dx in zip(at, move, strict=True)))

    _, slope = jax.jvp(value, at, tuple(move))
    np.testing.assert_allclose(slope, (moved(1e-5) - moved(-1e-5)) / 2e-5, rtol=1e-5, atol=1e-6)


@pytest.mark.slow
def test_the_weights_of_the_separations():
    """erfcx and the mean over Gaussians, against scipy and a sum."""
    z = np.geomspace(1e-3, 1e9, 100)
    np.testing.assert_allclose(scaled_erfc(jnp.asarray(z)), special.erfcx(z), rtol=1e-14)
    for u, h, r in ((1.0, 0.5, 0.3), (0.2, 1.0, 3.0), (5.0, 0.01, 2.0), (1e-3, 1.0, 0.05), (40.0, 1.0, 5.0)):
        grid, step = np.linspace(-12, 12, 2000001, retstep=True)
        mean = np.sum(np.exp(-np.abs(u + h * grid) / r - grid**2 / 2)) * step / math.sqrt(2 * math.pi)
        assert float(spread(*map(jnp.asarray, (u, h, r)))) == pytest.approx(mean, rel=1e-6)


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
    states = [_Theory(load, count=800) for load in np.exp(log_load)]
    gaps = make_interp_spline(log_load, [one.volume[0] for one in states])
    share = make_interp_spline(log_load, [one.attraction(reach) for one in states])
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
        assert full - 2e-6 <= left < 1  # near full contact <e^-u/r> is 1e-6 off
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
