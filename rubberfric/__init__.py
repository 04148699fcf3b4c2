"""rubberfric: differentiable rubber friction after Scaraggi and Persson."""

from rubberfric import plot, units
from rubberfric.anisotropy import Anisotropic, TabulatedAnisotropic, from_grid, harmonics_left_out
from rubberfric.coating import Coating
from rubberfric.files import load_scene, save_scene
from rubberfric.heating import Heating
from rubberfric.interface import SeparationProfile, contact_stiffness, separation_profile, stress_distribution
from rubberfric.joining import JoinedSpectra, Joint, join_spectra, resample
from rubberfric.layers import Slab
from rubberfric.maps import FrictionMap, friction_map
from rubberfric.materials import Elastic, Prony, PronyShear, Rigid, TabulatedModulus, complex_modulus
from rubberfric.model import Solution, contact_area, friction, quantities_of, separation, solve
from rubberfric.moments import cutoff, moment, rms_height, rms_slope, with_cutoff
from rubberfric.outside import friction_outside_table
from rubberfric.power import DissipatedPower, dissipated_power
from rubberfric.profiles import Profile, profile
from rubberfric.progress import progress
from rubberfric.prony_reading import read_prony
from rubberfric.prony_writing import write_prony
from rubberfric.psd import areal_spectrum, line_spectrum, spectrum_as, spectrum_from
from rubberfric.quadrature import Quadrature
from rubberfric.scene import Body, Scene
from rubberfric.shear import ContactShear
from rubberfric.shifts import WLF, Arrhenius, TabulatedShift
from rubberfric.softening import Softening
from rubberfric.spectra import SelfAffine, TabulatedSpectrum, power_spectrum
from rubberfric.surfaces import spectrum_of_surface
from rubberfric.sweep import accuracy
from rubberfric.tables import read_columns
from rubberfric.topography import MeasuredSpectrum, spectrum_of_profile, spectrum_of_topography

__all__ = [
    "WLF",
    "Anisotropic",
    "Arrhenius",
    "Body",
    "Coating",
    "ContactShear",
    "DissipatedPower",
    "Elastic",
    "FrictionMap",
    "Heating",
    "JoinedSpectra",
    "Joint",
    "MeasuredSpectrum",
    "Profile",
    "Prony",
    "PronyShear",
    "Quadrature",
    "Rigid",
    "Scene",
    "SelfAffine",
    "SeparationProfile",
    "Slab",
    "Softening",
    "Solution",
    "TabulatedAnisotropic",
    "TabulatedModulus",
    "TabulatedShift",
    "TabulatedSpectrum",
    "accuracy",
    "areal_spectrum",
    "complex_modulus",
    "contact_area",
    "contact_stiffness",
    "cutoff",
    "dissipated_power",
    "friction",
    "friction_map",
    "friction_outside_table",
    "from_grid",
    "harmonics_left_out",
    "join_spectra",
    "line_spectrum",
    "load_scene",
    "moment",
    "plot",
    "power_spectrum",
    "profile",
    "progress",
    "quantities_of",
    "read_columns",
    "read_prony",
    "resample",
    "rms_height",
    "rms_slope",
    "save_scene",
    "separation",
    "separation_profile",
    "solve",
    "spectrum_as",
    "spectrum_from",
    "spectrum_of_profile",
    "spectrum_of_surface",
    "spectrum_of_topography",
    "stress_distribution",
    "units",
    "with_cutoff",
    "write_prony",
]
