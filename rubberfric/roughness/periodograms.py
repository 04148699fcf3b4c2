r"""Bins of modes, and expected periodograms: effects of a window, detrending and bins on a spectrum.

A profile of n heights has the covariances R of a random profile with the spectrum C_1D,

.. math:: R(x) = \int_{-\infty}^\infty C_\mathrm{1D}(q)\, e^{iqx}\, dq

With the windowed and detrended heights z = W (1 - B B^T) h, where the columns of B are orthonormal
polynomials, the expected power of a mode is f^H W (1 - B B^T) R (1 - B B^T) W f. R is a Toeplitz matrix, so
that Fourier transforms compute its products.
"""

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy

# Width of an octave in ln q, the narrowest range of a fit of the slope d ln C / d ln q.
OCTAVE = np.log(2)
# Widest range of such a fit in octaves. Wider ones find smaller differences of slope, but blur their border.
_MOST_OCTAVES = 4
# Fewest bins of such a fit. A line has two parameters, and the other bins give the scatter about it.
FEWEST_BINS = 5
# C decreases more steeply than for this H where short waves were removed.
STEEPEST_HURST = 1.1
# Standard errors by which a slope must differ.
_SIGNIFICANT = 2.0
# State of a bin whose C falls like the C of a rough surface.
_ROUGH = 0
# State of a bin with noise.
_NOISE = 1
# State of a bin in which an instrument removed waves.
SMOOTHED = 2
# Wavevectors per mode at which C_1D is sampled; C_1D is straight between them except next to a cutoff.
_SAMPLES = 8
# Wavevectors per decade at which C_1D is computed; ln C_1D is linear in ln q in between.
_PER_DECADE = 60
# No surface has a spectrum that falls as steeply, C ~ q^-20.
_CLIFF = 20
# Fall of C within two bins behind which rounding errors of the transforms are all that is left.
_ROUNDING = 1e-6
# Steps between bins below which a fit of three parameters says little.
_LEAST_BINS = 4
# Steepest slope d ln C / d ln q of a rough surface, H = 1.
_STEEPEST_SLOPE = 4.0
# Fewest independent modes of a bin. Half a mode means a factor of 9, and fewer say nothing more.
_FEWEST_MODES = 0.5
# Squared correlation of modes at these distances along an axis, from the transform of the squared window.
_NEIGHBOURS = {"none": {0: 1.0}, "hann": {-2: 1 / 36, -1: 4 / 9, 0: 1.0, 1: 4 / 9, 2: 1 / 36}}
# Share of the power of a mode that a window adds to modes at these distances along an axis.
_LEAKS = {"none": {0: 1.0}, "hann": {-1: 1 / 6, 0: 2 / 3, 1: 1 / 6}}


class Sampling(NamedTuple):
    """How the heights of a profile were transformed.

    Attributes
    ----------
    window : factor of every height, shape (n,)
    trends : orthonormal columns that were subtracted first, shape (n, k)
    """

    window: np.ndarray
    trends: np.ndarray


