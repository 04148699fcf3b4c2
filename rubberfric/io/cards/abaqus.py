"""Abaqus: *ELASTIC or *HYPERELASTIC, *VISCOELASTIC with TIME=PRONY, and *TRS.

[Abaqus Keywords Guide]
"""

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from rubberfric.io.cards import hyperelastic
from rubberfric.io.cards.contents import (
    CardMaterial,
    CardOptions,
    CardSeries,
    Elastic,
    elastic_from_young,
    relative,
)
from rubberfric.io.cards.text import comma_line, comma_numbers, format_number, need

SIGN = r"^[ \t]*\*[ \t]*VISCOELASTIC"
# Keywords that end the block of a material.
_OUTSIDE = re.compile(
    r"\*(STEP|PART|ASSEMBLY|INSTANCE|END|NODE|NSET|ELEMENT|ELSET|SURFACE|AMPLITUDE|BOUNDARY|CONTACT"
    r"|INITIALCONDITIONS|PHYSICALCONSTANTS|SOLIDSECTION|SHELLSECTION|MEMBRANESECTION|COHESIVESECTION"
    r"|RIGIDBODY|TIE|EQUATION|ORIENTATION|SYSTEM|PREPRINT|HEADING)"
)
# Keywords of a material that change its modulus at small strain and are not read.
_UNREAD = (
    *("*INCLUDE", "*HYPERFOAM", "*ANISOTROPICHYPERELASTIC", "*HYPOELASTIC", "*POROUSELASTIC", "*DAMPING"),
    *("*LOWDENSITYFOAM", "*HYSTERESIS", "*USERMATERIAL", "*NONLINEARVISCOELASTIC", "*VISCOUS"),
)
_MODULI: dict[str, tuple[str, ...]] = {"MODULI": ("LONG TERM", "INSTANTANEOUS"), "DEPENDENCIES": ("0",)}
_ENERGIES = (
    *("NEO HOOKE", "MOONEY-RIVLIN", "POLYNOMIAL", "REDUCED POLYNOMIAL", "YEOH", "OGDEN"),
    *("ARRUDA-BOYCE", "VAN DER WAALS"),
)


class _Block(NamedTuple):
    """A keyword with its options and data lines."""

    line: str  # keyword line
    keyword: str  # in capitals, without blanks
    options: list[tuple[str, str]]  # (name, value)
    data: list[str]

    def taken(self, allowed: Mapping[str, tuple[str, ...]], hint: str = "") -> dict[str, str]:
        """Return the options by name. Raise ValueError for an option or a value that is not allowed.

        Names and values may be abbreviated. A name whose tuple of values is empty allows all values.
        """
        options: dict[str, str] = {}
        for written, value in self.options:
            name = _squeezed(written)
            names = [keyword for keyword in allowed if _squeezed(keyword).startswith(name)]
            names = [keyword for keyword in names if _squeezed(keyword) == name] or names
            values = allowed[names[0]] if len(names) == 1 else ()
            fits = [
                keyword for keyword in values if value and _squeezed(keyword).startswith(_squeezed(value))
            ]
            text = f"{written}={value}" if value else written
            listed = ", ".join(f"{a}={b}" if b else a for a, bs in allowed.items() for b in bs or ("",))
            message = f"{self.keyword}, {text} is not supported: must be {listed}{hint}"
            need(len(names) == 1 and (fits or not values or (not value and "" in values)), message)
            need(names[0] not in options, f"{self.keyword} has {names[0]} twice: must be given once")
            options[names[0]] = fits[0] if fits else value
        return options


def read(text: str, options: CardOptions) -> list[CardMaterial]:
    """Return the materials with *VISCOELASTIC."""
    materials: list[tuple[str, list[_Block]]] = [("", [])]
    inside = True
    for block in _blocks(text):
        if block.keyword == "*MATERIAL":
            names = [value for name, value in block.options if _squeezed(name) == "NAME"]
            materials.append((names[0].strip('" ') if names else "", []))
            inside = True
        elif _OUTSIDE.match(block.keyword):
            inside = False
        elif inside:
            materials[-1][1].append(block)
    return [
        CardMaterial((name,) if name else (), lambda blocks=blocks: _material(blocks, options))
        for name, blocks in materials
        if any(block.keyword == "*VISCOELASTIC" for block in blocks)
    ]


