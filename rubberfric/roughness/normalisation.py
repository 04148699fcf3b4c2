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

The spectra along a line and of the surface are related by Abel's transform,

.. math:: C_\mathrm{1D}(q) = \int_{-\infty}^\infty dq_y\, C\big(\sqrt{q^2 + q_y^2}\big),\qquad
          C(q) = -\frac{1}{\pi} \int_q^\infty \frac{C_\mathrm{1D}'(x)}{\sqrt{x^2 - q^2}}\, dx

(`line_spectrum`, `areal_spectrum`). C at q depends on C_1D at all larger wavevectors. For a power law
without ends the transform is a factor (`spectrum_from` with `hurst`), which is wrong at a roll-off, on a
plateau and within a factor 2 of a cutoff.
"""

import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import (
    POSITIVE,
    as_array,
    as_leaf,
    between,
    check_increasing,
    check_lengths,
    check_values,
    is_concrete,
    shown,
)
from rubberfric.base.objects.physical import check_kind
from rubberfric.base.quadrature import gauss, typed
from rubberfric.roughness.spectra import Spectrum, log_ratio, mean_growth

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

# Gauss nodes of Abel's kernel between q and 2 q.
_NODES = 24
# Terms of the series of Abel's kernel beyond 2 q. Each is at most 1/4 of the previous one, the last 2e-16.
_TERMS = 27


def spectrum_from(
    normalisation: str, q: ArrayLike, values: ArrayLike, hurst: ArrayLike | None = None
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
        The surface is assumed self-affine. None uses `areal_spectrum`, for a table that increases in q.

    Returns
    -------
    C [m^4], h_rms^2 = 2 pi int q C dq

    Raises
    ------
    ValueError : if the normalisation is unknown, if entries are masked, or if H is outside 0 ... 1 or not
        needed. Without H along a line, also for single values, and if noise makes C negative.

    Notes
    -----
    The factor for a line is exact for C ~ q^(-2(1 + H)) without ends. Below the roll-off its error is of the
    order of q/q_r. Within a factor 2 of a cutoff C is too small. `areal_spectrum` makes no such assumption.
    """
    if np.ma.is_masked(values) or np.ma.is_masked(q):
        raise ValueError("q or values has masked entries; leave them out, q[~values.mask]")
    if normalisation in LINES and hurst is None and jnp.ndim(q) == 1 and jnp.ndim(values) == 1:
        scale = NORMALISATIONS[normalisation]
        C = areal_spectrum(q, as_array(values) / scale)
        if is_concrete(C) and not np.all(np.asarray(C) > 0):
            i = int(np.argmin(np.asarray(C) > 0))
            raise ValueError(
                f"hurst is missing: C is not positive at q = {float(as_array(q)[i]):.4g} 1/m because of noise"
                " in the spectrum along a line; must be given, 0 ... 1, or smooth the spectrum"
            )
        return C
    return as_array(values) / _factor(normalisation, q, hurst)


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


def line_spectrum(spectrum: Spectrum, q: ArrayLike) -> jax.Array:
    r"""Return the spectrum along a line of an isotropic surface, exact for its broken power law.

    .. math:: C_\mathrm{1D}(q) = 2 \int_q^\infty \frac{C(x)\, x}{\sqrt{x^2 - q^2}}\, dx,\qquad
              h_\mathrm{rms}^2 = 2 \int_0^\infty C_\mathrm{1D}\, dq

    Parameters
    ----------
    spectrum : SelfAffine or TabulatedSpectrum
    q : wavevectors along the line, > 0 [1/m], any shape
        Below the spectrum's range C_1D tends to a constant. Above the range C_1D is 0.

    Returns
    -------
    C_1D [m^3], shape of q, with errors of 1e-13 for slopes d ln C / d ln q of -20 ... 20

    Notes
    -----
    C_1D is differentiable with respect to the spectrum and q, except at the ends of C, where C_1D is like a
    square root.
    """
    check_kind("spectrum", spectrum, Spectrum)
    return _line_spectrum(spectrum, _positive("q", q))


@jax.jit
def _line_spectrum(spectrum, q):
    law = spectrum.power_law()
    pieces = (law.q[:-1], law.q[1:], law.log_value[:-1], law.exponent, jnp.ones_like(law.exponent))
    return 2 * law.height2 * _abel(q, *pieces)


def areal_spectrum(q: ArrayLike, C_1D: ArrayLike, at: ArrayLike | None = None) -> jax.Array:
    r"""Return the spectrum C of an isotropic surface from C_1D along a line, by Abel's inversion.

    .. math:: C(q) = -\frac{1}{\pi} \int_q^\infty \frac{C_\mathrm{1D}'(x)}{\sqrt{x^2 - q^2}}\, dx

    The result is exact for a table that is log-log linear between its entries and continues beyond the last
    entry with the slope of its last piece.

    Parameters
    ----------
    q : wavevectors along the line, strictly increasing, > 0 [1/m], shape (n,), n >= 2
    C_1D : spectrum along a line, > 0 [m^3], shape (n,), h_rms^2 = 2 int C_1D dq
    at : wavevectors, >= q[0] [1/m], any shape, or None for q

    Returns
    -------
    C [m^4], shape of `at`

    Raises
    ------
    ValueError : if the table is invalid or does not decrease at its end.

    Notes
    -----
    The result is as sensitive to noise as a derivative. C is negative where C_1D increases steeply, which
    does not occur for an isotropic surface. Smooth the table first (`resample`), or use `spectrum_from`.
    """
    q, C_1D = (as_leaf(name, value, 1) for name, value in (("q", q), ("C_1D", C_1D)))
    check_lengths("areal_spectrum", q=q, C_1D=C_1D)
    if q.shape[0] < 2:
        raise ValueError(f"q has {q.shape[0]} entries: must have at least 2")
    for name, value in (("q", q), ("C_1D", C_1D)):
        check_values(name, value, POSITIVE)
    check_increasing("q", q)
    found, end = _areal(q, C_1D, q if at is None else _positive("at", at))
    check_values("slope of C_1D at its end", end, ("must be < 0", lambda x: x < 0))
    return found


@jax.jit
def _areal(q, C_1D, at):
    """Return C [m^4], and d ln C_1D / d ln q of the last piece, which must be negative."""
    log = jnp.log(C_1D)
    slope = jnp.diff(log) / log_ratio(q[1:], q[:-1])
    # The last piece again from the last entry, without an end.
    last = slope[-1:]
    slope = jnp.concatenate([slope, last])
    end = jnp.concatenate([q[1:], jnp.full_like(last, jnp.inf)])
    return _abel(at, q, end, log, slope, -slope) / math.pi, last[0]


def _positive(name, value):
    value = jnp.asarray(value)
    value = value if jnp.issubdtype(value.dtype, jnp.floating) else value.astype(float)
    check_values(name, value, POSITIVE)
    return value


@jax.jit
def _abel(x, start, end, log_value, exponent, weight):
    """Sum weight int f(q) / (q sqrt(q^2 - x^2)) dq over all pieces, where every integral covers q > x.

    In a piece, f is a power of q that equals exp(log_value) at the start of the piece. For q < 2 x, Gauss
    nodes in arcosh(q/x) remove the root. For q > 2 x, the root is a series in (x/q)^2, in which each term is
    a power of q.
    """
    x = x[..., None]
    shape = (*x.shape[:-1], start.shape[0])
    start, end, log_value, exponent = (jnp.broadcast_to(a, shape) for a in (start, end, log_value, exponent))
    u0, u1 = (_arcosh(jnp.clip(border, x, 2 * x), x) for border in (start, end))
    nodes, weights = (typed(table, x) for table in gauss(_NODES))
    u = u0[..., None] + (u1 - u0)[..., None] * nodes
    ratio = jnp.log(jnp.cosh(u)) + jnp.log(x / start)[..., None]
    # An empty piece far from x must not overflow before the multiplication by its width 0.
    ratio = jnp.where((u1 > u0)[..., None], ratio, 0.0)
    near = jnp.exp(log_value[..., None] + exponent[..., None] * ratio) / jnp.cosh(u)
    near = (u1 - u0) * jnp.sum(near * weights, -1) / x
    begin = jnp.maximum(start, 2 * x)
    empty = end <= begin
    begin = jnp.where(empty, start, begin)
    endless = jnp.isinf(end)
    width = log_ratio(jnp.where(endless | empty, begin, end), begin)
    k = np.arange(_TERMS)
    root = typed([math.comb(2 * n, n) / 4.0**n for n in range(_TERMS)], x)
    powers = jnp.exp(typed(2.0 * k, x) * jnp.log(jnp.where(empty, 0.5, x / begin))[..., None])
    order = exponent[..., None] - typed(1.0 + 2 * k, x)
    endless, width = endless[..., None], width[..., None]
    falling = jnp.where(endless, order, -1.0)  # the order of other pieces may be 0
    terms = jnp.where(endless, -1 / falling, width * mean_growth(order * width))
    series = jnp.sum(root * powers * terms, -1)
    far = jnp.exp(log_value + exponent * jnp.log(begin / start)) / begin * series
    return jnp.sum(weight * (near + jnp.where(empty, 0.0, far)), -1)


def _arcosh(q, x):
    """Return arcosh(q / x) for x <= q <= 2 x. The derivative at q = x, which is infinite, is set to 0."""
    excess = (q - x) / x
    beyond = excess > 0
    excess = jnp.where(beyond, excess, 1.0)
    return jnp.where(beyond, jnp.log1p(excess + jnp.sqrt(excess * (excess + 2))), 0.0)
