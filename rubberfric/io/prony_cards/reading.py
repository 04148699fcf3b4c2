"""Prony series from the material cards of `rubberfric.io.prony_cards.writing`, as these programs' users have them."""

import re

import numpy as np

from rubberfric.base.checks import closest, shown
from rubberfric.base.units import bulk_from_young, shear_from_young, young_from_shear
from rubberfric.io.prony_cards.writing import PROGRAMS, STRESS, TEMPERATURE
from rubberfric.io.tables import read_text
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.materials.shifts import WLF

_SIGNS = {
    "abaqus": r"^\s*\*VISCOELASTIC",
    "ansys": r"^\s*TB\s*,\s*PRONY",
    "lsdyna": r"^\s*\*MAT_(GENERAL_VISCOELASTIC|0?76)",
    "pyvisco": r"\btau_i\b",
}


def read_prony(path, program=None, *, unit_stress=None, unit_temperature="K", poisson=None, shift=True):
    """The Prony series in a file of material cards; of several materials the first.

    Parameters
    ----------
    path : file
    program : "abaqus", "ansys", "lsdyna" or "pyvisco"; None: as the file looks
    unit_stress : "Pa", "kPa", "MPa" or "GPa"; must be given but for pyvisco, whose file says it
    unit_temperature : "K" or "C", of a WLF shift
    poisson : Poisson's ratio [-], or None
        a constant one for the shear series of the cards, whatever they say of the bulk modulus; needed for
        pyvisco: of Young's modulus it says none (0.5 if None), for a shear modulus it must be given.
    shift : bool; False leaves the shift out

    Returns
    -------
    Prony where shear and bulk modulus relax alike, poisson is given or Poisson's ratio is 0.5;
    PronyShear where the bulk modulus is elastic.

    Raises
    ------
    ValueError
        one line naming the file and what is missing or wrong: no such cards, no units, bulk terms of
        their own, weights that add up to more than 1, a shift other than WLF.
    """
    text = read_text(path)
    try:
        if program is None:
            found = [name for name, sign in _SIGNS.items() if re.search(sign, text, re.I | re.M)]
            if not found:
                raise ValueError(
                    "has no Prony series: must be cards of abaqus, ansys or lsdyna, or a pyvisco table"
                )
            program = found[0]
        elif not isinstance(program, str) or program not in PROGRAMS:
            raise ValueError(f"program = {shown(program)}: {closest(program, PROGRAMS)}")
        if unit_stress is not None and (not isinstance(unit_stress, str) or unit_stress not in STRESS):
            raise ValueError(f"unit_stress = {shown(unit_stress)}: {closest(unit_stress, tuple(STRESS))}")
        if not isinstance(unit_temperature, str) or unit_temperature not in TEMPERATURE:
            near = closest(unit_temperature, tuple(TEMPERATURE))
            raise ValueError(f"unit_temperature = {shown(unit_temperature)}: {near}")
        if program == "pyvisco":
            return _pyvisco(text, unit_stress, poisson)
        if unit_stress is None:
            raise ValueError("unit_stress is missing: must be given, cards do not say it; Pa, MPa, ...")
        reader = {"abaqus": _abaqus, "ansys": _ansys, "lsdyna": _lsdyna}[program]
        return reader(text, STRESS[unit_stress], TEMPERATURE[unit_temperature], poisson, shift)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _material(rest, weights, tau, bulk, poisson, shift):
    """The material of shear moduli [Pa]; `bulk` None: it relaxes alike, at Poisson's ratio `poisson`."""
    if bulk is None:
        E_inf, E = (float(young_from_shear(rest, poisson)), young_from_shear(np.asarray(weights), poisson))
        return Prony(E_inf, E, tau, poisson, shift)
    return PronyShear(float(rest), np.asarray(weights), tau, float(bulk), shift)


