"""Absent parts of a scene are not traced; counted on the jaxpr."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend.core import Literal
from problems import RIGID, ROAD, TREAD, WORN, scene
from support.cases.stored import QUANTITIES
from support.counting.operations import costly, equations, per_point, primitives, work
from support.scenes.kinds import scenes

import rubberfric as rf
from rubberfric.theory import adhesive_contact

VELOCITY = jnp.logspace(-6, 1, 50)
QUADRATURE = rf.Quadrature()
OWN = rf.Quadrature(order=5, panels=3, graded=1)  # used by no other test, so that it is traced
TERMS = 3
ANGULAR = QUADRATURE.panels * QUADRATURE.angular_order  # nodes where the stiffness is evaluated


def contact_nodes(spectra, graded=True):
    """Nodes of all panels: between shares, 3 kinks of a self-affine spectrum, one after q_r, graded ones."""
    borders = QUADRATURE.panels - 1 + spectra * (4 + (QUADRATURE.graded if graded else 0))
    return (borders - 1) * QUADRATURE.order


def added(scene, quantity, *conditions):
    """Operations that one more velocity adds to a quantity."""

    def function(scene, velocity):
        asked = {"quadrature": QUADRATURE, "quantities": (quantity,)}
        return getattr(rf.solve(scene, velocity, 1e5, *conditions, **asked), quantity)

    return per_point(function, VELOCITY, scene)[0]


@pytest.mark.parametrize("upper", [(RIGID,), (rf.Elastic(1e9, 0.3),)], ids=["case II", "case III"])
def test_friction_of_cases_two_and_three_is_a_constant(upper):
    s = scene((TREAD, WORN), upper)
    names = primitives(lambda s, v: rf.friction(s, v, 1e5), s, VELOCITY)
    assert not {"erf", "exp", "sqrt", "sort", "dot_general"} & set(names)
    assert not np.any(rf.friction(s, VELOCITY, 1e5))


def test_smooth_solids_compute_nothing():
    s = scene((TREAD,), (RIGID,))
    result = rf.solve(s, VELOCITY, 1e5)
    assert (result.area == 1).all() and (result.friction == 0).all() and (result.separation == 0).all()
    assert not {"erf", "exp", "sqrt", "sort"} & set(primitives(lambda s, v: rf.solve(s, v, 1e5), s, VELOCITY))


def test_work_of_a_point_is_a_square_root_and_a_division_for_each_node_and_term():
    """The closed form's bound, and what contact adds: a root, an erf and a division for each contact node."""
    count = added(scene((TREAD,), (RIGID, ROAD)), "friction")
    nodes = contact_nodes(1)
    assert count["sqrt"] == ANGULAR * TERMS + nodes
    assert count["erf"] == nodes
    assert count["div"] == ANGULAR * TERMS + nodes + 1  # and modulus over pressure
    assert not count["exp"] and not count["log"]


def test_area_alone_needs_the_whole_integral_only():
    """Neither graded panels, nor the integral up to every node, nor contact nodes for each velocity."""
    s = scene((TREAD,), (RIGID, ROAD))
    count = added(s, "area")
    assert count["sqrt"] == ANGULAR * TERMS + 1
    assert count["erf"] == 1
    assert count["div"] <= ANGULAR * TERMS + 2
    assert count["multiply-add"] == ANGULAR  # from angular nodes to the integral

    def sizes(function):
        jaxpr = jax.make_jaxpr(function)(s, VELOCITY)
        return {v.aval.shape for e in equations(jaxpr.jaxpr) for v in e.outvars}

    panels, between = contact_nodes(1, graded=False) // QUADRATURE.order, 5 * QUADRATURE.order
    assert (panels, QUADRATURE.order) in sizes(lambda s, v: rf.contact_area(s, v, 1e5, quadrature=QUADRATURE))
    assert (panels + QUADRATURE.graded, between) in sizes(
        lambda s, v: rf.friction(s, v, 1e5, quadrature=QUADRATURE)
    )
    for shape in sizes(lambda s, v: rf.contact_area(s, v, 1e5, quadrature=QUADRATURE)):
        assert between not in shape and panels + QUADRATURE.graded not in shape


