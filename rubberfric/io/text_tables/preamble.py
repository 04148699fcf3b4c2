"""Conditions that lines above a table state, such as `Frequency: 10 Hz` above a temperature ramp."""

import re
from typing import NamedTuple

from rubberfric.base.atomic import StrPath, is_number
from rubberfric.io.columns import COLUMNS, LONGEST_TITLE, known_name, known_unit
from rubberfric.io.text_tables.lines import SEPARATORS, has_fields, split_fields, text_above_numbers
from rubberfric.io.text_tables.workbooks import read_export

# Between a name and its value, as in "Frequency: 10 Hz", "Frequency [Hz] = 10" and "Frequenz;10;Hz".
_NAMED = re.compile(r"[#\s]*(.+?)\s*[:=;,\t]\s*(\d+(?:[.,]\d+)?)[\s;,]*([^\d\s;,]*)[\s;,]*")
# In a text, as in "Temperature ramp at 10 Hz" and "Temperaturrampe (10,0 Hz)".
_IN_TEXT = re.compile(r"(?:\b(?:at|bei|à|of|f\s*=)\s*|(?<!\d)[(,@]\s*)(\d+(?:[.,]\d+)?)\s*([^\d\s;,()]+)")
# Lines of Gwyddion above an image: "# Width: 10.0 µm", "# Height: 5.0 µm" and "# Value units: m".
_IMAGE = {
    "width": re.compile(r"#\s*(?:width|breite|largeur)\s*:\s*([-+.,\de]+)\s*(\S+)\s*", re.IGNORECASE),
    "height": re.compile(r"#\s*(?:height|höhe|hauteur)\s*:\s*([-+.,\de]+)\s*(\S+)\s*", re.IGNORECASE),
    "unit": re.compile(r"#\s*(?:value units?|werteinheit(?:en)?)\s*:\s*(\S+)\s*", re.IGNORECASE),
}
# Names of lines about the geometry or the mode of a test, such as "Geometry name" of TRIOS.
_GEOMETRY = re.compile(
    r"geometry|geometrie|géométrie|clamp|fixture|deformation mode|test mode|test type|\bmode\b"
    r"|measuring system|messsystem|procedure ?(?:name|segments)|step name|^\s*#?\s*torsion",
    re.IGNORECASE,
)
# Words in such lines for shear, and for tension, bending and compression.
_SHEAR = re.compile(
    r"torsion|parallel plate|platte.platte|plate.plate|\bcone|kegel|couette|concentric|\bshear|scher"
    r"|cisaillement",
    re.IGNORECASE,
)
_TENSION = re.compile(
    r"tensi|axial|film|fib(?:er|re)|bending|cantilever|compress|zug|biege|druck|traction|flexion",
    re.IGNORECASE,
)
# Rheometers, which measure G' unless the geometry is one of tension.
_RHEOMETER = re.compile(
    r"ares[ -]?g2|discovery hr|\bdhr\b|\bhr[ -]?[123]0?\b|\bar[ -]?(?:g2|1500|2000)|\bmcr ?\d{2,3}|kinexus"
    r"|haake mars",
    re.IGNORECASE,
)
# Names of lines about the instrument.
_INSTRUMENT = re.compile(
    r"instrument (?:type|name|model)|^\s*#?\s*(?:instrument|device|gerät)\b", re.IGNORECASE
)
# Names of frequencies in lines.
_FREQUENCIES = ("f", "omega", "f_set")
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
    lines = _preamble(read_export(path))
    values = {value for line in lines for value in (*_named(line, _FREQUENCIES), *_frequencies(line))}
    return values.pop() if len(values) == 1 else None


def stated_stroke(path: StrPath) -> float | None:
    """Return the stroke [m] that the lines above the numbers of a table state, or None.

    Examples are "Stroke: 1 mm" and "Hub [mm];1,5". The result is None if the lines state several strokes.
    Raise ValueError if the file cannot be read.

    Examples
    --------
    >>> np.savetxt("srv.txt", [[0.0, 0.31], [0.1, 0.32]], header="Stroke: 1 mm")
    >>> rf.io.stated_stroke("srv.txt")
    0.001
    """
    values = {value for line in _preamble(read_export(path)) for value in _named(line, ("stroke",))}
    return values.pop() if len(values) == 1 else None


def stated_shear(text: str) -> list[str]:
    """Return the line above the numbers of a text that says that moduli are of shear, or [].

    This is a line about a geometry of shear such as "Geometry name: Torsion rectangular", or a line that
    names a rheometer, if no line names a geometry of tension.
    """
    lines = [" ".join(line.split()) for line in text_above_numbers(text).splitlines()]
    lines = [line for line in lines if len(line) <= LONGEST_TITLE]
    about = [line for line in lines if _GEOMETRY.search(line)]
    of_shear = [line for line in about if _SHEAR.search(line)]
    if of_shear or any(_TENSION.search(line) for line in about):
        return of_shear[:1]
    return [line for line in lines if _INSTRUMENT.search(line) and _RHEOMETER.search(line)][:1]


class ImageHeader(NamedTuple):
    """Size of an image [m], and unit of its values, that lines above it state; None if unknown.

    `width` is the length of a row and `height` the length of a column, with one spacing for each point.
    """

    width: float | None = None
    height: float | None = None
    unit: str | None = None


def stated_image(text: str) -> ImageHeader:
    """Return what the lines of Gwyddion above the numbers of an image state.

    Gwyddion writes them if the option "Add informational header" is set; the width is that of all points
    [https://gwyddion.net/documentation/user-guide-en/text-data-export.html].
    """
    stated: dict[str, float | str | None] = {}
    for line in text.splitlines():
        if has_fields(line):  # the first row of numbers; the header consists of comments
            break
        for name, pattern in _IMAGE.items():
            if not (match := pattern.fullmatch(line.strip())):
                continue
            if name == "unit":
                stated[name] = match[1]
            elif is_number(match[1]):
                unit = known_unit(match[2], "x")
                if unit in COLUMNS["x"].units:
                    stated[name] = COLUMNS["x"].units[unit] * float(match[1].replace(",", "."))
    return ImageHeader(**stated)  # pyright: ignore[reportArgumentType]


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
