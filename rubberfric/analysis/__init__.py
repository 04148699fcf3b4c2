"""What follows from the theory, and boundary elements that it is held against.

Maps, each length scale's part, the interface, power, errors against run time.
"""

from rubberfric.base.process.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.analysis.by_wavevector import Profile, profile
    from rubberfric.analysis.elements.expected import TheoryError, theory_error
    from rubberfric.analysis.elements.realisation import Surface, random_surface
    from rubberfric.analysis.elements.sliding import SlidingContact, boundary_element, sliding_contact
    from rubberfric.analysis.error_and_time.settings import quadrature_for
    from rubberfric.analysis.error_and_time.sweep import accuracy
    from rubberfric.analysis.extrapolation import friction_outside_table
    from rubberfric.analysis.interface.adhesion import (
        AdhesionProfile,
        AdhesionVerdict,
        adhesion_matters,
        adhesion_profile,
        full_contact_energy,
    )
    from rubberfric.analysis.interface.pull_off import pull_off_force
    from rubberfric.analysis.interface.separations import SeparationProfile, separation_profile
    from rubberfric.analysis.interface.stresses import contact_stiffness, stress_distribution
    from rubberfric.analysis.jacobian import value_and_jacobian
    from rubberfric.analysis.maps.friction_map import FrictionMap, friction_map
    from rubberfric.analysis.maps.friction_table import friction_table
    from rubberfric.analysis.power import DissipatedPower, dissipated_power
    from rubberfric.scene.numerics.settings import fitting_quadrature

__all__ = [
    "AdhesionProfile",
    "AdhesionVerdict",
    "DissipatedPower",
    "FrictionMap",
    "Profile",
    "SeparationProfile",
    "SlidingContact",
    "Surface",
    "TheoryError",
    "accuracy",
    "adhesion_matters",
    "adhesion_profile",
    "boundary_element",
    "contact_stiffness",
    "dissipated_power",
    "fitting_quadrature",
    "friction_map",
    "friction_outside_table",
    "friction_table",
    "full_contact_energy",
    "profile",
    "pull_off_force",
    "quadrature_for",
    "random_surface",
    "separation_profile",
    "sliding_contact",
    "stress_distribution",
    "theory_error",
    "value_and_jacobian",
]

lazily(
    __name__,
    {
        "rubberfric.analysis.by_wavevector": "Profile profile",
        "rubberfric.analysis.jacobian": "value_and_jacobian",
        "rubberfric.analysis.elements.expected": "TheoryError theory_error",
        "rubberfric.analysis.elements.realisation": "Surface random_surface",
        "rubberfric.analysis.elements.sliding": "SlidingContact boundary_element sliding_contact",
        "rubberfric.analysis.error_and_time.settings": "quadrature_for",
        "rubberfric.analysis.error_and_time.sweep": "accuracy",
        "rubberfric.analysis.extrapolation": "friction_outside_table",
        "rubberfric.analysis.interface.adhesion": (
            "AdhesionProfile AdhesionVerdict adhesion_matters adhesion_profile full_contact_energy"
        ),
        "rubberfric.analysis.interface.pull_off": "pull_off_force",
        "rubberfric.analysis.interface.separations": "SeparationProfile separation_profile",
        "rubberfric.analysis.interface.stresses": "contact_stiffness stress_distribution",
        "rubberfric.analysis.maps.friction_map": "FrictionMap friction_map",
        "rubberfric.analysis.maps.friction_table": "friction_table",
        "rubberfric.analysis.power": "DissipatedPower dissipated_power",
        "rubberfric.scene.numerics.settings": "fitting_quadrature",
    },
)
