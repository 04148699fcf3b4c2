"""jit, vmap, long curves and single quantities equal an eager call, and float32 keeps its dtype."""

import jax
import jax.numpy as jnp
import numpy as np
from problems import POINTS, PROBLEMS, compiled, covering, distinct, each

import rubberfric as rf

ORDINARY = ("rubber",)

# The first test compiles seven functions a problem, the third one for each quantity.
each_part = each(covering(PROBLEMS.values(), also=ORDINARY), ORDINARY)
each_structure = each(distinct(PROBLEMS.values()), ORDINARY)
# Outside jit a call takes the setting that fits, within it cannot know.
USUAL = rf.Quadrature()


def curve(problem):
    """Velocities around the velocity of the problem, and the other conditions."""
    velocity = problem.velocity * np.array([1.0, 0.1, 10.0, 3.0])
    return velocity, *problem.conditions[1:]


def assert_equal(values, expected, rtol):
    """Friction that vanishes relative to nothing."""
    for name, exact in expected.items():
        value, exact = np.asarray(values[name], float), np.asarray(exact, float)
        np.testing.assert_allclose(value, exact, rtol=rtol, atol=rtol * np.abs(exact).max(), err_msg=name)


@each_part
def test_all_ways_of_a_call_return_the_same(problem):
    """Eager, closed over, mapped over points, mapped over scenes: all loops in other orders."""
    names = rf.quantities_of(problem.scene)
    expected = problem.solved(velocity=curve(problem)[0])
    rtol = 1e-9 if "converged" in names else 1e-11

    def call(scene, velocity, *others):
        solution = rf.solve(scene, velocity, *others, quantities=names, quadrature=USUAL)
        return {quantity: getattr(solution, quantity) for quantity in names}

    scene, (velocity, *others) = problem.scene, curve(problem)
    assert_equal(call(scene, velocity, *others), expected, rtol)
    assert_equal(jax.jit(lambda v: call(scene, v, *others))(velocity), expected, rtol)
    grid = [np.broadcast_to(x, POINTS) for x in others]
    mapped = jax.jit(jax.vmap(call, (None, *[0] * (1 + len(grid)))))(problem.arguments[0], velocity, *grid)
    assert_equal(mapped, expected, rtol)
    scenes = jax.tree.map(lambda x: jnp.stack([x, x]), problem.arguments[0])
    mapped = jax.jit(jax.vmap(call, (0, None, *[None] * len(others))))(scenes, velocity, *others)
    for k in (0, 1):
        assert_equal({quantity: x[k] for quantity, x in mapped.items()}, expected, rtol)


@each_structure
def test_a_point_alone_equals_itself_in_a_curve(problem):
    """Bit by bit: iterations of the others end earlier or later, and do not matter."""
    velocity = curve(problem)[0]
    together = problem.solved(velocity=velocity)
    for i in range(POINTS):
        for quantity, alone in problem.solved(velocity=velocity[i]).items():
            exact = "tabulated" not in problem.tags  # whose grid follows the velocities
            np.testing.assert_allclose(
                alone[0], together[quantity][i], rtol=0 if exact else 1e-9, err_msg=quantity
            )


# Stiffness that depends on the wavevector is evaluated on a grid of frequencies for so many points.
MANY = 64


@each(distinct(PROBLEMS.values()), ("rubber on elastic base",))
def test_a_long_curve_has_the_values_of_its_points(problem):
    velocity = curve(problem)[0]
    between = np.geomspace(1e-3, 1e3, MANY - POINTS) * (problem.velocity or 1e-2)
    arguments = problem._replace(velocity=np.concatenate([between, velocity])).arguments
    names = rf.quantities_of(problem.scene)
    results = compiled(arguments, names, None)
    few = problem.solved(velocity=velocity)
    assert_equal({name: x[-POINTS:] for name, x in results.items()}, few, 1e-9)


@each_part
def test_one_quantity_alone(problem):
    """A call for one quantity returns its value, and None for the rest."""
    whole = problem.solved()
    for quantity in problem.names:
        only = jax.jit(lambda *at, quantity=quantity: rf.solve(*at, quantities=quantity))(*problem.arguments)
        scale = max(abs(whole[quantity][0]), abs(whole["friction"][0]) * quantity.endswith("friction"))
        assert abs(getattr(only, quantity) - whole[quantity][0]) <= 1e-9 * scale, quantity
        assert [x for x, value in only._asdict().items() if value is not None] == [quantity]


@each(distinct(PROBLEMS.values()), ("rubber", "contact shear"))
def test_single_precision(problem):
    expected, single = problem.solved(), problem.solved(dtype=np.float32)
    rtol = 5e-4 if problem.tags & {"heating", "adhesion"} else 5e-5
    for quantity in problem.names:
        assert single[quantity].dtype == np.float32
        if quantity.endswith("friction") and "law of a liquid" in problem.tags:
            # It depends on where the circle ends, and has no accurate value. float32 differs by 7 %.
            assert abs(single[quantity][0] / expected[quantity][0] - 1) < 0.1
            continue
        # A separation near full contact is a small difference.
        floor = 1e-6 if quantity == "separation" else 0.0
        np.testing.assert_allclose(single[quantity], expected[quantity], rtol=rtol, atol=1e-2 * floor * 5e-4)
    assert single.get("converged", np.ones(1)).all()


# It only traces. Arrays of the second one had the wrong shape.
@each(PROBLEMS.values(), (*ORDINARY, "vertical shift of rough rubber"))
def test_python_numbers_do_not_widen_a_float32_scene(problem):
    single = jax.tree.map(lambda x: x.astype(np.float32), problem.arguments[0])
    shapes = jax.eval_shape(
        lambda scene: rf.solve(scene, *problem.conditions, quantities=problem.names), single
    )
    assert {leaf.dtype for leaf in jax.tree.leaves(shapes)} == {np.dtype(np.float32)}
