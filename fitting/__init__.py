"""fitting: inverse fits of rubber-friction scenes to measurements, and what the data can tell."""

from fitting.data import AreaData, FrictionData, ModulusData, SpectrumData
from fitting.data_files import read, write
from fitting.fit import fit
from fitting.priors import Gaussian, Smooth
from fitting.result import FitResult
from fitting.rules import Bounded, Free, Positive, Tied

__all__ = [
    "AreaData",
    "Bounded",
    "FitResult",
    "Free",
    "FrictionData",
    "Gaussian",
    "ModulusData",
    "Positive",
    "Smooth",
    "SpectrumData",
    "Tied",
    "fit",
    "read",
    "write",
]
