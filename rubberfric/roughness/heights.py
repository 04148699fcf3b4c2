r"""Measured heights before their spectrum: outliers, holes, trends, asperity tops, and filled cavities.

A rubber block touches the tops of a road, and its spectrum is often computed from them alone. With the
heights h above the mean plane and the share n_T of the area with h > 0, the top spectrum is

.. math:: h_T = \max(h, 0), \qquad C_T = \frac{1}{n_T}\, C[h_T]

[Persson et al., J. Phys.: Condens. Matter 17 (2005) R1, arXiv:cond-mat/0502419]. Water or a seal coat fills
cavities up to a level L, where V is the volume per area,

.. math:: h_L = \max(h, L), \qquad V(L) = \langle \max(L - h, 0) \rangle

V is a piecewise linear, increasing function of L, and its inverse is exact.
"""

import math
from typing import NamedTuple

import numpy as np
import scipy

from rubberfric.base.checks import FINITE, NONNEGATIVE, POSITIVE, ArrayLike, as_leaf, check_values

# Share of the distances from neighbours below the quantile that is their scale. The rest may be outliers, or
# steps between plateaus.
_MOST = 0.8
# This quantile of the absolute value of a normal variable, over its standard deviation.
_QUANTILE = 1.2816
# Standard deviations from which on a height is an outlier. Gaussian surfaces have none, also smooth ones, and
# roads have steep edges, whose deviations are larger.
USUAL_OUTLIER = 10.0
# Growth of the scale of distances, at twice the spacing, above which there are steps between plateaus. The
# scale of smooth Gaussian surfaces grows by 4 to 5, and in samples of few distances rarely by more than 7.
_JUMP = 7.0
# Fewest distances of a wider spacing. In smaller samples the growth scatters more.
_FEWEST = 64
# The tip of a profilometer cannot follow curvatures above this share of one over its radius.
_FOLLOWED = 0.5
# Distances per octave at which curvatures are computed.
_PER_OCTAVE = 4
# Parts of a map or a profile whose scatter is the error of a cutoff.
_PARTS = 4


def find_outliers(
    heights: ArrayLike, threshold: float = USUAL_OUTLIER, *, profiles: bool = False
) -> np.ndarray:
    r"""Return a mask of the heights that deviate from their neighbours as no other height does.

    .. math:: \min(d_x, d_y) > \text{threshold}\; \frac{Q_{0.8}(d_x, d_y)}{1.2816},\qquad d_x = |h - m_x|

    m_x and m_y are the medians of the four nearest heights along x and y. A profile has d_x only.
    Q_0.8 is the 80 % quantile of all distances. The scale behind the threshold is at least the smallest
    distance of two different heights, the resolution of the instrument.

    Parameters
    ----------
    heights : map, shape (nx, ny), or with `profiles` one or more profiles, shape (n,) or (m, n); finite
    threshold : standard deviations, > 0

    Returns
    -------
    bool array of the shape of heights. Not found are spikes wider than two points, scratches, and
    spikes within two points of the end of a profile or a corner of a map. Neighbours of a spike may be
    masked, too.

    Notes
    -----
    Quantised heights have plateaus. Levelling tilts the plateaus, so the smallest distance of two different
    heights becomes a rounding error. Most distances d may then be far below a step of the heights. The scale
    is therefore also computed from every 2nd, 4th, 8th, ... height. From one of these spacings to the next,
    the scale of smooth Gaussian surfaces grows by a factor of 4 to 5. A growth by more than 7 is a step
    between plateaus, and the larger scale at this spacing and the next is used. Spikes must then exceed about
    ten steps.

    Examples
    --------
    >>> profile = 1e-6 * np.sin(0.1 * np.arange(50))
    >>> profile[20] += 5e-6
    >>> np.flatnonzero(rf.roughness.find_outliers(profile, profiles=True))
    array([20])
    """
    h = _finite(heights)
    check_values("threshold", as_leaf("threshold", threshold, 0), POSITIVE)
    distances = _distances(h, profiles)
    if not np.isfinite(distances).any():
        return np.zeros(h.shape, bool)
    nearest = distances.min(0)
    return np.isfinite(nearest) & (nearest > threshold * _scale_of_distances(h, profiles))


