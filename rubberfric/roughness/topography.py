r"""Power spectra of measured heights: profiles along a line, and height maps.

The functions use NumPy on the host. They are not differentiable and cannot be compiled with jit. Heights are
detrended, multiplied by a window w and transformed,

.. math:: C(\mathbf q) = \frac{\Delta x\, \Delta y}{(2\pi)^2\, N\, \langle w^2\rangle}
                         \Big|\sum_{kl} w_{kl} h_{kl} e^{-i \mathbf q \mathbf x_{kl}}\Big|^2,\qquad
          C_\mathrm{1D}(q) = \frac{\Delta x}{2\pi\, N\, \langle w^2\rangle}
                         \Big|\sum_k w_k h_k e^{-i q x_k}\Big|^2

By Parseval, the sum of C over all modes times their cell dq_x dq_y is <w^2 h^2>/<w^2>, the mean square
height of a homogeneous surface. Modes are then averaged in bins of equal width in log q.

Errors that remain: without a window, the edges of a surface that is not periodic add a false tail, C ~ q^-3
and C_1D ~ q^-2. The window "hann" reduces it to q^-7 and q^-6, below any self-affine surface, but spreads
each mode over its neighbours, so the first two or three modes are unreliable. Detrending removes height from
the same modes. The spectrum contains the instrument's resolution and noise.
"""

from typing import Any

import numpy as np
import scipy

from rubberfric.base.checks import (
    FINITE,
    NONNEGATIVE,
    POSITIVE,
    ArrayLike,
    as_leaf,
    check_choice,
    check_values,
    shown,
)
from rubberfric.roughness.heights import detrended, fill_cavities, tip_cutoff, top_heights, trends
from rubberfric.roughness.measured import InstrumentLimits, MeasuredSpectrum
from rubberfric.roughness.periodograms import Sampling, bins_of_modes, independent_modes, unbiased

WINDOWS = ("hann", "none")
# Highest degree of detrending polynomials in x (and y). More would remove roughness.
_DEGREES = (None, 0, 1, 2)
# Smallest number of points along an axis.
_LEAST = 8
# Largest distance of a position from an even grid, over the spacing.
_EVEN = 0.05


def spectrum_of_profile(
    x: ArrayLike,
    height: ArrayLike,
    *,
    window: str = "hann",
    detrend: int | None = 1,
    per_decade: float | None = 20,
    fill_volume: float | None = None,
    fill_level: float | None = None,
    tops: bool = False,
    tip_radius: float | None = None,
    noise: float | None = None,
) -> MeasuredSpectrum:
    r"""Return the spectrum C_1D(q) of a height profile.

    .. math:: h_\mathrm{rms}^2 = 2\int_0^\infty C_\mathrm{1D}\, dq

    Parameters
    ----------
    x : spacing of the heights, > 0 [m], or positions [m], shape (n,), even to within 5 % of the spacing
    height : heights [m], shape (n,), n >= 8, or (m, n) for m profiles of the same spacing; finite
        Profiles may also be segments of a long profile. C is the mean over all profiles.
    window : "hann", or "none" for a profile with the period n times the spacing
    detrend : degree of the polynomial that is subtracted first, 0, 1 or 2, or None
    per_decade : bins per decade, > 0, or None for every mode separately
    fill_volume, fill_level : volume per area [m], or level above the mean plane [m], up to which water or a
        seal coat fills the cavities (`fill_cavities`); pass at most one
    tops : if True, return the top spectrum C_T of the heights above the mean (`top_heights`)
    tip_radius : radius R of the tip of the instrument [m], which limits `resolved`, or None
        q1 is 2 pi/(2 d) at the distance d where the sharpest peak, max(2 h(x) - h(x + d) - h(x - d))/d^2, has
        the curvature 1/(2 R) [Sanner et al., Appl. Surf. Sci. Adv. 7 (2022) 100190].
    noise : rms height of the noise of the instrument [m], which limits `resolved`, or None
        It is sqrt(1/2) times the rms difference of two measurements of the same place.

    Returns
    -------
    MeasuredSpectrum with q from 2 pi / length to pi / spacing. `areal()` returns the spectrum C(q) of an
    isotropic surface with standard errors, and `table()` a spectrum for a scene.

    Raises
    ------
    ValueError : if an argument is invalid.

    Notes
    -----
    The function runs on the host and is not differentiable. Standard errors of several profiles are too small
    if the profiles are closer to each other than the longest waves.

    For a power law C ~ q^-s, the mean over a bin is 1 + (s ln r)^2/24 times C at the bin's q, where r is the
    ratio of the bin's borders: 1 % too large for s = 4 and 20 bins per decade.

    Examples
    --------
    >>> x, traces = rf.io.read_traces("data/laboratory/stylus.csv")
    >>> measured = rf.roughness.spectrum_of_profile(x, traces, per_decade=10)
    >>> round(1e6 * float(measured.rms_height))  # in µm
    143
    """
    height = _heights(height, 1)
    n = height.shape[-1]
    spacing = _spacing(x, n)
    kx = np.fft.fftfreq(n, spacing) * 2 * np.pi
    height, limits, remarks = _prepared(
        np.atleast_2d(height), (spacing,), detrend, fill_volume, fill_level, tops, tip_radius, noise
    )
    spectrum = _spectrum(height, (spacing,), np.abs(kx), window, detrend, per_decade)
    return spectrum._replace(limits=limits, remarks=remarks)


