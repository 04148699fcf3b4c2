"""Materials: moduli over frequency, their shift with temperature, and layers of them."""

from rubberfric.materials.coating import Coating
from rubberfric.materials.materials import (
    Elastic,
    Prony,
    PronyShear,
    Rigid,
    TabulatedModulus,
    complex_modulus,
)
from rubberfric.materials.shifts import WLF, Arrhenius, TabulatedShift
from rubberfric.materials.slab import Slab

__all__ = [
    "Arrhenius",
    "Coating",
    "Elastic",
    "Prony",
    "PronyShear",
    "Rigid",
    "Slab",
    "TabulatedModulus",
    "TabulatedShift",
    "WLF",
    "complex_modulus",
]
