r"""Power spectra of measured heights: tables for scenes, and the range in which the surface was resolved.

A self-affine surface has C ~ q^-2(1 + H) and C_1D ~ q^-(1 + 2 H), with 0 < H < 1. Instruments change the
spectrum at its upper end. White noise adds a constant to C. A filter, an optical resolution or a blunt tip
removes short waves, and C falls more steeply: behind a tip it approaches C_1D ~ q^-4
[Jacobs, Junge, Pastewka, Surf. Topogr.: Metrol. Prop. 5 (2017) 013001].
"""

from typing import Any, Literal, NamedTuple

import numpy as np
import scipy

from rubberfric.base.objects.labelled import Labelled, LabelledArrays
from rubberfric.roughness.lines import ArealSpectrum, areal_of_bins
from rubberfric.roughness.moments import cutoff, rms_slope
from rubberfric.roughness.periodograms import (
    FEWEST_BINS,
    OCTAVE,
    SMOOTHED,
    STEEPEST_HURST,
    Sampling,
    bins_before_cliff,
    falls,
    last_rough,
    states_of_bins,
    whole_bins,
)
from rubberfric.roughness.tabulated import TabulatedSpectrum

# Noise begins to flatten C where it is about half of C. At q1, C is this factor larger.
_ABOVE_NOISE = 2.5
# Smallest ratio of C to the stated noise up to q1.
_OVER_FLOOR = 5.0
# Neighbouring points give a slope up to a fifth smaller than the spectrum. A larger difference is reported.
_LARGER = 1.4
# Usual rms slope at the cutoff for rubber on roads.
_USUAL_SLOPE = 1.3

# Ratio of a wavevector to the largest one of a profile beyond which C adds 2 % to C_1D for H = 0, and less
# for larger H.
_BEYOND = 30.0

Limit = Literal["grid", "noise", "smoothing", "no surface", "tip", "noise floor"]
_TEXT = {
    "grid": "C falls like the C of a rough surface (0 < H < 1) up to the spacing of the points",
    "noise": "noise above q1: C falls more slowly than for H = 0 (at q1, noise is about a fifth of C)",
    "smoothing": f"short waves are smoothed by a tip or filter, or missing, above q1: C falls more steeply"
    f" than for H = {STEEPEST_HURST:g}",
    "tip": "the tip does not follow sharper peaks above q1",
    "noise floor": "the stated noise is more than a fifth of C above q1",
    "no surface": "C does not fall like the C of a rough surface (0 < H < 1) in any range",
}


class InstrumentLimits(NamedTuple):
    """Limits of an instrument.

    Attributes
    ----------
    tip : wavevector that the tip follows [1/m] and the standard deviation of its logarithm; None without a
        limit
    noise : C of white noise [m^4], or C_1D of a profile [m^3]; None if unknown
    """

    tip: tuple[float, float] | None = None
    noise: float | None = None


class ResolvedRange(NamedTuple):
    """Upper end of the range in which a measured spectrum is the spectrum of the surface.

    Attributes
    ----------
    q1 : proposed cutoff [1/m]; nan if no range is resolved
    limit : reason for the end
        "grid": the spacing of the points. "noise": above, C is noise. "smoothing": above, a tip or filter has
        removed short waves, or the surface has none. "no surface": C never falls like the C of a rough
        surface, or has fewer than five bins. "tip": above, peaks are sharper than the stated tip. "noise
        floor": above, the stated noise is more than a fifth of C.
    error : standard error of ln q1 [-]
        "grid": 0. "noise" and "smoothing": the distance of the bins. "tip": the scatter of four parts of the
        surface. "noise floor": the standard error of ln C over its slope, and the width of a bin.
    """

    q1: float
    limit: Limit
    error: float = 0.0


