"""A finer quadrature agrees with the usual one within the error that is stated for it."""

import numpy as np
import pytest
from problems import PROBLEMS
from support.cases.stored import slow_if

import rubberfric as rf

FINER = rf.Quadrature(order=18, panels=36, graded=16, ratio=3.5, angular_order=20)
ORDINARY = ("rubber",)


def tolerance(problem):
    """Relative errors of the usual quadrature."""
    if problem.tags & {"adhesion"}:  # nodes follow the load
        return 3e-5
    if "tabulated" in problem.tags:  # with and without kinks that the softening moves
        return 1e-5 if "softening" in problem.tags else 1e-6
    return 1e-8 if "heating" in problem.tags else 2e-9


@pytest.mark.parametrize("name", slow_if(lambda name: name not in ORDINARY, PROBLEMS.keys()))
def test_a_finer_quadrature_agrees(name):
    problem = PROBLEMS[name]
    velocity = problem.velocity * np.array([1.0, 0.1, 10.0])
    usual, fine = (problem.solved(velocity=velocity, quadrature=one) for one in (None, FINER))
    for quantity in problem.names:
        error = np.abs(usual[quantity] - fine[quantity])
        floor = np.abs(fine["friction"]) * (quantity == "transverse_friction")
        assert (error <= tolerance(problem) * np.maximum(np.abs(fine[quantity]), floor)).all(), (
            quantity,
            error,
        )
