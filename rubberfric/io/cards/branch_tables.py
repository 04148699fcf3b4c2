"""Tables with a row for each term: COMSOL and pyvisco.

COMSOL: table of branches for Viscoelasticity, Generalized Maxwell, with constants in comments [Structural
Mechanics Module User's Guide, Viscoelasticity, "Load from file"]. pyvisco: a CSV table of Young's modulus or
a shear modulus.
"""

import math
import re
from collections.abc import Iterator

import numpy as np

from rubberfric.base.units import ZERO_CELSIUS, shear_from_young
from rubberfric.io.cards.contents import CardMaterial, CardOptions, Cards, CardSeries, Elastic, relative
from rubberfric.io.cards.text import STRESS, format_number, need, parse_number

COMSOL = "^% COMSOL, Linear Elastic"
PYVISCO = r"\btau_i\b"


def read_comsol(text: str, options: CardOptions) -> list[CardMaterial]:
    """Return the material of a table."""
    return [CardMaterial((), lambda: _comsol(text, options))]


def _comsol(text, options):
    lines = re.findall(r"^% (\w+) = (\S+) (\S+)", text, re.M)
    constants = {name: (parse_number(value), unit) for name, value, unit in lines}
    rows = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("%")]
    complete = rows and all(len(row) == 3 for row in rows)
    need(complete, "rows must have a branch, a shear modulus and a relaxation time")
    _, weights, tau = np.array([[parse_number(field) for field in row] for row in rows]).T
    for name in ("G", "K"):
        message = f"comment '% {name} = ... Pa' is missing: must be given; the table has no {name}"
        need(constants.get(name, (0.0, ""))[1] in STRESS, message)
    scale = STRESS[options.stress or "Pa"]
    rest, bulk = (constants[name][0] * STRESS[constants[name][1]] / scale for name in ("G", "K"))
    wlf = ()
    if options.shift and "C1" in constants:
        missing = [name for name in ("Tref", "C2") if name not in constants]
        need(not missing, f"comment '% {missing[:1]} = ...' is missing: must be given with C1")
        T_ref, unit = constants["Tref"]
        zero = ZERO_CELSIUS if unit == "degC" else 0.0
        wlf = (T_ref + zero - options.zero, constants["C1"][0], constants["C2"][0])
    return Cards(rest, weights, 0 * tau, tau, math.nan, bulk, wlf)


def write_comsol(series: CardSeries) -> Iterator[str]:
    """Yield the lines of the table."""
    unit = series.options.stress or "Pa"
    yield "% COMSOL, Linear Elastic Material with the moduli G and K, below it Viscoelasticity,"
    yield "% Generalized Maxwell, Load from file: branch, shear modulus, relaxation time"
    yield f"% G = {format_number(series.rest * series.shear)} {unit} (relaxed)"
    yield f"% K = {format_number(series.bulk)} {unit}"
    if series.mass is not None:
        yield f"% rho = {format_number(series.mass * STRESS[unit] ** 2)} kg/m^3"
    if series.wlf:
        T_ref, C1, C2 = map(format_number, series.wlf)
        yield f"% Tref = {T_ref} {'degC' if series.options.zero else 'K'} (Williams-Landel-Ferry)"
        yield from (f"% C1 = {C1} 1", f"% C2 = {C2} K")
    for branch, (G, tau) in enumerate(zip(series.g * series.shear, series.tau, strict=True), start=1):
        yield f"{branch} {format_number(G)} {format_number(tau)}"


def read_pyvisco(text: str, options: CardOptions) -> list[CardMaterial]:
    """Return the material of a table."""
    return [CardMaterial((), lambda: _pyvisco(text, options))]


def _pyvisco(text, options):
    lines = [[field.strip() for field in line.split(",")] for line in text.splitlines() if line.strip()]
    need(len(lines) > 2, "the table must have a line of names, a line of units and rows of numbers")
    names, units, *rows = lines
    letter = next((name[0] for name in names if name in ("E_0", "G_0")), "")
    message = f"columns {', '.join(names)}: must have tau_i, alpha_i and E_0 or G_0"
    need(letter and "tau_i" in names and "alpha_i" in names, message)
    message = "G_0 is a shear modulus: poisson must be given, E = 2 (1 + poisson) G"
    need(letter == "E" or options.poisson is not None, message)
    for place, row in enumerate(rows, start=1):
        need(len(row) == len(names), f"row {place} has {len(row)} fields: must have {len(names)}")
    need(len(units) == len(names), f"the line of units has {len(units)} fields: must have {len(names)}")
    unit = units[names.index(f"{letter}_0")]
    message = f"column {letter}_0: unit {unit!r}: must be {options.stress or ', '.join(STRESS)}"
    need(unit in STRESS and options.stress in (None, unit), message)
    unit_of_time = units[names.index("tau_i")]
    need(unit_of_time == "s", f"column tau_i: unit {unit_of_time!r}: must be s")
    places = [names.index(name) for name in ("tau_i", "alpha_i", f"{letter}_0")]
    tau, g, moduli = np.array([[parse_number(row[i]) for i in places] for row in rows]).T
    equal = np.allclose(moduli, moduli[0], rtol=1e-6)
    need(equal, f"column {letter}_0: {moduli.min():g} to {moduli.max():g}: must be equal in all rows")
    nu = 0.5 if options.poisson is None else options.poisson
    modulus = float(moduli[0]) * STRESS[unit] / STRESS[options.stress or "Pa"]
    shear = shear_from_young(modulus, nu) if letter == "E" else modulus
    return relative([Elastic(shear, nu)], g, g, tau)


def write_pyvisco(series: CardSeries) -> Iterator[str]:
    """Yield the lines of the table."""
    yield "i,tau_i,alpha_i,E_0,E_i"
    yield f"-,s,-,{series.options.stress},{series.options.stress}"
    for i, (g, tau) in enumerate(zip(series.g.tolist(), series.tau.tolist(), strict=True), start=1):
        yield f"{i},{tau!r},{g!r},{series.young!r},{g * series.young!r}"
