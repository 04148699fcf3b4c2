"""`converged` is True where the values are solutions, and False where an iteration ended before."""

import numpy as np
import pytest
from problems import PROBLEMS, each

import rubberfric as rf
from rubberfric.base import fixed_points, roots
from rubberfric.theory.area import boundary_elements_law
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


def assert_equal(values, expected, at):
    """The sums over k with 174 ... 178 nodes agree to 1e-9."""
    for quantity in set(expected) - {"converged"}:
        np.testing.assert_allclose(
            values[quantity][at], expected[quantity][at], rtol=1e-8, atol=1e-14, err_msg=quantity
        )


@each(ITERATED, ("law",))
def test_ordinary_scenes_converge(problem, monkeypatch):
    """A hundred thousand times smaller residual leaves the values."""
    velocity = problem.velocity * np.array([1.0, 1e-3, 30.0])
    results = problem.solved(velocity=velocity)
    assert results["converged"].all()
    if problem.scene.heating is not None:
        monkeypatch.setattr(fixed_points, "_TOLERANCE", 1e-12)
        assert_equal(results, problem.solved(velocity=velocity, quadrature=FURTHER), slice(None))


@pytest.mark.parametrize("steps", ENDED)
@each(ITERATED, ())
def test_what_did_not_converge_says_so_and_is_finite(problem, steps, monkeypatch):
    """Values that are said to have converged are those of the full iteration."""
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
