"""Grip of a patch: closed forms of the brush model, brute force along the patch, derivatives, refusals."""

import itertools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.interpolate
import scipy.optimize
from problems import ROAD, SHEAR, SHIFTED_TREAD
from support.cases.stored import slow_if
from support.oracles.numerical import derivatives

import rubberfric as rf
from rubberfric import MeasuredPressure, Patch, Trapezoid
from rubberfric.applications import grip, peak_grip, slip_stiffness
from rubberfric.applications.brush_model import brush
from rubberfric.scene import cast

L, W, K, LOAD = 0.12, 0.15, 2e7, 3000.0
MEAN = LOAD / (L * W)
SCENE = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(SHIFTED_TREAD), shear=SHEAR)
TYRE = Patch(L, W, K)
SHAPES = {
    "parabolic": "parabolic",
    "uniform": "uniform",
    "trapezoid": Trapezoid(0.2),
    "measured": MeasuredPressure([0.0, 2.0, 3.0, 2.5, 1.0]),
}


def relative(name, s):
    """The pressure divided by its mean, written independently."""
    if name == "parabolic":
        return 6 * s * (1 - s)
    if name == "uniform":
        return np.ones_like(s)
    if name == "trapezoid":
        return np.interp(s, [0.0, 0.2, 0.8, 1.0], [0.0, 1.25, 1.25, 0.0])
    # The mean of the trapezoids between the values is 2.
    return np.interp(s, [0.0, 0.25, 0.5, 0.75, 1.0], np.array([0.0, 2.0, 3.0, 2.5, 1.0]) / 2.0)


def by_quadrature(limit, rise):
    """Mean stress, its mean moment and the sliding share of a patch, by adaptive quadrature.

    `limit` is the friction stress over s, and rise * s is the stress of a sticking element.
    """

    def excess(s):
        return rise * s - limit(s)

    grid = np.linspace(1e-9, 1, 20001)
    slides = np.flatnonzero(excess(grid) > 0)
    start = 1.0
    if slides.size:
        k = slides[0]
        start = scipy.optimize.brentq(excess, grid[k - 1], grid[k], xtol=1e-15) if k else 0.0
    found = [0.5 * rise * start**2, rise * (start**3 / 3 - start**2 / 4)]
    ends = [start, *(s for s in (0.2, 0.25, 0.5, 0.75, 0.8) if s > start), 1.0]
    for low, high in itertools.pairwise(ends):
        found[0] += scipy.integrate.quad(limit, low, high, epsabs=0, epsrel=1e-12)[0]
        found[1] += scipy.integrate.quad(lambda s: limit(s) * (s - 0.5), low, high, epsrel=1e-12)[0]
    return np.array(found), 1 - start


@pytest.mark.parametrize("mu", [0.3, pytest.param(1.2, marks=pytest.mark.slow)])
def test_constant_friction_under_a_parabola(mu):
    """F = mu F_z (3 t - 3 t^2 + t^3), M = mu F_z L t (1 - t)^3 / 2 with t = k sigma L / (6 mu p_mean)."""
    for t in (1e-6, 0.1, 0.5, 0.99, 1.0, 1.7):
        sigma = 6 * mu * MEAN * t / (K * L)
        force, moment, sliding = brush(TYRE, jnp.asarray(sigma), jnp.asarray(MEAN), jnp.full(8, mu))
        share = 3 * t - 3 * t**2 + t**3 if t < 1 else 1.0
        arm = 0.5 * t * (1 - t) ** 3 if t < 1 else 0.0
        assert float(force) == pytest.approx(mu * LOAD * share, rel=1e-10)
        assert float(moment) == pytest.approx(mu * LOAD * L * arm, abs=1e-10 * mu * LOAD * L)
        assert float(sliding) == pytest.approx(min(t, 1.0), abs=1e-12)


