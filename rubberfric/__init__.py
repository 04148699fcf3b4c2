"""rubberfric: differentiable rubber friction after Scaraggi and Persson."""

from rubberfric.coating import Coating
from rubberfric.files import load_scene, save_scene
from rubberfric.layers import Slab
from rubberfric.materials import Elastic, Prony, PronyShear, Rigid, TabulatedModulus, complex_modulus
from rubberfric.model import Solution, contact_area, friction, friction_outside_table, separation, solve
from rubberfric.quadrature import Quadrature
from rubberfric.scene import Body, Scene
from rubberfric.shear import ContactShear
from rubberfric.shifts import WLF, Arrhenius, TabulatedShift
from rubberfric.spectra import SelfAffine, TabulatedSpectrum, moment, power_spectrum, rms_slope
from rubberfric.sweep import accuracy

__all__ = [
    "WLF",
    "Arrhenius",
    "Body",
    "Coating",
    "ContactShear",
    "Elastic",
    "Prony",
    "PronyShear",
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
    "complex_modulus",
    "contact_area",
    "friction",
    "friction_outside_table",
    "load_scene",
    "moment",
    "power_spectrum",
    "rms_slope",
    "save_scene",
    "separation",
    "solve",
]
