"""Materials: moduli over frequency, their shift with temperature, and layered materials."""

from rubberfric.materials.coating import Coating
from rubberfric.materials.material import Elastic, Material, Rigid, complex_modulus
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.materials.shifts import (
    WLF,
    Arrhenius,
    Entropic,
    Shift,
    TabulatedShift,
    TabulatedVertical,
    VerticalShift,
)
from rubberfric.materials.slab import Layer, Slab
from rubberfric.materials.tabulated_modulus import TabulatedModulus

__all__ = [
    "WLF",
    "Arrhenius",
    "Coating",
    "Elastic",
    "Entropic",
    "Layer",
    "Material",
    "Prony",
    "PronyShear",
    "Rigid",
    "Shift",
    "Slab",
    "TabulatedModulus",
    "TabulatedShift",
    "TabulatedVertical",
    "VerticalShift",
    "complex_modulus",
]
