r"""Material cards of Prony series: a reader and a writer for each program.

Cards hold the glassy moduli, relative weights and relaxation times,

.. math:: G(t) = G_0 \Big[1 - \sum_i g_i (1 - e^{-t/\tau_i})\Big],\qquad
          B(t) = B_0 \Big[1 - \sum_i k_i (1 - e^{-t/\tau_i})\Big]

as *VISCOELASTIC, TIME=PRONY of Abaqus defines them. COMSOL, LS-DYNA and OpenRadioss hold the shear moduli
G_0 g_i. A constant Poisson's ratio means k_i = g_i, and an elastic bulk modulus means k_i = 0.
"""

import math
import re
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from rubberfric.base.units import ZERO_CELSIUS, bulk_from_young, shear_from_young, young_from_shear
from rubberfric.io.card_text import (
    STRESS,
    comma_line,
    comma_numbers,
    format_number,
    keyword_blocks,
    need,
    parse_number,
    wide_line,
    wide_numbers,
)


class CardOptions(NamedTuple):
    """Units of a file, and options for reading the file."""

    stress: str | None  # unit; None: named in the file
    zero: float  # zero of the temperature scale [K]
    poisson: float | None = None
    shift: bool = True  # read the shift


class Cards(NamedTuple):
    """Contents of cards, in the units of the file."""

    rest: float  # relaxed shear modulus
    moduli: np.ndarray  # shear moduli of the terms, shape (n,)
    k: np.ndarray  # relative weights of the bulk modulus [-], shape (n,)
    tau: np.ndarray  # relaxation times [s], shape (n,)
    poisson: float  # nan where the cards have a bulk modulus instead
    bulk: float  # bulk modulus, if k = 0
    wlf: tuple[float, ...] = ()  # reference temperature, C1 and C2; (): no shift


class CardSeries(NamedTuple):
    """A material to be written, in the units of the file."""

    young: float  # glassy Young's modulus
    poisson: float  # glassy Poisson's ratio [-]
    bulk: float  # glassy bulk modulus; inf for poisson = 0.5
    g: np.ndarray  # relative weights of the shear modulus [-], shape (n,)
    k: np.ndarray  # relative weights of the bulk modulus [-], shape (n,)
    tau: np.ndarray  # relaxation times [s], shape (n,)
    rest: float  # relaxed / glassy shear modulus [-]; exact where 1 - sum(g) cancels
    shear: float  # glassy shear modulus
    wlf: tuple[float, ...]  # reference temperature, C1 and C2; (): no shift
    options: CardOptions
    mass: float | None  # density
    name: str  # of the material


class CardFormat(NamedTuple):
    """Format of the cards of one program."""

    sign: str  # regular expression that identifies them
    comment: str  # beginning of a comment line; "": none
    has_shift: bool  # whether they can hold a WLF shift
    read: Callable[[str, CardOptions], Cards]
    write: Callable[[CardSeries], Iterator[str]]  # lines


def glassy_bulk(young: float, poisson: float) -> float:
    """Return the bulk modulus for Young's modulus and Poisson's ratio; inf for an incompressible solid."""
    return float(bulk_from_young(young, poisson)) if poisson < 0.5 else math.inf


def _relative(young, nu, g, k, tau, wlf=(), long_term=False) -> Cards:
    """Convert cards with relative weights and the glassy or, if `long_term`, the relaxed Young's modulus."""
    total = float(np.sum(g))
    need(total <= 1 + 1e-12, f"the weights of the shear modulus add up to {total:g}: must be at most 1")
    rest = max(1 - total, 0.0)
    message = "MODULI=LONG TERM with weights that add up to 1: must add up to less than 1"
    need(rest > 0 or not long_term, message)
    shear = shear_from_young(young, nu)
    glassy, relaxed = (shear / rest, shear) if long_term else (shear, shear * rest)
    return Cards(relaxed, glassy * g, k, tau, nu, glassy_bulk(young, nu), wlf)