def spectrum_of_topography(
    heights: ArrayLike,
    dx: ArrayLike,
    dy: ArrayLike | None = None,
    *,
    window: str = "hann",
    detrend: int | None = 1,
    per_decade: float | None = 20,
    fill_volume: float | None = None,
    fill_level: float | None = None,
    tops: bool = False,
    tip_radius: float | None = None,
    noise: float | None = None,
) -> MeasuredSpectrum:
    r"""Return the radially averaged spectrum C(q) of a height map.

    .. math:: h_\mathrm{rms}^2 = 2\pi \int q\, C\, dq

    Parameters
    ----------
    heights : [m], shape (nx, ny), at least 8 x 8; finite
    dx, dy : spacing along the first and the second axis, > 0 [m]; dy None: as dx
    window : "hann" (in x times in y), or "none" for a periodic map
    detrend : degree of the polynomial in x and y that is subtracted first, 0, 1, 2, or None
    per_decade : bins per decade, > 0, or None for every value of `abs(q)` separately
    fill_volume, fill_level, tops, tip_radius, noise : as in `spectrum_of_profile`

    Returns
    -------
    MeasuredSpectrum with q from 2 pi / longer side to pi / larger spacing, where circles are complete.
    `left_out` is the mean square height of the modes in the corners beyond. `table()` returns a spectrum for
    a scene.

    Raises, Notes : as in `spectrum_of_profile`. Directions are averaged also for anisotropic maps.

    Examples
    --------
    >>> x = 1e-3 * np.arange(64) / 64
    >>> heights = 1e-6 * np.sin(2 * np.pi * x / 125e-6)[:, None] * np.ones(64)
    >>> measured = rf.roughness.spectrum_of_topography(heights, dx=x[1], window="none", detrend=0)
    >>> round(1e6 * float(measured.h_rms), 4)  # in µm
    0.7071
    """
    heights = _heights(heights, 2)
    dx = _spacing(dx, None, "dx")
    dy = dx if dy is None else _spacing(dy, None, "dy")
    kx, ky = (np.fft.fftfreq(n, d) * 2 * np.pi for n, d in zip(heights.shape, (dx, dy), strict=True))
    heights, limits, remarks = _prepared(
        heights[None], (dx, dy), detrend, fill_volume, fill_level, tops, tip_radius, noise
    )
    spectrum = _spectrum(heights, (dx, dy), np.hypot(kx[:, None], ky), window, detrend, per_decade)
    return spectrum._replace(limits=limits, remarks=remarks)


def _prepared(heights, spacings, detrend, fill_volume, fill_level, tops, tip_radius, noise):
    """Detrend samples of heights, fill cavities and take the tops.

    Return the heights, the limits of the instrument, and texts about the changes.
    """
    if isinstance(detrend, bool) or detrend not in _DEGREES:
        raise ValueError(f"detrend = {shown(detrend)}: must be 0, 1, 2 or None")
    rules = {"tip_radius": POSITIVE, "noise": POSITIVE, "fill_volume": NONNEGATIVE, "fill_level": FINITE}
    for (name, rule), value in zip(rules.items(), (tip_radius, noise, fill_volume, fill_level), strict=True):
        if value is not None:
            check_values(name, as_leaf(name, value, 0), rule)
    if fill_volume is not None and fill_level is not None:
        raise ValueError(f"fill_level = {shown(fill_level)}: must not be given with fill_volume")
    heights = np.stack([detrended(height, detrend) for height in heights])
    limits = InstrumentLimits(
        tip=None if tip_radius is None else tip_cutoff(heights, spacings, tip_radius),
        noise=None if noise is None else noise**2 * np.prod(spacings) / (2 * np.pi) ** len(spacings),
    )
    shape, remarks = heights.shape, []
    if fill_volume is not None or fill_level is not None:
        filled = fill_cavities(heights.reshape(len(heights), -1), volume=fill_volume, level=fill_level)
        heights = filled.heights.reshape(shape)
        remarks.append(
            f"cavities filled up to {filled.level:.4g} m above the mean plane: {filled.covered:.1%} of the"
            f" area, {filled.volume:.4g} m^3 per m^2"
        )
    if tops:
        middle = heights - heights.mean()
        remarks.append(f"top spectrum, of the {np.mean(middle > 0):.1%} of the area above the mean")
        heights = top_heights(middle.reshape(len(heights), -1)).reshape(shape)
    return heights, limits, tuple(remarks)