def bins_of_modes(q: np.ndarray, highest: float, per_decade: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Return the bin numbers of all modes with 0 < q <= `highest`, and a mask of these modes."""
    lowest = q[q > 0].min()
    inside = (q > 0) & (q <= highest * (1 + 1e-9))
    if per_decade is None:
        # Equal |q| of different directions differ by rounding.
        steps = np.round(np.log(q[inside] / lowest) / 1e-9)
        return np.unique(steps, return_inverse=True)[1].ravel(), inside
    place = np.log10(q[inside] / lowest) * per_decade
    return np.floor(place + 1e-9).astype(int), inside


def independent_modes(
    log_q: np.ndarray, bins: np.ndarray, power: np.ndarray, window: str
) -> tuple[np.ndarray, np.ndarray]:
    r"""Return the numbers n of independent modes of all bins: of a bin alone, and in a fit to all bins.

    The mean of a bin has the relative variance

    .. math:: \frac1n = \frac{\sum r^2 C C'}{(\sum C)^2}

    over all pairs of modes with the correlation r. A window correlates neighbouring modes. In a fit to all
    bins, the neighbours in other bins count, too. If C differs between directions, few modes hold most of
    the power. The ratio of the means of C C' and C, squared, is the mean over an octave on each side,
    because a bin alone says little about it.

    Parameters
    ----------
    log_q : mean ln q of every bin
    bins : number of the bin of every mode, or -1
    power : squared amplitude of every mode, whose mean is C
    window : "hann" or "none"
    """
    inside, axes = bins >= 0, tuple(range(bins.ndim))
    count = np.bincount(bins[inside])
    pairs, products, all_pairs = np.zeros(count.size), np.zeros(count.size), 0.0
    for step in itertools.product(*[_NEIGHBOURS[window]] * bins.ndim):
        r2 = float(np.prod([_NEIGHBOURS[window][k] for k in step]))
        together = inside & (bins == np.roll(bins, step, axes))
        # The mean product of the powers of two modes is C C' (1 + r^2).
        product = (power * np.roll(power, step, axes))[together] / (1 + r2)
        # Modes k and -k of a real field are equal, which counts every pair twice.
        pairs += 2 * r2 * np.bincount(bins[together], minlength=count.size)
        products += 2 * r2 * np.bincount(bins[together], product, minlength=count.size)
        all_pairs += 2 * r2
    kept = count > 0
    count, pairs, products = count[kept], pairs[kept], products[kept]
    alone = count**2 / pairs
    square = (np.bincount(bins[inside], power[inside])[kept] / count) ** 2
    ratio = products / pairs / np.where(square > 0, square, 1.0)
    # The square of a mean of n modes is too large by the factor 1 + 1/n.
    ratio /= np.maximum(1 - ratio / alone, 0.5)
    first = np.searchsorted(log_q, log_q - OCTAVE)
    end = np.searchsorted(log_q, log_q + OCTAVE, side="right")
    sums = np.cumsum(np.pad([alone * ratio, alone], ((0, 0), (1, 0))), axis=1)
    weighted, weight = sums[:, end] - sums[:, first]
    ratio = np.maximum(weighted / weight, 1.0)
    # One mode at least holds the power of a bin.
    alone = np.maximum(alone / ratio, np.minimum(alone, 1.0))
    return alone, np.maximum(count / all_pairs / ratio, _FEWEST_MODES)


def unbiased(
    log_q: np.ndarray,
    C: np.ndarray,
    modes: np.ndarray,
    mean: Callable[[np.ndarray], np.ndarray],
    window: str,
    alone: np.ndarray,
) -> np.ndarray:
    """Return C(q) of the bins of a map, whose logarithm is right on average.

    The logarithm of a mean of n modes is digamma(n) - ln n too small on average. The mean of a bin also
    differs from C at its mean ln q: a falling C is larger on average, and a window takes power from
    neighbouring modes. In a narrow map they are far away, and the power is too small at long waves.

    Parameters
    ----------
    log_q, C : mean ln q and mean C of every bin
    modes : ln q of every mode
    mean : function that returns the means of the bins of values at every mode
    window : "hann" or "none"
    alone : number of independent modes of every bin
    """
    change = np.log(alone) - scipy.special.digamma(alone)
    if C.size >= FEWEST_BINS:
        *_, line = falls(log_q, np.log(np.maximum(C, np.finfo(float).tiny)), alone, OCTAVE)
        # C of few modes scatters. C of a rough surface does not rise.
        step = np.diff(log_q)
        slope = np.clip(np.diff(line) / step, -_STEEPEST_SLOPE, 0.0)
        line = np.append(0.0, np.cumsum(slope * step))
        beyond = np.maximum(modes - log_q[-1], 0.0)
        expected = np.exp(np.interp(modes, log_q, line) + slope[-1] * beyond)
        for axis in range(modes.ndim):
            moved = [share * np.roll(expected, k, axis) for k, share in _LEAKS[window].items()]
            expected = np.sum(moved, 0)
        change += line - np.log(mean(expected))
    return C * np.exp(change)


def bins_before_cliff(q: np.ndarray, C: np.ndarray) -> int:
    """Return the number of bins before the spectrum ends within the bins, as behind a low-pass filter.

    A bin is behind the end if C falls to it more steeply than q^-20. Bins behind a fall by 1e-6 within two
    bins hold rounding errors. At least four bins are kept.
    """
    steepness = -np.diff(np.log(np.maximum(C, np.finfo(float).tiny))) / np.diff(np.log(q))
    largest_behind = np.maximum.accumulate(C[::-1])[::-1]
    lost = largest_behind[2:] < np.minimum(_ROUNDING, (q[2:] / q[:-2]) ** -_CLIFF) * C[:-2]
    last = max(int(np.argmax(lost)) + 1, _LEAST_BINS) if lost.any() else len(steepness)
    while last > _LEAST_BINS and steepness[last - 1] > _CLIFF:
        last -= 1
    return last + 1


def whole_bins(q: np.ndarray, C: np.ndarray) -> tuple[int, int]:
    """Return the range of bins (begin, end) in which all modes have roughness.

    The spectrum of a synthetic surface may begin or end within the bins, and that of a filtered one ends. The
    bin with the border is partly empty, and is left out with those beyond.

    Examples
    --------
    >>> q = np.geomspace(1e3, 1e5, 41)
    >>> C = 1e-14 * (q / 1e3) ** -3.6 * np.minimum(1.0, (3e4 / q) ** 30)  # a filter at 3e4 1/m
    >>> begin, end = rf.roughness.whole_bins(q, C)
    >>> begin, end, round(float(q[end - 1]))
    (0, 30, 28184)
    """
    end = bins_before_cliff(q, C)
    empty = np.flatnonzero(np.maximum.accumulate(C)[:-2] < _ROUNDING * C[2:])
    return int(empty[-1]) + 2 if empty.size else 0, end - (end < q.size)


def states_of_bins(
    log_q: np.ndarray, log_C: np.ndarray, weight: np.ndarray, dimensions: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the states of all bins, a mask of significantly falling bins, and a smoothed ln C.

    A bin whose slope is not significant over four octaves counts as rough.
    """
    states = np.full(log_q.size, _ROUGH)
    falling, undecided = np.zeros(log_q.size, bool), np.ones(log_q.size, bool)
    level = log_C
    for octaves in range(1, _MOST_OCTAVES + 1):
        fall, error, line = falls(log_q, log_C, weight, octaves * OCTAVE)
        low, high = fall - _SIGNIFICANT * error, fall + _SIGNIFICANT * error
        noise, smoothed = high < dimensions, low > dimensions + 2 * STEEPEST_HURST
        states = np.where(undecided & noise, _NOISE, np.where(undecided & smoothed, SMOOTHED, states))
        falling |= undecided & (low > 0.5 * dimensions)
        level = np.where(undecided, line, level)
        undecided &= ~(noise | smoothed | ((low > dimensions) & (high < dimensions + 2 * STEEPEST_HURST)))
    return states, falling, level


def last_rough(states: np.ndarray, log_q: np.ndarray) -> int:
    """Return the index of the last rough bin, or -1 without a rough bin.

    C changes gradually from smoothing to noise. Rough bins over less than an octave, with smoothing below,
    belong to this change.
    """
    last = states.size - 1
    while last >= 0 and states[last] != _ROUGH:
        last -= 1
    if last in (-1, states.size - 1):
        return last
    below = np.flatnonzero(states[: last + 1] != _ROUGH)
    if below.size and states[below[-1]] == SMOOTHED and log_q[last] - log_q[below[-1]] < OCTAVE:
        return last_rough(states[: below[-1] + 1], log_q)
    return last


def falls(
    log_q: np.ndarray, log_C: np.ndarray, weight: np.ndarray, width: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return -d ln C / d ln q about every bin, its error, and the value of a weighted line over `width`.

    The error is the larger of the standard errors from the weights and from the scatter about the line.
    """
    n = log_q.size
    first = np.minimum(np.searchsorted(log_q, log_q - width / 2 - 1e-9), np.arange(n) - FEWEST_BINS // 2)
    first = np.clip(first, 0, n - FEWEST_BINS)
    end = np.maximum(np.searchsorted(log_q, log_q + width / 2 + 1e-9), first + FEWEST_BINS)
    x, y = log_q - log_q.mean(), log_C - log_C.mean()

    def total(values):
        sums = np.append(0.0, np.cumsum(values))
        return sums[end] - sums[first]

    w, wx, wy = total(weight), total(weight * x), total(weight * y)
    xx, xy = total(weight * x * x) - wx**2 / w, total(weight * x * y) - wx * wy / w
    yy = total(weight * y * y) - wy**2 / w
    slope = xy / xx
    scatter = np.maximum(yy - slope * xy, 0) / np.maximum(end - first - 2, 1)
    line = log_C.mean() + wy / w + slope * (x - wx / w)
    return -slope, np.sqrt(np.maximum(scatter, 1.0) / xx), line


def expected_bins(
    spectrum: Callable[[np.ndarray], np.ndarray], cell: float, modes: np.ndarray, sampling: Sampling
) -> np.ndarray:
    """Return the expected mean of C_1D [m^3] in the bins of a profile with the given spectrum.

    Parameters
    ----------
    spectrum : function of wavevectors > 0 [1/m] that returns C_1D [m^3]
    cell : distance of the modes [1/m]
    modes : number of modes of every bin, counting q and -q, without q = 0; bins are in order
    sampling : window and trends
    """
    n = sampling.window.size
    step = cell / _SAMPLES
    # Up to the shortest wave, of two heights; shorter waves are taken as absent.
    q = step * np.arange(_SAMPLES * n // 2 + 1)
    count = int(np.log10(q[-1] / q[1]) * _PER_DECADE) + 2
    coarse = np.geomspace(q[1], q[-1], count)
    values = np.maximum(spectrum(coarse), np.finfo(float).tiny)
    sampled = np.exp(np.interp(np.log(np.maximum(q, q[1])), np.log(coarse), np.log(values)))
    covariance = np.fft.irfft(sampled, _SAMPLES * n)[:n] * _SAMPLES * n * step
    power = _expected_power(covariance, *sampling) / (n**2 * np.mean(sampling.window**2) * cell)
    # Modes k = 1 ... n/2. The last one equals its negative if n is even.
    weight = np.full(n // 2, 2.0)
    weight[-1] -= n % 2 == 0
    ends = np.searchsorted(np.cumsum(weight), np.cumsum(modes) - 0.5)
    sums = np.cumsum(weight * power[1 : n // 2 + 1])[ends]
    return np.diff(sums, prepend=0.0) / modes


def _expected_power(covariance, window, trends):
    """Return the expected abs(F)^2 of modes k = 0 ... n - 1 from the covariances at distances 0 ... n - 1."""
    n = window.size
    # Covariances of the windowed heights, summed over pairs of heights of every distance modulo n.
    pairs = np.fft.irfft(np.abs(np.fft.rfft(window, 2 * n)) ** 2, 2 * n)[:n] * covariance
    power = np.fft.fft(pairs + np.append(0.0, pairs[:0:-1])).real
    circulant = np.concatenate([covariance, [0.0], covariance[:0:-1]])
    transform = np.fft.rfft(circulant)[:, None] * np.fft.rfft(trends, 2 * n, axis=0)
    spread = np.fft.irfft(transform, 2 * n, axis=0)[:n]
    own, other = (np.fft.fft(window[:, None] * each, axis=0) for each in (trends, spread))
    between = trends.T @ spread
    power -= 2 * np.sum(own.conj() * other, 1).real
    return power + np.einsum("ka,ab,kb->k", own, between, own.conj()).real