# --- Abaqus


def _read_abaqus(text: str, options: CardOptions) -> Cards:
    """Read the first material that has the keyword *VISCOELASTIC."""
    found: dict[str, tuple[str, list[str]]] = {}
    for line, data in keyword_blocks(text, r"\s*(\*\*|$)"):
        keyword = line.partition(",")[0].strip().upper()
        if keyword == "*MATERIAL":
            if "*VISCOELASTIC" in found:
                break
            found = {}
        if not found.get(keyword, ("", []))[1]:
            found[keyword] = line.upper(), data

    needed = ("*ELASTIC", "*VISCOELASTIC", *["*TRS"] * (options.shift and "*TRS" in found))
    for keyword in needed:
        need(found.get(keyword, ("", []))[1], f"{keyword} with data is missing: must be given")
    (elastic, moduli), (viscoelastic, terms), *trs = (found[keyword] for keyword in needed)
    need("PRONY" in viscoelastic, f"{viscoelastic}: must be TIME=PRONY")
    for line, _ in trs:
        message = f"{line}: must be DEFINITION=WLF; shift=False leaves the shift out"
        need("DEFINITION" not in line or "WLF" in line, message)
    young, nu = [*comma_numbers(moduli[0]), 0.0][:2]
    g, k, tau = np.array([[*comma_numbers(line), 0.0, 0.0][:3] for line in terms]).T
    wlf = tuple(comma_numbers(trs[0][1][0])) if trs else ()
    return _relative(young, nu, g, k, tau, wlf, "INSTANTANEOUS" not in elastic)  # the program's default


def _write_abaqus(series: CardSeries) -> Iterator[str]:
    yield f"*MATERIAL, NAME={series.name}"
    if series.mass is not None:
        yield from ("*DENSITY", f"{format_number(series.mass)},")
    yield from ("*ELASTIC, MODULI=INSTANTANEOUS", comma_line(series.young, series.poisson))
    yield "*VISCOELASTIC, TIME=PRONY"
    for row in zip(series.g, series.k, series.tau, strict=True):
        yield comma_line(*row)
    if series.wlf:
        yield from ("*TRS, DEFINITION=WLF", comma_line(*series.wlf))


# --- ANSYS: MP,EX and MP,PRXY, TB,PRONY for shear and bulk, TB,SHIFT


def _read_ansys(text: str, options: CardOptions) -> Cards:
    constants, tables = _ansys_commands(text)
    for name in ("EX", "PRXY"):
        need(name in constants, f"MP,{name} is missing: must be given")
    (g, tau), (k, bulk_tau) = (_ansys_pairs(tables, what) for what in ("SHEAR", "BULK"))
    need(g.size, "TB,PRONY,...,SHEAR with TBDATA is missing: must be given")
    equal = not k.size or (k.shape == g.shape and np.allclose(bulk_tau, tau, rtol=1e-9))
    need(equal, "TB,PRONY,...,BULK has other times than SHEAR; the times must be equal")
    wlf = ()
    if shifts := [name for name in tables if options.shift and name.startswith("SHIFT,")]:
        need(shifts[0] == "SHIFT,WLF", f"TB,{shifts[0]}: must be WLF; shift=False leaves the shift out")
        wlf = tuple(tables["SHIFT,WLF"][i] for i in (1, 2, 3))
    return _relative(constants["EX"], constants["PRXY"], g, k if k.size else 0 * g, tau, wlf)


