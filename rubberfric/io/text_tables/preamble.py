"""Conditions that lines above a table state, such as `Frequency: 10 Hz` above a temperature ramp."""

import re

from rubberfric.base.atomic import StrPath, is_number
from rubberfric.io.columns import COLUMNS, LONGEST_TITLE, known_name, known_unit
from rubberfric.io.text_tables.lines import SEPARATORS, has_fields, split_fields
from rubberfric.io.text_tables.workbooks import read_export

# Between a name and its value, as in "Frequency: 10 Hz", "Frequency [Hz] = 10" and "Frequenz;10;Hz".
_NAMED = re.compile(r"[#\s]*(.+?)\s*[:=;,\t]\s*(\d+(?:[.,]\d+)?)[\s;,]*([^\d\s;,]*)[\s;,]*")
# In a text, as in "Temperature ramp at 10 Hz" and "Temperaturrampe (10,0 Hz)".
_IN_TEXT = re.compile(r"(?:\b(?:at|bei|à|of|f\s*=)\s*|(?<!\d)[(,@]\s*)(\d+(?:[.,]\d+)?)\s*([^\d\s;,()]+)")
# Names of frequencies in lines.
_FREQUENCIES = ("f", "omega", "f_set")
# Words of lines about the frequency of the sampling.
_SAMPLING = re.compile(r"sampl|rate|filter|abtast|acqui|échant|erfass", re.IGNORECASE)


def stated_frequency(path: StrPath) -> float | None:
    """Return the angular frequency [rad/s] that the lines above the numbers of a table state, or None.

    Examples are "Frequency: 10 Hz", "Frequenz [Hz];10" and "Temperature ramp at 10 Hz". The result is None if
    the lines state several frequencies. Raise ValueError if the file cannot be read.
    """
    lines = _preamble(read_export(path))
    values = {value for line in lines for value in (*_named(line, _FREQUENCIES), *_frequencies(line))}
    return values.pop() if len(values) == 1 else None


def stated_stroke(path: StrPath) -> float | None:
    """Return the stroke [m] that the lines above the numbers of a table state, or None.

    Examples are "Stroke: 1 mm" and "Hub [mm];1,5". The result is None if the lines state several strokes.
    Raise ValueError if the file cannot be read.
    """
    values = {value for line in _preamble(read_export(path)) for value in _named(line, ("stroke",))}
    return values.pop() if len(values) == 1 else None


def _preamble(text):
    """Return the lines above the first line with two numbers that is no comment."""
    lines = []
    for line in text.splitlines():
        if has_fields(line) and any(
            sum(map(is_number, split_fields(line, separator))) > 1 for separator in SEPARATORS
        ):
            break
        if len(line) <= LONGEST_TITLE and not _SAMPLING.search(line):
            lines.append(line)
    return lines


def _named(line, names):
    """Yield the value in SI in a line that consists of one of the names, a number and a unit."""
    if match := _NAMED.fullmatch(line.replace('"', " ")):
        name, unit = known_name(match[1])
        if name in names:
            yield from _value(match[2], unit or match[3], names)


def _frequencies(line):
    """Yield the angular frequencies in the text of a line [rad/s]."""
    for match in _IN_TEXT.finditer(line):
        yield from _value(match[1], match[2], _FREQUENCIES)


def _value(number, unit, names):
    for name in names:
        plain = known_unit(unit, name)
        if name in COLUMNS and plain in COLUMNS[name].units and plain != "rpm":
            yield COLUMNS[name].value(float(number.replace(",", ".")), plain)
