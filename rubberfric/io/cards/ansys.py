"""ANSYS: MP, TB,ELASTIC or TB,HYPER, TB,PRONY for shear and bulk, and TB,SHIFT.

The commands belong to the material whose number they contain. Tables over temperature are read from MPTEMP
and MPDATA, or from TBTEMP. [ANSYS Material Reference]
"""

from collections.abc import Iterator, Sequence

import numpy as np

from rubberfric.io.cards import hyperelastic
from rubberfric.io.cards.contents import CardMaterial, CardOptions, CardSeries, elastic_from_young, relative
from rubberfric.io.cards.text import need, parse_number

SIGN = r"^(.*\$)?[ \t]*TB[ \t]*,[ \t]*PRON"
# Commands that change materials and are not evaluated, by their first four letters.
_UNREAD = ("TBMO", "TBDE", "TBCO", "MPDE", "MPCO", "MPCH", "MPAM", "/INP", "*USE")
# Constants of anisotropic materials and of damping.
_OTHER = ("EY", "EZ", "PRYZ", "PRXZ", "NUYZ", "NUXZ", "GXY", "GYZ", "GXZ", "BETD", "DMPR", "DMPS")
# Tables that change the modulus at small strain, by their first four letters.
_TABLES = ("ANEL", "AHYP", "SDAM", "USER", "CAST", "PELA", "FCLI")

_Rows = list[tuple[float | None, dict[int, float]]]  # temperature, and constants by number


class _Material:
    """Commands of one material number."""

    def __init__(self):
        self.constants: dict[str, list[float]] = {}  # of MP by label: polynomial in temperature
        self.points: dict[str, dict[float, float]] = {}  # of MPDATA by label: value at temperatures
        self.tables: dict[tuple[str, str], _Rows] = {}  # of TB by label and option
        self.sizes: dict[tuple[str, str], int] = {}  # number of points that TB states


def read(text: str, options: CardOptions) -> list[CardMaterial]:
    """Return the materials with TB,PRONY."""
    return [
        CardMaterial((number,), lambda number=number, material=material: _cards(number, material, options))
        for number, material in _materials(text).items()
        if any(label == "PRON" for label, _ in material.tables)
    ]


def _commands(text):
    """Yield (first four letters, fields) of each command in capitals."""
    for line in text.splitlines():
        for command in line.split("!")[0].split("$"):
            name, *fields = (field.strip().upper() for field in command.split(","))
            if name:
                yield name[:4], [*fields, *[""] * (6 - len(fields))]


def _materials(text):
    """Return the materials of a text by number."""
    materials: dict[str, _Material] = {}
    temperatures: dict[int, float] = {}  # of MPTEMP, by place
    rows: _Rows | None = None  # of the last TB
    for name, fields in _commands(text):
        message = f"{name},{','.join(filter(None, fields))} is not evaluated; copy the cards of the material"
        need(name not in _UNREAD, f"{message} alone to a file")
        if name == "MP" and fields[0]:
            material = materials.setdefault(_number(fields[1]), _Material())
            values, label = [parse_number(field) for field in fields[2:]], fields[0]
            known = material.constants.setdefault(label, values)
            message = f"MP,{label} is given twice for the material {_number(fields[1])}: must have one value"
            need(known == values, message)
        elif name == "MPTE":
            if not any(fields):
                temperatures = {}
            first = int(parse_number(fields[0])) if fields[0] else len(temperatures) + 1
            values = [parse_number(field) for field in fields[1:] if field]
            temperatures |= {first + i: value for i, value in enumerate(values)}
        elif name == "MPDA":
            points = materials.setdefault(_number(fields[1]), _Material()).points.setdefault(fields[0], {})
            first = int(parse_number(fields[2])) if fields[2] else len(points) + 1
            for i, value in enumerate(field for field in fields[3:] if field):
                need(first + i in temperatures, f"MPDATA,{fields[0]}: temperature {first + i} is missing")
                points[temperatures[first + i]] = parse_number(value)
        elif name == "TB":
            material = materials.setdefault(_number(fields[1]), _Material())
            key = fields[0][:4], fields[4]
            message = (
                f"TB,{fields[0]} is given twice for the material {_number(fields[1])}: must be given once"
            )
            need(not any(values for _, values in material.tables.get(key, [])), message)
            rows = material.tables.setdefault(key, [(None, {})])
            material.sizes[key] = int(parse_number(fields[3]))
        elif name == "TBTE" and rows is not None:
            _begin(rows, parse_number(fields[0]), fields[1])
        elif name == "TBDA" and rows is not None:
            _add(rows[-1][1], fields)
    return materials


def _number(field):
    """Return a material number as text; a blank number is 1."""
    return str(int(field)) if field.isdigit() else field or "1"


