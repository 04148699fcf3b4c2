"""rubberfric: differentiable rubber friction after Scaraggi and Persson."""

from typing import TYPE_CHECKING

from rubberfric import analysis, io, materials, plot, roughness
from rubberfric.analysis import FrictionMap, friction_map
from rubberfric.base import units
from rubberfric.base.progress import progress
from rubberfric.base.quadrature import Quadrature
from rubberfric.io import load_scene, save_scene
from rubberfric.materials import (
    WLF,
    Arrhenius,
    Coating,
    Elastic,
    Entropic,
    Prony,
    PronyShear,
    Rigid,
    Slab,
    TabulatedModulus,
    TabulatedShift,
    TabulatedVertical,
    complex_modulus,
)
from rubberfric.roughness import (
    Anisotropic,
    SelfAffine,
    TabulatedAnisotropic,
    TabulatedSpectrum,
    power_spectrum,
    rms_slope,
    with_cutoff,
)
from rubberfric.scene import (
    Adhesion,
    Body,
    ContactShear,
    Correlation,
    Heating,
    Scene,
    Softening,
    ThermalProperties,
)
from rubberfric.theory import Solution, contact_area, friction, quantities_of, separation, solve

__all__ = [
    "WLF",
    "Adhesion",
    "Anisotropic",
    "Arrhenius",
    "Body",
    "Coating",
    "ContactShear",
    "Correlation",
    "Elastic",
    "Entropic",
    "FrictionMap",
    "Heating",
    "Prony",
    "PronyShear",
    "Quadrature",
    "Rigid",
    "Scene",
    "SelfAffine",
    "Slab",
    "Softening",
    "Solution",
    "TabulatedAnisotropic",
    "TabulatedModulus",
    "TabulatedShift",
    "TabulatedSpectrum",
    "TabulatedVertical",
    "ThermalProperties",
    "analysis",
    "complex_modulus",
    "contact_area",
    "friction",
    "friction_map",
    "io",
    "load_scene",
    "materials",
    "plot",
    "power_spectrum",
    "progress",
    "quantities_of",
    "rms_slope",
    "roughness",
    "save_scene",
    "separation",
    "solve",
    "units",
    "with_cutoff",
]

# What is looked for here, and is in the package beside.
_FITTING = (
    "AreaData",
    "Bounded",
    "FitResult",
    "Free",
    "FrictionData",
    "Gaussian",
    "KramersKronig",
    "MasterCurve",
    "ModulusData",
    "Positive",
    "PronyFit",
    "Smooth",
    "SpectrumData",
    "SpectrumFit",
    "Tied",
    "fit",
    "fit_master_curve",
    "fit_prony",
    "fit_spectrum",
    "kramers_kronig",
    "sensitivity",
    "softening_from_sweep",
)


def __dir__():
    """The public names only."""
    return sorted(__all__)


if not TYPE_CHECKING:  # a checker would take every name for one that is here

    def __getattr__(name):
        """Say where a name is that is not here."""
        if name in _FITTING:  # an AttributeError would lose its text in "from rubberfric import fit"
            raise ImportError(f"rubberfric has no {name!r}, fitting has: from fitting import {name}")
        raise AttributeError(f"module 'rubberfric' has no attribute {name!r}")