def _squeezed(text):
    return re.sub(r"\s", "", text).upper()


def _blocks(text):
    """Return the keywords of a text. A keyword line that ends with a comma continues on the next line."""
    lines: list[tuple[str, list[str]]] = []
    continues = False
    for line in text.splitlines():
        if re.match(r"\s*(\*\*|$)", line):
            continue
        is_keyword = line.lstrip().startswith("*")
        if continues and not is_keyword:
            lines[-1] = lines[-1][0] + line.strip(), []
        elif is_keyword:
            lines.append((line.strip(), []))
        elif lines:
            lines[-1][1].append(line)
        continues = (is_keyword or continues) and line.rstrip().endswith(",")
    blocks = []
    for line, data in lines:
        keyword, *fields = re.findall(r'(?:[^,"]|"[^"]*"?)+', line)
        pairs = [field.partition("=") for field in fields if field.strip()]
        blocks.append(_Block(line, _squeezed(keyword), [(a.strip(), b.strip()) for a, _, b in pairs], data))
    return blocks


def _material(blocks, options):
    """Return the contents of the keywords of one material."""
    for block in blocks:
        advice = "copy the lines of the other file here" if block.keyword == "*INCLUDE" else "remove it"
        need(
            block.keyword not in _UNREAD,
            f"{block.line} is not read, but may change the modulus; {advice}, or convert the material",
        )
    viscoelastic = _one(blocks, "*VISCOELASTIC")
    how = viscoelastic.taken(
        {"TIME": ("PRONY",), "FREQUENCY": ("PRONY",), "TYPE": ("ISOTROPIC",), "ERRTOL": (), "NMAX": ()}
    )
    need("TIME" in how or "FREQUENCY" in how, f"{viscoelastic.line}: must be TIME=PRONY")
    wlf = _wlf(blocks, options.shift)
    hyper = [block for block in blocks if block.keyword == "*HYPERELASTIC"]
    if hyper:
        message = "*ELASTIC and *HYPERELASTIC are both given: must be one of them"
        need(not any(block.keyword == "*ELASTIC" for block in blocks), message)
    elastic = _one(blocks, "*HYPERELASTIC" if hyper else "*ELASTIC")
    moduli, rows = _hyperelastic(elastic) if hyper else _elastic(elastic)
    terms = [comma_numbers(line) for line in viscoelastic.data]
    for place, term in enumerate(terms, start=1):
        need(
            len(term) < 4 or not any(term[3:]),
            f"*VISCOELASTIC: term {place} has {len(term)} numbers: must have g, k and tau",
        )
    g, k, tau = np.array([[*term, 0.0, 0.0][:3] for term in terms]).T
    # LONG TERM is the program's default.
    long_term = moduli.get("MODULI") != "INSTANTANEOUS"
    where = elastic.keyword
    return relative(rows, g, k, tau, wlf, shift=options.shift, long_term=long_term, where=where)


def _one(blocks, keyword):
    """Return the only block with data of a keyword, or raise ValueError."""
    same = [block for block in blocks if block.keyword == keyword and block.data]
    need(same, f"{keyword} with data is missing: must be given")
    need(len(same) == 1, f"{keyword} is given {len(same)} times in a material: must be given once")
    return same[0]


def _wlf(blocks, needed):
    """Return reference temperature, C1 and C2 of *TRS, or () if there is no WLF shift."""
    shifts = [block for block in blocks if block.keyword == "*TRS"]
    if not shifts:
        return ()
    leave = "; shift=False leaves the shift out"
    try:
        need(len(shifts) == 1, f"*TRS is given {len(shifts)} times in a material: must be given once")
        shifts[0].taken({"DEFINITION": ("WLF",)}, leave)
        rows = [comma_numbers(line) for line in shifts[0].data]
        need(rows, "*TRS with data is missing: must be given")
        fits = len(rows) == 1 and len(rows[0]) == 3
        need(fits, f"*TRS has {sum(map(len, rows))} numbers: must have T_ref, C1 and C2{leave}")
    except ValueError:
        if needed:
            raise
        return ()
    return tuple(rows[0])


