"""Prony series for COMSOL: the table that Viscoelasticity, Generalized Maxwell loads from a file.

Three columns, separated by blanks: branch, shear modulus, relaxation time. What else the model asks for
stands in comments above: relaxed shear modulus and bulk modulus of the Linear Elastic Material, and the WLF
constants, log10 a_T = -C1 (T - Tref) / (C2 + T - Tref), in K.
[COMSOL Structural Mechanics Module User's Guide, Viscoelasticity, "Load from file"]
"""

import re
from collections.abc import Iterator

import numpy as np

from rubberfric.base.units import ZERO_CELSIUS
from rubberfric.io.prony_cards.series import (
    STRESS,
    Format,
    Material,
    Series,
    Units,
    elastic_bulk,
    number,
    relaxing_alike,
    text_of,
)
from rubberfric.materials.prony import PronyShear
from rubberfric.materials.shifts.laws import WLF

_CONSTANT = re.compile(r"^% (\w+) = (\S+) (\S+)", re.M)


def read(text: str, units: Units, poisson: float | None, shift: bool) -> Material:
    """The material of a table and the comments above it."""
    constants = {name: (number(value), unit) for name, value, unit in _CONSTANT.findall(text)}
    rows = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("%")]
    if not all(len(row) == 3 for row in rows) or not rows:
        raise ValueError("has no rows of branch, shear modulus and relaxation time: must have")
    _, weights, tau = np.array([[number(field) for field in row] for row in rows]).T
    weights = weights * units.pascal
    law = None
    if shift and "C1" in constants:
        offset = ZERO_CELSIUS if constants["Tref"][1] == "degC" else 0.0
        law = WLF(constants["C1"][0], constants["C2"][0], constants["Tref"][0] + offset)
    rest, bulk = (_pascal(constants, name) for name in "GK")
    if poisson is None:
        return PronyShear(rest, weights, tau, bulk, law)
    return relaxing_alike(rest, weights, tau, poisson, law)


def write(series: Series, units: Units, mass: float | None, _name: str) -> Iterator[str]:
    """Lines of the file."""
    bulk = elastic_bulk(series, "comsol")
    yield "% COMSOL, Linear Elastic Material with the moduli G and K, below it Viscoelasticity,"
    yield "% Generalized Maxwell, Load from file: branch, shear modulus, relaxation time"
    yield f"% G = {text_of(series.rest * series.shear / units.pascal)} {units.stress} (relaxed)"
    yield f"% K = {text_of(bulk / units.pascal)} {units.stress}"
    if mass is not None:
        yield f"% rho = {text_of(mass * units.pascal**2)} kg/m^3"
    if series.shift is not None:
        T_ref, C1, C2 = series.wlf(units)
        yield f"% Tref = {text_of(T_ref)} {'degC' if units.zero else 'K'} (Williams-Landel-Ferry)"
        yield f"% C1 = {text_of(C1)} 1"
        yield f"% C2 = {text_of(C2)} K"
    for branch, (g, tau) in enumerate(zip(series.g, series.tau, strict=True), start=1):
        yield f"{branch} {text_of(g * series.shear / units.pascal)} {text_of(tau)}"


COMSOL = Format(r"^% COMSOL, Linear Elastic", True, "%", read, write)


def _pascal(constants: dict[str, tuple[float, str]], name: str) -> float:
    """A modulus of the comments [Pa]."""
    if name not in constants or constants[name][1] not in STRESS:
        raise ValueError(f"has no comment '% {name} = ... Pa': must be there, the table has no such column")
    value, unit = constants[name]
    return value * STRESS[unit]