def _ansys_commands(text: str) -> tuple[dict[str, float], dict[str, dict[int, float]]]:
    """Return the constants of MP commands by label, and of TB commands by "LABEL,OPTION" and number."""
    constants, tables, current = {}, {}, None
    for line in text.splitlines():
        command, *fields = (field.strip() for field in line.split("!")[0].split(","))
        if command.upper() == "MP" and len(fields) > 2:
            constants.setdefault(fields[0].upper(), parse_number(fields[2]))
        elif command.upper() == "TB":
            current = tables.setdefault(f"{fields[0]},{''.join(fields[4:5])}".upper(), {})
        elif command.upper() == "TBDATA" and current is not None:
            start = int(parse_number(fields[0])) if fields[0] else max(current, default=0) + 1
            values = filter(None, fields[1:])
            current |= {start + i: parse_number(field) for i, field in enumerate(values)}
    if "NUXY" in constants:
        constants.setdefault("PRXY", constants["NUXY"])
    return constants, tables


def _ansys_pairs(tables: dict[str, dict[int, float]], what: str) -> np.ndarray:
    """Return the weights and times of a Prony table as an array of shape (2, n)."""
    table = tables.get(f"PRONY,{what}", {})
    constants = sorted(table)
    message = f"TB,PRONY,...,{what} has the constants {constants}: must be pairs of weight and time"
    need(len(table) % 2 == 0 and constants == list(range(1, len(table) + 1)), message)
    return np.array([table[i] for i in constants]).reshape(-1, 2).T


def _write_ansys(series: CardSeries) -> Iterator[str]:
    yield from (f"MP,EX,1,{series.young!r}", f"MP,PRXY,1,{series.poisson!r}")
    if series.mass is not None:
        yield f"MP,DENS,1,{series.mass!r}"
    for what, weights in (("SHEAR", series.g), ("BULK", series.k)):
        if weights.any():
            yield f"TB,PRONY,1,1,{series.tau.size},{what}"
            values = np.stack([weights, series.tau], 1).ravel().tolist()
            for i in range(0, len(values), 6):
                yield f"TBDATA,{i + 1}," + ",".join(map(repr, values[i : i + 6]))
    if series.wlf:
        yield from ("TB,SHIFT,1,1,3,WLF", "TBDATA,1," + ",".join(map(repr, series.wlf)))


# --- COMSOL: table of branches for Viscoelasticity, Generalized Maxwell, with constants in comments
# [Structural Mechanics Module User's Guide, Viscoelasticity, "Load from file"]


def _read_comsol(text: str, options: CardOptions) -> Cards:
    found = re.findall(r"^% (\w+) = (\S+) (\S+)", text, re.M)
    constants = {name: (parse_number(value), unit) for name, value, unit in found}
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
        T_ref, unit = constants["Tref"]
        zero = ZERO_CELSIUS if unit == "degC" else 0.0
        wlf = (T_ref + zero - options.zero, constants["C1"][0], constants["C2"][0])
    return Cards(rest, weights, 0 * tau, tau, math.nan, bulk, wlf)


def _write_comsol(series: CardSeries) -> Iterator[str]:
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


# --- LS-DYNA: *MAT_076, fields of 10 characters or between commas. The shift factor has base e,
# Phi = exp(-A (T - TREF) / (B + T - TREF)), A = C1 ln 10, B = C2 [Keyword User's Manual II, *MAT_076], and is
# written as a_T, which slows relaxation in the cold. Versions use it differently: check one element at two
# temperatures.

_MAT_076 = r"\s*\*MAT_(GENERAL_VISCOELASTIC|0?76)"


