r"""Normalisations of measured power spectra, and spectra along a line.

Programs and papers use these normalisations for the same roughness:

    name                     unit   mean square height               from C
    "C"                      m^4    h^2 = 2 pi int q C dq            C [Persson]
    "C_iso"                  m^4    h^2 = (1/2 pi) int q C_iso dq    4 pi^2 C
    "C_1D"                   m^3    h^2 = 2 int C_1D dq              see below [Persson]
    "C_1D_surfacetopography" m^3    h^2 = (1/pi) int C_1D dq         2 pi times the line above
    "C_1D_one_sided"         m^3    h^2 = int C_1D dq                2 C_1D
    "W1"                     m^3    h^2 = int W1 dq                  2 C_1D [Gwyddion, one-dimensional PSDF]
    "ISO_8608"               m^3    h^2 = int G_d dn                 4 pi C_1D, n = q / 2 pi in cycles/m
    "Wr"                     m^3    h^2 = int Wr dq                  2 pi q C [Gwyddion, radial PSDF]

All integrals are from 0 to infinity. contact.engineering and SurfaceTopography use C_iso and the fourth row
[Jacobs, Junge, Pastewka, Surf. Topogr.: Metrol. Prop. 5 (2017) 013001]. C_1D is two-sided: half of the mean
square height is at q < 0. The displacement spectral density of ISO 8608 and ISO 13473-4 is one-sided.

A spectrum along a line is the projection of C, and C at q depends on C_1D at all larger wavevectors.
`rubberfric.roughness.areal_spectrum` inverts the projection. For a power law without ends the projection is a
factor (`spectrum_from` with `hurst`), which is wrong at a roll-off, on a plateau and within a factor 2 of a
cutoff.
"""

import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import (
    as_array,
    as_leaf,
    between,
    check_values,
    is_concrete,
    shown,
    warn_caller,
)
from rubberfric.roughness.lines import areal_spectrum

# Factors of C. For a line they follow the self-affine factor, and for Wr the factor q.
NORMALISATIONS = {
    "C": 1.0,
    "C_iso": 4 * math.pi**2,
    "C_1D": 1.0,
    "C_1D_surfacetopography": 2 * math.pi,
    "C_1D_one_sided": 2.0,
    "W1": 2.0,
    "ISO_8608": 4 * math.pi,
    "Wr": 2 * math.pi,
}
LINES = ("C_1D", "C_1D_surfacetopography", "C_1D_one_sided", "W1", "ISO_8608")
NORMALISATION_RULE = (
    'must be "C" (h_rms^2 = 2 pi int q C dq), "C_iso" (contact.engineering, 4 pi^2 times C), "C_1D"'
    ' (along a line, h_rms^2 = 2 int C_1D dq), "C_1D_surfacetopography" (2 pi times C_1D), "C_1D_one_sided"'
    ' or "W1" (Gwyddion, h_rms^2 = int W1 dq), "Wr" (Gwyddion, radial, h_rms^2 = int Wr dq) or "ISO_8608"'
    " (h_rms^2 = int G_d dn, n in cycles/m)"
)

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

# C_1D falls more slowly than this share of the slope of a self-affine surface, -(1 + 2 H), before a roll-off.
_FLAT = 0.5
# The slope at the beginning of a table is fitted over this factor of q. A roll-off from about 2 q[0] on is
# found.
_BEGINNING = 3.0
# Smallest number of entries of this fit, because single modes scatter by a factor of 2.
_LEAST = 5


def spectrum_from(
    normalisation: str,
    q: ArrayLike,
    values: ArrayLike,
    hurst: ArrayLike | None = None,
    *,
    relative: ArrayLike | None = None,
) -> jax.Array:
    r"""Return C(q) from a spectrum in another normalisation.

    .. math:: C = \frac{C_\mathrm{iso}}{4\pi^2},\qquad
              C = \frac{C_\mathrm{1D}}{q}\, \frac{\Gamma(1 + H)}{\sqrt\pi\, \Gamma(H + 1/2)}

    Parameters
    ----------
    normalisation : "C", "C_iso", "Wr", or along a line "C_1D", "C_1D_one_sided", "C_1D_surfacetopography",
        "W1" or "ISO_8608", see the module's docstring
    q : wavevectors [1/m], any shape; q = 2 pi n for a spectrum over cycles per metre
    values : spectrum in that normalisation, [m^4], or [m^3] for Wr and along a line
    hurst : H [-], 0 ... 1, only along a line
        The surface is assumed self-affine without a roll-off. None uses `areal_spectrum`, for a table that
        increases in q.
    relative : standard errors of ln(values) [-], only for `areal_spectrum`, or None if they are unknown

    Returns
    -------
    C [m^4], h_rms^2 = 2 pi int q C dq

    Raises
    ------
    ValueError : if the normalisation is unknown, if entries are masked, or if H is outside 0 ... 1 or not
        needed. Without H along a line, also for single values, and for tables that `areal_spectrum` refuses.

    Notes
    -----
    The factor for a line is exact for C ~ q^(-2(1 + H)) without ends. Below the roll-off its error is of the
    order of q_r/q. Within a factor 2 of a cutoff C is too small. The rms height is 1.09 to 1.40 times too
    large if there is a roll-off. A UserWarning says so if a table along a line begins with a slope of less
    than half of -(1 + 2 H). `areal_spectrum` makes no such assumption.
    """
    if np.ma.is_masked(values) or np.ma.is_masked(q):
        raise ValueError("q or values has masked entries; leave them out, q[~values.mask]")
    if normalisation in LINES and hurst is None and jnp.ndim(q) == 1 and jnp.ndim(values) == 1:
        return areal_spectrum(q, as_array(values) / NORMALISATIONS[normalisation], relative).C
    factor = _factor(normalisation, q, hurst)
    if normalisation in LINES and is_concrete(q) and is_concrete(values) and is_concrete(hurst):
        _warn_of_rolloff(np.asarray(q, float), np.asarray(values, float), hurst)
    return as_array(values) / factor


