"""Second derivatives of the law, and derivatives where the roughness has no plateau."""

import jax
import jax.numpy as jnp
import numpy as np
import problems
import pytest

import rubberfric as rf

ROAD = rf.SelfAffine(q0=150.0, qr=600.0, q1=2e4, hurst=0.77, h_rms=2e-4)
RUBBER = rf.Prony(2.3e6, [3e8, 4e7], [3e-7, 2e-4], 0.47)
OMEGA = np.logspace(1, 9, 17)
E = np.asarray(rf.complex_modulus(RUBBER, OMEGA))
TABLE = rf.TabulatedModulus(OMEGA, E.real, E.imag, poisson=0.47, smoothing=0.3)
# Few nodes: these derivatives are those of the computed function.
FEW = rf.Quadrature(order=6, panels=4, graded=2)


def _scene(body, road=ROAD):
    return rf.Scene(body, rf.Body(rf.Rigid(), road), contact_model="boundary_elements", quadrature=FEW)


SCENES = {
    "plain": _scene(rf.Body(RUBBER)),
    "slab": _scene(rf.Body(RUBBER, layer=rf.Slab(5e-3, "bonded"))),
    "grooves": _scene(rf.Body(RUBBER), rf.Anisotropic(ROAD, 1.6, 0.5)),
    "table": _scene(rf.Body(TABLE)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_second_derivatives(name):
    """Three orders of forward and reverse mode agree with differences of the gradient.

    The nodes of the circle depend on the moduli and carry no derivatives, so differences contain changes of
    the quadrature error.
    """
    scene = SCENES[name]
    spectrum = "upper.spectrum.base" if name == "grooves" else "upper.spectrum"
    modulus = "lower.material.storage" if name == "table" else "lower.material.E_inf"
    hurst, at_rest = scene.upper.spectrum, scene.lower.material
    hurst = (hurst.base if name == "grooves" else hurst).hurst
    at_rest = at_rest.storage if name == "table" else at_rest.E_inf

    def friction(x):
        changed = scene.replace({f"{spectrum}.hurst": hurst * x[0], modulus: at_rest * x[1]})
        return rf.friction(changed, 0.02 * x[2], 2e5 * x[3])

    x, h = jnp.ones(4), 1e-3
    gradient = jax.jit(jax.grad(friction))
    ways = {
        "forward over reverse": jax.jacfwd(jax.grad(friction)),
        "reverse over reverse": jax.jacrev(jax.grad(friction)),
        "forward over forward": jax.jacfwd(jax.jacfwd(friction)),
    }
    steps = [[gradient(x + k * h * unit) for k in (-2, -1, 1, 2)] for unit in np.eye(4)]
    differences = np.array([(8 * (c - b) - (d - a)) / (12 * h) for a, b, c, d in steps])
    for way, hessian in ways.items():
        found = jax.jit(hessian)(x)
        np.testing.assert_allclose(found, differences, rtol=1e-5, atol=1e-7, err_msg=way)
        np.testing.assert_allclose(found, np.transpose(found), rtol=1e-9, atol=1e-12, err_msg=way)


@pytest.mark.slow
@pytest.mark.parametrize("pressure", [1e5, 4e5])
def test_no_plateau(pressure):
    """For q_r = q0 the derivatives by q_r are one-sided, and next to 0."""
    rubber = rf.Prony(1e6, [9e6, 3e6], [1e-3, 1e-1], poisson=0.5)

    def logs(x):
        road = rf.SelfAffine(100.0, 100.0 * jnp.exp(x), 1e4, 0.8, 2e-4)
        scene = rf.Scene(rf.Body(rubber), rf.Body(rf.Rigid(), road), contact_model="boundary_elements")
        found = rf.solve(scene, 0.1, pressure, quantities=("area", "friction"))
        return jnp.log(jnp.stack([found.area, found.friction]))

    values, h = jax.jit(logs), 1e-3
    at = np.array([values(k * h) for k in range(6)])
    expected = np.array([-137, 300, -300, 200, -75, 12]) @ at / (60 * h)
    for jacobian in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(jax.jit(jacobian(logs))(0.0), expected, atol=1e-6)


def test_slope_of_the_tread_at_rest():
    """Friction / v of a tread at 1e-30 ... 1e-8 m/s is 3914.98 s/m."""
    tread = rf.Prony(3.6e6, np.geomspace(1e9, 1e6, 13), np.logspace(-12, 0, 13), 0.5)
    scene = rf.Scene(rf.Body(tread), rf.Body(rf.Rigid(), problems.ROAD), contact_model="boundary_elements")
    slope = jax.grad(lambda v: rf.friction(scene, v, 2e5))(0.0)
    assert float(slope) == pytest.approx(3914.98, rel=2e-6)


@pytest.mark.slow
def test_second_derivative_at_rest():
    """The area is even in v."""
    scene = problems.PROBLEMS["law"].scene
    area = jax.jit(lambda v: rf.contact_area(scene, v, 2e5))
    found = float(jax.jit(jax.hessian(area))(0.0))
    h = 1e-4 / scene.lower.spectrum.q1
    expected = [2 * float(area(k * h) - area(0.0)) / (k * h) ** 2 for k in (100, 200)]
    assert found == pytest.approx((4 * expected[0] - expected[1]) / 3, rel=1e-3)
