"""Area, friction and separation of every reference scene, with the default quadrature."""

import functools

import jax
import numpy as np
import pytest
from support.cases.stored import QUANTITIES, arguments, h_rms, reference, value

import rubberfric as rf

SCENES = reference("forward_cases") | reference("edge_cases")
OPTIONS = reference("option_cases")


@functools.cache
def solution(name):
    """Computed once for the three quantities that are asserted apart."""
    found = value(arguments((SCENES | OPTIONS)[name]))
    return dict(zip(QUANTITIES, map(float, found), strict=True))


def assert_close(quantity, found, case, rel):
    expected = case[quantity]
    if quantity == "friction" and expected == 0:
        assert found == 0  # Cases II and III and elastic solids: nothing dissipates
        return
    scale = abs(expected)
    if quantity == "separation":
        scale += 1e-6 * h_rms(case)  # in full contact the separation is 1e-100 of the roughness
    assert abs(found - expected) <= rel * scale, f"relative error {abs(found - expected) / scale:.1e}"


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("name", SCENES)
def test_scene(name, quantity):
    assert_close(quantity, solution(name)[quantity], SCENES[name], 1e-9)


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * n.startswith("table-modulus-")) for n in OPTIONS]
)
def test_option(name, quantity):
    # A tabulated modulus is integrated over the angle across its kinks.
    rel = 1e-5 if "table-modulus" in name else 1e-9
    assert_close(quantity, solution(name)[quantity], OPTIONS[name], rel)


@pytest.mark.parametrize(
    "name",
    [
        "table-modulus",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("table-modulus-on-elastic", "table-modulus-wlf")
        ),
    ],
)
def test_tabulated_modulus_at_many_velocities(name):
    """The means over the angle are shared by all velocities of a call: 20 decades cost no accuracy."""
    case = OPTIONS[name]
    at, _, *rest = arguments(case)
    found = jax.jit(rf.solve)(at, np.array([1e-12, 1e-6, case["v"], 1e3, 1e9]), *rest)
    for quantity in QUANTITIES:
        assert_close(quantity, float(getattr(found, quantity)[2]), case, 1e-5)


@pytest.mark.parametrize("name", ["layer-on-rough-rigid-1", "elastic-elastic-0"])
def test_one_quantity_alone(name):
    """Asked for one quantity, a call returns what `solve` returns for it, and None for the rest."""
    at = arguments(SCENES[name])
    functions = {"area": rf.contact_area, "friction": rf.friction, "separation": rf.separation}
    for quantity, function in functions.items():
        alone = jax.jit(function)(*at)
        assert alone == pytest.approx(solution(name)[quantity], rel=1e-13, abs=0)
        only = jax.eval_shape(functools.partial(rf.solve, quantities=(quantity,)), *at)
        assert [q for q in QUANTITIES if getattr(only, q) is not None] == [quantity]
