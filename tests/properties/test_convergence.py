"""`converged` is True where the values are solutions, and False where an iteration ended before."""

import numpy as np
import pytest
from problems import PROBLEMS
from support.cases.stored import slow_if

import rubberfric as rf
from rubberfric.base import fixed_points
from rubberfric.theory.heat import branch

ITERATED = {name: one for name, one in PROBLEMS.items() if "converged" in rf.quantities_of(one.scene)}
HEATED = {name: one for name, one in ITERATED.items() if one.scene.heating is not None}


@pytest.mark.parametrize("name", slow_if(lambda name: name != "law", ITERATED.keys()))
def test_ordinary_scenes_converge(name):
    problem = ITERATED[name]
    found = problem.solved(velocity=problem.velocity * np.array([1.0, 1e-3, 30.0]))
    assert found["converged"].all()


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1, 2])
@pytest.mark.parametrize("name", HEATED)
def test_what_did_not_converge_says_so_and_is_finite(name, steps, monkeypatch):
    monkeypatch.setattr(fixed_points, "_MOST_STEPS", steps)
    # Else the branch is followed on the scene's own mesh.
    monkeypatch.setattr(branch, "_MOST_EVALUATIONS", steps)
    # Another setting compiles again.
    found = HEATED[name].solved(
        velocity=np.array([0.0, 1e-3, 1.0, 10.0]), quadrature=rf.Quadrature(heat=160 + steps)
    )
    assert not found["converged"][1:].any()
    assert all(np.isfinite(values).all() for values in found.values())
