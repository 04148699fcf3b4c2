"""Spectra of measured heights as data of a fit: which wavevectors are used, and up to which one."""

import numpy as np

from fitting.data.kinds import SpectrumData
from rubberfric.roughness import ArealSpectrum, MeasuredSpectrum, whole_bins

# Wavevectors below which a fit of three parameters says little.
_LEAST_FITTED = 4
# Standard error of ln C from which on C is not used, because it is unknown by a factor of e.
_UNKNOWN = 1.0


def spectrum_data(measured: MeasuredSpectrum | ArealSpectrum) -> SpectrumData:
    """Return C with standard errors from the spectrum of measured heights.

    The data of a map are `MeasuredSpectrum.unbiased` and its errors for a fit to all bins.

    The bins of profiles become the spectrum of an isotropic surface (`MeasuredSpectrum.areal`). Its errors
    contain the correlation of neighbouring entries. Its first entry is left out, because it also contains
    waves longer than the profiles, and so are entries whose standard error of ln C is 1 or more, and the
    extrapolated end.

    Parameters
    ----------
    measured : result of `rubberfric.roughness.spectrum_of_topography`, `spectrum_of_profile` or
        `areal_spectrum`

    Raises
    ------
    ValueError : if `measured` has another type, or if no entry remains.

    Examples
    --------
    >>> x, traces = rf.io.read_traces("data/laboratory/stylus.csv")
    >>> measured = rf.roughness.spectrum_of_profile(x, traces, per_decade=10)
    >>> data = fitting.spectrum_data(measured)
    >>> len(data) < measured.q.size, bool(np.all(data.relative < 1))
    (True, True)
    """
    if isinstance(measured, MeasuredSpectrum) and measured.dimensions == 2:
        return SpectrumData(measured.q, measured.unbiased, relative=measured.together)
    if isinstance(measured, MeasuredSpectrum):
        first, count, areal = 1, measured.q.size, measured.areal()
    elif isinstance(measured, ArealSpectrum):
        first, count, areal = 0, measured.q.size, measured
    else:
        raise ValueError(
            f"measured is a {type(measured).__name__}: pass a MeasuredSpectrum or an ArealSpectrum"
        )
    q, C, relative = (np.asarray(x)[first:count] for x in (areal.q, areal.C, areal.relative))
    known = relative < _UNKNOWN
    if not known.any():
        raise ValueError(
            "measured: all standard errors of ln C are 1 or more; measure more or longer profiles"
        )
    covariance = np.asarray(areal.covariance)[first:count, first:count][np.ix_(known, known)]
    # The variance of a mean of several entries contains the sums of the rows.
    together = np.sqrt(np.maximum(covariance.sum(1), np.diagonal(covariance)))
    return SpectrumData(q[known], C[known], relative=together)


def resolved_ends(measured: MeasuredSpectrum | ArealSpectrum) -> tuple[float | None, float | None]:
    """Return the first and last wavevector to fit [1/m]. None stands for the end of the data."""
    if isinstance(measured, ArealSpectrum):
        return float(measured.q[0]), None
    begin, _ = whole_bins(measured.q, measured.C)
    q1 = measured.resolved().q1
    enough = np.sum((measured.q >= measured.q[begin]) & (measured.q <= q1))
    q0 = float(measured.q[begin]) if measured.dimensions == 1 or begin > 0 else None
    return q0, q1 if enough > _LEAST_FITTED + (measured.dimensions == 1) else None