def _relative(modulus, nu, long_term, g, k, tau, poisson, shift):
    """The material of a Young's modulus [Pa] and relative weights."""
    total = float(np.sum(g))
    if total > 1 + 1e-12:
        raise ValueError(f"the weights of the shear modulus add up to {total:g}: must be at most 1")
    rest = max(1 - total, 0.0)
    if long_term and not rest > 0:
        raise ValueError("MODULI=LONG TERM with weights that add up to 1: must add up to less")
    if poisson is None and not np.any(k) and nu < 0.5:
        bulk = bulk_from_young(modulus, nu)
    elif poisson is not None or nu == 0.5 or np.allclose(k, g, rtol=1e-6, atol=0):
        bulk = None
    else:
        i = int(np.argmax(~np.isclose(k, g, rtol=1e-6, atol=0)))
        raise ValueError(
            f"term {i + 1}: weight {k[i]:g} of the bulk and {g[i]:g} of the shear modulus: must be equal, or"
            " all of the bulk 0; poisson=... takes the shear series alone"
        )
    shear = shear_from_young(modulus, nu)
    glassy = shear / rest if long_term else shear
    relaxed = shear if long_term else shear * rest
    return _material(relaxed, glassy * g, tau, bulk, nu if poisson is None else poisson, shift)


def _abaqus(text, scale, zero, poisson, shift):
    blocks = _keywords(text)
    elastic, options = _block(blocks, "*ELASTIC")
    visco, visco_options = _block(blocks, "*VISCOELASTIC")
    if "PRONY" not in visco_options.upper():
        raise ValueError(f"*VISCOELASTIC{visco_options}: must be TIME=PRONY")
    modulus, nu = [*_numbers(elastic[0]), 0.0][:2]
    rows = [[*_numbers(line), 0.0, 0.0][:3] for line in visco]
    g, k, tau = np.array(rows).T
    law = None
    if shift and any(name == "*TRS" for name, _, _ in blocks):
        trs, trs_options = _block(blocks, "*TRS")
        if "DEFINITION" in trs_options.upper() and "WLF" not in trs_options.upper():
            raise ValueError(f"*TRS{trs_options}: must be DEFINITION=WLF; shift=False leaves it out")
        T_ref, C1, C2 = _numbers(trs[0])
        law = WLF(C1, C2, T_ref + zero)
    long_term = "INSTANTANEOUS" not in options.upper()  # as the program has it
    return _relative(modulus * scale, nu, long_term, g, k, tau, poisson, law)


def _keywords(text):
    """(keyword, rest of its line, data lines) of every keyword, up to the second material."""
    blocks = []
    for line in text.splitlines():
        if line.lstrip().startswith("**") or not line.strip():
            continue
        if line.lstrip().startswith("*"):
            keyword, comma, options = line.strip().partition(",")
            if keyword.strip().upper() == "*MATERIAL" and any(
                name == "*VISCOELASTIC" for name, _, _ in blocks
            ):
                break
            if keyword.strip().upper() == "*MATERIAL":
                blocks = []
            blocks.append((keyword.strip().upper(), comma + options, []))
        elif blocks:
            blocks[-1][2].append(line)
    return blocks


def _block(blocks, keyword):
    for name, options, lines in blocks:
        if name == keyword and lines:
            return lines, options
    raise ValueError(f"has no {keyword} with data: must be there")


def _ansys(text, scale, zero, poisson, shift):
    tables, constants, current = {}, {}, None
    for line in text.splitlines():
        fields = [field.strip() for field in line.split("!")[0].split(",")]
        command = fields[0].upper()
        if command == "MP" and len(fields) > 3:
            constants.setdefault(fields[1].upper(), _number(fields[3]))
        elif command == "TB":
            label = fields[1].upper()
            current = tables.setdefault(f"{label},{fields[5].upper() if len(fields) > 5 else ''}", {})
        elif command == "TBDATA" and current is not None:
            start = int(_number(fields[1])) if fields[1] else max(current, default=0) + 1
            values = [field for field in fields[2:] if field]
            current |= {start + i: _number(field) for i, field in enumerate(values)}
    for name in ("EX", "PRXY"):
        if name not in constants and not (name == "PRXY" and "NUXY" in constants):
            raise ValueError(f"has no MP,{name}: must be there")
    nu = constants.get("PRXY", constants.get("NUXY"))
    parts = {what: _pairs(tables.get(f"PRONY,{what}", {}), what) for what in ("SHEAR", "BULK")}
    g, tau = parts["SHEAR"]
    if not g.size:
        raise ValueError("has no TB,PRONY,...,SHEAR with TBDATA: must be there")
    k, bulk_tau = parts["BULK"]
    if k.size and (k.shape != g.shape or not np.allclose(bulk_tau, tau, rtol=1e-9)):
        raise ValueError("TB,PRONY,...,BULK has other times than SHEAR: must be the same")
    law, shifts = None, [name for name in tables if name.startswith("SHIFT,")]
    if shift and shifts:
        if shifts[0] != "SHIFT,WLF":
            raise ValueError(f"TB,{shifts[0]}: must be WLF; shift=False leaves it out")
        T_ref, C1, C2 = (tables["SHIFT,WLF"][i] for i in (1, 2, 3))
        law = WLF(C1, C2, T_ref + zero)
    return _relative(constants["EX"] * scale, nu, False, g, k if k.size else 0 * g, tau, poisson, law)