def _scale_of_distances(h, profiles):
    """Return the standard deviation of the distances from neighbours, or a step of heights with plateaus."""
    steps = np.diff(np.unique(h))
    resolution = steps.min() if steps.size else 0.0
    every_second = (..., slice(None, None, 2)) if profiles else (slice(None, None, 2),) * h.ndim
    scales: list[float] = []
    while True:
        distances = _distances(h, profiles)
        inside = distances[np.isfinite(distances)]
        if scales and inside.size < _FEWEST:
            break
        scales.append(max(np.quantile(inside, _MOST) / _QUANTILE, resolution))
        h = h[every_second]
    jumps = [k for k in range(1, len(scales)) if scales[k] > _JUMP * scales[k - 1]]
    # At the jump itself, the quantile may lie between a plateau and a step.
    return max(scales[jumps[-1] : jumps[-1] + 2]) if jumps else scales[0]


def _distances(h, profiles):
    """Return the distances of all heights from their neighbours, with one entry for each axis."""
    return np.array([_from_neighbours(h, axis) for axis in ((-1,) if profiles else range(h.ndim))])


def _from_neighbours(h, axis):
    """Return the distance of every height from the median of the four nearest heights along an axis.

    Its own height is left out, because it is the median of a rising line. The distance is inf for the two
    heights at each end.
    """
    z = np.moveaxis(h, axis, -1)
    distances, n = np.full(z.shape, np.inf), z.shape[-1]
    beside = [z[..., k : n - 4 + k] for k in (0, 1, 3, 4)]
    if n > 4:
        distances[..., 2:-2] = np.abs(z[..., 2:-2] - np.median(beside, axis=0))
    return np.moveaxis(distances, -1, axis)


def fill_holes(heights: ArrayLike) -> np.ndarray:
    """Fill holes (NaN) of a map, so that each height in a hole is the mean of its neighbours along both axes.

    The result has no new maximum or minimum. A spectrum of filled heights is too low by about the share of
    holes at short waves.

    Examples
    --------
    >>> heights = np.array([[1.0, 1.0, 1.0], [1.0, np.nan, 3.0], [3.0, 3.0, 3.0]])
    >>> round(float(rf.roughness.fill_holes(1e-6 * heights)[1, 1]) * 1e6, 6)  # in µm
    2.0
    """
    heights = np.asarray(heights, float)
    hole = ~np.isfinite(heights)
    if not hole.any():
        return heights
    # Numbers of the holes; -1 for known heights, -2 outside the map.
    number = np.pad(np.where(hole, np.cumsum(hole).reshape(hole.shape) - 1, -1), 1, constant_values=-2)
    x, y = np.nonzero(number >= 0)
    neighbours = (x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)
    beside, height = (np.array([x[place] for place in neighbours]) for x in (number, np.pad(heights, 1)))
    known, count = np.sum(np.where(beside == -1, height, 0.0), 0), np.sum(beside >= -1, 0, dtype=float)
    own, other = np.nonzero(beside >= 0)[1], beside[beside >= 0]
    linked = scipy.sparse.coo_matrix((np.ones(own.size), (own, other)), (count.size, count.size))
    complete = heights.copy()
    complete[hole] = scipy.sparse.linalg.spsolve((scipy.sparse.diags(count) - linked).tocsc(), known)
    return complete


def detrended(heights: ArrayLike, degree: int | None = 1, *, profiles: bool = False) -> np.ndarray:
    """Subtract the least-squares polynomial of a total degree, 0, 1 or 2, from a map or from each profile.

    Examples
    --------
    >>> heights = 1e-6 * np.array([0.0, 1.0, 2.0, 4.0])
    >>> (1e6 * rf.roughness.detrended(heights, profiles=True)).round(6)
    array([ 0.2, -0.1, -0.4,  0.3])
    """
    h = np.asarray(heights, float)
    if degree is None:
        return h
    if profiles and h.ndim == 2:
        return np.stack([detrended(line, degree) for line in h])
    basis = trends(h.shape, degree)
    return h - (basis @ (basis.T @ h.ravel())).reshape(h.shape)


