"""What follows from the theory, and boundary elements that it is held against.

Maps, each length scale's part, the interface, power, errors against run time.
"""

from rubberfric.analysis.by_wavevector import Profile, profile
from rubberfric.analysis.elements.expected import TheoryError, theory_error
from rubberfric.analysis.elements.realisation import Surface, random_surface
from rubberfric.analysis.elements.sliding import SlidingContact, boundary_element, sliding_contact
from rubberfric.analysis.error_and_time.settings import quadrature_for
from rubberfric.analysis.error_and_time.sweep import accuracy
from rubberfric.analysis.extrapolation import friction_outside_table
from rubberfric.analysis.interface import contact_stiffness, stress_distribution
from rubberfric.analysis.jacobian import value_and_jacobian
from rubberfric.analysis.maps.friction_map import FrictionMap, friction_map
from rubberfric.analysis.power import DissipatedPower, dissipated_power
from rubberfric.analysis.separation_by_wavevector import SeparationProfile, separation_profile

__all__ = [
    "DissipatedPower",
    "FrictionMap",
    "Profile",
    "SeparationProfile",
    "SlidingContact",
    "Surface",
    "TheoryError",
    "accuracy",
    "boundary_element",
    "contact_stiffness",
    "dissipated_power",
    "friction_map",
    "friction_outside_table",
    "profile",
    "quadrature_for",
    "random_surface",
    "separation_profile",
    "sliding_contact",
    "stress_distribution",
    "theory_error",
    "value_and_jacobian",
]