def _elastic(block):
    """Return the options and the moduli of *ELASTIC at each temperature."""
    options = block.taken({"TYPE": ("ISOTROPIC",), **_MODULI})
    rows = []
    for line in block.data:
        fields = line.rstrip().rstrip(",").split(",")
        numbers = [*comma_numbers(line), 0.0]
        need(
            all(not field.strip() for field in fields[3:]),
            f"*ELASTIC has a row of {len(fields)} numbers: must have E, Poisson's ratio and a temperature",
        )
        temperature = numbers[2] if len(fields) > 2 and fields[2].strip() else None
        rows.append(elastic_from_young(numbers[0], numbers[1], temperature, "*ELASTIC"))
    return options, rows


def _hyperelastic(block):
    """Return the options and the moduli of *HYPERELASTIC at each temperature, at small strain."""
    way = "; or replace *HYPERELASTIC by *ELASTIC with the modulus at small strain and Poisson's ratio"
    allowed = {**{name: ("",) for name in _ENERGIES}, "N": (), **_MODULI}
    options = block.taken(allowed, way)
    names = [name for name in _ENERGIES if name in options]
    need(len(names) == 1, f"{block.line}: must name one of {', '.join(_ENERGIES)}{way}")
    n = _order(options.get("N", "1"))
    energy = {
        "NEO HOOKE": hyperelastic.reduced_polynomial(1),
        "MOONEY-RIVLIN": hyperelastic.polynomial(1),
        "POLYNOMIAL": hyperelastic.polynomial(n),
        "REDUCED POLYNOMIAL": hyperelastic.reduced_polynomial(n),
        "YEOH": hyperelastic.reduced_polynomial(3),
        "OGDEN": hyperelastic.ogden(n, halved=False),
        "ARRUDA-BOYCE": hyperelastic.ARRUDA_BOYCE,
        "VAN DER WAALS": hyperelastic.VAN_DER_WAALS,
    }[names[0]]
    return options, list(_rows_of(block, energy))


def _order(text):
    need(re.fullmatch("[1-6]", text), f"*HYPERELASTIC, N={text}: must be 1 ... 6")
    return int(text)


def _rows_of(block, energy) -> Iterator[Elastic]:
    """Yield the moduli at each temperature. Data lines have 8 numbers, the last of them the temperature."""
    count = energy.coefficients + energy.volumes
    lines = count // 8 + 1  # with the temperature
    data = block.data
    if count % 8 == 0 and len(data) == count // 8:
        data = [*data, ""]  # without a temperature
    message = f"*HYPERELASTIC has {len(data)} data lines: must have {lines} for each temperature"
    need(len(data) % lines == 0, message)
    for start in range(0, len(data), lines):
        fields: list[str] = []
        for line in data[start : start + lines]:
            parts = line.rstrip().rstrip(",").split(",")
            need(len(parts) <= 8, f"*HYPERELASTIC has a line of {len(parts)} numbers: must be at most 8")
            fields += parts + [""] * (8 - len(parts))
        numbers = [comma_numbers(field)[0] for field in fields]
        message = f"*HYPERELASTIC has more than {count} coefficients and a temperature"
        need(not any(field.strip() for field in fields[count + 1 :]), message)
        temperature = numbers[count] if fields[count].strip() else None
        yield energy.elastic(numbers[:count], temperature, "*HYPERELASTIC")


def write(series: CardSeries) -> Iterator[str]:
    """Yield the lines of the cards."""
    yield f"*MATERIAL, NAME={series.name}"
    if series.mass is not None:
        yield from ("*DENSITY", f"{format_number(series.mass)},")
    kind = "HYPERELASTIC, NEO HOOKE" if series.hyperelastic else "ELASTIC"
    yield f"*{kind}, MODULI=INSTANTANEOUS"
    for temperature, scale in series.scales:
        at = [] if temperature is None else [temperature]
        if series.hyperelastic:
            yield comma_line(0.5 * scale * series.shear, series.D1 / scale, *at)
        else:
            yield comma_line(scale * series.young, series.poisson, *at)
    yield "*VISCOELASTIC, TIME=PRONY"
    for row in zip(series.g, series.k, series.tau, strict=True):
        yield comma_line(*row)
    if series.wlf:
        yield from ("*TRS, DEFINITION=WLF", comma_line(*series.wlf))
