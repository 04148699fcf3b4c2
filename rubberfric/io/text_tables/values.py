"""Values in SI of the texts of a table, and the check of its units."""

from collections.abc import Collection

import numpy as np

from rubberfric.base.checks import listed, shown, warn_caller
from rubberfric.io.columns import COLUMNS
from rubberfric.io.exports import TextTable


def table_values(
    path: object,
    table: TextTable,
    bad_rows: str | None,
    wanted: Collection[str],
    history: list[str] | None = None,
) -> dict[str, np.ndarray]:
    """Return the values in SI of a table.

    Parameters
    ----------
    path : file or data frame in messages
    table : texts of the columns to read
    bad_rows : "drop" leaves out bad rows with a warning; otherwise a bad row is an error
    wanted : quantities that the caller uses as they are. Others must not be 0 if they are divisors.
    history : receives a text about bad rows that are left out

    Raises
    ------
    ValueError : a row is bad, or no row is left
    """
    bad, rows = list(table.bad), []
    columns = [COLUMNS[name or ""] for name in table.names]
    # The time of a friction record, in contrast to the time of a relaxation, may be 0.
    signed = {"t"} if "v" in wanted else set()
    columns = [
        column._replace(
            nonzero=column.nonzero and column.name not in wanted,
            positive=column.positive and column.name not in signed,
        )
        for column in columns
    ]
    place = table.place
    for line, row in table.rows:
        try:
            values = [
                column.read(f"{path}: {place} {line}: {_short(title)} = {shown(text)}", text, unit)
                for column, title, unit, text in zip(columns, table.titles, table.units, row, strict=True)
            ]
        except ValueError as error:
            bad.append((line, str(error)))
        else:
            rows.append(values)
    if bad:
        bad.sort()
        if bad_rows != "drop":
            hint = "" if bad_rows is None else '; bad_rows="drop" leaves out such rows'
            raise ValueError(f"{bad[0][1]}{hint}")
        if not rows:
            raise ValueError(
                f"{path}: must have a row of valid numbers; {bad[0][1].removeprefix(f'{path}: ')}"
            )
        lines, of = (
            listed([str(line) for line in dict.fromkeys(line for line, _ in bad)], 5),
            len(bad) + len(rows),
        )
        several = "s" if len(bad) > 1 else ""
        text = f"{len(bad)} of {of} rows have bad values and are left out: {place}{several} {lines}"
        warn_caller(f"{path}: {text}", UserWarning)
        if history is not None:
            history.append(text)
    values = np.array(rows, float).reshape(len(rows), len(columns))
    return {column.name: values[:, i] for i, column in enumerate(columns)}


def _short(title: str) -> str:
    return title if len(title) <= 60 else title[:57] + "..."


def check_units(where: str, table: TextTable) -> None:
    """Raise ValueError, beginning with `where`, if a column of a table has an unknown unit."""
    in_percent = {name for name, unit in zip(table.names, table.units, strict=True) if unit == "%"}
    for title, name, unit in zip(table.titles, table.names, table.units, strict=True):
        known = COLUMNS[name or ""].units
        if name == "wavenumber" and unit not in known:
            raise ValueError(
                f"{where}: column {title}: is 2 pi / wavelength or 1 / wavelength: must have the unit rad/m"
                f" or cycles/m, or rad/mm ..., got {unit!r}"
            )
        if unit == "rpm" and name in ("v", "v_travel"):
            raise ValueError(
                f"{where}: column {title}: rpm is a rate of rotation: must be a velocity; multiply it by"
                " 2 pi r / 60 with the radius r of the track [m], and name the unit m/s"
            )
        if name == "sigma" and unit == "%" and not in_percent & {"mu", "A_over_A0"}:
            raise ValueError(
                f"{where}: column {title}: unit '%': must be -, because sigma is not relative; name a"
                " relative error relative_sigma"
            )
        if unit not in known:
            raise ValueError(f"{where}: column {title}: unit {unit!r}: must be one of {', '.join(known)}")
