"""fitting: inverse fits of rubber-friction scenes to measurements, and what the data can tell."""

from fitting.characterise.kramers_kronig.check import kramers_kronig
from fitting.characterise.kramers_kronig.result import KramersKronig
from fitting.characterise.master_curve.fit import fit_master_curve
from fitting.characterise.master_curve.result import MasterCurve
from fitting.characterise.prony.fit import fit_prony
from fitting.characterise.prony.result import PronyFit
from fitting.characterise.softening import softening_from_sweep
from fitting.characterise.spectrum import fit_spectrum
from fitting.characterise.spectrum_result import SpectrumFit
from fitting.data.files import read, write
from fitting.data.kinds import AreaData, FrictionData, ModulusData, SpectrumData
from fitting.ensemble.members import Members, bootstrap_members, multi_start, profile_members
from fitting.ensemble.result import EnsembleResult
from fitting.ensemble.run import run_ensemble
from fitting.fit import fit
from fitting.parameters.constraints import Bounded, Free, Positive, RmsSlope, Tied
from fitting.parameters.priors import Gaussian, Smooth
from fitting.results import plot
from fitting.results.result import FitResult
from fitting.uncertainty.density import LogDensity, log_density
from fitting.uncertainty.sensitivity import sensitivity, sensitivity_names
from fitting.uncertainty.uses.design import Design, design, prediction
from fitting.uncertainty.uses.friction_table import friction_table

__all__ = [
    "AreaData",
    "Bounded",
    "Design",
    "EnsembleResult",
    "FitResult",
    "Free",
    "FrictionData",
    "Gaussian",
    "KramersKronig",
    "LogDensity",
    "MasterCurve",
    "Members",
    "ModulusData",
    "Positive",
    "PronyFit",
    "RmsSlope",
    "Smooth",
    "SpectrumData",
    "SpectrumFit",
    "Tied",
    "bootstrap_members",
    "design",
    "fit",
    "fit_master_curve",
    "fit_prony",
    "fit_spectrum",
    "friction_table",
    "kramers_kronig",
    "log_density",
    "multi_start",
    "plot",
    "prediction",
    "profile_members",
    "read",
    "run_ensemble",
    "sensitivity",
    "sensitivity_names",
    "softening_from_sweep",
    "write",
]
