"""The law fitted to boundary elements: brute force, limits, profiles, refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems.scenes import GEL as RUBBER
from problems.scenes import GENTLE as ROAD
from support.oracles.friction_law import friction_law

import rubberfric as rf


def _scene(material=RUBBER, road=ROAD, **options):
    return rf.Scene(
        rf.Body(material), rf.Body(rf.Rigid(), road), contact_model="boundary_elements", **options
    )


MODELS = "boundary_elements", "paper"
_value_and_slopes = jax.jit(jax.value_and_grad(rf.friction, argnums=(0, 2)))


def _solve(scene, velocity, pressure):
    return rf.solve(scene, velocity, pressure, quantities=("area", "friction"))


def _with(name):
    return _scene().replace({"contact_model": name})


def _rubber(omega):
    """Return E / (1 - nu^2) of RUBBER."""
    relaxing = sum(E * 1j * omega * tau / (1 + 1j * omega * tau) for E, tau in ((9e6, 1e-3), (3e6, 0.1)))
    return (1e6 + relaxing) / 0.75


@pytest.mark.parametrize(
    ("ratio", "angle"),
    [
        pytest.param(1.5, 0.0, marks=pytest.mark.slow),
        (0.6, 0.7),
        pytest.param(1.8, 2.2, marks=pytest.mark.slow),
    ],
)
def test_brute_force_of_grooves(ratio, angle):
    """Area and friction along and across the direction of sliding, and full contact as in the paper."""
    scene = _scene(road=rf.Anisotropic(ROAD, ratio, angle))

    def density(phi):
        across = np.cos(phi - angle) ** 2 * ratio + np.sin(phi - angle) ** 2 / ratio
        return across ** -(1 + float(ROAD.hurst))

    expected = friction_law(_rubber, ROAD, 0.1, 2e5, density=density)
    law, paper = (scene.replace({"contact_model": name}) for name in MODELS)
    names = ("area", "friction", "transverse_friction")
    found, full, papers = (
        rf.solve(one, 0.1, pressure, quantities=names)
        for one, pressure in ((law, 2e5), (law, 1e9), (paper, 1e9))
    )
    for name, value in zip(names, expected, strict=True):
        np.testing.assert_allclose(getattr(found, name), value, rtol=1e-7, atol=1e-12)
        np.testing.assert_allclose(getattr(full, name), getattr(papers, name), rtol=1e-7, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("slab", [rf.Slab(5e-3, "bonded"), rf.Slab(2e-3, "frictionless")])
def test_brute_force_of_a_slab(slab):
    """The stiffness of a slab is a factor of the modulus at every wavevector."""
    x = rf.Scene(rf.Body(RUBBER, layer=slab), rf.Body(rf.Rigid(), ROAD), contact_model="boundary_elements")
    found = _solve(x, 0.1, 3e5)

    def stiffer(q):
        x = np.minimum(slab.thickness * q, 100.0)
        if slab.base == "frictionless":
            return 1 / np.tanh(x) + x / np.sinh(x) ** 2
        return (2 * np.sinh(x) ** 2 + 2 * x**2 + 2) / (np.sinh(2 * x) - 2 * x)

    expected = friction_law(_rubber, ROAD, 0.1, 3e5, stiffer=stiffer)
    np.testing.assert_allclose([found.area, found.friction], expected[:2], rtol=1e-7)


def test_thick_slabs_are_half_spaces():
    thick = _scene().replace(lower=rf.Body(RUBBER, layer=rf.Slab(1.0, "bonded")))
    found, expected = (_solve(one, 0.1, 1e5) for one in (thick, _scene()))
    np.testing.assert_allclose([found.area, found.friction], [expected.area, expected.friction], rtol=1e-10)


@pytest.mark.parametrize("layer", [None, rf.Slab(5e-3)])
def test_full_contact_is_the_papers(layer):
    law, paper = (_with(name).replace(lower=rf.Body(RUBBER, layer=layer)) for name in MODELS)
    found, expected = (_solve(scene, 0.1, 1e9) for scene in (law, paper))
    np.testing.assert_allclose(found.area, 1.0, rtol=1e-12)
    np.testing.assert_allclose(found.friction, expected.friction, rtol=1e-7)


def test_separation_is_the_papers():
    law, paper = (float(rf.separation(_with(name), 0.1, 1e5)) for name in MODELS)
    assert law == pytest.approx(paper, rel=1e-9)


@pytest.mark.slow
def test_other_solids():
    """A smooth rigid solid on rough rubber is at rest; a table of the modulus and a spring in series."""
    at_rest = rf.Scene(rf.Body(RUBBER, ROAD), rf.Body(rf.Rigid()), contact_model="boundary_elements")
    elastic = _scene(rf.Elastic(1e6, 0.5))
    area = rf.contact_area(at_rest, [1e-3, 10.0], 1e4)
    np.testing.assert_allclose(area, rf.contact_area(elastic, 1.0, 1e4), rtol=1e-10)
    assert float(rf.friction(at_rest, 0.1, 1e4)) == 0
    omega = np.logspace(-6, 8, 400)
    E = np.asarray(rf.complex_modulus(RUBBER, omega))
    table = rf.TabulatedModulus(omega, E.real, E.imag, poisson=0.5)
    tabulated, series = (rf.friction(_scene(one), 0.1, 1e5) for one in (table, RUBBER))
    np.testing.assert_allclose(tabulated, series, rtol=3e-3)


@pytest.mark.slow
def test_profile():
    """The friction of all wavevectors, the area of cut roughness, the density, and W."""
    scene, velocity, pressure = _scene(), np.array([1e-3, 1.0]), np.array([2e5, 2e4])
    near = np.outer([150.0, 399.0, 401.0, 3e3, 9.99e3, 1.01e4, 3e4], [np.exp(-1e-3), 1.0, np.exp(1e-3)])
    q = np.concatenate([ROAD.q1 * np.array([1e-3, 0.1, 0.3, 1.0, 6.0, 9.0]), near.ravel()])
    found = rf.analysis.profile(scene, velocity, pressure, q=q, quadrature=rf.Quadrature())
    cut = scene.replace({"upper.spectrum": ROAD.cut(0.3 * ROAD.q1)})
    at = velocity, pressure
    options = {"quantities": ("area", "friction"), "quadrature": rf.Quadrature()}
    whole, part = (rf.solve(one, *at, **options) for one in (scene, cut))
    np.testing.assert_allclose(found.friction[:, 5], whole.friction, rtol=1e-12)
    np.testing.assert_allclose(found.area[:, 3:6], whole.area[:, None] * np.ones(3), rtol=1e-12)
    np.testing.assert_allclose(found.area[:, 2], part.area, rtol=1e-6)
    np.testing.assert_array_equal(found.area[:, 0], 1.0)
    np.testing.assert_array_equal(found.friction[:, 0], 0.0)
    # The density is the derivative of the friction, on both sides of the kinks at qr and q1.
    density, friction, share = (
        np.asarray(x)[:, 6:].reshape(2, 7, 3) for x in (found.friction_density, found.friction, found.share)
    )
    np.testing.assert_allclose(density[..., 1], (friction[..., 2] - friction[..., 0]) / 2e-3, rtol=1e-5)
    assert np.all((share[:, :5] > 0) & (share[:, :5] < 1 + 1e-12)) and np.all(share[:, 5:] == 0)
    full = rf.analysis.profile(scene, 0.1, 1e9)
    np.testing.assert_allclose(full.share[full.q < ROAD.q1], 1.0, rtol=1e-9)
    np.testing.assert_allclose(full.friction[-1], full.friction[np.argmax(full.q > ROAD.q1)], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "body",
    [rf.Body(rf.Rigid(), rf.Anisotropic(ROAD, 1.5, 0.5)), pytest.param(rf.Body(rf.Rigid(), ROAD), id="slab")],
)
def test_scenes_made_within_a_trace(body):
    """Checks of the known numbers of grooves or a slab do not meet tracers.

    Scenes with traced numbers have another quadrature.
    """
    layer = None if body.spectrum.harmonic_count() else rf.Slab(5e-3)
    scene = rf.Scene(rf.Body(RUBBER, layer=layer), body, contact_model="boundary_elements")

    @jax.jit
    def areas(factor):
        softer = scene.replace("lower.material.E", factor * scene.lower.material.E)
        same = scene.replace("gamma", 0.5)
        return [rf.contact_area(one, 0.3 * factor, 2e4) for one in (softer, same)]

    np.testing.assert_allclose(areas(1.0), rf.contact_area(scene, 0.3, 2e4), rtol=1e-9)


@pytest.mark.parametrize("thickness", [1e-30, pytest.param(1e-10, marks=pytest.mark.slow), 1e30])
def test_extreme_slabs_are_finite(thickness):
    def friction(thickness):
        slab = rf.Slab(thickness, "bonded")
        return rf.friction(_scene().replace(lower=rf.Body(RUBBER, layer=slab)), 0.1, 3e5)

    assert np.all(np.isfinite(jax.jit(jax.value_and_grad(friction))(thickness)))


@pytest.mark.parametrize("pressure", [1e-25, pytest.param(1e3, marks=pytest.mark.slow), 1e25])
def test_extreme_loads_are_finite(pressure):
    found = _value_and_slopes(_scene(), 0.1, pressure)
    assert all(np.all(np.isfinite(x)) for x in jax.tree.leaves(found))


@pytest.mark.slow
def test_derivatives_without_a_plateau():
    """With qr = q0 some panels have no width, and nodes lie at q0, where F = 0."""

    @jax.jit
    @jax.jacfwd
    def slopes_of(log_numbers):
        road = rf.SelfAffine(*jnp.exp(log_numbers))
        return jnp.log(rf.friction(_scene(road=road), 0.1, 1e5))

    at, near = (
        slopes_of(jnp.log(jnp.array([ROAD.q0, qr, ROAD.q1, ROAD.hurst, ROAD.h_rms])))
        for qr in (ROAD.q0, 1.000001 * ROAD.q0)
    )
    np.testing.assert_allclose(at, near, atol=1e-5)


@pytest.mark.slow
def test_single_precision():
    law = _scene()
    single = jax.tree.map(lambda x: np.asarray(x, np.float32), law)
    _, slopes = _value_and_slopes(single, np.float32(0.1), np.float32(1e5))
    value, expected = _value_and_slopes(law, 0.1, 1e5)
    # Relative to the friction, for relative changes of each number.
    for slope, exact, number in zip(*map(jax.tree.leaves, (slopes, expected, (law, 1e5))), strict=True):
        np.testing.assert_allclose(slope * number, exact * number, atol=1e-3 * float(value))


LAYERED = rf.Body(RUBBER, layer=rf.Coating(1e-3, rf.Elastic(1e9, 0.3)))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: _scene().replace("lower.spectrum", ROAD), "one rough surface, got two"),
        (lambda: _scene().replace(lower=LAYERED), r"half-spaces, or Slab and Rigid, but lower\.layer is a"),
        (
            lambda: _scene().replace(
                lower=rf.Body(RUBBER, layer=rf.Slab(1e-3)), upper=rf.Body(rf.Elastic(1e9, 0.3), ROAD)
            ),
            r"half-spaces, or Slab and Rigid, but lower\.layer is a",
        ),
        (
            lambda: _scene().replace(lower=rf.Body(RUBBER, layer=rf.Slab(2e-3))),
            r"this slab is 6\.2. times as stiff",
        ),
        (lambda: _scene(road=rf.Anisotropic(ROAD, 4.0, 0.0)), r"here they are 3\.\d* times as large"),
        (
            lambda: _scene(road=rf.TabulatedAnisotropic([1e2, 1e4], np.ones((2, 8)))),
            "same anisotropy at all wavevectors",
        ),
        (lambda: _scene(area_correction=True), "not possible together with area_correction"),
        (lambda: rf.analysis.separation_profile(_scene(), 0.1, 1e5), "contact_model"),
        (lambda: _with("finite_elements"), "contact_model"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
