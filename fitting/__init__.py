"""fitting: inverse fits of rubber-friction scenes to measurements, and what the data can tell."""

from fitting import plot
from fitting.data import AreaData, FrictionData, ModulusData, SpectrumData
from fitting.data_files import read, write
from fitting.density import LogDensity, log_density
from fitting.ensemble import run_ensemble
from fitting.ensemble_result import EnsembleResult
from fitting.fit import fit
from fitting.members import Members, bootstrap_members, multi_start, profile_members
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
    "EnsembleResult",
    "FitResult",
    "Free",
    "FrictionData",
    "Gaussian",
    "LogDensity",
    "Members",
    "ModulusData",
    "Positive",
    "PronyFit",
    "Smooth",
    "SpectrumData",
    "SpectrumFit",
    "Tied",
    "bootstrap_members",
    "fit",
    "fit_prony",
    "fit_spectrum",
    "log_density",
    "multi_start",
    "plot",
    "profile_members",
    "read",
    "run_ensemble",
    "sensitivity",
    "sensitivity_names",
    "write",
]
