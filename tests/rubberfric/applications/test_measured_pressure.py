"""Grip under measured pressures: places without pressure, grooves, and many values with scatter."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import ROAD, SHEAR, SHIFTED_TREAD
from support.cases.stored import slow_if

import rubberfric as rf
from rubberfric.applications import grip, slip_stiffness
from rubberfric.applications.brush_model import brush
from rubberfric.scene import cast

L, W, K, LOAD, MU = 0.12, 0.15, 5e7, 3000.0, 0.7
MEAN = LOAD / (L * W)
SLIPS = np.array([0.003, 0.01, 0.02, 0.03, 0.04, 0.06, 1.0])
VALUES = {
    "pads": [0.0, 0.0, 200.0, 300.0, 200.0, 0.0, 0.0],
    "groove": [50.0, 200.0, 0.0, 0.0, 0.0, 250.0, 100.0, 0.0],
    "point": [0.0, 300.0, 0.0, 250.0, 30.0],
    "everything": [0.0, 0.0, 200.0, 300.0, 0.0, 0.0, 250.0, 100.0, 300.0, 0.0],
}


def film(count, seed):
    """A trapezoid with 10 % scatter. Of three seeds, one has pads, and one has a groove."""
    s = np.linspace(0, 1, count)
    scatter = 1 + 0.1 * np.random.default_rng(seed).standard_normal(count)
    values = 300 * np.minimum(1, np.minimum(s, 1 - s) / 0.15) * scatter
    if seed % 3 == 1:
        values[: count // 5] = 0.0
    if seed % 3 == 2:
        values[count // 2] = 0.0
    return values


def patch_of(values):
    return rf.Patch(L, W, K, rf.MeasuredPressure(values))


def closed_form(values, sigma):
    """Force, moment and sliding share for a constant friction coefficient, by straight lines of stress."""
    x = np.linspace(0, 1, len(values))
    limits = np.asarray(values) / np.trapezoid(values, x) * MEAN * MU
    rise, slides, entry = K * sigma * L, False, 0.0
    force = moment = sliding = contact = 0.0

    def add(ends, stresses):
        nonlocal force, moment
        (a, b), (low, high) = ends, stresses
        force += L * W * (b - a) * (low + high) / 2
        # Simpson's rule is exact for the product of two lines.
        middle = (low + high) * ((a + b) / 2 - 0.5)
        moment += L**2 * W * (b - a) / 6 * (low * (a - 0.5) + 2 * middle + high * (b - 0.5))

    for (a, b), (low, high) in zip(itertools.pairwise(x), itertools.pairwise(limits), strict=True):
        if low == 0:
            entry, slides = a, False
        if low == high == 0:
            continue
        before, after = rise * (a - entry) - low, rise * (b - entry) - high
        if slides or after <= 0:
            start = a if slides else b
        else:
            slides = True
            start = a - (b - a) * before / (after - before) if before < 0 else a
        add((a, start), (rise * (a - entry), rise * (start - entry)))
        add((start, b), (low + (high - low) * (start - a) / (b - a), high))
        sliding, contact = sliding + b - start, contact + b - a
    return force, moment, sliding / contact


def assert_closed_form(values):
    over_slips = jax.vmap(brush, (None, 0, None, None))
    results = over_slips(patch_of(values), jnp.asarray(SLIPS), jnp.asarray(MEAN), jnp.full(8, MU))
    expected = np.array([closed_form(values, sigma) for sigma in SLIPS]).T
    np.testing.assert_allclose(results[0], expected[0], rtol=1e-11)
    np.testing.assert_allclose(results[1], expected[1], atol=1e-11 * MU * LOAD * L)
    np.testing.assert_allclose(results[2], expected[2], atol=1e-11)


@pytest.mark.parametrize("name", slow_if(lambda name: name in ("groove", "point"), VALUES.keys()))
def test_places_without_pressure(name):
    """An element without pressure carries nothing, and enters the next contact without deflection."""
    assert_closed_form(np.array(VALUES[name]))


@pytest.mark.parametrize("count", slow_if(lambda count: count != 88, (20, 44, 88, 200)))
def test_scatter(count):
    """Elements begin to slide at a minimum of the pressure, which even steps along the patch miss."""
    for seed in range(12):
        assert_closed_form(film(count, seed))


def test_pads_outside_the_contact():
    """A record with pads has the force, moment and sliding share of a shorter patch without them."""
    values = np.array(VALUES["pads"])
    scene = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(SHIFTED_TREAD), shear=SHEAR)
    with_pads = grip(scene, patch_of(values), SLIPS, 3.0, LOAD, 300.0)
    short = rf.Patch(L * 4 / 6, W, K, rf.MeasuredPressure(values[1:-1]))
    without = grip(scene, short, SLIPS, 3.0, LOAD, 300.0)
    for name in ("force", "moment", "sliding"):
        np.testing.assert_allclose(getattr(with_pads, name), getattr(without, name), rtol=1e-9, atol=1e-9)
    assert float(with_pads.sliding[0]) < 0.1


@pytest.mark.parametrize(
    ("name", "squares"),
    [
        ("pads", 4 / 9),
        pytest.param("groove", 13 / 49, marks=pytest.mark.slow),
        pytest.param("point", 1 / 2, marks=pytest.mark.slow),
        ("everything", 25 / 81),
    ],
)
def test_slip_stiffness(name, squares):
    """k w / 2 times the sum of the squared lengths of all contacts is the slope of the force at zero slip."""
    values = np.array(VALUES[name])
    stiffness = float(slip_stiffness(patch_of(values)))
    assert stiffness == pytest.approx(K * L**2 * W / 2 * squares, rel=1e-13)

    @jax.jit
    @jax.grad
    def slope(sigma):
        return brush(patch_of(values), sigma, jnp.asarray(MEAN), jnp.full(8, MU))[0]

    assert float(slope(0.0)) == pytest.approx(stiffness, rel=1e-13)
    assert float(slope(1e-6)) == pytest.approx(stiffness, rel=1e-3)


def test_derivatives_of_traced_values():
    """Compiled once for several sets of contacts: finite, and those of the closed form by pressures > 0."""

    def force(values, sigma):
        return brush(patch_of(values), sigma, jnp.asarray(MEAN), jnp.full(8, MU))[0]

    records = np.array([VALUES["pads"], [0.0, 300.0, 0.0, 0.0, 200.0, 250.0, 0.0]])
    by_values, by_slip = jax.jit(jax.vmap(jax.grad(force, (0, 1)), (0, None)))(records, jnp.asarray(0.02))
    assert np.all(np.isfinite(by_values))
    step = 1e-3
    for values, gradient, slope in zip(records, by_values, by_slip, strict=True):
        for i in np.flatnonzero(values):
            change = step * np.eye(len(values))[i]
            up, down = (closed_form(values + sign * change, 0.02)[0] for sign in (1, -1))
            assert float(gradient[i]) == pytest.approx((up - down) / (2 * step), rel=1e-6, abs=1e-8)
        up, down = (closed_form(values, 0.02 + sign * 1e-6)[0] for sign in (1, -1))
        assert float(slope) == pytest.approx((up - down) / 2e-6, rel=1e-6)


def test_float32():
    """Contacts that begin inside a patch begin there in single precision too."""
    patch = cast(patch_of(VALUES["everything"]), "float32")
    sigmas = jnp.asarray(SLIPS, jnp.float32)
    over_slips = jax.vmap(brush, (None, 0, None, None))
    results = over_slips(patch, sigmas, jnp.float32(MEAN), jnp.full(8, MU, jnp.float32))
    expected = np.array([closed_form(np.array(VALUES["everything"]), sigma) for sigma in SLIPS]).T
    for value, exact in zip(results, expected, strict=True):
        assert value.dtype == jnp.float32
        np.testing.assert_allclose(value, exact, rtol=1e-5, atol=1e-5 * np.max(np.abs(exact)))
    assert slip_stiffness(patch).dtype == jnp.float32
