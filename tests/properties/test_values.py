"""Values are those of programs that share no code with the fast path.

`tests/reference` holds the values of brute force (`tests/support/oracles`), and `rubberfric.theory.paper` the
paper's equations one by one. The quadrature error of `paper.solve` with its default nodes is 1e-14 in area
and friction and 1e-10 in the separation, from twice the nodes.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from problems import each, having, stored
from support.cases.stored import h_rms

import rubberfric as rf
from rubberfric.theory import paper

STORED = [
    problem._replace(name=f"{file}-{problem.name.removeprefix('edge-')}")
    for file in ("forward", "edge", "option", "part", "heated")
    for problem in stored(f"{file}_cases")
]
# Scenes of the fewest structures that compile quickly, and extremes of the same structures.
ORDINARY = (
    *(f"forward-{name}-0" for name in ("smooth-rubber-rough-rigid", "case2-rough-rubber-smooth-rigid")),
    *(f"forward-{name}-0" for name in ("elastic-elastic", "layer-on-rough-rigid")),
    *(f"forward-{name}-0" for name in ("case3-rough-rubber-smooth-elastic", "rubber-on-rough-elastic")),
    *(f"forward-{name}-0" for name in ("case1-rough-rubber-rough-rigid", "general-both-rubber-both-rough")),
    *(f"forward-extreme-{name}-0" for name in ("slow", "fast", "light", "heavy")),
    *(f"edge-{name}" for name in ("ten-decades", "negative-velocity")),
    *(f"option-{name}" for name in ("correction-light", "correction-heavy")),
    *(f"option-{name}" for name in ("frictionless-slab", "table-spectrum", "table-modulus", "wlf-hot")),
    *(f"part-soft-{name}" for name in ("plain", "slow", "fast", "backwards", "at-rest", "gentle")),
    *(f"part-grooved-{name}" for name in ("plain", "slow", "backwards", "at-rest", "along", "across")),
    "part-grooved-mirrored",
)


def tolerance(problem):
    """Relative error of a stored scene."""
    if problem.source == "heated_cases":
        return 1e-8
    if "tabulated" in problem.tags:  # integrated over the angle across its kinks
        return 1e-6 if problem.source == "part_cases" else 1e-5
    if "softening" in problem.tags:
        return 1e-10
    return 1e-11 if "anisotropic" in problem.tags else 1e-9


@each(STORED, ORDINARY)
def test_brute_force(problem):
    """At one of several velocities, which share the means over the angle of a tabulated modulus."""
    case, rtol = problem.case, tolerance(problem)
    results = problem.solved(velocity=np.array([problem.velocity, 1e-12, 1.0, 1e3]))
    assert results.get("converged", np.ones(1))[0]
    # In full contact the separation is 1e-100 of the roughness; by symmetry a transverse friction vanishes to
    # rounding of the friction; and what is hot is known by its rise.
    floors = {"separation": 1e-6 * h_rms(case), "transverse_friction": 1e-2 * abs(case["friction"])}
    offset = {"flash_temperature": problem.temperature}
    for quantity in problem.names:
        key = "transverse" if quantity == "transverse_friction" else quantity
        exact = case.get(key, 0.0) if key == "transverse" else case[key]
        error = abs(results[quantity][0] - exact)
        scale = abs(exact - offset.get(quantity, 0.0)) + floors.get(quantity, 0.0)
        # Where nothing dissipates, friction is 0 exactly.
        assert error <= rtol * scale, (quantity, results[quantity][0], exact)


# One structure. The ordinary run has other parts by brute force.
ORDINARY_OF_PAPER = ("rubber", "light load", "heavy load", "backwards", "rest", "liquid", "flat spectrum")


@functools.partial(jax.jit, static_argnames="tabulated")
def slope_of_paper(arguments, direction, tabulated):
    """Return values of the paper's equations and their derivatives along a direction."""
    nodes = paper.gauss_nodes(step=0.06, panels=12) if tabulated else paper.gauss_nodes()
    return jax.jvp(lambda *at: jnp.stack(paper.solve(*at, nodes=nodes)[:3]), arguments, direction)


@jax.jit
def slope_of_library(arguments, direction):
    return jax.jvp(lambda *at: jnp.stack(rf.solve(*at)[:3]), arguments, direction)


@each(having("paper"), ORDINARY_OF_PAPER)
def test_values_and_derivatives_are_those_of_the_paper(problem):
    """Derivatives by all parameters and conditions, along two random directions in their logarithms."""
    arguments = problem.arguments
    assert paper.covers(problem.scene)
    rng = np.random.default_rng(0)
    directions = jax.tree.map(lambda x: jnp.asarray(x * rng.uniform(0.5, 1.5, (2, *x.shape))), arguments)
    for i in (0, 1):
        direction = jax.tree.map(lambda x, i=i: x[i], directions)
        value, slope = slope_of_library(arguments, direction)
        exact, exact_slope = slope_of_paper(arguments, direction, "tabulated" in problem.tags)
        np.testing.assert_allclose(value, exact, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(slope, exact_slope, rtol=1e-6, atol=1e-9)
