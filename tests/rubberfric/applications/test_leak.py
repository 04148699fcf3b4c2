"""Leak of seals: limits of the effective medium, brute force, identities, derivatives, refusals."""

import functools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import RIGID, ROAD, TREAD
from support.oracles.effective_medium import conductivity, distribution
from support.oracles.moments import Roughness
from support.oracles.numerical import derivatives

import rubberfric as rf
from rubberfric.applications import contact_conductance, leak_conductivity, leak_rate, percolation_pressure
from rubberfric.applications.gaps import Gaps, gaps_at_rest, moments_of
from rubberfric.applications.leak import effective_conductivity
from rubberfric.scene import cast
from rubberfric.theory.area.corrected_separation import corrected_separation

SEAL = rf.Prony(3e6, [2e6, 1e6], [1e-3, 1.0], 0.49)
GLAND = rf.SelfAffine(1e3, 4e3, 1e6, 0.8, 2e-6)
SCENE = rf.Scene(rf.Body(RIGID, GLAND), rf.Body(SEAL))
# The ordinary tests compile the leak once, for this structure.
ELASTIC = rf.Scene(rf.Body(RIGID, GLAND), rf.Body(rf.Elastic(3e6, 0.49)))


# Leaks are far below the absolute tolerance of pytest.
approx = functools.partial(pytest.approx, abs=0.0)


CONDUCTIVITY = jax.jit(effective_conductivity, static_argnums=2)


def medium(area, shares, gaps, critical_area, width=0.0):
    """Return K of a medium of two gaps."""
    values = (jnp.asarray(one, float) for one in (area, shares, gaps, [width, width]))
    return float(CONDUCTIVITY(Gaps(*values), jnp.asarray(critical_area), 40))


def test_limits_of_the_effective_medium():
    """A uniform gap; equal shares of two gaps; a gap with a share in contact."""
    for critical_area in (0.3, 0.415, 0.5):
        # A uniform gap has no width.
        assert medium(0.0, [0.4, 0.6], [2e-6, 2e-6], critical_area) == approx(8e-18 / 12, rel=1e-10)
        for area in (0.1, 0.29):
            found = medium(area, [1 - area, 0], [2e-6, 1e-6], critical_area)
            assert found == approx(8e-18 / 12 * (1 - area / critical_area), rel=1e-10)
    two = medium(0.0, [0.5, 0.5], [1e-6, 5e-6], 0.5)
    assert two == approx(np.sqrt(1e-18 * 125e-18) / 12, rel=1e-10)
    assert medium(0.5, [0.5, 0], [2e-6, 1e-6], 0.5) == 0.0
    assert medium(0.6, [0.4, 0], [2e-6, 1e-6], 0.5) == 0.0
    # A narrow distribution: <u^3> of the parallel and 1 / <u^-3> of the series limit agree to 2nd order.
    narrow = medium(0.0, [0.4, 0.6], [2e-6, 2e-6], 0.5, width=2e-9)
    assert narrow == approx(8e-18 / 12 * (1 - 1.5e-6), rel=1e-9)


CASES = [
    ((1e3, 1e3, 1e5, 0.8, 1e-5), 1e6, 1e3, 0.5, 0.415, 1e-8),
    ((1e3, 4e3, 1e5, 0.8, 1e-5), 1e6, 4e3, 0.45, 0.415, 1e-8),
    ((1e3, 4e3, 1e5, 0.6, 1e-5), 1e6, 1e2, 0.5, 0.5, 1e-7),
]


@pytest.mark.parametrize(("numbers", "E", "p", "gamma", "critical_area", "error"), CASES)
def test_brute_force(numbers, E, p, gamma, critical_area, error):
    scene = rf.Scene(rf.Body(RIGID, rf.SelfAffine(*numbers)), rf.Body(rf.Elastic(E, 0.0)), gamma=gamma)
    expected = conductivity(*distribution(Roughness(*numbers), E / p, gamma), critical_area)
    assert float(leak_conductivity(scene, p, None, critical_area)) == approx(expected, rel=error)


@pytest.mark.slow
def test_mean_of_the_gaps():
    """The mean of u1 over all area is the mean separation, from the energy s = S P with S in G.

    The outer nodes begin at g = 0.0085, so that only the roughness beyond counts.
    """
    stiffness, gamma = 3e4, jnp.asarray(0.5)
    moments, contact = moments_of([GLAND.power_law()]), corrected_separation(gamma)
    gaps = gaps_at_rest(moments, contact, jnp.asarray(stiffness), 16)
    log_t = np.linspace(np.log(1e-14), np.log(np.log(1e3)), 200_001)
    t = np.exp(log_t)
    g = stiffness**2 / 8 * np.asarray(moments.up_to(2, t)) - 0.0085
    x = 0.5 / np.sqrt(np.where(g > 0, g, 1e-4))
    w = x * np.asarray(contact.gap(jnp.log(jnp.minimum(x, 5.7)))) * (x < 5.7)
    m1 = np.asarray(moments.up_to(1, t))
    expected = 0.25 * stiffness * np.sum(0.5 * (w[1:] + w[:-1]) * np.diff(m1))
    assert float(jnp.sum(gaps.share * gaps.mean)) == approx(expected, rel=3e-6)
    assert float(gaps.area + jnp.sum(gaps.share)) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.slow
