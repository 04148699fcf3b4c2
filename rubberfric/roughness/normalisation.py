r"""Normalisations of measured power spectra, and spectra along a line.

Programs and papers use these normalisations for the same roughness:

    name                     unit   mean square height               from C
    "C"                      m^4    h^2 = 2 pi int q C dq            C [Persson; Gwyddion, 2D PSDF]
    "C_iso"                  m^4    h^2 = 1/(2 pi) int q C_iso dq    4 pi^2 C
    "q_C_iso_over_pi"        m^3    h^2 = (1/2) int (q C_iso/pi) dq  4 pi q C [contact.engineering]
    "Wr"                     m^3    h^2 = int Wr dq                  2 pi q C [Gwyddion, radial PSDF]
    "C_1D"                   m^3    h^2 = 2 int C_1D dq              see below [Persson]
    "C_1D_surfacetopography" m^3    h^2 = (1/pi) int C_1D dq         2 pi times the line above
    "C_1D_one_sided"         m^3    h^2 = int C_1D dq                2 C_1D
    "W1"                     m^3    h^2 = int W1 dq                  2 C_1D [Gwyddion, one-dimensional PSDF]
    "ISO_8608"               m^3    h^2 = int G_d dn                 4 pi C_1D, n = q / 2 pi in cycles/m

All integrals are from 0 to infinity. contact.engineering and SurfaceTopography use "C_iso", "q_C_iso_over_pi"
and "C_1D_surfacetopography" [Jacobs, Junge, Pastewka, Surf. Topogr.: Metrol. Prop. 5 (2017) 013001]. C_1D is
two-sided: half of the mean square height is at q < 0. The displacement spectral density of ISO 8608 and
ISO 13473-4 is one-sided. Over n in cycles/m, "C_iso" is the density of a surface, h^2 = 2 pi int n C_iso dn,
and "C_1D_surfacetopography" is the two-sided density along a line, h^2 = 2 int C dn.

A spectrum along a line is the projection of C, and C at q depends on C_1D at all larger wavevectors.
`rubberfric.roughness.areal_spectrum` inverts the projection. For a power law without ends the projection is a
factor (`spectrum_from` with `hurst`), which is wrong at a roll-off, on a plateau and within a factor 2 of a
cutoff.
"""

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import (
    FINITE,
    POSITIVE,
    ArrayLike,
    as_array,
    as_leaf,
    between,
    check_unmasked,
    check_values,
    is_concrete,
    shape_of,
    shown,
    warn_caller,
)
from rubberfric.roughness.lines import areal_spectrum
from rubberfric.roughness.moments import rms_height
from rubberfric.roughness.projections import projected_table
from rubberfric.roughness.tabulated import TabulatedSpectrum


class Normalisation(NamedTuple):
    """Definition of a spectrum."""

    factor: float  # of C, of q C if `radial`, and of the two-sided C_1D over q if `line`
    height: str  # mean square height
    programs: str = ""  # programs that write it
    line: bool = False  # along a line
    radial: bool = False  # density of abs(q) over all directions
    cycles: bool = False  # defined over n in cycles/m instead of q


NORMALISATIONS = {
    "C": Normalisation(1.0, "2 pi int q C dq"),
    "C_iso": Normalisation(4 * math.pi**2, "1/(2 pi) int q C_iso dq", "SurfaceTopography"),
    "q_C_iso_over_pi": Normalisation(
        4 * math.pi, "(1/2) int (q C_iso/pi) dq", "contact.engineering", radial=True
    ),
    "Wr": Normalisation(2 * math.pi, "int Wr dq", "Gwyddion, radial", radial=True),
    "C_1D": Normalisation(1.0, "2 int C_1D dq", line=True),
    "C_1D_surfacetopography": Normalisation(
        2 * math.pi, "(1/pi) int C_1D dq", "SurfaceTopography, contact.engineering", line=True
    ),
    "C_1D_one_sided": Normalisation(2.0, "int C_1D dq", line=True),
    "W1": Normalisation(2.0, "int W1 dq", "Gwyddion", line=True),
    "ISO_8608": Normalisation(4 * math.pi, "int G_d dn, n in cycles/m", line=True, cycles=True),
}
LINES = tuple(name for name, about in NORMALISATIONS.items() if about.line)
NORMALISATION_RULE = "must be " + ", ".join(
    f'"{name}" (h_rms^2 = {about.height}{about.programs and "; "}{about.programs})'
    for name, about in NORMALISATIONS.items()
)

