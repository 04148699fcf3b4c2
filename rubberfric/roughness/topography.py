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

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from rubberfric.base.checks import shown
from rubberfric.roughness.normalisation import spectrum_from
from rubberfric.roughness.tabulated import TabulatedSpectrum

WINDOWS = ("hann", "none")
# Highest degree of detrending polynomials in x (and y); more would remove roughness.
_DEGREES = (None, 0, 1, 2)
# Largest distance of a position from an even grid, over the spacing.
_EVEN = 0.05


class MeasuredSpectrum(NamedTuple):
    """A binned power spectrum of measured heights.

    The arrays have one entry for each bin that contains modes.

    Attributes
    ----------
    q : geometric mean of the modes' wavevectors [1/m]
    C : mean over the modes of a bin: C of a map [m^4], C_1D of a profile [m^3] (h_rms^2 = 2 int C_1D dq)
    modes : number of modes, counting q and -q
    relative : standard error of ln C for a Gaussian surface, from the number of independent modes [-]
        `fitting.SpectrumData` accepts this standard error, which is too small for bins of a few modes.
    cell : area dq_x dq_y of a mode [1/m^2], or length dq of a mode in a profile [1/m]
    left_out : mean square height [m^2] of the modes outside all bins, in the corners of a map
    h_rms : rms of the detrended heights in the window [m]; h_rms^2 = cell sum(modes C) + left_out
    dimensions : 2 for a map, 1 for a profile
    """

    q: np.ndarray
    C: np.ndarray
    modes: np.ndarray
    relative: np.ndarray
    cell: float
    left_out: float
    h_rms: float
    dimensions: int = 2

    def knots(self) -> tuple[np.ndarray, np.ndarray]:
        r"""Return entries (q, C) of a log-log linear table with the mean square height of all bins.

        .. math:: 2\pi\int q\, C\, dq \;\text{ or }\; 2\int C_\mathrm{1D}\, dq
                  = \text{cell} \sum \text{modes}\; C

        The table covers the cells of all modes. Below the first bin C is constant, down to the border of the
        cell of q = 0. C continues above the last bin with the slope of the last octave, up to the outer
        border of the bin. The integral of the log-log line differs from the sum over a few long waves.
        Therefore ln C is changed by an amount proportional to C, which is the smallest possible change in
        units of `relative`. Bins near the maximum of C change by less than their standard error (by more in a
        map much longer than wide). Bins with a small C hardly change.

        Returns
        -------
        arrays q [1/m] and C [m^4] (profile: [m^3]), with an entry for each bin and one or two ends
        """
        q, C = self.q, self.C
        if not (C > 0).all():
            i = int(np.argmin(C))
            raise ValueError(f"C[{i}] = {C[i]:g} at q = {q[i]:g} 1/m: must be > 0; use fewer bins per_decade")
        # The cells of n modes and of q = 0 fill a circle of radius q, or a line from -q to q.
        cells = np.array([1.0, 1.0 + self.modes.sum()]) * self.cell
        low, high = np.sqrt(cells / np.pi) if self.dimensions == 2 else cells / 2
        # In a map that is much longer than wide, the first modes lie inside the circle.
        low = min(low, q[0] / np.sqrt(np.pi))
        log_q, log_C = np.log(np.append(low, q)), np.log(np.append(C[0], C))
        if high > q[-1] * (1 + 1e-9):
            # Neighbours may be close and scatter, so use the slope of the last octave.
            last = min(int(np.searchsorted(q, q[-1] / 2)), q.size - 2) + 1
            slope = np.polyfit(log_q[last:], log_C[last:], 1)[0] if q.size > 1 else 0.0
            log_C = np.append(log_C, log_C[-1] + slope * (np.log(high) - log_q[-1]))
            log_q = np.append(log_q, np.log(high))
        share = np.exp(log_C - log_C.max())
        target = np.log(self.cell * np.sum(self.modes * C))

        def miss(change):
            return _log_mean_square(log_q, log_C + change * share, self.dimensions) - target

        change = scipy.optimize.brentq(miss, -30.0, 30.0, xtol=1e-13, rtol=1e-14)
        return np.exp(log_q), np.exp(log_C + change * share)

    def table(self, hurst: float | None = None) -> TabulatedSpectrum:
        """Return the TabulatedSpectrum with the entries of `knots`.

        For a map, the rms height of the table is (h_rms^2 - left_out)^(1/2).

        Parameters
        ----------
        hurst : H [-], 0 ... 1, only for a profile. C_1D is converted by the factor of a self-affine surface
            (`spectrum_from`). The rms height of the table is then larger than the rms height of the profile,
            by a factor of 1.36 at H = 0.8.
        """
        q, C = self.knots()
        return TabulatedSpectrum(q, spectrum_from("C_1D" if self.dimensions == 1 else "C", q, C, hurst))


