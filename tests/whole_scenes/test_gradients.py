"""Derivatives of area, friction and separation compared with brute force and differences.

Errors are measured against |Q| + |dQ/d ln theta|, the change that matters in a fit: a
parameter off by a part moves the quantity by that part of it. A separation counts from
1e-6 of the rms height upwards. More scenes are in test_extremes.py, whose references have 25 digits.
"""

import jax
import numpy as np
import pytest
from support.cases.stored import QUANTITIES, arguments, h_rms, leaf_value, reference, reverse, slow_if

import rubberfric as rf

DERIVATIVES = reference("derivative_cases")

# Kinds of scene that test_extremes holds against references of more digits.
IN_EXTREMES = (
    "one-rubber",
    "two-rubbers",
    "slab",
    "two-slabs",
    "frictionless-slab",
    "rubber-on-elastic",
    "light",
    "corrected",
    "table-spectrum",
)


@pytest.mark.parametrize("name", slow_if(IN_EXTREMES.__contains__, DERIVATIVES.keys()))
def test_equal_to_the_oracle(name):
    """Derivatives of the brute-force values, not of the library's own."""
    case = DERIVATIVES[name]
    at = arguments(case)
    Q, slopes = reverse(at)
    floor = np.array([0.0, 0.0, 1e-6 * h_rms(case)])
    for parameter, expected in case["derivatives"].items():
        path = parameter.split(".")
        kind = case[path[0]]["kind"] if path[0].startswith("solid") else None
        slope = leaf_value(slopes, path, kind) * leaf_value(at, path, kind)
        expected = np.array([expected[quantity] for quantity in QUANTITIES])
        error = np.abs(slope - expected)
        assert (error <= 1e-6 * (np.abs(Q) + floor + np.abs(expected))).all(), (parameter, error)


@pytest.mark.slow
def test_a_roughness_that_begins_at_a_border_of_the_others():
    """An ulp from the middle of the range; the contact is lost within A^2 = 1e-12 of it: by differences."""
    road = rf.SelfAffine(1e6, 1e6, 3e6, 0.8, 1e-7)
    tread = rf.Prony(1.0, [1.0, 1.0, 1e3], [1.0, 1.0, 1.0])

    @jax.jit
    def friction(q0):
        rough = rf.SelfAffine(q0, 2828427.1247461904, 4e6, 0.8, 1.0)
        return rf.friction(rf.Scene(rf.Body(tread, road), rf.Body(rf.Elastic(1e3, 0.5), rough)), 1.0, 1e3)

    slope = 2e6 * float(jax.jit(jax.grad(friction))(2e6))
    difference = (friction(2e6 * (1 + 1e-5)) - friction(2e6 * (1 - 1e-5))) / 2e-5
    assert slope == pytest.approx(float(difference), rel=1e-7)