def trends(shape: tuple[int, ...], degree: int | None) -> np.ndarray:
    """Return orthonormal columns that span the polynomials of the given total degree on a grid."""
    if degree is None:
        return np.zeros((math.prod(shape), 0))
    axes = np.meshgrid(*(np.linspace(-1, 1, n) for n in shape), indexing="ij")
    powers = [p for p in np.ndindex(*([degree + 1] * len(shape))) if sum(p) <= degree]
    basis = np.stack([np.prod([a**k for a, k in zip(axes, p, strict=True)], 0).ravel() for p in powers], 1)
    return np.linalg.qr(basis)[0]


def top_heights(heights: ArrayLike) -> np.ndarray:
    r"""Return heights whose spectrum is the top spectrum C_T of the module's docstring.

    .. math:: \frac{\max(h, 0) - \langle\max(h, 0)\rangle}{\sqrt{n_T}}

    Parameters
    ----------
    heights : heights above the mean plane [m], any shape with mean 0; `detrended` gives them

    Notes
    -----
    For Gaussian heights C_T is 0.5 to 0.6 C below the roll-off and tends to C for short waves, and the mean
    square height is 1 - 1/pi = 0.682 times the one of h. On a road with flat tops and deep cavities C_T is
    smaller. `top_heights(-heights)` gives the bottom spectrum.

    Raises
    ------
    ValueError : if heights are not finite, or if none is above 0.

    Examples
    --------
    >>> heights = np.random.default_rng(0).normal(scale=1e-3, size=100_000)
    >>> tops = rf.roughness.top_heights(heights - heights.mean())
    >>> round(float(np.var(tops) / np.var(heights)), 2)  # 1 - 1/pi
    0.68
    """
    h = _finite(heights)
    share = np.mean(h > 0)
    if share == 0:
        raise ValueError("heights: none is above 0; subtract the mean or a plane first (`detrended`)")
    tops = np.maximum(h, 0.0)
    return (tops - tops.mean()) / np.sqrt(share)


class FilledCavities(NamedTuple):
    """Heights with cavities that are filled up to a level.

    Attributes
    ----------
    heights : max(h, level) [m]
    level : level of the filling, in the coordinate of the heights [m]
    volume : volume of the filling per area of the map [m]
    covered : share of the points below the level [-]
    """

    heights: np.ndarray
    level: float
    volume: float
    covered: float


def fill_cavities(
    heights: ArrayLike, *, volume: float | None = None, level: float | None = None
) -> FilledCavities:
    r"""Fill the cavities of a road, as water or a seal coat does.

    .. math:: h_L = \max(h, L), \qquad V(L) = \langle \max(L - h, 0) \rangle

    All cavities have one level, as if they were connected.

    Parameters
    ----------
    heights : heights above a horizontal plane [m], any shape; `detrended` subtracts a tilt
    volume : V, volume per area, >= 0 [m]; 1 mm is 1 litre on a square metre
    level : L [m], in the coordinate of the heights; pass either volume or level

    Raises
    ------
    ValueError : if not exactly one of volume and level is given, if a value is invalid, or if heights are not
        finite.

    Examples
    --------
    >>> heights = 1e-3 * np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    >>> wet = rf.roughness.fill_cavities(heights, volume=0.6e-3)
    >>> float(wet.covered), bool(abs(wet.level) < 1e-12), round(1e3 * float(wet.heights.mean()), 6)
    (0.4, True, 0.6)
    """
    h = _finite(heights)
    if (volume is None) == (level is None):
        raise ValueError("fill_cavities: pass either volume or level")
    if level is not None:
        check_values("level", as_leaf("level", level, 0), FINITE)
    if volume is not None:
        check_values("volume", as_leaf("volume", volume, 0), NONNEGATIVE)
        level = _level_of(np.sort(h, axis=None), float(volume))
    assert level is not None
    depth = np.maximum(level - h, 0.0)
    return FilledCavities(np.maximum(h, level), float(level), float(depth.mean()), float(np.mean(depth > 0)))


