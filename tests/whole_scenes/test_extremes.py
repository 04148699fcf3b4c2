"""Extreme and stiff scenes against references of 25 digits and more; and single precision.

`extremes.py` lists the scenes, `reference/precise/make_extremes.py` computes their quantities and
the derivatives with respect to every number of scene, velocity, pressure and temperature.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.cases.extreme_errors import (
    REFERENCES,
    REFUSED,
    computed,
    conditions,
    elements,
    entry_of,
    errors,
    names_of,
    rounded,
    slope_errors,
    value_errors,
    value_floor,
)
from support.cases.extremes import CASES, changed
from support.cases.stored import QUANTITIES, h_rms, paths, reverse, slow_if, three, value

import rubberfric as rf

# Cases that compile other structures, or another quadrature.
SLOW = ("one-term", "many-terms", "gamma-0-light", "forty-decades")

ORDINARY = ("one",)  # kinds of scenes that the ordinary run compiles


def is_slow(name):
    """Return True if a case is only in the full set."""
    return name.startswith(SLOW) or CASES[name][0] not in ORDINARY


every_case = pytest.mark.parametrize("name", slow_if(is_slow, CASES.keys()))


# Incompressible films 1e-8 wavelengths thick: d ln Sbar / d nu is 1e16 there, so that a derivative
# of 1e-8 is left of it, and the rounding of 1e-16 next to it.
FILMS = {"film-incompressible-slabs": 1e-4, "film-on-thick-slabs": 1e-5}


@pytest.mark.parametrize("name", CASES)
def test_reference_is_of_this_case(name):
    """Made from the same numbers, of all of them, and good to 25 digits."""
    case, entry = changed(*CASES[name]), REFERENCES[name]
    names = names_of(conditions(case))
    if not name.startswith("many-terms"):
        assert set(entry["derivatives"]) == set(names)
    for leaf, row in entry["derivatives"].items():
        assert row[0] == pytest.approx(entry_of(case, leaf), rel=1e-14, abs=0), leaf
    assert entry["digits"] >= 25
    assert entry["digits_of_derivatives"] >= 25


@every_case
def test_value_and_derivatives(name):
    case, ((A, mu, u), _) = changed(*CASES[name]), computed(name)
    assert 0 <= A <= 1
    assert 0 <= u < 1e3 * h_rms(case) + 1e-300
    assert 0 <= mu * np.sign(case["v"] or 1) < np.inf
    error = value_errors(name)
    assert (error <= 1e-9).all(), dict(zip(QUANTITIES, error, strict=True))
    # With respect to every number.
    assert np.isfinite(computed(name)[1]).all()
    leaves, error = slope_errors(name)
    bound = FILMS.get(name, 1e-7)
    wrong = {leaf: row for leaf, row in zip(leaves, error.tolist(), strict=True) if not max(row) <= bound}
    assert not wrong


def test_wide_panels_leave_g_positive():
    """Eleven decades, eight of them plateau, a liquid in series: <|F|^2> rises by 1e5 within a panel."""
    liquid = rf.Prony(0.0, [1.0] * 3, [1.0] * 3)
    rough = [rf.SelfAffine(q0, qr, 1e11, 0.8, h) for q0, qr, h in ((10.0, 1.8e7, 0.0), (1.0, 1.8e8, 1.0))]
    scene = rf.Scene(rf.Body(liquid, rough[0]), rf.Body(rf.Elastic(1.0, 0.5), rough[1]))
    for v in (1e-12, 1e-11, 1e-9):
        assert np.isfinite(three(rf.solve(scene, v, 1.0))).all()


@pytest.mark.slow
def test_below_the_pole_of_the_shift():
    """Refused where the temperature is known; saturated, and finite, where it is not."""
    at, v, pressure, _ = conditions(changed("sheared", {}))
    with pytest.raises(ValueError, match="temperature"):
        rf.solve(at, v, pressure, 191.0)
    for T in (191.0, 191.55, 191.549, 0.0, -10.0):
        found, slopes = reverse((at, v, pressure, jnp.asarray(T, float)))
        assert np.isfinite(found).all()
        assert np.isfinite(elements(slopes)).all()


# --- Single precision


@pytest.mark.parametrize("name", REFUSED)
def test_refused_in_single_precision(name):
    with pytest.raises(ValueError, match=f"{REFUSED[name]}.*use float64"):
        rf.solve(*rounded(changed(*CASES[name]))[0])


def in_single(ordinary):
    """Return every case within float32, with cases outside the ordinary run marked slow."""
    names = [name for name in CASES if name not in REFUSED]
    return pytest.mark.parametrize("name", slow_if(lambda name: not ordinary(name), names))


@in_single(lambda name: not is_slow(name))
def test_single_precision(name):
    case = changed(*CASES[name])
    single, double = rounded(case)
    found, expected = np.asarray(value(single), float), np.asarray(reverse(double)[0])
    assert np.isfinite(found).all()
    error = errors(np.abs(found - expected), np.abs(expected) + value_floor(case, jnp.float32))
    assert (error <= 1e-5).all(), dict(zip(QUANTITIES, error, strict=True))


@in_single(lambda name: CASES[name][0] == "one" and not name.startswith(SLOW))
@pytest.mark.slow
def test_single_precision_derivatives(name):
    """All leaves float32 although x64 is on: dtype kept in values and derivatives, which are finite."""
    found, slopes = reverse(rounded(changed(*CASES[name]))[0])
    assert found.dtype == jnp.float32
    assert {slope.dtype for slope in jax.tree.leaves(slopes)} == {jnp.dtype(jnp.float32)}
    bad = [p for p, s in zip(paths(slopes), jax.tree.leaves(slopes), strict=True) if not np.isfinite(s).all()]
    assert not bad


def test_too_few_panels_give_nan_instead_of_a_wrong_friction():
    """<|F|^2> rises by 1e6 within a panel, where its interpolant swings below 0."""
    few = rf.Quadrature(order=5, panels=3, graded=2, ratio=8.0, angular_order=6)
    road = rf.SelfAffine(1e2, 1e3, 1e9, 0.8, 5e-4)
    steep = rf.Scene(rf.Body(rf.Rigid(), road), rf.Body(rf.Prony(1e6, [3e9], [1e-3])))
    found = rf.friction(steep, np.array([1e-4, 1e-3]), 1e4, quadrature=few)
    assert np.isnan(found).all(), "122 and 5.0 where the friction is 6.1 and 3.9"