def _begin(rows, temperature, change):
    need(not change, f"TBTEMP,{temperature:g},{change} is not evaluated: must have a temperature only")
    if rows[-1][1]:
        rows.append((temperature, {}))
    else:
        rows[-1] = temperature, rows[-1][1]


def _add(constants, fields):
    """Add the constants of a TBDATA command; blank fields leave constants unchanged."""
    first = int(parse_number(fields[0])) if fields[0] else max(constants, default=0) + 1
    constants |= {first + i: parse_number(field) for i, field in enumerate(fields[1:]) if field}


def _cards(number, material, options):
    unread = [label for label in _OTHER if label in material.constants or label in material.points]
    unread += [f"TB,{label}" for label, _ in material.tables if label in _TABLES]
    message = f"material {number}: {', '.join(unread)} is not read: must be isotropic, without damping"
    need(not unread, message)
    pairs = {}
    for label, option in material.tables:
        if label == "PRON":
            allowed = option[:4] in ("SHEA", "BULK")
            need(allowed, f"material {number}: TB,PRONY,...,{option}: must be SHEAR or BULK")
            pairs[option[:4]] = _pairs(material, (label, option))
    need("SHEA" in pairs, "TB,PRONY,...,SHEAR with TBDATA is missing: must be given")
    g, tau = pairs["SHEA"]
    k, bulk_tau = pairs.get("BULK", (0 * g, tau))
    equal = k.shape == g.shape and np.allclose(bulk_tau, tau, rtol=1e-9)
    need(equal, "TB,PRONY,...,BULK has other times than SHEAR; the times must be equal")
    rows, where = _moduli(number, material)
    wlf = _wlf(material, options.shift)
    return relative(rows, g, k, tau, wlf, shift=options.shift, where=where)


def _pairs(material, key):
    """Return the weights and times of a Prony table as an array of shape (2, n)."""
    table, size = _only(material.tables[key], f"TB,PRONY,...,{key[1]}"), material.sizes[key]
    numbers = sorted(table)
    message = f"TB,PRONY,...,{key[1]} has the constants {numbers}: must be pairs of weight and time"
    need(table and len(table) % 2 == 0 and numbers == list(range(1, len(table) + 1)), message)
    pairs = np.array([table[i] for i in numbers]).reshape(-1, 2).T
    message = f"TB,PRONY,...,{key[1]} has {pairs.shape[1]} pairs, but states {size}: the numbers must agree"
    need(size in (0, pairs.shape[1]), message)
    return pairs


def _only(rows, what):
    """Return the constants of a table, which must not change with temperature."""
    need(len(rows) == 1, f"{what} has {len(rows)} temperatures: must have one; keep one of them")
    return rows[0][1]


def _wlf(material, needed):
    """Return reference temperature, C1 and C2 of TB,SHIFT, or () if there is no WLF shift."""
    keys = [key for key in material.tables if key[0] == "SHIF"]
    if not keys or (not needed and keys[0][1] != "WLF"):
        return ()
    leave = "; shift=False leaves the shift out"
    message = f"TB,SHIFT,{','.join(option for _, option in keys)}: must be WLF{leave}"
    need([option for _, option in keys] == ["WLF"], message)
    table = _only(material.tables[keys[0]], "TB,SHIFT")
    need(sorted(table) == [1, 2, 3], f"TB,SHIFT has {len(table)} constants: must have T_ref, C1, C2{leave}")
    return table[1], table[2], table[3]


def _moduli(number, material):
    """Return the moduli at each temperature, and the command that contains them."""
    elastic = [key for key in material.tables if key[0] == "ELAS"]
    hyper = [key for key in material.tables if key[0] == "HYPE"]
    isotropic = [name for name in ("EX",) if name in material.constants or name in material.points]
    sources = [*(["MP"] * bool(isotropic)), *(f"TB,{label}" for label, _ in (*elastic, *hyper))]
    message = f"material {number} has moduli in {', '.join(sources)}: must be in one of them"
    need(len(sources) <= 1, message)
    if hyper:
        return _hyperelastic(material, hyper[0]), "TB,HYPER"
    if elastic:
        option = elastic[0][1]
        need(option in ("", "ISOT", "ISOTROPIC"), f"TB,ELASTIC,...,{option}: must be ISOT")
        rows = material.tables[elastic[0]]
        for _, constants in rows:
            need(sorted(constants) == [1, 2], "TB,ELASTIC must have E and Poisson's ratio")
        return [elastic_from_young(c[1], c[2], T, "TB,ELASTIC") for T, c in rows], "TB,ELASTIC"
    EX = _over_temperature(material, "EX")
    PRXY = _over_temperature(material, "PRXY", "NUXY")
    stated = sorted(T for T in {*EX, *PRXY} if T is not None)
    temperatures: list[float | None] = [*stated] or [None]
    rows = []
    for T in temperatures:
        columns = [column for column in (EX, PRXY) if T in column or None in column]
        message = f"material {number}: MPDATA,EX and MPDATA,PRXY must have the same temperatures"
        need(len(columns) == 2, message)
        young, poisson = (column[T if T in column else None] for column in columns)
        rows.append(elastic_from_young(young, poisson, T, "MP,EX"))
    return rows, "MP,EX"


