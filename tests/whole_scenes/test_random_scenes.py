"""Random whole scenes: what must hold for every scene at every velocity and pressure.

The structures come from a list, and each is compiled. Their numbers come from hypothesis, one scene per
example, so a failure shrinks to the simplest scene of its structure.

These properties are checked on every scene:

- Values are finite, as are derivatives with respect to every leaf, velocity, pressure and temperature.
- 0 <= A/A0 <= 1 and u_bar >= 0. For v > 0, mu >= 0.
- A/A0 and u_bar are even in v, and mu is odd.
- A/A0 grows with the load as fast as it must.
- Forward and reverse mode agree.

Some scenes compare jit and vmap with plain calls. Every structure checks the dtype.

More, and structures drawn at random: python -m pytest -m slow tests/whole_scenes/test_random_scenes.py
"""

import jax
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from support.cases.random_checks import as_numbers, check, check_values, everything, not_finite
from support.scenes.strategies import (
    FAR,
    LAYERS,
    MATERIALS,
    SHIFTS,
    SINGLE,
    SPECTRA,
    Solid,
    Structure,
    calls,
    decades,
    structures,
)

import rubberfric as rf

ROAD = Solid("rigid", "affine")
FIXED = (
    Structure(Solid("prony"), ROAD),
    Structure(Solid("prony", "affine", "bonded", "wlf"), Solid("rigid", "table"), True, "arrhenius", True),
    Structure(
        Solid("prony", "affine", None, "table"),
        Solid("prony", "affine", None, "arrhenius", 1),
        temperature=True,
    ),
    Structure(
        Solid("prony", "affine", "frictionless"), Solid("prony", "table", "bonded", None, 1), shear="plain"
    ),
    Structure(Solid("prony", "affine"), Solid("elastic", "affine"), shear="wlf"),
    Structure(ROAD, Solid("table-fall", None, None, "table"), shear="table", temperature=True),
    Structure(Solid("table-hold", "affine", "bonded"), Solid("prony", "table")),
    Structure(Solid("table-none"), Solid("elastic", "affine")),
    Structure(Solid("elastic", "affine", "frictionless"), Solid("elastic", "table")),
)
ROUGH_ROAD = FIXED[0]

# Every example compiles to the same function: how long one takes says nothing about it.
ordinary = settings(deadline=None, derandomize=True, database=None)
many = settings(ordinary, max_examples=3500, derandomize=False)
fewer = settings(many, max_examples=500)


HEAVIER = decades(-15.0, 6.0)


def examples(structure, how):
    """Check scenes of a structure, drawn as the settings say."""

    @how
    @given(calls(structure), HEAVIER)
    def run(call, heavier):
        check(call, heavier)

    run()


@pytest.mark.slow  # tests/rubberfric/theory/test_branches.py has random scenes in the ordinary run
@pytest.mark.parametrize("structure", FIXED, ids=str)
def test_many_scenes(structure):
    examples(structure, many)


@pytest.mark.slow
@pytest.mark.parametrize("structure", structures(40, seed=0), ids=str)
def test_scenes_of_any_structure(structure):
    examples(structure, fewer)


def drawn(structure, count, ranges=FAR, dtype=float):
    """A list of calls."""
    found = []

    @settings(ordinary, max_examples=count, phases=[Phase.generate])
    @given(calls(structure, ranges))
    def run(call):
        found.append(as_numbers(call, dtype))

    run()
    return found


# Loops run in another order. The worst conditioned quantity determines the rounding: friction in
# full contact, from a dissipation that cancels.
ALIKE = {"rtol": 1e-11, "atol": 1e-290}


@pytest.mark.slow
def test_without_jit():
    coarse = rf.Quadrature(order=4, panels=2, graded=1, angular_order=4)
    for call in drawn(ROUGH_ROAD, 3):
        with jax.disable_jit():
            plain = rf.solve(*call, quadrature=coarse)
        np.testing.assert_allclose(plain[:3], rf.solve(*call, quadrature=coarse)[:3], **ALIKE)


@pytest.mark.slow  # tests/properties has the dtype of values in the ordinary run
@pytest.mark.parametrize("structure", FIXED, ids=str)
def test_dtype_is_kept(structure):
    call = drawn(structure, 1, SINGLE, np.float32)[0]
    shapes = jax.eval_shape(everything, call, call[2], None)
    assert {leaf.dtype for leaf in jax.tree.leaves(shapes)} == {np.dtype(np.float32)}


@pytest.mark.slow
@pytest.mark.parametrize("structure", [s for s in FIXED if "table-" not in str(s)], ids=str)
def test_single_precision(structure):
    """Finite and in bounds within `SINGLE`; float32's erf falls by 4 eps where it nears 1."""
    for call in drawn(structure, 1000, SINGLE, np.float32):
        bodies = call[0].lower, call[0].upper
        if all(body.material.deforms and body.material.is_liquid() for body in bodies):
            continue  # two liquids: refused in single precision
        values, _, reverse = everything(call, 1.5 * call[2], None)
        check_values(call, 1.5 * call[2], np.asarray(values), np.finfo(np.float32).eps)
        assert not not_finite(reverse)


def test_the_list_has_every_class_and_option():
    solids = [solid for structure in FIXED for solid in structure[:2]]
    assert {solid.material for solid in solids} == set(MATERIALS)
    assert {solid.spectrum for solid in solids} == set(SPECTRA)
    assert {solid.layer for solid in solids} == set(LAYERS)
    shifts = {solid.shift for solid in solids} | {structure.shear for structure in FIXED}
    assert shifts == {*SHIFTS, "plain"}
    assert {structure.area_correction for structure in FIXED} == {False, True}
    assert {structure.temperature for structure in FIXED} == {False, True}