def test_percolation():
    """The leak ends at the pressure at which A/A0, with S in G, is the critical area."""
    scene = ELASTIC.replace(area_correction=True)
    for critical_area in (0.415, 0.6):
        p = percolation_pressure(scene, None, critical_area)
        assert float(rf.contact_area(scene, 0.0, p)) == approx(critical_area, rel=1e-9)
        K = [float(leak_conductivity(scene, p * s, None, critical_area)) for s in (0.99, 0.9999, 1.0001, 2.0)]
        assert K[0] > 100 * K[1] > 0
        assert K[2] == K[3] == 0
    plain = percolation_pressure(ELASTIC)
    slope, E = float(rf.rms_slope(GLAND)), 3e6 / (1 - 0.49**2)
    assert float(plain) == approx(0.2264 * E * slope, rel=1e-3)


def test_scaling():
    """K is proportional to the cube of all lengths, and depends on pressure / modulus."""
    K = float(leak_conductivity(ELASTIC, 2e4))
    large = ELASTIC.replace("lower.spectrum", rf.SelfAffine(1e2, 4e2, 1e5, 0.8, 2e-5))
    assert float(leak_conductivity(large, 2e4)) == approx(1e3 * K, rel=1e-9)
    hard = ELASTIC.replace("upper.material.young", 3e9)
    assert float(leak_conductivity(hard, 2e7)) == approx(K, rel=1e-9)
    assert float(leak_conductivity(ELASTIC, 1e6)) == 0
    water = leak_rate(ELASTIC, 2e4, -5e5, 1e-3, length=2e-3, width=0.157)
    assert float(water) == approx(K * -5e5 / 1e-3 * 0.157 / 2e-3, rel=1e-12)


@pytest.mark.slow
def test_identities():
    """K / h^3 depends on p / (E h') and the shape of the spectrum only.

    With all lengths along the surface fixed, d ln K / d ln p = -d ln K / d ln E, and d ln K / d ln h_rms is 3
    + d ln K / d ln E.
    """

    def log_K(x):
        scene = SCENE.replace(
            {"upper.material.E_inf": 3e6 * jnp.exp(x[0]), "lower.spectrum.h_rms": 2e-6 * jnp.exp(x[1])}
        )
        return jnp.log(leak_conductivity(scene, 2e4 * jnp.exp(x[2])))

    E, h, p = (float(one) for one in jax.grad(log_K)(jnp.zeros(3)))
    assert p == approx(-E, rel=1e-8)
    assert h == approx(3 + E, rel=1e-8)


@pytest.mark.slow
def test_derivatives():
    """Every number of the scene and the conditions against differences of fourth order."""
    names = [f"lower.spectrum.{name}" for name in ("q0", "qr", "q1", "hurst", "h_rms")]
    names += ["upper.material.E_inf", "upper.material.poisson", "gamma"]

    def value(name):
        where = SCENE
        for part in name.split("."):
            where = getattr(where, part)
        return where

    def log_K(x):
        scene = SCENE.replace({name: value(name) * (1 + y) for name, y in zip(names, x, strict=False)})
        return jnp.log(leak_conductivity(scene, 2e4 * (1 + x[-2]), None, 0.415 * (1 + x[-1])))

    start = jnp.zeros(len(names) + 2)
    slopes = jax.jit(jax.grad(log_K))(start)
    np.testing.assert_allclose(slopes, jax.jit(jax.jacfwd(log_K))(start), rtol=1e-8)
    np.testing.assert_allclose(slopes, derivatives(log_K, start.size, 1e-3), rtol=1e-6)


@pytest.mark.slow
def test_moduli_that_relax_do_not_matter():
    gradient = jax.grad(lambda scene: leak_conductivity(scene, 2e4))(SCENE)
    np.testing.assert_array_equal(gradient.upper.material.E, 0.0)
    elastic = SCENE.replace("upper", rf.Body(rf.Elastic(3e6, 0.49)))
    assert float(leak_conductivity(elastic, 2e4)) == approx(float(leak_conductivity(SCENE, 2e4)), rel=1e-12)


