"""What follows from the theory: maps, each length scale's part, the interface, power, errors."""

from rubberfric.analysis.by_wavevector import Profile, profile
from rubberfric.analysis.error_and_time.settings import quadrature_for
from rubberfric.analysis.error_and_time.sweep import accuracy
from rubberfric.analysis.extrapolation import friction_outside_table
from rubberfric.analysis.interface import contact_stiffness, stress_distribution
from rubberfric.analysis.jacobian import value_and_jacobian
from rubberfric.analysis.maps.friction_map import FrictionMap, friction_map
from rubberfric.analysis.power import DissipatedPower, dissipated_power
from rubberfric.analysis.separation_by_wavevector import SeparationProfile, separation_profile
from rubberfric.scene.settings import fitting_quadrature

__all__ = [
    "DissipatedPower",
    "FrictionMap",
    "Profile",
    "SeparationProfile",
    "accuracy",
    "contact_stiffness",
    "dissipated_power",
    "fitting_quadrature",
    "friction_map",
    "friction_outside_table",
    "profile",
    "quadrature_for",
    "separation_profile",
    "stress_distribution",
    "value_and_jacobian",
]
