"""Text files with several series of two columns, below commented titles, as contact.engineering writes them.

::

    # 1D PSD along x
    # --------------
    # Columns: Wavevector (µm⁻¹), PSD (µm³)
    1.0e-03 6.3e+04
    ...
"""

import re
from typing import NamedTuple

from rubberfric.base.atomic import StrPath
from rubberfric.base.checks import listed, warn_caller

_COLUMNS = re.compile(r"#\s*Columns:\s*(.+?), (.+)")
_UNIT = re.compile(r".*(\([^()]*\))\s*")


class Series(NamedTuple):
    """A series of a text: its name, its two titles, and its rows."""

    name: str
    titles: tuple[str, str]
    rows: list[str]


def series_of(text: str) -> list[Series]:
    """Return all series of a text; [] for a text of another program."""
    if "Columns:" not in text:
        return []
    all_series, lines = [], text.splitlines()
    for i, line in enumerate(lines):
        columns = _COLUMNS.fullmatch(line.strip())
        if columns and i > 1 and set(lines[i - 1].strip("# ")) == {"-"}:
            name = lines[i - 2].strip("# ")
            unit = _UNIT.fullmatch(columns[2])
            rows = []
            for row in lines[i + 1 :]:
                if not row.strip() or row.lstrip().startswith("#"):
                    break
                rows.append(row)
            all_series.append(Series(name, (columns[1], f"{name} {unit[1] if unit else ''}".strip()), rows))
    return all_series


def first_series(path: StrPath, text: str) -> str:
    """Return a text in which the first series is a table with titles, and warn about other series.

    The title of the second column is the name of the series. Texts without series are unchanged.
    """
    series = series_of(text)
    if not series:
        return text
    name, titles, rows = series[0]
    if len(series) > 1:
        others = listed([repr(other.name) for other in series[1:]])
        warn_caller(
            f"{path}: {name!r} is read, the first of {len(series)} series; the others are {others}",
            UserWarning,
        )
    return "\n".join(["\t".join(titles), *("\t".join(row.split()) for row in rows)]) + "\n"