@pytest.mark.slow
def test_two_solids():
    """Two rough surfaces add their powers, and two solids add their compliances."""
    half = GLAND.replace(h_rms=2e-6 / np.sqrt(2))
    both = rf.Scene(rf.Body(rf.Elastic(6e6, 0.49), half), rf.Body(rf.Elastic(6e6, 0.49), half))
    assert float(leak_conductivity(both, 2e4)) == approx(float(leak_conductivity(SCENE, 2e4)), rel=1e-9)
    assert float(percolation_pressure(both)) == approx(float(percolation_pressure(SCENE)), rel=1e-12)
    # Roughness beyond q1 of the other surface joins without a gap.
    parts = rf.SelfAffine(1e3, 1e3, 1e4, 0.8, 1.0), rf.SelfAffine(1e4, 1e4, 1e6, 0.8, 1.0)
    whole = rf.SelfAffine(1e3, 1e3, 1e6, 0.8, 2e-6)
    heights = [float(rf.roughness.rms_height(whole, 1e4)), 0.0]
    heights[1] = np.sqrt(4e-12 - heights[0] ** 2)
    lower, upper = (part.replace(h_rms=h) for part, h in zip(parts, heights, strict=True))
    joined = rf.Scene(rf.Body(RIGID, lower), rf.Body(SEAL, upper))
    one = rf.Scene(rf.Body(RIGID, whole), rf.Body(SEAL))
    assert float(leak_conductivity(joined, 2e4)) == approx(float(leak_conductivity(one, 2e4)), rel=1e-8)


@pytest.mark.slow
def test_extremes():
    """Light loads, full contact, no roughness and single precision."""
    p = np.array([1e-6, 1e-2, 1e2, 1e5, 1e9, 1e20])
    K = np.asarray(leak_conductivity(SCENE, p))
    assert np.all(np.diff(K[:4]) < 0)
    assert np.all(K[4:] == 0)
    slopes = jax.grad(lambda p: jnp.sum(leak_conductivity(SCENE, p)))(p)
    assert np.all(np.isfinite(slopes))
    smooth = SCENE.replace("lower.spectrum.h_rms", 0.0)
    assert float(leak_conductivity(smooth, 1e4)) == 0
    assert np.isfinite(
        jax.grad(lambda h: leak_conductivity(SCENE.replace("lower.spectrum.h_rms", h), 1e4))(0.0)
    )
    assert float(leak_conductivity(rf.Scene(rf.Body(RIGID), rf.Body(SEAL)), 1e4)) == 0
    single = cast(SCENE, "float32")
    found = leak_conductivity(single, np.float32(2e4), None, np.float32(0.415))
    assert found.dtype == jnp.float32
    assert float(found) == approx(float(leak_conductivity(SCENE, 2e4)), rel=1e-3)


REFUSED = {
    "scene.upper.layer: must be None for {}": {"upper": rf.Body(TREAD, None, rf.Slab(1e-3))},
    "scene.adhesion: {} is not defined with adhesion": {"adhesion": rf.Adhesion(0.05)},
    "is not defined for 'boundary_elements'": {"contact_model": "boundary_elements"},
    "scene.upper.material has no modulus at rest": {"upper": rf.Body(rf.Prony(0.0, [1e7], [1.0]))},
}


@pytest.mark.parametrize("message", REFUSED)
def test_scenes_that_leak_and_conductance_refuse(message):
    scene = rf.Scene(rf.Body(RIGID, ROAD), rf.Body(TREAD)).replace(**REFUSED[message])
    with pytest.raises(ValueError, match=re.escape(message.format("the leak"))):
        leak_conductivity(scene, 1e5)
    with pytest.raises(ValueError, match=re.escape(message.format("the conductance"))):
        contact_conductance(scene, 1e5, conductivity=(1.0, 1.0))


def test_anisotropic_roughness_is_refused():
    scene = rf.Scene(rf.Body(RIGID, rf.Anisotropic(ROAD, 1.5)), rf.Body(TREAD))
    message = "scene.lower.spectrum is anisotropic: must be isotropic for the leak"
    with pytest.raises(ValueError, match=message):
        leak_conductivity(scene, 1e5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"critical_area": 1.5}, "critical_area = 1.5: must be between 0.01 and 0.99"),
        ({"viscosity": 0.0}, "viscosity = 0.0: must be > 0"),
        ({"length": -1.0}, "length = -1.0: must be > 0"),
        ({"fluid_pressure": np.nan}, "fluid_pressure = nan: must be finite"),
    ],
)
def test_refused_numbers(arguments, message):
    numbers = {"fluid_pressure": 1e5, "viscosity": 1e-3, "length": 1e-3, "width": 0.1} | arguments
    with pytest.raises(ValueError, match=re.escape(message)):
        leak_rate(SCENE, 1e4, **numbers)
