"""Prony series in ANSYS: MP,EX and MP,PRXY, TB,PRONY for shear and bulk, TB,SHIFT for a WLF shift."""

from collections.abc import Iterator

import numpy as np

from rubberfric.io.prony_cards.series import Format, Material, Series, Units, from_relative, number
from rubberfric.materials.shifts.laws import WLF

MOST_TERMS = 100


def read(text: str, units: Units, poisson: float | None, shift: bool) -> Material:
    """The material of a file of commands."""
    constants, tables = _commands(text)
    for name in ("EX", "PRXY"):
        if name not in constants and not (name == "PRXY" and "NUXY" in constants):
            raise ValueError(f"has no MP,{name}: must be there")
    nu = constants["PRXY" if "PRXY" in constants else "NUXY"]
    g, tau = _pairs(tables, "SHEAR")
    if not g.size:
        raise ValueError("has no TB,PRONY,...,SHEAR with TBDATA: must be there")
    k, bulk_tau = _pairs(tables, "BULK")
    if k.size and (k.shape != g.shape or not np.allclose(bulk_tau, tau, rtol=1e-9)):
        raise ValueError("TB,PRONY,...,BULK has other times than SHEAR: must be the same")
    law, shifts = None, [name for name in tables if name.startswith("SHIFT,")]
    if shift and shifts:
        if shifts[0] != "SHIFT,WLF":
            raise ValueError(f"TB,{shifts[0]}: must be WLF; shift=False leaves it out")
        T_ref, C1, C2 = (tables["SHIFT,WLF"][i] for i in (1, 2, 3))
        law = WLF(C1, C2, T_ref + units.zero)
    young = constants["EX"] * units.pascal
    return from_relative(young, nu, False, g, k if k.size else 0 * g, tau, poisson, law)


def write(series: Series, units: Units, mass: float | None, _name: str) -> Iterator[str]:
    """Commands."""
    terms = series.tau.size
    if series.poisson >= 0.5:
        raise ValueError(
            "material has Poisson's ratio 0.5: it must be < 0.5 for ansys; give bulk, such as 2e9 [Pa]"
        )
    if terms > MOST_TERMS:
        raise ValueError(
            f"material has {terms} terms: must be at most {MOST_TERMS} for ansys; fit_prony with fewer"
        )
    yield f"MP,EX,1,{series.young(units)!r}"
    yield f"MP,PRXY,1,{series.poisson!r}"
    if mass is not None:
        yield f"MP,DENS,1,{mass!r}"
    for what, weights in (("SHEAR", series.g), ("BULK", series.k)):
        if weights.any():
            yield f"TB,PRONY,1,1,{terms},{what}"
            pairs = np.stack([weights, series.tau], 1).tolist()
            for i in range(0, terms, 3):
                yield f"TBDATA,{2 * i + 1}," + ",".join(repr(x) for pair in pairs[i : i + 3] for x in pair)
    if series.shift is not None:
        yield "TB,SHIFT,1,1,3,WLF"
        yield "TBDATA,1," + ",".join(map(repr, series.wlf(units)))


ANSYS = Format(r"^\s*TB\s*,\s*PRONY", True, "!", read, write)


def _commands(text: str) -> tuple[dict[str, float], dict[str, dict[int, float]]]:
    """Constants by their label, and tables by "LABEL,OPTION": number of a constant -> its value."""
    constants, tables, current = {}, {}, None
    for line in text.splitlines():
        fields = [field.strip() for field in line.split("!")[0].split(",")]
        command = fields[0].upper()
        if command == "MP" and len(fields) > 3:
            constants.setdefault(fields[1].upper(), number(fields[3]))
        elif command == "TB":
            label = fields[1].upper()
            current = tables.setdefault(f"{label},{fields[5].upper() if len(fields) > 5 else ''}", {})
        elif command == "TBDATA" and current is not None:
            start = int(number(fields[1])) if fields[1] else max(current, default=0) + 1
            values = [field for field in fields[2:] if field]
            current |= {start + i: number(field) for i, field in enumerate(values)}
    return constants, tables


def _pairs(tables: dict[str, dict[int, float]], what: str) -> tuple[np.ndarray, np.ndarray]:
    """Weights and times of a table of pairs; empty if there is none."""
    table = tables.get(f"PRONY,{what}", {})
    count = len(table)
    if count % 2 or sorted(table) != list(range(1, count + 1)):
        raise ValueError(
            f"TB,PRONY,...,{what}: has the constants {sorted(table)}: must be pairs of weight and time"
        )
    values = np.array([table[i] for i in range(1, count + 1)])
    return values[::2], values[1::2]