def _warn_of_rolloff(q, values, hurst):
    """Warn if C_1D falls slowly at the beginning of a table, where the factor of a power law is wrong."""
    if q.ndim != 1 or values.shape != q.shape or q.size < _LEAST or not ((q > 0) & (values > 0)).all():
        return
    order = np.argsort(q)
    q, values = q[order], values[order]
    count = max(int(np.sum(q <= _BEGINNING * q[0])), _LEAST)
    slope = np.polyfit(np.log(q[:count]), np.log(values[:count]), 1)[0]
    if slope > -_FLAT * (1 + 2 * float(np.max(hurst))):
        warn_caller(
            f"hurst = {shown(hurst)}: C_1D falls only as q^{slope:.2g} from q = {q[0]:.3g} 1/m on because of"
            " a roll-off, and the rms height becomes up to 1.4 times too large; leave hurst out",
            UserWarning,
        )


def density_column(normalisation: str) -> str:
    """Return the column of a table with a spectrum in this normalisation: C [m^4] or C_1D [m^3]."""
    return "C_1D" if normalisation in (*LINES, "Wr") else "C"


def spectrum_as(normalisation: str, q: ArrayLike, C: ArrayLike, hurst: ArrayLike | None = None) -> jax.Array:
    """Convert a spectrum C(q) [m^4] to another normalisation.

    This function is the inverse of `spectrum_from`.
    """
    return jnp.asarray(C) * _factor(normalisation, q, hurst)


def find_normalisation(path: object, names: Sequence[str], normalisation: str | None = None) -> str:
    """Return the normalisation of a table of a spectrum: the given one, or the one that its titles name.

    A density must be over the axis of its table, or it differs by 2 pi from its definition.

    Parameters
    ----------
    path : name of the table in messages
    names : names of the columns, from `rubberfric.io.read_names`
        W1, Wr and G_d name the normalisations "W1", "Wr" and "ISO_8608". q and k are in rad/m, n in cycles/m.
    normalisation : given one, or None

    Raises
    ------
    ValueError : the normalisation is missing, contradicts the title, or is over another axis than the table.
    """
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


def check_normalisation(
    normalisation: str,
    hurst: ArrayLike | None,
    what: str = "normalisation",
    where: str = "hurst",
    table: bool = False,
) -> None:
    """Raise ValueError if a normalisation is unknown, or if `hurst` is missing, invalid or not needed.

    `what` and `where` are the names of the two arguments in the message. A `table` along a line does not need
    `hurst`.
    """
    if not isinstance(normalisation, str) or normalisation not in NORMALISATIONS:
        raise ValueError(f"{what} = {shown(normalisation)}: {NORMALISATION_RULE}")
    if normalisation not in LINES:
        if hurst is not None:
            raise ValueError(
                f'{where} = {shown(hurst)}: must be absent; {what} = "{normalisation}" needs no'
                " Hurst exponent"
            )
        return
    if hurst is None and table:
        return
    if hurst is None:
        raise ValueError(
            f'{where} is missing: must be given, 0 ... 1; {what} = "{normalisation}" is converted'
            " with the factor of a self-affine surface"
        )
    check_values(where, as_leaf(where, hurst, 0), between(0.0, 1.0))


def _factor(normalisation, q, hurst):
    check_normalisation(normalisation, hurst)
    scale = NORMALISATIONS[normalisation]
    if normalisation == "Wr":
        return scale * jnp.asarray(q)
    if normalisation not in LINES:
        return scale
    H = jnp.asarray(hurst)
    ratio = jnp.exp(jax.scipy.special.gammaln(H + 0.5) - jax.scipy.special.gammaln(H + 1))
    return scale * math.sqrt(math.pi) * ratio * jnp.asarray(q)