def test_what_a_scene_lacks_adds_nothing_to_a_point():
    plain = added(scene((TREAD,), (RIGID, ROAD)), "friction")
    # The layer is real: it belongs to the scene, not to the velocity.
    assert added(scene((TREAD, None, rf.Slab(1e-3)), (RIGID, ROAD)), "friction") == plain
    # Rough rubber on a rigid solid is not excited: only a static term of G.
    rough = added(scene((TREAD, WORN), (RIGID, ROAD)), "friction")
    assert rough["sqrt"] - plain["sqrt"] == rough["erf"] - plain["erf"] == contact_nodes(2) - contact_nodes(1)
    # With an elastic block in series, a point looks up a table, which contains the terms of the rubber.
    few = rf.Prony(TREAD.E_inf, TREAD.E[:2], TREAD.tau[:2])
    in_series = [added(scene((rubber,), (rf.Elastic(1e9, 0.3), ROAD)), "friction") for rubber in (TREAD, few)]
    assert in_series[0] == in_series[1]
    assert in_series[0]["sqrt"] == contact_nodes(1)
    two = added(scene((TREAD, WORN), (TREAD, ROAD)), "friction")
    assert two["sqrt"] == contact_nodes(2)
    # Contact shear needs the area and one bell; temperature one shift factor.
    sheared = added(scene((TREAD,), (RIGID, ROAD), shear=rf.ContactShear(6e6, 0.1, 1e-2)), "friction")
    assert costly(sheared) - costly(plain) <= 8
    shifted = dataclasses.replace(TREAD, shift=rf.WLF(8.0, 100.0, 293.0))
    warm = scene((shifted,), (RIGID, ROAD))
    assert added(warm, "friction") == plain
    assert costly(added(warm, "friction", 300.0)) - costly(plain) <= 4


def test_without_adhesion_nothing_of_it_is_traced(monkeypatch):
    """Neither its fixed points nor the energy that they need."""

    def refuse(*_):
        raise AssertionError("adhesion is traced")

    rubber = scene((TREAD,), (RIGID, ROAD))
    kinds = {
        "solve_energy_criterion": rf.Adhesion(0.05),
        "solve_dmt_load": rf.Adhesion(0.05, limit="long", range=1e-9),
    }
    for adhesion in kinds.values():
        with monkeypatch.context() as patched:
            for function in kinds:
                patched.setattr(adhesive_contact, function, refuse)
            names = primitives(lambda s, v: rf.solve(s, v, 1e5, quadrature=OWN), rubber, VELOCITY)
            assert "while" not in names
            with pytest.raises(AssertionError, match="adhesion is traced"):
                rf.contact_area(rubber.replace(adhesion=adhesion), 1e-3, 1e5, quadrature=OWN)
    area = added(rubber, "area")
    assert area["erf"] == 1 and area["multiply-add"] == ANGULAR


def test_absent_parts_and_requested_quantities_only():
    plain = scene((TREAD,), (RIGID, ROAD))
    rough = scene((TREAD, WORN), (RIGID, ROAD))
    layered = scene((TREAD, None, rf.Slab(1e-3)), (RIGID, ROAD))
    two = scene((TREAD, WORN), (TREAD, ROAD))
    count = {
        name: len(primitives(lambda s, v: rf.friction(s, v, 1e5), s, VELOCITY))
        for name, s in {"plain": plain, "rough": rough, "layered": layered, "two": two}.items()
    }
    assert count["plain"] < count["layered"] < count["two"]
    assert count["plain"] < count["rough"] < count["two"]
    s = scene((TREAD, WORN), (TREAD, ROAD), shear=rf.ContactShear(6e6, 0.1, 1e-2))
    assert added(s, "shear_friction")["erf"] == 1
    assert "erf" not in primitives(
        lambda v: rf.solve(scene((TREAD,), (RIGID, ROAD)), v, 1e5, quantities=("shear_friction",)), VELOCITY
    )
    s = scene((TREAD,), (RIGID, ROAD))
    single = [work(lambda s, v, q=q: rf.solve(s, v, 1e5, quantities=(q,)), s, VELOCITY) for q in QUANTITIES]
    assert work(lambda s, v: rf.solve(s, v, 1e5), s, VELOCITY) < 0.7 * sum(single)
    s = scene((rf.Elastic(1e7, 0.4),), (RIGID, ROAD))
    one = work(lambda s, v: rf.contact_area(s, v, 1e5, quadrature=QUADRATURE), s, VELOCITY[:1])
    many = work(lambda s, v: rf.contact_area(s, v, 1e5, quadrature=QUADRATURE), s, VELOCITY)
    # Per velocity: G, its root, x and P, five operations.
    assert many <= one + 5 * VELOCITY.size


