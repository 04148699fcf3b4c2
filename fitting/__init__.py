"""fitting: inverse fits of rubber-friction scenes to measurements, with uncertainties and design."""

from rubberfric.base import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from fitting.characterise.kramers_kronig import KramersKronig as KramersKronig
    from fitting.characterise.kramers_kronig import kramers_kronig as kramers_kronig
    from fitting.characterise.master_curve import MasterCurve as MasterCurve
    from fitting.characterise.master_curve import fit_master_curve as fit_master_curve
    from fitting.characterise.prony import fit_prony as fit_prony
    from fitting.characterise.prony_fit import PronyFit as PronyFit
    from fitting.characterise.softening import softening_from_sweep as softening_from_sweep
    from fitting.characterise.spectrum import SpectrumFit as SpectrumFit
    from fitting.characterise.spectrum import fit_spectrum as fit_spectrum
    from fitting.data.averages import average as average
    from fitting.data.files import read as read
    from fitting.data.files import write as write
    from fitting.data.heights import spectrum_data as spectrum_data
    from fitting.data.kinds import AreaData as AreaData
    from fitting.data.kinds import CreepData as CreepData
    from fitting.data.kinds import FrictionData as FrictionData
    from fitting.data.kinds import ModulusData as ModulusData
    from fitting.data.kinds import RelaxationData as RelaxationData
    from fitting.data.kinds import SpectrumData as SpectrumData
    from fitting.data.slip import MomentData as MomentData
    from fitting.data.slip import SlipData as SlipData
    from fitting.ensemble.calibration import Calibration as Calibration
    from fitting.ensemble.calibration import calibration as calibration
    from fitting.ensemble.comparison import Comparison as Comparison
    from fitting.ensemble.comparison import compare as compare
    from fitting.ensemble.members import EnsembleResult as EnsembleResult
    from fitting.ensemble.members import Members as Members
    from fitting.ensemble.members import bootstrap_members as bootstrap_members
    from fitting.ensemble.members import multi_start as multi_start
    from fitting.ensemble.members import profile_members as profile_members
    from fitting.ensemble.run import run_ensemble as run_ensemble
    from fitting.fit import fit as fit
    from fitting.parameters.constraints import Bounded as Bounded
    from fitting.parameters.constraints import Free as Free
    from fitting.parameters.constraints import Positive as Positive
    from fitting.parameters.constraints import RmsSlope as RmsSlope
    from fitting.parameters.constraints import Tied as Tied
    from fitting.parameters.correlated import Correlated as Correlated
    from fitting.parameters.discrepancy import Discrepancy as Discrepancy
    from fitting.parameters.priors import Gaussian as Gaussian
    from fitting.parameters.priors import Smooth as Smooth
    from fitting.parameters.priors import Sum as Sum
    from fitting.parameters.variables import unconstrained as unconstrained
    from fitting.results import plot as plot
    from fitting.results.budget import Budget as Budget
    from fitting.results.result import FitResult as FitResult
    from fitting.results.result import friction_table as friction_table
    from fitting.results.samples import Samples as Samples
    from fitting.uncertainty.design import Design as Design
    from fitting.uncertainty.design import design as design
    from fitting.uncertainty.design import prediction as prediction
    from fitting.uncertainty.posterior import LogDensity as LogDensity
    from fitting.uncertainty.posterior import log_density as log_density
    from fitting.uncertainty.sensitivity import sensitivity as sensitivity
    from fitting.uncertainty.sensitivity import sensitivity_names as sensitivity_names

lazily(__name__, __file__)
