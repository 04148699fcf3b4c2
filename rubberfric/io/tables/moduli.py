"""E' and E'' of a table that has other moduli, or tan(delta) = E''/E'."""

from collections.abc import Collection

import numpy as np

from rubberfric.base.units import young_from_shear
from rubberfric.io.tables.columns import COLUMNS


def with_moduli(
    where: str,
    table: dict[str, np.ndarray],
    needed: Collection[str],
    optional: Collection[str],
    poisson: float | None,
    strict: bool,
) -> dict[str, np.ndarray]:
    """The table with E_stor and E_loss, if they are asked for, from what else it has."""
    shear = [name for name in ("G_stor", "G_loss", "G_comp") if name in table]
    young = [name for name in ("E_stor", "E_loss", "E_comp") if name in table]
    if shear and not young:
        if poisson is None:
            raise ValueError(
                f"{where}: {', '.join(shear)} are shear moduli: poisson must be given, E = 2 (1 + poisson) G"
            )
        for name in shear:
            table["E" + name[1:]] = young_from_shear(table[name], poisson)
    elif poisson is not None and strict:
        raise ValueError(f"{where}: poisson = {poisson!r}: must not be given; the table has no shear moduli")
    if "tan_del" in table:
        tangent = table["tan_del"]
        if "E_stor" not in table and "E_comp" in table:
            table["E_stor"] = table["E_comp"] / np.hypot(1, tangent)
        if "E_loss" not in table and "E_stor" in table:
            table["E_loss"] = table["E_stor"] * tangent
    return {name: values for name, values in table.items() if name in (*needed, *optional)}


def missing(where: str, quantity: str) -> str:
    """Message on a table that has no column of a quantity."""
    spellings = [name for name, column in COLUMNS.items() if column.name == quantity and column.offered]
    return f"{where}: no column {' or '.join(spellings)}: the table must have one"