class MeasuredSpectrum(NamedTuple):
    """A binned power spectrum of measured heights.

    The arrays have one entry for each bin that contains modes.

    Attributes
    ----------
    q : geometric mean of the modes' wavevectors [1/m]
    C : mean over the modes of a bin: C of a map [m^4], C_1D of a profile [m^3] (h_rms^2 = 2 int C_1D dq)
    modes : number of modes, counting q and -q
    relative : standard error of ln C for a Gaussian surface [-]
        C has a chi-squared distribution with 2 n degrees of freedom. The variance of its logarithm is
        trigamma(n), which is 1/n for many modes and 1.64 for one. The number n of independent modes is
        modes / 2 without a window. It is smaller with a window, and if C of a map differs between directions.
        For several profiles, n counts the modes of all profiles, and the error is at least the scatter
        between the profiles.
    cell : area dq_x dq_y of a mode [1/m^2], or length dq of a mode in a profile [1/m]
    left_out : mean square height [m^2] of the modes outside all bins, in the corners of a map
    h_rms : rms of the detrended heights in the window [m]; h_rms^2 = cell sum(modes C) + left_out
    dimensions : 2 for a map, 1 for a profile
    rms_height : rms of the detrended heights without a window [m], Sq or Rq
    rms_slope : rms gradient of a map, or rms slope along a profile [-], from differences of the detrended
        heights of neighbouring points (Sdq, Rdq). It includes noise. An isotropic surface has sqrt(2) times
        the rms slope of its profiles.
    sampling : window and detrending of a profile; None for a map
    unbiased : C(q) of a map [m^4] whose logarithm is right on average. C of few modes has a small logarithm,
        and the mean of a falling C is above C(q). For a profile, it is C_1D.
    together : standard error of its logarithm in a fit to all bins [-]; a window also correlates the modes
        of neighbouring bins of a map
    limits : limits of the instrument, as stated
    remarks : texts of the report on changes of the heights
    """

    q: np.ndarray
    C: np.ndarray
    modes: np.ndarray
    relative: np.ndarray
    cell: float
    left_out: float
    h_rms: float
    dimensions: int
    rms_height: float
    rms_slope: float
    sampling: Sampling | None
    unbiased: np.ndarray
    together: np.ndarray
    limits: InstrumentLimits = InstrumentLimits()
    remarks: tuple[str, ...] = ()

    def to_dataframe(self) -> Any:
        """Return the bins as a pandas.DataFrame: q, C or C_1D, relative_sigma and modes, with units.

        The columns hold `unbiased` and `together`. `fitting.read(frame, normalisation="C")` reads the frame,
        or "C_1D" of a profile. The numbers of the surface are in `attrs`. Raise ImportError if pandas is not
        installed.
        """
        return self._labelled().to_dataframe()

    def to_xarray(self) -> Any:
        """Return the bins as an xarray.Dataset over q. Raise ImportError if xarray is not installed."""
        return self._labelled().to_xarray()

    def _labelled(self) -> LabelledArrays:
        density = Labelled(self.unbiased, "m^4" if self.dimensions == 2 else "m^3")
        numbers = ("cell", "left_out", "h_rms", "dimensions", "rms_height", "rms_slope")
        return LabelledArrays(
            {"q": Labelled(self.q, "1/m")},
            {
                "C" if self.dimensions == 2 else "C_1D": density,
                "relative_sigma": Labelled(self.together, "-"),
                "modes": Labelled(self.modes, "-"),
            },
            ("q",),
            {name: getattr(self, name) for name in numbers},
        )

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
        self._check_positive()
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

    def areal(self) -> ArealSpectrum:
        """Return the areal spectrum C(q) of an isotropic surface from the spectrum of its profiles.

        `areal_spectrum` inverts the projection. Detrending removes most of the first bin, the window spreads
        modes over their neighbours, and bins are means. Therefore C_1D is divided by the ratio of the
        expected bins (`expected_bins`) to the projection, both for the C of the previous inversion.

        For 64 profiles of eleven longest waves, H = 0.5 ... 1 and q_r = 2 q_0 or 4 q_0, the rms height of
        `table` is right within 2.5 % and the rms slope within 1.5 % (ten random surfaces each). With
        q_r = q_0 the rms height is within 4.5 %. Its standard deviation of 2 % is the scatter of the windowed
        heights themselves, which contain few of the longest waves.

        Returns
        -------
        ArealSpectrum at the wavevectors of the bins, and at the outer border of the last bin
            The surface is assumed to have no waves below q[0]. C continues beyond the last bin with the
            slope of the last piece, and ends there if the next bin is smaller by more than q^-20 (a filter).

        Raises
        ------
        ValueError : for a map, if a bin has C = 0, and if C does not decrease at all.
        """
        if self.sampling is None:
            raise ValueError("areal() is for profiles; a map has C already")
        self._check_positive()
        count = bins_before_cliff(self.q, self.C)
        q, C, relative, modes = (x[:count] for x in (self.q, self.C, self.relative, self.modes))
        high = (1.0 + modes.sum()) * self.cell / 2
        q1 = high if count < self.q.size else None
        ends = [high] if q1 else [high, _BEYOND * high][int(high < q[-1] * (1 + 1e-9)) :]
        at = np.append(q, ends)
        spectrum = areal_of_bins(q, C, relative, at, q1, self.cell, modes, self.sampling)
        n = at.size if q1 else at.size - 1
        return ArealSpectrum(spectrum.q[:n], spectrum.C[:n], spectrum.covariance[:n, :n])

    def _check_positive(self):
        if not (self.C > 0).all():
            i = int(np.argmin(self.C))
            raise ValueError(
                f"C[{i}] = {self.C[i]:g} at q = {self.q[i]:g} 1/m: must be > 0; use fewer bins per_decade"
            )

    def table(self) -> TabulatedSpectrum:
        """Return the spectrum for a scene, with the entries of `knots` (map) or `areal` (profile).

        For a map, the rms height of the table is (h_rms^2 - left_out)^(1/2).
        """
        return self.areal().table() if self.dimensions == 1 else TabulatedSpectrum(*self.knots())

    def resolved(self) -> ResolvedRange:
        """Return the upper end of the range in which the spectrum is the spectrum of the surface.

        The slope d ln C / d ln q is fitted over an octave about every bin, or over up to four octaves if
        one octave is not significant. From the largest wavevector downwards, bins are left out while C falls
        significantly more slowly than for H = 0 (noise), or more steeply than for H = 1.1 (smoothing). At the
        border to noise, about half of C is noise. There, q1 is lowered until C is 2.5 times larger, so that
        noise is about a fifth of C. At the border to smoothing, q1 is half an octave lower. If C ends within
        the bins, q1 is the last whole bin.

        Coloured noise that falls like a rough surface is not found. With `window="none"`, the edges of
        a surface that is not periodic hide smoothing. If the radius of the tip or the noise was stated
        (`limits`), the lowest of all ends is returned.
        """
        ends = [self._range_of_slopes(), *self._stated_ranges()]
        return ends[0] if np.isnan(ends[0].q1) else min(ends, key=lambda end: end.q1)

    def _stated_ranges(self):
        """Yield the ends of the range that the tip and the noise set."""
        if self.limits.tip is not None and self.limits.tip[0] < self.q[-1]:
            yield ResolvedRange(max(self.limits.tip[0], float(self.q[0])), "tip", self.limits.tip[1])
        if self.limits.noise is not None and self.q.size >= FEWEST_BINS:
            log_q, log_C = np.log(self.q), np.log(np.maximum(self.C, np.finfo(float).tiny))
            fall, _, line = falls(log_q, log_C, self.relative**-2.0, OCTAVE)
            above = line - np.log(self.limits.noise) - np.log(_OVER_FLOOR)
            below = np.flatnonzero(above < 0)
            # A maximum of C may lie above the first bins.
            below = below[below > np.argmax(line)]
            if below.size:
                i = int(below[0])
                at = np.interp(0.0, [above[i], above[i - 1]], [log_q[i], log_q[i - 1]])
                # A position within a bin is uniformly distributed.
                bin_error = (log_q[i] - log_q[i - 1]) / np.sqrt(12)
                error = np.hypot(self.relative[i] / max(fall[i], 1.0), bin_error)
                yield ResolvedRange(float(np.exp(at)), "noise floor", float(error))

    def _range_of_slopes(self):
        """Return the end of the range that the slope of C shows."""
        begin, end = whole_bins(self.q, self.C) if self.q.size >= FEWEST_BINS else (0, 0)
        if end - begin < FEWEST_BINS:
            return ResolvedRange(np.nan, "no surface")
        q, C, relative = (x[begin:end] for x in (self.q, self.C, self.relative))
        log_q, log_C = np.log(q), np.log(np.maximum(C, np.finfo(float).tiny))
        states, falling, level = states_of_bins(log_q, log_C, relative**-2.0, self.dimensions)
        last = last_rough(states, log_q)
        if last < 0 or not falling[: last + 1].any():
            return ResolvedRange(np.nan, "no surface")
        if last == q.size - 1 and end == self.q.size:
            return ResolvedRange(float(q[-1]), "grid")
        if last == q.size - 1:
            return ResolvedRange(float(q[-1]), "smoothing", float(np.log(self.q[end] / q[-1])))
        step = float(log_q[last + 1] - log_q[last])
        if states[last + 1] == SMOOTHED:
            return ResolvedRange(float(max(q[last] / np.sqrt(2), q[0])), "smoothing", step)
        above = np.flatnonzero(level[: last + 1] > level[last] + np.log(_ABOVE_NOISE))
        return ResolvedRange(float(q[above[-1] if above.size else 0]), "noise", step)

    def report(self) -> str:
        """Return a text with rms height and slope, the range without noise and smoothing, and proposed q1."""
        kind = ("profile", "map")[self.dimensions - 1]
        along = " along the profile" * (self.dimensions == 1)
        resolved, lines = self.resolved(), [f"Spectrum of a {kind}, {self.q[0]:.4g} ... {self.q[-1]:.4g} 1/m"]
        lines.append(f"rms height {self.rms_height:.4g} m")
        lines.append(f"rms slope{along} {self.rms_slope:.4g}, from neighbouring points")
        lines += [*self.remarks, _TEXT[resolved.limit]]
        if np.isfinite(resolved.q1):
            table = self.table()
            to_q1 = float(rms_slope(table, resolved.q1))
            bar = f" +/- {resolved.error:.0%}" * (resolved.error > 0)
            lines.append(
                f"resolved up to q = {resolved.q1:.4g} 1/m{bar}, with rms slope {to_q1:.4g} of the surface"
            )
            if to_q1 > _LARGER * self.rms_slope * (1 if self.dimensions == 2 else np.sqrt(2)):
                lines.append(
                    'larger than the slope of the heights: edges that do not match (window "none"), or'
                    " roughness that differs between places, increase C"
                )
            if to_q1 > _USUAL_SLOPE:
                usual = float(cutoff(table, _USUAL_SLOPE))
                lines.append(
                    f"rms slope {_USUAL_SLOPE:g}, as usual for rubber on roads, up to q = {usual:.4g} 1/m"
                )
        return "\n    ".join(lines) + "\n"


def _log_mean_square(log_q, log_C, dimensions):
    """Return ln(2 pi int q C dq) of a log-log linear C, or ln(2 int C dq) if `dimensions` is 1."""
    log_term = log_C + dimensions * log_q
    widths = scipy.special.exprel(np.diff(log_term)) * np.diff(log_q)
    factor = 2 * np.pi if dimensions == 2 else 2.0
    return np.log(factor) + scipy.special.logsumexp(log_term[:-1], b=widths)