def _over_temperature(material, *names) -> dict[float | None, float]:
    """Return the values of a constant by temperature, with the key None for a constant without tables."""
    columns = []
    for name in names:
        if name in material.constants:
            value, *slopes = material.constants[name]
            message = f"MP,{name} has terms over temperature: must be a constant, or a table of MPDATA"
            need(not any(slopes), message)
            columns.append({None: value})
        if name in material.points:
            columns.append(material.points[name])
    need(columns, f"MP,{names[0]} is missing: must be given")
    need(all(column == columns[0] for column in columns), f"MP,{names[0]} is given twice: must be given once")
    return columns[0]


def _hyperelastic(material, key):
    """Return the moduli of TB,HYPER at each temperature, at small strain."""
    option, size = key[1], material.sizes[key]
    way = "; or replace TB,HYPER by MP,EX and MP,PRXY with the modulus at small strain"
    if option[:4] in ("POLY", "YEOH", "OGDE"):
        need(size in range(7), f"TB,HYPER,...,{size},{option}: must have the order 1 ... 6")
    if option[:4] == "MOON":
        need(size in (0, 2, 3, 5, 9), f"TB,HYPER,...,{size},{option}: must have 2, 3, 5 or 9 coefficients")
    energies = {
        "NEO": lambda: hyperelastic.SHEAR_AND_D,
        "MOON": lambda: hyperelastic.mooney(size or 2),
        "POLY": lambda: hyperelastic.polynomial(size or 1),
        "YEOH": lambda: hyperelastic.reduced_polynomial(size or 1),
        "OGDE": lambda: hyperelastic.ogden(size or 1, halved=True),
        "BOYC": lambda: hyperelastic.ARRUDA_BOYCE,
        "GENT": lambda: hyperelastic.GENT,
    }
    message = f"TB,HYPER,...,{option or '(blank)'} is not supported: must be NEO, MOONEY, POLY, YEOH, OGDEN"
    need(option[:4] in energies, f"{message}, BOYCE or GENT{way}")
    energy = energies[option[:4]]()
    count, rows = energy.coefficients + energy.volumes, []
    for temperature, constants in material.tables[key]:
        message = f"TB,HYPER,...,{option} has the constants {sorted(constants)}: must be at most {count}"
        need(constants and max(constants) <= count and min(constants) >= 1, f"{message}, from 1")
        values = [constants.get(i, 0.0) for i in range(1, count + 1)]
        rows.append(energy.elastic(values, temperature, "TB,HYPER"))
    return rows


def write(series: CardSeries) -> Iterator[str]:
    """Yield the lines of the cards."""
    if series.hyperelastic:
        yield from _neo_hooke(series)
    else:
        yield from _young(series)
    if series.mass is not None:
        yield f"MP,DENS,1,{series.mass!r}"
    for what, weights in (("SHEAR", series.g), ("BULK", series.k)):
        if weights.any():
            yield f"TB,PRONY,1,1,{series.tau.size},{what}"
            values: Sequence[float] = np.stack([weights, series.tau], 1).ravel().tolist()
            for i in range(0, len(values), 6):
                yield f"TBDATA,{i + 1}," + ",".join(map(repr, values[i : i + 6]))
    if series.wlf:
        yield from ("TB,SHIFT,1,1,3,WLF", "TBDATA,1," + ",".join(map(repr, series.wlf)))


def _young(series):
    """Yield MP,EX, or MPTEMP and MPDATA,EX, and MP,PRXY."""
    if series.rows is None:
        yield f"MP,EX,1,{series.young!r}"
    else:
        yield "MPTEMP"
        for command, values in (("MPTEMP", series.rows[0]), ("MPDATA,EX,1", series.young * series.rows[1])):
            for i in range(0, values.size, 6):
                yield f"{command},{i + 1}," + ",".join(map(repr, values[i : i + 6].tolist()))
    yield f"MP,PRXY,1,{series.poisson!r}"


def _neo_hooke(series):
    """Yield TB,HYPER with the glassy shear modulus and D1 at each temperature."""
    yield f"TB,HYPER,1,{len(series.scales)},,NEO"
    for temperature, scale in series.scales:
        if temperature is not None:
            yield f"TBTEMP,{temperature!r}"
        yield f"TBDATA,1,{scale * series.shear!r},{series.D1 / scale!r}"
