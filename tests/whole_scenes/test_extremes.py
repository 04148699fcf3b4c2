"""Extreme and stiff scenes against references of 25 digits and more; and single precision.

`extremes.py` lists the scenes, `reference/make_extremes.py` computes their quantities and
the derivatives with respect to every number of scene, velocity, pressure and temperature.
"""

import dataclasses
import functools
import json
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.cases import (
    FOLDER,
    QUANTITIES,
    arguments,
    as_arrays,
    h_rms,
    paths,
    reverse,
    scene,
    slow_if,
    three,
    value,
)
from support.extremes import CASES, RIGID, changed

import rubberfric as rf

REFERENCES = json.loads((FOLDER / "extremes.json").read_text())
# Without gamma, S P falls like (q/q0 - 1)^(-3/4) at light load instead of ^(-1/2): the
# default is 4e-8 off there, and needs more graded panels.
FINER = {"gamma-0-light-corrected": rf.Quadrature(graded=16)}
SLOW = ("one-term", "many-terms", "gamma-0-light")  # structures of their own, or a quadrature

ORDINARY = ("one", "two")  # kinds of scenes that the ordinary run compiles


def is_slow(name):
    """Whether a case is in the full set only."""
    return name.startswith(SLOW) or CASES[name][0] not in ORDINARY


every_case = pytest.mark.parametrize("name", slow_if(is_slow, CASES.keys()))


def conditions(case, dtype=float):
    """Arguments of `rf.solve` for a case, its contact shear included."""
    at, *rest = arguments(case, dtype)
    if "shear" in case:
        law = {key: x for key, x in case["shear"]["shift"].items() if key != "kind"}
        shear = rf.ContactShear(**case["shear"] | {"shift": rf.WLF(**law)})
        at = dataclasses.replace(at, shear=as_arrays(shear, dtype))
    return (at, *rest)


WORDS = {
    "lower.material": "solid1",
    "lower.layer": "solid1",
    "lower.spectrum": "psd1",
    "upper.material": "solid2",
    "upper.layer": "solid2",
    "upper.spectrum": "psd2",
    "poisson": "nu",
    "young": "E",
    "hurst": "H",
}


def names_of(tree):
    """The name that a case's dictionary has for every leaf element of its arguments: psd2.q0, solid1.E.2."""
    names = []
    for path, leaf in zip(paths(tree), jax.tree.leaves(tree), strict=True):
        number, name = re.fullmatch(r"\[(\d)\]\.?(.*)", path).groups()
        for word, own in WORDS.items():
            name = re.sub(rf"\b{word}\b", own, name)
        name = name or (None, "v", "pressure", "temperature")[int(number)]
        names += [f"{name}.{i}" for i in range(leaf.size)] if leaf.ndim else [name]
    return names


def elements(jacobian):
    """A Jacobian as (leaf element, quantity)."""
    rows = [np.asarray(x, float).reshape(len(QUANTITIES), -1).T for x in jax.tree.leaves(jacobian)]
    return np.concatenate(rows)


@functools.cache
def computed(name):
    """Quantities, and their derivatives as (leaf element, quantity)."""
    at = conditions(changed(*CASES[name]))
    found, slopes = _reverse_of(FINER[name])(at) if name in FINER else reverse(at)
    return np.asarray(found), elements(slopes)


@functools.cache
def _reverse_of(quadrature):
    def quantities(at):
        return jnp.stack(three(rf.solve(*at, quadrature=quadrature)))

    return jax.jit(lambda at: (quantities(at), jax.jacrev(quantities)(at)))


def value_floor(case, dtype=float):
    """What area, friction and separation count from: what stands for nothing is not nothing."""
    # Zero weights stand for 1e-30 of the stiffness (float32: 1e-16), which may relax; a separation
    # in full contact is 1e-100 of the roughness.
    weights = np.concatenate([np.ravel(case[solid].get("E", 1.0)) for solid in ("solid1", "solid2")])
    least = 1e-12 if dtype == jnp.float32 and not weights.all() else 1e-18
    return np.array([0.0, least, 1e-6 * h_rms(case)])


def slope_scale(case, names, expected, slopes):
    """What errors of derivatives are relative to: the derivative itself, shape (leaf element, quantity).

    Where it is small, 1e-3 of what it were if the parameter mattered as much as the one that
    matters most, or as if the quantity were proportional to it.
    """
    theta = np.array([_entry(case, name) for name in names])
    unit = np.array([_unit(case, name) for name in names])
    most = np.maximum(np.abs(expected), np.max(np.abs(theta[:, None] * slopes), 0))
    floor = np.maximum(1e-3 * most, value_floor(case))
    return np.maximum(np.abs(slopes), floor / unit[:, None])


def _entry(case, name):
    for key in name.split("."):
        case = case[int(key) if key.isdigit() else key]
    return case


