"""Tables of power spectra in the normalisations of other programs.

The axis is an angular wavevector q = 2 pi / wavelength, or a spatial frequency n = 1 / wavelength in
cycles/m. A density must be over the axis of its table, or differs by 2 pi from its definition.
"""

from collections.abc import Sequence
from typing import Any

from rubberfric.base.atomic import StrPath
from rubberfric.io.tables import read_names, read_table
from rubberfric.roughness.normalisation import NORMALISATION_RULE, density_column

# Titles of densities that name their normalisation.
_NAMED = {"W1": "W1", "Wr": "Wr", "G_d": "ISO_8608"}
# Equal normalisations.
_EQUAL = {"W1": ("W1", "C_1D_one_sided")}
# Normalisations over angular wavevectors, and the one over cycles/m that the same numbers would have.
_ANGULAR = {
    "C": '"C_iso" (h_rms^2 = 2 pi int n C dn)',
    "C_1D": '"C_1D_surfacetopography" (two-sided, h_rms^2 = 2 int C dn) or "ISO_8608" (one-sided)',
    "C_1D_one_sided": '"ISO_8608" (h_rms^2 = int G_d dn)',
    "W1": '"ISO_8608" (h_rms^2 = int G_d dn)',
}
# Meaning of 1/m in a column "wavenumber".
_WAVENUMBERS = {"ISO_8608": "cycles", "W1": "rad", "Wr": "rad", "C_1D_one_sided": "rad"}


def find_normalisation(path: StrPath, normalisation: str | None, columns: list[str] | None = None) -> str:
    """Return the normalisation of a table of a spectrum: the given one, or the one that its titles name.

    Titles W1, Wr and Gd name "W1", "Wr" and "ISO_8608".

    Raises
    ------
    ValueError : the normalisation is missing, contradicts the title, or is over another axis than the table.
    """
    names = read_names(path, columns)
    titles = [name for name in names if name in _NAMED]
    own = _NAMED[titles[0]] if titles else None
    if normalisation is None and own is None:
        raise ValueError(f"{path}: normalisation is missing: {NORMALISATION_RULE}")
    found = normalisation if normalisation is not None else own
    assert found is not None
    if own is not None and found not in _EQUAL.get(own, (own,)):
        raise ValueError(
            f'{path}: normalisation = "{found}": the column {titles[0]} is in the normalisation "{own}";'
            " leave the argument out, or rename the column C_1D"
        )
    if "n" in names and found in _ANGULAR:
        raise ValueError(
            f'{path}: normalisation = "{found}": is over q = 2 pi / wavelength, but the table is over'
            f" cycles/m; must be {_ANGULAR[found]}, or convert both columns to q"
        )
    angular = {"q", "k", "log10_q"} & set(names)
    if found == "ISO_8608" and angular:
        raise ValueError(
            f'{path}: normalisation = "ISO_8608": is over n in cycles/m, but the column {angular.pop()} is in'
            ' rad/m; must be "C_1D_one_sided" if the density is over rad/m, otherwise convert the column to'
            " n [cycles/m]"
        )
    return found


def read_density(
    path: StrPath,
    normalisation: str,
    optional: Sequence[str] = (),
    columns: list[str] | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Read q [1/m] and the density of a spectrum in a normalisation, as the column C or C_1D.

    Parameters
    ----------
    path, columns, optional, options : as for `read_table`
    normalisation : result of `find_normalisation`

    Returns
    -------
    dict with the keys "q", "C" (the density, [m^4] or [m^3]), and the optional columns of the table
    """
    density, meaning = density_column(normalisation), _WAVENUMBERS.get(normalisation)
    table = read_table(path, ("q", density), optional, columns=columns, wavenumber=meaning, **options)
    return {("C" if name == density else name): values for name, values in table.items()}
