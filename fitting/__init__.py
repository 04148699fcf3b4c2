"""fitting: inverse fits of rubber-friction scenes to measurements, and what the data can tell."""

from rubberfric.base import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
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
    from fitting.ensemble.calibration import calibration
    from fitting.ensemble.calibration_result import Calibration
    from fitting.ensemble.comparison import Comparison, compare
    from fitting.ensemble.members import Members, bootstrap_members, multi_start, profile_members
    from fitting.ensemble.result import EnsembleResult
    from fitting.ensemble.run import run_ensemble
    from fitting.fit import fit
    from fitting.parameters.constraints import Bounded, Free, Positive, RmsSlope, Tied
    from fitting.parameters.discrepancy import Discrepancy
    from fitting.parameters.priors.correlated import Correlated
    from fitting.parameters.priors.gaussian import Gaussian
    from fitting.parameters.priors.smooth import Smooth
    from fitting.parameters.priors.sums import Sum
    from fitting.results import plot
    from fitting.results.result import FitResult
    from fitting.results.samples import Samples
    from fitting.uncertainty.density import LogDensity, log_density
    from fitting.uncertainty.sensitivity import sensitivity, sensitivity_names
    from fitting.uncertainty.uses.design import Design, design, prediction
    from fitting.uncertainty.uses.friction_table import friction_table

__all__ = [
    "AreaData",
    "Bounded",
    "Calibration",
    "Comparison",
    "Correlated",
    "Design",
    "Discrepancy",
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
    "Samples",
    "Smooth",
    "SpectrumData",
    "SpectrumFit",
    "Sum",
    "Tied",
    "bootstrap_members",
    "calibration",
    "compare",
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

lazily(
    __name__,
    {
        "fitting.characterise.kramers_kronig.check": "kramers_kronig",
        "fitting.characterise.kramers_kronig.result": "KramersKronig",
        "fitting.characterise.master_curve.fit": "fit_master_curve",
        "fitting.characterise.master_curve.result": "MasterCurve",
        "fitting.characterise.prony.fit": "fit_prony",
        "fitting.characterise.prony.result": "PronyFit",
        "fitting.characterise.softening": "softening_from_sweep",
        "fitting.characterise.spectrum": "fit_spectrum",
        "fitting.characterise.spectrum_result": "SpectrumFit",
        "fitting.data.files": "read write",
        "fitting.data.kinds": "AreaData FrictionData ModulusData SpectrumData",
        "fitting.ensemble.calibration": "calibration",
        "fitting.ensemble.calibration_result": "Calibration",
        "fitting.ensemble.comparison": "Comparison compare",
        "fitting.ensemble.members": "Members bootstrap_members multi_start profile_members",
        "fitting.ensemble.result": "EnsembleResult",
        "fitting.ensemble.run": "run_ensemble",
        "fitting.fit": "fit",
        "fitting.parameters.constraints": "Bounded Free Positive RmsSlope Tied",
        "fitting.parameters.discrepancy": "Discrepancy",
        "fitting.parameters.priors.correlated": "Correlated",
        "fitting.parameters.priors.gaussian": "Gaussian",
        "fitting.parameters.priors.smooth": "Smooth",
        "fitting.parameters.priors.sums": "Sum",
        "fitting.results.result": "FitResult",
        "fitting.results.samples": "Samples",
        "fitting.uncertainty.density": "LogDensity log_density",
        "fitting.uncertainty.sensitivity": "sensitivity sensitivity_names",
        "fitting.uncertainty.uses.design": "Design design prediction",
        "fitting.uncertainty.uses.friction_table": "friction_table",
    },
    modules=("fitting.results.plot",),
)
