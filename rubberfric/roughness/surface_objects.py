"""Spectra of topography objects of SurfaceTopography and contact.engineering.

These packages are not imported. Any object with `heights()`, `physical_sizes`, `nb_grid_pts` and `unit` is
accepted.
"""

from typing import Any

import numpy as np

from rubberfric.base.checks import shown
from rubberfric.roughness.measured import MeasuredSpectrum
from rubberfric.roughness.topography import spectrum_of_profile, spectrum_of_topography

# Units of lengths and heights [m].
LENGTH_UNITS = {
    "m": 1.0,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "\u00b5m": 1e-6,
    "\u03bcm": 1e-6,
    "nm": 1e-9,
    "\u00c5": 1e-10,
    "pm": 1e-12,
}
_NEEDED = ("heights", "physical_sizes", "nb_grid_pts")


def spectrum_of_surface(topography: Any, *, unit: str | None = None, **options: Any) -> MeasuredSpectrum:
    r"""Return the spectrum of a topography object, which is C(q) of a map or C_1D(q) of a line scan.

    The function runs on the host.

    Parameters
    ----------
    topography : a uniform line scan or map of SurfaceTopography, or an object with `heights()`,
        `physical_sizes`, `nb_grid_pts`, and optionally `unit` and `is_periodic`
    unit : "m", "mm", "um", "nm", ..., unit of lengths and heights, if the topography has no unit
    window, detrend, per_decade : as in `spectrum_of_topography`; the defaults for a periodic surface are
        "none" and 0

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


def _scale(own, given):
    if own is None and given is None:
        names = ", ".join(LENGTH_UNITS)
        raise ValueError(f"unit is missing and the topography has none; pass one of {names}")
    if own is not None and given is not None and own != given:
        raise ValueError(f"unit = {shown(given)}: leave it out; the topography has {shown(own)}")
    unit = given if own is None else own
    if not isinstance(unit, str) or unit not in LENGTH_UNITS:
        raise ValueError(f"unit = {shown(unit)}: must be one of {', '.join(LENGTH_UNITS)}")
    return LENGTH_UNITS[unit]
