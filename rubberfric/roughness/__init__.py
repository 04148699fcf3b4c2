"""Roughness: power spectra, their moments and normalisations, and spectra of measured heights."""

from rubberfric.base.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.roughness.anisotropy import Anisotropic as Anisotropic
    from rubberfric.roughness.anisotropy import TabulatedAnisotropic as TabulatedAnisotropic
    from rubberfric.roughness.anisotropy import from_grid as from_grid
    from rubberfric.roughness.anisotropy import harmonics_left_out as harmonics_left_out
    from rubberfric.roughness.heights import FilledCavities as FilledCavities
    from rubberfric.roughness.heights import detrended as detrended
    from rubberfric.roughness.heights import fill_cavities as fill_cavities
    from rubberfric.roughness.heights import fill_holes as fill_holes
    from rubberfric.roughness.heights import find_outliers as find_outliers
    from rubberfric.roughness.heights import top_heights as top_heights
    from rubberfric.roughness.joining import JoinedSpectra as JoinedSpectra
    from rubberfric.roughness.joining import Joint as Joint
    from rubberfric.roughness.joining import join_spectra as join_spectra
    from rubberfric.roughness.joining import resample as resample
    from rubberfric.roughness.lines import ArealSpectrum as ArealSpectrum
    from rubberfric.roughness.lines import areal_spectrum as areal_spectrum
    from rubberfric.roughness.measured import InstrumentLimits as InstrumentLimits
    from rubberfric.roughness.measured import MeasuredSpectrum as MeasuredSpectrum
    from rubberfric.roughness.measured import ResolvedRange as ResolvedRange
    from rubberfric.roughness.moments import LARGEST_WAVEVECTOR as LARGEST_WAVEVECTOR
    from rubberfric.roughness.moments import cutoff as cutoff
    from rubberfric.roughness.moments import moment as moment
    from rubberfric.roughness.moments import rms_height as rms_height
    from rubberfric.roughness.moments import rms_slope as rms_slope
    from rubberfric.roughness.moments import with_cutoff as with_cutoff
    from rubberfric.roughness.normalisation import LINES as LINES
    from rubberfric.roughness.normalisation import NORMALISATION_RULE as NORMALISATION_RULE
    from rubberfric.roughness.normalisation import check_normalisation as check_normalisation
    from rubberfric.roughness.normalisation import density_column as density_column
    from rubberfric.roughness.normalisation import density_of_levels as density_of_levels
    from rubberfric.roughness.normalisation import find_normalisation as find_normalisation
    from rubberfric.roughness.normalisation import heights_by_normalisation as heights_by_normalisation
    from rubberfric.roughness.normalisation import spectrum_as as spectrum_as
    from rubberfric.roughness.normalisation import spectrum_from as spectrum_from
    from rubberfric.roughness.periodograms import whole_bins as whole_bins
    from rubberfric.roughness.projections import line_spectrum as line_spectrum
    from rubberfric.roughness.spectra import SelfAffine as SelfAffine
    from rubberfric.roughness.spectra import log_power_spectrum as log_power_spectrum
    from rubberfric.roughness.spectra import power_spectrum as power_spectrum
    from rubberfric.roughness.tabulated import TabulatedSpectrum as TabulatedSpectrum
    from rubberfric.roughness.topography import spectrum_of_profile as spectrum_of_profile
    from rubberfric.roughness.topography import spectrum_of_surface as spectrum_of_surface
    from rubberfric.roughness.topography import spectrum_of_topography as spectrum_of_topography

lazily(__name__, __file__, load=True)
