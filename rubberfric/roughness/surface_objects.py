"""Spectra of topographies as SurfaceTopography and contact.engineering have them.

Nothing is imported from there: what has `heights()`, `physical_sizes`, `nb_grid_pts` and `unit` will do.
"""

from typing import Any

import numpy as np

from rubberfric.base.checks import shown
from rubberfric.roughness.topography import MeasuredSpectrum, spectrum_of_profile, spectrum_of_topography

# Of lengths and heights [m].
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
    r"""Spectrum of a topography object: C(q) of a map, C_1D(q) of a line scan; host-side.

    Parameters
    ----------
    topography : a uniform line scan or map of SurfaceTopography, or anything with its `heights()`,
        `physical_sizes`, `nb_grid_pts`, and if it has them `unit` and `is_periodic`
    unit : "m", "mm", "um", "nm", ..., of lengths and heights; only for a topography without
    window, detrend, per_decade : as in `spectrum_of_topography`; of a periodic surface "none" and 0
        unless they are given

    Returns
    -------
    MeasuredSpectrum, in SI

    Raises
    ------
    ValueError : one line; no such object, no unit or an unknown one, points that are missing or not
        evenly spaced, and as `spectrum_of_topography`.

    Notes
    -----
    Spectra that SurfaceTopography made itself are converted by `spectrum_from`: "C_iso" those of
    `power_spectrum_from_area`, "C_1D_surfacetopography" those of `power_spectrum_from_profile`,
    once q and C are in SI and masked entries are left out.
    """
    for name in _NEEDED:
        if not hasattr(topography, name):
            raise ValueError(
                f"topography is a {type(topography).__name__} without {name}: must be one of"
                " SurfaceTopography; give arrays to spectrum_of_topography or spectrum_of_profile"
            )
    if not getattr(topography, "is_uniform", True):
        raise ValueError("topography: has points at uneven distances: must be uniform; interpolate before")
    scale = _scale(getattr(topography, "unit", None), unit)
    heights = topography.heights()
    if np.ma.is_masked(heights):
        raise ValueError("topography: has undefined points: must have none; fill in before")
    sizes, counts = np.atleast_1d(topography.physical_sizes), np.atleast_1d(topography.nb_grid_pts)
    if sizes.shape != counts.shape or np.shape(heights) != tuple(counts):
        raise ValueError(
            f"topography: heights of shape {np.shape(heights)}, nb_grid_pts {tuple(counts.tolist())},"
            f" physical_sizes {tuple(sizes.tolist())}: must have as many entries, 1 or 2"
        )
    spacings = scale * sizes / counts
    if getattr(topography, "is_periodic", False):
        options = {"window": "none", "detrend": 0} | options
    if len(spacings) == 1:
        return spectrum_of_profile(float(spacings[0]), scale * np.asarray(heights), **options)
    return spectrum_of_topography(scale * np.asarray(heights), *map(float, spacings), **options)


def _scale(own, given):
    """Metres per unit."""
    if own is None and given is None:
        names = ", ".join(LENGTH_UNITS)
        raise ValueError(f"unit is missing: must be given, the topography has none; one of {names}")
    if own is not None and given is not None and own != given:
        raise ValueError(f"unit = {shown(given)}: must not be given; the topography has {shown(own)}")
    unit = given if own is None else own
    if not isinstance(unit, str) or unit not in LENGTH_UNITS:
        raise ValueError(f"unit = {shown(unit)}: must be one of {', '.join(LENGTH_UNITS)}")
    return LENGTH_UNITS[unit]
