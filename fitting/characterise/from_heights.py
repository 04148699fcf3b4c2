"""Spectra of measured heights as data of a fit: which wavevectors are used, and up to which one."""

import numpy as np
import scipy

import rubberfric as rf
from fitting.data.kinds import SpectrumData
from rubberfric.roughness import ArealSpectrum, MeasuredSpectrum, bins_before_cliff

# Wavevectors below which a fit of three parameters says little.
_LEAST_FITTED = 4
# Standard error of ln C from which on C is not used, because it is unknown by a factor of e.
_UNKNOWN = 1.0
# Ratio of the h_rms of a fit to the rms height of profiles from which on they contradict each other. Few long
# waves fit into a profile, so its rms height scatters.
_TOO_HIGH = 2.0
# Distance of ln q_r from the ends of a spectrum, whose table has an entry at each.
_INSIDE = 1e-9


def spectrum_data(measured: MeasuredSpectrum | ArealSpectrum) -> SpectrumData:
    """Return C with standard errors from the spectrum of measured heights.

    The bins of a map are unchanged. The bins of profiles become the spectrum of an isotropic surface
    (`MeasuredSpectrum.areal`). Its first entry is left out, because it also contains waves longer than the
    profiles, and so are entries whose standard error of ln C is 1 or more, and the extrapolated end.

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
        return SpectrumData(measured.q, measured.C, relative=measured.relative)
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
    return SpectrumData(q[known], C[known], relative=relative[known])


def resolved_ends(measured: MeasuredSpectrum | ArealSpectrum) -> tuple[float | None, float | None]:
    """Return the first and last wavevector to fit [1/m]. None stands for the end of the data."""
    if isinstance(measured, ArealSpectrum):
        return float(measured.q[0]), None
    # A spectrum that ends within the last bins, as of a synthetic surface, has no resolved slope there.
    last = bins_before_cliff(measured.q, measured.C) - 1
    q1 = min(measured.resolved().q1, float(measured.q[last]))
    enough = np.sum(measured.q <= q1) > _LEAST_FITTED + (measured.dimensions == 1)
    return float(measured.q[0]) if measured.dimensions == 1 else None, q1 if enough else None


def rolloff_for_height(level: float, slope: float, q0: float, q1: float, height: float) -> float | None:
    r"""Return the roll-off q_r [1/m] for which C has a given rms height, or None if q_r = q0 agrees with it.

    .. math:: C = C_0 (\max(q, q_r) / q_0)^{-s}, \qquad h^2 = 2\pi \int_{q_0}^{q_1} q\, C\, dq

    Long waves decide h_rms of a spectrum without a roll-off. If their C is unknown, the heights limit it.

    Parameters
    ----------
    level, slope : ln C_0 [m^4], and s > 0, of the decrease
    q0, q1 : ends of the spectrum [1/m]
    height : rms height of the profiles [m]
    """
    ends = np.log(q0) + _INSIDE, np.log(q1) - _INSIDE

    def excess(log_qr):
        qr = np.exp(log_qr)
        plateau, end = np.exp(level - slope * np.log(np.array([qr, q1]) / q0))
        spectrum = rf.TabulatedSpectrum([q0, qr, q1], [plateau, plateau, end])
        return float(rf.roughness.rms_height(spectrum)) - height

    if excess(ends[0]) < (_TOO_HIGH - 1) * height:
        return None
    # The rms height decreases with q_r, because C decreases at all q < q_r.
    return q1 if excess(ends[1]) > 0 else float(np.exp(scipy.optimize.brentq(excess, *ends)))