def _level_of(ordered, volume):
    """Return L of the mean of max(L - h, 0) = volume, for heights in increasing order."""
    count = np.arange(1, ordered.size + 1)
    # Sums of L - h over the k lowest heights, at L equal to the next height.
    sums = count[:-1] * ordered[1:] - np.cumsum(ordered[:-1])
    k = int(np.searchsorted(sums, volume * ordered.size))
    lowest = ordered[: k + 1]
    return lowest.mean() + volume * ordered.size / lowest.size


def tip_cutoff(heights: ArrayLike, spacings: tuple[float, ...], radius: float) -> tuple[float, float] | None:
    r"""Return the wavevector up to which a tip of a given radius follows a surface, and its error.

    .. math:: \max\left(-\frac{h(x + d) - 2 h(x) + h(x - d)}{d^2}\right) = \frac{1}{2 R},\qquad
              q = \frac{2\pi}{2 d}

    The sharpest peak at the distance d is blunter than half of the curvature of the tip for all longer waves
    [Sanner, Noehring, Thimons, Jacobs, Pastewka, Appl. Surf. Sci. Adv. 7 (2022) 100190].

    Parameters
    ----------
    heights : profiles, shape (m, n), or maps, shape (m, nx, ny) [m]
    spacings : distances of the points along the last axes [m]
    radius : R [m]

    Returns
    -------
    Tuple of q [1/m], and the standard deviation of ln q over four parts of the surface; None if the tip
    follows the surface down to the spacing of the points
    """
    q = _tip_cutoff(heights, spacings, radius)
    if q is None:
        return None
    axis = int(np.argmax(np.shape(np.asarray(heights))))
    parts = [
        _tip_cutoff(part, spacings, radius) for part in np.array_split(np.asarray(heights), _PARTS, axis)
    ]
    highest = np.pi / min(spacings)
    return q, float(np.std(np.log([highest if part is None else part for part in parts])))


def _tip_cutoff(heights, spacings, radius):
    cutoffs = []
    for axis, spacing in enumerate(spacings, start=1):
        h = np.moveaxis(heights, axis, -1)
        longest = (h.shape[-1] - 1) // 2
        if longest < 1:
            continue
        octaves = np.arange(int(_PER_OCTAVE * np.log2(longest)) + 1) / _PER_OCTAVE
        steps = np.unique(np.floor(2.0**octaves).astype(int))
        bends = [2 * h[..., k:-k] - h[..., 2 * k :] - h[..., : -2 * k] for k in steps]
        sharpest = np.array([bend.max() for bend in bends]) / (steps * spacing) ** 2
        # From the longest distance on, the first one at which a peak is too sharp.
        sharp = np.flatnonzero(sharpest > _FOLLOWED / radius)
        if sharp.size:
            cutoffs.append(np.pi / (_crossing(steps, sharpest, sharp[-1], _FOLLOWED / radius) * spacing))
    return float(min(cutoffs)) if cutoffs else None


def _crossing(steps, sharpest, last, limit):
    """Return the distance in points at which the sharpest curvature falls to the limit."""
    if last + 1 == steps.size or not sharpest[last + 1] > 0:
        return steps[last]
    ln_k, ln_s = np.log(steps[last : last + 2]), np.log(sharpest[last : last + 2])
    return np.exp(np.interp(np.log(limit), ln_s[::-1], ln_k[::-1]))


def _finite(heights):
    h = np.asarray(heights)
    if h.dtype.kind not in "fiu" or h.ndim not in (1, 2) or h.size == 0 or np.ma.is_masked(heights):
        raise ValueError(f"heights of shape {h.shape}, type {h.dtype}: must be real, a profile or a map")
    h = h.astype(float)
    if not np.isfinite(h).all():
        raise ValueError("heights: must be finite; fill in missing points first (`fill_holes`)")
    return h