# Titles of densities that name their normalisation.
_NAMED = {name: name for name in ("W1", "Wr", "q_C_iso_over_pi", "C_1D_surfacetopography")}
_NAMED["G_d"] = "ISO_8608"
# Equal normalisations.
_EQUAL = {"W1": ("W1", "C_1D_one_sided")}
# Texts above a table that name its normalisation.
_HEADERS = (
    *((re.compile(rf'\bnormalisation[ =:]+"?{name}\b'), name) for name in NORMALISATIONS),
    (re.compile(r"\bISO[ /-]*(?:TS[ -]*)?(?:8608|13473-4)\b"), "ISO_8608"),
)
# Normalisations over angular wavevectors, and the one over cycles/m that the same numbers would have.
_ANGULAR = {
    "C": '"C_iso" (h_rms^2 = 2 pi int n C dn)',
    "C_1D": '"C_1D_surfacetopography" (two-sided, h_rms^2 = 2 int C dn) or "ISO_8608" (one-sided)',
    "C_1D_one_sided": '"ISO_8608" (h_rms^2 = int G_d dn)',
    "W1": '"ISO_8608" (h_rms^2 = int G_d dn)',
}

# Width of bands in lg n, by their number per octave [IEC 61260, base ten].
_BAND_WIDTHS = {1: 0.3, 3: 0.1}
# Largest deviation of a nominal wavelength, such as 63 mm or 125 mm, from an exact one, in lg.
_NOMINAL = 0.02
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
    normalisation : "C", "C_iso", "q_C_iso_over_pi", "Wr", or along a line "C_1D", "C_1D_one_sided",
        "C_1D_surfacetopography", "W1" or "ISO_8608", see the module's docstring
    q : wavevectors [1/m], any shape; q = 2 pi n for a spectrum over cycles per metre
    values : spectrum in that normalisation, [m^4], or [m^3] for densities of abs(q) and along a line
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

    Examples
    --------
    >>> C = rf.roughness.spectrum_from("C_iso", np.array([1e3, 1e4]), np.array([4e-13, 1e-16]))
    >>> [f"{float(x):.4g}" for x in C]  # in m^4
    ['1.013e-14', '2.533e-18']
    """
    check_unmasked("q", q)
    check_unmasked("values", values)
    if normalisation in LINES and hurst is None and len(shape_of(q)) == len(shape_of(values)) == 1:
        return areal_spectrum(q, as_array(values) / NORMALISATIONS[normalisation].factor, relative).C
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
    """Return the column of a table with a spectrum in this normalisation: C [m^4] or C_1D [m^3].

    Examples
    --------
    >>> rf.roughness.density_column("C_iso"), rf.roughness.density_column("ISO_8608")
    ('C', 'C_1D')
    """
    about = NORMALISATIONS.get(normalisation)
    return "C_1D" if about is not None and (about.line or about.radial) else "C"


def spectrum_as(normalisation: str, q: ArrayLike, C: ArrayLike, hurst: ArrayLike | None = None) -> jax.Array:
    """Convert a spectrum C(q) [m^4] to another normalisation.

    This function is the inverse of `spectrum_from`. Without `hurst`, a spectrum along a line is the exact
    projection of the log-log linear table (q, C), which has no waves below q[0] and continues beyond q[-1]
    with the slope of its last piece.

    Raises
    ------
    ValueError : as in `spectrum_from`. Along a line without H, q must be a table that increases.

    Examples
    --------
    >>> C_1D = rf.roughness.spectrum_as("C_1D", 1e4, 1e-17, hurst=0.8)
    >>> f"{float(C_1D):.4g}"  # in m^3
    '1.708e-13'
    """
    if normalisation in LINES and hurst is None and len(shape_of(q)) == len(shape_of(C)) == 1:
        return NORMALISATIONS[normalisation].factor * projected_table(q, C)
    return jnp.asarray(C) * _factor(normalisation, q, hurst)


def heights_by_normalisation(q: ArrayLike, values: ArrayLike) -> dict[str, float]:
    """Return the rms height of a table [m] for each normalisation that its values might have.

    Use it if a program does not state its definition. The right normalisation gives the rms height Sq or Rq
    of the same heights. A table along a line gives a slightly smaller height, because its waves below q[0]
    are missing.

    Parameters
    ----------
    q : wavevectors, strictly increasing, > 0 [1/m], shape (n,); q = 2 pi n for a table over n in cycles/m
    values : spectrum, > 0, log-log linear between its entries, [m^4] or [m^3], shape (n,)

    Examples
    --------
    >>> q = np.geomspace(1e3, 1e6, 50)
    >>> heights = rf.roughness.heights_by_normalisation(q, 1e-3 * q**-2.6)
    >>> min(heights, key=lambda name: abs(np.log(heights[name] / 1.4e-4)))  # Sq is 0.14 mm
    'C_1D'
    """
    q, values = jnp.asarray(q), jnp.asarray(values)
    heights = {}
    for name, about in NORMALISATIONS.items():
        # The mean square height 2 int C_1D dq is 2 pi int q C dq of C = C_1D / (pi q).
        scale = about.factor * (math.pi * q if about.line else q if about.radial else 1.0)
        heights[name] = float(rms_height(TabulatedSpectrum(q, values / scale)))
    return heights


def density_of_levels(
    wavelength: ArrayLike, level: ArrayLike, *, per_octave: int = 3
) -> tuple[np.ndarray, np.ndarray]:
    r"""Return q [1/m] and G_d [m^3] from texture levels in bands [ISO 13473-2, ISO 13473-4].

    .. math:: L = 10 \lg \frac{\int_\mathrm{band} G_d\, dn}{(10^{-6}\,\mathrm{m})^2},\qquad
              q = \frac{2\pi}{\lambda}

    Bands are a factor 10^(0.3 / per_octave) wide. Within a band, G_d is a power law with the slope of the
    neighbouring bands, and exact for a power law.

    Parameters
    ----------
    wavelength : centres of neighbouring bands [m], shape (n,), n >= 2, in any order; nominal values such as
        63 mm are replaced by the exact 10^1.8 mm
    level : texture level [dB] relative to 1e-6 m, shape (n,)
    per_octave : 3 for one-third-octave bands, 1 for octave bands

    Returns
    -------
    Tuple of q, increasing, and the one-sided displacement density G_d, whose normalisation is "ISO_8608"

    Raises
    ------
    ValueError : if shapes differ, values are invalid, or the wavelengths are not those of neighbouring bands.

    Examples
    --------
    >>> q, G_d = rf.roughness.density_of_levels([80e-3, 63e-3, 50e-3, 40e-3], [58.0, 57.5, 56.8, 56.0])
    >>> C = rf.roughness.spectrum_from("ISO_8608", q, G_d)
    """
    if isinstance(per_octave, bool) or per_octave not in _BAND_WIDTHS:
        raise ValueError(f"per_octave = {shown(per_octave)}: must be 3 or 1")
    wave, L = (np.asarray(as_leaf(name, x, 1)) for name, x in (("wavelength", wavelength), ("level", level)))
    check_values("wavelength", wave, POSITIVE)
    check_values("level", L, FINITE)
    if wave.shape != L.shape or wave.size < 2:
        raise ValueError(f"wavelength {wave.shape}, level {L.shape}: must have equal lengths, at least 2")
    order, width = np.argsort(-wave), _BAND_WIDTHS[per_octave]
    band = np.round(np.log10(wave[order]) / width)
    off = np.abs(np.log10(wave[order]) / width - band)
    if off.max() > _NOMINAL / width or not (np.diff(band) == -1).all():
        raise ValueError(
            f"wavelength = {shown(wave.tolist())}: must be centres of neighbouring bands, 10^(k {width:g}) m"
        )
    n = 10.0 ** (-width * band)
    square = 1e-12 * 10.0 ** (L[order] / 10)
    # G_d ~ n^(slope - 1) has the integral n G_d 2 sinh(slope w / 2) / slope over a band of width w in ln n.
    slope, w = np.gradient(np.log(square), np.log(n)), width * math.log(10)
    near = np.abs(slope) < 1e-6
    integral = np.where(near, w, 2 * np.sinh(slope * w / 2) / np.where(near, 1.0, slope))
    return 2 * math.pi * n, square / (n * integral)


def find_normalisation(
    path: object, names: Sequence[str], normalisation: str | None = None, header: str = ""
) -> str:
    """Return the normalisation of a table of a spectrum: the given one, or the one that its titles name.

    A density must be over the axis of its table, or it differs by 2 pi from its definition.

    Parameters
    ----------
    path : name of the table in messages
    names : names of the columns, from `rubberfric.io.read_names`
        W1 and Wr of Gwyddion, G_d of ISO 8608, and the names of contact.engineering name the normalisation.
        q and k are in rad/m, n in cycles/m.
    normalisation : given one, or None
    header : text above the table, in which "normalisation C_1D", "ISO 8608" and "ISO 13473-4" name it

    Raises
    ------
    ValueError : the normalisation is missing, contradicts the title, or is over another axis than the table.

    Examples
    --------
    >>> rf.roughness.find_normalisation("road.csv", ["n", "G_d"])
    'ISO_8608'
    """
    titles = [name for name in names if name in _NAMED]
    own = _NAMED[titles[0]] if titles else None
    above = next((name for pattern, name in _HEADERS if pattern.search(header)), None)
    chosen = next((name for name in (normalisation, own, above) if name is not None), None)
    if chosen is None:
        raise ValueError(f"{path}: normalisation is missing: {NORMALISATION_RULE}")
    if own is not None and chosen not in _EQUAL.get(own, (own,)):
        raise ValueError(
            f'{path}: normalisation = "{chosen}": the column {titles[0]} is in the normalisation "{own}";'
            " leave the argument out, or rename the column C_1D"
        )
    if "n" in names and chosen in _ANGULAR:
        raise ValueError(
            f'{path}: normalisation = "{chosen}": is over q = 2 pi / wavelength, but the table is over'
            f" cycles/m; must be {_ANGULAR[chosen]}, or convert both columns to q"
        )
    angular = {"q", "k", "log10_q"} & set(names)
    if chosen == "ISO_8608" and angular:
        raise ValueError(
            f'{path}: normalisation = "ISO_8608": is over n in cycles/m, but the column {angular.pop()} is in'
            ' rad/m; must be "C_1D_one_sided" if the density is over rad/m, otherwise convert the column to'
            " n [cycles/m]"
        )
    return chosen


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
    scale = NORMALISATIONS[normalisation].factor
    if NORMALISATIONS[normalisation].radial:
        return scale * jnp.asarray(q)
    if normalisation not in LINES:
        return scale
    H = jnp.asarray(hurst)
    ratio = jnp.exp(jax.scipy.special.gammaln(H + 0.5) - jax.scipy.special.gammaln(H + 1))
    return scale * math.sqrt(math.pi) * ratio * jnp.asarray(q)
