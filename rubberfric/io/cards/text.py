"""Text of cards and tables of other programs: units, numbers in fields, and blocks below keywords."""

import math
import re

from rubberfric.base.units import ZERO_CELSIUS

# Units of stress [Pa].
STRESS = {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9}
# Zeros of temperature scales [K].
TEMPERATURE = {"K": 0.0, "C": ZERO_CELSIUS}


def need(holds: object, message: str) -> None:
    """Raise ValueError with a message unless a condition holds."""
    if not holds:
        raise ValueError(message)


def parse_number(field: str) -> float:
    """Return the number in a field, which may have an exponent with D as in Fortran; a blank field is 0."""
    field = field.strip()
    try:
        number = float(re.sub(r"[dD](?=[+-]?\d+$)", "e", field or "0"))
    except ValueError:
        number = math.nan
    if not math.isfinite(number) or "_" in field:  # Python reads 1_0 as 10
        parameter = "; parameters are not evaluated" if re.match("[<&%]", field) else ""
        raise ValueError(f"{field!r}: must be a number{parameter}")
    return number


def format_number(value: float, width: int = 20) -> str:
    """Return the most accurate text of a number with at most `width` characters."""
    value = float(value)
    texts = [repr(value), f"{value:.{width}f}"[:width]]
    for digits in range(width):
        mantissa, exponent = f"{value:.{digits}E}".split("E")
        texts.append(f"{mantissa}E{int(exponent)}")
    return min((t for t in texts if len(t) <= width), key=lambda text: (abs(float(text) - value), len(text)))


def keyword_blocks(text: str, skip: str, mark: str = r"\s*\*") -> list[tuple[str, list[str]]]:
    """Return (keyword line, lines below it without comments) of each block in a text.

    The regular expressions `skip` and `mark` match the beginnings of comment lines and of keyword lines.
    """
    blocks: list[tuple[str, list[str]]] = []
    for line in text.splitlines():
        if re.match(skip, line):
            continue
        if re.match(mark, line):
            blocks.append((line.strip(), []))
        elif blocks:
            blocks[-1][1].append(line)
    return blocks


def comma_numbers(line: str) -> list[float]:
    """Return the numbers of a line, which are separated by commas; a comma may also end the line."""
    return [parse_number(field) for field in line.rstrip().rstrip(",").split(",")]


def comma_line(*values: float) -> str:
    """Return the numbers as a line that `comma_numbers` reads."""
    return ", ".join(map(format_number, values))


def wide_numbers(line: str, count: int, width: int = 20) -> list[float]:
    """Return the numbers in the first `count` fields of a line, whose fields have `width` characters."""
    try:
        return [parse_number(line[i : i + width]) for i in range(0, width * count, width)]
    except ValueError as error:
        raise ValueError(f"{error} in a field of {width} characters") from None


def wide_line(*values: float, width: int = 20) -> str:
    """Return the numbers as a line that `wide_numbers` reads."""
    return "".join(f"{format_number(value, width):>{width}}" for value in values)