def _spectrum(heights, spacings, q, window, detrend, per_decade):
    """Return the `MeasuredSpectrum` of one or more samples of heights on a grid, as the mean over samples.

    `heights` has the shape (samples, *grid). `q` holds the absolute wavevector of every mode.
    """
    check_choice("window", window, WINDOWS)
    if per_decade is not None and not (isinstance(per_decade, int | float) and 0 < per_decade <= 1e4):
        raise ValueError(f"per_decade = {shown(per_decade)}: must be a number > 0 or None")
    heights = np.stack([detrended(height, detrend) for height in heights])
    samples, grid = len(heights), heights.shape[1:]
    axes = tuple(range(1, heights.ndim))
    w = np.ones(())
    for n in grid:
        # Periodic window, whose transform is exactly three modes.
        side = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n) if window == "hann" else np.ones(n)
        w = w[..., None] * side
    power = np.mean(w**2)
    cell = float(np.prod([2 * np.pi / (n * d) for n, d in zip(grid, spacings, strict=True)]))
    mean_square = np.abs(np.fft.fftn(w * heights, axes=axes)) ** 2 / (q.size**2 * power)
    index, inside = bins_of_modes(q, np.pi / max(spacings), per_decade)
    count = np.bincount(index)
    kept = count > 0
    count = count[kept]

    def mean(values):
        return np.bincount(index, values[inside])[kept] / count

    each = np.stack([mean(sample) for sample in mean_square]) / cell
    C = each.mean(0)
    log_q = np.log(np.where(q > 0, q, q[q > 0].min()))
    center = mean(log_q)
    bins = np.full(q.shape, -1)
    bins[inside] = index
    # The modes of a profile have no other directions.
    power = mean_square[0] if len(grid) == 2 else np.ones(grid)
    alone, in_fit = independent_modes(center, bins, power, window)
    # C is distributed as chi^2 with two degrees of freedom for each independent mode.
    relative = np.sqrt(scipy.special.polygamma(1, alone * samples))
    if samples > 1:
        scatter = each.std(0, ddof=1) / np.sqrt(samples)
        relative = np.maximum(relative, scatter / np.where(C > 0, C, 1.0))
    corrected, together = C, relative
    if len(grid) == 2:
        corrected = unbiased(center, C, log_q, mean, window, alone)
        together = np.sqrt(scipy.special.polygamma(1, in_fit))
    return MeasuredSpectrum(
        q=np.exp(center),
        C=C,
        modes=count,
        relative=relative,
        cell=cell,
        left_out=float(np.sum(mean_square[:, ~inside])) / samples,
        h_rms=float(np.sqrt(np.sum(mean_square) / samples)),
        dimensions=len(grid),
        rms_height=float(np.sqrt(np.mean((heights - heights.mean(axes, keepdims=True)) ** 2))),
        rms_slope=float(
            np.sqrt(
                sum(np.mean((np.diff(heights, axis=k) / d) ** 2) for k, d in zip(axes, spacings, strict=True))
            )
        ),
        sampling=Sampling(w, trends(grid, detrend)) if len(grid) == 1 else None,
        unbiased=corrected,
        together=together,
    )


def _heights(height, dimensions):
    array = np.asarray(height)
    several = dimensions == 1 and array.ndim == 2 and len(array) > 0
    if (
        array.dtype.kind not in "fiu"
        or not (array.ndim == dimensions or several)
        or min(array.shape[-dimensions:]) < _LEAST
        or np.ma.is_masked(height)
    ):
        raise ValueError(
            f"heights of shape {array.shape}, type {array.dtype}: must be real, {dimensions}-dimensional,"
            f" without masked points, at least {_LEAST} along each axis"
        )
    array = array.astype(float)
    if not np.isfinite(array).all():
        where = ", ".join(map(str, np.argwhere(~np.isfinite(array))[0]))
        raise ValueError(f"heights[{where}] is not finite; fill in missing points first (`fill_holes`)")
    return array


