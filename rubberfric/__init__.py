"""rubberfric: differentiable rubber friction after Scaraggi and Persson."""

from rubberfric.base.lazy import lazily
from rubberfric.base.release import VERSION

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric import analysis as analysis
    from rubberfric import applications as applications
    from rubberfric import fitting as fitting
    from rubberfric import io as io
    from rubberfric import materials as materials
    from rubberfric import plot as plot
    from rubberfric import roughness as roughness
    from rubberfric.analysis import FrictionMap as FrictionMap
    from rubberfric.analysis import friction_map as friction_map
    from rubberfric.applications import grip as grip
    from rubberfric.base import units as units
    from rubberfric.base.checks import UnitWarning as UnitWarning
    from rubberfric.base.compilation import compilation_cache as compilation_cache
    from rubberfric.base.progress import progress as progress
    from rubberfric.base.quadrature import Quadrature as Quadrature
    from rubberfric.io import load_scene as load_scene
    from rubberfric.io import save_scene as save_scene
    from rubberfric.materials import WLF as WLF
    from rubberfric.materials import Arrhenius as Arrhenius
    from rubberfric.materials import Coating as Coating
    from rubberfric.materials import Elastic as Elastic
    from rubberfric.materials import Entropic as Entropic
    from rubberfric.materials import Prony as Prony
    from rubberfric.materials import PronyShear as PronyShear
    from rubberfric.materials import Rigid as Rigid
    from rubberfric.materials import Slab as Slab
    from rubberfric.materials import TabulatedModulus as TabulatedModulus
    from rubberfric.materials import TabulatedShift as TabulatedShift
    from rubberfric.materials import TabulatedVertical as TabulatedVertical
    from rubberfric.materials import complex_modulus as complex_modulus
    from rubberfric.roughness import Anisotropic as Anisotropic
    from rubberfric.roughness import SelfAffine as SelfAffine
    from rubberfric.roughness import TabulatedAnisotropic as TabulatedAnisotropic
    from rubberfric.roughness import TabulatedSpectrum as TabulatedSpectrum
    from rubberfric.roughness import power_spectrum as power_spectrum
    from rubberfric.roughness import rms_slope as rms_slope
    from rubberfric.roughness import with_cutoff as with_cutoff
    from rubberfric.scene import Adhesion as Adhesion
    from rubberfric.scene import Body as Body
    from rubberfric.scene import ContactShear as ContactShear
    from rubberfric.scene import Correlation as Correlation
    from rubberfric.scene import Heating as Heating
    from rubberfric.scene import MeasuredPressure as MeasuredPressure
    from rubberfric.scene import Parabolic as Parabolic
    from rubberfric.scene import Patch as Patch
    from rubberfric.scene import Scene as Scene
    from rubberfric.scene import Softening as Softening
    from rubberfric.scene import ThermalProperties as ThermalProperties
    from rubberfric.scene import Trapezoid as Trapezoid
    from rubberfric.scene import Uniform as Uniform
    from rubberfric.scene import same as same
    from rubberfric.scene import tuned as tuned
    from rubberfric.theory import Solution as Solution
    from rubberfric.theory import contact_area as contact_area
    from rubberfric.theory import friction as friction
    from rubberfric.theory import quantities_of as quantities_of
    from rubberfric.theory import separation as separation
    from rubberfric.theory import solve as solve

__version__ = VERSION

lazily(__name__, __file__, elsewhere="fitting")