def _read_lsdyna(text: str, options: CardOptions) -> Cards:
    blocks = [block for block in keyword_blocks(text, r"\$") if re.match(_MAT_076, block[0], re.I)]
    keyword, cards = blocks[0] if blocks else ("", [])
    cards = [
        comma_numbers(card) + [0.0] * 8 if "," in card else wide_numbers(card, 8, 10)
        for card in cards["_TITLE" in keyword.upper() :]
    ]
    material = "*MAT_GENERAL_VISCOELASTIC"
    need(len(cards) >= 3, f"{material} must have the material card, the curve card and the terms")
    (_, _, bulk, _, _, T_ref, A, B, *_), curve, *terms = cards
    need(not curve[0], f"{material} has the curve {curve[0]:g} instead of terms: must have terms")
    message = f"TREF = {T_ref:g}, A = {A:g}, B = {B:g}: must be != 0 for a WLF shift"
    shifts = any((T_ref, A, B)) and options.shift
    need(not shifts or all((T_ref, A, B)), f"{message}; shift=False leaves the shift out")
    for place, (_, _, K, *_) in enumerate(terms, start=1):
        need(not K, f"term {place}: KI = {K:g}: must be 0 because the bulk modulus is elastic")
    relaxing = [(G, 1 / rate) for G, rate, *_ in terms if rate and G]
    need(relaxing, f"{material} must have at least one term with a rate")
    weights, tau = np.array(relaxing).T
    rest = sum(G for G, rate, *_ in terms if rate == 0)
    wlf = (T_ref, A / math.log(10), B) if options.shift and A else ()
    return Cards(rest, weights, 0 * tau, tau, math.nan, bulk, wlf)


def _write_lsdyna(series: CardSeries) -> Iterator[str]:
    shift = [0.0, 0.0, *series.wlf] if series.wlf else []
    if shift:
        shift[3] *= math.log(10)
    assert series.mass is not None
    yield "*MAT_GENERAL_VISCOELASTIC"
    yield "$#     mid        ro      bulk       pcf        ef      tref         a         b"
    yield f"{1:10d}" + wide_line(series.mass, series.bulk, *shift, width=10)
    yield "$#    lcid        nt    bstart     tramp     lcidk       ntk   bstartk    trampk"
    yield f"{0:10d}"
    yield "$#      gi     betai        ki    betaki"
    relaxed = [(series.rest, 0.0)] * (series.rest > 0)
    for weight, rate in relaxed + list(zip(series.g, 1 / series.tau, strict=True)):
        yield wide_line(weight * series.shear, rate, width=10)


# --- OpenRadioss: /MAT/LAW42 with one term, alpha = 2, is neo-Hookean with the relaxed shear modulus mu and
# the bulk modulus of nu. /VISC/PRONY adds G_i exp(-beta_i t) and K_i exp(-beta_k t). [Reference Guide]


def _read_openradioss(text: str, options: CardOptions) -> Cards:
    blocks, found = keyword_blocks(text, "[#$]", "/"), []
    kinds = ("/MAT/LAW42", "/MAT/(LAW42|OGDEN)/", 6), ("/VISC/PRONY", "/VISC/PRONY/", 1)
    for name, pattern, least in kinds:
        cards = [data for line, data in blocks if re.match(pattern, line, re.I) and len(data) >= least]
        need(cards, f"{name} is missing or incomplete: must be given")
        found.append(cards[0])
    (_, _, nu, mu, _, alpha, *_), (count, *terms) = found
    (nu,), (mu, *others), (alpha,) = wide_numbers(nu, 1), wide_numbers(mu, 5), wide_numbers(alpha, 1)
    message = "/MAT/LAW42 must have one term with alpha = 2, so that strain leaves the modulus unchanged"
    need(alpha == 2 and not any(others), message)
    rows = [wide_numbers(card, 4) for card in terms if card.strip()]
    message = f"/VISC/PRONY has {len(rows)} terms, but its first card states {count[:10].strip()}"
    need(rows and len(rows) == int(count[:10]), f"{message}: the numbers must agree and be at least 1")
    G, beta, K, beta_k = np.array(rows).T
    agree = options.poisson is not None or not K.any() or np.array_equal(beta, beta_k)
    need(agree, "/VISC/PRONY: beta_k must equal beta_i; poisson=... reads the shear series only")
    bulk = glassy_bulk(young_from_shear(mu, nu), nu)
    return Cards(mu, G, K / (bulk + K.sum()), 1 / beta, nu, bulk)