def spectrum_of_profile(
    x: ArrayLike,
    height: ArrayLike,
    *,
    window: str = "hann",
    detrend: int | None = 1,
    per_decade: float | None = 20,
) -> MeasuredSpectrum:
    r"""Return the spectrum C_1D(q) of a height profile.

    .. math:: h_\mathrm{rms}^2 = 2\int_0^\infty C_\mathrm{1D}\, dq

    Parameters
    ----------
    x : spacing of the heights, > 0 [m], or positions [m], shape (n,), even to within 5 % of the spacing
    height : heights [m], shape (n,), n >= 8; finite
    window : "hann", or "none" for a profile with the period n times the spacing
    detrend : degree of the polynomial that is subtracted first, 0, 1 or 2, or None
    per_decade : bins per decade, > 0, or None for every mode separately

    Returns
    -------
    MeasuredSpectrum with q from 2 pi / length to pi / spacing. `table(hurst)` returns a spectrum for a scene.
    `knots()` returns entries for `spectrum_from("C_1D", q, C, hurst)` and `areal_spectrum(q, C)`.

    Raises
    ------
    ValueError : if an argument is invalid.

    Notes
    -----
    The function runs on the host and is not differentiable.

    For a power law C ~ q^-s, the mean over a bin is 1 + (s ln r)^2/24 times C at the bin's q, where r is the
    ratio of the bin's borders: 1 % too large for s = 4 and 20 bins per decade.
    """
    height = _heights(height, 1, 8)
    spacing = _spacing(x, height.size)
    kx = np.fft.fftfreq(height.size, spacing) * 2 * np.pi
    return _spectrum(height, (spacing,), np.abs(kx), window, detrend, per_decade)