def _unit(case, name):
    """A parameter, or if it is 0 a change of it that matters."""
    theta = _entry(case, name)
    if theta != 0:
        return abs(theta)
    if name in ("v", "psd1.h_rms", "psd2.h_rms"):
        return 1e-6
    if ".E" in name:
        solid = case[name.split(".")[0]]
        return max(solid["E_inf"], *solid["E"])
    return 1.0


def errors(error, scale):
    """Relative errors, 0/0 being none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(error == 0, 0.0, error / scale)


def value_errors(name):
    """Relative errors of area, friction and separation."""
    expected = np.array([REFERENCES[name][quantity] for quantity in QUANTITIES])
    scale = np.abs(expected) + value_floor(changed(*CASES[name]))
    return errors(np.abs(computed(name)[0] - expected), scale)


def slope_errors(name):
    """Names of the leaf elements with a reference, and relative errors of their derivatives."""
    case, entry = changed(*CASES[name]), REFERENCES[name]
    expected = np.array([entry[quantity] for quantity in QUANTITIES])
    at = names_of(conditions(case))
    rows = [i for i, leaf in enumerate(at) if leaf in entry["derivatives"]]
    at = [at[i] for i in rows]
    slopes = np.array([entry["derivatives"][leaf][1:] for leaf in at])
    error = np.abs(computed(name)[1][rows] - slopes)
    return at, errors(error, slope_scale(case, at, expected, slopes))


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
        assert row[0] == pytest.approx(_entry(case, leaf), rel=1e-14, abs=0), leaf
    assert entry["digits"] >= 25
    assert entry["digits_of_derivatives"] >= 25


@every_case
def test_in_bounds(name):
    case, ((A, mu, u), _) = changed(*CASES[name]), computed(name)
    assert 0 <= A <= 1
    assert 0 <= u < 1e3 * h_rms(case) + 1e-300
    assert 0 <= mu * np.sign(case["v"] or 1) < np.inf


@every_case
def test_value(name):
    error = value_errors(name)
    assert (error <= 1e-9).all(), dict(zip(QUANTITIES, error, strict=True))


@every_case
def test_derivatives(name):
    """With respect to every number."""
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


@pytest.mark.parametrize("T", [pytest.param(191.551, marks=pytest.mark.slow), 200.0, 293.15, 1e3])
def test_near_the_pole_of_the_shift(T):
    """Down to 0.001 K above the pole at 191.55 K, where a_T is 1e900000: rubber is glass there."""
    (A, mu, u), slopes = reverse(conditions(changed("sheared", {"temperature": T})))
    assert 0 < A < 1
    assert 0 < u < 5e-3
    assert 0 <= mu < 30
    assert np.isfinite(elements(slopes)).all()
    if T < 250:  # as fast as can be
        fast, _ = reverse(conditions(changed("sheared", {"v": 1e40})))
        np.testing.assert_allclose([A, u], [fast[0], fast[2]], rtol=1e-9)


def test_below_the_pole_of_the_shift():
    """Refused where the temperature is known; saturated, and finite, where it is not."""
    at, v, pressure, _ = conditions(changed("sheared", {}))
    with pytest.raises(ValueError, match="temperature"):
        rf.solve(at, v, pressure, 191.0)
    for T in (191.0, 191.55, 191.549, 0.0, -10.0):
        found, slopes = reverse((at, v, pressure, jnp.asarray(T, float)))
        assert np.isfinite(found).all()
        assert np.isfinite(elements(slopes)).all()


def test_rigid_on_rigid_is_refused():
    with pytest.raises(ValueError, match="deform"):
        scene(changed("one", {"solid1": RIGID}))


# --- Single precision


def rounded(case):
    """Arguments in float32, and the same numbers in float64: rounding them is no error of ours."""
    single = conditions(case, jnp.float32)
    return single, jax.tree.map(lambda x: x.astype(float), single)


# What float32 cannot hold, and what the error says it is.
REFUSED = {
    "two-liquids-two": "E_inf",
    "two-liquids-slabs": "E_inf",
    "two-liquids-at-rest-two": "E_inf",
    "film-incompressible-slabs": "thickness",
    "two-films-incompressible-slabs": "thickness",
    "near-the-pole-sheared": "temperature",
    "cold-sheared": "temperature",
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_in_single_precision(name):
    with pytest.raises(ValueError, match=f"{REFUSED[name]}.*use float64"):
        rf.solve(*rounded(changed(*CASES[name]))[0])


def in_single(ordinary):
    """Every case that float32 can hold, those that are not ordinary marked slow."""
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


def test_single_precision_with_python_scalars():
    """Python numbers do not promote a float32 scene."""
    single = as_arrays(scene(changed("one", {})), jnp.float32)
    for result in three(jax.eval_shape(rf.solve, single, 0.1, 3e5)):
        assert result.dtype == jnp.float32
