"""rubberfric: differentiable rubber friction after Scaraggi and Persson."""

from rubberfric.files import load_scene, save_scene
from rubberfric.joining import JoinedSpectra, Joint, join_spectra, resample
from rubberfric.layers import Slab
from rubberfric.materials import Elastic, Prony, Rigid, TabulatedModulus, complex_modulus
from rubberfric.model import Solution, contact_area, friction, friction_outside_table, separation, solve
from rubberfric.psd import areal_spectrum, line_spectrum, spectrum_as, spectrum_from
from rubberfric.quadrature import Quadrature
from rubberfric.scene import Body, Scene
from rubberfric.shear import ContactShear
from rubberfric.shifts import WLF, Arrhenius, TabulatedShift
from rubberfric.spectra import SelfAffine, TabulatedSpectrum, moment, power_spectrum, rms_slope
from rubberfric.sweep import accuracy
from rubberfric.topography import MeasuredSpectrum, spectrum_of_profile, spectrum_of_topography

__all__ = [
    "WLF",
    "Arrhenius",
    "Body",
    "ContactShear",
    "Elastic",
    "JoinedSpectra",
    "Joint",
    "MeasuredSpectrum",
    "Prony",
    "Quadrature",
    "Rigid",
    "Scene",
    "SelfAffine",
    "Slab",
    "Solution",
    "TabulatedModulus",
    "TabulatedShift",
    "TabulatedSpectrum",
    "accuracy",
    "areal_spectrum",
    "complex_modulus",
    "contact_area",
    "friction",
    "friction_outside_table",
    "join_spectra",
    "line_spectrum",
    "load_scene",
    "moment",
    "power_spectrum",
    "resample",
    "rms_slope",
    "save_scene",
    "separation",
    "solve",
    "spectrum_as",
    "spectrum_from",
    "spectrum_of_profile",
    "spectrum_of_topography",
]