def _pairs(table, what):
    count = len(table)
    if count % 2 or sorted(table) != list(range(1, count + 1)):
        raise ValueError(
            f"TB,PRONY,...,{what}: has the constants {sorted(table)}: must be pairs of weight and time"
        )
    values = np.array([table[i] for i in range(1, count + 1)])
    return values[::2], values[1::2]


def _lsdyna(text, scale, zero, poisson, shift):
    lines = iter([line for line in text.splitlines() if not line.startswith("$")])
    for line in lines:
        if re.match(_SIGNS["lsdyna"], line, re.I):
            if "_TITLE" in line.upper():
                next(lines)
            break
    cards = []
    for line in lines:
        if line.startswith("*"):
            break
        cards.append(line)
    if len(cards) < 3:
        raise ValueError(
            "*MAT_GENERAL_VISCOELASTIC: must have the material card, the curve card and the terms"
        )
    first, curve, *terms = ([_number(field or "0") for field in _fields(card)] for card in cards)
    if curve[0]:
        raise ValueError(f"*MAT_GENERAL_VISCOELASTIC: has the curve {curve[0]:g}: must have terms")
    if shift and any(first[5:8]):
        raise ValueError(
            "*MAT_GENERAL_VISCOELASTIC: has a shift (TREF, A, B): must have none; shift=False leaves it out"
        )
    rest, weights, tau = 0.0, [], []
    for number, (G, rate, K, _) in enumerate((row[:4] for row in terms), start=1):
        if K:
            raise ValueError(f"term {number}: has KI = {K:g}: must have none, the bulk modulus being elastic")
        if rate == 0:
            rest += G * scale
        elif G:
            weights.append(G * scale)
            tau.append(1 / rate)
    if not weights:
        raise ValueError("*MAT_GENERAL_VISCOELASTIC: has no term with a rate: must have one at least")
    return _material(rest, weights, tau, None if poisson is not None else first[2] * scale, poisson, None)


def _fields(card):
    """Eight fields of a card: between commas, or 10 characters each."""
    if "," in card:
        fields = [field.strip() for field in card.split(",")]
    else:
        fields = [card[i : i + 10].strip() for i in range(0, 80, 10)]
    return (fields + [""] * 8)[:8]


def _pyvisco(text, unit_stress, poisson):
    names, units, *rows = (
        [field.strip() for field in line.split(",")] for line in text.splitlines() if line.strip()
    )
    letter = next((name[0] for name in names if name in ("E_0", "G_0")), None)
    if letter is None or "tau_i" not in names or "alpha_i" not in names:
        raise ValueError(f"columns {', '.join(names)}: must have tau_i, alpha_i and E_0 or G_0")
    if letter == "G" and poisson is None:
        raise ValueError("G_0 is a shear modulus: poisson must be given, E = 2 (1 + poisson) G")
    unit = units[names.index(f"{letter}_0")]
    if unit not in STRESS or unit_stress not in (None, unit):
        raise ValueError(f"column {letter}_0: unit {unit!r}: must be {unit_stress or ', '.join(STRESS)}")
    table = {
        name: [_number(row[names.index(name)]) for row in rows]
        for name in ("tau_i", "alpha_i", f"{letter}_0")
    }
    nu = 0.5 if poisson is None else poisson
    modulus = table[f"{letter}_0"][0] * STRESS[unit]
    young = modulus if letter == "E" else young_from_shear(modulus, nu)
    g, tau = np.array(table["alpha_i"]), np.array(table["tau_i"])
    return _relative(young, nu, False, g, g, tau, nu, None)


def _numbers(line):
    return [_number(field or "0") for field in line.rstrip().rstrip(",").split(",")]


def _number(field):
    try:
        return float(re.sub(r"[dD](?=[+-]?\d+$)", "e", field.strip() or "0"))
    except ValueError:
        raise ValueError(f"{field.strip()!r}: must be a number") from None