def _spacing(x, n, name="x"):
    """Return the spacing of `n` heights, where `x` is the spacing or an array of even positions."""
    x = np.asarray(x)
    if x.dtype.kind not in "fiu" or x.shape not in ((), (n,)) or not np.isfinite(x).all():
        raise ValueError(
            f"{name} of shape {x.shape}: must be a finite spacing" + (f", or {n} positions" if n else "")
        )
    if x.ndim == 0:
        if not x > 0:
            raise ValueError(f"{name} = {float(x)!r}: must be > 0 [m]")
        return float(x)
    spacing = (x[-1] - x[0]) / (n - 1)
    if spacing < 0:
        raise ValueError(
            f"{name} decreases from {float(x[0]):g} to {float(x[-1]):g}: positions must increase; reverse"
            f" positions and heights: {name}[::-1], heights[..., ::-1]"
        )
    # Instruments round positions, so neighbours may differ by more than the grid does.
    uneven = np.abs(x - x[0] - spacing * np.arange(n))
    if not spacing > 0 or uneven.max() > _EVEN * spacing:
        i = int(np.argmax(uneven))
        raise ValueError(
            f"{name}[{i}] = {float(x[i])!r}: positions must increase evenly, to {_EVEN:.0%} of {spacing:g};"
            " sort them, and interpolate the heights to even positions"
        )
    return float(spacing)


# Units of lengths and heights [m].
LENGTH_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "pm": 1e-12}
LENGTH_UNITS |= {"\u00b5m": 1e-6, "\u03bcm": 1e-6, "\u00c5": 1e-10}
_NEEDED = ("heights", "physical_sizes", "nb_grid_pts")


def spectrum_of_surface(topography: Any, *, unit: str | None = None, **options: Any) -> MeasuredSpectrum:
    r"""Return the spectrum of a topography object, which is C(q) of a map or C_1D(q) of a line scan.

    The function runs on the host, and does not import SurfaceTopography.

    Parameters
    ----------
    topography : a uniform line scan or map of SurfaceTopography, or an object with `heights()`,
        `physical_sizes`, `nb_grid_pts`, and optionally `unit` and `is_periodic`
    unit : "m", "mm", "um", "nm", ..., unit of lengths and heights, if the topography has no unit
    options : as in `spectrum_of_topography`; the defaults for a periodic surface are window="none" and
        detrend=0

    Returns
    -------
    MeasuredSpectrum, in SI

    Raises
    ------
    ValueError : if the object is not a topography, if the unit is missing or unknown, or if points are
        undefined or unevenly spaced. Other errors as in `spectrum_of_topography`.

    Notes
    -----
    `spectrum_from` converts spectra computed by SurfaceTopography: "C_iso" for `power_spectrum_from_area`,
    "C_1D_surfacetopography" for `power_spectrum_from_profile`. Convert q and C to SI and leave masked entries
    out first.

    Examples
    --------
    >>> class LineScan:
    ...     physical_sizes, nb_grid_pts, unit, is_periodic = (10.0,), (1000,), "mm", True
    ...     def heights(self):
    ...         return 1e-3 * np.sin(2 * np.pi * np.arange(1000) / 50)
    >>> measured = rf.roughness.spectrum_of_surface(LineScan())
    >>> round(1e6 * float(measured.rms_height), 4), measured.dimensions  # in µm; C_1D of a line
    (0.7071, 1)
    """
    for name in _NEEDED:
        if not hasattr(topography, name):
            raise ValueError(
                f"topography is a {type(topography).__name__} without {name}; pass a"
                " SurfaceTopography object, or arrays to spectrum_of_topography or spectrum_of_profile"
            )
    if not getattr(topography, "is_uniform", True):
        raise ValueError("topography has unevenly spaced points; interpolate it to a uniform grid first")
    scale = _scale(getattr(topography, "unit", None), unit)
    heights = topography.heights()
    if np.ma.is_masked(heights):
        raise ValueError("topography has undefined points; fill them in first")
    sizes, counts = np.atleast_1d(topography.physical_sizes), np.atleast_1d(topography.nb_grid_pts)
    if sizes.shape != counts.shape or np.shape(heights) != tuple(counts):
        raise ValueError(
            f"topography: heights of shape {np.shape(heights)}, nb_grid_pts {tuple(counts.tolist())},"
            f" physical_sizes {tuple(sizes.tolist())}: must have equal numbers of entries, 1 or 2"
        )
    spacings = scale * sizes / counts
    if getattr(topography, "is_periodic", False):
        options = {"window": "none", "detrend": 0} | options
    if len(spacings) == 1:
        return spectrum_of_profile(float(spacings[0]), scale * np.asarray(heights), **options)
    return spectrum_of_topography(scale * np.asarray(heights), *map(float, spacings), **options)


def _scale(own, unit):
    if own is None and unit is None:
        names = ", ".join(LENGTH_UNITS)
        raise ValueError(f"unit is missing and the topography has none; pass one of {names}")
    if own is not None and unit is not None and own != unit:
        raise ValueError(f"unit = {shown(unit)}: leave it out; the topography has {shown(own)}")
    return LENGTH_UNITS[check_choice("unit", unit if own is None else own, LENGTH_UNITS)]
