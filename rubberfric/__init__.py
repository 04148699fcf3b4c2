"""rubberfric: differentiable rubber friction after Scaraggi and Persson."""

from rubberfric.base.process.lazy import lazily
from rubberfric.base.process.release import VERSION

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric import analysis, io, materials, plot, roughness
    from rubberfric.analysis import FrictionMap, friction_map
    from rubberfric.base import units
    from rubberfric.base.checks import UnitWarning
    from rubberfric.base.process.compilation_cache import compilation_cache
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
    "UnitWarning",
    "analysis",
    "compilation_cache",
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

__version__ = VERSION

# What is looked for here, and is in the package beside.
_FITTING = (
    "AreaData Bounded FitResult Free FrictionData Gaussian KramersKronig MasterCurve ModulusData Positive "
    "PronyFit Smooth SpectrumData SpectrumFit Tied fit fit_master_curve fit_prony fit_spectrum "
    "kramers_kronig sensitivity softening_from_sweep"
)

lazily(
    __name__,
    {
        "rubberfric.analysis": "FrictionMap friction_map",
        "rubberfric.base.checks": "UnitWarning",
        "rubberfric.base.process.compilation_cache": "compilation_cache",
        "rubberfric.base.progress": "progress",
        "rubberfric.base.quadrature": "Quadrature",
        "rubberfric.io": "load_scene save_scene",
        "rubberfric.scene": (
            "Adhesion Body ContactShear Correlation Heating Scene Softening ThermalProperties"
        ),
        "rubberfric.theory": "Solution contact_area friction quantities_of separation solve",
        "rubberfric.materials": (
            "WLF Arrhenius Coating Elastic Entropic Prony PronyShear Rigid Slab TabulatedModulus "
            "TabulatedShift TabulatedVertical complex_modulus"
        ),
        "rubberfric.roughness": (
            "Anisotropic SelfAffine TabulatedAnisotropic TabulatedSpectrum power_spectrum rms_slope "
            "with_cutoff"
        ),
    },
    modules=(
        "rubberfric.analysis",
        "rubberfric.io",
        "rubberfric.materials",
        "rubberfric.plot",
        "rubberfric.roughness",
        "rubberfric.base.units",
    ),
    elsewhere={"fitting": _FITTING},
)
