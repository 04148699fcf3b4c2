"""Softened and anisotropic scenes against the oracle: values, derivatives, single precision."""

import jax
import numpy as np
import pytest
from support.cases.parts import CASES, expected, forward, reverse, value
from support.cases.stored import arguments, elements, names_of, slow_if

# Scenes of three compilations: softened, anisotropic, and both of the last names by themselves.
ORDINARY = (
    *(f"soft-{name}" for name in ("plain", "slow", "fast", "backwards", "at-rest", "gentle", "two-rubbers")),
    *(f"grooved-{name}" for name in ("plain", "slow", "backwards", "at-rest", "along", "across", "mirrored")),
    "grooved-table",
)
# A tabulated modulus is integrated over the angle across its kinks.
TABLES = [name for name, case in CASES.items() if "table" in (case["solid1"]["kind"], case["solid2"]["kind"])]


@pytest.mark.parametrize("name", slow_if(lambda name: name not in ORDINARY, CASES.keys()))
def test_values(name):
    found, exact = value(arguments(CASES[name])), expected(CASES[name])
    rtol = 1e-6 if name in TABLES else 1e-10 if name.startswith("soft") else 1e-11
    # A transverse friction that vanishes by symmetry does so to rounding of the friction.
    np.testing.assert_allclose(found, exact, rtol=rtol, atol=1e-13 * abs(exact[1]))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, case in CASES.items() if "derivatives" in case])
def test_derivatives(name):
    """Forward = reverse, and both the differences of the oracle."""
    at = arguments(CASES[name])
    one, other, values = elements(reverse(at)), elements(forward(at)), np.abs(expected(CASES[name]))
    numbers = np.concatenate([np.ravel(x) for x in jax.tree.leaves(at)])
    unit = np.where(numbers != 0, np.abs(numbers), 1.0)[:, None]
    assert (np.abs(one - other) * unit <= 1e-9 * (values + np.abs(one) * unit)).all()
    slopes, numbers = (dict(zip(names_of(at), rows, strict=True)) for rows in (one, numbers))
    # Over the velocity a table's kinks run through the panels: with 48 panels and angle=1200 3e-6 is left.
    rtol = 1e-4 if name in TABLES else 1e-8
    for parameter, exact in CASES[name]["derivatives"].items():
        found = slopes[parameter] * (1.0 if parameter.endswith("angle") else numbers[parameter])
        exact = expected(exact)
        error = np.abs(found - exact) / np.maximum(values + np.abs(exact), np.finfo(float).tiny)
        assert (error <= rtol).all(), (parameter, found, exact)


SINGLE = ("soft-plain", "soft-two-rubbers", "soft-table-modulus", "soft-shear-modulus")
SINGLE += ("grooved-plain", "grooved-table", "grooved-two-rubbers")


@pytest.mark.slow
@pytest.mark.parametrize("name", SINGLE)
def test_single_precision(name):
    found = value(arguments(CASES[name], np.float32))
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, expected(CASES[name]), rtol=2e-5)
