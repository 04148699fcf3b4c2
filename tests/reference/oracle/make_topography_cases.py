"""Writes topography_cases.json: roughness of the five surfaces of `support.cases.heights`.

    pip install SurfaceTopography      (MIT; in an environment of its own, it is no dependency of the project)
    PYTHONPATH=tests python tests/reference/oracle/make_topography_cases.py

SurfaceTopography computes rms height and rms slope after removing the mean plane or line. It also computes
the mean of the power spectrum over octaves of wavevectors, without a window and with a Hann window. Arguments
are paths of files in its formats. Their numbers are printed in the same form, and not stored.
"""

import json
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import SurfaceTopography
from support.cases.heights import surfaces

PATH = Path(__file__).parents[1] / "topography_cases.json"


def octaves(topography):
    """Borders of octaves from below the first wavevector up to the largest complete one [1/m]."""
    q = [np.pi * n / s for n, s in zip(topography.nb_grid_pts, topography.physical_sizes, strict=True)]
    first = min(2 * np.pi / s for s in topography.physical_sizes)
    return 0.99 * first * 2.0 ** np.arange(np.floor(np.log2(min(q) / (0.99 * first))) + 1)


def as_topography(heights, sizes, **options):
    if heights.ndim == 2:
        return SurfaceTopography.Topography(heights, sizes, **options)
    return SurfaceTopography.UniformLineScan(heights, sizes[0], **options)


def evaluate(heights, sizes):
    flat = as_topography(heights, sizes, periodic=False).detrend("height")
    borders = octaves(flat)
    case = {"borders": borders.tolist()}
    if heights.ndim == 2:
        case |= {"rms_height": flat.rms_height_from_area(), "rms_slope": flat.rms_gradient()}
    else:
        case |= {"rms_height": flat.rms_height_from_profile(), "rms_slope": flat.rms_slope_from_profile()}
    for window, periodic in (("none", True), ("hann", False)):
        one = as_topography(flat.heights(), sizes, periodic=periodic)
        spectrum = one.power_spectrum_from_area if heights.ndim == 2 else one.power_spectrum_from_profile
        case[window] = np.ma.filled(spectrum(collocation=borders)[1], np.nan).tolist()
    return case


def main():
    cases = {"SurfaceTopography": version("SurfaceTopography")}
    for name, (heights, spacings) in surfaces().items():
        cases[name] = evaluate(heights, tuple(n * d for n, d in zip(heights.shape, spacings, strict=True)))
    PATH.write_text(json.dumps(cases, indent=1) + "\n")
    for path in sys.argv[1:]:
        measured = SurfaceTopography.read_topography(path).to_unit("m")
        print(json.dumps({path: evaluate(measured.heights(), measured.physical_sizes)}, indent=1))


if __name__ == "__main__":
    main()
