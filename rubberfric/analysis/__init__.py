"""What follows from the theory: maps, each length scale's part, the interface, power, errors."""

from rubberfric.analysis.by_wavevector import Profile, profile
from rubberfric.analysis.error_and_time.settings import quadrature_for
from rubberfric.analysis.error_and_time.sweep import accuracy
from rubberfric.analysis.extrapolation import friction_outside_table
from rubberfric.analysis.interface.adhesion import (
    AdhesionProfile,
    AdhesionVerdict,
    adhesion_matters,
    adhesion_profile,
    full_contact_energy,
    pull_off_force,
)
from rubberfric.analysis.interface.separations import SeparationProfile, separation_profile
from rubberfric.analysis.interface.stresses import contact_stiffness, stress_distribution
from rubberfric.analysis.jacobian import value_and_jacobian
from rubberfric.analysis.maps.friction_map import FrictionMap, friction_map
from rubberfric.analysis.power import DissipatedPower, dissipated_power

__all__ = [
    "AdhesionProfile",
    "AdhesionVerdict",
    "DissipatedPower",
    "FrictionMap",
    "Profile",
    "SeparationProfile",
    "accuracy",
    "adhesion_matters",
    "adhesion_profile",
    "contact_stiffness",
    "dissipated_power",
    "friction_map",
    "friction_outside_table",
    "full_contact_energy",
    "profile",
    "pull_off_force",
    "quadrature_for",
    "separation_profile",
    "stress_distribution",
    "value_and_jacobian",
]
