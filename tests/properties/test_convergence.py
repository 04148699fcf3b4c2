"""`converged` is True where the values are solutions, and False where an iteration ended before."""

import jax.numpy as jnp
import numpy as np
import pytest
from problems import PROBLEMS, each, having

import rubberfric as rf
from rubberfric.base import fixed_points, roots
from rubberfric.theory.area import boundary_elements_law, constant_area, long_range
from rubberfric.theory.heat import branch

ITERATED = [problem for problem in PROBLEMS.values() if "converged" in rf.quantities_of(problem.scene)]
# The largest number of steps of every iteration.
LIMITS = (
    (fixed_points, "_MOST_STEPS"),
    (branch, "_MOST_EVALUATIONS"),  # otherwise the branch is followed on the scene's own mesh
    (boundary_elements_law, "_STEPS"),
    (roots, "_MOST_SECANTS"),
)
# Settings with changed constants of an iteration compile again.
FURTHER = rf.Quadrature(heat=178)
ENDED = {1: rf.Quadrature(heat=174), 2: rf.Quadrature(heat=175)}
FOLLOWED = rf.Quadrature(heat=177)


def assert_equal(values, expected, at, rtol=1e-8):
    """The sums over k with 174 ... 178 nodes agree to 1e-9."""
    for quantity in set(expected) - {"converged"}:
        np.testing.assert_allclose(
            values[quantity][at], expected[quantity][at], rtol=rtol, atol=1e-14, err_msg=quantity
        )


def iterate_from_elsewhere(monkeypatch):
    """Let the law and adhesion iterate once more, from 0.1 % beside their solutions."""
    fixed_point, zero = boundary_elements_law._fixed_point, roots.zero

    def law(balance, start):
        return fixed_point(balance, fixed_point(balance, start)[0] + 1e-3)

    def adhesion(function, near, top):
        solution = zero(function, near, top)[0]
        return zero(function, near._replace(start=jnp.minimum(1.001 * solution, top)), top)

    monkeypatch.setattr(boundary_elements_law, "_fixed_point", law)
    for module in (constant_area, long_range):
        monkeypatch.setattr(module, "zero", adhesion)


@each(ITERATED, ("law",))
def test_ordinary_scenes_converge(problem, monkeypatch):
    """The values are the same with a hundred thousand times smaller residual, and from another start.

    The law and adhesion have tolerances of 1e-13 and 1e-11.
    """
    velocity = problem.velocity * np.array([1.0, 1e-3, 30.0])
    results = problem.solved(velocity=velocity)
    assert results["converged"].all()
    heated = problem.scene.heating is not None
    if heated:
        monkeypatch.setattr(fixed_points, "_TOLERANCE", 1e-12)
    else:
        iterate_from_elsewhere(monkeypatch)
    further = problem.solved(velocity=velocity, quadrature=FURTHER)
    assert_equal(results, further, slice(None), 1e-8 if heated else 1e-9)


@pytest.mark.parametrize("steps", ENDED)
@each(ITERATED, ())
def test_what_did_not_converge_says_so_and_is_finite(problem, steps, monkeypatch):
    """Where `converged` is True, values equal the results of the full iteration."""
    velocity = np.array([0.0, 1e-3, 1.0, 10.0])
    usual = problem.solved(velocity=velocity, quadrature=rf.Quadrature())
    for module, name in LIMITS:
        monkeypatch.setattr(module, name, steps)
    results = problem.solved(velocity=velocity, quadrature=ENDED[steps])
    assert all(np.isfinite(values).all() for values in results.values())
    ended = results["converged"]
    # At rest nothing is hot, and liquids have no stiffness. Adhesion starts close to its solution.
    assert not ended[1:].any() or "adhesion" in problem.tags
    assert_equal(results, usual, ended)


@each(having("heating"), ())
def test_the_branch_is_followed_where_the_refinement_ended_before(problem, monkeypatch):
    """Without enough steps on the scene's mesh, its branch leads to the solution."""
    velocity = problem.velocity * np.array([1.0, 1e-3, 30.0])
    usual = problem.solved(velocity=velocity, quadrature=rf.Quadrature())
    monkeypatch.setattr(fixed_points, "_MOST_STEPS", 1)
    results = problem.solved(velocity=velocity, quadrature=FOLLOWED)
    assert results["converged"].all()
    assert_equal(results, usual, slice(None))