def spectrum_of_topography(
    heights: ArrayLike,
    dx: ArrayLike,
    dy: ArrayLike | None = None,
    *,
    window: str = "hann",
    detrend: int | None = 1,
    per_decade: float | None = 20,
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

    Returns
    -------
    MeasuredSpectrum with q from 2 pi / longer side to pi / larger spacing, where circles are complete.
    `left_out` is the mean square height of the modes in the corners beyond. `table()` returns a spectrum for
    a scene.

    Raises, Notes : as in `spectrum_of_profile`. Directions are averaged also for anisotropic maps.
    """
    heights = _heights(heights, 2, 8)
    dx = _spacing(dx, None, "dx")
    dy = dx if dy is None else _spacing(dy, None, "dy")
    kx, ky = (np.fft.fftfreq(n, d) * 2 * np.pi for n, d in zip(heights.shape, (dx, dy), strict=True))
    return _spectrum(heights, (dx, dy), np.hypot(kx[:, None], ky), window, detrend, per_decade)


def _spectrum(height, spacings, q, window, detrend, per_decade):
    """Return the `MeasuredSpectrum` of heights on a grid.

    `q` holds the absolute wavevector of every mode.
    """
    if not isinstance(window, str) or window not in WINDOWS:
        raise ValueError(f"window = {shown(window)}: must be one of {', '.join(WINDOWS)}")
    if isinstance(detrend, bool) or detrend not in _DEGREES:
        raise ValueError(f"detrend = {shown(detrend)}: must be 0, 1, 2 or None")
    if per_decade is not None and not (isinstance(per_decade, int | float) and 0 < per_decade <= 1e4):
        raise ValueError(f"per_decade = {shown(per_decade)}: must be a number > 0 or None")
    height = _detrended(height, detrend)
    w = np.ones(())
    for n in height.shape:
        # Periodic window, whose transform is exactly three modes.
        side = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n) if window == "hann" else np.ones(n)
        w = w[..., None] * side
    power = np.mean(w**2)
    cell = float(np.prod([2 * np.pi / (n * d) for n, d in zip(height.shape, spacings, strict=True)]))
    mean_square = np.abs(np.fft.fftn(w * height)) ** 2 / (height.size**2 * power)
    # Modes q and -q of a real field are equal, and a window correlates neighbours.
    dependent = 2 * np.mean(w**4) / power**2
    index, inside = _bins(q, np.pi / max(spacings), per_decade)
    count = np.bincount(index)
    kept = count > 0
    count = count[kept]

    def mean(values):
        return np.bincount(index, values[inside])[kept] / count

    C = mean(mean_square) / cell
    return MeasuredSpectrum(
        q=np.exp(mean(np.log(np.where(q > 0, q, 1.0)))),
        C=C,
        modes=count,
        relative=np.sqrt(dependent / count),
        cell=cell,
        left_out=float(np.sum(mean_square[~inside])),
        h_rms=float(np.sqrt(np.sum(mean_square))),
        dimensions=height.ndim,
    )


def _log_mean_square(log_q, log_C, dimensions):
    """Return ln(2 pi int q C dq) of a log-log linear C, or ln(2 int C dq) if `dimensions` is 1."""
    width, log_term = np.diff(log_q), log_C + dimensions * log_q
    growth = np.diff(log_term)
    near = np.abs(growth) < 1e-8  # (e^x - 1)/x is 0/0 at x = 0
    mean = np.where(near, 1 + growth / 2, np.expm1(growth) / np.where(near, 1.0, growth))
    top = log_term.max()
    total = np.sum(np.exp(log_term[:-1] - top) * mean * width)
    return top + np.log((2 * np.pi if dimensions == 2 else 2.0) * total)


def _bins(q, highest, per_decade):
    """Return the bin numbers of all modes with 0 < q <= `highest`, and a mask of these modes."""
    lowest = q[q > 0].min()
    inside = (q > 0) & (q <= highest * (1 + 1e-9))
    if per_decade is None:
        # Equal |q| of different directions differ by rounding.
        steps = np.round(np.log(q[inside] / lowest) / 1e-9)
        return np.unique(steps, return_inverse=True)[1].ravel(), inside
    place = np.log10(q[inside] / lowest) * per_decade
    return np.floor(place + 1e-9).astype(int), inside


def _detrended(height, degree):
    """Subtract the least-squares polynomial of the given total degree from heights."""
    if degree is None:
        return height
    axes = np.meshgrid(*(np.linspace(-1, 1, n) for n in height.shape), indexing="ij")
    powers = [p for p in np.ndindex(*([degree + 1] * height.ndim)) if sum(p) <= degree]
    basis = np.stack([np.prod([a**k for a, k in zip(axes, p, strict=True)], 0).ravel() for p in powers], 1)
    return height - (basis @ np.linalg.lstsq(basis, height.ravel())[0]).reshape(height.shape)


def _heights(height, ndim, least):
    array = np.asarray(height)
    if (
        array.dtype.kind not in "fiu"
        or array.ndim != ndim
        or min(array.shape) < least
        or np.ma.is_masked(height)
    ):
        raise ValueError(
            f"heights of shape {array.shape}, type {array.dtype}: must be real, {ndim}-dimensional, without"
            f" masked points, at least {least} along each axis"
        )
    array = array.astype(float)
    if not np.isfinite(array).all():
        where = ", ".join(map(str, np.argwhere(~np.isfinite(array))[0]))
        raise ValueError(f"heights[{where}] is not finite; fill in missing points first")
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
    # Instruments round positions, so neighbours may differ by more than the grid does.
    uneven = np.abs(x - x[0] - spacing * np.arange(n))
    if not spacing > 0 or uneven.max() > _EVEN * spacing:
        i = int(np.argmax(uneven))
        raise ValueError(
            f"{name}[{i}] = {float(x[i])!r}: positions must increase evenly, to {_EVEN:.0%} of {spacing:g}"
        )
    return float(spacing)
