"""Area, friction and separation of every reference scene, with the default quadrature."""

import functools

import jax
import numpy as np
import pytest
from support.cases.stored import QUANTITIES, arguments, h_rms, reference, slow_if, value

import rubberfric as rf

SCENES = reference("forward_cases") | reference("edge_cases")
OPTIONS = reference("option_cases")


# Structures that differ from another scene only in the number of terms, or are in test_extremes.
SLOW_SCENES = (
    "case1-rough-rubber-rough-rigid-1",
    "case2-rough-rubber-smooth-rigid-1",
    "case3-rough-rubber-smooth-elastic-1",
    "case4-rough-rigid-smooth-rubber-1",
    "extreme-slow-1",
    "extreme-fast-1",
    "rubber-on-rough-elastic-1",
    "general-both-rubber-both-rough-1",
    "general-layered-1",
    "layer-on-rough-rigid-1",
    "edge-qr-equals-q0",
    "edge-qr-equals-q1",
    "edge-qr-equals-q1-two",
    "edge-ten-pascal",
    "edge-disjoint-spectra-two-rubbers",
    "edge-equal-tau-series",
    "edge-forty-decades",
    "edge-liquid",
)
SLOW_OPTIONS = ("correction-middle", "table-shift")


@functools.cache
def solution(name):
    """Return the quantities of a scene by their names."""
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
    assert abs(found - expected) <= rel * scale, f"{quantity} {found!r}, must be {expected!r}"


@pytest.mark.parametrize("name", slow_if(SLOW_SCENES.__contains__, SCENES.keys()))
def test_scene(name):
    for quantity in QUANTITIES:
        assert_close(quantity, solution(name)[quantity], SCENES[name], 1e-9)


@pytest.mark.parametrize(
    "name", slow_if(lambda name: name.startswith("table-modulus-") or name in SLOW_OPTIONS, OPTIONS.keys())
)
def test_option(name):
    # A tabulated modulus is integrated over the angle across its kinks.
    rel = 1e-5 if "table-modulus" in name else 1e-9
    for quantity in QUANTITIES:
        assert_close(quantity, solution(name)[quantity], OPTIONS[name], rel)


TABLES = ("table-modulus", "table-modulus-on-elastic", "table-modulus-wlf")


@pytest.mark.parametrize("name", slow_if(lambda name: name != "table-modulus", TABLES))
def test_tabulated_modulus_at_many_velocities(name):
    """The means over the angle are shared by all velocities of a call: 20 decades cost no accuracy."""
    case = OPTIONS[name]
    at, _, *rest = arguments(case)
    found = jax.jit(rf.solve)(at, np.array([1e-12, 1e-6, case["v"], 1e3, 1e9]), *rest)
    for quantity in QUANTITIES:
        assert_close(quantity, float(getattr(found, quantity)[2]), case, 1e-5)


@pytest.mark.parametrize("name", ["layer-on-rough-rigid-0", "elastic-elastic-0"])
def test_one_quantity_alone(name):
    """Asked for one quantity, a call returns what `solve` returns for it, and None for the rest."""
    at = arguments(SCENES[name])
    functions = {"area": rf.contact_area, "friction": rf.friction, "separation": rf.separation}
    for quantity, function in functions.items():
        alone = jax.jit(function)(*at)
        assert alone == pytest.approx(solution(name)[quantity], rel=1e-13, abs=0)
        only = jax.eval_shape(functools.partial(rf.solve, quantities=(quantity,)), *at)
        assert [q for q in QUANTITIES if getattr(only, q) is not None] == [quantity]
