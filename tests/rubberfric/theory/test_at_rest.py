"""Every contact model at v = 0: values, and derivatives with respect to the velocity in both modes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import rubberfric as rf
from rubberfric.theory.structure import has_transverse_force

ROAD = rf.SelfAffine(q0=100.0, qr=400.0, q1=1e4, hurst=0.8, h_rms=2e-4)
GROOVES = rf.Anisotropic(ROAD, 1.6, 0.5)
RUBBER = rf.Prony(1e6, [9e6, 3e6], [1e-3, 1e-1], poisson=0.5)
MELT = rf.Prony(0.0, [9e6, 3e6], [1e-3, 1e-1], poisson=0.5)
OMEGA = np.logspace(-4, 8, 49)
E = np.asarray(rf.complex_modulus(RUBBER, OMEGA))
TABLE = rf.TabulatedModulus(OMEGA, E.real, E.imag, poisson=0.5)
ON_ROAD = rf.Body(rf.Rigid(), ROAD)
TEMPERATURE = 293.0


def _paper(body=RUBBER, road=ON_ROAD, **options):
    return rf.Scene(body if isinstance(body, rf.Body) else rf.Body(body), road, **options)


def _law(body, road=ON_ROAD):
    return _paper(body, road, contact_model="boundary_elements")


HEATING = rf.Heating(1.2e3, 1.6e3, 0.23, 1e-3, 0.05)
SOFTENING = rf.Softening([0.01, 0.1, 1.0], [1.0, 0.7, 0.4], [1.0, 1.2, 0.6])
SCENES = {
    "law": _law(RUBBER),
    "law, liquid": _law(MELT),
    "law, slab": _law(rf.Body(RUBBER, layer=rf.Slab(5e-3, "bonded"))),
    "law, grooves": _law(RUBBER, rf.Body(rf.Rigid(), GROOVES)),
    "law, table": _law(TABLE),
    "law, rough elastic": _law(RUBBER, rf.Body(rf.Elastic(1e8, 0.3), ROAD)),
    "law, liquid on rough elastic": _law(MELT, rf.Body(rf.Elastic(1e8, 0.3), ROAD)),
    "paper": _paper(),
    "liquid": _paper(MELT),
    "table": _paper(TABLE),
    "grooves": _paper(road=rf.Body(rf.Rigid(), GROOVES)),
    "slab": _paper(rf.Body(RUBBER, layer=rf.Slab(5e-3, "bonded"))),
    "coating": _paper(rf.Body(RUBBER, layer=rf.Coating(1e-3, rf.Elastic(1e6, 0.5)))),
    "two rubbers": _paper(rf.Body(RUBBER, ROAD), rf.Body(RUBBER, ROAD)),
    "area correction": _paper(area_correction=True),
    "softening": _paper(rf.Body(RUBBER, softening=SOFTENING)),
    "short-range adhesion": _paper(adhesion=rf.Adhesion(0.05)),
    "long-range adhesion": _paper(adhesion=rf.Adhesion(0.05, limit="long", range=1e-6)),
    "heating": _paper(heating=HEATING),
}


def _quantities(scene):
    """Return area, viscoelastic and transverse friction as a function of the velocity."""
    names = ["area", "viscoelastic_friction"]
    names += ["transverse_friction"] if has_transverse_force(scene) else []
    temperature = None if scene.heating is None else TEMPERATURE

    def values(velocity):
        found = rf.solve(scene, velocity, 2e5, temperature, quantities=tuple(names))
        return jnp.stack([getattr(found, name) for name in names], -1)

    return values


# One scene for each way to the means and for each loop; the others compile for minutes.
ORDINARY = ("law", "paper", "liquid", "table")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in ORDINARY)) for name in SCENES]
)
def test_rest(name):
    """The friction is odd in v, so that its derivative at v = 0 is friction / v at small v."""
    values = _quantities(SCENES[name])
    at = jax.jit(values)(jnp.array([0.0, 1e-10, -1e-10, 1e-30]))
    np.testing.assert_array_equal(at[0, 1:], 0.0)
    np.testing.assert_allclose(at[:, 0], at[0, 0], rtol=1e-9)
    np.testing.assert_allclose(at[1, 1:], -at[2, 1:], rtol=1e-12)
    for jacobian in (jax.jacfwd, jax.jacrev):
        slope = jax.jit(jacobian(values))(0.0)
        assert abs(slope[0]) < 1e-9
        np.testing.assert_allclose(slope[1:], at[1, 1:] / 1e-10, rtol=1e-6)
        np.testing.assert_allclose(slope[1:], at[3, 1:] / 1e-30, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("material", [RUBBER, MELT, TABLE])
def test_all_derivatives_of_the_law_at_rest_are_finite(material):
    def friction_and_area(scene):
        found = rf.solve(scene, 0.0, 2e5, quantities=("area", "friction"))
        return found.area + found.friction

    slopes = jax.jit(jax.grad(friction_and_area))(_law(material))
    assert all(np.all(np.isfinite(x)) for x in jax.tree.leaves(slopes))


def test_slope_of_the_tread():
    """Friction / v of a tread at 1e-30 ... 1e-8 m/s is 3914.98 s/m."""
    tread = rf.Prony(3.6e6, np.geomspace(1e9, 1e6, 13), np.logspace(-12, 0, 13), 0.5)
    scene = _law(tread, rf.Body(rf.Rigid(), rf.SelfAffine(100.0, 1000.0, 3.1e4, 0.8, 0.5e-3)))
    assert float(jax.grad(lambda v: rf.friction(scene, v, 2e5))(0.0)) == pytest.approx(3914.98, rel=2e-6)


@pytest.mark.slow
def test_second_derivative_at_rest():
    """The area is even in v."""
    area = jax.jit(lambda v: rf.contact_area(_law(RUBBER), v, 2e5))
    found = float(jax.jit(jax.hessian(area))(0.0))
    h = 1e-4 / ROAD.q1
    expected = [2 * float(area(k * h) - area(0.0)) / (k * h) ** 2 for k in (100, 200)]
    assert found == pytest.approx((4 * expected[0] - expected[1]) / 3, rel=1e-3)
