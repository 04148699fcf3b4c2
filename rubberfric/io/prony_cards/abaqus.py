"""Prony series in Abaqus: ELASTIC and VISCOELASTIC, TIME=PRONY, with TRS for a WLF shift."""

from collections.abc import Iterator

import numpy as np

from rubberfric.io.prony_cards.series import Format, Material, Series, Units, from_relative, number, text_of
from rubberfric.materials.shifts.laws import WLF


def read(text: str, units: Units, poisson: float | None, shift: bool) -> Material:
    """The first material of an input file."""
    blocks = _keywords(text)
    elastic, options = _block(blocks, "*ELASTIC")
    terms, term_options = _block(blocks, "*VISCOELASTIC")
    if "PRONY" not in term_options.upper():
        raise ValueError(f"*VISCOELASTIC{term_options}: must be TIME=PRONY")
    modulus, nu = [*_numbers(elastic[0]), 0.0][:2]
    rows = [[*_numbers(line), 0.0, 0.0][:3] for line in terms]
    g, k, tau = np.array(rows).T
    law = None
    if shift and any(name == "*TRS" for name, _, _ in blocks):
        trs, trs_options = _block(blocks, "*TRS")
        if "DEFINITION" in trs_options.upper() and "WLF" not in trs_options.upper():
            raise ValueError(f"*TRS{trs_options}: must be DEFINITION=WLF; shift=False leaves it out")
        T_ref, C1, C2 = _numbers(trs[0])
        law = WLF(C1, C2, T_ref + units.zero)
    long_term = "INSTANTANEOUS" not in options.upper()  # as the program has it
    return from_relative(modulus * units.pascal, nu, long_term, g, k, tau, poisson, law)


def write(series: Series, units: Units, mass: float | None, name: str) -> Iterator[str]:
    """Lines of an input file."""
    if sum(float(text_of(weight)) for weight in series.g) >= 1:
        raise ValueError(
            "material has no relaxed modulus: it must be > 0 for abaqus, whose weights add up to < 1"
        )
    yield f"*MATERIAL, NAME={name}"
    if mass is not None:
        yield from ("*DENSITY", f"{text_of(mass)},")
    yield "*ELASTIC, MODULI=INSTANTANEOUS"
    yield _line(series.young(units), series.poisson)
    yield "*VISCOELASTIC, TIME=PRONY"
    for row in zip(series.g, series.k, series.tau, strict=True):
        yield _line(*row)
    if series.shift is not None:
        yield from ("*TRS, DEFINITION=WLF", _line(*series.wlf(units)))


ABAQUS = Format(r"^\s*\*VISCOELASTIC", True, "**", read, write)


def _keywords(text: str) -> list[tuple[str, str, list[str]]]:
    """(keyword, rest of its line, data lines) of every keyword, up to the second material."""
    blocks = []
    for line in text.splitlines():
        if line.lstrip().startswith("**") or not line.strip():
            continue
        if line.lstrip().startswith("*"):
            keyword, comma, options = line.strip().partition(",")
            keyword = keyword.strip().upper()
            if keyword == "*MATERIAL":
                if any(name == "*VISCOELASTIC" for name, _, _ in blocks):
                    break
                blocks = []
            blocks.append((keyword, comma + options, []))
        elif blocks:
            blocks[-1][2].append(line)
    return blocks


def _block(blocks: list[tuple[str, str, list[str]]], keyword: str) -> tuple[list[str], str]:
    for name, options, lines in blocks:
        if name == keyword and lines:
            return lines, options
    raise ValueError(f"has no {keyword} with data: must be there")


def _numbers(line: str) -> list[float]:
    return [number(field) for field in line.rstrip().rstrip(",").split(",")]


def _line(*values: float) -> str:
    return ", ".join(map(text_of, values))
