"""Writing of text tables in SI units, which `rubberfric.io.read_table` reads."""

from collections.abc import Mapping

import numpy as np

from rubberfric.base.atomic import StrPath, write_text
from rubberfric.base.checks import ArrayLike, shown
from rubberfric.io.columns import COLUMNS


def write_table(path: StrPath, table: Mapping[str, ArrayLike], comment: str = "") -> None:
    """Write columns in SI as a CSV file.

    Parameters
    ----------
    path : file
    table : mapping from name in SI (see `COLUMNS`) to a sequence. All sequences must have equal length.
        Numbers are written with all digits, so that they are read back unchanged.
    comment : lines at the top of the file, written behind #

    Raises
    ------
    ValueError : an unknown name, unequal lengths, or a value that `read_table` refuses

    Examples
    --------
    >>> rf.io.write_table("shift.csv", {"T": [273.15, 293.15], "aT": [70.2, 1.0]}, comment="by DMA")
    >>> with open("shift.csv") as file:
    ...     print(file.read(), end="")
    # by DMA
    T,aT
    K,-
    273.15,70.2
    293.15,1.0
    """
    try:
        text = table_text(table)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    write_text(path, "".join(f"# {line}\n" for line in comment.splitlines()) + text)


def table_text(table: Mapping[str, ArrayLike]) -> str:
    """Return columns in SI as the CSV text that `write_table` writes."""
    for name in table:
        if name not in COLUMNS or COLUMNS[name].name != name:
            known = sorted({column.name for column in COLUMNS.values()})
            raise ValueError(f"column {name!r}: must be one of {', '.join(known)}")
    columns = {}
    for name, values in table.items():
        try:
            columns[name] = np.asarray(values, float)
        except (TypeError, ValueError):
            raise ValueError(f"column {name!r} = {shown(values)}: must be numbers") from None
    lengths = {name: values.shape for name, values in columns.items()}
    if len(set(lengths.values())) != 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise ValueError(f"shapes of columns {lengths}: must be one-dimensional and equal")
    for name, values in columns.items():
        for i, value in enumerate(values.tolist()):
            COLUMNS[name].check(f"{name}[{i}] = {value!r}", value)
    units = [next(iter(COLUMNS[name].units)) for name in columns]
    rows = zip(*(map(repr, values.tolist()) for values in columns.values()), strict=True)
    return "".join(f"{','.join(row)}\n" for row in (columns, units, *rows))
