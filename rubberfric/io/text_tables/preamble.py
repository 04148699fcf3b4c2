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
# Words of lines about the frequency of the sampling.
_SAMPLING = re.compile(r"sampl|rate|filter|abtast|acqui|échant|erfass", re.IGNORECASE)


def stated_frequency(path: StrPath) -> float | None:
    """Return the angular frequency [rad/s] that the lines above the numbers of a table state, or None.

    Examples are "Frequency: 10 Hz", "Frequenz [Hz];10" and "Temperature ramp at 10 Hz". The result is None if
    the lines state several frequencies. Raise ValueError if the file cannot be read.

    Examples
    --------
    >>> ramp = [[20.0, 8.1, 1.1], [30.0, 7.5, 1.0]]
    >>> np.savetxt("ramp.txt", ramp, header="Temperature ramp at 10 Hz")
    >>> round(rf.io.stated_frequency("ramp.txt"), 3)
    62.832
    """
    values = {value for line in _preamble(read_export(path)) for value in _frequencies(line)}
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


def _frequencies(line):
    """Yield the angular frequencies in a line [rad/s]."""
    if match := _NAMED.fullmatch(line.replace('"', " ")):
        name, unit = known_name(match[1])
        if name in ("f", "omega", "f_set"):
            yield from _value(match[2], unit or match[3])
            return
    for match in _IN_TEXT.finditer(line):
        yield from _value(match[1], match[2])


def _value(number, unit):
    for name in ("f", "omega"):
        plain = known_unit(unit, name)
        if plain in COLUMNS[name].units and plain != "rpm":
            yield COLUMNS[name].value(float(number.replace(",", ".")), plain)
