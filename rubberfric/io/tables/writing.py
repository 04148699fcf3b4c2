"""CSV tables with two header rows, names and units, in SI."""

import csv
from collections.abc import Mapping

import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.atomic import StrPath, replacing
from rubberfric.io.tables.columns import COLUMNS


def write_table(path: StrPath, table: Mapping[str, ArrayLike], comment: str = "") -> None:
    """Write columns in SI (a dict of name -> sequence, names as in `COLUMNS`) as a CSV file.

    Numbers have as many digits as it takes to read the same ones back. `comment` goes to
    the top, each line behind a #. ValueError if a name is not known in SI, if lengths differ
    or if a value is one that `read_table` refuses.
    """
    for name in table:
        if name not in COLUMNS or COLUMNS[name].name != name:
            known = sorted({column.name for column in COLUMNS.values()})
            raise ValueError(f"{path}: column {name!r}: must be one of {', '.join(known)}")
    columns = {name: np.asarray(values, float) for name, values in table.items()}
    lengths = {name: values.shape for name, values in columns.items()}
    if len(set(lengths.values())) != 1 or any(len(shape) != 1 for shape in lengths.values()):
        raise ValueError(f"{path}: shapes of columns {lengths}: must be one-dimensional and equal")
    for name, values in columns.items():
        for i, value in enumerate(values.tolist()):
            COLUMNS[name].check(f"{path}: {name}[{i}] = {value!r}", value)
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        file.writelines(f"# {line}\n" for line in comment.splitlines())
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerow([next(iter(COLUMNS[name].units)) for name in columns])
        writer.writerows(zip(*(map(repr, values.tolist()) for values in columns.values()), strict=True))
