"""The paper's equations, evaluated one by one (`rubberfric.theory.paper`): values, nodes, refusals.

`tests/properties/test_values.py` compares the fast functions with them.
"""

import jax
import numpy as np
import pytest
from problems import PROBLEMS, RIGID, ROAD, TREAD, scene
from support.cases.stored import QUANTITIES, arguments, reference

import rubberfric as rf
from rubberfric.theory import paper

# Structures of scene of the brute force of `oracle.py`, which shares no code with the paper's module.
BY_ORACLE = ("general-both-rubber-both-rough-0", "general-layered-0", "extreme-light-1", "elastic-elastic-0")


@pytest.mark.parametrize("name", BY_ORACLE)
def test_the_paper_has_the_values_of_brute_force(name):
    case = reference("forward_cases")[name]
    found = jax.jit(paper.solve)(*arguments(case))
    for quantity in QUANTITIES:
        value, exact = float(getattr(found, quantity)), case[quantity]
        assert value == pytest.approx(exact, rel=1e-9, abs=1e-20 if exact == 0 else 0), quantity


@pytest.mark.slow
def test_nodes_of_the_paper_are_enough():
    for at, rtol in (
        (PROBLEMS["two rubbers"].arguments, [1e-13, 1e-13, 1e-9]),
        (PROBLEMS["light load"].arguments, [1e-12, 1e-11, 1e-9]),
    ):
        usual = paper.solve(*at)
        fine = paper.solve(*at, nodes=paper.gauss_nodes(order=16, panels=12, graded=18, step=0.15))
        for one, two, error in zip(usual, fine, rtol, strict=False):
            assert float(one) == pytest.approx(float(two), rel=error)


def test_trapezoids_converge_to_the_second_order():
    """Full contact at first, every angle resolved: the trapezoids' own order."""
    road = rf.SelfAffine(100.0, 1000.0, 1e4, 0.8, 5e-4)
    slow = scene((RIGID, road), (rf.Prony(3e6, [4e8, 5e7], [1e-7, 1e-3]),))
    exact = paper.solve(slow, 1e-7, 4e6)
    errors = []
    for n in (51, 101, 201):
        found = paper.solve(slow, 1e-7, 4e6, nodes=paper.trapezoid_nodes(n, 2 * n))
        errors.append([abs(float(a / b) - 1) for a, b in zip(found[:3], exact[:3], strict=True)])
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all((ratios > 3.4) & (ratios < 4.6)), ratios


@pytest.mark.parametrize(
    "part",
    [
        {"heating": rf.Heating(1200.0, 1600.0, 0.23, 2e-3)},
        {"softening": rf.Softening(np.array([1e-3, 1.0]), np.array([1.0, 0.3]), np.array([1.0, 0.5]))},
        {"adhesion": rf.Adhesion(0.05)},
        {"lower": rf.Body(RIGID, rf.Anisotropic(ROAD, 2.0))},
        {"upper": rf.Body(TREAD, None, rf.Coating(1e-3, rf.Elastic(1e9, 0.3)))},
    ],
    ids=lambda part: next(iter(part)),
)
def test_scenes_beyond_the_paper_are_refused(part):
    plain = scene((RIGID, ROAD), (TREAD,))
    assert paper.covers(plain) and not paper.covers(plain.replace(**part))
    with pytest.raises(ValueError, match="scene has a part that the paper's general case lacks"):
        paper.solve(plain.replace(**part), 1.0, 1e5)
