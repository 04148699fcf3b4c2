r"""LS-DYNA: *MAT_006, *MAT_076, and *MAT_077_H and *MAT_077_O with Prony terms.

*MAT_VISCOELASTIC (006) has one term, G(t) = G_I + (G_0 - G_I) exp(-beta t), and an elastic bulk modulus.

Fields have 10 characters or are separated by commas. The shift factor has base e,

.. math:: \Phi = \exp\frac{-A (T - T_\mathrm{ref})}{B + T - T_\mathrm{ref}},\qquad A = C_1 \ln 10,\ B = C_2

and is written as a_T, which slows relaxation in the cold. Versions use it differently: check one element at
two temperatures. The hyperelastic constants of *MAT_077 are relaxed, and the Prony terms are added to them.
[Keyword User's Manual II]
"""

import math
import re
from collections.abc import Iterator

import numpy as np

from rubberfric.base.units import young_from_shear
from rubberfric.io.cards.contents import CardMaterial, CardOptions, Cards, CardSeries, glassy_bulk
from rubberfric.io.cards.hyperelastic import ogden_shear
from rubberfric.io.cards.text import comma_numbers, keyword_blocks, need, wide_line, wide_numbers

_GENERAL = "*MAT_GENERAL_VISCOELASTIC"
# Number of cards before the terms, by pattern of the keyword.
_KINDS = {
    r"GENERAL_VISCOELASTIC|0?76": 2,
    r"HYPERELASTIC_RUBBER|0?77_H": 2,
    r"OGDEN_RUBBER|0?77_O": 3,
    r"VISCOELASTIC|0*6(?!\d)": 0,
}
# Place of *MAT_VISCOELASTIC in `_KINDS`.
_ONE_TERM = 3
SIGN = r"^[ \t]*\*MAT_(" + "|".join(_KINDS) + ")"


def read(text: str, options: CardOptions) -> list[CardMaterial]:
    """Return the materials with Prony terms."""
    materials = []
    for keyword, lines in keyword_blocks(text, r"\$"):
        for kind, (pattern, least) in enumerate(_KINDS.items()):
            if not (match := re.match(rf"\*MAT_({pattern})(.*)", keyword.upper())):
                continue
            titled = "_TITLE" in match[2]
            title = [lines[0].strip()] if titled and lines else []
            cards = lines[titled:]
            number = cards[0].split(",")[0][:10].strip() if cards else ""
            if kind in (0, _ONE_TERM) or any(line.strip() for line in cards[least:]):
                names = tuple(name for name in (number, *title) if name)
                materials.append(
                    CardMaterial(
                        names,
                        lambda kind=kind, keyword=keyword, cards=cards, more=match[2]: _cards(
                            kind, keyword, cards, more, options
                        ),
                    )
                )
    return materials


def _cards(kind, keyword, lines, more, options):
    need(
        more.replace("_TITLE", "") == "",
        f"{keyword} is not read: must have no suffix except _TITLE, in fields of 10 characters",
    )
    least = list(_KINDS.values())[kind]
    rows = [
        (comma_numbers(line) + [0.0] * 8)[:8] if "," in line else wide_numbers(line, 8, 10) for line in lines
    ]
    if kind == _ONE_TERM:
        return _one_term([row for row, line in zip(rows, lines, strict=True) if line.strip()])
    name = (_GENERAL, "*MAT_HYPERELASTIC_RUBBER", "*MAT_OGDEN_RUBBER")[kind]
    need(len(rows) > least, f"{name} must have the material card, {least - 1} further cards and the terms")
    if kind == 0:
        return _general(rows, options)
    return _rubber(name, rows, least, ogden=kind == 2)


def _terms(rows, name):
    """Return the relaxed modulus, the weights and the times of rows of G_i and rates."""
    relaxing = [(G, 1 / rate) for G, rate, *_ in rows if rate and G]
    need(relaxing, f"{name} must have at least one term with a rate")
    weights, tau = np.array(relaxing).T
    return sum(G for G, rate, *_ in rows if rate == 0), weights, tau