@pytest.mark.parametrize("name", slow_if(lambda name: name in ("uniform", "trapezoid"), SHAPES.keys()))
def test_constant_friction_under_every_pressure(name):
    """Against quadrature to 1e-10, and all of the load slides at large slip."""
    patch, mu = Patch(L, W, K, SHAPES[name]), 0.7
    count = 1 if name == "uniform" else 8
    for sigma in (0.002, 0.02, 0.1, 3.0):
        found = brush(patch, jnp.asarray(sigma), jnp.asarray(MEAN), jnp.full(count, mu))
        exact, share = by_quadrature(lambda s: MEAN * relative(name, s) * mu, K * sigma * L)
        np.testing.assert_allclose(found[0], L * W * exact[0], rtol=1e-10)
        np.testing.assert_allclose(found[1], L**2 * W * exact[1], atol=1e-10 * mu * LOAD * L)
        assert float(found[2]) == pytest.approx(share, abs=1e-10)
    # Under a uniform pressure the first elements always stick.
    assert float(found[0]) == pytest.approx(mu * LOAD, rel=1e-2 if name == "uniform" else 1e-10)


def friction_over_pressure(sliding_speed, temperature):
    """Friction as a function of pressure, a spline through 200 pressures."""
    p = np.geomspace(1e-7 * MEAN, 2 * MEAN, 200)
    mu = np.asarray(rf.friction(SCENE, sliding_speed, p, temperature))
    return scipy.interpolate.CubicSpline(np.log(p), mu)


@pytest.mark.parametrize("kind", ["angle", "ratio"])
@pytest.mark.parametrize("name", slow_if(lambda name: name != "parabolic", SHAPES.keys()))
def test_friction_of_a_scene(name, kind):
    """Friction that depends on speed, pressure and temperature, against quadrature to 1e-7."""
    patch, speed, T = Patch(L, W, K, SHAPES[name]), 3.0, 300.0
    slips = np.array([0.01, 0.05, 0.3])
    found = grip(SCENE, patch, slips, speed, LOAD, T, kind)
    for i, slip in enumerate(slips):
        sigma, v = (
            (np.tan(slip), speed * np.sin(slip)) if kind == "angle" else (slip / (1 + slip), speed * slip)
        )
        mu = friction_over_pressure(v, T)

        def limit(s, mu=mu):
            p = MEAN * relative(name, s)
            return p * mu(np.log(np.maximum(p, 1e-7 * MEAN)))

        exact, share = by_quadrature(limit, K * sigma * L)
        assert float(found.force[i]) == pytest.approx(L * W * exact[0], rel=1e-7)
        assert float(found.coefficient[i]) == pytest.approx(L * W * exact[0] / LOAD, rel=1e-7)
        assert float(found.sliding[i]) == pytest.approx(share, abs=1e-6)
        if kind == "angle":
            assert float(found.moment[i]) == pytest.approx(L**2 * W * exact[1], abs=1e-7 * LOAD * L)
    assert (found.moment is None) == (kind == "ratio")


def test_signs_and_broadcasting():
    slip = np.array([-0.05, 0.0, 0.05])
    side = grip(SCENE, TYRE, slip, 3.0, np.array([[1000.0], [3000.0]]), 300.0)
    assert side.force.shape == side.moment.shape == side.sliding.shape == (2, 3)
    np.testing.assert_allclose(side.force[:, 0], -side.force[:, 2], rtol=1e-13)
    np.testing.assert_allclose(side.moment[:, 0], -side.moment[:, 2], rtol=1e-13)
    np.testing.assert_array_equal(side.force[:, 1], 0.0)
    one = grip(SCENE, TYRE, 0.05, 3.0, 3000.0, 300.0)
    np.testing.assert_allclose(one.force, side.force[1, 2], rtol=1e-12)
    # A braked wheel turns more slowly, so that its elements stick longer at an equal sliding speed.
    brake, drive = grip(SCENE, TYRE, np.array([-0.05, 0.05]), 3.0, 3000.0, 300.0, "ratio").force
    assert -brake > drive > 0