@pytest.mark.slow
def test_many_points_are_taken_in_blocks_with_equal_results():
    from rubberfric.theory.model import BLOCK

    s = scene((TREAD, WORN), (RIGID, ROAD))
    v = jnp.logspace(-8, 3, 2 * BLOCK + 37)
    p = jnp.logspace(3, 7, v.size)
    whole = rf.solve(s, v, p)
    parts = [rf.solve(s, v[i : i + 300], p[i : i + 300]) for i in range(0, v.size, 300)]
    for name in QUANTITIES:
        expected = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_allclose(getattr(whole, name), expected, rtol=1e-13)
    gradient = jax.jit(jax.grad(lambda s: jnp.sum(rf.friction(s, v, p))))(s)
    expected = [
        jax.jit(jax.grad(lambda s, i=i: jnp.sum(rf.friction(s, v[i : i + 300], p[i : i + 300]))))(s)
        for i in range(0, v.size, 300)
    ]
    total = jax.tree_util.tree_map(lambda *x: sum(x), *expected)
    for a, b in zip(jax.tree_util.tree_leaves(gradient), jax.tree_util.tree_leaves(total), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-11)


def test_installed_jax_computes_a_vmapped_product_and_sum_of_squares_correctly():
    """The pattern of github.com/jax-ml/jax/issues/39103, in which jax 0.10.2 takes a wrong row.

    There the last of these rows comes out as 16320**2, 0.8 % off, at XLA's optimization level 0 too; in
    single precision, and without the squares, it is right.
    """
    x = np.zeros((16385, 3))
    x[:, 0] = np.arange(16385)
    ours = jax.jit(jax.vmap(lambda row: jnp.sum((jnp.eye(3) @ row) ** 2)))(x)
    assert ours.dtype == np.float64  # else there is nothing to see
    np.testing.assert_array_equal(ours, x[:, 0] ** 2)  # whole numbers below 2**53, exact in any order


def overlapping_updates(function, *arguments):
    """Return the equations that write into an array an update that was sliced from the same array."""
    found, origin = [], {}
    for e in equations(jax.make_jaxpr(function)(*arguments).jaxpr):
        inputs = [x for x in e.invars if not isinstance(x, Literal)]
        if e.primitive.name in ("slice", "dynamic_slice"):
            origin[e.outvars[0]] = {inputs[0]}
        elif e.primitive.name in ("reshape", "squeeze", "broadcast_in_dim", "convert_element_type"):
            origin[e.outvars[0]] = origin.get(inputs[0], set()) if inputs else set()
        elif e.primitive.name in ("dynamic_update_slice", "scatter"):
            update = e.invars[1 if e.primitive.name == "dynamic_update_slice" else 2]
            if not isinstance(update, Literal) and e.invars[0] in origin.get(update, set()):
                found.append(e)
    return found


@pytest.mark.slow
def test_no_array_is_updated_with_a_slice_of_itself():
    """The pattern of github.com/openxla/xla/issues/49176, for which XLA computes wrong numbers on CPUs."""
    assert overlapping_updates(lambda x: x.at[1:].set(x[:-1]).reshape(1, -1), VELOCITY)
    for name in ("two rough rubbers", "with contact shear", "tabulated modulus and spectrum"):
        s, T = scenes()[name]
        traced = jax.value_and_grad(lambda s, T=T: jnp.sum(rf.friction(s, VELOCITY, 1e5, T)))
        assert not overlapping_updates(traced, s), name
