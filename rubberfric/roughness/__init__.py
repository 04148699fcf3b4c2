"""Roughness: power spectra, their moments and normalisations, and spectra of measured heights."""

from rubberfric.roughness.anisotropy import Anisotropic, TabulatedAnisotropic, from_grid, harmonics_left_out
from rubberfric.roughness.joining import JoinedSpectra, Joint, join_spectra, resample
from rubberfric.roughness.measured import MeasuredSpectrum, ResolvedRange
from rubberfric.roughness.moments import cutoff, moment, rms_height, rms_slope, with_cutoff
from rubberfric.roughness.normalisation import (
    LINES,
    NORMALISATION_RULE,
    areal_spectrum,
    check_normalisation,
    line_spectrum,
    spectrum_as,
    spectrum_from,
)
from rubberfric.roughness.spectra import SelfAffine, log_power_spectrum, power_spectrum
from rubberfric.roughness.tabulated import TabulatedSpectrum
from rubberfric.roughness.topography import spectrum_of_profile, spectrum_of_surface, spectrum_of_topography

__all__ = [
    "LINES",
    "NORMALISATION_RULE",
    "Anisotropic",
    "JoinedSpectra",
    "Joint",
    "MeasuredSpectrum",
    "ResolvedRange",
    "SelfAffine",
    "TabulatedAnisotropic",
    "TabulatedSpectrum",
    "areal_spectrum",
    "check_normalisation",
    "cutoff",
    "from_grid",
    "harmonics_left_out",
    "join_spectra",
    "line_spectrum",
    "log_power_spectrum",
    "moment",
    "power_spectrum",
    "resample",
    "rms_height",
    "rms_slope",
    "spectrum_as",
    "spectrum_from",
    "spectrum_of_profile",
    "spectrum_of_surface",
    "spectrum_of_topography",
    "with_cutoff",
]
