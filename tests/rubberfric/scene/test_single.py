"""Single precision: scenes beyond its range are refused with a reason."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import FINE, ROAD
from problems import TREAD as RUBBER
from support.cases.stored import as_arrays, slow_if
from support.counting.operations import equations
from support.folders import DATA

import rubberfric as rf

RIGID = rf.Body(rf.Rigid(), ROAD)
LIQUID = rf.Prony(0.0, [1e6], [1.0])
WIDE = rf.Prony(1e6, [1e6, 1e6], [1e-18, 1e14])
COLD = rf.Prony(3.6e6, [1e9], [1e-6], shift=rf.WLF(8.9, 101.6, 293.15))
FINE_TABLE = rf.TabulatedSpectrum([1e2, 1e9], [1e-10, 1e-39])

REFUSED = {
    "lower.layer.thickness": (rf.Scene(rf.Body(RUBBER, None, rf.Slab(1e-10)), RIGID), None),
    "E_inf": (rf.Scene(rf.Body(LIQUID), rf.Body(LIQUID, ROAD)), None),
    "upper.spectrum.C": (rf.Scene(rf.Body(RUBBER), rf.Body(rf.Rigid(), FINE_TABLE)), None),
    "lower.material.shift": (rf.Scene(rf.Body(COLD), RIGID), 200.0),
}


@pytest.mark.parametrize("name", slow_if(lambda name: name == "E_inf", REFUSED.keys()))
def test_refused_in_single_precision_only(name):
    scene, temperature = REFUSED[name]
    conditions = (np.array([0.1]), 1e5, temperature)
    result = rf.solve(scene, *conditions)
    assert all(np.isfinite(x).all() for x in result if x is not None)
    single = as_arrays(scene, jnp.float32)
    with pytest.raises(ValueError, match=f"(?s){name}.*float32.*float64"):
        rf.solve(single, *(None if c is None else jnp.asarray(c, jnp.float32) for c in conditions))


def test_under_jit_nothing_is_refused():
    scene, temperature = REFUSED["lower.material.shift"]
    single, v, T = as_arrays((scene, np.array([0.1]), temperature), jnp.float32)
    assert np.isfinite(jax.jit(rf.friction)(single, v, jnp.float32(1e5), T)).all()


ACCEPTED = {
    "stiff facing solid": rf.Scene(
        rf.Body(RUBBER, None, rf.Slab(1e-4)), rf.Body(rf.Elastic(1e12, 0.3), ROAD)
    ),
    "times 32 decades apart": rf.Scene(rf.Body(WIDE), rf.Body(rf.Elastic(1e9, 0.3), ROAD)),
}


@pytest.mark.parametrize("name", slow_if(lambda name: name == "stiff facing solid", ACCEPTED.keys()))
def test_ordinary_scenes_pass(name):
    single = as_arrays(ACCEPTED[name], jnp.float32)
    found = rf.friction(single, jnp.float32([0.1]), jnp.float32(1e5))
    assert found.dtype == jnp.float32
    np.testing.assert_allclose(found, rf.friction(ACCEPTED[name], [0.1], 1e5), rtol=1e-5, atol=1e-12)


def test_full_contact_is_no_more_than_one():
    """JAX's erf in float32 passes 1 where x is 3.7 ... 3.83."""
    x = jnp.linspace(3.6, 4.0, 4001, dtype=jnp.float32)
    from rubberfric.theory.area.partial_contact import contact_fraction

    assert np.max(contact_fraction(x)) == 1


def test_the_area_is_proportional_to_light_loads():
    """The relative derivative is 1, also where the square of modulus over pressure is 1e24."""
    single = as_arrays(rf.Scene(rf.Body(RUBBER), RIGID), jnp.float32)
    area, slope = jax.jit(jax.value_and_grad(lambda p: rf.contact_area(single, jnp.float32(0.1), p)))(
        jnp.float32(1e-5)
    )
    assert slope.dtype == jnp.float32
    assert float(slope * 1e-5 / area) == pytest.approx(1.0, rel=1e-5)


def precisions_of_products(function, *arguments):
    return [
        one.params["precision"]
        for one in equations(jax.make_jaxpr(function)(*arguments).jaxpr)
        if one.primitive.name == "dot_general" and one.invars[0].aval.dtype == jnp.float32
    ]


SCENES = "tread_on_asphalt", "coated_base", "softened_tread_on_asphalt", "tabulated_tread", "two_rubbers"
EXACT = {(jax.lax.Precision.HIGHEST,) * 2}


@pytest.mark.parametrize("name", slow_if(lambda name: name != SCENES[0], SCENES))
def test_no_product_rounds_its_factors(name):
    """GPUs keep 11 bits of float32 factors, in values and derivative rules, unless told otherwise."""
    single, v = as_arrays(rf.load_scene(DATA / f"{name}.toml"), jnp.float32), jnp.float32([0.1, 1.0])

    def friction(scene):
        return jnp.sum(rf.friction(scene, v, jnp.float32(3e5)))

    found = precisions_of_products(jax.value_and_grad(friction), single)
    assert len(found) > 10
    assert set(found) == EXACT


def test_no_product_of_an_analysis_rounds_its_factors():
    single = as_arrays(rf.Scene(rf.Body(RUBBER), RIGID), jnp.float32)

    def stiffness(scene):
        return rf.analysis.contact_stiffness(scene, jnp.float32(0.1), jnp.float32(3e5))

    found = precisions_of_products(stiffness, single)
    assert len(found) > 3
    assert set(found) == EXACT


STICKY = rf.Scene(
    rf.Body(rf.Elastic(3e5, 0.45)),
    rf.Body(rf.Rigid(), FINE),
    adhesion=rf.Adhesion(0.05, limit="long", range=5e-7),
)
# The innermost panels are as narrow as with the default quadrature.
NARROW = rf.Quadrature(order=6, panels=3, graded=8, ratio=4.5, angular_order=6)


@pytest.mark.slow
@pytest.mark.parametrize("pressure", [2e3, 2e4, 2e5])
def test_gradients_with_long_range_adhesion_agree_with_double_precision(pressure):
    def values(scene, pressure):
        found = rf.solve(scene, 0.0 * pressure, pressure, quadrature=NARROW)
        return jnp.log(found.area) + 0.1 * jnp.log(found.separation)

    slope = jax.jit(jax.grad(values, argnums=(0, 1)))
    double = slope(*as_arrays((STICKY, pressure)))
    single = slope(*as_arrays((STICKY, pressure), jnp.float32))
    jax.tree.map(lambda x, y: np.testing.assert_allclose(x, y, rtol=5e-4), single, double)


def test_layers_that_are_traced_are_not_checked():
    """Only the thickness is traced; the material and the spectrum are known."""
    single = as_arrays(REFUSED["lower.layer.thickness"][0], jnp.float32)

    def area(thickness):
        scene = single.replace({"lower.layer.thickness": thickness})
        return rf.contact_area(scene, jnp.float32(0.1), jnp.float32(1e5))

    assert jax.eval_shape(area, jnp.float32(1e-10)).dtype == jnp.float32
