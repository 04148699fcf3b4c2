"""Second derivatives of every optional part of a scene, against differences of first derivatives."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

import rubberfric as rf
from rubberfric.base import quick_jit
from rubberfric.scene.softening import Softened, softening_factors

QUADRATURE = rf.Quadrature(order=8, panels=5, graded=4, ratio=5.0, angular_order=8)
STEP = 2e-4
# Fourth-order central differences.
WEIGHTS = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}

RUBBER = rf.Prony(2.3e6, [3e8, 4e7], [3e-7, 2e-4], 0.47)
SHIFTED = RUBBER.replace(shift=rf.WLF(8.9, 101.6, 293.15, vertical=rf.Entropic(6e-4)))
OTHER = rf.Prony(1e6, [5e7], [1e-5], 0.49)
ELASTIC = rf.Elastic(1e7, 0.4)
ROAD = rf.SelfAffine(150.0, 600.0, 4e4, 0.77, 2e-4)
WORN = rf.SelfAffine(170.0, 500.0, 3e4, 0.77, 1e-4)  # without a kink of ROAD
FINE = rf.SelfAffine(5e4, 1e5, 3e6, 0.7, 1e-6)
Q = np.array([150.0, 600.0, 3e3, 4e4])
C = 1e-11 * (Q / 150.0) ** -3.4 * np.array([1.0, 0.6, 1.2, 1.0])
OMEGA = np.logspace(0, 8, 9)
MODULUS = 2.3e6 + 4e7 * (1e-4j * OMEGA) / (1 + 1e-4j * OMEGA) + 1e5 * (1 + 1j) * OMEGA**0.3
TABLE = rf.TabulatedModulus(OMEGA, MODULUS.real, MODULUS.imag, 0.48)
SOFTENING = rf.Softening([0.01, 0.1, 1.0], [1.0, 0.7, 0.4], [1.0, 1.2, 0.6])
SHEAR = rf.ContactShear(6.5e6, 0.1, 6e-3, rf.Arrhenius(0.97, 293.15))
HEATING = rf.Heating(1.2e3, 1.6e3, 0.23, 1e-3, 0.05, 0.4)
SHIFT = rf.TabulatedShift(
    [280.0, 300.0, 320.0], [10.0, 0.5, 0.1], 293.0, vertical=rf.TabulatedVertical([280.0, 320.0], [1.2, 0.7])
)
DIRECTIONS = rf.TabulatedAnisotropic(
    Q, C[:, None] * np.array([1.0, 2.0, 1.5, 1.2]) ** np.linspace(1.0, -0.5, 4)[:, None]
)


def _on(spectrum, material=RUBBER, layer=None, **options):
    return rf.Scene(rf.Body(material, None, layer), rf.Body(rf.Rigid(), spectrum), **options)


def _pair(lower, upper, **options):
    return rf.Scene(rf.Body(*lower), rf.Body(*upper), **options)


# Velocity [m/s] and pressure [Pa].
SLIDING = (0.02, 2e5)
# Velocity [m/s], pressure [Pa] and temperature [K].
WARM = (0.02, 2e5, 303.0)
SCENES = {
    "rubber": (_on(ROAD), SLIDING),
    "area correction": (_on(ROAD, area_correction=True), SLIDING),
    "two rubbers": (_pair((RUBBER, WORN), (OTHER, ROAD)), SLIDING),
    "two solids": (_pair((RUBBER,), (ELASTIC, ROAD)), SLIDING),
    "bonded slab": (_on(ROAD, layer=rf.Slab(2e-3)), SLIDING),
    "frictionless slab": (_on(ROAD, layer=rf.Slab(2e-3, "frictionless")), SLIDING),
    "elastic base": (_on(ROAD, layer=rf.Coating(2e-3, ELASTIC)), SLIDING),
    "rubber base": (_on(ROAD, layer=rf.Coating(2e-3, OTHER)), SLIDING),
    "grooves": (_on(rf.Anisotropic(ROAD, 2.0, 0.3, harmonics=4)), SLIDING),
    "table of C": (_on(rf.TabulatedSpectrum(Q, C)), SLIDING),
    "table of C over directions": (_on(DIRECTIONS), SLIDING),
    "table of moduli": (_on(ROAD, TABLE), SLIDING),
    "relaxing shear modulus": (_on(ROAD, rf.PronyShear(1e6, [3e8], [3e-7], 2e9)), SLIDING),
    "softening": (_on(ROAD, softening=SOFTENING), SLIDING),
    "softening of a table": (_on(ROAD, TABLE, softening=SOFTENING), SLIDING),
    "softening in series": (_pair((RUBBER,), (ELASTIC, ROAD), softening=SOFTENING), SLIDING),
    "softening of two rubbers": (_pair((RUBBER, WORN), (OTHER, ROAD), softening=SOFTENING), SLIDING),
    "short-range adhesion": (_on(FINE, adhesion=rf.Adhesion(0.002)), (1e-4, 2e5)),
    "long-range adhesion": (_on(FINE, adhesion=rf.Adhesion(0.05, limit="long", range=5e-7)), (1e-4, 2e5)),
    "heating": (_on(ROAD, SHIFTED, heating=HEATING), WARM),
    "heating with shear": (_on(ROAD, SHIFTED, heating=HEATING, shear=SHEAR), WARM),
    "shear": (_on(ROAD, shear=SHEAR), WARM),
    "correlation": (_pair((RUBBER, WORN), (ELASTIC, ROAD), correlation=rf.Correlation(0.6)), (0.0, 2e5)),
    "WLF": (_on(ROAD, SHIFTED), WARM),
    "table of shifts": (_on(ROAD, RUBBER.replace(shift=SHIFT)), WARM),
    "rest": (_on(ROAD), (0.0, 2e5)),
}
# The nodes of the attraction follow the load without derivatives. Other second derivatives are up to 700.
LARGER = {"long-range adhesion": 2e-3, "table of shifts": 1e-4, "WLF": 1e-4, "bonded slab": 1e-4}


def _function(scene, conditions, quadrature, quantities):
    """Return a function of relative changes of all numbers of a scene and its conditions, and their count."""
    numbers, rebuilt = ravel_pytree((scene, conditions))
    # Correlated solids must stay at rest.
    unit = jnp.where(numbers == 0, 1e-3 if scene.correlation is None else 0.0, numbers)

    def function(change):
        scene, conditions = rebuilt(numbers + unit * change)
        found = rf.solve(scene, *conditions, quadrature=quadrature, quantities=quantities)
        values = {name: getattr(found, name) for name in quantities}
        # Friction at rest is 0.
        logarithms = [x if name == "friction" else jnp.log(x) for name, x in values.items()]
        return sum(weight * x for weight, x in zip((1.0, 0.7, 0.3), logarithms, strict=False))

    return function, numbers.size


def _differences(function, count):
    slope, unit = quick_jit()(jax.grad(function)), np.eye(count)
    return sum(w / STEP * np.array([slope(k * STEP * row) for row in unit]) for k, w in WEIGHTS.items())


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_all_second_derivatives(name):
    scene, conditions = SCENES[name]
    quantities = ("area", "separation", "friction")[: 2 if scene.correlation is not None else 3]
    # Derivatives by the ends of the roughness are those of the integral. With 8 nodes, the second derivative
    # of the separation differs from that of the sum by 4e-5, with 16 by 1e-10.
    quadrature = dataclasses.replace(QUADRATURE, order=16) if name == "table of C" else QUADRATURE
    function, count = _function(scene, conditions, quadrature, quantities)
    zero = jnp.zeros(count)
    forward = quick_jit()(jax.jacfwd(jax.grad(function)))(zero)
    reverse = quick_jit()(jax.jacrev(jax.grad(function)))(zero)
    np.testing.assert_allclose(forward, reverse, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(forward, forward.T, rtol=1e-6, atol=3e-5)
    atol = LARGER.get(name, 2e-5)
    np.testing.assert_allclose(forward, _differences(function, count), rtol=1e-5, atol=atol)


@pytest.mark.slow
def test_second_derivatives_of_softening_factors():
    def factors(numbers):
        softening, road = rebuilt(numbers)
        return jnp.stack(softening_factors(Softened(softening, (road.power_law(),)), wavevectors))

    numbers, rebuilt = ravel_pytree((SOFTENING, ROAD))
    # Below the roughness, at its beginning, on the plateau and beyond.
    wavevectors = jnp.array([100.0, 150.0, 150.0 * (1 + 1e-12), 300.0, 1e3, 3e4])
    second = jax.jit(jax.hessian(factors))(numbers)
    slope, unit = jax.jit(jax.jacrev(factors)), STEP * np.diag(numbers)
    expected = sum(
        w / STEP * np.array([slope(numbers + k * row) for row in unit]) for k, w in WEIGHTS.items()
    )
    expected = np.moveaxis(expected, 0, -1) / np.array(numbers)
    scale = np.array(numbers) * np.array(numbers)[:, None]
    inside = (slice(None), slice(3, None))
    np.testing.assert_allclose((second * scale)[inside], (expected * scale)[inside], rtol=1e-6, atol=1e-7)
    assert np.isfinite(second).all() and np.all(second[:, :2] == 0)


def test_second_derivatives_of_contact_shear_at_rest():
    smooth = rf.Scene(rf.Body(RUBBER), rf.Body(rf.Rigid()), shear=SHEAR)
    numbers, rebuilt = ravel_pytree((smooth.shear, 0.0))

    def friction(numbers):
        shear, velocity = rebuilt(numbers)
        return rf.friction(smooth.replace(shear=shear), velocity, 2e5, 303.0)

    # All derivatives of the bell are 0 at rest.
    assert np.all(jax.jit(jax.hessian(friction))(numbers) == 0)
