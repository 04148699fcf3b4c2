"""rubberfric: differentiable rubber friction after Scaraggi and Persson."""

from rubberfric.layers import Slab
from rubberfric.materials import Elastic, Prony, Rigid, TabulatedModulus, complex_modulus
from rubberfric.scene import Body, Scene
from rubberfric.shifts import WLF, Arrhenius, TabulatedShift
from rubberfric.spectra import SelfAffine, TabulatedSpectrum, moment, power_spectrum, rms_slope

__all__ = [
    "WLF",
    "Arrhenius",
    "Body",
    "Elastic",
    "Prony",
    "Rigid",
    "Scene",
    "SelfAffine",
    "Slab",
    "TabulatedModulus",
    "TabulatedShift",
    "TabulatedSpectrum",
    "complex_modulus",
    "moment",
    "power_spectrum",
    "rms_slope",
]