def _general(rows, options):
    (_, _, bulk, _, elastic, T_ref, A, B), curve, *terms = rows
    need(bulk > 0, f"{_GENERAL}: BULK = {bulk:g}: must be > 0")
    need(not elastic, f"{_GENERAL} has EF = {elastic:g}: must be 0, because the layer would be elastic")
    curves = [number for number in (curve[0], curve[4]) if number]
    need(not curves, f"{_GENERAL} has the curve {curves[:1]} instead of terms: must have terms")
    message = f"TREF = {T_ref:g}, A = {A:g}, B = {B:g}: must be != 0 for a WLF shift"
    shifts = any((T_ref, A, B)) and options.shift
    need(not shifts or all((T_ref, A, B)), f"{message}; shift=False leaves the shift out")
    for place, (_, _, K, *_) in enumerate(terms, start=1):
        need(not K, f"term {place}: KI = {K:g}: must be 0 because the bulk modulus is elastic")
    rest, weights, tau = _terms(terms, _GENERAL)
    wlf = (T_ref, A / math.log(10), B) if shifts else ()
    return Cards(rest, weights, 0 * tau, tau, math.nan, bulk, wlf)


def _one_term(rows):
    name = "*MAT_VISCOELASTIC"
    need(len(rows) == 1, f"{name} has {len(rows)} cards: must have one")
    _, _, bulk, glassy, relaxed, rate, *_ = rows[0]
    need(bulk > 0, f"{name}: BULK = {bulk:g}: must be > 0")
    need(rate > 0, f"{name}: BETA = {rate:g}: must be > 0")
    need(0 <= relaxed < glassy, f"{name}: G0 = {glassy:g}, GI = {relaxed:g}: must be G0 > GI >= 0")
    return Cards(relaxed, np.array([glassy - relaxed]), np.zeros(1), np.array([1 / rate]), math.nan, bulk)


def _rubber(name, rows, least, ogden):
    (_, _, nu, n, _, friction, *_), constants, *_ = rows
    way = "; or convert the material to *MAT_GENERAL_VISCOELASTIC"
    need(not n, f"{name} has N = {n:g}, a fit to test data: must be 0, with the constants{way}")
    need(not friction, f"{name} has G = {friction:g}: must be 0, without frequency independent damping{way}")
    need(0 <= nu <= 0.5, f"{name} has Poisson's ratio PR = {nu:g}: must be 0 ... 0.5{way}")
    for place, row in enumerate(rows[least:], start=1):
        need(not any(row[2:]), f"{name}: term {place} has {row[2:]} beside G and BETA: must be 0{way}")
    shear = ogden_shear(constants, rows[2]) if ogden else 2 * (constants[0] + constants[1])
    need(shear > 0, f"{name}: shear modulus {shear:g} at small strain: must be > 0")
    rest, weights, tau = _terms(rows[least:], name)
    bulk = glassy_bulk(young_from_shear(shear, nu), nu)
    return Cards(shear + rest, weights, 0 * tau, tau, 0.5 if nu == 0.5 else math.nan, bulk)


def write(series: CardSeries) -> Iterator[str]:
    """Yield the lines of the cards."""
    shift = [0.0, 0.0, *series.wlf] if series.wlf else []
    if shift:
        shift[3] *= math.log(10)
    assert series.mass is not None
    yield _GENERAL
    yield "$#     mid        ro      bulk       pcf        ef      tref         a         b"
    yield f"{1:10d}" + wide_line(series.mass, series.bulk, *shift, width=10)
    yield "$#    lcid        nt    bstart     tramp     lcidk       ntk   bstartk    trampk"
    yield f"{0:10d}"
    yield "$#      gi     betai        ki    betaki"
    relaxed = [(series.rest, 0.0)] * (series.rest > 0)
    for weight, rate in relaxed + list(zip(series.g, 1 / series.tau, strict=True)):
        yield wide_line(weight * series.shear, rate, width=10)
