"""Errors of extreme scenes against their references, in float64 and float32."""

import dataclasses
import functools
import json

import jax
import jax.numpy as jnp
import numpy as np
from support.cases.extremes import CASES, changed
from support.cases.stored import (
    FOLDER,
    QUANTITIES,
    arguments,
    as_arrays,
    elements,
    h_rms,
    names_of,
    reverse,
    three,
    with_jacobian,
)

import rubberfric as rf

REFERENCES = json.loads((FOLDER / "extremes.json").read_text())
# For gamma = 0, S P falls like (q/q0 - 1)^(-3/4) at light load instead of ^(-1/2): the
# default is 4e-8 off there, and needs more graded panels.
FINER = {"gamma-0-light-corrected": rf.Quadrature(graded=16)}


def conditions(case, dtype=float):
    """Arguments of `rf.solve` for a case, its contact shear included."""
    at, *rest = arguments(case, dtype)
    if "shear" in case:
        law = {key: x for key, x in case["shear"]["shift"].items() if key != "kind"}
        shear = rf.ContactShear(**case["shear"] | {"shift": rf.WLF(**law)})
        at = dataclasses.replace(at, shear=as_arrays(shear, dtype))
    return (at, *rest)


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

    return with_jacobian(quantities)


def value_floor(case, dtype=float):
    """Values of area, friction and separation below which errors are absolute."""
    # Zero weights stand for 1e-30 of the stiffness (float32: 1e-16), which may relax; a separation
    # in full contact is 1e-100 of the roughness.
    weights = np.concatenate([np.ravel(case[solid].get("E", 1.0)) for solid in ("solid1", "solid2")])
    least = 1e-12 if dtype == jnp.float32 and not weights.all() else 1e-18
    return np.array([0.0, least, 1e-6 * h_rms(case)])


def slope_scale(case, names, expected, slopes):
    """Return the scale of errors of derivatives, shape (leaf element, quantity).

    It is the size of the derivative or, if larger, 1e-3 of the quantity or of the largest sensitivity,
    divided by the parameter.
    """
    theta = np.array([entry_of(case, name) for name in names])
    unit = np.array([_unit(case, name) for name in names])
    most = np.maximum(np.abs(expected), np.max(np.abs(theta[:, None] * slopes), 0))
    floor = np.maximum(1e-3 * most, value_floor(case))
    return np.maximum(np.abs(slopes), floor / unit[:, None])


def entry_of(case, name):
    """The number of a case that a name says."""
    for key in name.split("."):
        case = case[int(key) if key.isdigit() else key]
    return case


def _unit(case, name):
    """A parameter, or if it is 0 a change of it that matters."""
    theta = entry_of(case, name)
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


def rounded(case):
    """Return arguments in float32 and the same numbers in float64, so that rounding is not counted."""
    single = conditions(case, jnp.float32)
    return single, jax.tree.map(lambda x: x.astype(float), single)


# Scenes beyond float32, and words of the message.
REFUSED = {
    "two-liquids-two": "E_inf",
    "two-liquids-slabs": "E_inf",
    "two-liquids-at-rest-two": "E_inf",
    "film-incompressible-slabs": "thickness",
    "two-films-incompressible-slabs": "thickness",
    "near-the-pole-sheared": "temperature",
    "cold-sheared": "temperature",
}
