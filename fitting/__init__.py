"""fitting: inverse fits of rubber-friction scenes to measurements, and what the data can tell."""

from fitting import plot
from fitting.data import AreaData, FrictionData, ModulusData, SpectrumData
from fitting.data_files import read, write
from fitting.density import LogDensity, log_density
from fitting.fit import fit
from fitting.priors import Gaussian, Smooth
from fitting.prony import fit_prony
from fitting.prony_result import PronyFit
from fitting.result import FitResult
from fitting.rules import Bounded, Free, Positive, Tied
from fitting.sensitivity import sensitivity, sensitivity_names
from fitting.spectrum import fit_spectrum
from fitting.spectrum_result import SpectrumFit

__all__ = [
    "AreaData",
    "Bounded",
    "FitResult",
    "Free",
    "FrictionData",
    "Gaussian",
    "LogDensity",
    "ModulusData",
    "Positive",
    "PronyFit",
    "Smooth",
    "SpectrumData",
    "SpectrumFit",
    "Tied",
    "fit",
    "fit_prony",
    "fit_spectrum",
    "log_density",
    "plot",
    "read",
    "sensitivity",
    "sensitivity_names",
    "write",
]