def _write_openradioss(series: CardSeries) -> Iterator[str]:
    G, K = series.rest * series.shear, series.bulk * (series.rest if series.k.any() else 1.0)
    nu = (3 * K - 2 * G) / (2 * (3 * K + G))
    assert series.mass is not None
    yield from ("/MAT/LAW42/1", series.name, "#              RHO_I", wide_line(series.mass))
    yield "#                 Nu           sigma_cut          funIDbulk         Fscale_bulk         M    I_f"
    yield wide_line(nu, 0.0) + " " * 10 + f"{0:10d}" + wide_line(0.0) + f"{0:10d}{0:10d}"
    for name, value in (("mu", G), ("alpha", 2.0)):
        yield "#" + "".join(f"{f'{name}_{i}':>20}" for i in range(1, 6))[1:]
        yield from (wide_line(value, 0.0, 0.0, 0.0, 0.0), "")
    yield "/VISC/PRONY/1"
    yield "#        M                           K_v      Itab    Ishape"
    yield f"{series.tau.size:10d}" + " " * 10 + wide_line(0.0) + f"{0:10d}{0:10d}"
    yield "#                G_i              beta_i                 K_i              beta_k"
    for g, k, tau in zip(series.g, series.k, series.tau, strict=True):
        yield wide_line(g * series.shear, 1 / tau, k * series.bulk if k else 0.0, 1 / tau if k else 0.0)


# --- pyvisco: a CSV table with a row for each term, of Young's modulus or a shear modulus


def _read_pyvisco(text: str, options: CardOptions) -> Cards:
    names, units, *rows = (
        [field.strip() for field in line.split(",")] for line in text.splitlines() if line.strip()
    )
    letter = next((name[0] for name in names if name in ("E_0", "G_0")), "")
    message = f"columns {', '.join(names)}: must have tau_i, alpha_i and E_0 or G_0"
    need(letter and "tau_i" in names and "alpha_i" in names, message)
    message = "G_0 is a shear modulus: poisson must be given, E = 2 (1 + poisson) G"
    need(letter == "E" or options.poisson is not None, message)
    unit = units[names.index(f"{letter}_0")]
    message = f"column {letter}_0: unit {unit!r}: must be {options.stress or ', '.join(STRESS)}"
    need(unit in STRESS and options.stress in (None, unit), message)
    places = [names.index(name) for name in ("tau_i", "alpha_i", f"{letter}_0")]
    tau, g, moduli = np.array([[parse_number(row[i]) for i in places] for row in rows]).T
    nu = 0.5 if options.poisson is None else options.poisson
    modulus = float(moduli[0]) * STRESS[unit] / STRESS[options.stress or "Pa"]
    return _relative(modulus if letter == "E" else young_from_shear(modulus, nu), nu, g, g, tau)


def _write_pyvisco(series: CardSeries) -> Iterator[str]:
    yield "i,tau_i,alpha_i,E_0,E_i"
    yield f"-,s,-,{series.options.stress},{series.options.stress}"
    for i, (g, tau) in enumerate(zip(series.g.tolist(), series.tau.tolist(), strict=True), start=1):
        yield f"{i},{tau!r},{g!r},{series.young!r},{g * series.young!r}"


FORMATS = {
    "abaqus": CardFormat(r"^\s*\*VISCOELASTIC", "**", True, _read_abaqus, _write_abaqus),
    "ansys": CardFormat(r"^\s*TB\s*,\s*PRONY", "!", True, _read_ansys, _write_ansys),
    "comsol": CardFormat("^% COMSOL, Linear Elastic", "%", True, _read_comsol, _write_comsol),
    "lsdyna": CardFormat("^" + _MAT_076, "$", True, _read_lsdyna, _write_lsdyna),
    "openradioss": CardFormat("^/VISC/PRONY/", "#", False, _read_openradioss, _write_openradioss),
    "pyvisco": CardFormat(r"\btau_i\b", "", False, _read_pyvisco, _write_pyvisco),
}
