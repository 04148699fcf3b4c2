"""Limits: a part that vanishes leaves the scene without it, and scenes that are the same in other words.

A limit of `tests/problems/limits.py` changes a problem into two that must agree. It applies to all problems
that have its tags, and runs on few of them that together have every part.
"""

import numpy as np
import pytest
from problems import PROBLEMS, covering, having, stored
from problems.limits import LIMITS
from support.cases.stored import slow_if

import rubberfric as rf

OF_SOFTENING = [problem for problem in stored("part_cases") if problem.case.get("softening")]
# Limits that apply to so few problems run on each.
FEW = 5


def cases():
    """Limits with each problem that they apply to, by their names."""
    for name, limit in LIMITS.items():
        among = [*PROBLEMS.values(), *(OF_SOFTENING if name == "a table of each body" else ())]
        problems = having(*limit.has, without=limit.lacks, among=among)
        if len(problems) > FEW:
            problems = covering(problems, limit.ordinary)
        for problem in problems:
            yield f"{name}: {problem.name}", (limit, problem)


CASES = dict(cases())


def is_slow(name):
    limit, problem = CASES[name]
    return problem.name not in limit.ordinary


@pytest.mark.parametrize("name", slow_if(is_slow, CASES.keys()))
def test_both_scenes_agree(name):
    """Friction that vanishes does so to 1e-12, a part of 1e-30 of a stiffness without relaxation to 1e-28."""
    limit, problem = CASES[name]
    velocity = 0.0 if limit.rest else problem.velocity
    scenes = limit.change(problem.scene), limit.other(problem.scene) if limit.other else problem.scene
    temperatures = limit.temperatures or [temperature_of(scene, problem) for scene in scenes]
    values, expected = (
        problem.solved(scene=scene, velocity=velocity, temperature=temperature)
        for scene, temperature in zip(scenes, temperatures, strict=True)
    )
    # Nodes across kinks of a table, and nodes of the law, differ between the scenes.
    nodes = 1e-6 if "tabulated" in problem.tags else 1e-7 if "law" in problem.tags else 0.0
    rtol = max(limit.rtol, nodes)
    for quantity in set(expected) & set(values) - {"converged"}:
        scale = np.abs(expected["friction"]) if quantity.endswith("friction") else 0.0
        error = np.abs(values[quantity] - expected[quantity])
        atol = limit.atol * (quantity.endswith("friction"))
        assert (error <= rtol * np.maximum(np.abs(expected[quantity]), scale) + atol).all(), (
            quantity,
            values[quantity],
            expected[quantity],
        )


def temperature_of(scene, problem):
    """None where nothing in the scene depends on it."""
    bodies = (scene.lower, scene.upper)
    shifts = [getattr(body.material, "shift", None) for body in bodies]
    shifts += [
        getattr(body.layer.base, "shift", None) for body in bodies if isinstance(body.layer, rf.Coating)
    ]
    shifts += [scene.shear.shift] if scene.shear is not None else []
    return problem.temperature if any(shift is not None for shift in shifts) else None
