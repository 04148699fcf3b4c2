r"""Prony series in LS-DYNA: MAT_GENERAL_VISCOELASTIC (076), fields of 10 characters or between commas.

Its shift factor of Williams, Landel and Ferry has a base e and an absolute T_REF,

.. math:: \Phi = \exp\frac{-A (T - T_{REF})}{B + T - T_{REF}},\qquad A = C_1 \ln 10,\quad B = C_2

[LS-DYNA Keyword User's Manual II, *MAT_076]. It is written as a_T, which slows relaxation in the cold;
versions differ in how they use it: run one element at two temperatures. Its Arrhenius law is not written.
"""

import math
import re
from collections.abc import Iterator

import numpy as np

from rubberfric.io.prony_cards.series import (
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

MOST_TERMS = 18
_SIGN = r"^\s*\*MAT_(GENERAL_VISCOELASTIC|0?76)"


def read(text: str, units: Units, poisson: float | None, shift: bool) -> Material:
    """The first such material of a keyword file."""
    cards = _cards(text)
    if len(cards) < 3:
        raise ValueError(
            "*MAT_GENERAL_VISCOELASTIC: must have the material card, the curve card and the terms"
        )
    first, curve, *terms = ([number(field) for field in _fields(card)] for card in cards)
    if curve[0]:
        raise ValueError(f"*MAT_GENERAL_VISCOELASTIC: has the curve {curve[0]:g}: must have terms")
    T_ref, A, B = first[5:8]
    if shift and any(first[5:8]) and not all(first[5:8]):
        raise ValueError(
            f"*MAT_GENERAL_VISCOELASTIC: TREF = {T_ref:g}, A = {A:g}, B = {B:g}: must be a WLF shift, none"
            " of them 0; shift=False leaves it out"
        )
    law = WLF(A / math.log(10), B, T_ref + units.zero) if shift and A else None
    rest, weights, tau = 0.0, [], []
    for place, (G, rate, K, _) in enumerate((row[:4] for row in terms), start=1):
        if K:
            raise ValueError(f"term {place}: has KI = {K:g}: must have none, the bulk modulus being elastic")
        if rate == 0:
            rest += G * units.pascal
        elif G:
            weights.append(G * units.pascal)
            tau.append(1 / rate)
    if not weights:
        raise ValueError("*MAT_GENERAL_VISCOELASTIC: has no term with a rate: must have one at least")
    if poisson is None:
        return PronyShear(rest, weights, tau, first[2] * units.pascal, law)
    return relaxing_alike(rest, np.array(weights), np.array(tau), poisson, law)


def write(series: Series, units: Units, mass: float | None, _name: str) -> Iterator[str]:
    """Lines of a keyword file; numbers have 6 digits, which is what 10 characters hold."""
    terms = series.tau.size + (series.rest > 0)
    if terms > MOST_TERMS:
        raise ValueError(
            f"material has {series.tau.size} terms: must be at most {MOST_TERMS} for lsdyna, the relaxed"
            " modulus being one; fit_prony with fewer terms"
        )
    if mass is None:
        raise ValueError("density is missing: must be given for lsdyna [kg/m^3]")
    bulk, shift = elastic_bulk(series, "lsdyna"), ()
    if series.shift is not None:
        T_ref, C1, C2 = series.wlf(units)
        if units.zero:
            raise ValueError("unit_temperature = 'C': must be K for the shift of lsdyna, whose TREF is > 0")
        shift = (0.0, 0.0, T_ref, C1 * math.log(10), C2)
    yield "*MAT_GENERAL_VISCOELASTIC"
    yield "$#     mid        ro      bulk       pcf        ef      tref         a         b"
    yield f"{1:10d}" + _line(mass, bulk / units.pascal, *shift)
    yield "$#    lcid        nt    bstart     tramp     lcidk       ntk   bstartk    trampk"
    yield f"{0:10d}"
    yield "$#      gi     betai        ki    betaki"
    rows = [(series.rest, 0.0)] * (series.rest > 0) + list(zip(series.g, 1 / series.tau, strict=True))
    for weight, rate in rows:
        yield _line(weight * series.shear / units.pascal, rate)


LSDYNA = Format(_SIGN, True, "$", read, write)


def _cards(text: str) -> list[str]:
    """The cards below the keyword, without comments."""
    lines = iter([line for line in text.splitlines() if not line.startswith("$")])
    for line in lines:
        if re.match(_SIGN, line, re.I):
            if "_TITLE" in line.upper():
                next(lines)
            break
    cards = []
    for line in lines:
        if line.startswith("*"):
            break
        cards.append(line)
    return cards


def _fields(card: str) -> list[str]:
    """Eight fields of a card: between commas, or 10 characters each."""
    if "," in card:
        fields = [field.strip() for field in card.split(",")]
    else:
        fields = [card[i : i + 10].strip() for i in range(0, 80, 10)]
    return (fields + [""] * 8)[:8]


def _line(*values: float) -> str:
    return "".join(f"{text_of(value, 10):>10}" for value in values)