def test_slip_stiffness():
    """k L^2 w / 2 is the slope of the force at zero slip, by derivative and by a small slip."""
    stiffness = float(slip_stiffness(TYRE))
    assert stiffness == pytest.approx(K * L**2 * W / 2, rel=1e-15)
    for kind in ("angle", "ratio"):
        slope = jax.grad(lambda slip, kind=kind: grip(SCENE, TYRE, slip, 3.0, LOAD, 300.0, kind).force)(0.0)
        assert float(slope) == pytest.approx(stiffness, rel=1e-12)


def total(scene, patch, slip, speed, load, temperature):
    found = grip(scene, patch, slip, speed, load, temperature)
    return jnp.sum(found.coefficient) + 10 * jnp.sum(found.moment) / LOAD


def test_derivatives():
    """By every number of scene, patch and conditions, in both modes, against central differences."""
    arguments = SCENE, TYRE, jnp.array([0.02, 0.2]), jnp.asarray(3.0), jnp.asarray(LOAD), jnp.asarray(300.0)
    leaves, tree = jax.tree.flatten(arguments)
    sizes = [np.size(leaf) for leaf in leaves]
    flat = np.concatenate([np.ravel(np.asarray(leaf, float)) for leaf in leaves])

    @jax.jit
    def value(x):
        parts = jnp.split(flat * jnp.exp(x), np.cumsum(sizes)[:-1])
        pairs = zip(parts, leaves, strict=True)
        return total(*tree.unflatten([part.reshape(np.shape(leaf)) for part, leaf in pairs]))

    zero = jnp.zeros(flat.size)
    reverse, forward = jax.jit(jax.grad(value))(zero), jax.jit(jax.jacfwd(value))(zero)
    np.testing.assert_allclose(forward, reverse, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(reverse, derivatives(value, flat.size, 1e-4), rtol=1e-6, atol=1e-9)


@pytest.mark.slow
def test_second_derivatives():
    """Where elements begin to slide carries no first derivative of the force, but a second one."""

    def force(x):
        patch = TYRE.replace(stiffness=K * jnp.exp(x[0]))
        scene = SCENE.replace("shear.tau_f0", 6.5e6 * jnp.exp(x[1]))
        return grip(scene, patch, 0.03 * jnp.exp(x[2]), 3.0, LOAD * jnp.exp(x[3]), 300.0).coefficient

    zero = jnp.zeros(4)
    hessian = jax.jit(jax.hessian(force))(zero)
    gradient, step = jax.jit(jax.grad(force)), 1e-4
    for i in range(4):
        unit = zero.at[i].set(step)
        difference = (gradient(unit) - gradient(-unit)) / (2 * step)
        np.testing.assert_allclose(hessian[i], difference, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(hessian, hessian.T, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["angle", "ratio"])
def test_peak(kind):
    """Against a search of SciPy, and derivatives of force and slip against differences of such searches."""
    between = (1e-3, 0.8) if kind == "angle" else (-0.8, -1e-3)
    sign = np.sign(between[0])

    def searched(stiffness, shear):
        patch, scene = TYRE.replace(stiffness=stiffness), SCENE.replace("shear.tau_f0", shear)
        value = jax.jit(lambda x: sign * grip(scene, patch, sign * jnp.exp(x), 3.0, LOAD, 300.0, kind).force)
        grid = np.linspace(*np.log(np.sort(np.abs(between))), 200)
        k = int(np.argmax(value(grid)))
        slope = jax.jit(jax.grad(value))
        x = scipy.optimize.brentq(lambda x: float(slope(x)), grid[k - 1], grid[k + 1], xtol=1e-14)
        return float(value(x)), x

    def found(x):
        patch = TYRE.replace(stiffness=K * jnp.exp(x[0]))
        scene = SCENE.replace("shear.tau_f0", 6.5e6 * jnp.exp(x[1]))
        peak = peak_grip(scene, patch, 3.0, LOAD, 300.0, kind, between=between)
        return jnp.stack([sign * peak.force, jnp.log(sign * peak.slip)])

    zero, step = jnp.zeros(2), 1e-3
    force, log_slip = found(zero)
    exact = searched(K, 6.5e6)
    assert float(force) == pytest.approx(exact[0], rel=1e-12)
    assert float(log_slip) == pytest.approx(exact[1], abs=1e-7)
    slopes = jax.jit(jax.jacrev(found))(zero)
    for i, unit in enumerate(np.eye(2)):
        up, down = (searched(*(np.array([K, 6.5e6]) * np.exp(s * step * unit))) for s in (1, -1))
        np.testing.assert_allclose(slopes[:, i], (np.array(up) - np.array(down)) / (2 * step), rtol=1e-4)


@pytest.mark.slow
def test_peak_at_an_end():
    """In a range of small slips the force rises everywhere."""
    patch = TYRE.replace(pressure="uniform")  # which needs the friction at one pressure
    rising = peak_grip(SCENE, patch, 3.0, np.array([LOAD, 2 * LOAD]), 300.0, between=(1e-3, 5e-3))
    assert not np.any(rising.inside)
    np.testing.assert_allclose(rising.slip, 5e-3, rtol=1e-12)
    np.testing.assert_allclose(rising.force[0], grip(SCENE, patch, 5e-3, 3.0, LOAD, 300.0).force, rtol=1e-12)
    for wrong in ((0.1, 0.01), (-0.1, 0.1), (0.0, 0.1)):
        with pytest.raises(ValueError, match="must be two slips of one sign"):
            peak_grip(SCENE, TYRE, 3.0, LOAD, 300.0, between=wrong)


@pytest.mark.slow
def test_float32():
    """A scene in single precision gives results in single precision."""
    low, patch = cast(SCENE, "float32"), TYRE.replace(pressure="uniform")  # with one friction for each slip
    side, peak = grip(low, patch, 0.03, 3.0, LOAD, 300.0), peak_grip(low, patch, 3.0, LOAD, 300.0)
    for value in (side.force, side.moment, side.sliding, peak.slip, peak.force):
        assert value.dtype == jnp.float32
    expected = peak_grip(SCENE, patch, 3.0, LOAD, 300.0)
    assert float(peak.force) == pytest.approx(float(expected.force), rel=1e-5)
    # Next to the peak, rounding of the force moves the slip.
    assert float(peak.slip) == pytest.approx(float(expected.slip), rel=1e-2)


def grip_with(**change):
    given = {"patch": TYRE, "slip": 0.1, "speed": 3.0, "load": LOAD, "temperature": 300.0} | change
    return grip(SCENE, **given)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: grip_with(slip=5.0), "slip = 5.0: must be between -pi/2 and pi/2; is it in degrees?"),
        (lambda: grip_with(slip=-1.0, kind="ratio"), "slip = -1.0: must be > -1"),
        (lambda: grip_with(speed=-3.0), "speed = -3.0: must be > 0"),
        (lambda: grip_with(kind="side"), "kind = 'side': must be 'angle' or 'ratio'"),
        (lambda: grip_with(patch=3.0), "patch is a float: must be a Patch"),
        (lambda: Patch(L, W, K, "round"), "Patch.pressure = 'round': must be 'parabolic', 'uniform'"),
        (lambda: Patch(-L, W, K), "Patch.length = -0.12"),
        (lambda: Trapezoid(0.6), "Trapezoid.ramp = 0.6: must be between"),
        (lambda: MeasuredPressure([1.0]), "must have at least two"),
        (lambda: MeasuredPressure([0.0, 0.0, 0.0]), "all pressures are 0: one must be > 0"),
        (lambda: MeasuredPressure([1.0, -1.0]), "MeasuredPressure.values[1] = -1"),
    ],
)
def test_refused(make, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        make()
